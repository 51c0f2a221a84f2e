"""How far long work is, on standard error: a bar, or a line now and then."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

Show = Callable[[float, str], None]


LINE_EVERY = 30.0
"""How often [s] a line says how far the work is, where there is no terminal for a bar."""


@contextmanager
def progress_bar(total: float) -> Iterator[Show]:
    """A bar on standard error; call it with the work done and what is being done now.

    Where that is no terminal, as in a log file, it is a line now and then.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
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
        if time.monotonic() - last >= LINE_EVERY:
            last = time.monotonic()
            line = f"{done / total:.0%}: {what}"
            console.print(line, soft_wrap=True, highlight=False, markup=False)

    return show
