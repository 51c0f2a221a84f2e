"""Long work with its progress shown: many comparisons, a film."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from robotball import InputError, Request, Scene, integrate
from robotball.files.replacing import refused
from robotball.processes import in_processes
from robotball.rotations import Array
from robotball.threads import allowed
from validation.comparison.agreement import Agreement, compare_with
from validation.comparison.drawing import MANY, draw
from validation.comparison.names import fault_window_path
from validation.comparison.results import Record, record
from validation.progress import Show, progress_bar

if TYPE_CHECKING:
    from robotball.film.render import Film


def agreements_of(
    scene: Scene,
    requests: Sequence[Request],
    times: Array | None = None,
    *,
    strict: bool = False,
    fault_windows: Path | None = None,
    show: Show = lambda *_: None,
) -> list[Agreement]:
    """A scene by every request; the equations are integrated once.

    strict: as in simulate; fault_windows: the folder for the states around each run's first fault;
    show: told how many requests are done.
    """
    show(0, f"{scene.name}: equations")
    theory = integrate(scene, times)
    agreements = []
    for i, request in enumerate(requests):
        progress = partial(_show, show, i, f"{scene.name}: {request.name}")
        window = None
        if fault_windows is not None:
            label = request.engine.label
            window = fault_window_path(fault_windows, scene, label, request.name)
        agreements.append(
            compare_with(theory, request, strict=strict, fault_window=window, progress=progress)
        )
    return agreements


@dataclass(frozen=True)
class Compared:
    """What is kept of a scene's agreements.

    records: as results.record has them; windows: the files of the faulty runs' fault windows;
    pictures: their files; refused: why there is nothing, if the scene cannot be run.
    """

    records: list[Record]
    windows: list[Path]
    pictures: Sequence[Path] = ()
    refused: str | None = None


@dataclass(frozen=True)
class Comparing:
    """Scene → Compared, with pictures and fault windows in the folder `out`.

    requests: each makes one, in whatever process it is; the others: as for `agreements_of`.
    """

    requests: Sequence[Callable[[], Request]]
    times: Array | None
    strict: bool
    out: Path
    plots: bool

    def __call__(self, scene: Scene, show: Show = lambda *_: None) -> Compared:
        requests = [make() for make in self.requests]
        try:
            agreements = agreements_of(
                scene,
                requests,
                self.times,
                strict=self.strict,
                fault_windows=self.out,
                show=show,
            )
        except InputError as error:
            return Compared([], [], refused=str(error))
        pictures: Sequence[Path] = ()
        if self.plots:
            pictures = draw(agreements, self.out)
        records = [record(each) for each in agreements]
        return Compared(records, windows(agreements, self.out), pictures)


def compare_all(scenes: Sequence[Scene], comparing: Comparing) -> list[Compared]:
    """What is kept of every scene, in their order; many scenes on all cores."""
    found: list[Compared] = []
    each = len(comparing.requests)
    with progress_bar(len(scenes) * each) as show:
        if len(scenes) < MANY or allowed() == 1:
            for i, scene in enumerate(scenes):
                found.append(comparing(scene, partial(_from, show, i * each)))
        else:
            for scene, compared in zip(scenes, in_processes(comparing, scenes), strict=True):
                found.append(compared)
                show(len(found) * each, scene.name)
    return found


def film(path: Path, agreement: Agreement, how: "Film | None" = None) -> None:
    """Both motions of an agreement as a film at `path`, by default as `Film()` says."""
    from robotball.film.write import write_video  # an encoder and a GL, which only a film needs

    with refused(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar(1) as show:
        write_video(
            path,
            agreement.motion,
            agreement.theory,
            how,
            progress=lambda part: show(part, f"{agreement.scene.name}: video"),
        )


def _show(show: Show, done: int, what: str, part: float) -> None:
    show(done + part, what)


def _from(show: Show, begin: int, done: float, what: str) -> None:
    show(begin + done, what)


def windows(agreements: Sequence[Agreement], folder: Path) -> list[Path]:
    """The files of the fault windows that the faulty runs left in a folder."""
    paths = [
        fault_window_path(folder, each.scene, each.motion.engine, each.settings.name)
        for each in agreements
        if each.faults
    ]
    return [path for path in paths if path.exists()]


def tell_fault_windows(paths: Iterable[Path]) -> None:
    """Print how to look at the first fault of each faulty run that left a fault window."""
    for path in paths:
        print(f"robotball replay {path}", "steps through its first fault")
