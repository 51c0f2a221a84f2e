"""Results on disk: records that can be made again, in files that are whole or not there."""

import csv
import io
import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from robotball import InputError, Motion
from robotball.files.replacing import replacing as replacing
from validation.agreement import Agreement
from validation.sensitivity import Sensitivity

PACKAGES = ("robotball", "mujoco", "numpy", "scipy", "dm-control")
TABLE_COLUMNS = (
    "scene",
    "rolling",
    "preset",
    "timestep",
    "path_error",
    "gamma_error",
    "momentum_drift",
    "realtime_factor",
    "agrees",
    "verdict",
)


def versions() -> dict[str, str]:
    """What a number depends on besides its scene and settings."""
    return {
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{package: version(package) for package in PACKAGES},
    }


def record(agreement: Agreement) -> dict[str, Any]:
    """One comparison as plain data; numbers of a run that broke off are None."""
    settings = {
        name: value for name, value in asdict(agreement.settings).items() if value is not None
    }
    diagnostics, sensitivity = agreement.diagnostics, agreement.sensitivity
    return {
        "scene": agreement.scene.name,
        "rolling": agreement.scene.rolling,
        "preset": agreement.settings.name,
        "settings": {name: value for name, value in settings.items() if value is not None},
        "timestep": diagnostics.timestep,
        "duration": float(agreement.theory.times[-1]),
        "samples": len(agreement.theory.times),
        "path_length": agreement.theory.path_length,
        "path_error": agreement.path_error,
        "gamma_error": agreement.gamma_error,
        "momentum_drift": agreement.momentum_drift,
        "friction_used": float(diagnostics.friction_used.max(initial=0.0)),
        "needs": needs(agreement.theory),
        "steps": diagnostics.steps,
        "realtime_factor": agreement.realtime_factor,
        "agrees": agreement.agrees,
        "faults": [asdict(fault) for fault in agreement.faults],
        "verdict": agreement.verdict,
        # What the motion makes of small errors; None unless that was asked and is known.
        "sensitivity": None if sensitivity is None else _plain(sensitivity),
        "seed": None,  # nothing in a comparison is random
        "versions": versions(),
    }


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


def write_json(path: Path, agreements: Sequence[Agreement]) -> None:
    """A list of records, one an agreement."""
    records = [record(agreement) for agreement in agreements]
    text = json.dumps(records, indent=2, allow_nan=False, ensure_ascii=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n")


def write_record(path: Path | None, record: Mapping[str, Any]) -> None:
    """One record with the versions it depends on as JSON, if a path is given."""
    if path is None:
        return
    text = json.dumps({**record, "versions": versions()}, indent=1, allow_nan=False)
    with replacing(writable_file(path)) as temporary:
        temporary.write_text(text + "\n")


def write_csv(path: Path, agreements: Sequence[Agreement]) -> None:
    """The table of the agreements, a row each."""
    write_rows(path, [record(agreement) for agreement in agreements], TABLE_COLUMNS)


def write_rows(
    path: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str] | None = None
) -> None:
    """A table as CSV, with these columns of the rows, or those of the first; None is empty."""
    text = io.StringIO()
    columns = list(rows[0]) if columns is None else columns
    table = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    with replacing(path) as temporary:
        temporary.write_text(text.getvalue())


def write_markdown(path: Path, agreements: Sequence[Agreement]) -> None:
    """The table of the agreements as the README shows it."""
    lines = [
        "| scene | preset | step | path error | γ error | drift of M | × real time | verdict |",
        "|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for each in map(record, agreements):
        errors = (each[name] for name in ("path_error", "gamma_error", "momentum_drift"))
        cells = [each["scene"], each["preset"], f"{each['timestep'] * 1e3:.3g} ms"]
        cells += ["-" if error is None else f"{error:.1e}" for error in errors]
        cells += [f"{each['realtime_factor']:.0f}"]
        lines.append(f"| {' | '.join(cells)} | {each['verdict']} |")
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n")


def writable_folder(path: Path) -> Path:
    """`path`, in which files can be written; raises InputError where they can't.

    It is tried by making the folder; one that was not there is taken away again, so that nothing
    stays of a command that is refused later.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be made: {error.strerror or error}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: no permission")
    for folder in made:
        folder.rmdir()
    return path


def writable_file(path: Path) -> Path:
    """`path`, in a folder that it can be written to; raises InputError where there is none."""
    writable_folder(path.parent)
    if path.is_dir():
        raise InputError(f"{path} cannot be written: it is a folder")
    return path
