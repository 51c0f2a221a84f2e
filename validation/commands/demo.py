"""The command `robotball demo`."""

from dataclasses import dataclass
from pathlib import Path

from validation.commands.arguments import (
    AGREES,
    OUT,
)


@dataclass(frozen=True)
class Demo:
    """Compare fig12 and classical_regular at every preset, with table, plots and video."""

    out: Path = OUT
    """Folder for everything."""

    def run(self) -> int:
        from validation.demo import demo
        from validation.output import writable_folder

        demo(writable_folder(self.out))
        return AGREES
