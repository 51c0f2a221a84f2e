"""The atlas: each cell of the maps is run by the contact engine and judged by the equations."""

import logging
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotball import InputError, Motion, Scene, Settings
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
    Map,
    Trial,
    trial,
)
from validation.studies.extremes.outcome import Outcome, classify, largest_error
from validation.sweeps import Result, sweep

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
            record = _measured(trial(MAPS[cell["map"]], *place))
        except InputError as error:
            record = {"outcome": Outcome.REFUSED.name, "refusal": str(error)}
    return {**record, "seconds": time.process_time() - began}


def _measured(this: Trial) -> dict[str, Any]:
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


def sample_times(this: Trial) -> Array:
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
    loads = theory.loads
    return replace(
        settings,
        sliding_friction=max(settings.sliding_friction, AMPLE * loads.sliding_friction.max()),
        torsional_friction=max(settings.torsional_friction, AMPLE * loads.torsional_friction.max()),
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
