"""The mechanics of a tree of bodies that rolls in a shell, in plain arithmetic.

The formulas use scalars, like those of formulas.py, so the same functions work with floats, with
NumPy columns and inside numba. Vectors are 3-tuples in the axes of one body of the tree, the
carrier. Velocities and accelerations are relative to space, and positions are measured from the
sphere's centre. Row 0 of the bodies is the shell. A hinge or a slide joins every other body to its
parent, which has a lower row: joint j moves body j + 1. Arrays whose shape ends in `...` have there
the shape of the scalars, () or (n,). Functions write into their last array arguments.

u = (ω_s, q̇) has the shell's angular velocity and the rates of the joints. If the shell slips, its
slip velocity along space's X and Y stands between the two. (L, h) = 𝓜u has the angular momentum
about the contact point and the momenta along the joints. All sums over bodies are recursive, as in
Featherstone, Rigid Body Dynamics Algorithms: sweeps out to the last body and back give torques
(Newton-Euler), and articulated bodies, whose joints are free, give u from (L, h).

`States` has n states of a `Robot` as columns: gamma (n, 3) in the carrier's axes; angles and rates
(n, h) of the joints [rad, rad/s; m, m/s for slides]; omega (n, 3) of the carrier, in the carrier's
axes [rad/s]. All units are SI units.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from robotball.robot.ball import Ball
from robotball.robot.formulas import Rolling, Scalar, Vector, add, cross, dot, scale, subtract
from robotball.rotations import Array

_Numbers = Any  # an array, or its row
Matrix = tuple[Vector, Vector, Vector]  # its rows

# Bodies are rows of one array, for numba and for columns.
# Row of a body at joint angles 0, at which all bodies have the same axes. A body and all bodies
# that its joint moves form a composite. WHOLE is the mass of the composite. _PART is this mass as a
# fraction of the mass of the composite, of its parent and of later composites at the parent.
_MASS, _CENTRE, _AXIS, _PIVOT, _INERTIA, _ARMATURE = 0, 1, 4, 7, 10, 19
_PARENT, _SLIDES, WHOLE, _PART, _ROW = 20, 21, 22, 23, 24
# Row of a placed body: its centre of mass, its inertia tensor about this centre, the pivot of its
# joint, and the rows of its rotation from joint angles 0. Then for a unit rate of its joint: the
# composite's angular velocity, velocity at the pivot and momentum. Last, the composite's centre of
# mass.
_FROM_CENTRE, _TENSOR, _AT, _ROTATION, _TURN, _SLIDE, _PUSH = 0, 3, 12, 15, 24, 27, 30
_MIDDLE, PLACED = 33, 36
# Row of an articulated body: the matrices of torque = Aω + Bv and force = Bᵀω + Cv about the pivot;
# the torque and the force for a unit rate of the joint, and the inertia along the joint.
_A, _B, _C, _TORQUE, _FORCE, _ALONG, ARTICULATED = 0, 9, 18, 27, 30, 33, 34
# Row of a moving body: angular velocity, velocity of the centre of mass, and the derivatives of
# these two; sums over the body's composite, of momenta or forces and of their moments about the
# sphere's centre.
TURNING, _VELOCITY, _TURNING_RATE, _ACCELERATION, _SUM, _MOMENT, MOVING = 0, 3, 6, 9, 12, 15, 18
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_STILL = (0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A robot at given joint angles, and aγ, from the contact point to the sphere's centre."""

    bodies: _Numbers
    placed: _Numbers
    lift: Vector


def vector(row: _Numbers, at: int) -> Vector:
    """Return three numbers of a row."""
    return (row[at], row[at + 1], row[at + 2])


def put(row: _Numbers, at: int, v: Vector) -> None:
    """Write a vector into a row."""
    row[at] = v[0]
    row[at + 1] = v[1]
    row[at + 2] = v[2]


def _increase(row: _Numbers, at: int, v: Vector) -> None:
    """Add a vector to a vector in a row."""
    put(row, at, add(vector(row, at), v))


def _matrix(row: _Numbers, at: int) -> Matrix:
    """Return the matrix that is stored in a row, as its rows."""
    return vector(row, at), vector(row, at + 3), vector(row, at + 6)


def _transposed(M: Matrix) -> Matrix:
    return (M[0][0], M[1][0], M[2][0]), (M[0][1], M[1][1], M[2][1]), (M[0][2], M[1][2], M[2][2])


def _sum(M: Matrix, N: Matrix) -> Matrix:
    return add(M[0], N[0]), add(M[1], N[1]), add(M[2], N[2])


def _around(arm: Vector, M: Matrix) -> Matrix:
    """Return arm × each row of M."""
    return cross(arm, M[0]), cross(arm, M[1]), cross(arm, M[2])


def _outer(u: Vector, v: Vector) -> Matrix:
    return scale(u[0], v), scale(u[1], v), scale(u[2], v)


def _times(M: Matrix, v: Vector) -> Vector:
    return dot(M[0], v), dot(M[1], v), dot(M[2], v)


def _applied(row: _Numbers, at: int, v: Vector) -> Vector:
    """Return the product of the matrix that is stored in a row and v."""
    return _times(_matrix(row, at), v)


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
            if body[_SLIDES] == 0:
                put(row, _TURN, axis)
                put(row, _SLIDE, scale(0.0, axis))
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
                for i in range(_ROTATION, _TURN):
                    row[i] = parent[i]
                pivot = add(pivot, scale(angle, axis))
                put(row, _TURN, scale(0.0, axis))
                put(row, _SLIDE, axis)
            put(row, _AT, pivot)
        arm = subtract(vector(body, _CENTRE), vector(body, _PIVOT))
        put(row, _FROM_CENTRE, add(vector(row, _AT), _applied(row, _ROTATION, arm)))
        put(row, _MIDDLE, vector(row, _FROM_CENTRE))
        # RJ by columns, then (RJ)Rᵀ by rows; J is symmetric.
        x = _applied(row, _ROTATION, vector(body, _INERTIA))
        y = _applied(row, _ROTATION, vector(body, _INERTIA + 3))
        z = _applied(row, _ROTATION, vector(body, _INERTIA + 6))
        put(row, _TENSOR, _applied(row, _ROTATION, (x[0], y[0], z[0])))
        put(row, _TENSOR + 3, _applied(row, _ROTATION, (x[1], y[1], z[1])))
        put(row, _TENSOR + 6, _applied(row, _ROTATION, (x[2], y[2], z[2])))
    # The composites; each is in the row of its first body.
    for b in range(len(bodies) - 1, 0, -1):
        body, row, parent = bodies[b], placed[b], placed[int(bodies[b][_PARENT])]
        middle = vector(row, _MIDDLE)
        turned = cross(vector(row, _TURN), subtract(middle, vector(row, _AT)))
        put(row, _PUSH, scale(body[WHOLE], add(turned, vector(row, _SLIDE))))
        _increase(parent, _MIDDLE, scale(body[_PART], subtract(middle, vector(parent, _MIDDLE))))


def articulate(pose: Pose, axes: Matrix, given: _Numbers, free: _Numbers, matrix: _Numbers) -> None:
    """Write the articulated bodies `free` (b, ARTICULATED), and 𝓜 (k, k) of the shell with them.

    axes: the axes of space. given (k + h,): which rates of u are given, and so not free. k is 3, or
    5 with slip.
    """
    bodies, placed, root = pose.bodies, pose.placed, len(matrix)
    for b in range(len(bodies)):
        row, own = placed[b], free[b]
        arm = subtract(vector(row, _FROM_CENTRE), vector(row, _AT))
        for i in range(3):
            push = scale(bodies[b][_MASS], (_X, _Y, _Z)[i])
            spin = cross(push, arm)
            put(own, _A + 3 * i, add(vector(row, _TENSOR + 3 * i), cross(arm, spin)))
            put(own, _B + 3 * i, spin)
            put(own, _C + 3 * i, push)
    for b in range(len(bodies) - 1, 0, -1):
        parent = free[int(bodies[b][_PARENT])]
        A, B, C = _seen_from(_arm(pose, b), _freed(pose, b, given[root + b - 1], free[b]))
        for i in range(3):
            _increase(parent, _A + 3 * i, A[i])
            _increase(parent, _B + 3 * i, B[i])
            _increase(parent, _C + 3 * i, C[i])
    A, B, C = _seen_from(pose.lift, _matrices(free[0]))
    for i in range(3):
        for j in range(3):
            matrix[i, j] = dot(axes[i], _times(A, axes[j]))
        for j in range(3, root):
            matrix[i, j] = matrix[j, i] = dot(axes[i], _times(B, axes[j - 3]))
    for i in range(3, root):
        for j in range(3, root):
            matrix[i, j] = dot(axes[i - 3], _times(C, axes[j - 3]))
    _exchange(matrix, given)


def _matrices(own: _Numbers) -> tuple[Matrix, Matrix, Matrix]:
    return _matrix(own, _A), _matrix(own, _B), _matrix(own, _C)


def _seen_from(arm: Vector, matrices: tuple[Matrix, Matrix, Matrix]) -> tuple[Matrix, ...]:
    """Return A, B and C about another point, from which `arm` reaches the pivot."""
    A, B, C = matrices
    moved = _sum(B, _transposed(_around(arm, C)))
    return _sum(_sum(A, _around(arm, B)), _transposed(_around(arm, moved))), moved, C


def _arm(pose: Pose, b: int) -> Vector:
    """Return the vector from the pivot of body b's parent to the pivot of body b."""
    p = int(pose.bodies[b][_PARENT])
    return subtract(vector(pose.placed[b], _AT), vector(pose.placed[p], _AT))


def _freed(pose: Pose, b: int, given: bool, own: _Numbers) -> tuple[Matrix, Matrix, Matrix]:
    """Write torque, force and inertia for a unit rate of body b's joint; return A, B, C.

    A, B, C are those of the body with the joint free, unless the rate of the joint is given.
    """
    A, B, C = _matrices(own)
    turn, slide = vector(pose.placed[b], _TURN), vector(pose.placed[b], _SLIDE)
    torque = add(_times(A, turn), _times(B, slide))
    force = add(_times(_transposed(B), turn), _times(C, slide))
    # The rotor of a motor adds inertia only to the motor's own joint.
    along = dot(turn, torque) + dot(slide, force) + pose.bodies[b][_ARMATURE]
    own[_ALONG] = along
    put(own, _TORQUE, torque)
    put(own, _FORCE, force)
    if given:
        return A, B, C
    t, f = scale(-1 / along, torque), scale(-1 / along, force)
    return _sum(A, _outer(t, torque)), _sum(B, _outer(t, force)), _sum(C, _outer(f, force))


def _exchange(matrix: _Numbers, given: _Numbers) -> None:
    """Change 𝓜 (k, k) in place so that it gives the free rates and the momenta of given rates.

    The new matrix must be multiplied by the momenta of the free rates and by the given rates, in
    the order of u.
    """
    k = len(matrix)
    for i in range(k):
        if not given[i]:
            per_pivot = 1 / matrix[i, i]
            matrix[i, i] = -1.0
            for j in range(k):
                if j != i:
                    factor = matrix[j, i] * per_pivot
                    matrix[j, i] = 0.0
                    for l in range(k):
                        matrix[j, l] -= factor * matrix[i, l]
            for l in range(k):
                matrix[i, l] *= -per_pivot


def of_shell(u: _Numbers, axes: Matrix, root: int) -> tuple[Vector, Vector]:
    """Return the shell's ω and slip velocity of u; root: 3, or 5 with slip."""
    slip = scale(0.0, axes[0])
    if root > 3:
        slip = add(scale(u[3], axes[0]), scale(u[4], axes[1]))
    return add(add(scale(u[0], axes[0]), scale(u[1], axes[1])), scale(u[2], axes[2])), slip


def solve(
    pose: Pose, axes: Matrix, given: _Numbers, free: _Numbers, matrix: _Numbers, right: _Numbers,
    u: _Numbers, moving: _Numbers,
) -> None:  # fmt: skip
    """Solve 𝓜u = right for the rates of u (k + h,) that are not given, after `articulate`.

    Writes the right sides (k + h,) of the given rates, and auxiliary rates and sums into `moving`.
    """
    bodies, placed, root = pose.bodies, pose.placed, len(matrix)
    moving[:, _SUM:] = 0.0
    # The force of each joint on the parent if the parent is at rest, and the moment of this force.
    for b in range(len(bodies) - 1, 0, -1):
        i, p, own, row = root + b - 1, int(bodies[b][_PARENT]), free[b], placed[b]
        force, torque = vector(moving[b], _SUM), vector(moving[b], _MOMENT)
        against = dot(vector(row, _TURN), torque) + dot(vector(row, _SLIDE), force)
        if given[i]:
            right[i] = against
        else:
            u[i] = (right[i] - against) / own[_ALONG]
        force = add(force, scale(u[i], vector(own, _FORCE)))
        arm = _arm(pose, b)
        torque = add(add(torque, scale(u[i], vector(own, _TORQUE))), cross(arm, force))
        _increase(moving[p], _SUM, force)
        _increase(moving[p], _MOMENT, torque)
    force = vector(moving[0], _SUM)
    torque = add(vector(moving[0], _MOMENT), cross(pose.lift, force))
    for i in range(root):
        moving[0, _SUM + i] = dot(axes[i], torque) if i < 3 else dot(axes[i - 3], force)
    for i in range(root):
        total = 0.0
        for j in range(root):
            total += matrix[i, j] * (u[j] if given[j] else right[j] - moving[0, _SUM + j])
        if given[i]:
            right[i] = total + moving[0, _SUM + i]
        else:
            u[i] = total
    turning, slip = of_shell(u, axes, root)
    put(moving[0], _TURNING_RATE, turning)
    put(moving[0], _ACCELERATION, add(slip, cross(turning, pose.lift)))
    for b in range(1, len(bodies)):
        i, p, own, row = root + b - 1, int(bodies[b][_PARENT]), free[b], placed[b]
        turning = vector(moving[p], _TURNING_RATE)
        velocity = add(vector(moving[p], _ACCELERATION), cross(turning, _arm(pose, b)))
        carried = dot(vector(own, _TORQUE), turning) + dot(vector(own, _FORCE), velocity)
        if given[i]:
            right[i] += carried + own[_ALONG] * u[i]
        else:
            u[i] -= carried / own[_ALONG]
        put(moving[b], _TURNING_RATE, add(turning, scale(u[i], vector(row, _TURN))))
        put(moving[b], _ACCELERATION, add(velocity, scale(u[i], vector(row, _SLIDE))))


def _along(row: _Numbers, force: Vector, torque: Vector) -> Scalar:
    """Return the component along a body's joint of a force and its moment about the centre."""
    around = subtract(torque, cross(vector(row, _AT), force))
    return dot(vector(row, _TURN), around) + dot(vector(row, _SLIDE), force)


def _at_pivot(pose: Pose, moving: _Numbers, b: int, p: int) -> Vector:
    """Return the velocity of the point of body b's parent p at the pivot of b."""
    arm = subtract(vector(pose.placed[b], _AT), vector(pose.placed[p], _FROM_CENTRE))
    return add(vector(moving[p], _VELOCITY), cross(vector(moving[p], TURNING), arm))


def _hand_on(moving: _Numbers, b: int, p: int) -> None:
    """Add the sums over the composite of body b to those of its parent p."""
    _increase(moving[p], _SUM, vector(moving[b], _SUM))
    _increase(moving[p], _MOMENT, vector(moving[b], _MOMENT))


def move(pose: Pose, shell: Vector, slip: Vector, rates: _Numbers, moving: _Numbers) -> None:
    """Write the velocities in moving (b, MOVING, ...) for ω_s, slip and the joints' rates (h, ...).

    slip: velocity of the shell's point at the contact [m/s].
    """
    bodies, placed = pose.bodies, pose.placed
    arm = add(vector(placed[0], _FROM_CENTRE), pose.lift)
    put(moving[0], TURNING, shell)
    put(moving[0], _VELOCITY, add(cross(shell, arm), slip))
    for b in range(1, len(bodies)):
        p, row = int(bodies[b][_PARENT]), placed[b]
        turning = add(vector(moving[p], TURNING), scale(rates[b - 1], vector(row, _TURN)))
        slide = scale(rates[b - 1], vector(row, _SLIDE))
        velocity = add(_at_pivot(pose, moving, b, p), slide)
        rho = subtract(vector(row, _FROM_CENTRE), vector(row, _AT))
        put(moving[b], TURNING, turning)
        put(moving[b], _VELOCITY, add(velocity, cross(turning, rho)))


def momenta(pose: Pose, moving: _Numbers, rates: _Numbers, along: _Numbers) -> Vector:
    """Return L and write h (h, ...) for the rates of joints, and the sums in `moving`."""
    bodies, placed = pose.bodies, pose.placed
    for b in range(len(bodies)):
        push = scale(bodies[b][_MASS], vector(moving[b], _VELOCITY))
        spin = _applied(placed[b], _TENSOR, vector(moving[b], TURNING))
        put(moving[b], _SUM, push)
        put(moving[b], _MOMENT, add(spin, cross(vector(placed[b], _FROM_CENTRE), push)))
    for b in range(len(bodies) - 1, 0, -1):
        along[b - 1] = _along(placed[b], vector(moving[b], _SUM), vector(moving[b], _MOMENT))
        along[b - 1] += bodies[b][_ARMATURE] * rates[b - 1]
        _hand_on(moving, b, int(bodies[b][_PARENT]))
    return add(vector(moving[0], _MOMENT), cross(pose.lift, vector(moving[0], _SUM)))


def momentum_rates(pose: Pose, moving: _Numbers, slip: Vector, rates: _Numbers) -> Vector:
    """Return L̇ and write ḣ (h, ...) in space after `momenta`, without weight, motors and plane.

    slip: as in `move`. The contact point has the velocity v = aω×γ + slip. L̇ = P×v, with the
    momentum P of all bodies. Let p be the momentum of a joint's composite, l the composite's
    angular momentum about the pivot, ω the parent's angular velocity, and w the velocity of the
    pivot. Along a hinge ḣ = (ω×n, l) + (n, p×w), along a slide ḣ = (ω×n, p).
    """
    for b in range(1, len(pose.bodies)):
        p, row = int(pose.bodies[b][_PARENT]), pose.placed[b]
        omega, push = vector(moving[p], TURNING), vector(moving[b], _SUM)
        turn, around = vector(row, _TURN), cross(push, _at_pivot(pose, moving, b, p))
        spin = subtract(vector(moving[b], _MOMENT), cross(vector(row, _AT), push))
        rates[b - 1] = dot(cross(omega, turn), spin) + dot(turn, around)
        rates[b - 1] += dot(cross(omega, vector(row, _SLIDE)), push)
    v = add(cross(vector(moving[0], TURNING), pose.lift), slip)
    return cross(vector(moving[0], _SUM), v)


def weigh(pose: Pose, gravity: Vector, torques: _Numbers) -> tuple[Vector, Vector]:
    """Return the weight and its torque about the contact point; write joint torques (h, ...)."""
    for b in range(1, len(pose.bodies)):
        torques[b - 1] = dot(vector(pose.placed[b], _PUSH), gravity)
    weight = scale(pose.bodies[0][WHOLE], gravity)
    return weight, cross(add(vector(pose.placed[0], _MIDDLE), pose.lift), weight)


def bias(pose: Pose, moving: _Numbers, rates: _Numbers, torques: _Numbers) -> tuple[Vector, Vector]:
    """Return the force [N] and torque that keep u constant without gravity, from Newton and Euler.

    The torque is about the contact point. Writes the torques (h, ...) of joints (forces for
    slides). For du/dt ≠ 0, 𝓜 du/dt is added to the torques, and `push` of du/dt to the force.
    """
    bodies, placed = pose.bodies, pose.placed
    for b in range(len(bodies)):
        row, m = placed[b], bodies[b][_MASS]
        turning, r = vector(moving[b], TURNING), vector(row, _FROM_CENTRE)
        # The velocities of the sphere's centre and of the shell are constant.
        rate = scale(0.0, r)
        acceleration = rate
        rho = r
        if b > 0:
            p = int(bodies[b][_PARENT])
            omega, pivot = vector(moving[p], TURNING), vector(row, _AT)
            arm = subtract(pivot, vector(placed[p], _FROM_CENTRE))
            rate = vector(moving[p], _TURNING_RATE)
            acceleration = add(vector(moving[p], _ACCELERATION), _acceleration(rate, omega, arm))
            # n has the rate ω×n in space: a hinge gets q̇ω×n, a slide 2q̇ω×n.
            rate = add(rate, scale(rates[b - 1], cross(omega, vector(row, _TURN))))
            slide = cross(omega, vector(row, _SLIDE))
            acceleration = add(acceleration, scale(2.0 * rates[b - 1], slide))
            rho = subtract(r, pivot)
        acceleration = add(acceleration, _acceleration(rate, turning, rho))
        put(moving[b], _TURNING_RATE, rate)
        put(moving[b], _ACCELERATION, acceleration)
        f = scale(m, acceleration)
        spin = cross(turning, _applied(row, _TENSOR, turning))
        torque = add(_applied(row, _TENSOR, rate), spin)
        put(moving[b], _SUM, f)
        put(moving[b], _MOMENT, add(torque, cross(r, f)))
    for b in range(len(bodies) - 1, 0, -1):
        torques[b - 1] = _along(placed[b], vector(moving[b], _SUM), vector(moving[b], _MOMENT))
        _hand_on(moving, b, int(bodies[b][_PARENT]))
    force = vector(moving[0], _SUM)
    return force, add(vector(moving[0], _MOMENT), cross(pose.lift, force))


def push(pose: Pose, axes: Matrix, u: _Numbers) -> Vector:
    """Return the momentum Σ m v_b for u, or its rate for du/dt."""
    root, arm = len(u) - len(pose.bodies) + 1, add(vector(pose.placed[0], _MIDDLE), pose.lift)
    shell, slip = of_shell(u, axes, root)
    total = scale(pose.bodies[0][WHOLE], add(cross(shell, arm), slip))
    for b in range(1, len(pose.bodies)):
        total = add(total, scale(u[root + b - 1], vector(pose.placed[b], _PUSH)))
    return total


def _acceleration(rate: Vector, turning: Vector, r: Vector) -> Vector:
    """Return the acceleration of a point r of a turning body, relative to its origin."""
    return add(cross(rate, r), cross(turning, cross(turning, r)))


@dataclass(frozen=True)
class Robot:
    """The numbers of a tree of bodies, in rows (b, _ROW), and the radius [m].

    carrier: the row of the body whose axes vectors have, and whose attitude a motion gives.
    """

    bodies: Array
    radius: float
    carrier: int

    @property
    def hinges(self) -> int:
        return len(self.bodies) - 1

    @property
    def mass(self) -> float:
        return float(self.bodies[0, WHOLE])

    def states(self, gamma: Array, angles: Array, omega: Array, rates: Array) -> "States":
        """Return the robot in n states of motion."""
        pose = self.pose(gamma, angles)
        return self.moving(pose, np.concatenate([(omega - self._carried(pose, rates)).T, rates.T]))

    def pose(self, gamma: Array, angles: Array) -> Pose:
        """Return the robot at joint angles, in the carrier's axes."""
        return Pose(self.bodies, self.placed(angles), tuple(self.radius * gamma.T))

    def moving(self, pose: Pose, u: Array) -> "States":
        """Return the robot in n states with u (3 + h, n)."""
        moving = np.empty((len(self.bodies), MOVING, u.shape[1]))
        move(pose, tuple(u[:3]), _STILL, u[3:], moving)
        return States(self, pose, u, moving)

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
        turned = placed[:, _ROTATION:_TURN].transpose(0, 2, 1)
        turned = turned.reshape(*turned.shape[:2], 3, 3)
        pivots, at = self.bodies[:, _PIVOT:_INERTIA], placed[:, _AT:_ROTATION]
        return turned, at.transpose(0, 2, 1) - np.einsum("bnij,bj->bni", turned, pivots)

    def matrix(self, pose: Pose) -> Array:
        """Return 𝓜 (3 + h, 3 + h, n), with L in the carrier's axes."""
        k, n = 3 + self.hinges, pose.placed.shape[2]
        lift = tuple(np.tile(pose.lift, k))
        tiled = Pose(self.bodies, np.tile(pose.placed, k), lift)
        return self.moving(tiled, np.repeat(np.eye(k), n, axis=1)).momenta.reshape(k, k, n)

    def _carried(self, pose: Pose, rates: Array) -> Array:
        """Return the carrier's angular velocity relative to the shell (n, 3)."""
        carried, b = np.zeros((len(rates), 3)), self.carrier
        while b > 0:
            carried += (pose.placed[b, _TURN:_SLIDE] * rates[:, b - 1]).T
            b = int(self.bodies[b, _PARENT])
        return carried

    def angular_velocity(
        self, gamma: Array, angles: Array, M: Array, rates: Array, rolling: Rolling
    ) -> Array:
        """Return ω (n, 3) of the carrier from the momentum M (n, 3), both in its axes."""
        pose, rubber = self.pose(gamma, angles), rolling == "rubber"
        matrix = self.matrix(pose).transpose(2, 0, 1)
        # In the rubber model M is γ×L, so L is M×γ plus an unknown part along γ.
        left, right = np.zeros((len(gamma), 4, 4)), np.zeros((len(gamma), 4, 1))
        left[:, :3, :3], left[:, 3, 3] = matrix[:, :3, :3], not rubber
        left[:, 3, :3] = left[:, :3, 3] = gamma * rubber
        right[:, :3, 0] = np.cross(M, gamma) if rubber else M
        right[:, :3] -= matrix[:, :3, 3:] @ rates[:, :, None]
        return np.asarray(np.linalg.solve(left, right)[:, :3, 0] + self._carried(pose, rates))


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
    rows[:, WHOLE] = rows[:, _MASS]
    for row in rows[:0:-1]:
        parent = rows[int(row[_PARENT])]
        both = parent[WHOLE] + row[WHOLE]
        row[_PART] = row[WHOLE] / both if both else 0.0  # links may be massless
        parent[WHOLE] = both
    return Robot(rows, ball.radius, carrier=int(ball.has_frame))


@dataclass(frozen=True)
class States:
    """n states of a robot in motion; the last index of an array is the state.

    placed (b, PLACED, n) in the pose, u (3 + h, n), moving (b, MOVING, n) with its velocities.
    """

    robot: Robot
    pose: Pose
    u: Array
    moving: Array

    @property
    def gamma(self) -> Array:
        """γ (3, n)."""
        return np.array(self.pose.lift) / self.robot.radius

    @cached_property
    def matrix(self) -> Array:
        """𝓜 (3 + h, 3 + h, n)."""
        return self.robot.matrix(self.pose)

    @cached_property
    def momenta(self) -> Array:
        """(L, h) (3 + h, n): about the contact point, in frame axes, and along the hinges."""
        along = np.empty_like(self.u[3:])
        L = momenta(self.pose, self.moving, self.u[3:], along)
        return np.concatenate([L, along])

    def momentum(self, rolling: Rolling) -> Array:
        """Return M (n, 3) in frame axes: γ×L in the rubber model, L in the classical one."""
        L = self.momenta[:3]
        return (np.cross(self.gamma, L, axis=0) if rolling == "rubber" else L).T

    @cached_property
    def pushes(self) -> Array:
        """Σ m ∂v_b/∂u_k (3, 3 + h, n): the momentum of the robot for each unit rate."""
        arm = self.centre_of_mass.T + self.pose.lift
        of_shell = self.robot.mass * np.cross(np.eye(3)[:, :, None], arm[None], axis=1)
        of_joints = self.pose.placed[1:, _PUSH:_MIDDLE]
        return np.concatenate([of_shell, of_joints]).transpose(1, 0, 2)

    @property
    def centre_of_mass(self) -> Array:
        """The centre of mass (n, 3) from the centre of the sphere, frame axes [m]."""
        return np.asarray(self.pose.placed[0, _MIDDLE:].T)

    @property
    def turning(self) -> Array:
        """The bodies' angular velocities (b, n, 3), frame axes [rad/s]."""
        return self.moving[:, TURNING:_VELOCITY].transpose(0, 2, 1)

    @property
    def velocities(self) -> Array:
        """The velocities (b, n, 3) of the bodies' centres of mass, frame axes [m/s]."""
        return self.moving[:, _VELOCITY:_TURNING_RATE].transpose(0, 2, 1)
