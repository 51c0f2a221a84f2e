"""Results on disk: records that can be made again, in files that are whole or not there."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from robotball import Fault, Motion
from validation.comparison.agreement import Agreement
from validation.comparison.sensitivity import Sensitivity
from validation.output import versions, write_rows, write_text

TABLE_COLUMNS = (
    "scene",
    "rolling",
    "engine",
    "preset",
    "timestep",
    "path_error",
    "gamma_error",
    "momentum_error",
    "realtime_factor",
    "agrees",
    "verdict",
)


Record = dict[str, Any]


def record(agreement: Agreement) -> Record:
    """One comparison as plain data; numbers of a run that broke off are None."""
    report, sensitivity = agreement.report, agreement.sensitivity
    return {
        "scene": agreement.scene.name,
        "rolling": agreement.scene.rolling,
        "engine": agreement.motion.engine.name,
        "preset": agreement.settings.name,
        "settings": agreement.settings.plain(),
        "timestep": report.timestep,
        "duration": float(agreement.theory.times[-1]),
        "samples": len(agreement.theory.times),
        "path_length": agreement.theory.path_length,
        "path_error": agreement.path_error,
        "reference_error": agreement.reference_error,
        "estimated_error": report.estimated_error,
        "gamma_error": agreement.gamma_error,
        "attitude_error": agreement.attitude_error,
        "momentum_error": agreement.momentum_error,
        "momentum_drift": agreement.momentum_error,  # its name in version 0.1
        "friction_used": _known(report.friction_used.max(initial=0.0)),
        "needs": needs(agreement.theory),
        "steps": report.steps,
        "realtime_factor": agreement.realtime_factor,
        "agrees": agreement.agrees,
        "faults": [_fault(fault) for fault in agreement.faults],
        "verdict": agreement.verdict,
        # What the motion makes of small errors; None unless that explains something.
        "sensitivity": None if sensitivity is None else _plain(sensitivity),
        "seed": None,  # nothing in a comparison is random
        "versions": versions() | {agreement.motion.engine.name: agreement.motion.engine.version},
    }


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _fault(fault: Fault) -> dict[str, Any]:
    return {
        "kind": fault.kind.name, "time": fault.time, "cause": fault.text, "fatal": fault.fatal,
    }  # fmt: skip


def _plain(sensitivity: Sensitivity) -> dict[str, Any]:
    """Its numbers, those that are not finite as None, and whether it explains the error."""
    numbers = asdict(sensitivity).items()
    plain = {name: value if math.isfinite(value) else None for name, value in numbers}
    return {**plain, "explains": sensitivity.explains}


def needs(motion: Motion) -> dict[str, Any]:
    """The most that a motion asks for: friction (torsional in m), motor torques N m, powers W."""
    loads = motion.loads
    return {
        "sliding_friction": float(loads.sliding_friction.max()),
        "torsional_friction": float(loads.torsional_friction.max()),
        "motor_torques": np.abs(loads.motor_torques).max(axis=0).tolist(),
        "motor_powers": np.abs(motion.motor_powers).max(axis=0).tolist(),
    }


def write_json(path: Path, records: Sequence[Record]) -> None:
    """A list of records, one an agreement."""
    text = json.dumps(list(records), indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


def write_csv(path: Path, records: Sequence[Record]) -> None:
    """The table of the agreements, a row each."""
    write_rows(path, records, TABLE_COLUMNS)


def write_markdown(path: Path, records: Sequence[Record]) -> None:
    """The table of the agreements as the README shows it."""
    lines = [
        "| scene | preset | step | path error | γ error | momentum error | × real time | verdict |",
        "|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for each in records:
        errors = (each[name] for name in ("path_error", "gamma_error", "momentum_error"))
        cells = [each["scene"], each["preset"], f"{each['timestep'] * 1e3:.3g} ms"]
        cells += ["-" if error is None else f"{error:.1e}" for error in errors]
        cells += [f"{each['realtime_factor']:.0f}"]
        lines.append(f"| {' | '.join(cells)} | {each['verdict']} |")
    write_text(path, "\n".join(lines) + "\n")
