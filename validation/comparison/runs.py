"""Long work with its progress shown: many comparisons, a video."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from robotball import Scene, Settings, integrate
from robotball.engines.mujoco.accuracy import accuracy_name
from robotball.rotations import Array
from validation.comparison.agreement import Agreement, compare
from validation.output import replacing
from validation.progress import Show, progress_bar


def compare_all(
    scenes: Sequence[Scene],
    wanted: Sequence[Settings | float],
    times: Array | None = None,
    *,
    strict: bool = False,
    dumps: Path | None = None,
) -> list[Agreement]:
    """Every scene at all of the settings, or to all of the accuracies; the equations are
    integrated once a scene.

    strict: as in simulate; dumps: the folder for the states around each run's first fault.
    """
    agreements: list[Agreement] = []
    with progress_bar(len(scenes) * len(wanted)) as show:
        for scene in scenes:
            show(len(agreements), f"{scene.name}: equations")
            theory = integrate(scene, times)
            for each in wanted:
                by: dict[str, Any]
                by, name = (
                    ({"accuracy": each}, accuracy_name(each))
                    if isinstance(each, float)
                    else ({"settings": each}, each.name)
                )
                report = partial(_report, show, len(agreements), f"{scene.name}: {name}")
                dump = None if dumps is None else dump_path(dumps, scene, name)
                agreements.append(
                    compare(scene, theory=theory, strict=strict, dump=dump, progress=report, **by)
                )
    return agreements


def dump_path(folder: Path, scene: Scene, settings: str) -> Path:
    """Where the states around the first fault of a run go, by the name of its settings."""
    return folder / f"{scene.name}-{settings.replace(' ', '-')}-fault.json"


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


def _report(show: Show, done: int, what: str, part: float) -> None:
    show(done + part, what)
