"""The attractors of Fig. 11 by the contact engine, each claim beside the equations.

The commands are `robotball attractors`, and `robotball basins`, which counts the random starts of a
scene that reach each of its attractors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from robotball import load_scene, preset, sample_times
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.equations import Parameters
from robotball.errors import check_count
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.long_run import CHAOS, LINE, LOST, basins
from robotball.qualitative.long_run import TORUS as ON_TORUS
from robotball.qualitative.sections import fixed_point, section
from validation.options import AGREES, DISAGREES, File, SceneName, Threads, check_files
from validation.output import Show, plain_table, print_whole, progress_bar, write_record
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
    own_start,
    rank_probability,
)
from validation.studies.lyapunov import contact_exponent, growth_by_equations

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


@dataclass(frozen=True)
class _Measurement:
    """One quantity by both engines.

    apart, bound: their difference and what it may be at most; error: the sampling's, at one
    standard deviation, 0 where nothing is random.
    """

    claim: str
    contact: float
    equations: float
    apart: float
    bound: float
    error: float = 0.0

    @property
    def holds(self) -> bool:
        return bool(self.apart <= self.bound)


def _measure_cycle(show: Show) -> Iterator[_Measurement]:
    """Measure Fig. 11a's periodic orbit: period, fixed point, multiplier, drift."""
    show(0, "Fig. 11a: periodic orbit")
    scene = load_scene("fig12")
    cycle = fixed_point(scene.parameters, 3.6, 0.6, _F)
    L, l = _crossing_of(cycle, scene.parameters)
    model = build(scene, preset("balanced"))
    contact = contact_cycle(model, L, l + 0.01, _F, cycle.period, direction=-1)
    size, ours = abs(cycle.multipliers[0]), abs(contact.multipliers[0])
    for claim, a, b in (
        ("11a: period [s]", contact.period, cycle.period),
        ("11a: L of it [kg m²/s]", contact.L, L),
        ("11a: l of it [rad]", contact.l, l),
        ("11a: |multiplier|", ours, size),
    ):
        yield _Measurement(claim, a, b, abs(a - b), 1e-6)
    start = own_start(scene, cycle.attitude, cycle.momentum)
    moved = run(model, sample_times(cycle.period, 5e-3), start=start).contact_point[-1]
    yield _measure_drift("fig12", -float(moved @ cycle.momentum[:2]) / 5 / cycle.period, 0.0, 1e-5)


def _crossing_of(cycle: Cycle, parameters: Parameters) -> tuple[float, float]:
    """Return (L, l) where a periodic orbit crosses g = 0 with g falling."""
    found = section(parameters, cycle.attitude[None], cycle.momentum[None], 1, direction=-1)
    return float(found.L[0, 0]), float(found.l[0, 0])


def _measure_torus(show: Show) -> Iterator[_Measurement]:
    """Measure Fig. 11a's limit torus: how far MuJoCo's section points are from the curve."""
    show(1, "Fig. 11a: limit torus")
    scene = load_scene("fig13")
    curve = cloud_by_equations(scene.parameters, TORUS, seed=0)
    contact = cloud_by_contact(build(scene, preset("balanced")), TORUS_BY_CONTACT, seed=0)
    apart = distance_to_curve(contact.states, curve.states)
    yield _Measurement("11a: off the torus", apart.max(), 0.0, apart.max(), 5e-6)
    # The mean over 1200 s misses that of all time by a swing of the path, some metres, over that.
    yield _measure_drift("fig13", float(contact.velocities[0, 0]), 0.0, 5e-3)


def _measure_clouds(show: Show) -> Iterator[_Measurement]:
    """Measure Fig. 11b's strange attractor: its cloud among the equations' own."""
    scene = load_scene("fig14")
    model = build(scene, COARSE)
    contact = cloud_by_contact(model, _CLOUD, 0, lambda part: show(2 + part, "Fig. 11b: cloud"))
    show(3, "Fig. 11b: clouds of the equations")
    reference, *peers = (
        cloud_by_equations(scene.parameters, _CLOUD, seed).states for seed in range(1, _PEERS + 2)
    )
    probability = rank_probability(contact.states, peers, reference)
    # Of right clouds 1 - p is even between 0 and 1, 0.5 in the mean; over 0.99 is refused.
    yield _Measurement("11b: 1 - p of the cloud", 1 - probability, 0.5, 1 - probability, 0.99)
    mean = contact.velocities.mean(axis=0)
    error = contact.velocities.std(axis=0, ddof=1) / np.sqrt(_CLOUD.starts)
    yield _measure_drift("fig14", float(mean[0]), float(error[0]), 3 * float(error[0]))


def _measure_exponents(show: Show) -> Iterator[_Measurement]:
    """Measure Fig. 11b's largest exponent, and the growth of both engines along one motion."""
    scene = load_scene("fig14")
    contact = contact_exponent(
        build(scene, COARSE),
        *_PAIRS.points(seed=0),
        _PAIR_SECONDS,
        interval=10.0,
        progress=lambda part: show(4 + 4 * part, "Fig. 11b: exponent"),
    )
    apart = abs(contact.mean - _EXPONENT)
    bound = 0.03 * _EXPONENT
    yield _Measurement("11b: λ₁ [1/s]", contact.mean, _EXPONENT, apart, bound, contact.error)
    alongside = float(growth_by_equations(scene.parameters, contact).mean() / contact.interval)
    apart = abs(contact.mean - alongside)
    yield _Measurement("11b: along one motion", contact.mean, alongside, apart, 1e-4)


def _measure_drift(scene: str, velocity: float, error: float, bound: float) -> _Measurement:
    theirs = _DRIFTS[scene]
    claim = f"{scene[3:]}: drift [m/s]"
    return _Measurement(claim, velocity, theirs, abs(velocity - theirs), bound, error)


def _show_attractors(measurements: Sequence[_Measurement]) -> None:
    """Print a row a measurement; σ is the sampling's standard error."""
    table = plain_table(("", LABEL.name, EQUATIONS.name, "apart", "bound", "σ", ""))
    for each in measurements:
        numbers = (f"{each.contact:.8g}", f"{each.equations:.8g}")
        sizes = (
            f"{each.apart:.1e}",
            f"{each.bound:.1e}",
            f"{each.error:.1e}" if each.error else "",
        )
        verdict = "holds" if each.holds else "DOES NOT HOLD"
        table.add_row(each.claim, *numbers, *sizes, verdict)
    print_whole(table, Console())


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
        with progress_bar(8) as show:
            some = _STUDIES[:1] if self.quick else _STUDIES
            measurements = [each for study in some for each in study(show)]
        _show_attractors(measurements)
        record = [{**asdict(each), "holds": each.holds} for each in measurements]
        write_record(self.json, {"measurements": record})
        return AGREES if all(each.holds for each in measurements) else DISAGREES


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
    """Of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the starts and what they reach."""

    def run(self) -> int:
        scene = attracted_scene(self.scene, "a basin")
        check_count("starts", self.starts, 2)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(1) as show:
            show(0, f"{scene.name}: {self.starts} starts")
            found = basins(scene.parameters, attitudes, momenta, self.transient)
        names = {ON_TORUS: "torus", CHAOS: "chaos", LINE: "straight line"}
        names[LOST] = "stops crossing g = 0"
        for i, cycle in enumerate(found.cycles):
            names[i] = f"cycle of period {cycle.period:.6f} s"
        table = Table("attractor", "share of the starts", box=box.SIMPLE_HEAD)
        for label, name in sorted(names.items(), reverse=True):
            if found.share(label) > 0:
                table.add_row(name, f"{found.share(label):.3f}")
        print_whole(table, Console())
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
