"""Measure what a run costs over a bare loop of mj_step, and what many motions gain by more cores.

It is a part of `make bench`. The digits of the motions must be the same on one core and on all.
Beside each ratio stands what plain processes reach, one a core, each of which does the one core's
work for itself: cores that share caches, memory and clock are not as fast together as alone.
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
from validation.studies.timing import Cost, measure_costs, one_step, simulated_second

_SCENES = ("fig12", "classical_regular")
_ROUNDS = 9
_FRAMED: dict[str, Any] = {"padding": (0, 1), "show_edge": True}


def _main() -> None:
    """Print a table of each scene, and that of the cores."""
    console, everyone = Console(), cores()
    console.print(
        f"Medians (ranges) over {_ROUNDS} interleaved rounds of a scene's 10 s, as ratios to "
        "a bare loop of mj_step\non the same model; processor time, from a model on: each makes "
        "its own MjData. steps: a run's\nstepping, all of it read; run: that, the monitor and the "
        "Motion."
    )
    for name in _SCENES:
        console.print(_costs(load_scene(name)))
    console.print(
        f"The best of {_ROUNDS} rounds, on one core and on {everyone} in turn: another's work\n"
        f"on the machine slows some rounds, and the best least.\n"
        f"bound: how many times as much {everyone} plain processes do as one alone."
    )
    console.print(_gains(everyone))


# The cost of a run -------------------------------------------------------------------------------


def _costs(scene: Scene) -> Table:
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
    costs = dict(zip(works, measure_costs([*works.values()], _ROUNDS), strict=True))
    headings = ("preset", "µs a step", "steps", "run", "equations", "naive's loop")
    table = plain_table(headings, title=scene.name, title_justify="left", **_FRAMED)
    for preset, model in models.items():
        bare = costs[f"{preset}: bare"]
        others = (f"{preset}: steps", f"{preset}: run", "equations", "naive: bare")
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


# The gain by cores -------------------------------------------------------------------------------

_FIG_11B = load_scene("fig14").parameters
_MANY, _SOME = 4096, 512
_TIMES = np.array([0.0, 100.0])

_Digits = NDArray[Any]


@cache
def _work() -> dict[str, Callable[[], _Digits]]:
    """Return the functions that are timed, by name; each returns its digits."""
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
    """Return a row a work: the best seconds on one core and on all, and their ratio."""
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
            assert all(np.array_equal(each, digits[0]) for each in digits), name
            one, all_of_them = best["ours", 1], best["ours", everyone]
            bound = everyone * best["plain", 1] / best["plain", everyone]
            numbers = (f"{one * 1e3:.0f}", f"{all_of_them * 1e3:.0f}", f"{one / all_of_them:.2f}")
            table.add_row(name, *numbers, f"{bound:.2f}")
    return table


def _seconds_together(submit: Callable[..., Future[Answer]], name: str, count: int) -> float:
    """Return the seconds of so many processes at a named work, each for itself."""
    began = time.perf_counter()
    for future in [submit(name) for _ in range(count)]:
        future.result()
    return time.perf_counter() - began


def _do_plainly(name: str) -> None:
    """Do a named work in a process of its own, where one thread is allowed."""
    _work()[name]()


if __name__ == "__main__":
    _main()
