"""Run many comparisons or a film with progress shown, and show a fault window in the terminal."""

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from robotball import InputError, Motion, Request, Scene, integrate
from robotball.engines.mujoco.fault_window import FaultWindow, Replayed
from robotball.files.replacing import refused
from robotball.processes import allowed, in_processes
from robotball.rotations import Array
from validation.agreement import Agreement, compare_with
from validation.output import Show, plain_table, print_whole, program, progress_bar
from validation.plots import MANY, draw
from validation.results import Record, fault_window_path, record

if TYPE_CHECKING:
    from robotball.film.render import Film


def compare_all(scenes: Sequence[Scene], comparing: "Comparing") -> list["_Compared"]:
    """Return what is kept of every scene, in their order; many scenes on all cores."""
    each = len(comparing.requests)
    with progress_bar(len(scenes) * each) as show:
        if len(scenes) < MANY or allowed() == 1:
            return [comparing(scene, shifted(show, i * each)) for i, scene in enumerate(scenes)]
        found = []
        for scene, compared in zip(scenes, in_processes(comparing, scenes), strict=True):
            found.append(compared)
            show(len(found) * each, scene.name)
        return found


def shifted(show: Show, begin: int) -> Show:
    """Return what shows the progress of a part of the work, before which `begin` was done."""
    return lambda done, what: show(begin + done, what)


@dataclass(frozen=True)
class Comparing:
    """Scene → _Compared, with pictures and fault windows in the folder `out`.

    requests: each makes one, in whatever process it is; the others: as for `agreements_of`.
    """

    requests: Sequence[Callable[[], Request]]
    times: Array | None
    strict: bool
    out: Path
    plots: bool

    def __call__(self, scene: Scene, show: Show = lambda *_: None) -> "_Compared":
        requests = [make() for make in self.requests]
        try:
            agreements = agreements_of(
                scene, requests, self.times, strict=self.strict, fault_windows=self.out, show=show
            )
        except InputError as error:
            return _Compared([], [], refused=str(error))
        pictures = draw(agreements, self.out) if self.plots else ()
        records = [record(each) for each in agreements]
        return _Compared(records, windows(agreements, self.out), pictures)


@dataclass(frozen=True)
class _Compared:
    """The records and pictures of a scene's agreements.

    records: as results.record has them; windows: the files of the faulty runs' fault windows;
    pictures: their files; refused: why there is nothing, if the scene cannot be run.
    """

    records: list[Record]
    windows: list[Path]
    pictures: Sequence[Path] = ()
    refused: str | None = None


def agreements_of(
    scene: Scene,
    requests: Sequence[Request],
    times: Array | None = None,
    *,
    strict: bool = False,
    fault_windows: Path | None = None,
    show: Show = lambda *_: None,
) -> list[Agreement]:
    """Run a scene by every request, and integrate the equations once.

    strict: as in simulate; fault_windows: the folder for the states around each run's first fault;
    show: called with the number of requests done.
    """
    show(0, f"{scene.name}: equations")
    theory = integrate(
        scene, times, progress=lambda part: show(0, f"{scene.name}: equations {part:.0%}")
    )

    def agreement(done: int, request: Request) -> Agreement:
        window = None
        if fault_windows is not None:
            window = fault_window_path(fault_windows, scene, request.engine.label, request.name)

        def progress(part: float) -> None:
            show(done + part, f"{scene.name}: {request.name}")

        more = replace(request, strict=strict, fault_window=window, progress=progress)
        return compare_with(theory, more)

    return [agreement(i, request) for i, request in enumerate(requests)]


def film(path: Path, agreements: Sequence[Agreement], how: "Film | None" = None) -> None:
    """Film the motions of a scene's agreements at `path`, by default as `Film()` says.

    Raises InputError as `motions_of` does, and as `write_video` does.
    """
    motions = motions_of(agreements, "video")
    from robotball.film.render import write_video  # an encoder and a GL, which only a film needs

    with refused(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar(1) as show:
        words = f"{motions[-1].scene.name}: video"
        write_video(path, motions, how, progress=lambda part: show(part, words))


def motions_of(agreements: Sequence[Agreement], kind: str) -> list[Motion]:
    """Return the motions of a scene's agreements, and the equations' as the last.

    Raises InputError where a run broke in its first step, so that there is nothing to see.
    """
    for each in agreements:
        if len(each.motion.times) < 2:
            why = f"its motion ended at t = {each.end:g} s: {each.verdict}"
            raise InputError(f"{each.scene.name} has no {kind}, as {why}")
    return [*(each.motion for each in agreements), agreements[0].theory]


def windows(agreements: Sequence[Agreement], folder: Path) -> list[Path]:
    """Return the files of the fault windows that the faulty runs left in a folder."""
    paths = [
        fault_window_path(folder, each.scene, each.motion.engine, each.settings.name)
        for each in agreements
        if each.faults
    ]
    return [path for path in paths if path.exists()]


def tell_fault_windows(paths: Iterable[Path]) -> None:
    """Print how to look at the first fault of each faulty run that left a fault window."""
    for path in paths:
        print("The first fault, step by step:", f" {program()} replay {path}", sep="\n")


def show_rows(window: FaultWindow, console: Console) -> None:
    """Print all rows of a fault window, the first bad one marked."""
    columns = map(escape, window.columns)
    table = plain_table(("row", *columns, ""), left=(1 + len(window.columns),))
    for i, row in enumerate(window.table):
        bad = i == window.bad
        cells = [f"{i}", *map(_cell, row), "<- bad" if bad else ""]
        table.add_row(*cells, style="yellow" if bad else "")
    if window.bad == len(window.table):
        table.add_row(f"{window.bad}", *("" for _ in window.columns), "<- no further")
    print_whole(table, console)


def walk(window: FaultWindow, console: Console) -> None:
    """Print row after row from the first bad one on, each at a press of Enter."""
    if not sys.stdin.isatty():
        raise InputError("--interactive needs a terminal; leave it out to see all rows at once")
    for i in range(min(window.bad, len(window.table) - 1), len(window.table)):
        show_row(window, i, console)
        if input("Enter for the next row, q to leave: ").strip():
            break


def show_row(window: FaultWindow, row: int, console: Console) -> None:
    """Print all that is known of one row. Raises InputError where there is no such row."""
    if not 0 <= row < len(window.table):
        raise InputError(f"--step must be a row from 0 to {len(window.table) - 1}, not {row}")
    console.print(f"row {row}{', the first bad one' if row == window.bad else ''}")
    for name, value in zip(window.columns, window.table[row], strict=True):
        console.print(escape(f"  {name:20s} {_cell(value, digits=9)}"), highlight=False)
    qpos, qvel = window.coordinates(row)
    for name, values in (("qpos", qpos), ("qvel", qvel)):
        console.print(f"  {name:20s} {' '.join(_cell(v, 9) for v in values)}", highlight=False)


def _cell(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def outcome_of(window: FaultWindow, replayed: Replayed) -> str:
    """Return the outcome of taking the steps again, in a line."""
    if replayed.difference is None:
        return f"not stepped again: {replayed.why}"
    what = "the forces at its states" if window.adaptive else "its steps"
    if replayed.difference == 0.0:
        return f"{replayed.rows} rows: {what}, computed again, are the same to the last bit"
    return f"{replayed.rows} rows: {what}, computed again, differ by {replayed.difference:.3g}"
