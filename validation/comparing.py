"""Run many comparisons, and write films, with progress."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from robotball import InputError, Motion, Request, Scene, integrate
from robotball.errors import percent
from robotball.files.replacing import refused
from robotball.processes import allowed, in_processes
from robotball.rotations import Array

from .agreement import Agreement, compare_with
from .output import Show, progress_bar
from .plots import draw
from .results import Record, record

_MANY = 4  # if there are this many scenes, several processes compare them


def compare_all(scenes: Sequence[Scene], comparing: "Comparing") -> list["_Compared"]:
    """Compare scenes, in parallel if there are many, and return their records in order."""
    runs = len(comparing.requests)
    with progress_bar(len(scenes) * runs) as show:
        # Starting processes takes longer than comparing a few scenes.
        if len(scenes) < _MANY or allowed() == 1:
            return [comparing(scene, shifted(show, i * runs)) for i, scene in enumerate(scenes)]
        results = []
        for scene, compared in zip(scenes, in_processes(comparing, scenes), strict=True):
            results.append(compared)
            show(len(results) * runs, scene.name)
        return results


def shifted(show: Show, begin: int) -> Show:
    """Return a function that shows the progress of a part of the work that begins at `begin`."""
    return lambda done, work: show(begin + done, work)


@dataclass(frozen=True)
class Comparing:
    """Compare a scene and draw its pictures; can be pickled.

    Attributes
    ----------
    requests : sequence of callables
        Each callable returns a request; it is called in the process that runs the request.
    times : (n,), s, or None
        The sample times.
    out : Path
        The folder for pictures.
    plots : bool
        Whether to draw pictures.
    """

    requests: Sequence[Callable[[], Request]]
    times: Array | None
    out: Path
    plots: bool

    def __call__(self, scene: Scene, show: Show = lambda *_: None) -> "_Compared":
        requests = [make() for make in self.requests]
        try:
            agreements = agreements_of(scene, requests, self.times, show)
        except InputError as error:
            # The results of the other scenes must not be lost.
            return _Compared([], refused=str(error))
        pictures = draw(agreements, self.out) if self.plots else ()
        return _Compared([record(agreement) for agreement in agreements], pictures)


@dataclass(frozen=True)
class _Compared:
    """Records and picture files of a scene, or the reason why it was refused."""

    records: list[Record]
    pictures: Sequence[Path] = ()
    refused: str | None = None


def agreements_of(
    scene: Scene,
    requests: Sequence[Request],
    times: Array | None = None,
    show: Show = lambda *_: None,
) -> list[Agreement]:
    """Run a scene with every request, and integrate the equations once.

    `show` is called with the number of requests done.
    """
    show(0, f"{scene.name}: equations")
    theory = integrate(
        scene, times, progress=lambda part: show(0, f"{scene.name}: equations {part:.0%}")
    )

    def agreement(done: int, request: Request) -> Agreement:
        def progress(part: float) -> None:
            show(done + part, f"{scene.name}: {request.name}")

        return compare_with(theory, replace(request, progress=progress))

    return [agreement(i, request) for i, request in enumerate(requests)]


def film(path: Path, motions: Sequence[Motion], **options: Any) -> None:
    """Film motions of a scene at `path`; the last one is the reference motion.

    `options` are passed to `robotball.film`. Raises InputError if it does.
    """
    from robotball.view import render  # imports an encoder and OpenGL, which only a film needs

    with refused(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar(1) as show:
        words = f"{motions[-1].scene.name}: video"
        render.film(path, motions, progress=lambda part: show(part, words), **options)


def note_of(agreements: Sequence[Agreement]) -> str:
    """Return the effect of the settings' friction on the path, for a note in a film."""
    slips = [run.slip for run in agreements if run.slip and run.slip.of_settings]
    shares = [slip.by_friction for slip in slips if slip.by_friction is not None]
    return f"too little friction alone changes the path by {percent(max(shares))}" if shares else ""


def motions_of(agreements: Sequence[Agreement], kind: str) -> list[Motion]:
    """Return the engine's motions of a scene, and the reference motion as the last.

    Raises InputError if a run failed in its first step. The last motion is the ghost in a film, and
    is drawn on top in a picture.
    """
    for run in agreements:
        if len(run.motion.times) < 2:
            ended = f"the run ended at t = {run.end:g} s: {run.verdict}"
            raise InputError(f"{run.scene.name}: no {kind}, because {ended}")
    return [*(run.motion for run in agreements), agreements[0].theory]
