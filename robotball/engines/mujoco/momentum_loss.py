"""What RK4's steps take of M, measured on the equations: the same integrator on the same variables.

A contact that holds leaves (2.4)-(2.5), which MuJoCo integrates as the velocity of the root, the
shell, in its own axes. In the frame's axes RK4 errs otherwise, by up to 300 times less.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from robotball import equations as eq
from robotball.engines.mujoco.planned_run import PlannedRun
from robotball.equations import Quaternion, Vector
from robotball.parameters import as_vector
from robotball.rotations import Array, multiply

MOST_STEPS = 500  # that are taken; what more of them take is in proportion


def measured_loss(plan: PlannedRun) -> float:
    """The largest change of M over the scene's scale that RK4 makes by the end of the plan.

    Takes some 60 ms. Infinite where the steps diverge.
    """
    count = plan.duration / plan.timestep
    steps = int(min(np.ceil(count), MOST_STEPS))
    ball = _Ball(plan)
    try:
        with np.errstate(all="ignore"):
            lost = _loss(ball, plan.timestep, steps)
    except ArithmeticError:  # a number beyond the largest
        return np.inf
    return lost / plan.scene.momentum_scale * max(1.0, count / steps) if lost < np.inf else np.inf


class _Ball:
    """The rolling ball by the shell's turning u in the shell's axes and its quaternion, (7,)."""

    def __init__(self, plan: PlannedRun) -> None:
        scene = plan.scene
        self.scene, self.rubber = scene, scene.rolling == "rubber"
        self.axis = as_vector(scene.principal_axes.T @ scene.ball.shell.axis)
        self.inertia = scene.principal_axes.T @ scene.ball.gyrostatic_inertia
        self.I, self.d = as_vector(scene.ball.principal[0]), scene.ball.d
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        shell = plan.angular_velocity - plan.Omega
        self.start = np.array([*shell, *attitude])

    @cached_property
    def drives(self) -> Callable[[float], tuple[float, Array, Array]]:
        """The frame's angle on the shell, and the hinges' rates and accelerations, at a time."""
        drives = self.scene.drives

        def told(t: float) -> tuple[float, Array, Array]:
            rates = np.array([float(drive.rate(t)) for drive in drives])
            changes = np.array([float(drive.acceleration(t)) for drive in drives])
            return float(drives[0].angle(t)), rates, changes

        if not self.scene.steady:
            return told
        _, rates, changes = told(0.0)
        return lambda t: (rates[0] * t, rates, changes)

    def rate(self, t: float, state: Array) -> Array:
        """d/dt of the state by (2.4)-(2.5)."""
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
        """M (3,) in world axes."""
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
        """ω in frame axes, and the frame's quaternion."""
        sine = np.sin(angle / 2)
        turn = (np.cos(angle / 2), *eq.scale(sine, self.axis))
        return eq.add(_turned(self.axis, -angle, u), Omega), eq.quaternion_product(q, turn)


def _loss(ball: _Ball, dt: float, steps: int) -> float:
    """The largest change of |M| over the steps [kg m²/s]."""
    state, M, worst = ball.start, ball.momentum(0.0, ball.start), 0.0
    for i in range(steps):
        t = i * dt
        k1 = ball.rate(t, state)
        k2 = ball.rate(t + dt / 2, state + dt / 2 * k1)
        k3 = ball.rate(t + dt / 2, state + dt / 2 * k2)
        k4 = ball.rate(t + dt, state + dt * k3)
        state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        lost = float(np.linalg.norm(ball.momentum(t + dt, state) - M))
        if not np.isfinite(lost):
            return np.inf
        worst = max(worst, lost)
    return worst


def _parts(state: Array) -> tuple[Vector, Quaternion]:
    p, q, r, w, x, y, z = state.tolist()
    return (p, q, r), (w, x, y, z)


def _turned(axis: Vector, angle: float, v: Vector) -> Vector:
    """v turned about a unit axis by Rodrigues' formula."""
    along = (1 - np.cos(angle)) * eq.dot(axis, v)
    across = eq.scale(np.sin(angle), eq.cross(axis, v))
    return eq.add(eq.add(eq.scale(np.cos(angle), v), across), eq.scale(along, axis))
