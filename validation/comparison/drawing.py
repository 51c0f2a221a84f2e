"""Who draws the pictures of a comparison.

matplotlib takes longer to come than a short motion to be compared. So other processes draw, which
import it while this one works; a process that has it already draws by itself.
"""

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from robotball.processes import in_processes, prepare
from validation.comparison.sheets import Sheet, sheet_of
from validation.output import DPI, replacing

if TYPE_CHECKING:
    from validation.comparison.agreement import Agreement

PLOTS = "validation.comparison.plots"  # imports matplotlib
KINDS = ("path", "momentum")
MANY = 4  # scenes, worth more than one process to compare them, each of which draws its own


def prepare_drawing(scenes: int) -> None:
    """Have matplotlib imported elsewhere, for a `draw` of so many scenes that is some time away."""
    if scenes < MANY and not _has_matplotlib():
        with suppress(OSError):  # then `draw` does without
            prepare(PLOTS)


def draw(agreements: Sequence["Agreement"], out: Path) -> list[Path]:
    """Two pictures of one scene's agreements, by one engine, as PNGs in `out`."""
    from validation.comparison.names import file_stem

    name, sheet = file_stem(agreements), sheet_of(agreements)
    drawings = [(kind, sheet, out / f"{name}-{kind}.png") for kind in KINDS]
    if not _has_matplotlib():
        with suppress(OSError):  # no process is to be had, or one was killed
            return list(in_processes(write, drawings))
    return [write(each) for each in drawings]


def write(drawing: tuple[str, Sheet, Path]) -> Path:
    """Draw one kind of picture of a sheet into a file."""
    from validation.comparison.plots import PICTURES

    kind, sheet, path = drawing
    with replacing(path) as temporary:
        PICTURES[kind](sheet).savefig(temporary, dpi=DPI)
    return path


def _has_matplotlib() -> bool:
    return "matplotlib.figure" in sys.modules
