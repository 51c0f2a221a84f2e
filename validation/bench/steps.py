"""Measure what a run costs over a bare loop of mj_step; a part of `make bench`."""

import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import mujoco
from rich.console import Console
from rich.table import Table

from robotball import PRESETS, Motion, Scene, integrate, load_scene
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from validation.output import plain_table

_SCENES = ("fig12", "classical_regular")
_ROUNDS = 9
Made = TypeVar("Made", bound=Motion)


def _main() -> None:
    """Time every preset's run and the equations against a bare loop on the same model."""
    console = Console()
    console.print(
        f"Medians (ranges) over {_ROUNDS} interleaved rounds of a scene's 10 s, as ratios to a "
        "bare loop of mj_step\non the same model; processor time, from a model on: each makes its "
        "own MjData. steps: a run's\nstepping, all of it read; run: that, the monitor and the "
        "Motion."
    )
    for name in _SCENES:
        console.print(_table(load_scene(name)))


def _table(scene: Scene) -> Table:
    """Return a row a preset; all but the first figure are ratios to the preset's own bare loop."""
    models = {
        preset: build(scene, settings)
        for preset, settings in PRESETS.items()
        if not settings.adaptive  # mj_step is not what it does
    }
    seconds = _measure(scene, models)
    headings = ("preset", "µs a step", "steps", "run", "equations", "naive's loop")
    table = plain_table(
        headings, title=scene.name, title_justify="left", padding=(0, 1), show_edge=True
    )
    for preset, model in models.items():
        bare = seconds[f"{preset}: bare"]
        step = statistics.median(bare) / _step_count(model)
        others = [f"{preset}: steps", f"{preset}: run", "equations", "naive: bare"]
        ratios = [_ratio(seconds[other], bare) for other in others]
        table.add_row(preset, f"{step * 1e6:.1f}", *ratios)
    return table


def _measure(scene: Scene, models: dict[str, Model]) -> dict[str, list[float]]:
    """Return the seconds of every piece of work, a list over rounds; one more round warms up."""
    seconds: dict[str, list[float]] = defaultdict(list)
    for _ in range(1 + _ROUNDS):
        seconds["equations"].append(_timed(lambda: integrate(scene))[0])
        for preset, model in models.items():
            seconds[f"{preset}: bare"].append(_bare_loop(model))
            whole, motion = _timed(partial(run, model, scene.times))
            seconds[f"{preset}: run"].append(whole)
            seconds[f"{preset}: steps"].append(motion.report.seconds)
    return {name: rounds[1:] for name, rounds in seconds.items()}


def _bare_loop(model: Model) -> float:
    """Return the processor time [s] of the same steps with nothing read, monitored or kept."""
    began = time.thread_time()
    data = model.start_data()
    for _ in range(_step_count(model)):
        mujoco.mj_step(model.compiled, data)
    return time.thread_time() - began


def _step_count(model: Model) -> int:
    return round(model.scene.duration / model.compiled.opt.timestep)


def _timed(work: Callable[[], Made]) -> tuple[float, Made]:
    began = time.thread_time()
    motion = work()
    return time.thread_time() - began, motion


def _ratio(ours: list[float], theirs: list[float]) -> str:
    """Return the median, least and largest of the ratios round by round."""
    ratios = [a / b for a, b in zip(ours, theirs, strict=True)]
    return f"{statistics.median(ratios):.2f} ({min(ratios):.2f}-{max(ratios):.2f})"


if __name__ == "__main__":
    _main()
