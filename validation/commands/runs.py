"""What compare and video share: which run the options ask for, and what a faulty one leaves."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from robotball import InputError, Settings
from robotball.engines.mujoco.accuracy import asked
from validation.comparison.agreement import Agreement
from validation.comparison.runs import dump_path


def wanted_run(name: str | None, accuracy: float | None, keep_going: bool) -> Settings | float:
    """The settings or the path error that the options ask for."""
    wanted = asked(name, accuracy)
    if not keep_going:
        return wanted
    if isinstance(wanted, float):
        raise InputError("a run with a fault reaches no accuracy: give --keep-going with a preset")
    return replace(wanted, stop_at_fault=False)


def tell_dumps(agreements: Sequence[Agreement], folder: Path) -> None:
    """Print how to look at the first fault of each faulty run."""
    for each in agreements:
        if each.faults:
            path = dump_path(folder, each.scene, each.settings.name)
            print(f"robotball replay {path}", "steps through its first fault")
