"""Long work with its progress shown: many comparisons, a video."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from robotball import Scene, Settings, integrate
from robotball.rotations import Array
from validation.agreement import Agreement, compare
from validation.results import replacing


def compare_all(
    scenes: Sequence[Scene],
    settings: Sequence[Settings],
    times: Array | None = None,
    *,
    strict: bool = False,
    dumps: Path | None = None,
) -> list[Agreement]:
    """Every scene at all of the settings; the equations are integrated once a scene.

    strict: as in simulate; dumps: the folder for the states around each run's first fault.
    """
    agreements: list[Agreement] = []
    with progress_bar(len(scenes) * len(settings)) as show:
        for scene in scenes:
            show(len(agreements), f"{scene.name}: equations")
            theory = integrate(scene, times)
            for each in settings:
                report = partial(_report, show, len(agreements), f"{scene.name}: {each.name}")
                dump = None if dumps is None else dump_path(dumps, scene, each)
                agreements.append(
                    compare(scene, each, theory=theory, strict=strict, dump=dump, progress=report)
                )
    return agreements


def dump_path(folder: Path, scene: Scene, settings: Settings) -> Path:
    """Where the states around the first fault of a run go."""
    return folder / f"{scene.name}-{settings.name}-fault.json"


def film(path: Path, agreement: Agreement) -> None:
    """Both motions of an agreement, side by side, as an mp4 at `path`."""
    from robotball.film.render import write_video  # an encoder and a GL, which only a film needs

    with progress_bar(1) as show, replacing(path) as temporary:
        write_video(
            temporary,
            agreement.scene,
            agreement.engine,
            agreement.theory,
            progress=lambda part: show(part, f"{agreement.scene.name}: video"),
        )


Show = Callable[[float, str], None]


def _report(show: Show, done: int, what: str, part: float) -> None:
    show(done + part, what)


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
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, what: bar.update(task, completed=done, description=what)


def _lines_now_and_then(console: Console, total: float) -> Show:
    last = time.monotonic()

    def show(done: float, what: str) -> None:
        nonlocal last
        if time.monotonic() - last >= LINE_EVERY:
            last = time.monotonic()
            console.print(f"{done / total:.0%}: {what}", soft_wrap=True, highlight=False)

    return show
