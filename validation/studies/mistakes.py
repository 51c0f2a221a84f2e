"""Search for mistakes that explain the difference between a trajectory and the reference.

A mistake is a wrong convention of a file's numbers, or the simulation of another scene. Each known
mistake is corrected separately. The mistake whose correction reduces the errors most is accepted,
and the search continues with the remaining errors. Conventions are tried first because they are
cheap; other scenes must be integrated.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache, cached_property, partial, reduce
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from robotball import InputError, Motion, Scene, Trajectory, integrate
from robotball.engines.recorded import angular_velocity, sampled_rates
from robotball.files.trajectories import LENGTHS, RATES
from robotball.motion import arrays_of, with_arrays
from robotball.robot.formulas import Rolling
from robotball.robot.motors import Servo
from robotball.robot.variations import scaled_rate
from robotball.rotations import (
    Array,
    angle_between,
    conjugate,
    continuous,
    from_matrix,
    multiply,
    rotation_matrix,
)

_FLOOR = 1e-6  # relative, rad; smaller errors count as this error
_SAMPLES = 400  # samples on which a convention is tried
_NEAR = 1.3  # a factor of length closer to 1 may be an engine's error, so it is not tried as a unit
_STRETCHES = 400  # stretches of time that are tried before the best one is refined
_LONGEST = 0.1  # largest stretch as a fraction of the time
_LATE = 0.5  # of the duration: latest first time of a file whose clock is then set to 0
_LESSENS = np.log(5.0)  # correcting a mistake must reduce one error to a fifth
# Correcting mistakes must divide the typical error and the root mean square of all errors together
# by these factors. Measured: 1.008 by chance, at least 2.9 and 1.28 if a planted mistake is
# corrected.
_MOST = (2.0, 1.1)
# Largest remaining fraction of the typical error and of the root mean square, in path, attitude or
# ω. Measured: at most 0.09 and 0.30 if a planted mistake is corrected; the rest is the engine's
# error.
_REMAINING = ((0.1,), (1 / 3,))
SURE = 0.1  # a mistake is certain if at most this fraction of its largest error remains
_SPOILS = np.log(3.0)  # a correction may increase another error by at most this factor
_AS_GOOD = np.log(1.5)  # mistakes within this factor explain the errors equally well
_SOUND = 1e-3  # relative, rad; below such errors of path and attitude no other scene is tried
_CLEAR = np.log(1e-2), 0.1  # typical and largest error below which a convention explains all
# Slip below the first fraction of the speed is ignored. A limit of friction is measured at times
# when the slip is at least the second fraction of the largest slip.
_SLIPS, _FAST = 0.05, 0.3
_LARGEST = 5.0  # of the sliding friction; if a file needs more, its units or axes are wrong
# Friction of a floor with the default value of MuJoCo, or of Bullet and PhysX. For two materials
# MuJoCo takes the larger friction, Bullet the product and PhysX the mean.
_DEFAULTS = 1.0, 0.5
_MOST_MISTAKES = 4  # mistakes searched for in one file
_TRIED = 1e-9  # rtol of a mistaken scene's motion, far below the errors that matter
_SCENE, _TIME, _RATE = "scene", "time", "angular velocity"
_NOT_THE_RATE = "the angular velocity is not the rate of the attitude"
_ASTRAY = 1e-2  # relative error of ω; above, ω is recomputed. A delay of half a step has less
_FINE = 4000  # samples of a motion that is interpolated
_XYZ = "x, y, z"
_SPELT = {"in": "inches", "ft": "feet", "um": "µm", "rev/s": "revolutions per second"}
_WORLDS = {
    "x, z, -y": "Y is up",
    "x, z, y": "Y is up, and the axes are left-handed",
    "x, -y, -z": "Z is down",
    "y, x, -z": "Z is down (north, east, down)",
}


@dataclass(frozen=True)
class _Truth:
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
    """Errors of path, ω and momentum, relative, and of attitude [rad]; None if unknown."""

    path: float | None = None
    attitude: float | None = None
    rate: float | None = None
    momentum: float | None = None


def rows_of(file: Trajectory, at: slice | NDArray[np.intp]) -> Trajectory:
    """Return a trajectory with the selected rows only."""
    arrays: dict[str, Any] = {
        name: value[at] for name, value in vars(file).items() if isinstance(value, np.ndarray)
    }
    others = {name: column[at] for name, column in (file.others or {}).items()}
    return replace(file, **arrays, others=others)


def _errors_at(file: Trajectory, truth: _Truth) -> tuple[Array, ...]:
    """Return the errors (n,) of path, attitude and, if known, ω, in the units of `Errors`."""
    offset, omega = file.position[:, :2] - truth.motion.contact_point, truth.motion.angular_velocity
    path = np.linalg.norm(offset, axis=1) / truth.path_scale
    # An unknown attitude has no error.
    angle = np.nan_to_num(angle_between(truth.motion.attitude, file.attitude))
    if file.angular_velocity is None:
        return path, angle
    fastest = np.linalg.norm(omega, axis=1).max()
    return path, angle, np.linalg.norm(file.angular_velocity - omega, axis=1) / (fastest or 1.0)


def _largest(errors: tuple[Array, ...]) -> Errors:
    """Return the largest value of each error."""
    return Errors(*(float(error.max()) for error in errors))


def _typical(errors: tuple[Array, ...], times: Array) -> Array:
    """Return the mean over ln(t) of the logarithm of each error, (2 or 3,), at times (n,).

    An engine's error is small at first, whereas a mistake acts from the beginning. At the end of a
    chaotic motion both errors are as large as possible, so early samples get more weight.
    """
    weights = 1 / (times - times[0] + times[1] - times[0])
    logarithms = np.log(np.maximum(errors, _FLOOR))
    return np.asarray(np.average(logarithms, axis=1, weights=weights))


_Change = Callable[[Trajectory], Trajectory]
_Parts = dict[str, _Change]
"""Alternative mistakes: the name of each, and the function that undoes it."""


@dataclass(frozen=True)
class _Convention:
    """A mistake in conventions: its name, its correction, and its number of parts."""

    family: str
    name: str
    undo: _Change
    parts: int


def _conventions(truth: _Truth, has_height: bool) -> Iterator[_Convention]:
    """Yield the conventions to try. Without a height, the world's vertical stays the same."""
    yield from _combined("attitude", _attitudes(truth))
    yield from _combined("position", _positions())
    yield from _combined("angular velocity", _rates(truth))
    yield from (_Convention("world", *world, 1) for world in _worlds(has_height))


def _combined(family: str, kinds: Sequence[_Parts]) -> Iterator[_Convention]:
    """Yield all combinations with at most one mistake of each kind."""
    for chosen in product(*([("", lambda file: file), *parts.items()] for parts in kinds)):
        names = [name for name, _ in chosen if name]
        undo = partial(reduce, lambda file, change: change(file), [change for _, change in chosen])
        if names:
            yield _Convention(family, "; ".join(names), undo, len(names))


# Attitude ----------------------------------------------------------------------------------


def _attitude(change: Callable[[Array], Array]) -> _Change:
    return lambda file: replace(file, attitude=change(file.attitude))


def _right(q: Array) -> _Change:
    return _attitude(lambda attitude: multiply(attitude, np.broadcast_to(q, attitude.shape)))


def _attitudes(truth: _Truth) -> list[_Parts]:
    """Return the mistakes in the quaternion's order and direction, and in the body it describes."""
    orders = {
        "the quaternion's order is x, y, z, w": _attitude(lambda q: q[:, [3, 0, 1, 2]]),
        "qx, qy, qz, qw hold w, x, y, z": _attitude(lambda q: q[:, [1, 2, 3, 0]]),
    }
    senses = {"the rotation is from world to frame (conjugate, transposed)": _attitude(conjugate)}
    frames = {"the attitude describes the shell instead of the frame": _right(_in_shell(truth, 1))}
    for S in _rotations():
        frames[_renamed("frame's", _axes_of(S))] = _right(from_matrix(S))
    return [orders, senses, frames]


def _renamed(axes: str, names: str) -> str:
    return f"the {axes} axes are others: the file's {_XYZ} are the scene's {names}"


def _in_shell(truth: _Truth, sense: int) -> Array:
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
    """Return the mistakes in the origin, the units, and the axes of the plane."""
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


def _rates(truth: _Truth) -> list[_Parts]:
    """Return the mistakes in the units, signs and axes of ω, and in the body it describes."""
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
    """Yield other axes of the world, with the scene's frame axes or frame axes renamed alike."""
    for S in _signed_permutations():
        if np.array_equal(S, np.eye(3)) or not (has_height or abs(S[2, 2]) == 1):
            continue
        names = _axes_of(S)
        names += f" ({_WORLDS[names]})" if names in _WORLDS else ""
        if np.linalg.det(S) > 0:
            yield _renamed("world's", names), _seen_from(S, both=False)
        yield _renamed("world's and the frame's", names), _seen_from(S)


def _seen_from(S: Array, both: bool = True) -> _Change:
    """Undo world axes, and frame axes too if `both`, whose i-th axis is row i of S."""
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


def _mistaken_scenes(scene: Scene) -> Iterator[_MistakenScene]:
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
    μ = scene.friction.sliding or 0.0
    for floor in _DEFAULTS if μ else ():
        rules = {"larger": max(μ, floor), "mean": (μ + floor) / 2, "product": μ * floor}
        for rule, sliding in rules.items():
            of = f"the {rule} of the ball's {μ:g} and a floor's default of {floor:g}"
            friction = replace(scene.friction, sliding=sliding)
            yield f"friction.sliding is {sliding:.3g}, {of}", (replace(scene, friction=friction),)
    yield from _starts(scene)


def _has_rate(scene: Scene, hinge: int) -> bool:
    motor, command = scene.hinges[hinge].motor, scene.hinges[hinge].command
    moves = bool(np.any(command.rate(np.linspace(0, scene.duration, 50))))
    return moves and (motor is None or isinstance(motor, Servo))


def _with_rates(scene: Scene, hinges: list[int], factor: float) -> tuple[Scene, ...]:
    """Return scenes with scaled hinge rates that keep M, the frame's ω or the shell's ω."""
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


def _slipping_scene(scene: Scene, file: Trajectory, truth: _Truth) -> Scene | None:
    """Return the scene with the friction limits and the initial slip that a file shows."""
    a, times, points = scene.ball.radius, file.times, file.position[:, :2]
    omega = (file if file.angular_velocity is not None else _with_own_rate(file)).angular_velocity
    shell = np.asarray(omega) - np.outer(truth.motion.hinge_rates[:, 0], scene.ball.shell.axis)
    velocity, turning = sampled_rates(times, points)[0], _rotated(shell, file.attitude)
    slip = scene.slip_of(times, points, velocity, turning) * [1, 1, scene.rolling == "rubber"]
    arm = float(np.trace(scene.ball.inertia)) / 3 / scene.ball.mass  # m²
    braked = sampled_rates(times, np.column_stack([velocity, arm * turning[:, 2]]))[0]
    speeds, braking = (np.array([np.hypot(*v[:, :2].T), np.abs(v[:, 2])]) for v in (slip, braked))
    sizes = speeds * [[1], [a]]
    least = _SLIPS * float(np.linalg.norm(np.hypot(velocity, a * turning[:, :2]), axis=1).max())
    fast = sizes > np.maximum(least, _FAST * sizes.max(axis=1, keepdims=True))
    # The friction N W²v/|Wv| is rvN, with r = W²/|Wv| and |Wv| = Σ rv².
    r = np.divide(braking, scene.gravity * speeds, out=np.zeros_like(speeds), where=fast)
    limits = np.sqrt(r * (r * speeds**2).sum(axis=0))
    kinds = zip(("sliding", "torsional"), limits, fast, strict=True)
    found = {kind: float(np.median(row[at])) for kind, row, at in kinds if at.any()}
    if not 0 < found.get("sliding", 1.0) < _LARGEST or not found:
        return None
    begin = slip[0] * np.repeat(sizes[:, 0] > least, [2, 1])
    friction, start = replace(scene.friction, **found), replace(scene.start, slip=begin)
    return replace(scene, friction=friction, start=start)


def _slip_name(scene: Scene) -> str:
    """Return the friction and the start of a scene that slips, as keys of a scene file."""
    friction, (x, y, spin) = scene.friction, scene.start.slip.tolist()
    limits = {"sliding": friction.sliding, "torsional": friction.torsional}
    keys = [f"friction.{key} = {limit:.2g}" for key, limit in limits.items() if limit is not None]
    keys += [f"start.slip = [{x:.3g}, {y:.3g}]"] * bool(x or y)
    keys += [f"start.spin = {spin:.3g}"] * bool(spin)
    return f"the ball slips: about {', '.join(keys)}"


# Search ------------------------------------------------------------------------------------


def _least(error: Callable[[float], float], tried: Array, xatol: float) -> float:
    """Minimize an error near the best of equally spaced values (n,)."""
    best, step = float(min(tried, key=error)), float(tried[1] - tried[0])
    bounds = best - step, best + step
    found = minimize_scalar(error, bounds=bounds, method="bounded", options={"xatol": xatol})
    return float(found.x)


def _error_at(file: Trajectory, reference: Motion) -> Callable[[Array], float]:
    """Return a function of times (n,) [s]: the trajectory's error if its rows had these times.

    The error is the root mean square of the relative path error and the attitude error. Rows with
    times outside the reference are ignored.
    """
    nodes = reference.times
    values = np.column_stack([reference.contact_point, continuous(reference.attitude)])
    motion = CubicHermiteSpline(nodes, values, sampled_rates(nodes, values)[0])

    def error(times: Array) -> float:
        inside = (times >= 0) & (times <= nodes[-1])
        path, turn = np.split(motion(times[inside]), [2], axis=1)
        apart = ((file.position[inside, :2] - path) ** 2).sum(axis=1) / reference.path_scale**2
        # The attitude error is 2|sin(angle/2)|, for either sign of the quaternions.
        cosine = np.abs((turn * file.attitude[inside]).sum(axis=1)) / np.linalg.norm(turn, axis=1)
        return float(np.sqrt(np.mean(apart + 2 * np.nan_to_num(1 - np.minimum(cosine, 1.0)))))

    return error


@dataclass(frozen=True)
class Mistake:
    """A mistake, the errors before and after its correction, and equally good alternatives."""

    family: str
    name: str
    before: Errors
    after: Errors
    as_well: tuple[str, ...]

    @property
    def left(self) -> float:
        """The smallest fraction, among the kinds of error, of the largest error that remains."""
        pairs = zip(astuple(self.after), astuple(self.before), strict=True)
        return min((after / before for after, before in pairs if before), default=SURE)

    @property
    def sure(self) -> bool:
        """Whether so little error remains that the mistake is certain."""
        return self.left <= SURE


def reference_of(scene: Scene, times: Array, **options: Any) -> Motion:
    """Integrate the scene at 0 and at the times (n,) of a trajectory; options of `integrate`."""
    return integrate(scene, times if times[0] == 0 else np.concatenate([[0.0], times]), **options)


def _truth_of(theory: Motion, times: Array, step: int = 1) -> _Truth:
    """Return the truth at every `step`-th of the times (n,) for `reference_of` these times."""
    rows = {place: array[int(times[0] != 0) :: step] for place, array in arrays_of(theory)}
    return _Truth(with_arrays(theory, rows), theory.path_scale)


@dataclass(frozen=True)
class _Candidate:
    """A mistake to try: the file's rows with the mistake corrected, and their expected values."""

    family: str
    name: str
    parts: int
    file: Trajectory
    truth: _Truth
    scene: Scene

    @cached_property
    def errors(self) -> tuple[Array, ...]:
        return _errors_at(self.file, self.truth)

    @cached_property
    def typical(self) -> Array:
        return _typical(self.errors, self.file.times)

    @property
    def sizes(self) -> Array:
        """Typical size and root mean square of each error, (2, 2 or 3)."""
        mean_square = np.sqrt(np.mean(np.square(self.errors), axis=1))
        return np.array([np.exp(self.typical), mean_square])


class Search:
    """Search a trajectory for the mistakes that explain its errors, the largest first.

    Attributes
    ----------
    plain : Errors
        The errors of the file as written.
    mistakes : tuple of Mistake
        The mistakes found.
    scene : Scene
        The scene that was simulated, according to the mistakes.
    corrected : Trajectory
        The trajectory with its conventions corrected.
    theory : Motion
        The motion of `scene` at the times of `corrected`.
    at : slice
        The rows that were searched.
    """

    def __init__(self, trajectory: Trajectory, theory: Motion) -> None:
        """Search a trajectory; the theory is its reference."""
        self.trajectory, self.theory = trajectory, theory
        # At most 2 * _SAMPLES rows, equally spaced, including the first row.
        self.at = slice(None, None, max(1, len(trajectory.times) // _SAMPLES))
        rows = rows_of(trajectory, self.at)
        truth = _truth_of(theory, trajectory.times, self.at.step)
        # The file as written, then with each accepted mistake corrected too.
        self._accepted = [_Candidate("", "", 0, rows, truth, theory.scene)]
        self.plain = _largest(self._accepted[0].errors)
        self.mistakes = tuple(self._mistakes())
        self.scene = self._accepted[-1].scene
        self.corrected = self._corrected()

    def _mistakes(self) -> list[Mistake]:
        """Return the mistakes that explain the errors.

        Correcting a mistake and all later ones must remove most of the errors that were left
        before, and nearly all of the error of path, attitude or ω. An unknown mistake can look like
        a known mistake whose correction reduces one error by chance, or only at the beginning. Such
        a candidate is dropped.
        """
        tried = list(self._lessening())
        left = [candidate.sizes for candidate in self._accepted]
        explain = [k for k in range(len(left)) if all(_explain(left[k], b) for b in left[:k])]
        self._accepted = self._accepted[: explain[-1] + 1]
        return tried[: explain[-1]]

    def _lessening(self) -> Iterator[Mistake]:
        """Yield mistakes; correcting each one reduces the errors that remain."""
        while len(self._accepted) <= _MOST_MISTAKES:
            now = self._accepted[-1]
            before = _largest(now.errors)
            families = {candidate.family for candidate in self._accepted}
            if before.rate is None:
                families.add(_RATE)
            candidates = [
                _Candidate(
                    convention.family, convention.name, convention.parts, convention.undo(now.file),
                    now.truth, now.scene,
                )
                for convention in _conventions(now.truth, self._has_height)
                if convention.family not in families
            ]  # fmt: skip
            best = _best(candidates, now)
            wrong = max(error.max() for error in now.errors[:2]) > _SOUND
            if wrong and not {_SCENE, _TIME} & families and not (best and _is_clear(best[0])):
                candidates += [replace(other, file=now.file) for other in self._scenes]
                candidates += [*self._clocks(), *self._slipping()]
                best = _best(candidates, now)
            if _RATE not in families and (before.rate or 0.0) > _ASTRAY:
                # Otherwise limited rates would get the name of the nearest convention.
                recomputed = _best([self._rate_of_attitude()], now)
                if recomputed and (best is None or _is_closer(recomputed[0], best[0])):
                    best = recomputed
            if best is None:
                return
            chosen, as_well = best
            self._accepted.append(chosen)
            yield Mistake(chosen.family, chosen.name, before, _largest(chosen.errors), as_well)

    def _corrected(self) -> Trajectory:
        """Undo the wrong conventions in all rows, and set `theory` to the motion of `scene`."""
        first, *accepted = self._accepted
        if not accepted:
            return self.trajectory
        last = accepted[-1]
        # A mistake in the clock is the same for all rows.
        (begin, end), (before, after) = last.file.times[[0, -1]], first.file.times[[0, -1]]
        times = begin + (self.trajectory.times - before) * ((end - begin) / (after - before))
        file = replace(self.trajectory, times=times, momentum=None)
        # Integrating at all rows of a long file takes as long as trying many mistakes.
        if self.theory.scene is not last.scene or self.theory.times[-1] != times[-1]:
            self.theory = reference_of(last.scene, times)
        truth = _truth_of(self.theory, times)
        known = _conventions(truth, self._has_height)
        undo = {_NOT_THE_RATE: _with_own_rate} | {c.name: c.undo for c in known}
        for candidate in accepted:
            if candidate.name in undo:
                file = undo[candidate.name](file)
        return file

    @property
    def _has_height(self) -> bool:
        return bool(np.isfinite(self.trajectory.position[0, 2]))

    @cached_property
    def _scenes(self) -> list[_Candidate]:
        """The motions of scenes that may have been simulated instead; integrated once."""
        file, candidates = self._accepted[-1].file, []
        for name, scenes in _mistaken_scenes(self._accepted[-1].scene):
            for scene in scenes:
                with contextlib.suppress(InputError):  # skip balls that nobody can have simulated
                    truth = _truth_of(reference_of(scene, file.times, rtol=_TRIED), file.times)
                    candidates.append(_Candidate(_SCENE, name, 1, file, truth, scene))
        return candidates

    def _clocks(self) -> Iterator[_Candidate]:
        """Yield the scene's motion at times of another clock."""
        file, scene = self._accepted[-1].file, self._accepted[-1].scene
        factors = np.linspace(1 - _LONGEST, 1 + _LONGEST, _STRETCHES + 1)
        late = np.linspace(-_LATE * scene.duration, file.times[0], _STRETCHES + 1)
        yield from self._clock("too long by a factor of {:.5g}", lambda x: file.times / x, factors)
        yield from self._clock("off by {:+.4g} s", lambda x: file.times - x, late)

    def _clock(
        self, name: str, clock: Callable[[float], Array], tried: Array
    ) -> Iterator[_Candidate]:
        file, scene = self._accepted[-1].file, self._accepted[-1].scene
        end = float(clock(tried[0])[-1])
        with contextlib.suppress(InputError):  # a drive may end before that time
            error = _error_at(file, integrate(scene, np.linspace(0, end, _FINE), rtol=_TRIED))
            best = _least(lambda x: error(clock(x)), tried, 1e-7)
            right = replace(file, times=clock(min(best, float(tried[-1]))))
            truth = _truth_of(reference_of(scene, right.times, rtol=_TRIED), right.times)
            name = f"the times are {name.format(best)}"
            candidate = _Candidate(_TIME, name, 1, right, truth, scene)
            # A wrong clock changes ω too. A wrong inertia may slow down only the path.
            gain = self._accepted[-1].typical - candidate.typical
            if file.angular_velocity is None or gain[2] >= _LESSENS:
                yield candidate

    def _slipping(self) -> Iterator[_Candidate]:
        """Yield the scene with the friction limits and the initial slip that fit best."""
        now = self._accepted[-1]
        if found := _slipping_scene(now.scene, now.file, now.truth):
            with contextlib.suppress(InputError):
                truth = _truth_of(reference_of(found, now.file.times, rtol=_TRIED), now.file.times)
                yield _Candidate(_SCENE, _slip_name(found), 1, now.file, truth, found)

    def _rate_of_attitude(self) -> _Candidate:
        rate = _with_own_rate(self._corrected()).angular_velocity
        file = replace(self._accepted[-1].file, angular_velocity=np.asarray(rate)[self.at])
        return replace(self._accepted[-1], family=_RATE, name=_NOT_THE_RATE, parts=1, file=file)


def _with_own_rate(file: Trajectory) -> Trajectory:
    return replace(file, angular_velocity=angular_velocity(file.times, file.attitude)[0])


def _explain(after: Array, before: Array) -> bool:
    """Return whether most of the total error is gone, and nearly all of one error."""
    all_together = np.linalg.norm(after, axis=1) * _MOST < np.linalg.norm(before, axis=1)
    return bool(all_together.all() and (after < _REMAINING * before).all(axis=0).any())


def _is_closer(recomputed: _Candidate, best: _Candidate) -> bool:
    """Return whether ω from the attitude is far more accurate than a convention of ω."""
    return best.family == _RATE and bool(best.typical[2] - recomputed.typical[2] > _LESSENS)


def _is_clear(candidate: _Candidate) -> bool:
    typical, largest = candidate.typical[:2], np.max(candidate.errors[:2])
    return bool(np.all(typical < _CLEAR[0]) and largest < _CLEAR[1])


def _best(
    candidates: Sequence[_Candidate], now: _Candidate
) -> tuple[_Candidate, tuple[str, ...]] | None:
    """Return the simplest of the best candidates, and the names of equally good ones."""
    gains = []
    for candidate in candidates:
        gain = now.typical - candidate.typical
        if gain.max() >= _LESSENS and gain.min() >= -_SPOILS:
            gains.append((float(gain.sum()), candidate))
    if not gains:
        return None
    least = max(gain for gain, _ in gains) - _AS_GOOD
    good = [candidate for gain, candidate in gains if gain > least]
    chosen = min(good, key=lambda candidate: candidate.parts)
    names = dict.fromkeys(other.name for other in good if other.parts == chosen.parts)
    return chosen, tuple(name for name in names if name != chosen.name)
