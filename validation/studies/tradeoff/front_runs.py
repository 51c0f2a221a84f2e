"""One run of a configuration for its error and its cost: the work of the trade-off's sweep."""

import hashlib
import logging
import math
from collections.abc import Sequence
from functools import cache
from typing import Any

from robotball import Motion, Scene, Settings, integrate, load_scene, sample_times
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.files.scene_writer import scene_toml
from robotball.rotations import Array
from validation.comparison.agreement import Agreement
from validation.studies.timing import measure_costs, simulated_second
from validation.studies.tradeoff.configurations import (
    INTERVAL,
    options_of,
    settings_of,
)
from validation.sweeps import Cell

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
def reference(name: str, duration: float, interval: float = INTERVAL) -> tuple[Scene, Motion]:
    """A scene and its motion by the equations at samples so far apart [s], once a process."""
    scene = load_scene(name)
    return scene, integrate(scene, sample_times(duration, interval))
