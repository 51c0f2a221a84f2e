"""DART: its bodies with velocity actuators, or its dynamics under our constraints.

DART's contact has no torsional friction; we apply a torque against spin instead. DART integrates
only with semi-implicit Euler.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball, links_of
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, from_matrix, rotation_matrix


@dataclass(frozen=True, kw_only=True)
class _DartSettings(adapter.PointSettings):
    """Settings of a DART run."""

    friction: float | None = None  # of ball and plane
    # The law of friction with NSGS. None: a box with Dantzig's solver.
    law: Literal["Coulomb", "Associated", "Box"] | None = None


def _skeleton(scene: Scene, dart: Any) -> Any:
    ball = dart.dynamics.Skeleton("ball")
    bodies: dict[str, Any] = {}
    for link in links_of(scene):
        if not link.parent:
            _, body = ball.createFreeJointAndBodyNodePair()
        else:
            properties = dart.dynamics.RevoluteJointProperties()
            properties.mName = link.name
            properties.mAxis = link.axis
            place = dart.math.Isometry3()
            place.set_translation(link.pivot)
            properties.mT_ParentBodyToJoint = place
            joint, body = ball.createRevoluteJointAndBodyNodePair(bodies[link.parent], properties)
            # DART imposes the rate as a constraint, so it needs no gain and no armature.
            joint.setActuatorType(dart.dynamics.ActuatorType.VELOCITY)
        body.setInertia(dart.dynamics.Inertia(link.mass, link.centre, link.inertia))
        body.setName(link.name)
        bodies[link.name] = body
    return ball


def _put(ball: Any, state: State, dart: Any) -> None:
    """Set the ball's state. A free joint's velocities are (ω, v) in world axes."""
    root, place = ball.getBodyNode("shell").getParentJoint(), dart.math.Isometry3()
    place.set_rotation(rotation_matrix(state.attitude))
    place.set_translation(state.centre)
    ball.setPositions(np.concatenate([root.convertToPositions(place), state.angles]))
    ball.setVelocities(np.concatenate([state.omega, state.velocity, state.rates]))


class _DartWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _DartSettings, step: float) -> None:
        super().__init__(scene)
        import dartpy

        self.ball = _skeleton(scene, dartpy)
        self.world, self.shell = dartpy.simulation.World(), self.ball.getBodyNode("shell")
        self.damping = adapter.spin_damping(scene, settings, step)
        self.world.setTimeStep(step)
        self.set_gravity(scene.gravity_at(0.0))
        if settings.law is not None:
            friction = dartpy.constraint.NsgsFrictionSolver
            options = friction.Options()
            options.law = getattr(friction.Law, settings.law)
            self.world.getConstraintSolver().setBoxedLcpSolver(friction(options))
        self.ground = ground = dartpy.dynamics.Skeleton("ground")
        joint, plane = ground.createRevoluteJointAndBodyNodePair()  # about e_z
        joint.setActuatorType(dartpy.dynamics.ActuatorType.VELOCITY)
        self.set_turn(float(scene.plane_turn.rate(0.0)))
        up, shapes = np.array([0.0, 0.0, 1.0]), dartpy.dynamics
        for body, shape in (
            (plane, shapes.PlaneShape(up, 0.0)),
            (self.shell, shapes.SphereShape(scene.ball.radius)),
        ):
            node = body.createShapeNode(shape)
            node.createCollisionAspect()
            node.createDynamicsAspect()
            if settings.friction is not None:
                node.getDynamicsAspect().setFrictionCoeff(settings.friction)
        self.friction = node.getDynamicsAspect().getFrictionCoeff()
        self.world.addSkeleton(ground)
        self.world.addSkeleton(self.ball)
        _put(self.ball, self.now, dartpy)
        self.set_rates(self.now.rates)

    def set_gravity(self, gravity: Array) -> None:
        self.world.setGravity(gravity)

    def set_turn(self, rate: float) -> None:
        self.ground.setCommand(0, rate)

    def set_rates(self, rates: Array) -> None:
        for i, rate in enumerate(rates.tolist(), start=6):
            self.ball.setCommand(i, rate)

    def step(self, step: float) -> None:
        if self.damping:
            self._resist_spin()
        self.world.step(False)  # True would reset commands and the torque

    def _resist_spin(self) -> None:
        spin = self.shell.getAngularVelocity()[2] - self.ground.getCommand(0)
        self.shell.setExtTorque([0.0, 0.0, -self.damping * spin], False)

    def python_seconds(self) -> float:
        torque = adapter.seconds_per_call(self._resist_spin) * self.steps if self.damping else 0.0
        return super().python_seconds() + torque

    def state(self) -> State:
        shell, pose = self.shell, self.shell.getTransform()
        q, v = self.ball.getPositions(), self.ball.getVelocities()
        attitude, centre = from_matrix(np.array(pose.rotation())), np.array(pose.translation())
        velocity, omega = shell.getLinearVelocity(), shell.getAngularVelocity()
        return State(centre, np.array(velocity), attitude, np.array(omega), q[6:], v[6:])

    def force(self) -> Array:
        contacts = self.world.getLastCollisionResult().getContacts()
        return force_on_ball(np.array(contact.force) for contact in contacts)


class _DartDynamics(adapter.IdealWorld):
    def __init__(self, scene: Scene, settings: _DartSettings, step: float) -> None:
        super().__init__(scene, settings)
        import dartpy

        self.dart, self.ball = dartpy, _skeleton(scene, dartpy)
        self.set_gravity(scene.gravity_at(0.0))

    def set_gravity(self, gravity: Array) -> None:
        self.ball.setGravity(gravity)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        _put(self.ball, state, self.dart)
        ball = self.ball  # a free joint's velocities are (ω, v)
        return adapter.velocity_first(ball.getMassMatrix(), ball.getCoriolisAndGravityForces())


DART = adapter.Adapter(
    label=Label("DART", adapter.version_of("dartpy"), "#8C564B", "v"),
    packages=("dartpy",),
    extra="dart",
    presets=adapter.by_name(
        _DartSettings(name="as-it-comes", error_tolerance=1e-2, timestep=1e-3, spin_part=0.0),
        # The ball needs a friction of 1.2. The remaining error comes from the first-order
        # integrator.
        _DartSettings(name="best", error_tolerance=5e-2, timestep=1e-3, friction=20.0),
        _DartSettings(name="slip", error_tolerance=5e-2, timestep=1e-3, law="Coulomb"),
        # DOP853 chooses its steps; the timestep is the longest.
        _DartSettings(name="ideal", error_tolerance=1e-10, timestep=1.0, ideal="DOP853"),
    ),
    world=adapter.either(_DartWorld, _DartDynamics),
    moves_plane=True,
    rolls_unbalanced=True,
    lacks=adapter.spins,
)
