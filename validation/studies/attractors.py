"""Attractors and exponents by the contact engine, each claim of Fig. 11 beside the equations.

The commands are `robotball attractors`; `robotball basins`, which counts the random starts of a
scene that reach each of its attractors; and `robotball lyapunov`, which measures exponents.

For the largest exponent two motions of the contact model run side by side. After every interval
both are put back on the constraints, with the momentum that they started from, and the second is
brought back to a small distance from the first: a contact model has motions of its own, slipping
and spinning, and other levels of M², which are not of interest.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robotball import load_scene, preset, sample_times
from robotball.engines.ensembles.orbits import Starts
from robotball.engines.ensembles.steppers import DEVIATION
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.equations import Parameters
from robotball.errors import check_count
from robotball.processes import allowed
from robotball.qualitative.long_run import (
    CHAOS,
    LINE,
    LOST,
    Exponents,
    basins,
    exponents,
    standard_error,
)
from robotball.qualitative.long_run import TORUS as ON_TORUS
from robotball.qualitative.sections import fixed_point, section
from robotball.rotations import Array, conjugate, multiply
from validation.options import AGREES, DISAGREES, File, Preset, SceneName, Threads, check_files
from validation.output import Show, known, progress_bar, write_record
from validation.studies.contact_sections import (
    COARSE,
    Recipe,
    Torus,
    attracted_scene,
    cloud_by_contact,
    cloud_by_equations,
    contact_cycle,
    distance_to_curve,
    level_starts,
    moving_scene,
    own_start,
    rank_probability,
    sound_run,
)
from validation.study import Column, Row, show, table_of

_SEPARATION = 1e-6  # rad: its square is lost in the ratio, and so is rounding over it
_PAIR_TOLERANCE = 1e-11  # of a step of the equations alongside


@dataclass(frozen=True)
class _ContactExponent:
    """How n pairs of motions of the contact model came apart, in k intervals each.

    growth (n, k): the logarithm of the distance's growth in each interval; interval s; attitudes
    (n, k, 4), of the first motion when an interval began, turns (n, k, 3), the unit direction
    of the second from there; both in principal axes; momenta (n, 3) kg m²/s, world.
    """

    growth: Array
    interval: float
    attitudes: Array
    turns: Array
    momenta: Array

    @property
    def mean(self) -> float:
        """Return λ₁ over all pairs and intervals [1/s]."""
        return float(self.growth.mean() / self.interval)

    @property
    def error(self) -> float:
        """Return the standard error of `mean`, from the scatter of the pairs [1/s]."""
        return standard_error(self.growth.mean(axis=1) / self.interval)


def contact_exponent(
    model: Model,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 100.0,
    interval: float = 5.0,
    progress: Callable[[float], object] = lambda part: None,
) -> _ContactExponent:
    """Measure λ₁ of the motions from n starts, each over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): in principal axes, as `qualitative.long_run` takes them.
    Raises InputError where a run has a fault.
    """
    skipped, kept = round(transient / interval), max(1, round(duration / interval))
    growth = np.empty((len(attitudes), skipped + kept))
    origins, turns = np.empty((*growth.shape, 4)), np.empty((*growth.shape, 3))
    for i, (q, M) in enumerate(zip(attitudes, momenta, strict=True)):
        turn = np.array([0.6, 0.48, 0.64])
        for k in range(skipped + kept):
            origins[i, k], turns[i, k] = q, turn
            aside = Rotation.from_rotvec(_SEPARATION * turn).as_quat(scalar_first=True)
            beside = multiply(q, aside)
            q, other = (_rolled(model, each, M, interval) for each in (q, beside))
            apart = multiply(conjugate(q), other)
            turn = Rotation.from_quat(apart, scalar_first=True).as_rotvec()
            distance = float(np.linalg.norm(turn))
            growth[i, k], turn = np.log(distance / _SEPARATION), turn / distance
            progress((i * growth.shape[1] + k + 1) / growth.size)
    late = slice(skipped, None)
    return _ContactExponent(growth[:, late], interval, origins[:, late], turns[:, late], momenta)


def _rolled(model: Model, attitude: Array, momentum: Array, duration: float) -> Array:
    """Return the attitude (4,), principal axes, to which MuJoCo rolls the ball in `duration` s."""
    start = own_start(model.scene, attitude, momentum)
    motion = sound_run(model, start, np.array([0.0, duration]))
    return multiply(motion.attitude[-1], model.scene.principal_quaternion)


def growth_by_equations(parameters: Parameters, contact: _ContactExponent) -> Array:
    """Return `growth` (n, k) by the equations, from the same starts in the same directions."""
    n, k = contact.growth.shape
    starts = Starts(
        parameters, contact.attitudes.reshape(-1, 4), np.repeat(contact.momenta, k, axis=0)
    )
    rest = np.concatenate([contact.turns.reshape(-1, 3), np.zeros((n * k, 2))], axis=1)
    states, _ = starts.march(DEVIATION, rest, np.array([contact.interval]), _PAIR_TOLERANCE)
    return states[:, 0, 7].reshape(n, k)


_F = 25.0  # of Figs 11 to 14, (kg m²/s)²
# The curve by 192,000 points, the contact model's by 50: at most 1e-6 is lost to the spacing.
TORUS = Torus(L=0.0, l=1.96, spread=0.2, f=_F, starts=64, skipped=250, count=3000)
TORUS_BY_CONTACT = Torus(L=0.0, l=1.96, spread=0.0, f=_F, starts=1, skipped=100, count=50)
_CLOUD = Recipe(f=_F, starts=50, skipped=20, count=40)  # 2000 points
_PEERS = 199
_PAIRS = Recipe(f=_F, starts=16, skipped=0, count=0)
_PAIR_SECONDS = 4000.0  # of each: 1 % of sampling error over all
_EXPONENT = 0.1160  # of Fig. 11b, 1/s: the equations', ±0.0001 by 64 starts over 1e5 s
_DRIFTS = {"fig12": 3.65907, "fig13": 3.665, "fig14": 3.276}  # m/s along OX


def _measured(
    claim: str,
    contact: float,
    equations: float,
    bound: float,
    error: float = 0.0,
    apart: float | None = None,
) -> Row:
    """Return a row with one quantity by both engines, and whether they are near enough.

    apart, bound: their difference and what it may be at most; error: the sampling's, at one
    standard deviation, 0 where nothing is random.
    """
    apart = abs(contact - equations) if apart is None else apart
    return {
        "claim": claim, "contact": contact, "equations": equations, "apart": apart,
        "bound": bound, "error": error, "holds": bool(apart <= bound),
    }  # fmt: skip


def _measure_cycle(show: Show) -> Iterator[Row]:
    """Measure Fig. 11a's periodic orbit: period, fixed point, multiplier, drift."""
    show(0, "Fig. 11a: periodic orbit")
    scene = load_scene("fig12")
    cycle = fixed_point(scene.parameters, 3.6, 0.6, _F)
    attitudes, momenta = cycle.attitude[None], cycle.momentum[None]
    crossing = section(scene.parameters, attitudes, momenta, 1, direction=-1)
    L, l = float(crossing.L[0, 0]), float(crossing.l[0, 0])
    model = build(scene, preset("balanced"))
    contact = contact_cycle(model, L, l + 0.01, _F, cycle.period, direction=-1)
    for claim, a, b in (
        ("11a: period [s]", contact.period, cycle.period),
        ("11a: L of it [kg m²/s]", contact.L, L),
        ("11a: l of it [rad]", contact.l, l),
        ("11a: |multiplier|", abs(contact.multipliers[0]), abs(cycle.multipliers[0])),
    ):
        yield _measured(claim, a, b, 1e-6)
    start = own_start(scene, cycle.attitude, cycle.momentum)
    moved = run(model, sample_times(cycle.period, 5e-3), start=start).contact_point[-1]
    yield _measure_drift("fig12", -float(moved @ cycle.momentum[:2]) / 5 / cycle.period, 0.0, 1e-5)


def _measure_torus(show: Show) -> Iterator[Row]:
    """Measure Fig. 11a's limit torus: how far MuJoCo's section points are from the curve."""
    show(1, "Fig. 11a: limit torus")
    scene = load_scene("fig13")
    curve = cloud_by_equations(scene.parameters, TORUS, seed=0)
    contact = cloud_by_contact(build(scene, preset("balanced")), TORUS_BY_CONTACT, seed=0)
    apart = distance_to_curve(contact.states, curve.states)
    yield _measured("11a: off the torus", apart.max(), 0.0, 5e-6)
    # The mean over 1200 s misses that of all time by a swing of the path, some metres, over that.
    yield _measure_drift("fig13", float(contact.velocities[0, 0]), 0.0, 5e-3)


def _measure_clouds(show: Show) -> Iterator[Row]:
    """Measure Fig. 11b's strange attractor: its cloud among the equations' own."""
    scene = load_scene("fig14")
    model = build(scene, COARSE)
    contact = cloud_by_contact(model, _CLOUD, 0, lambda part: show(2 + part, "Fig. 11b: cloud"))
    show(3, "Fig. 11b: clouds of the equations")
    reference, *peers = (
        cloud_by_equations(scene.parameters, _CLOUD, seed).states for seed in range(1, _PEERS + 2)
    )
    unlikely = 1 - rank_probability(contact.states, peers, reference)
    # Of right clouds 1 - p is even between 0 and 1, 0.5 in the mean; over 0.99 is refused.
    yield _measured("11b: 1 - p of the cloud", unlikely, 0.5, 0.99, apart=unlikely)
    mean = contact.velocities.mean(axis=0)
    error = contact.velocities.std(axis=0, ddof=1) / np.sqrt(_CLOUD.starts)
    yield _measure_drift("fig14", float(mean[0]), float(error[0]), 3 * float(error[0]))


def _measure_exponents(show: Show) -> Iterator[Row]:
    """Measure Fig. 11b's largest exponent, and the growth of both engines along one motion."""
    scene = load_scene("fig14")
    contact = contact_exponent(
        build(scene, COARSE),
        *_PAIRS.points(seed=0),
        _PAIR_SECONDS,
        interval=10.0,
        progress=lambda part: show(4 + 4 * part, "Fig. 11b: exponent"),
    )
    yield _measured("11b: λ₁ [1/s]", contact.mean, _EXPONENT, 0.03 * _EXPONENT, contact.error)
    alongside = float(growth_by_equations(scene.parameters, contact).mean() / contact.interval)
    yield _measured("11b: along one motion", contact.mean, alongside, 1e-4)


def _measure_drift(scene: str, velocity: float, error: float, bound: float) -> Row:
    return _measured(f"{scene[3:]}: drift [m/s]", velocity, _DRIFTS[scene], bound, error)


_COLUMNS = (
    Column("", "claim", words=True),
    Column(LABEL.name, "contact", form=".8g"),
    Column(EQUATIONS.name, "equations", form=".8g"),
    Column("apart", "apart"),
    Column("bound", "bound"),
    Column("σ", lambda row: f"{row['error']:.1e}" if row["error"] else ""),
    Column("", lambda row: "holds" if row["holds"] else "DOES NOT HOLD"),
)
# Each shows how many of 8 parts of the work are done.
_STUDIES = (_measure_cycle, _measure_torus, _measure_clouds, _measure_exponents)


@dataclass(frozen=True)
class Attractors:
    """Measure the attractors of Fig. 11 by a contact engine and by the equations.

    Period, multiplier, torus, strange attractor, exponents and drifts; three minutes in all.

    Example: robotball attractors --quick --json attractors.json
    """

    quick: bool = False
    """The periodic orbit of Fig. 11a alone, in a few seconds."""
    json: File = None
    """Also write the measurements."""

    def run(self) -> int:
        check_files(self.json)
        with progress_bar(8) as progress:
            some = _STUDIES[:1] if self.quick else _STUDIES
            measurements = [each for study in some for each in study(progress)]
        show([table_of(_COLUMNS, measurements)])
        write_record(self.json, {"measurements": measurements})
        return AGREES if all(each["holds"] for each in measurements) else DISAGREES


@dataclass(frozen=True)
class Basins:
    """Tell which attractor each of many random starts of a scene's ball reaches.

    Example: robotball basins fig12 --starts 100
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    starts: int = 1000
    """Random starts with the scene's M² and (M, γ)."""
    transient: float = 3000.0
    """Time that each is given to reach it [s]."""
    seed: int = 0
    """The seed of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the starts and what they reach."""

    def run(self) -> int:
        scene = attracted_scene(self.scene, "a basin")
        check_count("starts", self.starts, 2)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(1) as progress:
            progress(0, f"{scene.name}: {self.starts} starts")
            found = basins(scene.parameters, attitudes, momenta, self.transient)
        names = {ON_TORUS: "torus", CHAOS: "chaos", LINE: "straight line"}
        names |= {LOST: "stops crossing g = 0"}
        names |= {i: f"cycle of period {of.period:.6f} s" for i, of in enumerate(found.cycles)}
        rows = [
            {"name": name, "share": share}
            for label, name in sorted(names.items(), reverse=True)
            if (share := found.share(label)) > 0
        ]
        columns = (
            Column("attractor", "name", words=True),
            Column("share of the starts", "share", form=".3f"),
        )
        show([table_of(columns, rows)])
        write_record(
            self.json,
            {
                "scene": scene.name,
                "seed": self.seed,
                "transient": self.transient,
                "attitudes": attitudes.tolist(),
                "reached": [names[label] for label in found.labels.tolist()],
            },
        )
        return AGREES


_BATCH = 16  # starts a core followed at once, between two moves of the progress bar


@dataclass(frozen=True)
class Lyapunov:
    """Measure a scene's Lyapunov exponents, by the equations and, on request, by an engine.

    Example: robotball lyapunov fig14 --starts 4 --duration 1000
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    starts: int = 16
    """Random starts with the scene's M² and (M, γ); for 1 the scene's own."""
    duration: float = 10_000.0
    """Time over which each is measured [s]."""
    transient: float = 1000.0
    """Time before that [s]."""
    preset: Preset = None
    """Also measure the largest one by the engine so set, over a tenth of the duration."""
    seed: int = 0
    """The seed of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the results, start by start."""

    def run(self) -> int:
        scene = moving_scene(self.scene, "an exponent")
        settings = None if self.preset is None else preset(self.preset)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(self.starts * (1 if settings is None else 2)) as progress:
            parts, together = [], _BATCH * allowed()
            for i in range(0, self.starts, together):
                progress(i, f"{scene.name}: equations")
                some = attitudes[i : i + together], momenta[i : i + together]
                parts.append(exponents(scene.parameters, *some, self.duration, self.transient))
            found = Exponents(
                np.concatenate([part.halves for part in parts]),
                np.concatenate([part.divergence for part in parts]),
                self.duration,
            )
            rows = [
                ("λ₁ [1/s]", found.mean[0], found.error[0]),
                ("λ₆ [1/s]", found.mean[1], found.error[1]),
                ("sum [1/s]", float(found.divergence.mean()), None),
                ("dimension of the section", found.dimension, found.dimension_error),
            ]
            record: dict[str, object] = {
                "scene": scene.name,
                "starts": self.starts,
                "seed": self.seed,
                "duration": self.duration,
                "largest": found.largest.tolist(),
                "smallest": found.smallest.tolist(),
                "dimension": found.dimension,
            }
            if settings is not None:
                model, what = build(scene, settings), f"{scene.name}: {LABEL.name}"
                contact = contact_exponent(
                    model, attitudes, momenta, self.duration / 10, min(100.0, self.transient), 10.0,
                    lambda part: progress(self.starts * (1 + part), what),
                )  # fmt: skip
                name = f"λ₁ by {LABEL.name}, {settings.name} [1/s]"
                rows.append((name, contact.mean, contact.error))
                record |= {
                    "engine": LABEL.name,
                    "engine_duration": self.duration / 10,
                    "engine_largest": (contact.growth.mean(axis=1) / contact.interval).tolist(),
                }
        columns = (
            Column("", "name", words=True),
            Column("mean", "mean", form=".6g"),
            Column("standard error", "error", form=".1g"),
        )
        numbers = [{"name": name, "mean": mean, "error": known(of)} for name, mean, of in rows]
        show([table_of(columns, numbers)])
        write_record(self.json, record)
        return AGREES
