"""The command `robotball replay`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, Positional, arg

from validation.commands.arguments import AGREES, DISAGREES


@dataclass(frozen=True)
class Replay:
    """Step through the fault window that a faulty run left, and take its steps again.

    Example: robotball compare fig12 --preset naive; robotball replay out/fig12-mujoco-naive-fault.json
    """  # noqa: E501

    file: Positional[Annotated[Path, arg(metavar="FILE")]]
    """A SCENE-ENGINE-PRESET-fault.json, which compare or video leaves of a faulty run."""
    step: DisallowNone[Annotated[int | None, arg(metavar="N", help_behavior_hint="")]] = None
    """Show all of this row alone: its readings, positions and velocities."""
    interactive: bool = False
    """Go from row to row, each at a press of Enter, from the first bad one on."""

    def run(self) -> int:
        from rich.console import Console
        from rich.markup import escape

        from robotball.engines.mujoco.fault_window import load, replay
        from validation.runs import outcome_of, show_row, show_rows, walk

        window, console = load(self.file), Console()
        if self.step is not None:
            show_row(window, self.step, console)
            return AGREES
        replayed = replay(window)
        run, causes = f"{window.name}, {window.settings.get('name')}", " and ".join(window.causes)
        console.print(escape(f"{run}: {causes} at t = {window.time:.6g} s"))
        if self.interactive:
            walk(window, console)
        else:
            show_rows(window, console)
        print(outcome_of(window, replayed))
        return AGREES if replayed.difference in (0.0, None) else DISAGREES
