"""Short trials of a planned run, for numbers of `limits` that no formula gives.

They are the loads and eigenvalues of MuJoCo's own model at its start, the rate at which the motors
settle with the ball rolling under them, and the momentum that RK4 loses.
"""

from dataclasses import replace

import mujoco
import numpy as np

from robotball import equations as eq
from robotball.ball import Frame, Rotor
from robotball.engines.adapter import rk4
from robotball.engines.mujoco.model import ModelHinge, build
from robotball.engines.mujoco.readings import readings_of
from robotball.engines.mujoco.settings import Settings, recipe
from robotball.engines.mujoco.stepping import controlled, read_row
from robotball.equations import Quaternion, Vector, as_vector
from robotball.motion import Loads
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Friction, MovedHinge, Scene

# The central differences' half step, a velocity [m/s or rad/s] or an angle [rad]: rounding over it
# and its own square are both far below the digits that a prediction needs.
_PUSH = 1e-6


def linearised_start(scene: Scene, settings: Settings) -> tuple[Loads, Array]:
    """Return the loads of a model's start, and its eigenvalues about it.

    The eigenvalues (2 nv - 3,) are complex [1/s]: a small deviation grows or dies out with the real
    part, and turns with the imaginary one.
    """
    # Unlimited friction, so that the loads show how much of it the motion needs.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(replace(scene, friction=Friction()), replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = readings_of(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The place on the plane changes nothing, and the height is the contact's.
        for of_angle, i in [(True, i) for i in range(3, nv)] + [(False, i) for i in range(nv)]:
            sides = []
            for push in (_PUSH, -_PUSH):
                data.qpos[:], data.qvel[:] = qpos, qvel
                if of_angle:
                    mujoco.mj_integratePos(compiled, data.qpos, np.eye(nv)[i], push)
                else:
                    data.qvel[i] += push
                mujoco.mj_forward(compiled, data)
                sides.append(data.qacc.copy())
            columns.append((sides[0] - sides[1]) / (2 * _PUSH))
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # A deviation of attitude is measured in axes that turn with the shell.
    turning[:3, :3] = -np.cross(qvel[3:6], np.eye(3)).T  # -ω×
    return loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T]))


_SEEN = 8  # angles of the pendulums at which the motors' rates are evaluated, 45° apart


def fastest_rate(scene: Scene, hinges: tuple[ModelHinge, ...]) -> float:
    """Return the largest |λ| [1/s] of the hinges' motors about the start, with the ball rolling.

    H du/dt = -C u - K φ for the turning u of the shell and of the hinges that have a motor, where
    C holds its damping or gain and K its stiffness, and those of the actuators; H is the part of
    the robot's mass matrix that is left once the shell rolls, and once the other hinges keep their
    rates. Where there are pendulums, the largest over eight angles that they pass. At least one
    hinge has such a motor.
    """
    own = [each for each in hinges if each.settles]
    gamma = rotation_matrix(scene.start.attitude)[2]
    # Rubber does not spin about the vertical, so the shell turns in the plane across γ alone.
    turns = np.linalg.svd(gamma[None])[2][1:] if scene.rolling == "rubber" else np.eye(3)
    angles = np.stack([_angles(scene, each) for each in scene.hinges], axis=1)
    still, upright = np.zeros_like(angles), np.tile(gamma, (_SEEN, 1))
    stands = scene.robot.states(upright, angles, np.zeros_like(upright), still)
    rows = [0, 1, 2, *(3 + each.index for each in own)]
    free, n = len(turns), len(own)
    onto = np.zeros((free + n, 3 + n))
    onto[:free, :3], onto[free:, 3:] = turns, np.eye(n)
    laws = [each.law for each in own if each.law]
    stiffness, damping = map(np.diag, np.array([(law.per_angle, law.per_rate) for law in laws]).T)
    for actuator in scene.actuators:
        gears = dict(actuator.gears)
        ratios = np.array([gears.get(each.of.name, 0.0) for each in own])
        stiffness = stiffness + actuator.law.per_angle * np.outer(ratios, ratios)
        damping = damping + actuator.law.per_rate * np.outer(ratios, ratios)
    worst = 0.0
    for matrix in stands.matrix.transpose(2, 0, 1):
        H = onto @ matrix[np.ix_(rows, rows)] @ onto.T
        back = np.linalg.solve(H, np.eye(free + n)[:, free:])
        # Of first order in (φ, u): springs act by the hinges' angles, dampers by their rates.
        system = np.zeros((2 * n + free, 2 * n + free))
        system[:n, n + free :] = np.eye(n)
        system[n:, :n], system[n:, n + free :] = -back @ stiffness, -back @ damping
        worst = max(worst, float(np.abs(np.linalg.eigvals(system)).max()))
    return worst


def _angles(scene: Scene, hinge: MovedHinge) -> Array:
    """Return the hinge's angles (SEEN,) [rad]: as it is commanded, or else a whole turn."""
    if isinstance(dict(scene.ball.named_bodies)[hinge.name], Frame | Rotor):
        return np.full(_SEEN, hinge.angle)
    times = np.linspace(0.0, scene.duration, _SEEN - 1)
    moved = [(1.0, hinge.motor.law, hinge.command)] if hinge.motor else []
    for actuator, command in zip(scene.actuators, scene.controls, strict=True):
        moved += [(ratio, actuator.law, command) for n, ratio in actuator.gears if n == hinge.name]
    for ratio, law, command in moved:
        if law.per_command and ratio and law.per_angle:
            to = law.per_command / law.per_angle / ratio
            return np.array([hinge.angle, *(to * command.rate(times))])
        if law.per_command and ratio and law.per_rate:
            to = law.per_command / law.per_rate / ratio
            return hinge.angle + np.array([0.0, *(to * command.angle(times))])
    return hinge.angle + np.linspace(0.0, 2 * np.pi, _SEEN, endpoint=False)


_MOST_STEPS = 500  # of a trial; the loss of a longer run is extrapolated in proportion


def momentum_loss(scene: Scene, turning: Array, timestep: float, duration: float) -> float:
    """Estimate how much momentum RK4 loses over a duration [s], relative to the scene's scale.

    turning: of the shell at the start (3,), principal axes [rad/s]. The unreduced equations
    (2.4)-(2.5) are integrated by RK4 in the variables that MuJoCo uses: the velocity of the root,
    the shell, in its own axes. In the frame's axes RK4 errs differently, by up to 300 times less.
    Takes some 60 ms. Infinite where the steps diverge.
    """
    count = duration / timestep
    steps = int(min(np.ceil(count), _MOST_STEPS))
    ball = _Ball(scene, turning)
    try:
        with np.errstate(all="ignore"):
            lost = _loss(ball, timestep, steps)
    except ArithmeticError:  # a number beyond the largest
        return np.inf
    return lost / scene.momentum_scale * max(1.0, count / steps) if lost < np.inf else np.inf


class _Ball:
    """The rolling ball by (2.4)-(2.5) in MuJoCo's variables.

    Its state (7,) is the shell's turning u in the shell's axes, then its quaternion.
    """

    def __init__(self, scene: Scene, turning: Array) -> None:
        self.scene, self.rubber = scene, scene.rolling == "rubber"
        self.axis = as_vector(scene.principal_axes.T @ scene.ball.shell.axis)
        self.inertia = scene.principal_axes.T @ scene.ball.gyrostatic_inertia
        self.I, self.d = as_vector(scene.ball.principal[0]), scene.ball.d
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        self.start = np.array([*turning, *attitude])

    def drives(self, t: float) -> tuple[float, Array, Array]:
        """Return the frame's angle on the shell, and the hinges' rates and accelerations."""
        drives = self.scene.drives
        rates = np.array([float(drive.rate(t)) for drive in drives])
        changes = np.array([float(drive.acceleration(t)) for drive in drives])
        return float(drives[0].angle(t)), rates, changes

    def rate(self, t: float, state: Array) -> Array:
        """Return d/dt of the state by (2.4)-(2.5)."""
        angle, rates, changes = self.drives(t)
        u, q = _parts(state)
        Omega, Omega_rate = eq.scale(rates[0], self.axis), eq.scale(changes[0], self.axis)
        omega, attitude = self._of_frame(u, q, angle, Omega)
        acceleration, _ = eq.full_angular_acceleration(
            omega,
            eq.space_axes(attitude)[2],
            Omega,
            Omega_rate,
            as_vector(self.inertia @ rates),
            as_vector(self.inertia @ changes),
            self.I,
            self.d,
            self.rubber,
        )
        # Of ω - Ω, which turns with the frame about the shell's axis.
        change = eq.subtract(acceleration, Omega_rate)
        change = eq.add(change, eq.cross(Omega, eq.subtract(omega, Omega)))
        return np.array([*_turned(self.axis, angle, change), *eq.attitude_rate(q, u)])

    def momentum(self, t: float, state: Array) -> Array:
        """Return M (3,) in world axes."""
        angle, rates, _ = self.drives(t)
        Omega = eq.scale(rates[0], self.axis)
        omega, attitude = self._of_frame(*_parts(state), angle, Omega)
        axes = eq.space_axes(attitude)
        k = as_vector(self.inertia @ rates)
        K = eq.subtract(k, eq.scale(self.d, Omega))
        L = eq.contact_angular_momentum(omega, axes[2], Omega, K, self.I, self.d)
        M = eq.cross(axes[2], L) if self.rubber else L
        return np.array([eq.dot(axis, M) for axis in axes])

    def _of_frame(
        self, u: Vector, q: Quaternion, angle: float, Omega: Vector
    ) -> tuple[Vector, Quaternion]:
        """Return ω in frame axes, and the frame's quaternion."""
        sine = np.sin(angle / 2)
        turn = (np.cos(angle / 2), *eq.scale(sine, self.axis))
        return eq.add(_turned(self.axis, -angle, u), Omega), eq.quaternion_product(q, turn)


def _loss(ball: _Ball, dt: float, steps: int) -> float:
    """Return the largest change of M over the steps [kg m²/s]."""
    state, M, worst = ball.start, ball.momentum(0.0, ball.start), 0.0
    for i in range(steps):
        state = rk4(ball.rate, i * dt, state, dt)
        lost = float(np.linalg.norm(ball.momentum(i * dt + dt, state) - M))
        if not np.isfinite(lost):
            return np.inf
        worst = max(worst, lost)
    return worst


def _parts(state: Array) -> tuple[Vector, Quaternion]:
    """Split the state into the shell's turning and quaternion."""
    p, q, r, w, x, y, z = state.tolist()
    return (p, q, r), (w, x, y, z)


def _turned(axis: Vector, angle: float, v: Vector) -> Vector:
    """Turn v about a unit axis by Rodrigues' formula."""
    along = (1 - np.cos(angle)) * eq.dot(axis, v)
    across = eq.scale(np.sin(angle), eq.cross(axis, v))
    return eq.add(eq.add(eq.scale(np.cos(angle), v), across), eq.scale(along, axis))
