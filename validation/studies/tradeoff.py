"""What accuracy costs, over many configurations: error against processor time, the Pareto front."""

import hashlib
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from robotball import PRESETS, Motion, Scene, Settings, integrate, load_scene, sample_times
from robotball.engines.mujoco.engine import MUJOCO
from robotball.engines.mujoco.integrators import FIRST_ORDER, MUJOCOS_DEFAULT
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.files.scene_writer import scene_toml
from robotball.rotations import Array
from validation.comparison.agreement import Agreement
from validation.studies.configurations import (
    INTERVAL,
    Options,
    describe,
    options_of,
    settings_with,
)
from validation.studies.order import fit_order
from validation.studies.timing import measure_costs, simulated_second
from validation.sweeps import Cell, Result

TARGET = 1e-6  # the path error at which first order and the front are compared
# A path so much better than the momentum is one whose errors cancelled; sound ones reach 20.
CANCELLED = 100
ORDER = 1.25  # of a line that is taken for first order: the steeper ones cancel as well
TIMED = 0.05  # s of processor time that is timed at every turn


def scene_cell(scene: str, duration: float) -> dict[str, Any]:
    """What a cell says of its scene, a catalog name or a path.

    The ball is in it by a digest, so that no result outlives a change of the file.
    """
    text = scene_toml(load_scene(scene)).encode()
    digest = hashlib.sha256(text).hexdigest()[:12]
    return {"scene": scene, "digest": digest, "duration": duration}


def cells_of(scene: str, settings: Sequence[Settings], duration: float, rounds: int) -> list[Cell]:
    """A run and its timing for each of the settings, as plain data with all their options."""
    shared = {**scene_cell(scene, duration), "rounds": rounds}
    return [{**shared, **options_of(each)} for each in settings]


def measure(cell: Cell) -> dict[str, Any]:
    """Errors against the equations, faults, and the cost of one simulated second."""
    scene, theory = reference(cell["scene"], cell["duration"])
    model = build(scene, settings_with(cell))
    logging.getLogger("absl").setLevel(logging.ERROR)  # a process of its own says it again
    agreement = Agreement(theory, run(model, theory.times), MUJOCO)
    timed = _worth(TIMED, agreement.report.seconds, theory.times)
    (cost,) = measure_costs([simulated_second(model, timed)], cell["rounds"])
    least, most = cost.spread
    return {
        "path_error": agreement.path_error,
        "momentum_error": agreement.momentum_error,
        "slip": float(agreement.report.slip.max(initial=0.0)),
        "steps": agreement.report.steps,
        "longest_step": agreement.report.timestep,
        "faults": [str(fault) for fault in agreement.faults],
        "ratio": cost.ratio,
        "ratio_least": least,
        "ratio_most": most,
        "baseline": cost.baseline,
    }


def _worth(seconds: float, whole: float, times: Array) -> Array:
    """As many of the times, of which all cost `whole`, as are worth these seconds."""
    return times[: max(2, math.ceil(len(times) * min(1.0, seconds / whole)))]


@cache
def reference(name: str, duration: float, interval: float = INTERVAL) -> tuple[Scene, Motion]:
    """A scene and its motion by the equations at samples so far apart [s], once a process."""
    scene = load_scene(name)
    return scene, integrate(scene, sample_times(duration, interval))


@dataclass(frozen=True)
class Configuration:
    """A configuration that was run, or why it could not be.

    error, momentum_error  the same of M
    ratio         cost of a simulated second, relative to the bare loop's; spread: least and most
    cost          the same as processor time [s per simulated s], at the study's baseline
    trouble       its faults, or why it failed; empty for a sound run

    Where a run broke off or failed, what it has not is NaN.
    """

    options: Options
    error: float
    momentum_error: float
    ratio: float
    spread: tuple[float, float]
    cost: float
    trouble: str

    @property
    def sound(self) -> bool:
        """Whether it is a result: no trouble, and no path that is good by accident."""
        return not self.trouble and self.momentum_error <= CANCELLED * self.error

    @property
    def integrator(self) -> str:
        return str(self.options.get("integrator", MUJOCOS_DEFAULT))

    @property
    def timestep(self) -> float:
        """s, of an integrator that has one; MuJoCo's default where none is set."""
        return float(self.options.get("timestep", 2e-3))

    @property
    def steps(self) -> str:
        """The timestep, or the tolerance of steps that are chosen."""
        if "rtol" in self.options:
            return f"rtol {self.options['rtol']:.0e}"
        return f"{self.timestep * 1e3:.3g} ms"

    @property
    def preset(self) -> str | None:
        """The preset that has just these options."""
        return _PRESETS.get(repr(sorted(self.options.items())))

    @property
    def title(self) -> str:
        return self.preset or f"{self.integrator} {self.steps}, {describe(self.options)}"


_PRESETS = {repr(sorted(options_of(s).items())): name for name, s in PRESETS.items()}


def configurations_of(results: Sequence[Result]) -> tuple[list[Configuration], float]:
    """The results as configurations, and the baseline: the bare loop's simulated second [s].

    It is the median over the whole study.
    """
    baselines = [r.record["baseline"] for r in results if r.record is not None]
    baseline = float(np.median(baselines)) if baselines else math.nan
    return [_configuration(result, baseline) for result in results], baseline


def _configuration(result: Result, baseline: float) -> Configuration:
    options = options_of(settings_with(result.cell))
    record = result.record
    if record is None:
        reason = result.failure or ""
        return Configuration(
            options, math.nan, math.nan, math.nan, (math.nan,) * 2, math.nan, reason
        )
    error, of_momentum = (
        math.nan if record[name] is None else float(record[name])
        for name in ("path_error", "momentum_error")
    )
    return Configuration(
        options,
        error,
        of_momentum,
        record["ratio"],
        (record["ratio_least"], record["ratio_most"]),
        record["ratio"] * baseline,
        "; ".join(record["faults"]),
    )


def known(number: float) -> float | None:
    """The number, or None where it is none."""
    return None if math.isnan(number) else number


def pareto_front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Which configurations no other beats, being as good and cheaper or as cheap and better.

    The cheapest first.
    """
    front: list[int] = []
    for i in sorted(range(len(errors)), key=lambda i: (costs[i], errors[i])):
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def sound_pareto_front(configurations: Sequence[Configuration]) -> list[Configuration]:
    """The front of path error against cost, of the sound ones, the cheapest first."""
    sound = [each for each in configurations if each.sound]
    errors = [each.error for each in sound]
    return [sound[i] for i in pareto_front(errors, [each.cost for each in sound])]


@dataclass(frozen=True)
class Line:
    """Configurations that differ in the timestep alone, and the order of their error in it."""

    configurations: tuple[Configuration, ...]
    order: float

    @property
    def nearest(self) -> Configuration:
        """The one whose error is nearest to the target's."""
        return min(self.configurations, key=lambda p: abs(math.log(p.error / TARGET)))

    @property
    def at_target(self) -> float:
        """The cost of the target [s per simulated s]: from the nearest, at its cost of a step."""
        near = self.nearest
        return near.cost * (near.error / TARGET) ** (1 / self.order)

    @property
    def extrapolated(self) -> bool:
        return all(p.error > TARGET for p in self.configurations)


def first_order_lines(configurations: Sequence[Configuration]) -> list[Line]:
    """Every line of a first-order integrator that is one: sound, and no steeper than its order."""
    groups: dict[str, list[Configuration]] = {}
    for each in configurations:
        if each.sound and each.integrator in FIRST_ORDER:
            rest = {k: v for k, v in each.options.items() if k != "timestep"}
            groups.setdefault(repr(sorted(rest.items())), []).append(each)
    lines = []
    for group in groups.values():
        fit = fit_order([p.timestep for p in group], [p.error for p in group])
        if fit is not None and fit.order <= ORDER:
            lines.append(Line(tuple(sorted(group, key=lambda p: p.timestep)), fit.order))
    return lines


@dataclass(frozen=True)
class Tradeoff:
    """The study of one scene: all configurations, their Pareto front, and first order beside it.

    baseline: processor time of the bare loop's simulated second [s], by which costs are seconds;
    best: the front's cheapest that reaches the target; first_order: the cheapest line there.
    """

    scene: Scene
    configurations: tuple[Configuration, ...]
    baseline: float
    pareto_front: tuple[Configuration, ...]
    best: Configuration | None
    first_order: Line | None

    @property
    def ratio(self) -> float | None:
        """How many times less than first order the front costs at the target."""
        if self.best is None or self.first_order is None:
            return None
        return self.first_order.at_target / self.best.cost

    @property
    def presets(self) -> dict[str, Configuration]:
        return {each.preset: each for each in self.configurations if each.preset}


def tradeoff_of(scene: Scene, results: Sequence[Result]) -> Tradeoff:
    """The study of the results of `measure`."""
    configurations, baseline = configurations_of(results)
    front = sound_pareto_front(configurations)
    good_enough = [each for each in front if each.error <= TARGET]
    lines = first_order_lines(configurations)
    return Tradeoff(
        scene,
        tuple(configurations),
        baseline,
        tuple(front),
        min(good_enough, key=lambda each: each.cost, default=None),
        min(lines, key=lambda line: line.at_target, default=None),
    )
