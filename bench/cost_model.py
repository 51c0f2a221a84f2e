"""Measure the cost model that chooses settings for a requested accuracy.

Runs every scene of the catalog and random balls with RK4 and with order 8 at many
steps, and prints the fitted coefficients beside the current ones. A second table
compares, for four accuracies, the time of the chosen settings with the fastest of these runs;
`bench.estimates` measures whether the accuracies are reached.
"""

import argparse
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from robotball import Motion, Scene, SceneWarning, Settings, catalog, integrate, load_scene
from robotball.engines.engine import as_own, simulate
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.accuracy import RK4_EVALUATIONS, scene_rate
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import ORDER_8, recipe
from robotball.engines.mujoco.special_limits import COST_MODEL
from robotball.rotations import Array
from tests.random_balls import ball_of_points
from validation.agreement import Agreement
from validation.output import known, plain_table, progress_bar, write_record
from validation.sweeps import Cell, sweep

_BALLS = 30
_TARGETS = (1e-4, 1e-6, 1e-8, 1e-10)
_STEPS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 29, 35)  # RK4 steps per sample interval
_STEPS_8 = tuple(0.1 / 2 ** (k / 4) for k in range(13))  # s, of order 8
_ENOUGH = 3e-11  # path error at which a search stops: finer runs are the best for no target
_Record = Mapping[str, Any]
_WIDTH = 130  # characters, for the table of cases
_STYLE: dict[str, Any] = {"title_justify": "left", "padding": (0, 1), "show_edge": True}
_ROUNDING, _COARSE = 1e-11, 1e-6  # path errors between these follow the order


def _cells() -> list[Cell]:
    return [
        *({"scene": name} for name in catalog()),
        *({"ball": number} for number in range(_BALLS)),
    ]


def _measure(cell: Cell) -> Mapping[str, Any]:
    """Return the runs of both families and one case per target, with errors from the equations."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        scene = ball_of_points(cell["ball"]) if "ball" in cell else load_scene(cell["scene"])
        theory = integrate(scene)
        interval = float(theory.times[1])
        rk4 = (recipe("", 1.0, timestep=interval / n) for n in _STEPS)
        order_8 = (recipe("", 1.0, integrator=ORDER_8, timestep=step) for step in _STEPS_8)
        return {
            "scene": scene.name,
            "steady": scene.steady,
            "motors": any(hinge.motor for hinge in scene.hinges),
            "rate": scene_rate(scene),
            "duration": scene.duration,
            "samples": len(theory.times),
            "rk4": _search(scene, theory, rk4),
            # Between the families, so that drifting timings affect both alike.
            "cases": [_case(scene, theory, target) for target in _TARGETS],
            # A servo's stiffness would limit the steps, not the error.
            "order_8": []
            if any(hinge.motor for hinge in scene.hinges)
            else _search(scene, theory, order_8),
        }


def _search(scene: Scene, theory: Motion, family: Iterable[Settings]) -> list[dict[str, Any]]:
    """Return the runs of a family, coarsest first, until one is accurate enough for all targets."""
    runs: list[dict[str, Any]] = []
    for settings in family:
        runs.append(_run(scene, theory, settings))
        error = runs[-1]["error"]
        if error is not None and error < _ENOUGH:
            break
    return runs


def _run(scene: Scene, theory: Motion, settings: Settings) -> dict[str, Any]:
    agreement = Agreement(theory, run(build(scene, settings), theory.times))
    diagnostics = agreement.report
    return {
        "size": agreement.report.timestep,
        "error": known(agreement.path_error),
        "drift": known(agreement.momentum_error),
        "sound": not agreement.faults,
        "steps": diagnostics.steps,
        "seconds": diagnostics.seconds,
    }


def _case(scene: Scene, theory: Motion, target: float) -> dict[str, Any]:
    """Return the processor time of a run to an accuracy, in total and of its last attempt [s]."""
    report = simulate(scene, theory.times, accuracy=target).report
    return {
        "target": target,
        "order_8": as_own(report.settings, Settings, LABEL).integrator == ORDER_8,
        "seconds": report.total_seconds,
        "last_seconds": report.seconds,
    }


def _best_seconds(front: Mapping[str, Any], target: float) -> float:
    """Return the shortest time [s] of a sound run within the target error, or infinity."""
    runs = [*front["rk4"], *front["order_8"]]
    return min(
        (
            record["seconds"]
            for record in runs
            if record["sound"] and record["error"] is not None and record["error"] <= target
        ),
        default=np.inf,
    )


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--workers", type=int)
    options = parser.parse_args()
    everything = _cells()
    with progress_bar(len(everything)) as show:
        results = sweep(
            _measure, everything, options.out / "front.jsonl", workers=options.workers, show=show
        )
    console = Console(width=_WIDTH)
    for result in results:
        if result.failure:
            console.print(f"{result.cell}: {result.failure}", style="yellow")
    records = [result.record for result in results if result.record is not None]
    console.print(_coefficient_table(records))
    console.print(_case_table(records))
    write_record(options.out / "front.json", {"coefficients": _coefficients(records)})


def _coefficients(records: Sequence[_Record]) -> dict[str, tuple[float, float]]:
    """Return each field of Front: the measured value and its scatter over scenes.

    Orders are low percentiles, so that estimates are rarely too small. Scatter is a factor for
    gain and step, and absolute for the others.
    """
    records = [record for record in records if not record["motors"]]
    steady = [record for record in records if record["steady"]]
    order = np.array([value for record in records for value in _orders(record)])
    stiffness = np.array([_stiffness(record) for record in records])
    gain = np.array([_gain(record) for record in records])
    power, log_gain = np.polyfit(np.log(stiffness), np.log(gain), 1)
    step = np.array([_per_step(record) for record in steady])
    order_8_step, sample = np.array([_per_order_8_step(record) for record in steady]).T
    control = [
        (_per_step(record) - np.median(step)) / RK4_EVALUATIONS
        for record in records
        if not record["steady"]
    ]
    return {
        "order": (float(np.percentile(order, 3)), float(order.std())),
        "gain": (float(np.exp(log_gain)), _factor(gain / stiffness**power)),
        "power": (float(power), 0.0),
        "step": (float(np.median(step)), _factor(step)),
        "order_8_step": (float(np.median(order_8_step)), float(order_8_step.std())),
        "sample": (float(np.median(sample)), float(sample.std())),
        "control": (float(np.median(control)), float(np.std(control))),
    }


def _orders(record: _Record) -> list[float]:
    first, *others = record["rk4"]
    return [_order(first, run) for run in others if run["error"] > _ROUNDING]


def _order(coarse: _Record, fine: _Record) -> float:
    return float(np.log(coarse["error"] / fine["error"]) / np.log(coarse["size"] / fine["size"]))


def _stiffness(record: _Record) -> float:
    """Return RK4's error for steps of one radian of rotation, extrapolated at fourth order."""
    run = record["rk4"][0]
    return float(run["error"] / (record["rate"] * run["size"]) ** 4)


def _gain(record: _Record) -> float:
    """Return the error of order 8 over (rate * step)^8 (geometric mean)."""
    errors = [
        run["error"] / (record["rate"] * run["size"]) ** 8
        for run in record["order_8"]
        if run["error"] is not None and _ROUNDING < run["error"] < _COARSE
    ]
    return float(np.exp(np.mean(np.log(errors))))


def _per_step(record: _Record) -> float:
    return float(np.median([run["seconds"] / run["steps"] for run in record["rk4"]]))


def _per_order_8_step(record: _Record) -> Array:
    runs = record["order_8"]
    seconds = np.array([run["seconds"] for run in runs])
    counts = np.array([[run["steps"], record["samples"]] for run in runs])
    return np.linalg.lstsq(counts / seconds[:, None], np.ones(len(runs)), rcond=None)[0]


def _factor(values: Array) -> float:
    """Return the standard deviation of the logarithm as a factor."""
    return float(np.exp(np.std(np.log(values))))


def _coefficient_table(records: Sequence[_Record]) -> Table:
    headings = ("coefficient", "in use", "measured", "scatter")
    table = plain_table(headings, title="the front", **_STYLE)
    for name, (value, scatter) in _coefficients(records).items():
        table.add_row(name, f"{getattr(COST_MODEL, name):.3g}", f"{value:.3g}", f"{scatter:.2g}")
    return table


def _case_table(records: Sequence[_Record]) -> Table:
    """Return a row per accuracy: how often order 8 was chosen, and the time over the best."""
    headings = (
        "requested", "cases", "order 8", "CPU / best\nmedian", "90 %", "largest", "over 2",
        "last run\nmedian", "largest",
    )  # fmt: skip
    table = plain_table(headings, (), title="accuracies requested", **_STYLE)
    for target in (*_TARGETS, None):
        cases = [
            (case["order_8"], case["seconds"] / best, case["last_seconds"] / best)
            for record in records
            for case in record["cases"]
            if target in (None, case["target"])
            and np.isfinite(best := _best_seconds(record, case["target"]))
        ]
        order_8, whole, last = np.array(cases).T
        shares = (np.median(whole), np.percentile(whole, 90), whole.max())
        table.add_row(
            "all" if target is None else f"{target:g}",
            str(len(cases)),
            f"{order_8.sum():.0f}",
            *(f"{share:.2f}" for share in shares),
            f"{(whole > 2).sum()}",
            *(f"{share:.2f}" for share in (np.median(last), last.max())),
        )
    return table


if __name__ == "__main__":
    _main()
