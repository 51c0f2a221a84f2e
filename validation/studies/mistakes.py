"""Known mistakes in a trajectory file: wrong conventions of its numbers, or another scene.

A trajectory is compared with the reference sample by sample, with each known mistake undone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial, reduce
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball import Motion, Scene, Trajectory
from robotball.files.trajectories import LENGTHS, RATES
from robotball.robot.formulas import Rolling
from robotball.robot.motors import Servo
from robotball.robot.variations import scaled_rate
from robotball.rotations import (
    Array,
    angle_between,
    conjugate,
    from_matrix,
    multiply,
    rotation_matrix,
)

_FLOOR = 1e-6  # relative, rad; smaller errors count as this one
_MOST = 400  # samples on which a convention is tried
_NEAR = 1.3  # a factor of length closer to 1 may be an engine's error, so it is not tried as a unit
_XYZ = "x, y, z"
_SPELT = {"in": "inches", "ft": "feet", "um": "µm", "rev/s": "revolutions per second"}
_WORLDS = {
    "x, z, -y": "Y is up",
    "x, z, y": "Y is up, and the axes are left-handed",
    "x, -y, -z": "Z is down",
    "y, x, -z": "Z is down (north, east, down)",
}


@dataclass(frozen=True)
class Truth:
    """Expected values of a trajectory's rows.

    Attributes
    ----------
    motion : Motion
        The reference motion at the times of these rows.
    path_scale : float, m
        The path scale of the whole reference motion.
    """

    motion: Motion
    path_scale: float


@dataclass(frozen=True)
class Errors:
    """Errors of path, over its length, of attitude [rad], and of ω, relative; None if unknown."""

    path: float
    attitude: float
    rate: float | None = None


def rows_of(file: Trajectory, at: slice | NDArray[np.intp]) -> Trajectory:
    """Return a trajectory with the selected rows only."""
    arrays: dict[str, Any] = {
        name: value[at] for name, value in vars(file).items() if isinstance(value, np.ndarray)
    }
    others = {name: column[at] for name, column in (file.others or {}).items()}
    return replace(file, **arrays, others=others)


def some_of(count: int) -> slice:
    """Select at most `2 * _MOST` of `count` samples at equal distances, including the first."""
    return slice(None, None, max(1, count // _MOST))


def errors_at(file: Trajectory, truth: Truth, angle: Array | None = None) -> tuple[Array, ...]:
    """Return the errors (n,) of path, attitude and, if known, ω, in the units of `Errors`.

    Pass the attitude's error as `angle` (n,) if it is known.
    """
    offset, omega = file.position[:, :2] - truth.motion.contact_point, truth.motion.angular_velocity
    path = np.linalg.norm(offset, axis=1) / truth.path_scale
    if angle is None:
        angle = angle_between(truth.motion.attitude, file.attitude)
    if file.angular_velocity is None:
        return path, angle
    fastest = np.linalg.norm(omega, axis=1).max()
    return path, angle, np.linalg.norm(file.angular_velocity - omega, axis=1) / (fastest or 1.0)


def largest(errors: tuple[Array, ...]) -> Errors:
    """Return the largest value of each error."""
    return Errors(*(float(error.max()) for error in errors))


def typical(errors: tuple[Array, ...], times: Array) -> Array:
    """Return the mean over ln(t) of the logarithm of each error, (2 or 3,), at times (n,).

    An engine's error is small at first, whereas a mistake acts from the beginning. At the end of a
    chaotic motion both are as large as possible, so early samples get more weight.
    """
    weights = 1 / (times - times[0] + times[1] - times[0])
    logarithms = np.log(np.maximum(errors, _FLOOR))
    return np.asarray(np.average(logarithms, axis=1, weights=weights))


_Change = Callable[[Trajectory], Trajectory]
_Parts = dict[str, _Change]
"""Alternative mistakes: the name of each, and the function that undoes it."""


@dataclass(frozen=True)
class Convention:
    """A mistake in conventions: its name, the function that undoes it, and its number of parts."""

    family: str
    name: str
    undo: _Change
    parts: int


def conventions(truth: Truth, has_height: bool) -> Iterator[Convention]:
    """Yield the conventions to try. Without a height, the world's vertical stays the same."""
    yield from _combined("attitude", _attitudes(truth))
    yield from _combined("position", _positions())
    yield from _combined("angular velocity", _rates(truth))
    yield from (Convention("world", *world, 1) for world in _worlds(has_height))


def _combined(family: str, kinds: Sequence[_Parts]) -> Iterator[Convention]:
    """Yield all combinations with at most one mistake of each kind."""
    for chosen in product(*([("", lambda file: file), *parts.items()] for parts in kinds)):
        names = [name for name, _ in chosen if name]
        undo = partial(reduce, lambda file, change: change(file), [change for _, change in chosen])
        if names:
            yield Convention(family, "; ".join(names), undo, len(names))


# Attitude ----------------------------------------------------------------------------------


def _attitude(change: Callable[[Array], Array]) -> _Change:
    return lambda file: replace(file, attitude=change(file.attitude))


def _right(q: Array) -> _Change:
    return _attitude(lambda attitude: multiply(attitude, np.broadcast_to(q, attitude.shape)))


def _attitudes(truth: Truth) -> list[_Parts]:
    """Return the orders and directions of the quaternion, and the bodies that it may describe."""
    orders = {
        "the quaternion's order is x, y, z, w": _attitude(lambda q: q[:, [3, 0, 1, 2]]),
        "qx, qy, qz, qw hold w, x, y, z": _attitude(lambda q: q[:, [1, 2, 3, 0]]),
    }
    senses = {"the rotation is from world to frame (conjugate, transposed)": _attitude(conjugate)}
    frames = {
        "the attitude describes the shell instead of the frame": _right(_in_shell(truth, 1)),
    }
    for S in _rotations():
        frames[_renamed("frame's", _axes_of(S))] = _right(from_matrix(S))
    return [orders, senses, frames]


def _renamed(axes: str, names: str) -> str:
    return f"the {axes} axes are others: the file's {_XYZ} are the scene's {names}"


def _in_shell(truth: Truth, sense: int) -> Array:
    """Return the frame's attitude in the shell (n, 4), or its inverse for sense = -1."""
    angle, axis = truth.motion.hinge_angles[:, :1], truth.motion.scene.ball.shell.axis
    half = sense * angle / 2
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)


# Position ----------------------------------------------------------------------------------


def _position(change: Callable[[Array], Array]) -> _Change:
    """Return the function that changes the horizontal position (n, 2)."""

    def undo(file: Trajectory) -> Trajectory:
        horizontal, height = np.split(file.position, [2], axis=1)
        return replace(file, position=np.hstack([change(horizontal), height]))

    return undo


def _turned(S: Array) -> _Change:
    return _position(lambda p: p @ S)


def _others(units: Mapping[str, float]) -> dict[str, float]:
    """Return the sizes of the units that are not SI units, with their names spelt out."""
    return {_SPELT.get(unit, unit): size for unit, size in units.items() if size != 1}


def _resized(size: float) -> _Change:
    return lambda file: replace(file, position=size * file.position)


def _positions() -> list[_Parts]:
    """Return origins, units, and axes of the plane."""
    origins = {"the path does not start at (0, 0)": _position(lambda p: p - p[0])}
    lengths = {
        f"the positions are in {unit}": _resized(size)
        for unit, size in _others(LENGTHS).items()
        if not 1 / _NEAR < size < _NEAR
    }
    planes = {
        f"x, y are the scene's {_axes_of(S[:2])}": _turned(S[:2, :2])
        for S in _signed_permutations()
        if S[2, 2] == 1 and not np.array_equal(S, np.eye(3))
    }
    return [origins, lengths, planes]


# Angular velocity --------------------------------------------------------------------------


def _rated(change: Callable[[Array, Trajectory], Array]) -> _Change:
    def undo(file: Trajectory) -> Trajectory:
        omega = file.angular_velocity
        return replace(file, angular_velocity=None if omega is None else change(omega, file))

    return undo


def _rates(truth: Truth) -> list[_Parts]:
    """Return units, signs and axes of ω, and the bodies it may describe."""
    scene, to_frame = truth.motion.scene, _in_shell(truth, -1)
    relative = np.outer(truth.motion.hinge_rates[:, 0], scene.ball.shell.axis)
    of = "the angular velocity"
    units = {f"{of} is in {unit}": _scaled(size) for unit, size in _others(RATES).items()}
    signs = {f"{of} has the other sign": _scaled(-1.0)}
    axes = {
        f"{of} is in world axes": _rated(lambda w, file: _rotated(w, conjugate(file.attitude))),
        f"{of} is in the axes of the shell": _rated(lambda w, _: _rotated(w, to_frame)),
        **{f"{of}'s {_XYZ} are along the scene's {_axes_of(S)}": _along(S) for S in _rotations()},
    }
    bodies = {f"{of} describes the shell instead of the frame": _rated(lambda w, _: w + relative)}
    return [units, signs, axes, bodies]


def _scaled(size: float) -> _Change:
    return _rated(lambda w, _: size * w)


def _along(S: Array) -> _Change:
    return _rated(lambda w, _: w @ S)


def _rotated(v: Array, attitude: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", rotation_matrix(attitude), v))


# World -------------------------------------------------------------------------------------


def _worlds(has_height: bool) -> Iterator[tuple[str, _Change]]:
    """Yield other axes of the world, with the scene's frame axes or with likewise renamed ones."""
    for S in _signed_permutations():
        if np.array_equal(S, np.eye(3)) or not (has_height or abs(S[2, 2]) == 1):
            continue
        names = _axes_of(S)
        names += f" ({_WORLDS[names]})" if names in _WORLDS else ""
        if np.linalg.det(S) > 0:
            yield _renamed("world's", names), _seen_from(S, both=False)
        yield _renamed("world's and the frame's", names), _seen_from(S)


def _seen_from(S: Array, both: bool = True) -> _Change:
    """Undo axes of the world, and of the frame if both, whose i-th axis is row i of S."""
    proper = S * np.linalg.det(S).round()  # a mirror image reverses rotation vectors
    turn = from_matrix(proper)

    def undo(file: Trajectory) -> Trajectory:
        q, w = file.attitude, file.angular_velocity
        # A missing height (NaN) must not spread to the other coordinates.
        position = np.where(np.isnan(file.position), 0.0, file.position) @ S
        q = multiply(np.broadcast_to(conjugate(turn), q.shape), q)
        if both:
            q = multiply(q, np.broadcast_to(turn, q.shape))
            w = None if w is None else w @ proper
        return replace(file, position=position, attitude=q, angular_velocity=w)

    return undo


@cache
def _signed_permutations() -> tuple[Array, ...]:
    """Return the 48 matrices (3, 3), rotations and reflections; row i is the i-th axis."""
    return tuple(
        np.eye(3)[list(order)] * np.array(signs, dtype=float)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    )


def _rotations() -> list[Array]:
    """Return the 23 signed permutations that are rotations, without the identity."""
    proper = [S for S in _signed_permutations() if np.linalg.det(S) > 0]
    return [S for S in proper if not np.array_equal(S, np.eye(3))]


def _axes_of(S: Array) -> str:
    """Return the names of the axes, such as "y, -x, z"."""
    names = (("-" if row.sum() < 0 else "") + "xyz"[int(np.abs(row).argmax())] for row in S)
    return ", ".join(names)


# Scene -------------------------------------------------------------------------------------

_MistakenScene = tuple[str, tuple[Scene, ...]]
"""The name of a mistake in setting up the scene, and the scenes that it may have led to."""


def mistaken_scenes(scene: Scene) -> Iterator[_MistakenScene]:
    """Yield the scenes to try: other conventions, units and axes, and left-out physics."""
    names = [hinge.name for hinge in scene.hinges]
    moving = [i for i, hinge in enumerate(scene.hinges) if _has_rate(scene, i)]
    groups = {f"the {names[i]}'s rate": [i] for i in moving}
    if len(moving) > 1:
        groups["the rates of all hinges"] = moving
    factors = {"with the other sign": -1.0, "left out (zero)": 0.0, "in degrees": RATES["deg/s"]}
    for mistake, factor in factors.items():
        for rates, hinges in groups.items():
            yield f"{rates} {mistake}", _with_rates(scene, hinges, factor)
    other: Rolling = "classical" if scene.rolling == "rubber" else "rubber"
    flat = replace(scene.start, momentum=scene.start.momentum * [1.0, 1.0, 0.0])
    level = replace(scene, rolling=other, start=flat)
    spin = "may spin (classical)" if other == "classical" else "may not spin (rubber)"
    # A rubber ball cannot start with spin: the plane stops it, or the start leaves it out.
    up, omega = scene.start.to_world[2], _omega(scene)
    shell = omega - scene.hinges[0].rate * scene.ball.shell.axis
    still = [_kept(level, scene, omega - up * (up @ shell))] if other == "rubber" else []
    yield f"the ball {spin}", (_kept(level, scene), *still, level)
    if any(slope := scene.gravity_direction[:2]):
        reversed_slope = (-slope[0], -slope[1], scene.gravity_direction[2])
        yield "the plane slopes the other way", (replace(scene, gravity_direction=reversed_slope),)
    yield from _starts(scene)


def _has_rate(scene: Scene, hinge: int) -> bool:
    motor = scene.hinges[hinge].motor
    at = np.linspace(0, scene.duration, 50)
    return (motor is None or isinstance(motor, Servo)) and bool(
        np.any(scene.hinges[hinge].command.rate(at))
    )


def _with_rates(scene: Scene, hinges: list[int], factor: float) -> tuple[Scene, ...]:
    """Scale the rates of hinges, and keep in turn M, the frame's ω, and the shell's ω."""
    rates = {scene.hinges[i].name: scaled_rate(scene.drives[i], factor) for i in hinges}
    changed = scene.with_hinges(command=rates)
    scenes = [changed, _kept(changed, scene)]
    if 0 in hinges:
        added = (factor - 1) * float(scene.drives[0].rate(0.0)) * scene.ball.shell.axis
        scenes.append(_kept(changed, scene, _omega(scene) + added))
    return tuple(scenes)


def _starts(scene: Scene) -> Iterator[_MistakenScene]:
    start, R = scene.start, scene.start.to_world
    omega, q = _omega(scene), start.attitude
    yield "the start's angular velocity is set in world axes", (_kept(scene, scene, R.T @ omega),)
    attitudes = {
        "conjugate (world to frame)": conjugate(q),
        "read in the order x, y, z, w": q[[3, 0, 1, 2]],
        "given in the order x, y, z, w but read in the order w, x, y, z": q[[1, 2, 3, 0]],
    }
    for mistake, attitude in attitudes.items():
        turned = replace(scene, start=replace(start, attitude=attitude))
        in_world = rotation_matrix(attitude).T @ R @ omega
        scenes = (_kept(turned, scene, omega), turned, _kept(turned, scene, in_world))
        yield f"the start's attitude is {mistake}", scenes


def _omega(scene: Scene) -> Array:
    return scene.angular_velocity_at(scene.start)


def _kept(changed: Scene, scene: Scene, omega: Array | None = None) -> Scene:
    """Start a changed scene with the frame's ω of the original scene, or with the given ω."""
    M = changed.momentum_of(_omega(scene) if omega is None else omega)
    return replace(changed, start=replace(changed.start, momentum=_level(changed, M)))


def _level(scene: Scene, M: Array) -> Array:
    """Return M without its vertical part if the ball is of the rubber model."""
    return M * [1.0, 1.0, 0.0] if scene.rolling == "rubber" else M
