"""What accuracy costs, over many configurations: error against processor time, and the front."""

import hashlib
import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from robotball import PRESETS, Motion, Scene, Settings, integrate, load_scene, sample_times
from robotball.contact.model import build
from robotball.files.scene_writer import scene_toml
from robotball.rotations import Array
from robotball.simulate import run
from validation.agreement import Agreement
from validation.sweeps import Cell, Result
from validation.tradeoffs.configurations import (
    FIRST_ORDER,
    INTERVAL,
    Options,
    options_of,
    settings_of,
)
from validation.tradeoffs.timing import measure_costs, simulated_second

TARGET = 1e-6  # the path error at which first order and the front are compared
ORDER = 1.25  # the most that a line counts for first order: beyond it, errors cancelled
TIMED = 0.05  # s of processor time that is timed at every turn
FEWEST = 3  # points that make a line


def scene_cell(scene: str, duration: float) -> dict[str, Any]:
    """What a cell says of its scene, a catalog name or a path.

    The ball is in it by a digest, so that no result outlives a change of the file.
    """
    text = scene_toml(load_scene(scene)).encode()
    digest = hashlib.sha256(text).hexdigest()[:12]
    return {"scene": scene, "digest": digest, "duration": duration}


def cells_of(
    scene: str, settings: Sequence[Settings], duration: float, rounds: int
) -> list[Cell]:
    """A run and its timing for each of the settings, as plain data with all their options."""
    shared = {**scene_cell(scene, duration), "rounds": rounds}
    return [{**shared, "kind": each.name, **options_of(each)} for each in settings]


def measure(cell: Cell) -> dict[str, Any]:
    """Errors against the equations, faults, and the cost of one simulated second."""
    scene, theory = reference(cell["scene"], cell["duration"])
    model = build(scene, settings_of(cell))
    logging.getLogger("absl").setLevel(logging.ERROR)  # a process of its own says it again
    agreement = Agreement(scene, model.settings, theory, run(model, theory.times))
    timed = _worth(TIMED, agreement.diagnostics.seconds, theory.times)
    (cost,) = measure_costs([simulated_second(model, timed)], cell["rounds"])
    least, most = cost.spread
    return {
        "path_error": agreement.path_error,
        "momentum_drift": agreement.momentum_drift,
        "slip": float(agreement.diagnostics.slip.max(initial=0.0)),
        "steps": agreement.diagnostics.steps,
        "longest_step": agreement.diagnostics.timestep,
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
def reference(name: str, duration: float) -> tuple[Scene, Motion]:
    """A scene and its motion by the equations, once a process."""
    scene = load_scene(name)
    return scene, integrate(scene, sample_times(duration, INTERVAL))


@dataclass(frozen=True)
class Point:
    """A configuration that was run, or why it could not be.

    error, drift  path error and momentum drift; None where there is none
    ratio         cost of a simulated second, relative to the bare loop's; spread: least and most
    cost          the same as processor time [s per simulated s], at the study's baseline
    trouble       its faults, or why it failed; empty for a sound run
    """

    kind: str
    options: Options
    error: float | None
    drift: float | None
    ratio: float
    spread: tuple[float, float]
    cost: float
    trouble: str

    @property
    def sound(self) -> bool:
        return not self.trouble and self.error is not None

    @property
    def integrator(self) -> str:
        return str(self.options.get("integrator", "Euler"))  # MuJoCo's default

    @property
    def steps(self) -> str:
        """The timestep, or the tolerance of steps that are chosen."""
        if "rtol" in self.options:
            return f"rtol {self.options['rtol']:.0e}"
        return f"{self.options.get('timestep', 2e-3) * 1e3:.3g} ms"

    @property
    def preset(self) -> str | None:
        """The preset that has just these options."""
        return _PRESETS.get(repr(sorted(self.options.items())))

    @property
    def title(self) -> str:
        return self.preset or f"{self.kind}, {self.integrator} {self.steps}"


_PRESETS = {repr(sorted(options_of(s).items())): name for name, s in PRESETS.items()}


def points_of(results: Sequence[Result]) -> tuple[list[Point], float]:
    """The results as points, and the baseline [s]: the bare loop's simulated second, at its median
    over the whole study.
    """
    baselines = [r.record["baseline"] for r in results if r.record is not None]
    baseline = float(np.median(baselines)) if baselines else math.nan
    return [_point(result, baseline) for result in results], baseline


def _point(result: Result, baseline: float) -> Point:
    options = options_of(settings_of(result.cell))
    kind, record = str(result.cell["kind"]), result.record
    if record is None:
        reason = result.failure or ""
        return Point(kind, options, None, None, math.nan, (math.nan, math.nan), math.nan, reason)
    return Point(
        kind,
        options,
        record["path_error"],
        record["momentum_drift"],
        record["ratio"],
        (record["ratio_least"], record["ratio_most"]),
        record["ratio"] * baseline,
        "; ".join(record["faults"]),
    )


def front_of(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Which points no other beats: as good and cheaper, or as cheap and better. By error, falling."""
    front: list[int] = []
    for i in sorted(range(len(errors)), key=lambda i: (costs[i], errors[i])):
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def sound_front(points: Sequence[Point]) -> list[Point]:
    """The front of the sound ones whose momentum is as good as their path.

    Where only the path is good, errors of two kinds have cancelled.
    """
    sound = [p for p in points if p.sound]
    errors = [max(p.error or 0.0, p.drift or 0.0) for p in sound]
    return [sound[i] for i in front_of(errors, [p.cost for p in sound])]


@dataclass(frozen=True)
class Line:
    """First-order configurations that differ in the timestep alone, the coarsest first.

    cost ∝ error^-order between them; at_target: what the target would cost, by that law from the
    finest, which is extrapolated where the finest does not reach it.
    """

    points: tuple[Point, ...]
    order: float
    at_target: float

    @property
    def extrapolated(self) -> bool:
        return all((p.error or 0.0) > TARGET for p in self.points)


def power_law(errors: Sequence[float], costs: Sequence[float]) -> float:
    """The p of cost ∝ error^(-1/p) through the points: the order that a cost's increase buys."""
    slope = np.polyfit(np.log(costs), np.log(errors), 1)[0]
    return float(-slope)


def cost_at(error: float, known: tuple[float, float], order: float) -> float:
    """The cost at an error, of a line of this order through a `known` (error, cost)."""
    return known[1] * float((known[0] / error) ** (1 / order))
