"""Poincaré sections g = g₀ of section 5.2, in both rolling models, without angles.

The section is an annulus: the points at L = ±√f differ with l. Orbits cross it in both
directions, towards larger g (+1) and smaller (-1).

Crossings of the equations are found by the compiled steps, each by steps that end on the section
(`ensembles.crossings`). A contact engine's motion is known at its samples only, but with the exact
rates there, for everything that stands still in space turns in the frame at v×ω: between samples it
follows cubic Hermite polynomials.

In order: crossings of the equations, periodic orbits, crossings of a sampled motion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from robotball.dynamics.cycles import Cycle, close
from robotball.engines.equations import integrate, scene_of
from robotball.engines.many_motions import FromStarts
from robotball.errors import InputError, check_count
from robotball.motion import Motion
from robotball.processes import Queue, in_threads
from robotball.robot import formulas as eq
from robotball.robot.ball import Rotor, Value
from robotball.robot.drives import Constant, Drive, Sine, Total
from robotball.robot.formulas import Parameters
from robotball.robot.scene import Scene, Start, along_momentum, section_state
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
    components,
    kernel_start,
    work,
)
from robotball.theory.ensembles.steppers import BALL, LEVEL, RETURN, SECTION, System, stepper

# Allowed between two crossings, where some dozens are usual: an orbit at rest never crosses.
_STEPS_PER_CROSSING = 100_000
_MOST_PERIODS = 1000  # of one drive in the common period of all
_ON_PERIOD = 1e-9  # of a period of any: what rounding leaves, where frequencies have a common one
_ON_SECTION = 1e-10  # a start that near counts as on the section, and is no crossing


@dataclass(frozen=True)
class Crossings(Value):
    """Hold the m crossings of a motion, in principal axes; or (n, m) of n motions.

    times (m,) s; gamma (m, 3); momenta (m, 3) kg m²/s; directions (m,): +1 where g grows, -1
    where it falls.
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
        """γ and M/|M| (m, 6), whose distance needs no angle.

        On the annulus (l, L) two near states may lie far apart, at L = ±√f or at l = ±π.
        """
        # Unscaled, the longer of the two vectors would decide the distance alone.
        sizes = np.linalg.norm(self.momenta, axis=-1, keepdims=True)
        return np.concatenate([self.gamma, self.momenta / sizes], axis=-1)

    def __getitem__(self, which: int | slice | Mask | tuple[int, slice]) -> "Crossings":
        """Return some of the crossings."""
        return Crossings(*(getattr(self, each.name)[which] for each in fields(Crossings)))

    def only(self, direction: int) -> "Crossings":
        """Return the crossings of one direction; all of them for 0."""
        return self[(self.directions == direction) | (direction == 0)]

    def later(self, time: float) -> "Crossings":
        """Return the crossings `time` [s] later."""
        return replace(self, times=self.times + time)


def joined(parts: Sequence[Crossings]) -> Crossings:
    """Return crossings one after the other."""
    names = [each.name for each in fields(Crossings)]
    return Crossings(*(np.concatenate([getattr(of, name) for of in parts]) for name in names))


@dataclass(frozen=True)
class Section(Crossings):
    """Hold the first m crossings of g = g₀ by n orbits, after their start.

    Attributes
    ----------
    times : (n, m), s
        The times. What was not found is NaN.
    gamma, momenta : (n, m, 3), principal axes
        The vectors γ and M, of which `l`, `L` and `states` are made.
    directions : (n, m)
        1 where g grows, -1 where it falls, 0 where nothing was found.
    attitudes : (n, m, 4), frame to world
        The attitudes.
    found : (n,)
        How many of the m crossings were found.
    status : (n,)
        How each orbit ended, as `orbits` says it.
    """

    attitudes: Array
    found: Integers
    status: Integers

    def after(self, skipped: int) -> Crossings:
        """Return each orbit's crossings but the first ones, orbit by orbit."""
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
    """Find the first `count` crossings of g = `g` [rad] by the motions from many starts.

    balls: one, or several with equally many of the starts each; attitudes (n, 4), momenta (n, 3),
    tolerance: as for `orbits`; direction: 1 or -1 for one direction only, 0 for both. On the
    section to 1e-12 of sin(g - g₀)√(1 - L²/f). Raises InputError on unusable starts, such as M = 0,
    which has no g.
    """
    starts = Starts(balls, attitudes, momenta)
    if not (starts.size > 0).all() or count < 1 or direction not in (-1, 0, 1):
        raise InputError(
            "a section needs M other than zero, a count of 1 or more, a direction ±1, 0"
        )
    m, c = (starts.rows[:, LEVEL - BALL :][:, :2] / starts.size[:, None]).T
    numbers = np.stack(np.broadcast_arrays(np.cos(g), np.sin(g), m, c), axis=1)
    found = crossings(starts, RETURN, numbers, count, direction, tolerance)
    times, states, directions, number, status = found
    world = starts.to_world(states)
    MX, MY, MZ = np.asarray(momenta, dtype=float).T[:, :, None]
    axes = eq.unit_space_axes(components(world))
    M, gamma = eq.seen_from_frame((MX, MY, MZ), axes), np.stack(axes[2], axis=-1)
    return Section(times, gamma, np.stack(M, axis=-1), directions, world, number, status)


def section(
    scene: Scene | str | Path,
    count: int = 100,
    *,
    starts: Sequence[Start] | None = None,
    g: float = 0.0,
    direction: int = 0,
) -> Section:
    """Find where motions by the equations cross a Poincaré section.

    The section is the surface g = `g` of the paper's coordinates (5.5). The scene must be balanced,
    with constant rates and M other than zero.

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
        1 for crossings where g grows, -1 where it falls, 0 for both.

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

    They are as `orbits` takes them. None stands for the scene's own start.
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

    numbers (n, k): of the section, for each start. Returns times, states (n, m, size) in turned
    axes, directions, found and status, as a Section has them.
    """
    n = len(starts.rows)
    # The numbers stand in the rows that the compiled steps read, as the ball's do.
    starts.rows[:, SECTION - BALL :][:, : numbers.shape[1]] = numbers
    times, states = np.full((n, count), np.nan), np.full((n, count, system.size), np.nan)
    directions = np.zeros((n, count), np.int64)
    found, status = np.zeros(n, np.int64), np.zeros(n, np.int64)
    results = times, states, directions, found, status
    step = stepper(system, starts.rolling)
    rows = starts.rows_of(system, np.zeros((n, 0)))
    lengths = starts.first_lengths(longest, tolerance)

    def find(queue: Queue) -> None:
        own = *work(system.size, 5), np.zeros((LANES, TRACK))
        allowed = tolerance, _STEPS_PER_CROSSING, longest, direction
        cross(step, queue, rows, lengths, *allowed, *own, *results)

    in_threads(find, math.ceil(n / LANES))
    return results


def section_starts(
    L: ArrayLike, l: ArrayLike, f: float, g: float = 0.0, c: float = 0.0
) -> tuple[Array, Array]:
    """Return attitudes (n, 4), world momenta (n, 3) of points L, l (n,) of g = `g` by (5.5).

    Raises InputError unless f > 0, L² < f and c² < f.
    """
    starts = [
        along_momentum(*section_state(float(L_), float(l_), g, f, c))
        for L_, l_ in zip(np.ravel(L), np.ravel(l), strict=True)
    ]
    return np.array([s.attitude for s in starts]), np.array([s.momentum for s in starts])


def fixed_point(parameters: Parameters, L: float, l: float, f: float) -> Cycle:
    """Return the periodic orbit near (L, l) of g = 0 that comes back at the first return.

    A fixed point of the map is one crossing of it; its multipliers are the orbit's. Raises
    InputError where Newton's method does not converge.
    """
    # The given point need not be on a crossing that the map counts: it starts at the next one.
    attitudes, momenta = section_starts(L, l, f)
    first = sections_of(parameters, attitudes, momenta, 1)
    if first.status.any():
        raise InputError("the orbit never comes back to the section")
    # From the first crossing on in its own direction alone: a return is one that crosses alike.
    direction = int(first.directions[0, 0])
    same_way = sections_of(parameters, attitudes, momenta, 2, direction=direction)
    period = float(same_way.times[0, 1] - same_way.times[0, 0])
    return close(parameters, same_way.attitudes[0, 0], momenta[0], period)


def period_of(scene: Scene) -> float:
    """Return the period [s] of all that drives a scene.

    Where mass that turns is not balanced, a mean rate has a period too: a whole turn. Raises
    InputError where there is none.
    """
    if scene.controller is not None or any(hinge.motor for hinge in scene.hinges):
        raise InputError(
            f"{scene.name}: a stroboscopic map needs given rates; what a motor moves has a state "
            "of its own"
        )
    parts = [_parts(scene, drive) for drive in (*scene.drives, *scene.plane_drives)]
    frequencies = [p.frequency for each in parts for p in each if isinstance(p, Sine)]
    if scene.not_reduced:
        for hinge, own in zip(scene.ball.hinges, parts, strict=False):
            # Over the periods of its swings a hinge turns by its mean rate alone.
            mean = sum(p.value if isinstance(p, Constant) else p.mean for p in own)
            if mean and not isinstance(hinge.body, Rotor):
                frequencies.append(abs(mean) / (2 * np.pi))
    if not frequencies:
        raise InputError(
            f"{scene.name}: nothing drives it periodically, as a stroboscopic map needs"
        )
    ratios = [Fraction(f / frequencies[0]).limit_denominator(_MOST_PERIODS) for f in frequencies]
    period = math.lcm(*(ratio.denominator for ratio in ratios)) / frequencies[0]
    if any(abs(f * period - round(f * period)) > _ON_PERIOD for f in frequencies):
        raise InputError(
            f"{scene.name}: {', '.join(f'{f:g}' for f in frequencies)} Hz have no common period"
        )
    return period


def _parts(scene: Scene, drive: Drive) -> list[Constant | Sine]:
    """Return what a drive is the sum of. Raises InputError unless that is constant or sines."""
    parts = drive.drives if isinstance(drive, Total) else (drive,)
    known = [part for part in parts if isinstance(part, Constant | Sine)]
    if len(known) < len(parts):
        raise InputError(
            f"{scene.name}: a stroboscopic map needs constant rates and sines, not a ramp, samples "
            "or a function"
        )
    return known


def strobed(
    scene: Scene, attitudes: Array, momenta: Array, count: int, rtol: float = LONG_RUN_TOLERANCE
) -> tuple[Array, Array]:
    """Return the attitudes (n, m, 4) and momenta (n, m, 3) once a period, after each of n starts.

    The points of the section phase = 0. attitudes (n, 4), of the principal axes, and momenta
    (n, 3), world; rtol: the error of a step. Raises InputError where the scene is not periodic, the
    ball lifts off, or the steps are used up.
    """
    times: Array = np.linspace(0.0, count * period_of(scene), count + 1)
    found = []
    for q, M in zip(attitudes, momenta, strict=True):
        motion = integrate(replace(scene, start=own_start(scene, q, M)), times, rtol)
        found.append((motion.attitude[1:], motion.momentum[1:]))
    ends, M = (np.array(each) for each in zip(*found, strict=True))
    return multiply(ends, scene.principal_quaternion), M


def stroboscopic_map(
    scene: Scene, attitudes: Array, momenta: Array, rtol: float = LEAST_RTOL
) -> tuple[Array, Array]:
    """Return attitudes (n, 4) and momenta (n, 3) a period later, a `Flow` of a scene."""
    ends, M = strobed(scene, attitudes, momenta, 1, rtol)
    return ends[:, 0], M[:, 0]


def own_start(scene: Scene, attitude: Array, momentum: Array) -> Start:
    """Return a start in the frame's own axes, given in principal axes, which the equations have."""
    return Start(multiply(attitude, conjugate(scene.principal_quaternion)), momentum)


def crossings_of_motion(motion: Motion, scene: Scene, g: float = 0.0) -> Crossings:
    """Find where a motion of `scene` crosses g = `g` [rad].

    Between samples by cubics through values and rates, as γ and M are constant in space. Their
    error is h⁴/384 of the fourth derivative for samples h apart: 3e-9 s for the catalog's balls
    sampled every 5 ms. Raises InputError where M = 0.
    """
    axes, times = rotation_matrix(motion.attitude) @ scene.principal_axes, motion.times
    gamma, M = axes[:, 2], np.einsum("nji,nj->ni", axes, motion.momentum)
    omega = motion.angular_velocity @ scene.principal_axes
    f, c = (M * M).sum(axis=1, keepdims=True), (M * gamma).sum(axis=1, keepdims=True)
    if not f.min() > 0:
        raise InputError("a section needs M other than zero, which has no g")
    across = np.sqrt(1 - c * c / f)
    node = (gamma - c / f * M) / across
    beta = np.cross(M, node) / np.sqrt(f)
    # √(1 - L²/f) (sin g, cos g) = (-β₃, -γ₀₃), as in systems.section_function. No angle is needed,
    # so that nothing jumps by a turn.
    ahead, facing = np.sin(g) * node - np.cos(g) * beta, np.cos(g) * node + np.sin(g) * beta
    value, rate = ahead[:, 2], np.cross(ahead, omega)[:, 2]
    at = CubicHermiteSpline(times, value, rate)
    found = at.roots(extrapolate=False)
    # A start on the section is no crossing; its own root may come out a little later.
    if abs(value[0]) < _ON_SECTION:
        found = found[found > times[1]]
    crossed = Crossings(
        times=found,
        gamma=CubicHermiteSpline(times, gamma, np.cross(gamma, omega))(found),
        momenta=CubicHermiteSpline(times, M, np.cross(M, omega))(found),
        directions=np.sign(at(found, 1)).astype(int),
    )
    # sin(g - g₀) is zero at g₀ + π as well; the cosine's sign decides.
    faces = CubicHermiteSpline(times, facing[:, 2], np.cross(facing, omega)[:, 2])(found)
    return crossed[faces < 0]
