"""One run of one engine, as a process of its own: a cell as JSON in, its record as JSON out.

It is started by the interpreter of the engine's environment, with a pipe whose closing ends it.
What the engine prints goes to standard error.
"""

import hashlib
import json
import math
import os
import platform
import statistics
import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from robotball import InputError, engine_named, integrate, load_scene, sample_times
from robotball.engines.protocol import Request
from robotball.engines.simulate import run_request
from robotball.motion import momentum_error, path_error
from robotball.settings import EngineSettings
from validation.comparison.sensitivity import total_defect
from validation.sweeps.process import end_when_closed

ENOUGH = 1.0  # s of processor time after which a run is not timed again
LOOSEST = 0.3  # that a run is held to at another value than the preset's own, which has no other
FIXED_WORK = bytes(1 << 23)  # whose digest tells the speed of the machine at the time


def run(cell: Mapping[str, Any]) -> dict[str, Any]:
    """What came of a run: errors, what the engine did besides, cost and versions."""
    scene = load_scene(cell["scene"])
    theory = integrate(scene, sample_times(cell["duration"]))
    engine = engine_named(cell["engine"])
    preset = engine.presets[cell["preset"]]
    settings = settings_of(preset, cell["field"], cell["value"])
    request = Request(engine, settings)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        before = fixed_work()
        motions = [run_request(scene, theory.times, request, loads=theory.loads)]
        while len(motions) < cell["rounds"] and motions[0].report.seconds < ENOUGH:
            motions.append(run_request(scene, theory.times, request, loads=theory.loads))
        speed = (before + fixed_work()) / 2
        defect = None
        if cell["stretches"]:
            defect = total_defect(engine.prepare(scene, settings), theory)
    motion, report = motions[0], motions[0].report
    finished = len(motion.times) == len(theory.times)
    python = [each.report.python_seconds for each in motions]
    return {
        "label": engine.label.name,
        "colour": engine.label.colour,
        "version": engine.label.version,
        "path_error": known(path_error(motion, theory)) if finished else None,
        "momentum_error": known(momentum_error(motion, theory)) if finished else None,
        "defect": known(defect),
        "reached": float(motion.times[-1]),
        "slip": known(report.slip.max()),
        "spin": known(abs(report.spin).max()),
        "hinge_rate_error": known(report.hinge_rate_error.max()),
        "steps": report.steps,
        "longest_step": report.timestep,
        "seconds": statistics.median(each.report.seconds for each in motions),
        "python_seconds": known(python[0]),
        "fixed_work": speed,
        "faults": [str(fault) for fault in report.faults],
        "lacks": sorted({str(each.message) for each in said}),
        "settings": settings.plain(),
        "python": platform.python_version(),
    }


def settings_of(preset: EngineSettings, field: str, value: float) -> EngineSettings:
    """The preset with another value of a field, for a run that goes on in spite of its faults."""
    changes: dict[str, Any] = {field: value, "stop_at_fault": False}
    if getattr(preset, field) != value:
        changes["error_tolerance"] = LOOSEST
    return replace(preset, **changes)


def known(value: float | None) -> float | None:
    """A number that JSON has."""
    return float(value) if value is not None and math.isfinite(value) else None


def fixed_work() -> float:
    """Processor time of a piece of work that no package takes part in [s]."""
    began = time.process_time()
    hashlib.sha256(FIXED_WORK).digest()
    return time.process_time() - began


def main() -> None:
    """Reads a cell, ends with its reader, and writes the record."""
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what engines print
    end_when_closed(int(sys.argv[1]))
    cell = json.loads(sys.stdin.readline())
    try:
        record = run(cell)
    except InputError as error:
        record = {"refused": str(error)}
    json.dump(record, answer, allow_nan=False)
    answer.flush()
    os._exit(0)  # some engines end badly


if __name__ == "__main__":
    main()
