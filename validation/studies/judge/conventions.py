"""What the numbers of a file may mean other than what they should: the known mistakes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import permutations, product

import numpy as np

from robotball.files.trajectory_file import LENGTHS
from robotball.rotations import Array, conjugate, from_matrix, multiply, rotation_matrix
from validation.studies.judge.numbers import Numbers, Truth

Change = Callable[[Numbers], Numbers]
Part = tuple[str, Change]  # "" changes nothing
XYZ = "x, y, z"
SPELT = {"in": "inches", "ft": "feet", "um": "µm"}
NEAR = 1.3  # a factor of length so near 1 may be an engine's error, and is no unit


@dataclass(frozen=True)
class Convention:
    """A mistake: its name, what undoes it, and of how many single ones it is made."""

    family: str
    name: str
    undo: Change
    parts: int


def conventions(truth: Truth, has_height: bool) -> Iterator[Convention]:
    """All that are tried on a trajectory of the reference's motion.

    has_height: whether its z is known, without which no world but one with the same vertical is
    tried.
    """
    yield from _combined("attitude", [_orders(), _senses(), _frames(truth)])
    yield from _combined("position", [_origins(), _lengths(truth), _planes(), _places(truth)])
    yield from _combined("angular velocity", [_units(), _signs(), _axes(truth), _bodies(truth)])
    yield from (Convention("world", *part, 1) for part in _worlds(has_height))


def _combined(family: str, parts: Sequence[Sequence[Part]]) -> Iterator[Convention]:
    for chosen in product(*([("", _same), *each] for each in parts)):
        names = [name for name, _ in chosen if name]
        if names:
            yield Convention(family, "; ".join(names), _all([f for _, f in chosen]), len(names))


def _same(numbers: Numbers) -> Numbers:
    return numbers


def _all(changes: Sequence[Change]) -> Change:
    def undo(numbers: Numbers) -> Numbers:
        for change in changes:
            numbers = change(numbers)
        return numbers

    return undo


# Attitude ----------------------------------------------------------------------------------


def _turned(change: Callable[[Array], Array]) -> Change:
    return lambda numbers: numbers.changed(attitude=change(numbers.attitude))


def _orders() -> list[Part]:
    return [
        ("the quaternion's order is x, y, z, w", _turned(lambda q: q[:, [3, 0, 1, 2]])),
        ("qx, qy, qz, qw hold w, x, y, z", _turned(lambda q: q[:, [1, 2, 3, 0]])),
    ]


def _senses() -> list[Part]:
    return [("the rotation is from world to frame (conjugate, transposed)", _turned(conjugate))]


def _frames(truth: Truth) -> list[Part]:
    scene, start = truth.motion.scene, truth.motion.scene.start.attitude
    principal = conjugate(scene.principal_quaternion)
    half = truth.frame_angle[:, None] / 2
    axis = scene.ball.shell.axis
    in_shell = np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)
    parts = [
        ("the attitude is the shell's, not the frame's", _right(in_shell)),
        ("the attitude is that of the ball's principal axes", _right(principal)),
        ("the attitude is counted from the start, in world axes", _right(start)),
        (
            "the attitude is counted from the start, in frame axes",
            _turned(lambda q: multiply(start, q)),
        ),
    ]
    for S in _rotations():
        name = f"the frame's axes are others: the file's {XYZ} are the scene's {_text(S)}"
        parts.append((name, _right(from_matrix(S))))
    return parts


def _right(q: Array) -> Change:
    return _turned(lambda attitude: multiply(attitude, np.broadcast_to(q, attitude.shape)))


# Position ----------------------------------------------------------------------------------


def _moved(change: Callable[[Array], Array]) -> Change:
    """Of the horizontal part (n, 2)."""

    def undo(numbers: Numbers) -> Numbers:
        height = numbers.position[:, 2:]
        horizontal = change(numbers.position[:, :2])
        return numbers.changed(position=np.concatenate([horizontal, height], axis=1))

    return undo


def _origins() -> list[Part]:
    return [("the path does not start at (0, 0)", _moved(lambda p: p - p[0]))]


def _lengths(truth: Truth) -> list[Part]:
    units = {unit: size for unit, size in LENGTHS.items() if unit != "m"}
    names = {f"the positions are in {SPELT.get(u, u)}": size for u, size in units.items()}
    a = truth.motion.scene.ball.radius
    names |= {"the positions are in radii of the ball": a, "the positions are in diameters": 2 * a}
    return [
        (name, partial(_resized, size))
        for name, size in names.items()
        if not 1 / NEAR < size < NEAR
    ]


def _resized(size: float, numbers: Numbers) -> Numbers:
    return numbers.changed(position=size * numbers.position)


def _planes() -> list[Part]:
    return [
        ("x and y are exchanged", _moved(lambda p: p[:, ::-1])),
        ("x has the other sign", _moved(lambda p: p * [-1, 1])),
        ("y has the other sign", _moved(lambda p: p * [1, -1])),
        ("x and y both have the other sign", _moved(lambda p: -p)),
        ("x, y are the scene's y, -x", _moved(lambda p: p[:, ::-1] * [-1, 1])),
        ("x, y are the scene's -y, x", _moved(lambda p: p[:, ::-1] * [1, -1])),
        ("x, y are the scene's -y, -x", _moved(lambda p: -p[:, ::-1])),
    ]


def _places(truth: Truth) -> list[Part]:
    scene = truth.motion.scene
    reach = 1e-6 * scene.ball.radius
    return [
        (f"x, y are of the {name}'s centre of mass", _moved(partial(np.add, -place)))
        for name, place in truth.places.items()
        if np.abs(place).max() > reach
    ]


# Angular velocity --------------------------------------------------------------------------


def _rated(change: Callable[[Array, Numbers], Array]) -> Change:
    def undo(numbers: Numbers) -> Numbers:
        if numbers.rate is None:
            return numbers
        return numbers.changed(rate=change(numbers.rate, numbers))

    return undo


def _units() -> list[Part]:
    sizes = {"deg/s": np.pi / 180, "revolutions per second": 2 * np.pi, "rpm": 2 * np.pi / 60}
    return [
        (f"the angular velocity is in {unit}", _rated(partial(_times, size)))
        for unit, size in sizes.items()
    ]


def _signs() -> list[Part]:
    return [("the angular velocity has the other sign", _rated(lambda w, _: -w))]


def _axes(truth: Truth) -> list[Part]:
    scene = truth.motion.scene
    half = -truth.frame_angle[:, None] / 2
    to_frame = np.concatenate([np.cos(half), np.sin(half) * scene.ball.shell.axis], axis=1)
    parts: list[Part] = [
        (
            "the angular velocity is in world axes",
            _rated(lambda w, numbers: _rotated(w, conjugate(numbers.attitude))),
        ),
        (
            "the angular velocity is turned from world to frame axes twice",
            _rated(lambda w, numbers: _rotated(w, numbers.attitude)),
        ),
        ("the angular velocity is in the shell's axes", _rated(lambda w, _: _rotated(w, to_frame))),
        (
            "the angular velocity is in principal axes",
            _rated(lambda w, _: w @ scene.principal_axes.T),
        ),
    ]
    for S in _rotations():
        name = f"the angular velocity's {XYZ} are along the scene's {_text(S)}"
        parts.append((name, _rated(partial(_along, S))))
    return parts


def _bodies(truth: Truth) -> list[Part]:
    more = np.outer(truth.frame_rate, truth.motion.scene.ball.shell.axis)
    return [
        (
            "the angular velocity is the shell's, not the frame's",
            _rated(lambda w, _: w + more),
        )
    ]


def _times(size: float, w: Array, _: Numbers) -> Array:
    return w * size


def _along(S: Array, w: Array, _: Numbers) -> Array:
    return w @ S


def _rotated(v: Array, attitude: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", rotation_matrix(attitude), v))


# World -------------------------------------------------------------------------------------

WORLDS = {
    "x, z, -y": "Y is up",
    "x, z, y": "Y is up, and the axes are left-handed",
    "x, -y, -z": "Z is down",
    "y, x, -z": "Z is down (north, east, down)",
}


def _worlds(has_height: bool) -> Iterator[Part]:
    """The file's axes x, y, z are others than the world's, and maybe the frame's likewise."""
    for S in _signed_permutations():
        if np.array_equal(S, np.eye(3)) or not (has_height or abs(S[2, 2]) == 1):
            continue
        text = _text(S)
        known = f" ({WORLDS[text]})" if text in WORLDS else ""
        axes = f"{XYZ} are the scene's {text}{known}"
        proper = np.linalg.det(S) > 0
        if proper:
            yield f"the world's axes are others: the file's {axes}", _seen_from(S, both=False)
        yield f"the world's and the frame's axes are others: the file's {axes}", _seen_from(S)


def _seen_from(S: Array, both: bool = True) -> Change:
    """Undoes axes of the world, and of the frame if both, whose i-th is row i of S."""
    proper = S * np.linalg.det(S).round()  # what mirrors, turns vectors of rotation the other way
    turn = from_matrix(proper)

    def undo(numbers: Numbers) -> Numbers:
        q, w = numbers.attitude, numbers.rate
        # A height that the file does not have must not become one of its other coordinates.
        position = np.where(np.isnan(numbers.position), 0.0, numbers.position) @ S
        q = multiply(np.broadcast_to(conjugate(turn), q.shape), q)
        if both:
            q = multiply(q, np.broadcast_to(turn, q.shape))
            w = None if w is None else w @ proper
        return Numbers(position, q, w)

    return undo


@cache
def _signed_permutations() -> tuple[Array, ...]:
    """The 48 (3, 3), turned and mirrored; row i is the i-th axis."""
    return tuple(
        np.eye(3)[list(order)] * np.array(signs, dtype=float)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    )


def _rotations() -> list[Array]:
    """Those of them that turn, but for the one that does not."""
    turning = [S for S in _signed_permutations() if np.linalg.det(S) > 0]
    return [S for S in turning if not np.array_equal(S, np.eye(3))]


def _text(S: Array) -> str:
    """The axes by name: "y, -x, z"."""
    names = (("-" if row.sum() < 0 else "") + "xyz"[int(np.abs(row).argmax())] for row in S)
    return ", ".join(names)
