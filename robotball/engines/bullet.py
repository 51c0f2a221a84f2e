"""PyBullet: Bullet's articulated bodies, with velocity motors on the hinges.

PyBullet integrates only with semi-implicit Euler. Its spinning friction is used for the rubber
model.
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball, links_of, principal_inertia
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, conjugate, multiply, rotation_matrix


@dataclass(frozen=True, kw_only=True)
class _BulletSettings(adapter.StepSettings):
    """Settings of a PyBullet run."""

    friction: float | None = None  # of the ball; Bullet limits it to 10
    torsional: float | None = None  # m, against spin; for rubber balls only
    motor_force: float = 1e3  # N m, largest torque of a hinge's velocity motor
    damping: float | None = None  # of all links
    most_rate: float | None = None  # rad/s, at which Bullet clips hinge rates


class _BulletWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _BulletSettings, step: float) -> None:
        super().__init__(scene)
        import pybullet
        import pybullet_utils.bullet_client as client

        self.p = p = client.BulletClient(connection_mode=pybullet.DIRECT)
        self.set_gravity(scene.gravity_at(0.0))
        p.setTimeStep(step)
        self.plane = plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
        self.strength, links = settings.motor_force, links_of(scene)
        (shell, *hung), names = links, [link.name for link in links]
        moments, axes = zip(*map(principal_inertia, links), strict=True)
        self.principal = axes[0]  # Bullet's base frame has the principal axes
        start = self.now
        n, sphere = len(hung), p.createCollisionShape(p.GEOM_SPHERE, radius=scene.ball.radius)
        self.ball = p.createMultiBody(
            shell.mass, sphere, basePosition=start.centre, baseOrientation=_xyzw(start.attitude),
            baseInertialFramePosition=shell.centre,
            baseInertialFrameOrientation=_xyzw(self.principal),
            linkMasses=[link.mass for link in hung], linkCollisionShapeIndices=[-1] * n,
            linkVisualShapeIndices=[-1] * n, linkPositions=[link.pivot for link in hung],
            linkOrientations=[[0, 0, 0, 1]] * n,
            linkInertialFramePositions=[link.centre for link in hung],
            linkInertialFrameOrientations=[_xyzw(q) for q in axes[1:]],
            linkParentIndices=[names.index(link.parent) for link in hung],
            linkJointTypes=[p.JOINT_REVOLUTE] * n, linkJointAxis=[link.axis for link in hung],
        )  # fmt: skip
        kinds = ("linearDamping", "angularDamping", "jointDamping")
        options = dict.fromkeys(kinds, settings.damping) | {"maxJointVelocity": settings.most_rate}
        for i, diagonal in enumerate(moments, start=-1):
            # One option per call: given several for a link, Bullet silently applies some to the
            # base instead (docs/findings/pybullet_change_dynamics.py).
            dynamics = adapter.without_none(localInertiaDiagonal=diagonal.tolist(), **options)
            for name, value in dynamics.items():
                p.changeDynamics(self.ball, i, **{name: value})
        spinning = settings.torsional if scene.rolling == "rubber" else None
        friction = {"lateralFriction": settings.friction, "spinningFriction": spinning}
        for name, value in adapter.without_none(**friction).items():
            # Bullet multiplies the friction of both bodies, and the spinning friction of each by
            # the friction of the other: 1 and 0 on the plane keep the ball's coefficients.
            p.changeDynamics(plane, -1, lateralFriction=1.0)
            p.changeDynamics(self.ball, -1, **{name: value})
        self.friction = p.getDynamicsInfo(plane, -1)[1] * p.getDynamicsInfo(self.ball, -1)[1]
        # The base's frame is at its centre of mass.
        self.offset, lever = shell.centre, rotation_matrix(start.attitude) @ shell.centre
        p.resetBasePositionAndOrientation(
            self.ball, start.centre + lever, _xyzw(multiply(start.attitude, self.principal))
        )
        p.resetBaseVelocity(self.ball, start.velocity + np.cross(start.omega, lever), start.omega)
        for i, rate in enumerate(start.rates.tolist()):
            p.resetJointState(self.ball, i, 0.0, rate)
        self.set_rates(start.rates)
        self.set_turn(float(scene.plane_turn.rate(0.0)))

    def set_gravity(self, gravity: Array) -> None:
        self.p.setGravity(*gravity.tolist())

    def set_turn(self, rate: float) -> None:
        self.p.resetBaseVelocity(self.plane, [0.0] * 3, [0.0, 0.0, rate])

    def set_rates(self, rates: Array) -> None:
        # Resetting the joint states at every step instead gives a path error of 300 to 500 %.
        self.p.setJointMotorControlArray(
            self.ball, range(len(rates)), self.p.VELOCITY_CONTROL,
            targetVelocities=rates.tolist(), forces=[self.strength] * len(rates),
        )  # fmt: skip

    def step(self, step: float) -> None:
        self.p.stepSimulation()

    def state(self) -> State:
        position, quaternion = self.p.getBasePositionAndOrientation(self.ball)
        velocity, omega = self.p.getBaseVelocity(self.ball)
        hinges = self.p.getJointStates(self.ball, range(len(self.scene.drives))) or ()
        attitude = multiply(np.roll(quaternion, 1), conjugate(self.principal))
        angles, rates = (np.array([hinge[i] for hinge in hinges], float) for i in (0, 1))
        lever = rotation_matrix(attitude) @ self.offset
        velocity = velocity - np.cross(omega, lever)
        return State(position - lever, velocity, attitude, np.array(omega), angles, rates)

    def force(self) -> Array:
        # For each contact: the normal and two friction directions, with their forces.
        points = self.p.getContactPoints(self.ball)
        return force_on_ball(np.array([c[9], c[10], c[12]]) @ [c[7], c[11], c[13]] for c in points)


def _xyzw(q: Array) -> list[float]:
    """Return a quaternion in Bullet's order (x, y, z, w)."""
    return np.roll(q, -1).tolist()


_AS_IT_COMES = _BulletSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1 / 240,
    motor_force=100.0,
)  # fmt: skip
# The ball needs a friction of 1.2. The motors keep hinge rates to 1e-7. The rate limit is far above
# the rotor's 148 rad/s; the default of 100 rad/s would clip a third. Solver iterations and contact
# parameters change nothing: the remaining error comes from the integrator.
_BEST = _BulletSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, motor_force=1e9,
    friction=20.0, torsional=20.0, damping=0.0, most_rate=1e6,
)  # fmt: skip

BULLET = adapter.Adapter(
    label=Label("PyBullet", adapter.version_of("pybullet"), "#E69F00", "h"),
    packages=("pybullet",),
    extra="bullet",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_BulletWorld,
    moves_plane=True,
    rolls_unbalanced=True,
    resists_spin=True,
)
