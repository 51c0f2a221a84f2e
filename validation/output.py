"""Write results to files, which are never incomplete, and show the progress of long work.

Records include the versions of packages. Progress goes to standard error.
"""

import csv
import io
import math
import os
import re
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from robotball.errors import InputError
from robotball.files import json_text
from robotball.files.replacing import STANDARD_OUTPUT, followed, no_regular_file, refused, replacing
from robotball.motion import versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect
    from rich.table import Table

_DPI = 120
_CHARACTERS = 10  # per inch, in letters of 12 points
_WIDEST = 10_000  # characters, wider than any table
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of formulas in a spreadsheet
_LINE_EVERY = 30.0  # s between lines of progress outside a terminal
_SHORT = 3.0  # s; no line is written if the rest takes less


def program() -> str:
    """Return the command that starts this program in the same folder."""
    started = Path(sys.argv[0])
    if started.stem == "__main__":
        return f"python -m {__package__}"
    return "robotball" if which("robotball") == str(started) else os.path.relpath(started)


def write_record(path: Path | None, record: Mapping[str, Any]) -> None:
    """Write a record with the versions of packages as JSON, if a path is given."""
    if path is not None:
        text = json_text({**record, "versions": versions()}, indent=1)
        write_text(writable_file(path), text + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 on any system."""
    with replacing(path) as temporary:
        # File names and JSON strings may contain bytes that cannot be encoded.
        temporary.write_text(text, encoding="utf-8", errors="replace")


def in_picture(text: str) -> str:
    """Escape dollars in a user's text, which Matplotlib would read as a formula."""
    return text.replace("$", r"\$")


def together(text: str) -> str:
    """Prevent line breaks next to relation signs and between numbers and units."""
    return re.sub(r" (?=[=<≈] )|(?<=[=<≈]) |(?<=\d) (?=%|(?:s|ms|m|rad|kg)\b)", "\u00a0", text)


def halo(width: float = 3.0) -> "list[AbstractPathEffect]":
    """Return a path effect that gives lines and letters a white rim [points]."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground="white")]


def title(figure: "Figure", text: str) -> None:
    """Put a user's title above a figure; a wide title is small and has at most two lines."""
    wide, lines = figure.get_size_inches()[0], [text]
    if small := len(text) > _CHARACTERS * wide:
        lines = wrap(text, int(4 / 3 * _CHARACTERS * wide), max_lines=2, placeholder=" …")
    figure.suptitle(in_picture("\n".join(lines)), fontsize=9 if small else 12)


def panels(
    heading: str, size: tuple[float, float], rows: int = 1, columns: int = 1, **more: Any
) -> "tuple[Figure, Any]":
    """Return a figure with a user's title, and its axes with grids, like `subplots` does.

    `size` is in inches; `more` are options of `subplots`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    title(figure, heading)
    axes = figure.subplots(rows, columns, **more)
    for panel in figure.axes:
        panel.grid(alpha=0.3)
    return figure, axes


def write_picture(path: Path, figure: "Figure") -> Path:
    """Write a picture as PNG, and return its path.

    A logarithmic axis without positive values becomes linear: a ball at rest has errors of 0.
    """
    for axes in figure.axes:
        for axis, least in ((axes.xaxis, axes.dataLim.minposx), (axes.yaxis, axes.dataLim.minposy)):
            if axis.get_scale() == "log" and not math.isfinite(least):
                axes.set(**{f"{axis.axis_name}scale": "linear"})
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=_DPI)
    return path


def write_rows(
    path: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str] | None = None
) -> None:
    """Write rows as CSV, by default with the columns of the first row; None is empty.

    An apostrophe is put before texts that a spreadsheet would read as a formula.
    """
    text = io.StringIO()
    columns = list(rows[0] if rows else ()) if columns is None else columns
    table = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    write_text(path, text.getvalue())


def _cell(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def known(value: float | None) -> float | None:
    """Return a finite number unchanged, and None for other values, which JSON cannot contain."""
    return float(value) if value is not None and math.isfinite(value) else None


def scientific(value: float | None) -> str:
    """Return a number in two digits, or a dash for None and NaN."""
    return "-" if value is None or math.isnan(value) else f"{value:.1e}"


def plain_table(
    headings: Sequence[str],
    left: Collection[int] = (0,),
    rows: Iterable[Sequence[str]] = (),
    **style: Any,
) -> "Table":
    """Return a table with right-aligned columns, except for the columns with an index in `left`.

    `style` has options of `rich.table.Table`; the default is no padding and no edge.
    """
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, **{"padding": 0, "show_edge": False, **style})
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="left" if i in left else "right")
    for row in rows:
        table.add_row(*row)
    return table


def print_whole(table: "Table", console: Console) -> None:
    """Print a table without cutting numbers.

    In a terminal, long texts are folded if this makes the table fit. Otherwise the table keeps its
    width.
    """
    # Rich would cut cells to the width of the console.
    terminal, console.width = console.width, _WIDEST
    if console.is_terminal and console.measure(table).minimum <= terminal:
        console.width = terminal
    console.print(table)
    console.width = terminal


def as_text(write: Callable[[Console], None]) -> str:
    """Return what a function prints on a console, without colours."""
    text = io.StringIO()
    write(Console(file=text, width=_WIDEST, color_system=None))
    return text.getvalue()


def writable_folder(path: Path) -> Path:
    """Check that files can be written in a folder, and return its path.

    The folder is created and removed again, so that a command that is refused later leaves no
    folder behind. Raises InputError if the folder cannot be written.
    """
    if path == STANDARD_OUTPUT:
        raise InputError("--out takes a folder, not `-`, which means standard output")
    try:
        # Permissions alone do not show whether a folder can be created.
        created = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be made: {error.strerror or error}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: no permission")
    for folder in created:
        folder.rmdir()
    return path


def writable_file(path: Path) -> Path:
    """Check that a file can be written, and return its path. Raises InputError if not."""
    with refused(path):
        if path.is_dir():
            raise InputError(f"{path} cannot be written: it is a folder")
        if path == STANDARD_OUTPUT:
            return path
        if not no_regular_file(path):
            writable_folder(followed(path).parent)
        elif not os.access(path, os.W_OK):
            raise InputError(f"{path} cannot be written: no permission")
    return path


Show = Callable[[float, str], None]
"""Called with the work done and with a description of the current work."""


@contextmanager
def progress_bar(total: float, first_line: float = _LINE_EVERY) -> Iterator[Show]:
    """Show the progress of work of this size on standard error.

    A terminal shows a bar. Another stream, such as a log file, gets a line from time to time; the
    first line comes after `first_line` [s], if the work takes much longer.
    """
    console = Console(stderr=True)
    if not console.file.isatty():  # `is_terminal` would believe the FORCE_COLOR of Jupyter
        yield _lines_now_and_then(console, total, first_line)
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, what: bar.update(task, completed=done, description=what)


def _lines_now_and_then(console: Console, total: float, wait: float) -> Show:
    last, first = time.monotonic(), list[float]()

    def show(done: float, what: str) -> None:
        nonlocal last, wait, first
        now = time.monotonic()
        began, before = first = first or [now, done]
        left = (now - began) * (total - done) / (done - before or math.inf)
        if now - last >= wait and left > _SHORT:
            last, wait = now, _LINE_EVERY
            line = f"{done / total:.0%}: {what}, about {left:.0f} s to go"
            console.print(line, soft_wrap=True, highlight=False, markup=False)

    return show


def pairs_of(form: str, texts: Sequence[str]) -> dict[str, str]:
    """Parse texts `NAME=VALUE`; form: the form in the InputError."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if not name or not value or name in pairs:
            raise InputError(f"{form}, only once for each name, not {text!r}")
        pairs[name] = value
    return pairs


def columns_named(texts: Sequence[str]) -> dict[str, str]:
    """Parse the texts of --map. Raises InputError for a malformed text."""
    return pairs_of("--map takes TITLE=COLUMN, such as roll_joint.position=frame_angle", texts)
