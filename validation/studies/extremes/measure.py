"""The atlas: each cell of the maps is run by the contact engine and judged by the equations."""

import logging
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotball import Fault, FaultKind, InputError, Motion, Scene, Settings
from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.planned_run import PlannedRun
from robotball.engines.mujoco.precheck import LAWS, exceeded
from robotball.engines.mujoco.run import run
from robotball.engines.reduced.integrate import compiled_states, motion_of
from robotball.rotations import Array
from validation.comparison.agreement import Agreement
from validation.progress import Show
from validation.studies.extremes.cells import Cut, cells_of
from validation.studies.extremes.maps import (
    DURATION,
    MAPS,
    TIMESTEP,
    CellRun,
    Map,
    cell_run,
)
from validation.sweeps import Result, sweep

ACCURATE = 1e-4  # largest error of an accurate run, relative; the recipe's coarsest keeps 1e-6
WRONG = 0.1  # an error above it is no result at all


class Outcome(Enum):
    """What a reader sees of a cell: its sign on the map, and the sentence that explains it."""

    ACCURATE = ("", f"accurate: error at most {ACCURATE:g}")
    DEGRADED = ("·", f"degraded: error at most {WRONG:g}")
    WRONG = ("X", f"silently wrong: error above {WRONG:g}, contact and drives as they should be")
    SLIPPED = ("s", "slipped: friction cone saturated, or slip along the path")
    LOST_CONTACT = ("c", "lost contact")
    OFF_RATE = ("r", "a drive lost its rate")
    DIVERGED = ("D", "diverged and reported")
    REFUSED = ("–", "refused before the run, with one line")
    UNFINISHED = ("?", "stopped at its limit of steps or time")
    FAILED = ("!", "ended in an error that nobody had foreseen")

    def __init__(self, sign: str, sentence: str) -> None:
        self.sign = sign
        self.sentence = sentence


# Any other kind of fault leaves no state.
OF_KIND = {
    FaultKind.OUT_OF_STEPS: Outcome.UNFINISHED,
    FaultKind.CONTACT_LOST: Outcome.LOST_CONTACT,
    FaultKind.CONE_SATURATED: Outcome.SLIPPED,
    FaultKind.SLIPPED: Outcome.SLIPPED,
    FaultKind.RATE_OFF: Outcome.OFF_RATE,
    FaultKind.TORQUE_LIMIT: Outcome.OFF_RATE,
    FaultKind.MOMENTUM_OFF: Outcome.WRONG,
}
# What these cost is in the error, and may be little.
BY_ERROR = (Outcome.OFF_RATE, Outcome.WRONG)


def largest_error(record: Mapping[str, Any]) -> float | None:
    """The larger of path error and momentum error; None where the run has none."""
    errors = [record.get(name) for name in ("path_error", "momentum_error")]
    known = [error for error in errors if error is not None]
    return max(known) if len(known) == len(errors) else None


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """The outcome of a run with these faults, the earliest first, and this error.

    The error is None where the run broke off. One that goes on is called by its first fault, from
    which the others follow: a ball that slips may well lose its contact later.
    """
    kinds = [OF_KIND.get(fault.kind, Outcome.DIVERGED) for fault in faults]
    if Outcome.DIVERGED in kinds or (error is None and Outcome.UNFINISHED not in kinds):
        return Outcome.DIVERGED
    if error is None:
        return Outcome.UNFINISHED
    grave = [kind for kind in kinds if kind not in BY_ERROR]
    if error > WRONG:
        first = [kind for kind in kinds if kind is not Outcome.WRONG]
        return first[0] if first else Outcome.WRONG
    if grave:
        return grave[0]
    return Outcome.ACCURATE if error <= ACCURATE else Outcome.DEGRADED


TURNING = 200.0  # rad: no cell that turns fast needs more to show its error
STEPS = 50  # at least, for an instability to grow in
SAMPLES = 100  # at most, at which the two motions are compared
AMPLE = 3.0  # times the motion's demand


def measure(cell: Mapping[str, Any]) -> dict[str, Any]:
    """The record of a cell {map, rolling, integrator, x, y}; no input makes it raise.

    outcome: an Outcome's name; path_error, momentum_error: relative, gamma_error: rad, None where
    the run broke off; faults: of the run; foretold: the limits that the precheck finds exceeded;
    nearness: to each limit; seconds: CPU time.
    """
    began = time.process_time()
    # In a process of its own nothing else keeps MuJoCo and NumPy quiet about what is recorded.
    logging.getLogger("absl").setLevel(logging.ERROR)
    place = (cell[key] for key in ("rolling", "integrator", "x", "y"))
    with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        try:
            record = _measured(cell_run(MAPS[cell["map"]], *place))
        except InputError as error:
            record = {"outcome": Outcome.REFUSED.name, "refusal": str(error)}
    return {**record, "seconds": time.process_time() - began}


def _measured(this: CellRun) -> dict[str, Any]:
    scene, times = this.scene, sample_times(this)
    theory = reference(scene, times)
    settings = ample(this.settings, theory) if this.ample else this.settings
    motion = run(build(scene, settings), times)
    errors = errors_of(Agreement(theory, motion))
    return {
        "outcome": classify(motion.report.faults, largest_error(errors)).name,
        **errors,
        "faults": [str(fault) for fault in motion.report.faults],
        # What a user reads before the run, who does not know the motion yet.
        "foretold": [limit.what for limit in exceeded(scene, settings, times)],
        "nearness": nearness(PlannedRun(scene, settings, float(times[-1]), theory.loads)),
        "steps": motion.report.steps,
    }


def errors_of(agreement: Agreement) -> dict[str, float | None]:
    """The errors of a record, by their names; None where there is no number."""
    names = ("path_error", "momentum_error", "gamma_error")
    errors = {name: getattr(agreement, name) for name in names}
    return {
        name: error if error is not None and np.isfinite(error) else None
        for name, error in errors.items()
    }


def nearness(plan: PlannedRun) -> dict[str, float | None]:
    """How much of each predicted limit is used, by the name of its prediction.

    What is used without end is None.
    """
    checks = {predict.__name__: predict(plan) for predict in LAWS}
    return {
        name: check.nearness if np.isfinite(check.nearness) else None
        for name, check in checks.items()
        if check is not None
    }


def reference(scene: Scene, times: Array) -> Motion:
    """What `integrate` gives, to the same error, by the compiled step: some turn a million times.

    For steady drives; times (n,) s from 0. Raises InputError where the motion is given up.
    """
    return motion_of(scene, times, compiled_states(scene, times))


def speed_scale(scene: Scene) -> float:
    """About how fast the ball turns: A(|M| + |K|) + |Ω| [rad/s]."""
    numbers = scene.parameters
    size = np.linalg.norm(scene.start.momentum) + np.linalg.norm(numbers.K)
    return float(max(numbers.A) * size + np.linalg.norm(numbers.Omega))


def sample_times(this: CellRun) -> Array:
    """The times (n,) of a case, whole timesteps apart [s]: a few turns of the ball, unless it has
    a duration, and in enough steps of a fixed length.
    """
    step = this.settings.timestep or TIMESTEP
    duration = this.duration or min(DURATION, TURNING / speed_scale(this.scene))
    if not this.settings.adaptive and this.duration is None:
        duration = max(duration, STEPS * step)
    interval = step * max(1.0, np.ceil(duration / step / SAMPLES))
    if this.settings.adaptive:
        interval = duration / SAMPLES
    return interval * np.arange(max(2, round(duration / interval) + 1))


def ample(settings: Settings, theory: Motion) -> Settings:
    """The settings with friction AMPLE times what the motion demands, where it is less."""
    settings, loads = Chosen(theory.scene, settings).settings, theory.loads
    spin = settings.torsional_friction_of(theory.scene.ball.radius)
    return replace(
        settings,
        sliding_friction=max(settings.sliding_friction, AMPLE * loads.sliding_friction.max()),
        torsional_friction=max(spin, AMPLE * loads.torsional_friction.max()),
    )


def survey(
    maps: Sequence[Map],
    cut: Cut,
    file: Path,
    show: Show,
    *,
    workers: int | None = None,
    cluster: str | None = None,
) -> dict[str, list[Result]]:
    """The results of the maps' cells by the map's name; `file` keeps them for another time.

    workers, cluster: where the cells run, as for `sweep`.
    """
    results: dict[str, list[Result]] = {}
    done = 0
    for each in maps:
        cells = cells_of(each, cut)
        results[each.name] = sweep(
            measure,
            cells,
            file,
            workers=workers,
            cluster=cluster,
            limit=each.limit,
            show=partial(_show, show, done, each.name),
        )
        done += len(cells)
    return results


def _show(show: Show, done: int, name: str, part: float, words: str) -> None:
    show(done + part, f"{name}: {words}")
