"""Measure a run's cost relative to a bare loop of mj_step, and the speed-up on several cores.

Part of `make bench`. Motions must have the same digits on one core and on all. The bound beside
each speed-up is what independent processes reach, one per core: cores share caches, memory
bandwidth and clock.
"""

import math
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from robotball import PRESETS, Motion, Scene, integrate, load_scene
from robotball.dynamics.long_run import basins, exponents_of
from robotball.dynamics.sections import section_starts, sections_of
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.processes import Answer, at_most, cores, pool
from robotball.theory.ensembles.orbits import orbits
from validation.output import plain_table
from validation.studies.measuring import Cost, measure_costs, one_step, simulated_second

_SCENES = ("fig12", "classical_regular")
_ROUNDS = 9
_FRAMED: dict[str, Any] = {"padding": (0, 1), "show_edge": True}
_FIG_11B = load_scene("fig14").parameters
_MANY, _SOME = 4096, 512
_TIMES = np.array([0.0, 100.0])
_Digits = NDArray[Any]


def _main() -> None:
    console, everyone = Console(), cores()
    console.print(
        f"Medians (ranges) over {_ROUNDS} interleaved rounds of a scene's 10 s, relative to a bare "
        "loop of mj_step\non the same model. Processor time after the model is built. steps: the "
        "run's stepping with all readings;\nrun: also the monitor and the Motion."
    )
    for name in _SCENES:
        console.print(_costs(load_scene(name)))
    console.print(
        f"Best of {_ROUNDS} rounds, alternating between one core and {everyone}: other work on the "
        f"machine slows\nsome rounds, the best one least. bound: throughput of {everyone} "
        "independent processes over one."
    )
    console.print(_gains(everyone))


# The cost of a run


def _costs(scene: Scene) -> Table:
    """Return a row per preset; all but the first number are relative to its bare loop."""
    models = {
        preset: build(scene, settings)
        for preset, settings in PRESETS.items()
        if settings.own  # the others do not use mj_step
    }
    works: dict[str, Callable[[], float]] = {
        "equations": partial(_simulated_second, partial(integrate, scene))
    }
    for preset, model in models.items():
        works[f"{preset}: bare"] = partial(_bare_second, model)
        works[f"{preset}: steps"] = simulated_second(model, scene.times)
        works[f"{preset}: run"] = partial(_simulated_second, partial(run, model, scene.times))
    costs = dict(zip(works, measure_costs([*works.values()], _ROUNDS), strict=True))
    headings = ("preset", "µs a step", "steps", "run", "equations", "naive's loop")
    table = plain_table(headings, title=scene.name, title_justify="left", **_FRAMED)
    for preset, model in models.items():
        bare = costs[f"{preset}: bare"]
        others = (f"{preset}: steps", f"{preset}: run", "equations", "naive: bare")
        ratios = [_ratio_text(costs[other].over(bare)) for other in others]
        step = bare.seconds * model.compiled.opt.timestep
        table.add_row(preset, f"{step * 1e6:.1f}", *ratios)
    return table


def _bare_second(model: Model) -> float:
    """Return the processor time [s] of mj_step alone per simulated second."""
    timestep = model.compiled.opt.timestep
    return one_step(model.compiled, round(model.scene.duration / timestep)) / timestep


def _simulated_second(work: Callable[[], Motion]) -> float:
    began = time.thread_time()
    motion = work()
    return (time.thread_time() - began) / float(motion.times[-1])


def _ratio_text(cost: Cost) -> str:
    least, most = cost.spread
    return f"{cost.ratio:.2f} ({least:.2f}-{most:.2f})"


# The speed-up on several cores


@cache
def _work() -> dict[str, Callable[[], _Digits]]:
    """Return the timed functions, with names; each returns its digits."""
    rng = np.random.default_rng(1)
    starts = section_starts(rng.uniform(-4, 4, _MANY), rng.uniform(0, 6, _MANY), 25.0)
    some = starts[0][:_SOME], starts[1][:_SOME]

    return {
        "ensemble": lambda: orbits(_FIG_11B, *starts, _TIMES, 1e-9).contact_points,
        "section": lambda: sections_of(_FIG_11B, *starts, 25, tolerance=1e-9).times,
        "exponents": lambda: exponents_of(_FIG_11B, *some, 1000.0, 100.0).largest,
        "basins": lambda: basins(_FIG_11B, *some, 500.0).labels,
    }


def _gains(everyone: int) -> Table:
    """Return a row per function: the best times on one core and on all, and their ratio."""
    headings = ("", "1 core [ms]", f"{everyone} cores [ms]", "ratio", "bound")
    table = plain_table(headings, left=(), **_FRAMED)
    with pool(_do_plainly, everyone) as submit:
        for name, work in _work().items():
            best: dict[tuple[str, int], float] = defaultdict(lambda: math.inf)
            digits: list[_Digits] = []
            for done in range(1 + _ROUNDS):
                for count in (1, everyone):
                    with at_most(count):
                        began = time.perf_counter()
                        digits.append(work())
                        ours = time.perf_counter() - began
                    plain = _seconds_together(submit, name, count)
                    if done:  # the first round warms up
                        best["ours", count] = min(best["ours", count], ours)
                        best["plain", count] = min(best["plain", count], plain)
            assert all(np.array_equal(other, digits[0]) for other in digits), name
            one, all_of_them = best["ours", 1], best["ours", everyone]
            bound = everyone * best["plain", 1] / best["plain", everyone]
            numbers = (f"{one * 1e3:.0f}", f"{all_of_them * 1e3:.0f}", f"{one / all_of_them:.2f}")
            table.add_row(name, *numbers, f"{bound:.2f}")
    return table


def _seconds_together(submit: Callable[..., Future[Answer]], name: str, count: int) -> float:
    began = time.perf_counter()
    for future in [submit(name) for _ in range(count)]:
        future.result()
    return time.perf_counter() - began


def _do_plainly(name: str) -> None:
    _work()[name]()


if __name__ == "__main__":
    _main()
