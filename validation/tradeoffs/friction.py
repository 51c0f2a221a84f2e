"""What rolling and torsional friction do to the recipe's ball, over six decades of each."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robotball import Motion, Scene, load_scene, sample_times
from robotball.contact.model import build
from robotball.rotations import Array, rotation_matrix
from robotball.simulate import run
from validation.agreement import Agreement
from validation.sweeps import Cell
from validation.tradeoffs.configurations import RECIPE
from validation.tradeoffs.front import reference, scene_cell

ROLLING, TORSIONAL = "rolling", "torsional"
ROLLING_LENGTHS = (1e-6, 1.0)  # m, the ends of the study
TORSIONAL_LENGTHS = (5e-3, 1e3)  # m; the first is MuJoCo's default
PER_DECADE = {False: 4, True: 1}  # lengths a decade; of the quick form
EATEN = 0.1  # of |M|: the rate of loss is read until so much is gone


def friction_cells(scene: str, duration: float, quick: bool = False) -> list[Cell]:
    """Every run of the study: rolling friction, then torsional."""
    shared = scene_cell(scene, duration)
    return [
        {**shared, "friction": kind, "length": length}
        for kind, ends in ((ROLLING, ROLLING_LENGTHS), (TORSIONAL, TORSIONAL_LENGTHS))
        for length in _lengths(ends, PER_DECADE[quick])
    ]


def _lengths(ends: tuple[float, float], per_decade: int) -> list[float]:
    first, last = np.log10(ends)
    count = round((last - first) * per_decade) + 1
    return [float(f"{length:.4g}") for length in np.logspace(first, last, count)]


def friction_run(cell: Cell) -> dict[str, Any]:
    """The recipe with one coefficient of friction otherwise: its errors, and how fast it loses |M|.

    Without rolling friction the ball has the condim of its rolling model; with it, 6.
    """
    scene, theory = reference(cell["scene"], cell["duration"])
    if cell["friction"] == ROLLING:
        settings = replace(RECIPE, condim=6, rolling_friction=cell["length"])
    else:
        settings = replace(RECIPE, condim=4, torsional_friction=cell["length"])
    agreement = Agreement(scene, settings, theory, run(build(scene, settings), theory.times))
    engine = agreement.engine
    sizes = np.linalg.norm(engine.momentum, axis=1)
    until = _until(sizes)
    weight = scene.ball.mass * scene.gravity
    return {
        "path_error": agreement.path_error,
        "momentum_drift": agreement.momentum_drift,
        "left": float(sizes[-1] / sizes[0]),
        "loss": float((sizes[0] - sizes[until]) / engine.times[until]),
        "most_loss": cell["length"] * weight,
        "expected_loss": cell["length"] * weight * float(np.mean(_lever(scene, engine)[:until + 1])),
        "until": float(engine.times[until]),
        "spin": float(np.abs(agreement.diagnostics.spin).max()),
        "faults": [str(fault) for fault in agreement.faults],
    }


def _until(sizes: Array) -> int:
    """The last sample before more of |M| (n,) is lost than EATEN; at least the second."""
    lost = np.flatnonzero(sizes < (1 - EATEN) * sizes[0])
    return max(1, int(lost[0]) - 1) if len(lost) else len(sizes) - 1


def _lever(scene: Scene, motion: Motion) -> Array:
    """How much of a rolling-friction torque of one acts against |M| (n,), between -1 and 1.

    The torque is against the shell's rolling, û across the vertical: L̇ = -û. The classical |M|
    loses û·M̂ of it, and the rubber one, of M = γ×L (3.1), (γ×û)·M̂.
    """
    rate = np.array([scene.drives[0].rate(t) for t in motion.times.tolist()])
    in_frame = motion.angular_velocity - rate[:, None] * scene.ball.shell.axis
    rolling = np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), in_frame) * [1, 1, 0]
    rolling /= np.linalg.norm(rolling, axis=1, keepdims=True)
    if scene.rolling == "rubber":
        rolling = np.cross([0.0, 0.0, 1.0], rolling)
    direction = motion.momentum / np.linalg.norm(motion.momentum, axis=1, keepdims=True)
    return np.einsum("ni,ni->n", rolling, direction)
