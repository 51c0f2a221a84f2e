"""The mechanics of a tree of bodies that rolls in a shell, in plain arithmetic.

The formulas use scalars, like those of formulas.py, so the same functions run on floats, on NumPy
columns and inside numba. Vectors are 3-tuples in the axes of one body of the tree, its carrier,
but velocities and accelerations are rates in space; positions are from the sphere's centre. Row 0
of the bodies is the shell. Every other body is joined to its parent, which has a lower row, by a
hinge or a slide: joint j moves body j + 1. Arrays that end in `...` have the shape of the scalars
there, () or (n,). Functions write into their last array arguments.

u = (ω_s, q̇): the shell's angular velocity, then the rates of the joints. The columns of a body give
its motion, ω_b = Σ t_k u_k and v_b = Σ s_k u_k (Kane's partial velocities). (L, h) = 𝓜u: the
angular momentum about the contact point, then the momenta along the joints.

`States` has n states of a `Robot` as columns: gamma (n, 3) in the carrier's axes; angles and rates
(n, h) of the joints [rad, rad/s; m, m/s for slides]; omega (n, 3) of the carrier, in its axes
[rad/s]. SI units.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from robotball.robot.ball import Ball
from robotball.robot.formulas import Rolling, Scalar, Vector, add, cross, dot, scale, subtract
from robotball.rotations import Array

_Numbers = Any  # an array, or its row

# Bodies are rows of one array, for numba and for columns.
# Row of a body at joint angles 0, in axes that all bodies then share.
_MASS, _CENTRE, _AXIS, _PIVOT, _INERTIA, _ARMATURE = 0, 1, 4, 7, 10, 19
_PARENT, _SLIDES, _ROW = 20, 21, 22
# Row of a placed body: its centre of mass, its tensor about it, the axis of its joint, the pivot,
# and the rows of its rotation from joint angles 0.
_FROM_CENTRE, _TENSOR, _ALONG, _AT, _ROTATION, PLACED = 0, 3, 12, 15, 18, 27
# Column of a body for a component of u: angular velocity and velocity of the centre of mass.
_TURN, _MOVE, COLUMN = 0, 3, 6
# Row of a moving body: angular velocity, velocity of the centre of mass, and the rates of both.
TURNING, _VELOCITY, _TURNING_RATE, _ACCELERATION, MOVING = 0, 3, 6, 9, 12
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def vector(row: _Numbers, at: int) -> Vector:
    """Return three numbers of a row."""
    return (row[at], row[at + 1], row[at + 2])


def put(row: _Numbers, at: int, v: Vector) -> None:
    """Write a vector into a row."""
    row[at] = v[0]
    row[at + 1] = v[1]
    row[at + 2] = v[2]


def _applied(row: _Numbers, at: int, v: Vector) -> Vector:
    """Return the matrix in a row times v."""
    return (
        dot(vector(row, at), v),
        dot(vector(row, at + 3), v),
        dot(vector(row, at + 6), v),
    )


def _turned(v: Vector, axis: Vector, cosine: Scalar, sine: Scalar) -> Vector:
    """Return v rotated about a unit vector, with the formula of Rodrigues."""
    along = scale((1 - cosine) * dot(axis, v), axis)
    return add(add(scale(cosine, v), scale(sine, cross(axis, v))), along)


def place(bodies: _Numbers, carrier: int, angles: _Numbers, placed: _Numbers) -> None:
    """Write the placed bodies (b, PLACED, ...) for joint angles (h, ...)."""
    # From the carrier back along its joints to the shell: the rows of the shell's rotation are the
    # carrier's axes in the shell.
    x, y, z = _X, _Y, _Z
    b = carrier
    while b > 0:
        if bodies[b][_SLIDES] == 0:
            axis, angle = vector(bodies[b], _AXIS), angles[b - 1]
            cosine, sine = np.cos(angle), np.sin(angle)
            x = _turned(x, axis, cosine, sine)
            y = _turned(y, axis, cosine, sine)
            z = _turned(z, axis, cosine, sine)
        b = int(bodies[b][_PARENT])
    put(placed[0], _ROTATION, x)
    put(placed[0], _ROTATION + 3, y)
    put(placed[0], _ROTATION + 6, z)
    # Zero times a vector has the shape of the scalars; a literal zero does not.
    put(placed[0], _AT, scale(0.0, x))
    for b in range(len(bodies)):
        body, row = bodies[b], placed[b]
        if b > 0:
            p = int(body[_PARENT])
            parent, angle = placed[p], angles[b - 1]
            axis = _applied(parent, _ROTATION, vector(body, _AXIS))
            arm = subtract(vector(body, _PIVOT), vector(bodies[p], _PIVOT))
            pivot = add(vector(parent, _AT), _applied(parent, _ROTATION, arm))
            put(row, _ALONG, axis)
            if body[_SLIDES] == 0:
                cosine, sine = np.cos(angle), np.sin(angle)
                for k in range(3):
                    column = (
                        parent[_ROTATION + k],
                        parent[_ROTATION + 3 + k],
                        parent[_ROTATION + 6 + k],
                    )
                    column = _turned(column, axis, cosine, sine)
                    for i in range(3):
                        row[_ROTATION + 3 * i + k] = column[i]
            else:
                for i in range(_ROTATION, PLACED):
                    row[i] = parent[i]
                pivot = add(pivot, scale(angle, axis))
            put(row, _AT, pivot)
        arm = subtract(vector(body, _CENTRE), vector(body, _PIVOT))
        put(row, _FROM_CENTRE, add(vector(row, _AT), _applied(row, _ROTATION, arm)))
        # RJ by columns, then (RJ)Rᵀ by rows; J is symmetric.
        x = _applied(row, _ROTATION, vector(body, _INERTIA))
        y = _applied(row, _ROTATION, vector(body, _INERTIA + 3))
        z = _applied(row, _ROTATION, vector(body, _INERTIA + 6))
        put(row, _TENSOR, _applied(row, _ROTATION, (x[0], y[0], z[0])))
        put(row, _TENSOR + 3, _applied(row, _ROTATION, (x[1], y[1], z[1])))
        put(row, _TENSOR + 6, _applied(row, _ROTATION, (x[2], y[2], z[2])))


def partial_velocities(
    bodies: _Numbers, placed: _Numbers, radius: float, gamma: Vector, columns: _Numbers
) -> None:
    """Write the columns (b, 3 + h, COLUMN, ...) of the bodies' motion per unit of u."""
    columns[:] = 0.0
    for b in range(len(bodies)):
        r = vector(placed[b], _FROM_CENTRE)
        # From the contact point of the shell, which is at rest.
        x = add(r, scale(radius, gamma))
        for i, e in enumerate((_X, _Y, _Z)):
            columns[b, i, _TURN + i] = 1.0
            put(columns[b, i], _MOVE, cross(e, x))
        j = b
        while j > 0:
            axis, column = vector(placed[j], _ALONG), columns[b, 2 + j]
            if bodies[j][_SLIDES] == 0:
                put(column, _TURN, axis)
                put(column, _MOVE, cross(axis, subtract(r, vector(placed[j], _AT))))
            else:
                put(column, _MOVE, axis)
            j = int(bodies[j][_PARENT])


def slip_columns(columns: _Numbers, alpha: Vector, beta: Vector) -> None:
    """Write the columns of the slip velocity, the last two: along space's X and Y."""
    for b in range(len(columns)):
        put(columns[b, columns.shape[1] - 2], _MOVE, alpha)
        put(columns[b, columns.shape[1] - 1], _MOVE, beta)


def _before(bodies: _Numbers, i: int) -> int:
    """Return the index in u of the last rate before i that moves the body of i too, or -1."""
    return 2 + int(bodies[i - 2][_PARENT]) if i > 2 else i - 1


def mass_matrix(bodies: _Numbers, placed: _Numbers, columns: _Numbers, matrix: _Numbers) -> None:
    """Write 𝓜 (3 + h, 3 + h, ...); u·𝓜u/2 is the kinetic energy, including the armatures.

    A larger matrix gets zeros outside 𝓜.
    """
    matrix[:] = 0.0
    k = columns.shape[1]
    for b in range(len(bodies)):
        # Only the rates that move the body: the other columns are zero.
        i = 2 + b
        while i >= 0:
            spin = _applied(placed[b], _TENSOR, vector(columns[b, i], _TURN))
            push = scale(bodies[b][_MASS], vector(columns[b, i], _MOVE))
            j = i
            while j >= 0:
                turn, move = vector(columns[b, j], _TURN), vector(columns[b, j], _MOVE)
                matrix[i, j] += dot(turn, spin) + dot(move, push)
                j = _before(bodies, j)
            i = _before(bodies, i)
    joined = 2 + len(bodies)
    for i in range(joined, k):  # slip, which moves all bodies alike
        for b in range(len(bodies)):
            push = scale(bodies[b][_MASS], vector(columns[b, i], _MOVE))
            for j in range(i + 1):
                matrix[i, j] += dot(vector(columns[b, j], _MOVE), push)
    for i in range(k):
        if 2 < i < joined:  # the rotor of a geared motor has inertia for its own joint only
            matrix[i, i] += bodies[i - 2][_ARMATURE]
        for j in range(i):
            matrix[j, i] = matrix[i, j]


def move(columns: _Numbers, u: _Numbers, moving: _Numbers) -> None:
    """Write the velocities in moving (b, MOVING, ...) for u (3 + h, ...)."""
    for b in range(len(columns)):
        turning, velocity = scale(0.0, vector(u, 0)), scale(0.0, vector(u, 0))
        for k in range(columns.shape[1]):
            turning = add(turning, scale(u[k], vector(columns[b, k], _TURN)))
            velocity = add(velocity, scale(u[k], vector(columns[b, k], _MOVE)))
        put(moving[b], TURNING, turning)
        put(moving[b], _VELOCITY, velocity)


def momentum_rates(
    bodies: _Numbers,
    placed: _Numbers,
    moving: _Numbers,
    radius: float,
    gamma: Vector,
    gravity: Vector,
    slip: Vector,
    rates: _Numbers,
) -> None:
    """Write the rates of (L, h) in space (3 + h, ...), without the torques of motors and plane.

    slip: velocity of the shell's point at the contact [m/s], v = aω×γ + slip: velocity of the
    contact point. L̇ = Σ m v_b×v + m(r_b + aγ)×G; along a hinge of the parent's ω, whose pivot has
    the velocity w, ḣ = Σ (ω×n, J_bω_b + ρ×m v_b) + (n, m v_b×w + mρ×G); along a slide
    ḣ = Σ m(ω×n, v_b) + m(n, G).
    The sum for a joint is over the bodies that it moves.
    """
    v = add(scale(radius, cross(vector(moving[0], TURNING), gamma)), slip)
    L_rate = scale(0.0, gamma)
    rates[:] = 0.0
    for b in range(len(bodies)):
        row, m = placed[b], bodies[b][_MASS]
        r, v_b = vector(row, _FROM_CENTRE), vector(moving[b], _VELOCITY)
        weight, push = scale(m, gravity), scale(m, v_b)
        around = cross(add(r, scale(radius, gamma)), weight)
        L_rate = add(L_rate, add(cross(push, v), around))
        spin = _applied(row, _TENSOR, vector(moving[b], TURNING))
        j = b
        while j > 0:
            p = int(bodies[j][_PARENT])
            n, omega = vector(placed[j], _ALONG), vector(moving[p], TURNING)
            n_rate = cross(omega, n)
            if bodies[j][_SLIDES] == 0:
                pivot = vector(placed[j], _AT)
                arm = subtract(pivot, vector(placed[p], _FROM_CENTRE))
                of_pivot = add(vector(moving[p], _VELOCITY), cross(omega, arm))
                rho = subtract(r, pivot)
                rates[2 + j] += dot(n_rate, add(spin, cross(rho, push)))
                rates[2 + j] += dot(n, add(cross(push, of_pivot), cross(rho, weight)))
            else:
                rates[2 + j] += dot(n_rate, push) + dot(n, weight)
            j = p
    put(rates, 0, L_rate)


def bias(
    bodies: _Numbers,
    placed: _Numbers,
    columns: _Numbers,
    moving: _Numbers,
    radius: float,
    gamma: Vector,
    gravity: Vector,
    u: _Numbers,
    torques: _Numbers,
) -> Vector:
    """Write the torques that keep u constant (3 + h, ...), from Newton and Euler.

    torques (3 + h, ...): of the plane about the contact point, then of the motors (forces for
    slides). Returns the plane's force [N]. For du/dt ≠ 0, 𝓜 du/dt is added to the torques, and
    `push` of du/dt to the force. The accelerations are written into `moving`.
    """
    force = scale(0.0, gamma)
    torques[:] = 0.0
    for b in range(len(bodies)):
        row, m = placed[b], bodies[b][_MASS]
        turning, r = vector(moving[b], TURNING), vector(row, _FROM_CENTRE)
        # The velocities of the sphere's centre and of the shell are constant.
        rate = scale(0.0, gamma)
        acceleration = rate
        rho = r
        if b > 0:
            p = int(bodies[b][_PARENT])
            n, omega = vector(placed[b], _ALONG), vector(moving[p], TURNING)
            pivot = vector(row, _AT)
            arm = subtract(pivot, vector(placed[p], _FROM_CENTRE))
            rate = vector(moving[p], _TURNING_RATE)
            acceleration = add(vector(moving[p], _ACCELERATION), _acceleration(rate, omega, arm))
            # n has the rate ω×n in space: a hinge gets q̇ω×n, a slide 2q̇ω×n.
            carried = scale(u[2 + b], cross(omega, n))
            if bodies[b][_SLIDES] == 0:
                rate = add(rate, carried)
            else:
                acceleration = add(acceleration, scale(2.0, carried))
            rho = subtract(r, pivot)
        acceleration = add(acceleration, _acceleration(rate, turning, rho))
        put(moving[b], _TURNING_RATE, rate)
        put(moving[b], _ACCELERATION, acceleration)
        f = scale(m, subtract(acceleration, gravity))
        spin = cross(turning, _applied(row, _TENSOR, turning))
        torque = add(_applied(row, _TENSOR, rate), spin)
        force = add(force, f)
        for k in range(columns.shape[1]):
            column = columns[b, k]
            torques[k] += dot(vector(column, _TURN), torque) + dot(vector(column, _MOVE), f)
    return force


def push(bodies: _Numbers, columns: _Numbers, u: _Numbers) -> Vector:
    """Return the momentum Σ m v_b for u (3 + h, ...), or its rate for du/dt."""
    total = scale(0.0, vector(u, 0))
    for b in range(len(bodies)):
        for k in range(columns.shape[1]):
            total = add(total, scale(bodies[b][_MASS] * u[k], vector(columns[b, k], _MOVE)))
    return total


def _acceleration(rate: Vector, turning: Vector, r: Vector) -> Vector:
    """Return the acceleration of a point r of a turning body, relative to its origin."""
    return add(cross(rate, r), cross(turning, cross(turning, r)))


def eliminate(matrix: _Numbers, given: _Numbers) -> None:
    """Bring 𝓜 (k, k, ...), without the rows and columns of given rates (k,), to triangular form.

    Gaussian elimination in place, with the factors in the lower triangle. 𝓜 is positive definite
    and the remainder of its border negative definite, so rows need not be exchanged.
    """
    k = len(matrix)
    for i in range(k):
        for j in range(i + 1, k):
            # Rows and columns of given rates are skipped: removing them would allocate arrays at
            # every evaluation of compiled code.
            if not (given[i] or given[j]):
                matrix[j, i] /= matrix[i, i]
                for l in range(i + 1, k):
                    matrix[j, l] -= matrix[j, i] * matrix[i, l]


def constrain(matrix: _Numbers, directions: tuple[Vector, ...]) -> None:
    """Border 𝓜, at the end of a larger matrix, with directions D_k without shell rotation.

    The additional unknowns are Lagrange multipliers, the torques along D_k with the opposite sign;
    the additional rows are (D_k, ω_s) = 0. If the right side has momenta, the multipliers are the
    components of L along D_k, which M lacks.
    """
    first = len(matrix) - len(directions)
    for c in range(len(directions)):
        for i in range(3):
            matrix[first + c, i] = matrix[i, first + c] = directions[c][i]


def solve(matrix: _Numbers, given: _Numbers, right: _Numbers, u: _Numbers) -> None:
    """Solve 𝓜u = right for the rates of u (k, ...) that are not given (k,); the others stay.

    matrix: the result of `eliminate`, in which rows of given rates are unchanged.
    """
    k = len(matrix)
    for i in range(k):
        if not given[i]:
            u[i] = right[i]
            for j in range(k):
                if given[j]:
                    u[i] -= matrix[j, i] * u[j]
    for i in range(k):
        for j in range(i + 1, k):
            if not (given[i] or given[j]):
                u[j] -= matrix[j, i] * u[i]
    for i in range(k - 1, -1, -1):
        if not given[i]:
            for j in range(i + 1, k):
                if not given[j]:
                    u[i] -= matrix[i, j] * u[j]
            u[i] = u[i] / matrix[i, i]


@dataclass(frozen=True)
class Robot:
    """The numbers of a tree of bodies, in rows (b, _ROW), and the radius [m].

    carrier: row of the body in whose axes vectors are, and whose attitude a motion gives.
    """

    bodies: Array
    radius: float
    carrier: int

    @property
    def hinges(self) -> int:
        return len(self.bodies) - 1

    @property
    def mass(self) -> float:
        return float(self.bodies[:, _MASS].sum())

    def states(self, gamma: Array, angles: Array, omega: Array, rates: Array) -> "States":
        """Return the robot in n states of motion."""
        placed = self.placed(angles)
        columns = self.columns(placed, gamma)
        u = np.concatenate([omega.T - self._carried(columns, rates), rates.T])
        moving = np.empty((len(self.bodies), MOVING, len(gamma)))
        move(columns, u, moving)
        return States(self, gamma.T, placed, columns, u, moving)

    def placed(self, angles: Array) -> Array:
        """Return the placed bodies (b, PLACED, n) at angles (n, h), in the carrier's axes."""
        placed = np.empty((len(self.bodies), PLACED, len(angles)))
        place(self.bodies, self.carrier, angles.T, placed)
        return placed

    def moved(self, angles: Array) -> tuple[Array, Array]:
        """Return rotations R (b, n, 3, 3) and shifts s (b, n, 3) of the bodies at angles (n, h).

        A point of a body at x for joint angles 0 moves to Rx + s from the sphere's centre, in the
        carrier's axes.
        """
        placed = self.placed(angles)
        turned = placed[:, _ROTATION:].transpose(0, 2, 1).reshape(*placed[:, 0].shape, 3, 3)
        pivots, at = self.bodies[:, _PIVOT:_INERTIA], placed[:, _AT:_ROTATION]
        return turned, at.transpose(0, 2, 1) - np.einsum("bnij,bj->bni", turned, pivots)

    def columns(self, placed: Array, gamma: Array) -> Array:
        """Return the bodies' columns (b, 3 + h, COLUMN, n) of placed bodies."""
        columns = np.empty((len(self.bodies), 3 + self.hinges, COLUMN, len(gamma)))
        partial_velocities(self.bodies, placed, self.radius, tuple(gamma.T), columns)
        return columns

    def _carried(self, columns: Array, rates: Array) -> Array:
        """Return the carrier's angular velocity relative to the shell (3, n)."""
        turns = columns[self.carrier, 3:, _TURN:_MOVE]
        return np.asarray(np.einsum("hin,nh->in", turns, rates))

    def angular_velocity(
        self, gamma: Array, angles: Array, M: Array, rates: Array, rolling: Rolling
    ) -> Array:
        """Return ω (n, 3) of the carrier from the momentum M (n, 3), both in its axes."""
        k = 3 + self.hinges
        given = np.arange(k + 1) > 2
        given[k] = rolling != "rubber"
        placed = self.placed(angles)
        columns = self.columns(placed, gamma)
        matrix = np.empty((k + 1, k + 1, len(gamma)))
        right, u = np.zeros((2, k + 1, len(gamma)))
        mass_matrix(self.bodies, placed, columns, matrix)
        constrain(matrix, (tuple(gamma.T),))
        eliminate(matrix, given)
        # M is γ×L in the rubber model, so L is M×γ plus a part along γ, the multiplier.
        right[:3] = (np.cross(M, gamma) if rolling == "rubber" else M).T
        u[3:k] = rates.T
        solve(matrix, given, right, u)
        return (u[:3] + self._carried(columns, rates)).T


def robot_of(ball: Ball) -> Robot:
    """Return a ball's robot, with the armatures of its hinges' motors."""
    names = [link.name for link in ball.tree]
    rows = np.zeros((len(names), _ROW))
    for row, link in zip(rows, ball.tree, strict=True):
        row[_MASS], row[_SLIDES] = link.mass, link.slides
        row[_CENTRE:_AXIS], row[_AXIS:_PIVOT] = link.centre, link.axis
        row[_PIVOT:_INERTIA], row[_INERTIA:_ARMATURE] = link.pivot, link.inertia.ravel()
    rows[1:, _PARENT] = [names.index(link.parent) for link in ball.tree[1:]]
    motors = [hinge.motor for hinge in ball.hinges]
    rows[1:, _ARMATURE] = [motor.armature if motor else 0.0 for motor in motors]
    return Robot(rows, ball.radius, carrier=int(ball.has_frame))


@dataclass(frozen=True)
class States:
    """n states of a robot in motion; the last index of an array is the state.

    gamma (3, n), placed (b, PLACED, n), columns (b, 3 + h, COLUMN, n), u (3 + h, n), moving
    (b, MOVING, n) without its accelerations.
    """

    robot: Robot
    gamma: Array
    placed: Array
    columns: Array
    u: Array
    moving: Array

    @cached_property
    def matrix(self) -> Array:
        """𝓜 (3 + h, 3 + h, n)."""
        matrix = np.empty((len(self.u), *self.u.shape))
        mass_matrix(self.robot.bodies, self.placed, self.columns, matrix)
        return matrix

    @cached_property
    def momenta(self) -> Array:
        """(L, h) (3 + h, n): about the contact point, in frame axes, and along the hinges."""
        return np.asarray((self.matrix * self.u).sum(axis=1))

    def momentum(self, rolling: Rolling) -> Array:
        """Return M (n, 3) in frame axes: γ×L in the rubber model, L in the classical one."""
        L = self.momenta[:3]
        return (np.cross(self.gamma, L, axis=0) if rolling == "rubber" else L).T

    @cached_property
    def pushes(self) -> Array:
        """Σ m ∂v_b/∂u_k (3, 3 + h, n): the momentum that each unit rate gives the robot."""
        moves = self.columns[:, :, _MOVE:]
        return np.asarray(np.einsum("b,bkin->ikn", self.robot.bodies[:, _MASS], moves))

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
        return self.moving[:, _VELOCITY:_TURNING_RATE].transpose(0, 2, 1)
