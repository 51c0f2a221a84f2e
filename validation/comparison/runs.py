"""Long work with its progress shown: many comparisons, a film."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from robotball import InputError, Request, Scene, integrate
from robotball.files.replacing import refused
from robotball.rotations import Array
from validation.comparison.agreement import Agreement, compare_with
from validation.comparison.names import fault_window_path
from validation.progress import Show, progress_bar

if TYPE_CHECKING:
    from robotball.film.render import Film


def compare_all(
    scenes: Sequence[Scene],
    requests: Sequence[Request],
    times: Array | None = None,
    *,
    strict: bool = False,
    fault_windows: Path | None = None,
    refuse: Callable[[Scene, InputError], None] | None = None,
) -> list[Agreement]:
    """Every scene by every request; the equations are integrated once a scene.

    strict: as in simulate; fault_windows: the folder for the states around each run's first fault;
    refuse: told of a scene that cannot be run, after which the others are; without it the
    InputError ends all.
    """
    agreements: list[Agreement] = []
    with progress_bar(len(scenes) * len(requests)) as show:
        for i, scene in enumerate(scenes):
            show(i * len(requests), f"{scene.name}: equations")
            try:
                theory = integrate(scene, times)
                for j, request in enumerate(requests, start=i * len(requests)):
                    progress = partial(_show, show, j, f"{scene.name}: {request.name}")
                    window = None
                    if fault_windows is not None:
                        label = request.engine.label
                        window = fault_window_path(fault_windows, scene, label, request.name)
                    agreements.append(
                        compare_with(
                            theory, request, strict=strict, fault_window=window, progress=progress
                        )
                    )
            except InputError as error:
                if refuse is None:
                    raise
                refuse(scene, error)
    return agreements


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


def tell_fault_windows(agreements: Sequence[Agreement], folder: Path) -> None:
    """Print how to look at the first fault of each faulty run that left a fault window."""
    for each in agreements:
        path = fault_window_path(folder, each.scene, each.motion.engine, each.settings.name)
        if each.faults and path.exists():
            print(f"robotball replay {path}", "steps through its first fault")
