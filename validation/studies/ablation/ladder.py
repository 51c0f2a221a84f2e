"""The error budget: from the naive model to the recipe choice by choice, and back.

Errors hide one another. Going up, a rung's error is that of the worst choice not yet made, and a
rung can even look worse than the one before: two errors had cancelled, or what is now felt was
drowned before. What a choice is worth by itself is seen at the top, where all else is right and
it alone is undone.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from robotball import Scene, Settings, integrate
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.rotations import Array
from validation.comparison.agreement import Agreement
from validation.comparison.results import record
from validation.studies.ablation.choices import BOTTOM, CHOICES, TOP, adopt, undo
from validation.studies.timing import Cost, measure_costs, simulated_second

TIMED = 2.0  # s of the motion over which cost is measured; it hardly changes along the way
ROUNDS = 5  # of timing, all rungs in turn


def climb() -> tuple[Settings, ...]:
    """The naive model, then settings that each make one choice more; each is named after it."""
    rungs = [BOTTOM]
    for choice in CHOICES:
        rungs.append(replace(adopt(rungs[-1], choice), name=choice.name))
    return tuple(rungs)


def descend() -> tuple[Settings, ...]:
    """The recipe, then the recipe with each choice alone undone, named after it."""
    return TOP, *(replace(undo(TOP, choice), name=choice.name) for choice in CHOICES)


@dataclass(frozen=True)
class Rung:
    """What one of the settings does to a scene, and the cost of a simulated second of it."""

    agreement: Agreement
    cost: Cost

    @property
    def name(self) -> str:
        return self.agreement.settings.name

    @property
    def slip(self) -> float:
        """The sliding velocity at the contact, root mean square, over the mean rolling speed."""
        theory = self.agreement.theory
        speed = theory.path_length / float(theory.times[-1])
        return float(np.sqrt(np.mean(self.agreement.diagnostics.slip**2))) / speed


@dataclass(frozen=True)
class Ladder:
    """Rungs on the way up, from the naive model; and the recipe, then each choice undone."""

    scene: Scene
    up: tuple[Rung, ...]
    undone: tuple[Rung, ...]

    @property
    def naive(self) -> Rung:
        return self.up[0]

    @property
    def recipe(self) -> Rung:
        return self.undone[0]

    def times_naive(self, rung: Rung) -> Cost:
        """The cost of a rung as ratios to that of the naive model."""
        return rung.cost.over(self.naive.cost)

    def rows(self) -> list[dict[str, Any]]:
        """A row of plain numbers for every rung; those of a run that broke off are None."""
        directions = (("up", self.up), ("undone", self.undone))
        return [self._row(direction, rung) for direction, rungs in directions for rung in rungs]

    def _row(self, direction: str, rung: Rung) -> dict[str, Any]:
        cost = self.times_naive(rung)
        return {
            "direction": direction,
            "choice": rung.name,
            "path_error": rung.agreement.path_error,
            "momentum_drift": rung.agreement.momentum_drift,
            "slip": rung.slip,
            "cpu_seconds": rung.cost.seconds,
            "times_naive": cost.ratio,
            "times_naive_least": cost.spread[0],
            "times_naive_most": cost.spread[1],
            "faults": "; ".join(map(str, rung.agreement.faults)),
        }

    def record(self) -> dict[str, Any]:
        """The ladder as plain data, with the settings and the faults of every rung in full."""
        rungs = (*self.up, *self.undone)
        return {
            "scene": self.scene.name,
            "choices": [asdict(choice) for choice in CHOICES],
            "rungs": [
                {**record(rung.agreement), **row}
                for rung, row in zip(rungs, self.rows(), strict=True)
            ],
        }


def measure_ladder(
    scene: Scene,
    times: Array | None = None,
    rounds: int = ROUNDS,
    show: Callable[[float, str], None] | None = None,
) -> Ladder:
    """All rungs of a scene over `times` (n,) [s] from 0, the scene's own if None.

    rounds: of timing, all rungs in turn. show: told the part that is done, 0 to 1, and what is
    done next.
    """
    settings = (*climb(), *descend())
    show = show or (lambda part, what: None)
    theory = integrate(scene, times)
    models = [build(scene, each) for each in settings]
    agreements = []
    total = len(models) * (rounds + 2)
    for i, model in enumerate(models):
        show(i / total, f"{scene.name}: {model.settings.name}")
        agreements.append(Agreement(scene, model.settings, theory, run(model, theory.times)))
    timed = theory.times[: max(2, int(np.searchsorted(theory.times, TIMED)))]
    costs = measure_costs(
        [simulated_second(model, timed) for model in models],
        rounds,
        lambda done: show((len(models) + done) / total, f"{scene.name}: timing"),
    )
    rungs = tuple(Rung(*pair) for pair in zip(agreements, costs, strict=True))
    top = len(climb())
    return Ladder(scene, rungs[:top], rungs[top:])


def fault_of(rung: Rung) -> str:
    """The first fault of a rung, and how many more there are; nothing where there is none."""
    faults: Sequence[object] = rung.agreement.faults
    more = f" (+{len(faults) - 1})" if len(faults) > 1 else ""
    return f"{faults[0]}{more}" if faults else ""
