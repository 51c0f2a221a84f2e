"""Common parts of studies: cells, rows, tables, files and pictures.

A module of `validation.studies` measures and returns a `Study`. Its command passes the study to
`present`, which writes the files and prints the tables.
"""

import hashlib
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CANCELLED = 100.0
"""Largest ratio of the momentum error to the path error. Sound runs reach 20; with a larger ratio,
path errors have cancelled."""
Row = Mapping[str, Any]
"""Plain data of one run; missing numbers are None or left out."""


def scene_cell(scene: str, duration: float, control: Sequence[str] = ()) -> dict[str, Any]:
    """Return the part of a sweep's cell that describes its scene, a catalog name or a path.

    A digest of the loaded scene makes results invalid if its files change, unless only comments
    change. `control` has the form that `controlled` takes.
    """
    loaded = controlled(scene, control)
    # A scene file cannot describe a robot from an MJCF or URDF file.
    text = pickle.dumps(loaded) if loaded.ball.general else scene_toml(loaded).encode()
    digest = hashlib.sha256(text).hexdigest()[:12]
    cell = {"scene": scene, "digest": digest, "duration": duration}
    return {**cell, "control": [*control]} if control else cell


def reference(cell: Cell, interval: float) -> tuple[Scene, Motion]:
    """Return a cell's scene and its reference motion, sampled every `interval` s; cached."""
    return _reference(cell["scene"], (*cell.get("control", ()),), cell["duration"], interval)


@cache
def _reference(
    name: str, control: tuple[str, ...], duration: float, interval: float
) -> tuple[Scene, Motion]:
    scene = controlled(name, control)
    return scene, integrate(scene, sample_times(duration, interval))


def compiled_motion(scene: Scene, times: Array) -> Motion:
    """Integrate a steady scene over times (n,) [s] from 0 with the compiled step.

    This function is as accurate as `integrate`, and faster for scenes with a million turns. Raises
    InputError if the motion needs too many steps.
    """
    return motion_of(scene, times, compiled_states(scene, times))


@dataclass(frozen=True)
class Column:
    """A column of a table in the terminal.

    Attributes
    ----------
    header, unit : str
        The header and the unit.
    cell : str or callable
        The key of a text or number in the rows, or a function that returns the text for a row.
    words : bool
        Whether the column is aligned left.
    form : str
        The format of numbers. A number that rounds to zero has no sign.
    scale : float
        The factor of numbers.
    missing : str
        The text for a missing number.
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
        # The format option z, which removes the sign of -0.0, does not exist for integers.
        form = self.form if self.form == "d" else f"z{self.form}"
        return f"{value * self.scale:{form}}"


def pareto_front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Return the indices of the points that no other point dominates, the cheapest first."""
    front: list[int] = []
    for i in sorted(range(len(errors)), key=lambda i: (costs[i], errors[i])):
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def cost_axes(heading: str, xlabel: str) -> "tuple[Figure, Axes]":
    """Return a figure with logarithmic axes: errors across, costs upwards."""
    figure, axes = panels(heading, (10.0, 7.2))
    axes.set(xscale="log", yscale="log", xlabel=xlabel)
    axes.set_ylabel("processor time of a simulated second [s]")
    return figure, axes


@dataclass(frozen=True)
class Study:
    """The outcome of a study.

    Attributes
    ----------
    scene : str
        The name of the scene.
    engine : Label or None
        The engine under test. None if several engines are compared.
    words : sequence of str
        The parts of the file names after scene and engine.
    rows : sequence of mappings
        The rows of the CSV file.
    record : mapping or None
        The JSON file without versions.
    shown : sequence of tables and str
        Tables and lines of rich markup to print.
    picture : Figure or None
        The picture.
    """

    scene: str
    engine: Label | None
    words: Sequence[str]
    rows: Sequence[Row]
    record: Mapping[str, Any] | None = None
    shown: Sequence[Table | str] = ()
    picture: "Figure | None" = None

    def stem(self, *words: str) -> str:
        """Return the file name without extension; `words` are parts for the options."""
        return file_name(self.scene, self.engine, [*self.words, *words])


def table_of(
    columns: Sequence[Column],
    rows: Sequence[Row],
    doubtful: Callable[[Row], object] = lambda row: False,
    section: str | None = None,
) -> Table:
    """Return the table of the rows for the terminal.

    Doubtful rows are yellow. An empty line separates rows with different values of `section`.
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


def present(study: Study, picture: Path, json: Path | None, csv: Path | None) -> list[Path]:
    """Write the files of a study, print its tables, and return the paths of the files."""
    # Write first, because printing may fail.
    written = write(study, picture, json, csv)
    show(study.shown)
    return written


def write(study: Study, picture: Path, json: Path | None, csv: Path | None) -> list[Path]:
    """Write the files of a study whose paths are given, and return their paths."""
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
    """Print tables without cutting them, and lines of rich markup."""
    console = Console()
    for part in parts:
        if isinstance(part, Table):
            print_whole(part, console)
        else:
            console.print(part, soft_wrap=not console.is_terminal)
