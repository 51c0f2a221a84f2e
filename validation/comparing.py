"""Run many comparisons or a film, with progress shown."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robotball import InputError, Motion, Request, Scene, integrate
from robotball.files.replacing import refused
from robotball.processes import allowed, in_processes
from robotball.rotations import Array

from .agreement import Agreement, compare_with
from .output import Show, progress_bar
from .plots import MANY, draw
from .results import Record, record

if TYPE_CHECKING:
    from robotball.view.render import Film


def compare_all(scenes: Sequence[Scene], comparing: "Comparing") -> list["_Compared"]:
    """Return what is kept of every scene, in their order; many scenes on all cores."""
    each = len(comparing.requests)
    with progress_bar(len(scenes) * each) as show:
        # A few scenes are done before as many processes have started.
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
    """Scene → _Compared, with pictures in the folder `out`.

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
            agreements = agreements_of(scene, requests, self.times, strict=self.strict, show=show)
        except InputError as error:
            # One scene that cannot be run must not take the results of the others with it.
            return _Compared([], refused=str(error))
        pictures = draw(agreements, self.out) if self.plots else ()
        return _Compared([record(each) for each in agreements], pictures)


@dataclass(frozen=True)
class _Compared:
    """The records and pictures of a scene's agreements.

    records: as results.record has them; pictures: their files; refused: why there is nothing, if
    the scene cannot be run.
    """

    records: list[Record]
    pictures: Sequence[Path] = ()
    refused: str | None = None


def agreements_of(
    scene: Scene,
    requests: Sequence[Request],
    times: Array | None = None,
    *,
    strict: bool = False,
    show: Show = lambda *_: None,
) -> list[Agreement]:
    """Run a scene by every request, and integrate the equations once.

    strict: as in simulate; show: called with the number of requests done.
    """
    show(0, f"{scene.name}: equations")
    theory = integrate(
        scene, times, progress=lambda part: show(0, f"{scene.name}: equations {part:.0%}")
    )

    def agreement(done: int, request: Request) -> Agreement:
        def progress(part: float) -> None:
            show(done + part, f"{scene.name}: {request.name}")

        return compare_with(theory, replace(request, strict=strict, progress=progress))

    return [agreement(i, request) for i, request in enumerate(requests)]


def film(path: Path, motions: Sequence[Motion], how: "Film | None" = None) -> None:
    """Film motions of a scene at `path`, by default as `Film()` says; the last is the equations'.

    Raises InputError as `robotball.film` does.
    """
    from robotball.view import render  # an encoder and a GL, which only a film needs

    with refused(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar(1) as show:
        words = f"{motions[-1].scene.name}: video"
        options = vars(how) if how else {}
        render.film(path, motions, progress=lambda part: show(part, words), **options)


def motions_of(agreements: Sequence[Agreement], kind: str) -> list[Motion]:
    """Return the motions of a scene's agreements, and the equations' as the last.

    Raises InputError where a run broke in its first step, so that there is nothing to see.
    """
    for each in agreements:
        if len(each.motion.times) < 2:
            why = f"its motion ended at t = {each.end:g} s: {each.verdict}"
            raise InputError(f"{each.scene.name} has no {kind}, as {why}")
    # The equations' last: a film's ghost, and the ball that a picture draws on top.
    return [*(each.motion for each in agreements), agreements[0].theory]
