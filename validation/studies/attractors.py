"""Attractors and exponents by the contact engine, each claim of Fig. 11 beside the equations.

The commands are `robotball attractors`, and `robotball basins`, which counts the random starts of a
scene that reach each of its attractors.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from robotball import load_scene, preset, sample_times
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.errors import check_count
from robotball.qualitative.long_run import (
    CHAOS,
    LINE,
    LOST,
    Drift,
    basins,
    drift,
    exponents,
)
from robotball.qualitative.long_run import TORUS as ON_TORUS
from robotball.qualitative.sections import fixed_point, own_start, section
from validation.options import AGREES, DISAGREES, File, SceneName, Threads
from validation.output import Show, progress_bar, write_record
from validation.studies.contact_sections import (
    COARSE,
    Recipe,
    Torus,
    attracted_scene,
    cloud_by_contact,
    cloud_by_equations,
    distance_to_curve,
    level_starts,
    rank_probability,
    sound_run,
)
from validation.studies.contact_tangent import contact_cycle, cycle_crossings, growths, rolled
from validation.study import Column, Row, show, table_of

_F = 25.0  # of Figs 11 to 14, (kg m²/s)²
# The curve by 192,000 points, the contact model's by 50: at most 1e-6 is lost to the spacing.
TORUS = Torus(L=0.0, l=1.96, spread=0.2, f=_F, starts=64, skipped=250, count=3000)
TORUS_BY_CONTACT = Torus(L=0.0, l=1.96, spread=0.0, f=_F, starts=1, skipped=100, count=50)
_CLOUD = Recipe(f=_F, starts=50, skipped=20, count=40)  # 2000 points
# With 199 clouds beside it the least probability of a rank is 1/200.
_PEERS = 199
_PAIRS = Recipe(f=_F, starts=16, skipped=0, count=0)
_LONG_RUN = 1e5  # s, of the equations' means: of 16 chaotic starts λ₁ is known to 2e-4 1/s


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
    # Newton's method on the engine's own map, so that its cycle is known to rounding and not to how
    # long a run settles.
    contact = contact_cycle(model, cycle)
    through = cycle_crossings(model, contact).only(-1)
    for claim, a, b in (
        ("11a: period [s]", contact.period, cycle.period),
        ("11a: its L [kg m²/s]", float(through.L[0]), L),
        ("11a: its l [rad]", float(through.l[0]), l),
        ("11a: |multiplier|", abs(contact.multipliers[0]), abs(cycle.multipliers[0])),
    ):
        yield _measured(claim, a, b, 1e-6)
    start = own_start(scene, cycle.attitude, cycle.momentum)
    moved = sound_run(model, start, sample_times(cycle.period, 5e-3)).contact_point[-1]
    periods = drift(scene.parameters, attitudes, momenta, 100 * cycle.period, cycle.period)
    # OX is against M by (3.3), and |M| is 5.
    along = -float(moved @ cycle.momentum[:2]) / 5 / cycle.period
    yield _measured_drift("12", along, 0.0, periods, 1e-5)


def _measure_torus(show: Show) -> Iterator[Row]:
    """Measure Fig. 11a's limit torus: how far MuJoCo's section points are from the curve."""
    show(1, "Fig. 11a: limit torus")
    scene = load_scene("fig13")
    curve = cloud_by_equations(scene.parameters, TORUS, seed=0)
    contact, velocities = cloud_by_contact(scene, preset("balanced"), TORUS_BY_CONTACT, seed=0)
    apart = distance_to_curve(contact.states, curve.states)
    yield _measured("11a: off the torus", apart.max(), 0.0, 5e-6)
    # The mean over 1200 s misses that of all time by a swing of the path, some metres, over that.
    long = drift(scene.parameters, *TORUS_BY_CONTACT.points(seed=0), _LONG_RUN, 3000.0)
    yield _measured_drift("13", float(velocities[0, 0]), 0.0, long, 5e-3)


def _measure_clouds(show: Show) -> Iterator[Row]:
    """Measure Fig. 11b's strange attractor: its cloud among the equations' own."""
    scene = load_scene("fig14")
    contact, velocities = cloud_by_contact(
        scene, COARSE, _CLOUD, 0, lambda part: show(2 + part, "Fig. 11b: cloud")
    )
    show(3, "Fig. 11b: clouds of the equations")
    reference, *peers = (
        cloud_by_equations(scene.parameters, _CLOUD, seed).states for seed in range(1, _PEERS + 2)
    )
    # A test by rank, as no bound on a distance between two random clouds is known beforehand.
    unlikely = 1 - rank_probability(contact.states, peers, reference)
    # Of right clouds 1 - p is even between 0 and 1, 0.5 in the mean; over 0.99 is refused.
    yield _measured("11b: 1 - p of the cloud", unlikely, 0.5, 0.99, apart=unlikely)
    mean = velocities.mean(axis=0)
    # The starts are independent, the points of one start are not: so starts are counted, not
    # points.
    error = velocities.std(axis=0, ddof=1) / np.sqrt(_CLOUD.starts)
    long = drift(scene.parameters, *_PAIRS.points(seed=0), _LONG_RUN)
    yield _measured_drift("14", float(mean[0]), float(error[0]), long, 3 * float(error[0]))


def _measure_exponents(show: Show) -> Iterator[Row]:
    """Measure Fig. 11b's largest exponent, and the growth of both engines along one motion."""
    scene = load_scene("fig14")
    contact = growths(
        scene, partial(rolled, build(scene, COARSE), 10.0), 10.0, 10, 400,
        _PAIRS.points(seed=0), lambda part: show(4 + 4 * part, "Fig. 11b: exponent"), deviations=1,
    )  # fmt: skip
    largest, error = contact.ends().mean[0], contact.ends().error[0]
    reference, _ = exponents(scene.parameters, *_PAIRS.points(seed=0), _LONG_RUN).mean
    yield _measured("11b: λ₁ [1/s]", largest, reference, 0.03 * reference, error)
    # Along one motion there is no chance in it: the equations take the very states of the engine,
    # stretch by stretch.
    alongside = float(contact.by_equations(scene.parameters)[0].mean() / contact.stretch)
    yield _measured("11b: along one motion", largest, alongside, 1e-4)


def _measured_drift(
    figure: str, velocity: float, error: float, equations: Drift, bound: float
) -> Row:
    along = float(equations.mean[0])
    return _measured(f"{figure}: drift [m/s]", velocity, along, bound, error)


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
