"""The paper's Figs 3 to 14 as pictures, one file a figure; what each shows is in its own module.

Every picture has the caption's parameters and what was chosen where the caption does not say,
the facts as corrected, and MuJoCo's motion over that of the equations wherever there is a path.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from robotball import InputError
from robotball.film import gl
from robotball.processes import in_processes
from validation.figures import attractor_figures as attractors
from validation.figures.lines import figure9, figure10
from validation.figures.motion_from_rest import figure5, figure6, figure7, figure8
from validation.figures.structure import figure3, figure4
from validation.output import write_picture

_BY_OPENGL = ("3", "4")
_SINGLE = (figure3, figure4, figure5, figure6, figure7, figure8, figure9, figure10)
FIGURES: dict[str, dict[str, Callable[[], Figure]]] = {
    **{f"{number}": {f"fig{number:02}": each} for number, each in enumerate(_SINGLE, start=3)},
    "11": {"fig11a": attractors.figure11a, "fig11b": attractors.figure11b},
    "12": {"fig12": attractors.figure12},
    "13": {"fig13": attractors.figure13},
    "14": {"fig14": attractors.figure14},
    "tori": {"tori": attractors.figure_tori},
}


def draw_figures(
    names: Sequence[str], out: Path, report: Callable[[float, str], None] = lambda *_: None
) -> list[Path]:
    """Draw the pictures of the figures named, or of all for none, as PNGs in the folder `out`.

    report is called with how many pictures are done and which was the last. Raises InputError for a
    figure that there is not.
    """
    pictures = chosen(names)
    written = []
    # By name, as a picture is made where it is written: a Figure need not pass between processes.
    for i, path in enumerate(in_processes(partial(_draw, out), [*pictures.items()])):
        report(i + 1, path.stem)
        written.append(path)
    return written


def _draw(out: Path, named: tuple[str, Callable[[], Figure]]) -> Path:
    name, picture = named
    return write_picture(out / f"{name}.png", picture())


def chosen(names: Sequence[str]) -> dict[str, Callable[[], Figure]]:
    """Return the pictures of the figures named, or of all for none, by their files' names.

    All are without Figs 3 and 4 where there is no off-screen GL. Raises InputError for a figure
    that there is not.
    """
    for name in names:
        if name not in FIGURES:
            raise InputError(f"no figure {name} to draw; there are 3 to 14, and tori")
    if not names:
        names = [name for name in FIGURES if name not in _BY_OPENGL or gl.find_backend()]
    return {file: picture for name in names for file, picture in FIGURES[name].items()}
