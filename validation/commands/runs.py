"""What compare and video share: how to look at what a faulty run leaves."""

from collections.abc import Sequence
from pathlib import Path

from validation.comparison.agreement import Agreement
from validation.comparison.runs import fault_window_path


def tell_fault_windows(agreements: Sequence[Agreement], folder: Path) -> None:
    """Print how to look at the first fault of each faulty run that left a fault window."""
    for each in agreements:
        path = fault_window_path(folder, each.scene, each.settings.name)
        if each.faults and path.exists():
            print(f"robotball replay {path}", "steps through its first fault")
