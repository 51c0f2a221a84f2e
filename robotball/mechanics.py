"""The mechanics of any robot that rolls in a shell, once, in plain arithmetic.

There is nothing in the formulas but ``+ - * /`` on scalars, as in equations.py, so that the same
functions run on floats, on NumPy columns and inside numba. Vectors are 3-tuples in frame axes, but
velocities and accelerations are rates in space. Row 0 of the bodies is the shell, row 1 the frame,
the others are hinged on the frame; hinge j turns body j + 1. Arrays that end in `...` have there
the shape of the scalars, () or (n,); those that are named last are written.

u = (ω_s, Ω, φ̇): the shell's angular velocity, then the rates of the hinges. (L, h) = 𝓜u: the
angular momentum about the contact point, then the momenta along the hinges.

In order: rows of numbers, where bodies are, 𝓜 and the momenta's rates, forces by Newton and Euler,
𝓜u = (L, h) solved where some rates are given and the shell may not turn as it likes; then a robot
and n of its states as columns: gamma (n, 3) in frame axes; angles and rates (n, h) of the hinges,
as in `Scene.hinges` [rad, rad/s]; omega (n, 3) of the frame, in frame axes [rad/s]. SI units.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from robotball.equations import Rolling, Scalar, Vector, add, cross, dot, scale, subtract
from robotball.robot import Ball, Frame
from robotball.rotations import Array, rotation_matrix

_Numbers = Any  # an array, or its row

# Bodies are rows of numbers and no records: numba and columns take them as one array.
# A body's row: as it is at its hinge's angle 0.
_MASS, _CENTRE, _AXIS, _PIVOT, _INERTIA, _ARMATURE, _ROW = 0, 1, 4, 7, 10, 19, 20
# A placed body's row: its centre of mass from the sphere's centre and from its hinge's pivot, its
# tensor about it.
_FROM_CENTRE, _ARM, _TENSOR, PLACED = 0, 3, 6, 15
# A moving body's row: its angular velocity, and its centre of mass's velocity.
TURNING, _VELOCITY, MOVING = 0, 3, 6


def vector(row: _Numbers, at: int) -> Vector:
    """Return three numbers of a row."""
    return (row[at], row[at + 1], row[at + 2])


def put(row: _Numbers, at: int, v: Vector) -> None:
    """Write a vector into a row."""
    row[at] = v[0]
    row[at + 1] = v[1]
    row[at + 2] = v[2]


def _applied(row: _Numbers, at: int, v: Vector) -> Vector:
    """Return the tensor that a row holds, times v."""
    return (
        dot(vector(row, at), v),
        dot(vector(row, at + 3), v),
        dot(vector(row, at + 6), v),
    )


def _turned(v: Vector, axis: Vector, cosine: Scalar, sine: Scalar) -> Vector:
    """Return v turned about a unit vector, by Rodrigues' formula."""
    along = scale((1 - cosine) * dot(axis, v), axis)
    return add(add(scale(cosine, v), scale(sine, cross(axis, v))), along)


def place(bodies: _Numbers, cosines: _Numbers, sines: _Numbers, placed: _Numbers) -> None:
    """Write where the bodies are, placed (b, PLACED, ...), for the cosines and sines (h, ...)."""
    for b in range(len(bodies)):
        body, row = bodies[b], placed[b]
        axis, pivot = vector(body, _AXIS), vector(body, _PIVOT)
        arm = subtract(vector(body, _CENTRE), pivot)
        if b < 2:  # the axes are the frame's own, and the shell is symmetric about its hinge
            put(row, _ARM, arm)
            for k in range(0, 9, 3):
                put(row, _TENSOR + k, vector(body, _INERTIA + k))
        else:
            c, s = cosines[b - 1], sines[b - 1]
            put(row, _ARM, _turned(arm, axis, c, s))
            # QJ, column by column, and then (QJ)Qᵀ, row by row; J is symmetric, so its rows are its
            # columns.
            x = _turned(vector(body, _INERTIA), axis, c, s)
            y = _turned(vector(body, _INERTIA + 3), axis, c, s)
            z = _turned(vector(body, _INERTIA + 6), axis, c, s)
            put(row, _TENSOR, _turned((x[0], y[0], z[0]), axis, c, s))
            put(row, _TENSOR + 3, _turned((x[1], y[1], z[1]), axis, c, s))
            put(row, _TENSOR + 6, _turned((x[2], y[2], z[2]), axis, c, s))
        put(row, _FROM_CENTRE, add(pivot, vector(row, _ARM)))


def mass_matrix(
    bodies: _Numbers, placed: _Numbers, radius: float, gamma: Vector, matrix: _Numbers
) -> None:
    """Write 𝓜 (3 + h, 3 + h, ...): u·𝓜u/2 is the kinetic energy, with that of the armatures."""
    matrix[:] = 0.0
    e = vector(bodies[1], _AXIS)
    for b in range(len(bodies)):
        row, m = placed[b], bodies[b][_MASS]
        r = vector(row, _FROM_CENTRE)
        # From the shell's point at the contact, which has no velocity.
        x = add(r, scale(radius, gamma))
        m_x_x = m * dot(x, x)
        for i in range(3):
            for j in range(3):
                matrix[i, j] += row[_TENSOR + 3 * i + j] - m * x[i] * x[j]
            matrix[i, i] += m_x_x
        if b > 0:
            _add_hinge(row, m, x, e, cross(e, r), 3, matrix)
        if b > 1:
            n = vector(bodies[b], _AXIS)
            by_n = cross(n, vector(row, _ARM))
            _add_hinge(row, m, x, n, by_n, 2 + b, matrix)
            shared = dot(e, _applied(row, _TENSOR, n)) + m * dot(cross(e, r), by_n)
            matrix[3, 2 + b] += shared
            matrix[2 + b, 3] += shared
        if b > 0:  # a motor's rotor, behind its gear, counts for the rate of its hinge alone
            matrix[2 + b, 2 + b] += bodies[b][_ARMATURE]


def _add_hinge(
    row: _Numbers, m: float, x: Vector, axis: Vector, velocity: Vector, at: int, matrix: _Numbers
) -> None:
    """Add a body's part of one hinge to 𝓜; at unit rate the hinge gives the body `velocity`."""
    spin = _applied(row, _TENSOR, axis)
    momentum = add(spin, scale(m, cross(x, velocity)))
    for i in range(3):
        matrix[i, at] += momentum[i]
        matrix[at, i] += momentum[i]
    matrix[at, at] += dot(axis, spin) + m * dot(velocity, velocity)


def move(
    bodies: _Numbers, placed: _Numbers, radius: float, gamma: Vector, u: _Numbers, moving: _Numbers
) -> None:
    """Write how the bodies move, moving (b, MOVING, ...), by u (3 + h, ...)."""
    e, shell = vector(bodies[1], _AXIS), vector(u, 0)
    frame = add(shell, scale(u[3], e))
    of_centre = scale(radius, cross(shell, gamma))
    for b in range(len(bodies)):
        row = placed[b]
        if b == 0:  # turns about its centre, whose velocity the contact gives
            put(moving[b], TURNING, shell)
            put(moving[b], _VELOCITY, add(of_centre, cross(shell, vector(row, _FROM_CENTRE))))
            continue
        turning = frame if b == 1 else add(frame, scale(u[2 + b], vector(bodies[b], _AXIS)))
        of_pivot = add(of_centre, cross(frame, vector(bodies[b], _PIVOT)))
        put(moving[b], TURNING, turning)
        put(moving[b], _VELOCITY, add(of_pivot, cross(turning, vector(row, _ARM))))


def momentum_rates(
    bodies: _Numbers,
    placed: _Numbers,
    moving: _Numbers,
    radius: float,
    gamma: Vector,
    gravity: Vector,
    rates: _Numbers,
) -> None:
    """Write the rates of (L, h) in space (3 + h, ...) without the torques of motors and plane.

    L̇ = Ṡ×v + (S + maγ)×G,  ḣ_0 = (ω×e, N′) + (e, Σ′ m v_b×v + m r_b×G),
    ḣ_i = (ω×n, N) + (n, m v_i×(v + ω×p) + m ρ×G).
    """
    e, shell = vector(bodies[1], _AXIS), vector(moving[0], TURNING)
    omega = vector(moving[1], TURNING)
    v, e_rate = scale(radius, cross(shell, gamma)), cross(omega, e)
    L_rate, h_rate = scale(0.0, gamma), 0.0 * gamma[0]
    for b in range(len(bodies)):
        row, m, axis = placed[b], bodies[b][_MASS], vector(bodies[b], _AXIS)
        r, v_b = vector(row, _FROM_CENTRE), vector(moving[b], _VELOCITY)
        # Ṡ×v = Σ m v_b×v, for v×v = 0.
        carried = add(cross(v_b, v), cross(r, gravity))
        L_rate = add(L_rate, scale(m, add(carried, cross(scale(radius, gamma), gravity))))
        spin = _applied(row, _TENSOR, vector(moving[b], TURNING))
        if b > 0:
            N = add(spin, scale(m, cross(r, v_b)))
            h_rate = h_rate + dot(e_rate, N) + m * dot(e, carried)
        if b > 1:
            rho = vector(row, _ARM)
            N = add(spin, scale(m, cross(rho, v_b)))
            of_pivot = add(v, cross(omega, vector(bodies[b], _PIVOT)))
            around = add(cross(v_b, of_pivot), cross(rho, gravity))
            rates[2 + b] = dot(cross(omega, axis), N) + m * dot(axis, around)
    put(rates, 0, L_rate)
    rates[3] = h_rate


def needed(
    bodies: _Numbers,
    placed: _Numbers,
    moving: _Numbers,
    radius: float,
    gamma: Vector,
    gravity: Vector,
    u: _Numbers,
    u_rate: _Numbers,
    torques: _Numbers,
) -> Vector:
    """Write the torques that give u a rate in space (3 + h, ...), by Newton and Euler.

    torques (3 + h, ...): that of the plane about the contact point, then those of the motors.
    Returns the plane's force [N]. In space n has the rate ω×n, so a hinge gives φ̈n + φ̇ω×n.
    """
    e, shell = vector(bodies[1], _AXIS), vector(moving[0], TURNING)
    omega = vector(moving[1], TURNING)
    shell_rate = vector(u_rate, 0)
    frame_rate = add(shell_rate, add(scale(u_rate[3], e), scale(u[3], cross(omega, e))))
    of_centre = scale(radius, cross(shell_rate, gamma))
    force, torque = scale(0.0, gamma), scale(0.0, gamma)
    torques[3] = bodies[1][_ARMATURE] * u_rate[3]
    for b in range(len(bodies)):
        row, m = placed[b], bodies[b][_MASS]
        axis, pivot = vector(bodies[b], _AXIS), vector(bodies[b], _PIVOT)
        turning, rate, of_pivot = shell, shell_rate, of_centre
        if b > 0:
            turning, rate = vector(moving[b], TURNING), frame_rate
            of_pivot = add(of_centre, _acceleration(frame_rate, omega, pivot))
        if b > 1:
            own = add(scale(u_rate[2 + b], axis), scale(u[2 + b], cross(omega, axis)))
            rate = add(frame_rate, own)
        r, rho = vector(row, _FROM_CENTRE), vector(row, _ARM)
        a_b = add(of_pivot, _acceleration(rate, turning, rho))
        f = scale(m, subtract(a_b, gravity))
        spin_rate = add(
            _applied(row, _TENSOR, rate), cross(turning, _applied(row, _TENSOR, turning))
        )
        about_centre = add(spin_rate, cross(r, f))
        force, torque = add(force, f), add(torque, about_centre)
        if b > 0:
            torques[3] += dot(e, about_centre)
        if b > 1:
            own_torque = dot(axis, add(spin_rate, cross(rho, f)))
            torques[2 + b] = own_torque + bodies[b][_ARMATURE] * u_rate[2 + b]
    put(torques, 0, add(torque, cross(scale(radius, gamma), force)))
    return force


def _acceleration(rate: Vector, turning: Vector, r: Vector) -> Vector:
    """Return the acceleration of a point r of a turning body against its origin's."""
    return add(cross(rate, r), cross(turning, cross(turning, r)))


def _solve(matrix: _Numbers, given: _Numbers, right: _Numbers, u: _Numbers) -> None:
    """Solve 𝓜u = right for u (k, c, ...) in the rows that are not given (k,); the others stay.

    Gaussian elimination. 𝓜 is positive definite, so that no rows need to be exchanged.
    """
    k, columns = right.shape[0], right.shape[1]
    left = np.copy(matrix)
    for i in range(k):
        if not given[i]:
            for c in range(columns):
                u[i, c] = right[i, c]
                for j in range(k):
                    if given[j]:
                        u[i, c] -= matrix[i, j] * u[j, c]
    for i in range(k):
        for j in range(i + 1, k):
            # Rows and columns of given rates are passed over; to cut them out would take new arrays
            # at every evaluation of compiled code.
            if not (given[i] or given[j]):
                factor = left[j, i] / left[i, i]
                for l in range(i + 1, k):
                    left[j, l] -= factor * left[i, l]
                for c in range(columns):
                    u[j, c] -= factor * u[i, c]
    for i in range(k - 1, -1, -1):
        if not given[i]:
            for c in range(columns):
                for j in range(i + 1, k):
                    if not given[j]:
                        u[i, c] -= left[i, j] * u[j, c]
                u[i, c] = u[i, c] / left[i, i]


def solve_rolling(
    matrix: _Numbers, given: _Numbers, directions: _Numbers, right: _Numbers, u: _Numbers
) -> None:
    """Solve as `_solve` for u (k, 1, ...), with torques along D_k (c, 3, ...) for (D_k, ω_s) = 0.

    The torques are Lagrange multipliers: u is that of no torque and that of each torque of unit
    size, added so that the constraints hold. For momenta as the right side they are the parts of L
    along D_k, which M does not have.
    """
    k, count = len(matrix), len(directions)
    columns = np.zeros_like(matrix[:, : 1 + count])
    answers = np.zeros_like(columns)
    for i in range(k):
        columns[i, 0] = right[i, 0]
        answers[i, 0] = u[i, 0]
    for c in range(count):
        for i in range(3):
            columns[i, 1 + c] = directions[c, i]
    _solve(matrix, given, columns, answers)
    small = np.zeros_like(matrix[:count, :count])
    off = np.zeros_like(matrix[:count, :1])
    torques = np.zeros_like(off)
    for c in range(count):
        for i in range(3):
            off[c, 0] -= directions[c, i] * answers[i, 0]
            for other in range(count):
                small[c, other] += directions[c, i] * answers[i, 1 + other]
    _solve(small, np.zeros(count, dtype=np.bool_), off, torques)
    for i in range(k):
        u[i, 0] = answers[i, 0]
        for c in range(count):
            u[i, 0] += torques[c, 0] * answers[i, 1 + c]


@dataclass(frozen=True)
class Robot:
    """The numbers of a ball's bodies, in rows (b, ROW) as the formulas take them, and a [m]."""

    bodies: Array
    radius: float

    @property
    def hinges(self) -> int:
        return len(self.bodies) - 1

    @property
    def mass(self) -> float:
        return float(self.bodies[:, _MASS].sum())

    def states(self, gamma: Array, angles: Array, omega: Array, rates: Array) -> "States":
        """Return the robot in n states of motion."""
        axis = self.bodies[0, _AXIS:_PIVOT, None]
        u = np.concatenate([omega.T - rates[:, 0] * axis, rates.T])
        placed = self.placed(angles)
        moving = np.empty((len(self.bodies), MOVING, len(gamma)))
        move(self.bodies, placed, self.radius, tuple(gamma.T), u, moving)
        return States(self, gamma.T, placed, u, moving)

    def placed(self, angles: Array) -> Array:
        """Return where the bodies are at angles (n, h): (b, PLACED, n), in frame axes."""
        placed = np.empty((len(self.bodies), PLACED, len(angles)))
        place(self.bodies, np.cos(angles.T), np.sin(angles.T), placed)
        return placed

    def angular_velocity(
        self, gamma: Array, angles: Array, M: Array, rates: Array, rolling: Rolling
    ) -> Array:
        """Return ω (n, 3) of the frame from the momentum M (n, 3), both in frame axes."""
        k = 3 + self.hinges
        given = np.arange(k) > 2
        matrix, right = np.empty((k, k, len(gamma))), np.zeros((k, 1, len(gamma)))
        mass_matrix(self.bodies, self.placed(angles), self.radius, tuple(gamma.T), matrix)
        # M is γ×L in the rubber model, so L is M×γ but for its part along γ, which `solve_rolling`
        # finds from the shell's not turning about γ.
        right[:3, 0] = (np.cross(M, gamma) if rolling == "rubber" else M).T
        u = np.zeros_like(right)
        u[3:, 0] = rates.T
        fixed = gamma.T[None] if rolling == "rubber" else np.empty((0, 3, len(gamma)))
        solve_rolling(matrix, given, fixed, right, u)
        axis = self.bodies[0, _AXIS:_PIVOT]
        return u[:3, 0].T + np.outer(rates[:, 0], axis)


def robot_of(ball: Ball, armatures: tuple[float, ...] = ()) -> Robot:
    """Return a ball's robot; armatures [kg m²] of its hinges, 0 where none are given."""
    rows = np.zeros((len(ball.named_bodies), _ROW))
    for row, (_, body) in zip(rows, ball.named_bodies, strict=True):
        row[_MASS] = body.mass
        row[_CENTRE:_AXIS] = body.centre
        row[_AXIS:_PIVOT] = ball.shell.axis if isinstance(body, Frame) else body.axis
        row[_INERTIA:_ARMATURE] = body.inertia.ravel()
    for row, rotor in zip(rows[2:], ball.rotors, strict=False):
        row[_PIVOT:_INERTIA] = rotor.centre
    for row, pendulum in zip(rows[2 + len(ball.rotors) :], ball.pendulums, strict=True):
        row[_PIVOT:_INERTIA] = pendulum.pivot
    if armatures:
        rows[1:, _ARMATURE] = armatures
    return Robot(rows, ball.radius)


@dataclass(frozen=True)
class States:
    """States of a robot in motion, n of them, which the last index of an array counts.

    gamma (3, n), placed (b, PLACED, n), u (3 + h, n), moving (b, MOVING, n).
    """

    robot: Robot
    gamma: Array
    placed: Array
    u: Array
    moving: Array

    @cached_property
    def matrix(self) -> Array:
        """𝓜 (3 + h, 3 + h, n)."""
        matrix = np.empty((len(self.u), *self.u.shape))
        mass_matrix(self.robot.bodies, self.placed, self.robot.radius, tuple(self.gamma), matrix)
        return matrix

    @cached_property
    def momenta(self) -> Array:
        """(L, h) (3 + h, n): about the contact point, in frame axes, and along the hinges."""
        return np.asarray((self.matrix * self.u).sum(axis=1))

    def momentum(self, rolling: Rolling) -> Array:
        """Return M (n, 3) in frame axes: γ×L in the rubber model, L in the classical one."""
        L = self.momenta[:3]
        return (np.cross(self.gamma, L, axis=0) if rolling == "rubber" else L).T

    @property
    def kinetic_energy(self) -> Array:
        """The kinetic energy (n,), with that of the armatures [J]."""
        return np.asarray((self.u * self.momenta).sum(axis=0) / 2)

    @property
    def centre_of_mass(self) -> Array:
        """The centre of mass (n, 3) from the centre of the sphere, frame axes [m]."""
        masses = self.robot.bodies[:, _MASS]
        return np.asarray(np.einsum("b,bin->ni", masses, self.placed[:, :3])) / self.robot.mass

    @property
    def turning(self) -> Array:
        """The bodies' angular velocities (b, n, 3), frame axes [rad/s]."""
        return self.moving[:, TURNING:_VELOCITY].transpose(0, 2, 1)

    @property
    def velocities(self) -> Array:
        """The velocities (b, n, 3) of the bodies' centres of mass, frame axes [m/s]."""
        return self.moving[:, _VELOCITY:].transpose(0, 2, 1)


def momentum_at(
    ball: Ball, rolling: Rolling, attitude: Array, omega: Array, angles: Array, rates: Array
) -> Array:
    """Return M (3,) in world axes of a ball in one state [kg m²/s].

    attitude (4,), frame to world; omega (3,) of the frame, in frame axes [rad/s]; angles and rates
    (h,) of the hinges [rad, rad/s]. In the rubber model the shell must not spin.
    """
    to_world = rotation_matrix(attitude)
    one = robot_of(ball).states(to_world[None, 2], angles[None], omega[None], rates[None])
    return np.asarray(to_world @ one.momentum(rolling)[0])
