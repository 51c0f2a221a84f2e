"""Write results into files that are whole or not there, and show the progress of long work.

Records name the versions that they depend on. Progress goes to standard error: a bar, or a line now
and then.
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
from robotball.files.json_text import json_text
from robotball.files.replacing import STANDARD_OUTPUT, followed, no_regular_file, refused, replacing
from robotball.motion import versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect
    from rich.table import Table

_DPI = 120
_CHARACTERS = 10  # of 12 points, in an inch
_WIDEST = 10_000  # characters, more than a table has
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # beginnings of one, for a spreadsheet


def program() -> str:
    """Return the words that start this program in a reader's terminal, in the same folder."""
    started = Path(sys.argv[0])
    if started.stem == "__main__":
        return f"python -m {__package__}"
    return "robotball" if which("robotball") == str(started) else os.path.relpath(started)


def write_record(path: Path | None, record: Mapping[str, Any]) -> None:
    """Write a record with the versions that it depends on as JSON, if a path is given."""
    if path is not None:
        text = json_text({**record, "versions": versions()}, indent=1)
        write_text(writable_file(path), text + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, wherever it is written."""
    with replacing(path) as temporary:
        # Bytes of a file's name that are no text, or half a character of a JSON file, are `?`.
        temporary.write_text(text, encoding="utf-8", errors="replace")


def in_picture(text: str) -> str:
    """Return a user's text for a picture, in which its dollars are no formula."""
    return text.replace("$", r"\$")


def together(text: str) -> str:
    """Return a text of which no line is broken beside a relation or before a number's unit."""
    return re.sub(r" (?=[=<≈] )|(?<=[=<≈]) |(?<=\d) (?=%|(?:s|ms|m|rad|kg)\b)", "\u00a0", text)


def halo(width: float = 3.0) -> "list[AbstractPathEffect]":
    """Return a white rim, in points, that sets lines and letters off from their background."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground="white")]


def title(figure: "Figure", text: str) -> None:
    """Put a user's title above a figure; a wider one is small, and in two lines at most."""
    wide, lines = figure.get_size_inches()[0], [text]
    if small := len(text) > _CHARACTERS * wide:
        lines = wrap(text, int(4 / 3 * _CHARACTERS * wide), max_lines=2, placeholder=" …")
    figure.suptitle(in_picture("\n".join(lines)), fontsize=9 if small else 12)


def panels(
    heading: str, size: tuple[float, float], rows: int = 1, columns: int = 1, **more: Any
) -> "tuple[Figure, Any]":
    """Return a figure with a user's title, and its panels as `subplots` has them, each with a grid.

    size: inches; more: for `subplots`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    title(figure, heading)
    axes = figure.subplots(rows, columns, **more)
    for each in figure.axes:
        each.grid(alpha=0.3)
    return figure, axes


def write_picture(path: Path, figure: "Figure") -> Path:
    """Write a picture as PNG, and return its path.

    A logarithmic axis on which nothing is positive is made linear. Errors of a ball at rest are 0.
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
    """Write rows as CSV, with these columns, or those of the first row; None is empty.

    A text that a spreadsheet would take for a formula has an apostrophe before it.
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
    """Return a number for a record; None, as JSON has no other, where it is not finite."""
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
    """Return a table; columns begin at the right but for those whose place is `left`.

    style: of `rich.table.Table`, a padding of 0 and no edge as far as it says nothing else.
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
    """Print a table and cut no number of it.

    In a terminal words are folded where that makes it fit. Else it is as wide as it is: a narrower
    terminal breaks its lines.
    """
    # Rich measures a table against the console's width, and would cut cells to it.
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
    """Return `path`, in which files can be written; raises InputError where they can't.

    It is tried by making the folder; one that was not there is taken away again, so that nothing
    stays of a command that is refused later.
    """
    if path == STANDARD_OUTPUT:
        raise InputError("`-` is standard output, and the output folder must be a folder")
    try:
        # Whether a folder can be made shows only when it is made: permissions are not all.
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be made: {error.strerror or error}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: no permission")
    for folder in made:
        folder.rmdir()
    return path


def writable_file(path: Path) -> Path:
    """Return `path` if `replacing` can write it; raises InputError where it cannot."""
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
"""Called with the work done and with words on what is being done now."""
_LINE_EVERY = 30.0  # s between lines of progress, where there is no terminal for a bar


@contextmanager
def progress_bar(total: float) -> Iterator[Show]:
    """Show the progress of work of this size on standard error by a bar.

    Where that is no terminal, as in a log file, it is a line now and then.
    """
    console = Console(stderr=True)
    if not console.file.isatty():  # Jupyter sets FORCE_COLOR, by which rich takes a pipe for one
        yield _lines_now_and_then(console, total)
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, what: bar.update(task, completed=done, description=what)


def _lines_now_and_then(console: Console, total: float) -> Show:
    last = time.monotonic()

    def show(done: float, what: str) -> None:
        nonlocal last
        # In a log file every line stays, so there are few.
        if time.monotonic() - last >= _LINE_EVERY:
            last = time.monotonic()
            line = f"{done / total:.0%}: {what}"
            console.print(line, soft_wrap=True, highlight=False, markup=False)

    return show
