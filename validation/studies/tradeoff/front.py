"""What accuracy costs, over many configurations: error against processor time, and the front."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robotball import PRESETS, Scene
from validation.studies.order import fit_order
from validation.studies.tradeoff.configurations import (
    FIRST_ORDER,
    Options,
    describe,
    options_of,
    settings_of,
)
from validation.sweeps import Result

TARGET = 1e-6  # the path error at which first order and the front are compared
# A path so much better than the momentum is one whose errors cancelled; sound ones reach 20.
CANCELLED = 100
ORDER = 1.25  # of a line that is taken for first order: the steeper ones cancel as well


@dataclass(frozen=True)
class Point:
    """A configuration that was run, or why it could not be.

    error, drift  path error and momentum drift
    ratio         cost of a simulated second, relative to the bare loop's; spread: least and most
    cost          the same as processor time [s per simulated s], at the study's baseline
    trouble       its faults, or why it failed; empty for a sound run

    Where a run broke off or failed, what it has not is NaN.
    """

    options: Options
    error: float
    drift: float
    ratio: float
    spread: tuple[float, float]
    cost: float
    trouble: str

    @property
    def sound(self) -> bool:
        """Whether it is a result: no trouble, and no path that is good by accident."""
        return not self.trouble and self.drift <= CANCELLED * self.error

    @property
    def integrator(self) -> str:
        return str(self.options.get("integrator", "Euler"))  # MuJoCo's default

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

    def record(self) -> dict[str, Any]:
        """The point as plain data."""
        numbers = {name: known(getattr(self, name)) for name in ("error", "drift", "ratio", "cost")}
        return {
            "title": self.title,
            "sound": self.sound,
            **numbers,
            "spread": [known(end) for end in self.spread],
            "trouble": self.trouble,
            "options": self.options,
        }


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
    record = result.record
    if record is None:
        reason = result.failure or ""
        return Point(options, math.nan, math.nan, math.nan, (math.nan,) * 2, math.nan, reason)
    error, drift = (
        math.nan if record[name] is None else float(record[name])
        for name in ("path_error", "momentum_drift")
    )
    return Point(
        options,
        error,
        drift,
        record["ratio"],
        (record["ratio_least"], record["ratio_most"]),
        record["ratio"] * baseline,
        "; ".join(record["faults"]),
    )


def known(number: float) -> float | None:
    """The number, or None where it is none."""
    return None if math.isnan(number) else number


def front_of(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Which points no other beats, being as good and cheaper or as cheap and better.

    The cheapest first.
    """
    front: list[int] = []
    for i in sorted(range(len(errors)), key=lambda i: (costs[i], errors[i])):
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def sound_front(points: Sequence[Point]) -> list[Point]:
    """The front of path error against cost, of the sound ones, the cheapest first."""
    sound = [point for point in points if point.sound]
    errors = [point.error for point in sound]
    return [sound[i] for i in front_of(errors, [point.cost for point in sound])]


@dataclass(frozen=True)
class Line:
    """Configurations that differ in the timestep alone, and the order of their error in it."""

    points: tuple[Point, ...]
    order: float

    @property
    def nearest(self) -> Point:
        """The one whose error is nearest to the target's."""
        return min(self.points, key=lambda p: abs(math.log(p.error / TARGET)))

    @property
    def at_target(self) -> float:
        """The cost of the target [s per simulated s]: from the nearest, at its cost of a step."""
        near = self.nearest
        return near.cost * (near.error / TARGET) ** (1 / self.order)

    @property
    def extrapolated(self) -> bool:
        return all(p.error > TARGET for p in self.points)


def first_order_lines(points: Sequence[Point]) -> list[Line]:
    """Every line of a first-order integrator that is one: sound, and no steeper than its order."""
    groups: dict[str, list[Point]] = {}
    for point in points:
        if point.sound and point.integrator in FIRST_ORDER:
            rest = {k: v for k, v in point.options.items() if k != "timestep"}
            groups.setdefault(repr(sorted(rest.items())), []).append(point)
    lines = []
    for group in groups.values():
        fit = fit_order([p.timestep for p in group], [p.error for p in group])
        if fit is not None and fit.order <= ORDER:
            lines.append(Line(tuple(sorted(group, key=lambda p: p.timestep)), fit.order))
    return lines


@dataclass(frozen=True)
class Tradeoff:
    """The study of one scene: all points, their front, and first order beside it.

    baseline: processor time of the bare loop's simulated second [s], by which costs are seconds;
    best: the front's cheapest that reaches the target; first_order: the cheapest line there.
    """

    scene: Scene
    points: tuple[Point, ...]
    baseline: float
    front: tuple[Point, ...]
    best: Point | None
    first_order: Line | None

    @property
    def ratio(self) -> float | None:
        """How many times less than first order the front costs at the target."""
        if self.best is None or self.first_order is None:
            return None
        return self.first_order.at_target / self.best.cost

    def record(self) -> dict[str, Any]:
        """The study as plain data; what has no number is None."""
        line = self.first_order
        return {
            "scene": self.scene.name,
            "target": TARGET,
            "ratio": self.ratio,
            "baseline": self.baseline,
            "best": self.best and self.best.record(),
            "first_order": line
            and {
                "order": line.order,
                "extrapolated": line.extrapolated,
                "cost_at_target": line.at_target,
                "nearest": line.nearest.record(),
            },
            "front": [point.record() for point in self.front],
            "points": [point.record() for point in self.points],
        }

    @property
    def presets(self) -> dict[str, Point]:
        return {point.preset: point for point in self.points if point.preset}


def tradeoff_of(scene: Scene, results: Sequence[Result]) -> Tradeoff:
    """The study of the results of `measure`."""
    points, baseline = points_of(results)
    front = sound_front(points)
    reached = [point for point in front if point.error <= TARGET]
    lines = first_order_lines(points)
    return Tradeoff(
        scene,
        tuple(points),
        baseline,
        tuple(front),
        min(reached, key=lambda point: point.cost, default=None),
        min(lines, key=lambda line: line.at_target, default=None),
    )
