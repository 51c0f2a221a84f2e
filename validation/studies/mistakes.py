"""Mistakes that a trajectory's file may hold: other conventions of its numbers, or another scene.

Numbers of a file are compared with the reference's sample by sample, under each known mistake.
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

_FLOOR = 1e-6  # an error below it explains as little as none
_MOST = 400  # samples that a convention is tried on


@dataclass(frozen=True)
class Truth:
    """What a trajectory should have in its rows: a reference motion, of these rows alone.

    path_scale: of the motion at all of its samples [m].
    """

    motion: Motion
    path_scale: float


@dataclass(frozen=True)
class Errors:
    """The errors of numbers.

    path: over its length; attitude: rad; rate: that of ω, relative, None where it is not known.
    """

    path: float
    attitude: float
    rate: float | None = None


def rows_of(file: Trajectory, at: slice | NDArray[np.intp]) -> Trajectory:
    """Return some of the rows of a trajectory."""
    parts = vars(file).items()
    own: dict[str, Any] = {name: each[at] for name, each in parts if isinstance(each, np.ndarray)}
    others = {name: each[at] for name, each in (file.others or {}).items()}
    return replace(file, **own, others=others)


def some_of(count: int) -> slice:
    """Select some of `count` samples, the first among them, at equal distances."""
    return slice(None, None, max(1, count // _MOST))


def errors_at(file: Trajectory, truth: Truth, angle: Array | None = None) -> tuple[Array, ...]:
    """Return the errors of path, attitude and, if known, ω: (n,) each, in the units of `Errors`.

    angle: the attitude's (n,), where it is known.
    """
    apart, right = file.position[:, :2] - truth.motion.contact_point, truth.motion.angular_velocity
    path = np.linalg.norm(apart, axis=1) / truth.path_scale
    if angle is None:
        angle = angle_between(truth.motion.attitude, file.attitude)
    if file.angular_velocity is None:
        return path, angle
    fastest = np.linalg.norm(right, axis=1).max()
    return path, angle, np.linalg.norm(file.angular_velocity - right, axis=1) / (fastest or 1.0)


def largest(errors: tuple[Array, ...]) -> Errors:
    """Return the largest of each."""
    return Errors(*(float(each.max()) for each in errors))


def typical(errors: tuple[Array, ...], times: Array) -> Array:
    """Return the mean over ln(t) of ln(error) of each, (2 or 3,), at times (n,).

    An engine's error is small at the beginning, and a mistake is there from the beginning on; in a
    chaotic motion both are as large as they can be at the end.
    """
    weights = 1 / (times - times[0] + times[1] - times[0])
    logarithms = np.log(np.maximum(errors, _FLOOR))
    return np.asarray(np.average(logarithms, axis=1, weights=weights))


_Change = Callable[[Trajectory], Trajectory]
_Parts = dict[str, _Change]  # by their names; "" changes nothing
_XYZ = "x, y, z"
_SPELT = {"in": "inches", "ft": "feet", "um": "µm", "rev/s": "revolutions per second"}
_NEAR = 1.3  # a factor of length so near 1 may be an engine's error, and is no unit


@dataclass(frozen=True)
class _Convention:
    """A mistake: its name, what undoes it, and of how many single ones it is made."""

    family: str
    name: str
    undo: _Change
    parts: int


def conventions(truth: Truth, has_height: bool) -> Iterator[_Convention]:
    """Yield all that are tried on a trajectory of the reference's motion.

    has_height: whether its z is known. Without it only worlds with the same vertical are tried.
    """
    yield from _combined("attitude", _attitudes(truth))
    yield from _combined("position", _positions(truth))
    yield from _combined("angular velocity", _rates(truth))
    yield from (_Convention("world", *part, 1) for part in _worlds(has_height))


def _combined(family: str, parts: Sequence[_Parts]) -> Iterator[_Convention]:
    """Yield all combinations with at most one of each kind of part."""
    for chosen in product(*([("", lambda file: file), *each.items()] for each in parts)):
        names = [name for name, _ in chosen if name]
        undo = partial(reduce, lambda file, change: change(file), [each for _, each in chosen])
        if names:
            yield _Convention(family, "; ".join(names), undo, len(names))


# Attitude ----------------------------------------------------------------------------------


def _attitude(change: Callable[[Array], Array]) -> _Change:
    return lambda file: replace(file, attitude=change(file.attitude))


def _right(q: Array) -> _Change:
    return _attitude(lambda attitude: multiply(attitude, np.broadcast_to(q, attitude.shape)))


def _attitudes(truth: Truth) -> list[_Parts]:
    """Return orders of a quaternion's numbers, its senses, and frames of which it may be."""
    start = truth.motion.scene.start.attitude
    counted = "the attitude is counted from the start, in"
    orders = {
        "the quaternion's order is x, y, z, w": _attitude(lambda q: q[:, [3, 0, 1, 2]]),
        "qx, qy, qz, qw hold w, x, y, z": _attitude(lambda q: q[:, [1, 2, 3, 0]]),
    }
    senses = {"the rotation is from world to frame (conjugate, transposed)": _attitude(conjugate)}
    frames = {
        "the attitude is the shell's, not the frame's": _right(_in_shell(truth, 1)),
        f"{counted} world axes": _right(start),
        f"{counted} frame axes": _attitude(lambda q: multiply(start, q)),
    }
    for S in _rotations():
        other = f"the frame's axes are others: the file's {_XYZ} are the scene's {_axes_of(S)}"
        frames[other] = _right(from_matrix(S))
    return [orders, senses, frames]


def _in_shell(truth: Truth, sense: int) -> Array:
    """Return the frame's attitude in the shell (n, 4), or for the sense -1 its inverse."""
    angle, axis = truth.motion.hinge_angles[:, :1], truth.motion.scene.ball.shell.axis
    half = sense * angle / 2
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)


# Position ----------------------------------------------------------------------------------


def _position(change: Callable[[Array], Array]) -> _Change:
    """Return what undoes a change of the horizontal part (n, 2)."""

    def undo(file: Trajectory) -> Trajectory:
        horizontal = change(file.position[:, :2])
        return replace(file, position=np.column_stack([horizontal, file.position[:, 2]]))

    return undo


def _others(units: Mapping[str, float]) -> dict[str, float]:
    """Return the units that are not SI's, as they are spelt in a sentence."""
    return {_SPELT.get(unit, unit): size for unit, size in units.items() if size != 1}


def _resized(size: float) -> _Change:
    return lambda file: replace(file, position=size * file.position)


def _positions(truth: Truth) -> list[_Parts]:
    """Return origins, units, and axes of the plane."""
    a = truth.motion.scene.ball.radius
    sizes = _others(LENGTHS) | {"radii of the ball": a, "diameters": 2 * a}
    origins = {"the path does not start at (0, 0)": _position(lambda p: p - p[0])}
    lengths = {
        f"the positions are in {unit}": _resized(size)
        for unit, size in sizes.items()
        if not 1 / _NEAR < size < _NEAR
    }
    planes = {
        "x and y are exchanged": _position(lambda p: p[:, ::-1]),
        "x has the other sign": _position(lambda p: p * [-1, 1]),
        "y has the other sign": _position(lambda p: p * [1, -1]),
        "x and y both have the other sign": _position(lambda p: -p),
        "x, y are the scene's y, -x": _position(lambda p: p[:, ::-1] * [-1, 1]),
        "x, y are the scene's -y, x": _position(lambda p: p[:, ::-1] * [1, -1]),
        "x, y are the scene's -y, -x": _position(lambda p: -p[:, ::-1]),
    }
    return [origins, lengths, planes]


# Angular velocity --------------------------------------------------------------------------


def _rated(change: Callable[[Array, Trajectory], Array]) -> _Change:
    def undo(file: Trajectory) -> Trajectory:
        omega = file.angular_velocity
        return replace(file, angular_velocity=None if omega is None else change(omega, file))

    return undo


def _rates(truth: Truth) -> list[_Parts]:
    """Return units, signs and axes of ω, and the bodies of which it may be."""
    scene, to_frame = truth.motion.scene, _in_shell(truth, -1)
    more = np.outer(truth.motion.hinge_rates[:, 0], scene.ball.shell.axis)
    of = "the angular velocity"
    units = {f"{of} is in {unit}": _scaled(size) for unit, size in _others(RATES).items()}
    signs = {f"{of} has the other sign": _scaled(-1.0)}
    axes = {
        f"{of} is in world axes": _rated(lambda w, file: _rotated(w, conjugate(file.attitude))),
        f"{of} is in the shell's axes": _rated(lambda w, _: _rotated(w, to_frame)),
        **{f"{of}'s {_XYZ} are along the scene's {_axes_of(S)}": _along(S) for S in _rotations()},
    }
    bodies = {f"{of} is the shell's, not the frame's": _rated(lambda w, _: w + more)}
    return [units, signs, axes, bodies]


def _scaled(size: float) -> _Change:
    return _rated(lambda w, _: size * w)


def _along(S: Array) -> _Change:
    return _rated(lambda w, _: w @ S)


def _rotated(v: Array, attitude: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", rotation_matrix(attitude), v))


# World -------------------------------------------------------------------------------------

_WORLDS = {
    "x, z, -y": "Y is up",
    "x, z, y": "Y is up, and the axes are left-handed",
    "x, -y, -z": "Z is down",
    "y, x, -z": "Z is down (north, east, down)",
}


def _worlds(has_height: bool) -> Iterator[tuple[str, _Change]]:
    """Yield axes x, y, z of the file other than the world's, and maybe the frame's likewise."""
    for S in _signed_permutations():
        if np.array_equal(S, np.eye(3)) or not (has_height or abs(S[2, 2]) == 1):
            continue
        text = _axes_of(S)
        known = f" ({_WORLDS[text]})" if text in _WORLDS else ""
        axes = f"{_XYZ} are the scene's {text}{known}"
        proper = np.linalg.det(S) > 0
        if proper:
            yield f"the world's axes are others: the file's {axes}", _seen_from(S, both=False)
        yield f"the world's and the frame's axes are others: the file's {axes}", _seen_from(S)


def _seen_from(S: Array, both: bool = True) -> _Change:
    """Undoes axes of the world, and of the frame if both, whose i-th is row i of S."""
    proper = S * np.linalg.det(S).round()  # what mirrors, turns vectors of rotation the other way
    turn = from_matrix(proper)

    def undo(file: Trajectory) -> Trajectory:
        q, w = file.attitude, file.angular_velocity
        # A height that the file does not have must not become one of its other coordinates.
        position = np.where(np.isnan(file.position), 0.0, file.position) @ S
        q = multiply(np.broadcast_to(conjugate(turn), q.shape), q)
        if both:
            q = multiply(q, np.broadcast_to(turn, q.shape))
            w = None if w is None else w @ proper
        return replace(file, position=position, attitude=q, angular_velocity=w)

    return undo


@cache
def _signed_permutations() -> tuple[Array, ...]:
    """Return the 48 (3, 3), turned and mirrored; row i is the i-th axis."""
    return tuple(
        np.eye(3)[list(order)] * np.array(signs, dtype=float)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    )


def _rotations() -> list[Array]:
    """Return the signed permutations that turn, without the identity."""
    turning = [S for S in _signed_permutations() if np.linalg.det(S) > 0]
    return [S for S in turning if not np.array_equal(S, np.eye(3))]


def _axes_of(S: Array) -> str:
    """Return the axes by name: "y, -x, z"."""
    names = (("-" if row.sum() < 0 else "") + "xyz"[int(np.abs(row).argmax())] for row in S)
    return ", ".join(names)


_MistakenScene = tuple[str, tuple[Scene, ...]]
"""A mistake in setting up the scene, and the scenes that it may have led to."""


def mistaken_scenes(scene: Scene) -> Iterator[_MistakenScene]:
    """Yield the scenes that are tried: other conventions, units and axes, and left-out physics."""
    names = [hinge.name for hinge in scene.hinges]
    moving = [i for i, hinge in enumerate(scene.hinges) if _has_rate(scene, i)]
    groups = [([i], f"the {names[i]}'s rate", "has", "is") for i in moving]
    if len(moving) > 1:
        groups.append((moving, "all rates", "have", "are"))
    for which, what, has, _ in groups:
        yield (f"{what} {has} the other sign", _with_rates(scene, which, -1.0))
    for which, what, _, are in groups:
        yield (f"{what} {are} zero", _with_rates(scene, which, 0.0))
        yield (f"{what} {are} taken in degrees", _with_rates(scene, which, RATES["deg/s"]))
    other: Rolling = "classical" if scene.rolling == "rubber" else "rubber"
    flat = replace(scene.start, momentum=scene.start.momentum * [1.0, 1.0, 0.0])
    level = replace(scene, rolling=other, start=flat)
    spin = "may spin (classical)" if other == "classical" else "may not spin (rubber)"
    # The start's spin, where it may not be, is left out, or stopped by the plane.
    up, omega = scene.start.to_world[2], _omega(scene)
    shell = omega - scene.hinges[0].rate * scene.ball.shell.axis
    still = [_kept(level, scene, omega - up * (up @ shell))] if other == "rubber" else []
    yield (f"the ball {spin}", (_kept(level, scene), *still, level))
    if any(slope := scene.gravity_direction[:2]):
        other_way = (-slope[0], -slope[1], scene.gravity_direction[2])
        yield ("the plane slopes the other way", (replace(scene, gravity_direction=other_way),))
    yield from _starts(scene)


def _has_rate(scene: Scene, hinge: int) -> bool:
    motor = scene.hinges[hinge].motor
    at = np.linspace(0, scene.duration, 50)
    return (motor is None or isinstance(motor, Servo)) and bool(
        np.any(scene.hinges[hinge].command.rate(at))
    )


def _with_rates(scene: Scene, which: list[int], factor: float) -> tuple[Scene, ...]:
    """Return scenes with some rates times a factor: with the same M, frame's ω, or shell's ω."""
    rates = {scene.hinges[i].name: scaled_rate(scene.drives[i], factor) for i in which}
    changed = scene.with_hinges(command=rates)
    found = [changed, _kept(changed, scene)]
    if 0 in which:
        more = (factor - 1) * float(scene.drives[0].rate(0.0)) * scene.ball.shell.axis
        found.append(_kept(changed, scene, _omega(scene) + more))
    return tuple(found)


def _starts(scene: Scene) -> Iterator[_MistakenScene]:
    start, R = scene.start, scene.start.to_world
    omega, q = _omega(scene), start.attitude
    yield ("the start's angular velocity is set in world axes", (_kept(scene, scene, R.T @ omega),))
    frames = "the start's angular velocity is set in frame axes where world axes are meant"
    yield (frames, (_kept(scene, scene, R @ omega),))
    yield ("the start's angular velocity has the other sign", (_kept(scene, scene, -omega),))
    other = replace(start, momentum=_level(scene, R @ start.momentum))
    yield ("the start's momentum is taken in frame axes", (replace(scene, start=other),))
    attitudes = {
        "conjugate (world to frame)": conjugate(q),
        "read in the order x, y, z, w": q[[3, 0, 1, 2]],
        "given in the order x, y, z, w where w, x, y, z is read": q[[1, 2, 3, 0]],
        "left out": np.array([1.0, 0.0, 0.0, 0.0]),
    }
    for how, attitude in attitudes.items():
        turned = replace(scene, start=replace(start, attitude=attitude))
        in_world = rotation_matrix(attitude).T @ R @ omega
        scenes = (_kept(turned, scene, omega), turned, _kept(turned, scene, in_world))
        yield (f"the start's attitude is {how}", scenes)


def _omega(scene: Scene) -> Array:
    return scene.angular_velocity_at(scene.start)


def _kept(changed: Scene, scene: Scene, omega: Array | None = None) -> Scene:
    """Return a changed scene that starts with the frame's ω of the other, or with this ω."""
    M = changed.momentum_of(_omega(scene) if omega is None else omega)
    return replace(changed, start=replace(changed.start, momentum=_level(changed, M)))


def _level(scene: Scene, M: Array) -> Array:
    """Return M as the rolling model has it: a rubber ball's is horizontal."""
    return M * [1.0, 1.0, 0.0] if scene.rolling == "rubber" else M
