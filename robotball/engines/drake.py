"""Drake as an engine: its plant in steps or continuous time, or its dynamics by our constraints.

Point contact has no torsional friction: a torque against the spin, ours, stands in for it. What
friction lets slip is set by the stiction tolerance, not by the step.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, lifting, links_of, start_state
from robotball.motion import Label
from robotball.rotations import Array
from robotball.scene import Scene

# Of the radius, where the search for the depth at rest begins, and its steps at most: the load is a
# smooth function of the depth, and the search ends by itself after fewer.
_FIRST_DEPTH, _SECANTS = 1e-3, 8
_Integrator = Literal[
    "runge_kutta3", "radau3", "implicit_euler", "velocity_implicit_euler", "cenic"
]


@dataclass(frozen=True, kw_only=True)
class _DrakeSettings(adapter.PointSettings):
    """Settings of a Drake run.

    approximation: of the contact in discrete steps; integrator: for continuous time instead, where
    the approximation says nothing and the timestep is the longest step, or every step without
    error_control; accuracy_per_step: of that control, and of Newton's iteration in implicit steps;
    stiction m/s: the slip below which friction is not full; gain N m s/rad: of velocity servos on
    the hinges; armature kg m²: reflected inertia instead of servos.
    """

    approximation: Literal["sap", "lagged", "similar"] | None = None
    integrator: _Integrator | None = None
    accuracy_per_step: float | None = None
    error_control: bool = True
    stiction: float | None = None
    friction: float = 1.0
    gain: float | None = None
    armature: float | None = None


def _add_plant(
    scene: Scene, settings: _DrakeSettings, builder: Any, step: float, depth: float = 0.0
) -> Any:
    """Return the plant of the ball, pressed into the plane by `depth` [m]; step 0 is continuous."""
    from pydrake.geometry import HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody import plant as plants
    from pydrake.multibody import tree

    plant, _ = plants.AddMultibodyPlantSceneGraph(builder, time_step=step)
    if settings.approximation is not None and step:
        of = f"k{settings.approximation.capitalize()}"
        plant.set_discrete_contact_approximation(getattr(plants.DiscreteContactApproximation, of))
    bodies: dict[str, Any] = {}
    for link in links_of(scene):
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        central = tree.RotationalInertia(xx, yy, zz, xy, xz, yz)
        inertia = tree.SpatialInertia.MakeFromCentralInertia(link.mass, link.centre, central)
        bodies[link.name] = plant.AddRigidBody(link.name, inertia)
        if not link.parent:
            continue
        parent = bodies[link.parent].body_frame()
        place = tree.FixedOffsetFrame(f"{link.name}_hinge", parent, RigidTransform(link.pivot))
        ends = plant.AddFrame(place), bodies[link.name].body_frame()
        hinge = plant.AddJoint(tree.RevoluteJoint(link.name, *ends, link.axis))
        motor = plant.AddJointActuator(link.name, hinge)
        if settings.armature is not None:
            motor.set_default_rotor_inertia(settings.armature)
            motor.set_default_gear_ratio(1.0)
        else:
            motor.set_controller_gains(tree.PdControllerGains(p=0.0, d=settings.gain))
    friction = plants.CoulombFriction(settings.friction, settings.friction)
    # Equally stiff, the two meet in the middle of their overlap, which must be at height 0: the
    # lever arm of friction is otherwise off, by 9e-6 m.
    ground = HalfSpace.MakePose(np.array([0, 0, 1.0]), np.array([0, 0, depth / 2]))
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "plane", friction)
    sphere = Sphere(scene.ball.radius + depth / 2)
    plant.RegisterCollisionGeometry(bodies["shell"], RigidTransform(), sphere, "sphere", friction)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -scene.gravity])
    plant.Finalize()
    if settings.stiction is not None:
        plant.set_stiction_tolerance(settings.stiction)
    return plant


def _positions(state: State) -> tuple[Array, Array]:
    """Return Drake's q and v."""
    q = np.concatenate([state.attitude, state.centre, state.angles])
    return q, np.concatenate([state.turning, state.velocity, state.rates])


def _carrying_depth(scene: Scene, settings: _DrakeSettings) -> float:
    """Return the depth at which the contact carries the ball's weight [m], by secants."""
    from pydrake.systems.framework import DiagramBuilder

    def fall(depth: float) -> float:
        builder = DiagramBuilder()
        plant = _add_plant(scene, replace(settings, gain=None, armature=0.0), builder, 0.0, depth)
        diagram = builder.Build()
        root = diagram.CreateDefaultContext()
        context = plant.GetMyMutableContextFromRoot(root)
        plant.get_actuation_input_port().FixValue(context, np.zeros(len(scene.drives)))
        resting = start_state(scene)
        plant.SetPositions(context, _positions(resting)[0])
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        return float(rates[plant.num_positions() + 5])

    low, high = 0.0, _FIRST_DEPTH * scene.ball.radius
    at_low, at_high = fall(low), fall(high)
    for _ in range(_SECANTS):
        if at_high == at_low or abs(at_high) < 1e-12 * scene.gravity:
            break
        low, high = high, high - at_high * (high - low) / (at_high - at_low)
        at_low, at_high = at_high, fall(high)
    return high


def _motors(scene: Scene, armature: float | None) -> Any:
    """Return a system that drives the motors: torques for armatures, or angles and rates."""
    from pydrake.systems.framework import LeafSystem
    from pydrake.systems.primitives import ConstantVectorSource

    drives = scene.drives

    def inputs(t: float) -> Array:
        if armature is not None:
            return np.array([armature * drive.acceleration(t) for drive in drives], float)
        return np.array([*np.zeros(len(drives)), *(drive.rate(t) for drive in drives)], float)

    if scene.steady:
        return ConstantVectorSource(inputs(0.0))  # saves the calls into Python at every step
    system = LeafSystem()

    def output(context: Any, port: Any) -> None:
        port.SetFromVector(inputs(context.get_time()))

    system.DeclareVectorOutputPort("inputs", len(inputs(0.0)), output)
    return system


def _against_spin(plant: Any, damping: float) -> Any:
    """Return a system that puts the torque -damping (ω, e_z) on the shell."""
    from pydrake.common.value import Value
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.plant import ExternallyAppliedSpatialForce
    from pydrake.systems.framework import LeafSystem

    system, n = LeafSystem(), plant.num_multibody_states()
    port, first = system.DeclareVectorInputPort("state", n), plant.num_positions()
    force = ExternallyAppliedSpatialForce()
    force.body_index = plant.GetBodyByName("shell").index()

    def torque(context: Any, output: Any) -> None:
        spin = port.Eval(context)[first + 2]
        force.F_Bq_W = SpatialForce(np.array([0.0, 0.0, -damping * spin]), np.zeros(3))
        output.set_value([force])

    system.DeclareAbstractOutputPort("torque", lambda: Value([force]), torque)
    return system


class _DrakeWorld(adapter.World):
    """The plant in a Simulator, which steps it in C++ from sample to sample."""

    def __init__(self, scene: Scene, settings: _DrakeSettings, step: float) -> None:
        super().__init__(scene)
        from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
        from pydrake.systems.framework import DiagramBuilder

        builder, self.friction = DiagramBuilder(), settings.friction
        discrete = settings.integrator is None
        depth = 0.0 if discrete else _carrying_depth(scene, settings)
        self.plant = plant = _add_plant(scene, settings, builder, step if discrete else 0.0, depth)
        motors = builder.AddSystem(_motors(scene, settings.armature))
        only = plant.GetModelInstanceByName("DefaultModelInstance")
        takes = plant.get_actuation_input_port()
        if settings.armature is None:
            takes = plant.get_desired_state_input_port(only)
        builder.Connect(motors.get_output_port(0), takes)
        if damping := adapter.spin_damping(scene, settings, step):
            torque = builder.AddSystem(_against_spin(plant, damping))
            builder.Connect(plant.get_state_output_port(), torque.get_input_port(0))
            builder.Connect(torque.get_output_port(0), plant.get_applied_spatial_force_input_port())
        self.simulator = Simulator(builder.Build())
        if not discrete:
            config = SimulatorConfig(integration_scheme=settings.integrator, max_step_size=step)
            if settings.accuracy_per_step is not None:
                config.accuracy = settings.accuracy_per_step
            ApplySimulatorConfig(config, self.simulator)
            # Set here, not by the config, which forgets the accuracy of equal steps and leaves
            # Drake's own of 1e-3 in its place (docs/findings/drake_fixed_accuracy.py).
            self.simulator.get_mutable_integrator().set_fixed_step_mode(not settings.error_control)
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        q, v = _positions(self.now)
        plant.SetPositions(self.context, q)
        plant.SetVelocities(self.context, v)
        self.simulator.Initialize()

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        simulator = self.simulator
        self.longest = adapter.longest_step(self.scene, times, timestep)
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
        return lifting(each.contact_force() for each in contacts)

    def python_seconds(self) -> float:
        """Return NaN: Drake itself calls our torque and motors, so their time is unknown."""
        return float("nan")


class _DrakeDynamics(adapter.IdealWorld):
    """The plant's mass matrix and bias, with no contact of its own."""

    def __init__(self, scene: Scene, settings: _DrakeSettings, step: float) -> None:
        super().__init__(scene, settings)
        from pydrake.systems.framework import DiagramBuilder

        builder = DiagramBuilder()
        self.plant = _add_plant(scene, settings, builder, 0.0)
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        plant, context = self.plant, self.context
        plant.SetPositionsAndVelocities(context, np.concatenate(_positions(state)))
        h = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        return adapter.velocity_first(plant.CalcMassMatrix(context), h)


_AS_IT_COMES = _DrakeSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-3, gain=1.0,
    spin_part=0.0,
)  # fmt: skip
# Servos turn the hinges: beside the armature that does so in continuous time, these contacts freeze
# all velocities, in silence (docs/findings/drake_frozen.py). A lower gain lets the hinges lag: at
# 1e4 N m s/rad by 5e-4 of their rates.
_DISCRETE = _DrakeSettings(
    name="discrete", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3,
    approximation="lagged", friction=20.0, gain=1e6,
)  # fmt: skip
# RADAU in equal steps. Under error control they shrink to 2e-5 s where friction passes zero, and
# what Newton's tolerance leaves of each adds up. The stiction tolerance sets the error: it falls to
# a tenth from 1e-3 to 1e-4 m/s, and at 3e-5 the run does not end. At a spin damping of 1e4 N m s,
# 30 times inertia over step, the spin that it lets through was most of the error.
_BEST = replace(
    _DISCRETE, name="best", error_tolerance=1e-3, approximation=None, integrator="radau3",
    accuracy_per_step=1e-8, error_control=False, stiction=1e-4, spin_part=3e3, gain=None,
    armature=1e12,
)  # fmt: skip
# DOP853 chooses its steps itself; the timestep is only the longest.
_IDEAL = _DrakeSettings(
    name="ideal", error_tolerance=1e-10, timestep=1.0, armature=0.0, ideal="DOP853"
)


def _world(scene: Scene, settings: _DrakeSettings, step: float) -> adapter.World:
    return (_DrakeDynamics if settings.ideal else _DrakeWorld)(scene, settings, step)


DRAKE = adapter.Adapter(
    label=Label("Drake", adapter.version_of("drake"), "#009E73", "s"),
    packages=("pydrake",),
    extra="drake",
    presets=adapter.by_name(_AS_IT_COMES, _DISCRETE, _BEST, _IDEAL),
    world=_world,
    lacks=adapter.spins,
)
