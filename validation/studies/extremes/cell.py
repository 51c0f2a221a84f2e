"""One cell of a map: the case is run by MuJoCo and judged by the equations."""

import logging
import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from robotball import InputError, Motion, Settings
from robotball.engines.mujoco.contact_limits import EDGES as GRIP
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.planned_run import Case as EdgeCase
from robotball.engines.mujoco.planned_run import momentum_scale
from robotball.engines.mujoco.precheck import check
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.step_limits import EDGES as STABILITY
from robotball.rotations import Array
from validation.comparison.agreement import Agreement
from validation.studies.extremes.maps import DURATION, MAPS, TIMESTEP, Case, case
from validation.studies.extremes.outcome import Outcome, classify, largest_error
from validation.studies.extremes.reference import path_length, reference, speed_scale

PREDICTIONS = (*STABILITY, *GRIP)
TURNING = 200.0  # rad: no cell that turns fast needs more to show its error
STEPS = 50  # at least, for an instability to grow in
SAMPLES = 100  # at most, at which the two motions are compared
AMPLE = 3.0  # times the motion's demand


def measure(cell: Mapping[str, Any]) -> dict[str, Any]:
    """The record of a cell {map, rolling, integrator, x, y}; no input makes it raise.

    outcome: an Outcome's name; path_error, momentum_drift: relative to the path's length and to
    the watch's scale of M, gamma_error: rad, None where the run broke off; faults: what the watch
    saw during the run; foretold: the edges that the check before it finds crossed; nearness: of
    each edge; seconds: CPU time.
    """
    began = time.process_time()
    # In a process of its own nothing else keeps MuJoCo and NumPy quiet about what is recorded.
    logging.getLogger("absl").setLevel(logging.ERROR)
    place = (cell[key] for key in ("rolling", "integrator", "x", "y"))
    with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        try:
            record = _measured(case(MAPS[cell["map"]], *place))
        except InputError as error:
            record = {"outcome": Outcome.REFUSED.name, "refusal": str(error)}
    return {**record, "seconds": time.process_time() - began}


def _measured(this: Case) -> dict[str, Any]:
    scene, times = this.scene, sample_times(this)
    theory = reference(scene, times)
    settings = ample(this.settings, theory) if this.ample else this.settings
    engine = run(build(scene, settings), times)
    errors = errors_of(Agreement(scene, settings, theory, engine))
    diagnostics = engine.diagnostics
    assert diagnostics is not None  # MuJoCo's motions have them
    return {
        "outcome": classify(diagnostics.faults, largest_error(errors)).name,
        **errors,
        "faults": [str(fault) for fault in diagnostics.faults],
        # What a user is told before the run, who does not know the motion yet.
        "foretold": [edge.what for edge in check(scene, settings, times)],
        "nearness": nearness(EdgeCase(scene, settings, float(times[-1]), theory.loads)),
        "steps": diagnostics.steps,
    }


def errors_of(agreement: Agreement) -> dict[str, float | None]:
    """The errors of a record, by their names; None where there is no number."""
    names = ("path_error", "momentum_drift", "gamma_error")
    if not agreement.finished:
        return dict.fromkeys(names)
    scene, momentum = agreement.scene, agreement.engine.momentum
    values = (
        agreement.path_errors.max() / path_length(scene, agreement.theory),
        np.linalg.norm(momentum - momentum[:1], axis=1).max() / momentum_scale(scene),
        agreement.gamma_error,
    )
    return {
        name: float(value) if np.isfinite(value) else None
        for name, value in zip(names, values, strict=True)
    }


def nearness(case: EdgeCase) -> dict[str, float | None]:
    """How much of each predicted edge's limit is used, by the name of its prediction.

    What is used without end is None.
    """
    edges = {predict.__name__: predict(case) for predict in PREDICTIONS}
    return {
        name: edge.nearness if np.isfinite(edge.nearness) else None
        for name, edge in edges.items()
        if edge is not None
    }


def sample_times(this: Case) -> Array:
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
