"""Measure what a run costs over a bare loop of mj_step; a part of `make bench`."""

import time
from collections.abc import Callable
from functools import partial

from rich.console import Console
from rich.table import Table

from robotball import PRESETS, Motion, Scene, integrate, load_scene
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from validation.output import plain_table
from validation.studies.timing import Cost, measure_costs, one_step, simulated_second

_SCENES = ("fig12", "classical_regular")
_ROUNDS = 9


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
    works: dict[str, Callable[[], float]] = {
        "equations": partial(_simulated_second, partial(integrate, scene))
    }
    for preset, model in models.items():
        works[f"{preset}: bare"] = partial(_bare_second, model)
        works[f"{preset}: steps"] = simulated_second(model, scene.times)
        works[f"{preset}: run"] = partial(_simulated_second, partial(run, model, scene.times))
    costs = dict(zip(works, measure_costs(list(works.values()), _ROUNDS), strict=True))
    headings = ("preset", "µs a step", "steps", "run", "equations", "naive's loop")
    table = plain_table(
        headings, title=scene.name, title_justify="left", padding=(0, 1), show_edge=True
    )
    for preset, model in models.items():
        bare = costs[f"{preset}: bare"]
        others = [f"{preset}: steps", f"{preset}: run", "equations", "naive: bare"]
        ratios = [_words(costs[other].over(bare)) for other in others]
        step = bare.seconds * model.compiled.opt.timestep
        table.add_row(preset, f"{step * 1e6:.1f}", *ratios)
    return table


def _bare_second(model: Model) -> float:
    """Return the processor time [s] of a simulated second of mj_step alone, over the scene."""
    timestep = model.compiled.opt.timestep
    return one_step(model.compiled, round(model.scene.duration / timestep)) / timestep


def _simulated_second(work: Callable[[], Motion]) -> float:
    """Return the processor time [s] of a motion, all that is made of it, per simulated second."""
    began = time.thread_time()
    motion = work()
    return (time.thread_time() - began) / float(motion.times[-1])


def _words(cost: Cost) -> str:
    least, most = cost.spread
    return f"{cost.ratio:.2f} ({least:.2f}-{most:.2f})"


if __name__ == "__main__":
    _main()
