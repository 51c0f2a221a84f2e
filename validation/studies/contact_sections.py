"""Poincaré sections of the contact model beside those of the equations, and `robotball section`.

MuJoCo's section map goes from crossing to crossing of g = 0. A run of many returns is cut into
stretches, each begun on the constraints again and with the momentum it started from: so an
attractor is seen at its own level of M² however long the run is.

Long-run motion needs a scene that is suited to it, and starts on the scene's level of M² and (M,
γ), which every motion keeps. A recipe of a cloud of section points says from which starts, drawn by
a seed, after how many returns, and how many crossings are taken. Two clouds are compared by their
energy distance, and by its rank among those of clouds that the equations drew.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from robotball import InputError, Motion, Scene, Settings, load_scene, preset, sample_times
from robotball.engines.ensembles.orbits import LONG_RUN_TOLERANCE
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.equations import Parameters
from robotball.errors import check_count, check_seed
from robotball.qualitative.sections import (
    Crossings,
    crossings_of_motion,
    joined,
    own_start,
    period_of,
    section,
    section_starts,
    strobed,
)
from robotball.qualitative.straight_motions import straight_motions
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Start
from validation.options import AGREES, OUT, File, Preset, SceneName, Threads
from validation.output import panels, progress_bar, writable_folder, write_picture, write_record
from validation.results import changed, file_name

_STRETCH = 100.0  # s; in it M drifts by a few millionths at most
_NO_RETURN = 100  # stretches without enough crossings, after which a run is given up


def sound_run(model: Model, start: Start, times: Array) -> Motion:
    """Return the motion over times (n,) [s]. Raises InputError where it has a fault."""
    motion = run(model, times, scene=replace(model.scene, start=start))
    if motion.report.faults:
        raise InputError(f"{LABEL.name}'s run is no result: {motion.report.faults[0]}")
    return motion


def by_contact(settings: Settings, scene: Scene, times: Array) -> Motion:
    """Return a scene's motion as `sound_run` does, from its own start."""
    return sound_run(build(scene, settings), scene.start, times)


def each_step(model: Model, duration: float) -> Array:
    """Return the times (n,) of a model's steps [s]."""
    return sample_times(duration, model.compiled.opt.timestep)


def _returns(
    model: Model, start: Start, count: int, direction: int = 1
) -> tuple[Crossings, float, Array]:
    """Return the first `count` crossings of g = 0 in a direction (0: in both).

    Besides, how long the run was [s], and the contact point's displacement (2,) over it [m]. Raises
    InputError where a run has a fault, or does not come back often enough.
    """
    found: list[Crossings] = []
    moved, at = np.zeros(2), start
    # Chaotic returns may be far apart, but not for ever.
    for stretch in range(_NO_RETURN * count):
        motion = sound_run(model, at, each_step(model, _STRETCH))
        some = crossings_of_motion(motion, model.scene).only(direction)
        found.append(some.later(stretch * _STRETCH))
        moved = moved + motion.contact_point[-1]
        # M as it was at first, not at the end: else the run would drift from its level of M², on
        # which the attractor depends.
        at = Start(motion.attitude[-1], start.momentum)
        if sum(len(each.times) for each in found) >= count:
            return joined(found)[:count], (stretch + 1) * _STRETCH, moved
    raise InputError(f"{LABEL.name}'s ball does not come back to the section")


def level_starts(scene: Scene, count: int, seed: int, g: float = 0.0) -> tuple[Array, Array]:
    """Return starts on the scene's level of M: attitudes (n, 4) and world momenta (n, 3).

    Attitudes are of the principal axes. The scene's own start for a count of 1, else random points
    of its section g = `g`.
    """
    check_count("starts", count, 1)
    check_seed(seed)
    M = scene.start.momentum
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    if count == 1:
        return attitude[None], M[None]
    if not M.any():
        raise InputError(
            f"{scene.name} starts from rest, and random starts have its M²: give it one"
        )
    # The rubber model's M is horizontal by (3.1).
    c = float(M[2]) if scene.rolling == "classical" else 0.0
    return _random_starts(float(M @ M), count, seed, g, c)


def _random_starts(
    f: float, count: int, seed: int, g: float = 0.0, c: float = 0.0
) -> tuple[Array, Array]:
    """Return starts evenly over the annulus of the section g = `g`."""
    random = np.random.default_rng(seed)
    L = random.uniform(-1.0, 1.0, count) * np.sqrt(f)
    return section_starts(L, random.uniform(-np.pi, np.pi, count), f, g, c)


def steady_scene(name: str, purpose: str) -> Scene:
    """Load a scene whose rates are constant. Raises InputError for any other."""
    scene = load_scene(name)
    if not scene.steady:
        raise InputError(
            f"{scene.name}: its drives change in time, and {purpose} needs constant rates; "
            f"'robotball compare {name}' shows its motion"
        )
    return scene


def moving_scene(name: str, purpose: str) -> Scene:
    """Load a steady scene with a momentum. Raises InputError for a start from rest, M = 0."""
    scene = steady_scene(name, purpose)
    if not np.any(scene.start.momentum):
        raise InputError(
            f"{scene.name} starts from rest, and {purpose} needs a momentum M other than zero; "
            f"'robotball equilibria {name}' shows the motion from rest"
        )
    return scene


def attracted_scene(name: str, purpose: str) -> Scene:
    """Load a moving scene that has attractors.

    Raises InputError where Ω = 0, and phase volume is kept.
    """
    scene = moving_scene(name, purpose)
    if not np.any(scene.parameters.Omega):
        raise InputError(
            f"{scene.name}: its frame does not turn (Ω = 0), so phase volume is kept and there "
            f"are no attractors; 'robotball section {name}' shows its motion"
        )
    return scene


def _may_come_to_rest(scene: Scene) -> bool:
    """Return whether a straight-line motion with the scene's M² attracts: motions may end there."""
    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    if ball.rolling != "rubber" or not np.any(ball.Omega):
        return False
    return any(line.is_stable for line in straight_motions(ball, f))


# An attractor forgives a longer step as well: 3e-5 of a path in 10 s at this one, in a third of
# the time that "fast" takes. The contact's time constant must not be below two steps.
COARSE: Settings = replace(
    preset("fast"), name="coarse", timestep=0.05, solref=(0.1, 1.0), error_tolerance=1e-3
)


@dataclass(frozen=True)
class Recipe:
    """A cloud of section points: from `starts` starts, `count` crossings of each after `skipped`.

    f = M² (kg m²/s)² and c = (M, γ) [kg m²/s] of every start; direction: of the crossings, ±1 or 0
    for both.
    """

    f: float
    starts: int
    skipped: int
    count: int
    direction: int = 1
    c: float = 0.0

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3), evenly over the annulus."""
        return _random_starts(self.f, self.starts, seed, c=self.c)


@dataclass(frozen=True, kw_only=True)
class Torus(Recipe):
    """The cloud of a limit torus, from starts evenly within `spread` of (L, l) on g = 0.

    spread is in kg m²/s and rad.
    """

    L: float
    l: float
    spread: float

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3)."""
        offsets = np.random.default_rng(seed).uniform(-self.spread, self.spread, (2, self.starts))
        return section_starts(self.L + offsets[0], self.l + offsets[1], self.f)


def cloud_by_equations(parameters: Parameters, recipe: Recipe, seed: int) -> Crossings:
    """Return the recipe's cloud by the equations.

    Raises InputError where a start gives too few points.
    """
    attitudes, momenta = recipe.points(seed)
    total = recipe.skipped + recipe.count
    found = section(
        parameters, attitudes, momenta, total, 0.0, recipe.direction, LONG_RUN_TOLERANCE
    )
    if found.status.any():
        raise InputError(f"{np.count_nonzero(found.status)} starts do not keep crossing g = 0")
    return found.after(recipe.skipped)


def cloud_by_contact(
    scene: Scene,
    settings: Settings,
    recipe: Recipe,
    seed: int,
    progress: Callable[[float], object] = lambda part: None,
) -> tuple[Crossings, Array]:
    """Return the recipe's cloud by MuJoCo, and the mean velocity from each of its starts.

    velocities (starts, 2): of the contact point, along OX = -M/√f and OY [m/s]. Raises InputError
    where a run has a fault.
    """
    parts, velocities, model = [], [], build(scene, settings)
    for i, (attitude, momentum) in enumerate(zip(*recipe.points(seed), strict=True)):
        start = own_start(scene, attitude, momentum)
        found, duration, moved = _returns(
            model, start, recipe.skipped + recipe.count, recipe.direction
        )
        parts.append(found[recipe.skipped :])
        velocities.append(moved / duration)
        progress((i + 1) / recipe.starts)
    return joined(parts), np.array(velocities)


_NEIGHBOURS = 8


def distance(cloud: Array, reference: Array) -> float:
    """Return 2E|x - y| - E|x - x'| of clouds (n, k), (m, k).

    That is their energy distance, but for a part that depends on the reference alone.
    """
    return float(2 * cdist(cloud, reference).mean() - cdist(cloud, cloud).mean())


def rank_probability(cloud: Array, peers: Sequence[Array], reference: Array) -> float:
    """Return how probable it is that by chance `cloud` is so far from `reference`, or farther.

    peers: clouds drawn by the very recipe that `cloud` claims to be drawn by, each from starts of
    its own. If the claim is true all of them and `cloud` are exchangeable, so the rank of its
    energy distance from the reference is uniform: exactly, however correlated the points of one
    cloud are. The least value is 1/(1 + number of peers).
    """
    ours = distance(cloud, reference)
    return (1 + sum(distance(peer, reference) >= ours for peer in peers)) / (1 + len(peers))


def distance_to_curve(points: Array, curve: Array) -> Array:
    """Return how far points (n, k) are from a curve given by many points (m, k) of it, (n,).

    The distance is to the straight line that fits the nearest few best. It misses a curve of
    curvature κ by κs²/2 where those few reach s along it.
    """
    _, nearest = cKDTree(curve).query(points, k=_NEIGHBOURS)
    near = curve[nearest]
    # A line through the neighbours, not the nearest of them: the spacing of the points would be
    # taken for a distance.
    middle = near.mean(axis=1, keepdims=True)
    along = np.linalg.svd(near - middle, full_matrices=False)[2][:, 0]
    arm = points - middle[:, 0]
    across = arm - (arm * along).sum(axis=1, keepdims=True) * along
    return np.linalg.norm(across, axis=1)


def _at_phase(period: float, attitudes: Array, momenta: Array, skip: int) -> Crossings:
    """Return points once a period [s], after the first `skip`: (n, m, 4) and (n, m, 3), joined."""
    attitudes, momenta = attitudes[:, skip:], momenta[:, skip:]
    axes = rotation_matrix(attitudes).reshape(-1, 3, 3)
    M = np.einsum("nij,ni->nj", axes, momenta.reshape(-1, 3))
    times = np.tile(period * np.arange(skip + 1, skip + 1 + momenta.shape[1]), len(momenta))
    return Crossings(times, axes[:, 2], M, np.ones(len(M), int))


def _draw_section(scene: Scene, theory: Crossings, engine: Crossings | None, where: str) -> Figure:
    """Draw the section's points on the annulus; filled where g grows, paler where it falls."""
    figure, axes = panels(f"{scene.title}: section {where}", (8.0, 6.0))
    # Dots shrink with their number, lest they fill what is a curve.
    size = 1.2 if len(theory.l) >= 5000 else 3.0 if engine is None else 7.0
    drawn = [(EQUATIONS.name, theory, EQUATIONS.colour, "o", size)]
    if engine is not None:
        drawn.append((LABEL.name, engine, LABEL.colour, "+", 5.0))
    sides = [(1, 1.0, ", g grows"), (-1, 0.4, ", g falls")]
    if not where.startswith("g"):  # a phase grows always
        sides = [(1, 1.0, "")]
    for name, points, colour, mark, size in drawn:
        for direction, alpha, words in sides:
            some = points[points.directions == direction]
            axes.plot(some.l % (2 * np.pi), some.L, mark, color=colour,
                      alpha=alpha, markersize=size, markeredgewidth=0 if mark == "o" else 0.8,
                      label=f"{name}{words}")  # fmt: skip
    size = max(float(np.linalg.norm(scene.start.momentum)), float(np.abs(theory.L).max()))
    axes.set(xlabel="l [rad], from 0 to 2π", ylabel="L [kg m²/s]",
             xlim=(0, 2 * np.pi), ylim=(-1.05 * size, 1.05 * size))  # fmt: skip
    axes.legend(loc="best", markerscale=2 if engine is None else 1)
    return figure


@dataclass(frozen=True)
class Section:
    """Draw a scene's Poincaré section on the annulus (l, L): g = g₀, or a phase of its drives.

    Example: robotball section fig12 --starts 4 --count 500
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    starts: int = 1
    """Motions to follow: the scene's own alone, or as many random ones with its M² and (M, γ)."""
    count: int = 2000
    """Crossings of each."""
    skip: int = 0
    """Crossings of each to leave out first."""
    g: float = 0.0
    """The section's g₀ [rad]."""
    preset: Preset = None
    """Draw the engine's crossings as well, of the scene's own start, with these settings."""
    seed: int = 0
    """The seed of the random starts."""
    out: Path = OUT
    """Folder for the picture."""
    threads: Threads = None
    json: File = None
    """Also write the points."""

    def run(self) -> int:
        scene = load_scene(self.scene)
        period = None if scene.steady and not scene.not_reduced else period_of(scene)
        if period is None:
            scene = moving_scene(self.scene, "a section")
        elif self.g:
            raise InputError(f"{scene.name}: its section is a phase of its drives, without a g")
        settings = None if self.preset is None else preset(self.preset)
        words = ["section", *changed(self, "starts", "count", "skip", "g", "seed")]
        by, first = (None, []) if settings is None else (LABEL, [settings.name])
        path = writable_folder(self.out) / f"{file_name(scene.name, by, [*first, *words])}.png"
        attitudes, momenta = level_starts(scene, self.starts, self.seed, self.g)
        total = check_count("skip", self.skip, 0) + check_count("count", self.count, 1)
        with progress_bar(1 if settings is None else 2) as show:
            show(0, f"{scene.name}: equations")
            points, engine = self._by_equations(scene, attitudes, momenta, period), None
            if settings is not None:
                show(1, f"{scene.name}: {LABEL.name}, {settings.name}")
                model = build(scene, settings)
                if period is None:
                    times = each_step(model, points.times[self.count - 1])
                    motion = sound_run(model, scene.start, times)
                    engine = crossings_of_motion(motion, scene, self.g)[self.skip :]
                else:
                    motion = sound_run(model, scene.start, period * np.arange(total + 1.0))
                    ends = multiply(motion.attitude[1:], scene.principal_quaternion)
                    engine = _at_phase(period, ends[None], motion.momentum[None, 1:], self.skip)
            where = f"g = {self.g:g}" if period is None else f"once in {period:.6g} s"
            write_picture(path, _draw_section(scene, points, engine, where))
        drawn = {EQUATIONS.name: points} | ({} if engine is None else {LABEL.name: engine})
        for name, each in drawn.items():
            growing, total = np.count_nonzero(each.directions == 1), len(each.l)
            if period is not None:
                print(f"{name}: {total} points, {where}")
                continue
            print(f"{name}: {total} crossings, {growing} with g growing, {total - growing} falling")
        if period is None and _may_come_to_rest(scene):
            print("a straight-line motion with this M² attracts: what ends there crosses only by")
            print(f"rounding; 'robotball equilibria {self.scene}' lists it")
        print(path)
        write_record(
            self.json,
            {"scene": scene.name, "g": self.g, "starts": self.starts, "seed": self.seed}
            | ({} if period is None else {"period": period})
            | {
                by: {name: getattr(of, name).tolist() for name in ("times", "l", "L", "directions")}
                for by, of in drawn.items()
            },
        )
        return AGREES

    def _by_equations(
        self, scene: Scene, attitudes: Array, momenta: Array, period: float | None
    ) -> Crossings:
        """Return the points of the motions from some starts, as `level_starts` gives them."""
        if period is not None:
            ends, M = strobed(scene, attitudes, momenta, self.skip + self.count)
            return _at_phase(period, ends, M, self.skip)
        found = section(scene.parameters, attitudes, momenta, self.skip + self.count, self.g)
        if lost := np.count_nonzero(found.status):
            raise InputError(f"{lost} motions do not keep crossing g = {self.g:g}")
        return found.after(self.skip)
