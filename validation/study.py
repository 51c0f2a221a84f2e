"""One frame for studies: the rows of a study make its tables, its CSV file and its record.

A module of `validation.studies` measures and returns a `Study`. Its command hands the study to
`present`, which writes the files, prints the tables and is the one place that does.
"""

import hashlib
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball import Motion, Scene, integrate, sample_times, scene_toml
from robotball.motion import Label
from robotball.rotations import Array
from robotball.theory.reduced import compiled_states, motion_of

from .output import panels, print_whole, write_picture, write_record, write_rows
from .results import controlled, file_name
from .sweeps import Cell

CANCELLED = 100.0
"""Times that M may be less accurate than the path: sound runs reach 20, and where it is more, the
path's errors cancelled."""
Row = Mapping[str, Any]
"""Plain data of one run; what has no number is None or left out."""


def scene_cell(scene: str, duration: float, control: Sequence[str] = ()) -> dict[str, Any]:
    """Return the part of a sweep's cell that describes its scene, a catalog name or a path.

    The ball and the values of its controls are in it by a digest, so that no result outlives a
    change of their files. control: as `controlled` takes it, and a key only where there is some.
    """
    # Of the scene as it was read, not of the file: a comment in it changes no motion.
    loaded = controlled(scene, control)
    # A scene file cannot hold a robot of a file of its own.
    general = loaded.ball.general
    text = pickle.dumps(loaded) if general else scene_toml(loaded).encode()
    digest = hashlib.sha256(text).hexdigest()[:12]
    cell = {"scene": scene, "digest": digest, "duration": duration}
    return {**cell, "control": [*control]} if control else cell


def reference(cell: Cell, interval: float) -> tuple[Scene, Motion]:
    """Return a cell's scene and its motion by the equations, sampled every `interval` s; cached."""
    return _reference(cell["scene"], (*cell.get("control", ()),), cell["duration"], interval)


@cache
def _reference(
    name: str, control: tuple[str, ...], duration: float, interval: float
) -> tuple[Scene, Motion]:
    scene = controlled(name, control)
    return scene, integrate(scene, sample_times(duration, interval))


def compiled_motion(scene: Scene, times: Array) -> Motion:
    """Integrate a steady scene over times (n,) [s] from 0 by the compiled step.

    The error is that of `integrate`, which would be too slow: some scenes turn a million times.
    Raises InputError where the motion is given up.
    """
    return motion_of(scene, times, compiled_states(scene, times))


@dataclass(frozen=True)
class Column:
    """A column of a table in the terminal.

    cell: the key of a text or a number in the rows, or a function that gives the text for a row;
    words: whether the column holds words, which begin at its left. A number is shown times `scale`
    in the format `form`, one that rounds to zero without a sign; one that a row has not as
    `missing`.
    """

    header: str
    cell: str | Callable[[Row], str]
    unit: str = ""
    words: bool = False
    form: str = ".1e"
    scale: float = 1
    missing: str = "-"

    def text(self, row: Row) -> str:
        """Return the text of the cell."""
        if not isinstance(self.cell, str):
            return self.cell(row)
        value = row.get(self.cell)
        if value is None:
            return self.missing
        if isinstance(value, str):
            return value
        # Python has no z, which takes the sign from -0.0, for integers.
        form = self.form if self.form == "d" else f"z{self.form}"
        return f"{value * self.scale:{form}}"


def pareto_front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Return the indices that no other beats by being as good and cheaper, or as cheap and better.

    The cheapest first.
    """
    front: list[int] = []
    for i in sorted(range(len(errors)), key=lambda i: (costs[i], errors[i])):
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def cost_axes(heading: str, xlabel: str) -> tuple[Figure, Axes]:
    """Return a figure of errors across against their cost upwards, both by their logarithms."""
    figure, axes = panels(heading, (10.0, 7.2))
    axes.set(xscale="log", yscale="log", xlabel=xlabel)
    axes.set_ylabel("processor time of a simulated second [s]")
    return figure, axes


@dataclass(frozen=True)
class Study:
    """The outcome of a study.

    scene    name of the scene
    engine   label of the engine under test, None where several are compared
    words    the next words of the files' names, before those of the options
    rows     the CSV file, a dict a line
    record   the JSON file, without versions; None where there is none
    shown    tables and lines of rich markup, in the order of printing
    picture  None where there is nothing to draw
    """

    scene: str
    engine: Label | None
    words: Sequence[str]
    rows: Sequence[Row]
    record: Mapping[str, Any] | None = None
    shown: Sequence[Table | str] = ()
    picture: Figure | None = None

    def stem(self, *words: str) -> str:
        """Return the files' name, without its end; words: those of the options."""
        return file_name(self.scene, self.engine, [*self.words, *words])


def table_of(
    columns: Sequence[Column],
    rows: Sequence[Row],
    doubtful: Callable[[Row], object] = lambda row: False,
    section: str | None = None,
) -> Table:
    """Return the table of the rows for the terminal.

    doubtful: whether a row is no result, and yellow; section: the key whose changes are marked by
    an empty line.
    """
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for column in columns:
        header = escape(f"{column.header}\n[{column.unit}]" if column.unit else column.header)
        table.add_column(header, justify="left" if column.words else "right")
    for i, row in enumerate(rows):
        cells = [escape(column.text(row)) for column in columns]
        last = i + 1 == len(rows) or section is None or rows[i + 1][section] != row[section]
        table.add_row(
            *cells,
            style="yellow" if doubtful(row) else "",
            end_section=section is not None and last,
        )
    return table


def markdown(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    """Return the lines of the table of the rows in Markdown."""
    cells = [[each.header for each in columns], ["---:"[: 4 - each.words] for each in columns]]
    cells += [[column.text(row).replace("|", "\\|") for column in columns] for row in rows]
    return [f"| {' | '.join(each)} |" for each in cells]


def present(study: Study, picture: Path, json: Path | None, csv: Path | None) -> list[Path]:
    """Write a study's files as `write` does, print its tables, and return the files' paths."""
    # Files before tables: what a terminal cannot show is written all the same.
    written = write(study, picture, json, csv)
    show(study.shown)
    return written


def write(study: Study, picture: Path, json: Path | None, csv: Path | None) -> list[Path]:
    """Write a study's files and return their paths. No data is written where its path is None."""
    written = []
    if study.picture is not None:
        written.append(write_picture(picture, study.picture))
    if json is not None and study.record is not None:
        write_record(json, study.record)
        written.append(json)
    if csv is not None:
        write_rows(csv, study.rows)
        written.append(csv)
    return written


def show(parts: Iterable[Table | str]) -> None:
    """Print tables, each as wide as it is, and lines of rich markup."""
    console = Console()
    for part in parts:
        if isinstance(part, Table):
            print_whole(part, console)
        else:
            console.print(part, soft_wrap=not console.is_terminal)  # a log has whole lines
