"""One scene's own front: the recipe over its steps, and what asking for an accuracy makes of it."""

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from robotball import (
    Motion,
    Scene,
    SceneWarning,
    Settings,
    catalog,
    integrate,
    load_scene,
)
from robotball.engines.mujoco.cost_model import scene_rate
from robotball.engines.mujoco.engine import own_settings
from robotball.engines.mujoco.integrators import ADAPTIVE
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import recipe
from robotball.engines.simulate import simulate
from validation.comparison.agreement import Agreement
from validation.studies.random_scenes import random_scene
from validation.sweeps import Cell

BALLS = 30
TARGETS = (1e-4, 1e-6, 1e-8, 1e-10)
STEPS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 29, 35)  # of RK4 in a sample interval
RTOLS = tuple(10 ** (-half / 2) for half in range(14, 27))  # half a decade apart
ENOUGH = 3e-11  # a finer run than one of this error is no target's best


def cells() -> list[Cell]:
    """The catalog, and the random balls."""
    return [
        *({"scene": name} for name in catalog()),
        *({"ball": number} for number in range(BALLS)),
    ]


def measure(cell: Cell) -> Mapping[str, Any]:
    """The runs of both families, and one case a target; errors against the equations."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        scene = random_scene(cell["ball"]) if "ball" in cell else load_scene(cell["scene"])
        theory = integrate(scene)
        interval = float(theory.times[1])
        rk4 = (recipe("", 1.0, timestep=interval / n) for n in STEPS)
        adaptive = (recipe("", 1.0, integrator=ADAPTIVE, rtol=rtol) for rtol in RTOLS)
        return {
            "scene": scene.name,
            "steady": scene.steady,
            "motors": any(scene.motors),
            "rate": scene_rate(scene),
            "duration": scene.duration,
            "samples": len(theory.times),
            "rk4": _search(scene, theory, rk4),
            # What timings drift by should not fall between the families and the cases.
            "cases": [_case(scene, theory, target) for target in TARGETS],
            # A servo's stiffness, not the error, would set the steps.
            "adaptive": [] if any(scene.motors) else _search(scene, theory, adaptive),
        }


def _search(scene: Scene, theory: Motion, family: Iterable[Settings]) -> list[dict[str, Any]]:
    """The runs of a family from the coarsest on, until one is good enough for any target."""
    runs: list[dict[str, Any]] = []
    for settings in family:
        runs.append(_run(scene, theory, settings))
        error = runs[-1]["error"]
        if error is not None and error < ENOUGH:
            break
    return runs


def _run(scene: Scene, theory: Motion, settings: Settings) -> dict[str, Any]:
    agreement = Agreement(theory, run(build(scene, settings), theory.times))
    diagnostics = agreement.report
    return {
        "size": settings.rtol if settings.adaptive else settings.timestep,
        "error": agreement.path_error,
        "drift": agreement.momentum_error,
        "sound": not agreement.faults,
        "steps": diagnostics.steps,
        "seconds": diagnostics.seconds,
    }


def _case(scene: Scene, theory: Motion, target: float) -> dict[str, Any]:
    """A run to an accuracy, its true error beside the estimate."""
    with warnings.catch_warnings(record=True) as reported:
        warnings.simplefilter("always", SceneWarning)
        motion = simulate(scene, theory.times, accuracy=target)
    agreement, settings = Agreement(theory, motion), own_settings(motion.report.settings)
    return {
        "target": target,
        "chosen": settings.rtol or settings.timestep,
        "adaptive": settings.adaptive,
        "error": agreement.path_error,
        "estimate": agreement.report.estimated_error,
        "reported": bool(reported),
        "seconds": motion.report.total_seconds,
        "last_seconds": agreement.report.seconds,
    }


def best_seconds(record: Mapping[str, Any], target: float) -> float:
    """The least that a sound run of a true error within the target took [s]; infinite if none."""
    runs = [*record["rk4"], *record["adaptive"]]
    return min(
        (
            each["seconds"]
            for each in runs
            if each["sound"] and each["error"] is not None and each["error"] <= target
        ),
        default=np.inf,
    )
