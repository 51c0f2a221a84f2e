"""PyBullet as an engine: Bullet's articulated bodies, with velocity motors on the hinges.

It steps by semi-implicit Euler alone. Its spinning friction is what a rubber ball needs.
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, lifting, links_of, principal_inertia
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, conjugate, multiply


@dataclass(frozen=True, kw_only=True)
class _BulletSettings(adapter.StepSettings):
    """Settings of a PyBullet run.

    lateral_friction: of the ball, of which Bullet takes 10 at most; spinning_friction: against
    spin, of a rubber ball alone; motor_force N m: the most that a hinge's velocity motor gives;
    damping: of all links; most_rate rad/s: at which Bullet cuts every hinge's rate.
    """

    lateral_friction: float | None = None
    spinning_friction: float | None = None
    motor_force: float = 1e3
    damping: float | None = None
    most_rate: float | None = None


class _BulletWorld(adapter.ServoWorld):
    """The ball in a client of its own."""

    def __init__(self, scene: Scene, settings: _BulletSettings, step: float) -> None:
        super().__init__(scene)
        import pybullet
        import pybullet_utils.bullet_client as client

        self.p = p = client.BulletClient(connection_mode=pybullet.DIRECT)
        self.fall(scene.gravity_at(0.0))
        p.setTimeStep(step)
        plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
        self.strength, links = settings.motor_force, links_of(scene)
        (shell, *hung), names = links, [link.name for link in links]
        moments, axes = zip(*map(principal_inertia, links), strict=True)
        self.own = axes[0]  # Bullet's base is turned into principal axes
        start = self.now
        n, sphere = len(hung), p.createCollisionShape(p.GEOM_SPHERE, radius=scene.ball.radius)
        self.ball = p.createMultiBody(
            shell.mass, sphere, basePosition=start.centre, baseOrientation=_xyzw(start.attitude),
            baseInertialFrameOrientation=_xyzw(self.own),
            linkMasses=[link.mass for link in hung], linkCollisionShapeIndices=[-1] * n,
            linkVisualShapeIndices=[-1] * n, linkPositions=[link.pivot for link in hung],
            linkOrientations=[[0, 0, 0, 1]] * n,
            linkInertialFramePositions=[link.centre for link in hung],
            linkInertialFrameOrientations=[_xyzw(each) for each in axes[1:]],
            linkParentIndices=[names.index(link.parent) for link in hung],
            linkJointTypes=[p.JOINT_REVOLUTE] * n, linkJointAxis=[link.axis for link in hung],
        )  # fmt: skip
        kinds = ("linearDamping", "angularDamping", "jointDamping")
        options = dict.fromkeys(kinds, settings.damping) | {"maxJointVelocity": settings.most_rate}
        for i, each in enumerate(moments, start=-1):
            # One option a call: of several for a link, Bullet gives some to the base in silence,
            # and the link keeps what it had (docs/findings/pybullet_change_dynamics.py).
            own = adapter.given(localInertiaDiagonal=each.tolist(), **options)
            for name, value in own.items():
                p.changeDynamics(self.ball, i, **{name: value})
        spinning = settings.spinning_friction if scene.rolling == "rubber" else None
        friction = {"lateralFriction": settings.lateral_friction, "spinningFriction": spinning}
        for name, value in adapter.given(**friction).items():
            # Bullet multiplies two bodies' coefficients: with 1 on the plane the ball's own counts.
            p.changeDynamics(plane, -1, **{name: 1.0})
            p.changeDynamics(self.ball, -1, **{name: value})
        self.friction = p.getDynamicsInfo(plane, -1)[1] * p.getDynamicsInfo(self.ball, -1)[1]
        p.resetBasePositionAndOrientation(
            self.ball, start.centre, _xyzw(multiply(start.attitude, self.own))
        )
        p.resetBaseVelocity(self.ball, start.velocity, start.turning)
        for i, rate in enumerate(start.rates.tolist()):
            p.resetJointState(self.ball, i, 0.0, rate)
        self.turn(start.rates)

    def fall(self, gravity: Array) -> None:
        self.p.setGravity(*gravity.tolist())

    def turn(self, rates: Array) -> None:
        # By motors: with resetJointState at every step the ball's path is off by 3 to 5 times its
        # length.
        self.p.setJointMotorControlArray(
            self.ball, range(len(rates)), self.p.VELOCITY_CONTROL,
            targetVelocities=rates.tolist(), forces=[self.strength] * len(rates),
        )  # fmt: skip

    def step(self, step: float) -> None:
        self.p.stepSimulation()

    def state(self) -> State:
        place, turn = self.p.getBasePositionAndOrientation(self.ball)
        velocity, turning = self.p.getBaseVelocity(self.ball)
        hinges = self.p.getJointStates(self.ball, range(len(self.scene.drives)))
        attitude = multiply(np.roll(turn, 1), conjugate(self.own))
        angles, rates = (np.array([hinge[i] for hinge in hinges]) for i in (0, 1))
        return State(
            np.array(place), np.array(velocity), attitude, np.array(turning), angles, rates
        )

    def force(self) -> Array:
        # Of each contact the normal force and two of friction, with their directions.
        contacts = self.p.getContactPoints(self.ball)
        return lifting(np.array([c[9], c[10], c[12]]) @ [c[7], c[11], c[13]] for c in contacts)


def _xyzw(q: Array) -> list[float]:
    """Return a quaternion in Bullet's order."""
    return np.roll(q, -1).tolist()


_AS_IT_COMES = _BulletSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1 / 240,
    motor_force=100.0,
)  # fmt: skip
# Friction beyond what the ball needs, 1.2; motors so strong that hinges keep their rates to 1e-7;
# and a limit far above the rotor's 148 rad/s, which the default of 100 rad/s cuts by a third. The
# solver's iterations and the contact's parameters change nothing: the error left is of the steps.
_BEST = _BulletSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, motor_force=1e9,
    lateral_friction=20.0, spinning_friction=20.0, damping=0.0, most_rate=1e6,
)  # fmt: skip

BULLET = adapter.Adapter(
    label=Label("PyBullet", adapter.version_of("pybullet"), "#E69F00", "h"),
    packages=("pybullet",),
    extra="bullet",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_BulletWorld,
    falls=True,
)
