"""DART as an engine: its bodies with velocity actuators, or its dynamics under our constraints.

Its contact has no torsional friction: a torque against the spin, ours, stands in for it. It steps
by semi-implicit Euler alone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, lifting, links_of
from robotball.motion import Label
from robotball.rotations import Array, from_matrix, rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True, kw_only=True)
class _DartSettings(adapter.PointSettings):
    """Settings of a DART run. friction: of ball and plane."""

    friction: float | None = None


def _skeleton(scene: Scene, dart: Any) -> Any:
    """Return the ball as a skeleton without collision shapes."""
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
            # The rate is then a constraint of DART's own, without a gain or an armature to choose.
            joint.setActuatorType(dart.dynamics.ActuatorType.VELOCITY)
        body.setInertia(dart.dynamics.Inertia(link.mass, link.centre, link.inertia))
        bodies[link.name] = body
    return ball


def _put(ball: Any, state: State, dart: Any) -> None:
    """Put the ball into a state. A free joint's velocities are (ω, v) in world axes."""
    place = dart.math.Isometry3()
    place.set_rotation(rotation_matrix(state.attitude))
    place.set_translation(state.centre)
    free = dart.dynamics.FreeJoint.convertToPositions(place)
    ball.setPositions(np.concatenate([free, state.angles]))
    ball.setVelocities(np.concatenate([state.turning, state.velocity, state.rates]))


class _DartWorld(adapter.ServoWorld):
    """The ball and its plane in a World."""

    def __init__(self, scene: Scene, settings: _DartSettings, step: float) -> None:
        super().__init__(scene)
        import dartpy

        self.world, self.ball = dartpy.simulation.World(), _skeleton(scene, dartpy)
        self.damping = adapter.spin_damping(scene, settings, step)
        self.world.setTimeStep(step)
        self.fall(scene.gravity_at(0.0))
        ground = dartpy.dynamics.Skeleton("ground")
        _, plane = ground.createWeldJointAndBodyNodePair()
        ground.setMobile(False)
        up, shapes = np.array([0.0, 0.0, 1.0]), dartpy.dynamics
        for body, shape in (
            (plane, shapes.PlaneShape(up, 0.0)),
            (self.ball.getBodyNode(0), shapes.SphereShape(scene.ball.radius)),
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
        self.turn(self.now.rates)

    def fall(self, gravity: Array) -> None:
        self.world.setGravity(gravity)

    def turn(self, rates: Array) -> None:
        for i, rate in enumerate(rates.tolist(), start=6):
            self.ball.setCommand(i, rate)

    def step(self, step: float) -> None:
        if self.damping:
            self._resist_spin()
        self.world.step(False)  # True would reset the commands, and the torque

    def _resist_spin(self) -> None:
        shell = self.ball.getBodyNode(0)
        shell.setExtTorque([0.0, 0.0, -self.damping * shell.getAngularVelocity()[2]], False)

    def python_seconds(self) -> float:
        torque = adapter.seconds_per_call(self._resist_spin) * self.steps if self.damping else 0.0
        return super().python_seconds() + torque

    def state(self) -> State:
        shell = self.ball.getBodyNode(0)
        place = shell.getTransform()
        q, v = self.ball.getPositions(), self.ball.getVelocities()
        turn, centre = from_matrix(np.array(place.rotation())), np.array(place.translation())
        moving, turning = shell.getLinearVelocity(), shell.getAngularVelocity()
        return State(centre, np.array(moving), turn, np.array(turning), q[6:], v[6:])

    def force(self) -> Array:
        contacts = self.world.getLastCollisionResult().getContacts()
        return lifting(np.array(each.force) for each in contacts)


class _DartDynamics(adapter.IdealWorld):
    """The skeleton's mass matrix and bias, with no contact of its own."""

    def __init__(self, scene: Scene, settings: _DartSettings, step: float) -> None:
        super().__init__(scene, settings)
        import dartpy

        self.dart, self.ball = dartpy, _skeleton(scene, dartpy)
        self.fall(scene.gravity_at(0.0))

    def fall(self, gravity: Array) -> None:
        self.ball.setGravity(gravity)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        _put(self.ball, state, self.dart)
        # DART puts a free joint's turning before its velocity.
        return adapter.velocity_first(
            self.ball.getMassMatrix(), self.ball.getCoriolisAndGravityForces()
        )


def _world(scene: Scene, settings: _DartSettings, step: float) -> adapter.World:
    return (_DartDynamics if settings.ideal else _DartWorld)(scene, settings, step)


DART = adapter.Adapter(
    label=Label("DART", adapter.version_of("dartpy"), "#8C564B", "v"),
    packages=("dartpy",),
    extra="dart",
    presets=adapter.by_name(
        _DartSettings(name="as-it-comes", error_tolerance=1e-2, timestep=1e-3, spin_part=0.0),
        # More friction than the ball needs, 1.2. What error is left is of the steps, of first
        # order.
        _DartSettings(name="best", error_tolerance=5e-2, timestep=1e-3, friction=20.0),
        # DOP853 chooses its steps itself; the timestep is only the longest.
        _DartSettings(name="ideal", error_tolerance=1e-10, timestep=1.0, ideal="DOP853"),
    ),
    world=_world,
    falls=True,
    lacks=adapter.spins,
)
