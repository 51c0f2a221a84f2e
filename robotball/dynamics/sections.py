"""Poincaré sections g = g₀ of section 5.2, for both rolling models.

The section is an annulus, because at L = ±√f different l are different points. Orbits cross it in
both directions, towards larger g (+1) and smaller g (-1).

Compiled steps of the equations end exactly on the section (`ensembles.crossings`). For a contact
engine's motion, values and exact rates are known at the samples, because a vector v that is
constant in space has the rate v×ω in frame axes. Between samples the values are interpolated with
cubic Hermite polynomials.

In order: crossings of the equations, stroboscopic maps, crossings of a sampled motion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from robotball.engines.equations import integrate, scene_of
from robotball.engines.many_motions import FromStarts
from robotball.errors import InputError, check_count
from robotball.motion import Motion
from robotball.processes import Queue, in_threads
from robotball.robot.ball import Rotor, Value
from robotball.robot.drives import Constant, Drive, Sine, Total
from robotball.robot.formulas import Parameters
from robotball.robot.scene import Scene, Start, aligned, section_state
from robotball.rotations import Array, Mask, conjugate, multiply, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.ensembles.crossings import TRACK, cross
from robotball.theory.ensembles.flatten import LANES
from robotball.theory.ensembles.orbits import (
    LONG_RUN_TOLERANCE,
    STEP_TOLERANCE,
    Balls,
    Integers,
    Starts,
    kernel_start,
    work,
)
from robotball.theory.ensembles.steppers import BALL, LEVEL, RETURN, SECTION, System, stepper
from robotball.theory.plane import check_no_turn

# Limit of the steps between two crossings. A few dozen are usual; an orbit at rest never crosses.
_STEPS_PER_CROSSING = 100_000
_MOST_PERIODS = 1000  # largest number of one drive's periods in the common period
_ON_PERIOD = 1e-9  # of a period: rounding of commensurable frequencies
_ON_SECTION = 1e-10  # a start nearer than this is on the section, and is not a crossing


@dataclass(frozen=True)
class Crossings(Value):
    """The m crossings of a motion in principal axes, or (n, m) crossings of n motions.

    times (m,) [s]; gamma (m, 3); momenta (m, 3) [kg m²/s]; directions (m,): +1 if g increases, -1
    if it decreases.
    """

    times: Array
    gamma: Array
    momenta: Array
    directions: Integers

    @property
    def l(self) -> Array:  # noqa: E743
        """l (m,) of (5.5), rad."""
        return np.arctan2(self.momenta[..., 0], self.momenta[..., 1])

    @property
    def L(self) -> Array:
        """L (m,) of (5.5), kg m²/s."""
        return self.momenta[..., 2]

    @property
    def states(self) -> Array:
        """γ and M/|M| (m, 6), for distances without angles.

        In (l, L) two near states may be far apart: near L = ±√f, or at l = ±π.
        """
        # Scaled, so that both vectors have the same weight in a distance.
        sizes = np.linalg.norm(self.momenta, axis=-1, keepdims=True)
        return np.concatenate([self.gamma, self.momenta / sizes], axis=-1)

    def __getitem__(self, which: int | slice | Mask | tuple[int, slice]) -> "Crossings":
        """Return a subset of the crossings."""
        return Crossings(*(getattr(self, field.name)[which] for field in fields(Crossings)))

    def only(self, direction: int) -> "Crossings":
        """Return the crossings in one direction; all of them if it is 0."""
        return self[(self.directions == direction) | (direction == 0)]


def joined(parts: Sequence[Crossings]) -> Crossings:
    """Return the concatenated crossings."""
    names = [field.name for field in fields(Crossings)]
    return Crossings(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class Section(Crossings):
    """Hold the first m crossings of g = g₀ by n orbits.

    Attributes
    ----------
    times : (n, m), s
        NaN if not found.
    gamma, momenta : (n, m, 3), principal axes
        The vectors γ and M.
    directions : (n, m)
        1 if g increases, -1 if it decreases, 0 if not found.
    attitudes : (n, m, 4)
        Quaternions of the rotation from frame to world axes.
    found : (n,)
        How many of the m crossings were found.
    status : (n,)
        How each orbit ended; see `orbits`.
    """

    attitudes: Array
    found: Integers
    status: Integers

    def after(self, skipped: int) -> Crossings:
        """Return the crossings of all orbits, without the first `skipped` of each orbit."""
        return joined([self[i, skipped:] for i in range(len(self.times))])


def sections_of(
    balls: Balls,
    attitudes: Array,
    momenta: Array,
    count: int,
    g: float = 0.0,
    direction: int = 0,
    tolerance: float = STEP_TOLERANCE,
) -> Section:
    """Find the first `count` crossings of g = `g` [rad] by the motions from n starts.

    balls: one ball, or several balls with equally many starts each. attitudes (n, 4), momenta (n,
    3) and tolerance: as for `orbits`. direction: 1 or -1, or 0 for both directions. Crossings are
    accurate to 1e-12 in sin(g - g₀)√(1 - L²/f). Raises InputError for invalid starts, and for M =
    0, where g is undefined.
    """
    starts = Starts(balls, attitudes, momenta)
    if not (starts.size > 0).all() or count < 1 or direction not in (-1, 0, 1):
        raise InputError(
            "a section needs a nonzero M, a count of at least 1, and the direction 1, -1 or 0"
        )
    m, c = (starts.rows[:, LEVEL - BALL :][:, :2] / starts.size[:, None]).T
    numbers = np.stack(np.broadcast_arrays(np.cos(g), np.sin(g), m, c), axis=1)
    results = crossings(starts, RETURN, numbers, count, direction, tolerance)
    times, states, directions, number, status = results
    world = starts.to_world(states)
    axes = rotation_matrix(world)
    M = np.einsum("ni,nmij->nmj", momenta, axes)
    return Section(times, axes[..., 2, :], M, directions, world, number, status)


def section(
    scene: Scene | str | Path,
    count: int = 100,
    *,
    starts: Sequence[Start] | None = None,
    g: float = 0.0,
    direction: int = 0,
) -> Section:
    """Integrate motions and find their crossings of a Poincaré section.

    The section is the surface g = `g` of the paper's coordinates (5.5). The scene must be balanced,
    with constant rates and M ≠ 0.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    count : int, default 100
        The number of crossings of each motion.
    starts : sequence of Start, optional
        The starts of the motions. The default is the start of the scene.
    g : float, default 0, rad
        The value of g on the section.
    direction : {0, 1, -1}, default 0
        1 for crossings with increasing g, -1 for crossings with decreasing g, 0 for all.

    Returns
    -------
    Section
        The crossings, one row for each start.

    Raises
    ------
    InputError
        If the paper's equations do not describe the scene, if its rates change, if M is zero, or if
        `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> found = rb.section("fig12", 4)
    >>> found.times.shape, found.directions[0].tolist()
    ((1, 4), [1, -1, 1, -1])
    >>> print(f"{found.L[0, 2]:.3f} kg m²/s")
    -1.910 kg m²/s
    """
    return sections_of(*starts_of(scene, starts), count, g, direction)


def starts_of(
    scene: Scene | str | Path, starts: Sequence[Start] | None
) -> tuple[Parameters, Array, Array]:
    """Return a scene's Parameters, and the attitudes (n, 4) and momenta (n, 3) of its starts.

    These values are arguments for `orbits`. If `starts` is None, the scene's start is used.
    """
    scene = scene_of(scene)
    scenes = [scene] if starts is None else FromStarts(scene, starts)
    check_count("the number of starts", len(scenes), 1)
    _, attitudes, momenta = zip(*map(kernel_start, scenes), strict=True)
    return scene.parameters, np.concatenate(attitudes), np.concatenate(momenta)


def crossings(
    starts: Starts,
    system: System,
    numbers: Array,
    count: int,
    direction: int,
    tolerance: float,
    longest: float = np.inf,
) -> tuple[Array, Array, Integers, Integers, Integers]:
    """Find the first `count` zeros of a system's section function, within `longest` [s].

    numbers (n, k): parameters of the section for each start. Returns times (n, m), states
    (n, m, size) in axes aligned with M, and directions, found and status as in `Section`.
    """
    n = len(starts.rows)
    # The compiled steps read the section's parameters from the same rows as the ball's parameters.
    starts.rows[:, SECTION - BALL :][:, : numbers.shape[1]] = numbers
    times, states = np.full((n, count), np.nan), np.full((n, count, system.size), np.nan)
    directions = np.zeros((n, count), np.int64)
    found, status = np.zeros(n, np.int64), np.zeros(n, np.int64)
    results = times, states, directions, found, status
    step = stepper(system, starts.rolling)
    rows = starts.rows_of(system, np.zeros((n, 0)))
    lengths = starts.first_lengths(longest, tolerance)

    def find(queue: Queue) -> None:
        buffers = *work(system.size, 5), np.zeros((LANES, TRACK))
        limits = tolerance, _STEPS_PER_CROSSING, longest, direction
        cross(step, queue, rows, lengths, *limits, *buffers, *results)

    in_threads(find, math.ceil(n / LANES))
    return results


def section_starts(
    L: ArrayLike, l: ArrayLike, f: float, g: float = 0.0, c: float = 0.0
) -> tuple[Array, Array]:
    """Return attitudes (n, 4) and world momenta (n, 3) of section points L, l (n,), by (5.5).

    Raises InputError unless f > 0, L² < f and c² < f.
    """
    return aligned(*section_state(np.ravel(L), np.ravel(l), g, f, c))


def period_of(scene: Scene) -> float:
    """Return the common period [s] of all drives of a scene.

    If a rotating body is not balanced, its mean rate contributes the period of a full turn. Raises
    InputError if there is no period.
    """
    check_no_turn(scene, "a stroboscopic map")  # it would depend on the ball's position
    if scene.controller is not None or any(hinge.motor for hinge in scene.hinges):
        raise InputError(
            f"{scene.name}: a stroboscopic map needs prescribed rates; motors and controllers have "
            "states of their own: remove them"
        )
    parts = [_parts(scene, drive) for drive in (*scene.drives, *scene.plane_drives)]
    frequencies = [part.frequency for p in parts for part in p if isinstance(part, Sine)]
    if scene.not_reduced:
        for hinge, terms in zip(scene.ball.hinges, parts, strict=False):
            # Sines cancel over their period, so only the mean rate turns the hinge.
            mean = sum(p.value if isinstance(p, Constant) else p.mean for p in terms)
            if mean and not isinstance(hinge.body, Rotor):
                frequencies.append(abs(mean) / (2 * np.pi))
    if not frequencies:
        raise InputError(f"{scene.name}: a stroboscopic map needs a periodic drive, such as a Sine")
    ratios = [Fraction(f / frequencies[0]).limit_denominator(_MOST_PERIODS) for f in frequencies]
    period = math.lcm(*(ratio.denominator for ratio in ratios)) / frequencies[0]
    if any(abs(f * period - round(f * period)) > _ON_PERIOD for f in frequencies):
        raise InputError(
            f"{scene.name}: {', '.join(f'{f:g}' for f in frequencies)} Hz have no common period"
        )
    return period


def _parts(scene: Scene, drive: Drive) -> list[Constant | Sine]:
    """Return the terms of a drive. Raises InputError unless they are constants or sines."""
    parts = drive.drives if isinstance(drive, Total) else (drive,)
    terms = [part for part in parts if isinstance(part, Constant | Sine)]
    if len(terms) < len(parts):
        raise InputError(
            f"{scene.name}: a stroboscopic map needs constant rates and sines, not a ramp, samples "
            "or a function"
        )
    return terms


def strobed(
    scene: Scene, attitudes: Array, momenta: Array, count: int, rtol: float = LONG_RUN_TOLERANCE
) -> tuple[Array, Array]:
    """Return attitudes (n, m, 4) and momenta (n, m, 3) after each of m = `count` periods.

    These are the points of the section at drive phase 0. attitudes (n, 4): of the principal axes.
    momenta (n, 3): in world axes. rtol: relative error of a step. Raises InputError if the scene is
    not periodic, the ball lifts off or the step limit is reached.
    """
    times: Array = np.linspace(0.0, count * period_of(scene), count + 1)
    samples = []
    for q, M in zip(attitudes, momenta, strict=True):
        motion = integrate(replace(scene, start=own_start(scene, q, M)), times, rtol)
        samples.append((motion.attitude[1:], motion.momentum[1:]))
    ends, M = (np.array(values) for values in zip(*samples, strict=True))
    return multiply(ends, scene.principal_quaternion), M


def stroboscopic_map(
    scene: Scene, attitudes: Array, momenta: Array, rtol: float = LEAST_RTOL
) -> tuple[Array, Array]:
    """Return attitudes (n, 4) and momenta (n, 3) one period later; a `cycles.Flow`."""
    ends, M = strobed(scene, attitudes, momenta, 1, rtol)
    return ends[:, 0], M[:, 0]


def own_start(scene: Scene, attitude: Array, momentum: Array) -> Start:
    """Return a scene's start from a principal axes' attitude (4,) and M (3,) in world axes."""
    return Start(multiply(attitude, conjugate(scene.principal_quaternion)), momentum)


def crossings_of_motion(motion: Motion, scene: Scene, g: float = 0.0) -> Crossings:
    """Find the crossings of g = `g` [rad] in a sampled motion of `scene`.

    γ and M are interpolated with cubic polynomials. The error is h⁴/384 times the fourth derivative
    for a sample interval h: 3e-9 s for the catalog's balls sampled every 5 ms. Raises InputError if
    M = 0.
    """
    axes, times = rotation_matrix(motion.attitude) @ scene.principal_axes, motion.times
    gamma, M = axes[:, 2], np.einsum("nji,nj->ni", axes, motion.momentum)
    omega = motion.angular_velocity @ scene.principal_axes
    f, c = (M * M).sum(axis=1, keepdims=True), (M * gamma).sum(axis=1, keepdims=True)
    if not f.min() > 0:
        raise InputError("a section needs a nonzero momentum M: g is undefined at M = 0")
    across = np.sqrt(1 - c * c / f)
    node = (gamma - c / f * M) / across
    beta = np.cross(M, node) / np.sqrt(f)
    # √(1 - L²/f) (sin g, cos g) = (-β₃, -γ₀₃), as in systems.section_function: free of angles, so
    # nothing jumps by 2π.
    ahead, facing = np.sin(g) * node - np.cos(g) * beta, np.cos(g) * node + np.sin(g) * beta
    value, rate = ahead[:, 2], np.cross(ahead, omega)[:, 2]
    at = CubicHermiteSpline(times, value, rate)
    roots = at.roots(extrapolate=False)
    # A start on the section does not count, but rounding may move its root to a slightly later
    # time.
    if abs(value[0]) < _ON_SECTION:
        roots = roots[roots > times[1]]
    crossed = Crossings(
        times=roots,
        gamma=CubicHermiteSpline(times, gamma, np.cross(gamma, omega))(roots),
        momenta=CubicHermiteSpline(times, M, np.cross(M, omega))(roots),
        directions=np.sign(at(roots, 1)).astype(int),
    )
    # sin(g - g₀) vanishes at g₀ + π, too: the sign of the cosine decides.
    faces = CubicHermiteSpline(times, facing[:, 2], np.cross(facing, omega)[:, 2])(roots)
    return crossed[faces < 0]
