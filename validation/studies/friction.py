"""What rolling and torsional friction do to the recipe's ball, over six decades of each."""

from dataclasses import replace
from typing import Any

import numpy as np

from robotball import Motion, Scene, Settings
from robotball.engines.mujoco.engine import MUJOCO
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.parameters import Rolling
from robotball.rotations import Array, rotation_matrix
from robotball.times import SAMPLE_INTERVAL
from validation.comparison.agreement import Agreement
from validation.studies.configurations import RECIPE
from validation.studies.tradeoff import reference, scene_cell
from validation.sweeps import Cell

ROLLING, TORSIONAL = "rolling", "torsional"
ROLLING_LENGTHS = (1e-6, 1.0)  # m, the ends of the study
TORSIONAL_LENGTHS = (5e-3, 1e3)  # m; the first is MuJoCo's default
PER_DECADE = {False: 4, True: 1}  # lengths a decade; of the quick form
EATEN = 0.1  # of |M|: the rate of loss is read until so much is gone
LEAST_FRICTION = 1e-5  # m: MuJoCo's own limit from below, next to no friction
# Rolling rows are softer than the sliding ones by (μ_slide/μ_roll)²: under the recipe they give
# way long before their limit. So they are studied as stiff as the normal force as well.
SOFT, HARD = "as in the recipe", "as stiff as the normal force"
STIFF: dict[str, Any] = {
    "solver": "Newton",
    "iterations": 20,
    "noslip_iterations": None,
    "impratio": 1e4,
    "solreffriction": None,
    "timestep": 2e-3,
}


def friction_cells(scene: str, duration: float, quick: bool = False) -> list[Cell]:
    """Every run of the study: rolling friction, then torsional."""
    shared, per_decade = scene_cell(scene, duration), PER_DECADE[quick]
    rolling = [
        {**shared, "friction": ROLLING, "rows": rows, "length": length}
        for rows in (SOFT, HARD)
        for length in _lengths(ROLLING_LENGTHS, per_decade)
    ]
    torsional = [
        {**shared, "friction": TORSIONAL, "rows": SOFT, "length": length}
        for length in _lengths(TORSIONAL_LENGTHS, per_decade)
    ]
    return [*rolling, *torsional]


def _lengths(ends: tuple[float, float], per_decade: int) -> list[float]:
    first, last = np.log10(ends)
    count = round((last - first) * per_decade) + 1
    return [float(f"{length:.4g}") for length in np.logspace(first, last, count)]


def friction_run(cell: Cell) -> dict[str, Any]:
    """The recipe with one friction otherwise: its errors, and how fast it loses |M|."""
    scene, theory = reference(cell["scene"], cell["duration"], SAMPLE_INTERVAL)
    settings = friction_settings(scene.rolling, cell)
    agreement = Agreement(theory, run(build(scene, settings), theory.times), MUJOCO)
    motion = agreement.motion
    sizes = np.linalg.norm(motion.momentum, axis=1)
    until = _until(sizes)
    speed = np.linalg.norm(theory.angular_velocity, axis=1).max()
    weight = scene.ball.mass * scene.gravity
    return {
        "path_error": agreement.path_error,
        "momentum_error": agreement.momentum_error,
        "left": float(sizes[-1] / sizes[0]),
        "loss": float((sizes[0] - sizes[until]) / motion.times[until]),
        "most_loss": cell["length"] * weight,
        "expected_loss": cell["length"]
        * weight
        * float(np.mean(_lever(scene, motion)[: until + 1])),
        "until": float(motion.times[until]),
        "relative_spin": float(np.abs(agreement.report.spin).max() / speed),
        "faults": [str(fault) for fault in agreement.faults],
    }


def friction_settings(rolling: Rolling, cell: Cell) -> Settings:
    """The recipe with the cell's friction; a classical ball spins freely all the same."""
    goes_on = replace(RECIPE, stop_at_fault=False)
    if cell["friction"] == TORSIONAL:
        return replace(goes_on, condim=4, torsional_friction=cell["length"])
    changes: dict[str, Any] = {"condim": 6, "rolling_friction": cell["length"]}
    if rolling == "classical":
        changes["torsional_friction"] = LEAST_FRICTION
    return replace(goes_on, **changes, **(STIFF if cell["rows"] == HARD else {}))


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
