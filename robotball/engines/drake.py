"""Drake: its plant in discrete or continuous time, or its dynamics under our constraints.

Point contact has no torsional friction; we apply a torque against spin instead. The stiction
tolerance, not the step, determines how much the contact slips.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from robotball.engines import adapter
from robotball.engines.observe import depth_at_rest
from robotball.engines.states import State, force_on_ball, links_of, start_state
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array

_FIRST_DEPTH, _DEPTH_ERROR = 1e-3, 1e-12  # radii, in the search for the depth at rest


@dataclass(frozen=True, kw_only=True)
class _DrakeSettings(adapter.PointSettings):
    """Settings of a Drake run; time is discrete without an `integrator`; timestep: the longest."""

    approximation: Literal["sap", "lagged", "similar"] | None = None
    integrator: str | None = None  # Drake's name, such as "radau3"
    accuracy_per_step: float | None = None  # of error control and Newton's iteration
    error_control: bool = True
    stiction: float | None = None  # m/s, slip speed at which friction is full
    friction: float = 1.0
    gain: float | None = None  # N m s/rad, of velocity servos on the hinges
    armature: float | None = None  # kg m², reflected inertia of the hinges, in place of servos


def _add_plant(
    scene: Scene, settings: _DrakeSettings, builder: Any, step: float, depth: float = 0.0
) -> Any:
    """Return the ball's plant, pressed into the plane by `depth` [m]; step 0 is continuous."""
    from pydrake.geometry import HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody import plant as plants
    from pydrake.multibody import tree

    plant, _ = plants.AddMultibodyPlantSceneGraph(builder, time_step=step)
    if settings.approximation is not None and step:
        name = f"k{settings.approximation.capitalize()}"
        plant.set_discrete_contact_approximation(getattr(plants.DiscreteContactApproximation, name))
    bodies: dict[str, Any] = {}
    for link in links_of(scene):
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        central = tree.RotationalInertia(xx, yy, zz, xy, xz, yz)
        inertia = tree.SpatialInertia.MakeFromCentralInertia(link.mass, link.centre, central)
        bodies[link.name] = plant.AddRigidBody(link.name, inertia)
        if not link.parent:
            continue
        parent = bodies[link.parent].body_frame()
        offset = tree.FixedOffsetFrame(f"{link.name}_hinge", parent, RigidTransform(link.pivot))
        ends = plant.AddFrame(offset), bodies[link.name].body_frame()
        hinge = plant.AddJoint(tree.RevoluteJoint(link.name, *ends, link.axis))
        motor = plant.AddJointActuator(link.name, hinge)
        if settings.armature is not None:
            motor.set_default_rotor_inertia(settings.armature)
            motor.set_default_gear_ratio(1.0)
        else:
            motor.set_controller_gains(tree.PdControllerGains(p=0.0, d=settings.gain))
    friction = plants.CoulombFriction(settings.friction, settings.friction)
    # Two equally stiff bodies touch in the middle of their overlap. The middle must be at height 0:
    # otherwise friction's lever arm is wrong by 9e-6 m.
    ground = HalfSpace.MakePose(np.array([0, 0, 1.0]), np.array([0, 0, depth / 2]))
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "plane", friction)
    sphere = Sphere(scene.ball.radius + depth / 2)
    plant.RegisterCollisionGeometry(bodies["shell"], RigidTransform(), sphere, "sphere", friction)
    plant.mutable_gravity_field().set_gravity_vector(scene.gravity_at(0.0))
    plant.Finalize()
    if settings.stiction is not None:
        plant.set_stiction_tolerance(settings.stiction)
    return plant


def _coordinates(state: State) -> Array:
    q = (state.attitude, state.centre, state.angles)
    return np.concatenate([*q, state.omega, state.velocity, state.rates])


def _alone(scene: Scene, settings: _DrakeSettings, depth: float = 0.0) -> tuple[Any, Any, Any]:
    """Return a plant in continuous time, its context, and the owners of the two."""
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant = _add_plant(scene, settings, builder, 0.0, depth)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return plant, plant.GetMyMutableContextFromRoot(root), (diagram, root)


def _carrying_depth(scene: Scene, settings: _DrakeSettings) -> float:
    """Return the depth at which the contact carries the ball's weight [m]."""
    at_rest, a = _coordinates(start_state(scene)), scene.ball.radius

    def vertical_acceleration(depth: float) -> float:
        plant, context, _living = _alone(scene, replace(settings, gain=None, armature=0.0), depth)
        plant.get_actuation_input_port().FixValue(context, np.zeros(len(scene.drives)))
        q = plant.num_positions()
        at_rest[q:] = 0.0
        plant.SetPositionsAndVelocities(context, at_rest)
        return float(plant.EvalTimeDerivatives(context).CopyToVector()[q + 5])

    return depth_at_rest(vertical_acceleration, 0.0, _FIRST_DEPTH * a, _DEPTH_ERROR * a)


def _motors(scene: Scene, armature: float | None) -> Any:
    """Return a system with the motors' inputs: torques for armatures, else angles and rates."""
    from pydrake.systems.framework import LeafSystem
    from pydrake.systems.primitives import ConstantVectorSource

    drives = scene.drives

    def inputs(t: float) -> Array:
        if armature is not None:
            return np.array([armature * drive.acceleration(t) for drive in drives], float)
        return np.array([*np.zeros(len(drives)), *(drive.rate(t) for drive in drives)], float)

    if scene.steady:
        return ConstantVectorSource(inputs(0.0))  # saves a call into Python at every step
    system = LeafSystem()

    def output(context: Any, port: Any) -> None:
        port.SetFromVector(inputs(context.get_time()))

    system.DeclareVectorOutputPort("inputs", len(inputs(0.0)), output)
    return system


def _against_spin(plant: Any, damping: float) -> Any:
    """Return a system that computes the torque -damping (ω, e_z) on the shell from the state."""
    from pydrake.systems.primitives import MatrixGain

    D = np.zeros((plant.num_velocities(), plant.num_multibody_states()))
    D[2, plant.num_positions() + 2] = -damping  # v begins with the shell's ω, in world axes
    return MatrixGain(D)


class _DrakeWorld(adapter.World):
    """The plant in a Simulator, which steps it in C++ between sample times."""

    def __init__(self, scene: Scene, settings: _DrakeSettings, step: float) -> None:
        super().__init__(scene)
        from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
        from pydrake.systems.framework import DiagramBuilder

        builder, self.friction, self.longest = DiagramBuilder(), settings.friction, step
        discrete = settings.integrator is None
        depth = 0.0 if discrete else _carrying_depth(scene, settings)
        self.plant = plant = _add_plant(scene, settings, builder, step if discrete else 0.0, depth)
        motors = builder.AddSystem(_motors(scene, settings.armature))
        only = plant.GetModelInstanceByName("DefaultModelInstance")
        port = plant.get_actuation_input_port()
        if settings.armature is None:
            port = plant.get_desired_state_input_port(only)
        builder.Connect(motors.get_output_port(0), port)
        if damping := adapter.spin_damping(scene, settings, step):
            torque = builder.AddSystem(_against_spin(plant, damping))
            builder.Connect(plant.get_state_output_port(), torque.get_input_port(0))
            port = plant.get_applied_generalized_force_input_port()
            builder.Connect(torque.get_output_port(0), port)
        self.simulator = Simulator(builder.Build())
        if not discrete:
            config = SimulatorConfig(integration_scheme=settings.integrator, max_step_size=step)
            if settings.accuracy_per_step is not None:
                config.accuracy = settings.accuracy_per_step
            ApplySimulatorConfig(config, self.simulator)
            # ApplySimulatorConfig ignores the accuracy of equal steps and leaves Drake's default of
            # 1e-3 (docs/findings/drake_fixed_accuracy.py).
            self.simulator.get_mutable_integrator().set_fixed_step_mode(not settings.error_control)
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        plant.SetPositionsAndVelocities(self.context, _coordinates(self.now))
        self.simulator.Initialize()

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        simulator = self.simulator
        for t in times[1:].tolist():
            simulator.AdvanceTo(t)
            self.steps = max(simulator.get_num_steps_taken(), simulator.get_num_discrete_updates())
            yield self._state

    def _state(self) -> State:
        q, v = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
        return State(q[4:7], v[3:6], q[:4], v[:3], q[7:], v[6:])

    def force(self) -> Array:
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        contacts = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
        return force_on_ball(contact.contact_force() for contact in contacts)

    def python_seconds(self) -> float:
        """Return 0, or NaN if rates change: Drake then calls our function within its steps."""
        return 0.0 if self.scene.steady else float("nan")


class _DrakeDynamics(adapter.IdealWorld):
    def __init__(self, scene: Scene, settings: _DrakeSettings, step: float) -> None:
        super().__init__(scene, settings)
        self.plant, self.context, self.living = _alone(scene, settings)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        plant, context = self.plant, self.context
        plant.SetPositionsAndVelocities(context, _coordinates(state))
        h = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        return adapter.velocity_first(plant.CalcMassMatrix(context), h)


_AS_IT_COMES = _DrakeSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-3, gain=1.0,
    spin_part=0.0,
)  # fmt: skip
# Servos, because these contacts silently freeze all velocities beside the armature of "best"
# (docs/findings/drake_frozen.py). With a lower gain the hinges lag: with 1e4 N m s/rad by 5e-4 of
# their rates.
_DISCRETE = _DrakeSettings(
    name="discrete", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3,
    approximation="lagged", friction=20.0, gain=1e6,
)  # fmt: skip
# RADAU with equal steps. With error control, steps shrink to 2e-5 s when friction passes zero, and
# the errors of Newton's iteration add up. The error depends on the stiction tolerance: 1e-4 instead
# of 1e-3 m/s divides it by 10, and at 3e-5 the run does not finish. With a spin damping of 1e4 N m
# s, 30 times inertia / step, the remaining spin causes most of the error.
_BEST = replace(
    _DISCRETE, name="best", error_tolerance=1e-3, approximation=None, integrator="radau3",
    accuracy_per_step=1e-8, error_control=False, stiction=1e-4, spin_part=3e3, gain=None,
    armature=1e12,
)  # fmt: skip
# DOP853 chooses its steps; the timestep is the longest.
_IDEAL = _DrakeSettings(
    name="ideal", error_tolerance=1e-10, timestep=1.0, armature=0.0, ideal="DOP853"
)


DRAKE = adapter.Adapter(
    label=Label("Drake", adapter.version_of("drake"), "#009E73", "s"),
    packages=("pydrake",),
    extra="drake",
    presets=adapter.by_name(_AS_IT_COMES, _DISCRETE, _BEST, _IDEAL),
    world=adapter.either(_DrakeWorld, _DrakeDynamics),
    rolls_unbalanced=True,
    lacks=adapter.spins,
)
