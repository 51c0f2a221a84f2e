"""Rolling and torsional friction on the recipe's ball, over six decades of each."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import PRESETS, Motion, Scene, Settings, integrate
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import recipe
from robotball.equations import Rolling
from robotball.film.looks import ACCENT, INK
from robotball.rotations import Array, rotation_matrix
from robotball.scene import SAMPLE_INTERVAL
from validation.agreement import Agreement
from validation.output import panels
from validation.plots import note
from validation.study import Study, reference
from validation.sweeps import Cell, Result, rows_of

RECIPE = recipe("recipe", 1.0, timestep=PRESETS["balanced"].timestep)  # no error is a fault
ROLLING, TORSIONAL = "rolling", "torsional"
_ROLLING_LENGTHS = (1e-6, 1.0)  # m, the ends of the study
_TORSIONAL_LENGTHS = (5e-3, 1e3)  # m; the first is MuJoCo's default
_PER_DECADE = {False: 4, True: 1}  # lengths a decade; of the quick form
_EATEN = 0.1  # of |M|: the rate of loss is read until so much is gone
LEAST_FRICTION = 1e-5  # m: MuJoCo's own limit from below, next to no friction
# Rolling rows are softer than the sliding ones by (μ_slide/μ_roll)²: under the recipe they give
# way long before their limit. So they are studied as stiff as the normal force as well.
SOFT, HARD = "as in the recipe", "as stiff as the normal force"
_STIFF: dict[str, Any] = {
    "solver": "Newton",
    "iterations": 20,
    "noslip_iterations": None,
    "impratio": 1e4,
    "solreffriction": None,
    "timestep": 2e-3,
}


def friction_cells(shared: Cell, quick: bool = False) -> list[Cell]:
    """Return every run of the study: rolling friction, then torsional; shared: its scene."""
    return [
        {**shared, "friction": friction, "rows": rows, "length": length}
        for friction, rows, ends in (
            (ROLLING, SOFT, _ROLLING_LENGTHS),
            (ROLLING, HARD, _ROLLING_LENGTHS),
            (TORSIONAL, SOFT, _TORSIONAL_LENGTHS),
        )
        for length in _lengths(ends, _PER_DECADE[quick])
    ]


def _lengths(ends: tuple[float, float], per_decade: int) -> list[float]:
    first, last = np.log10(ends)
    count = round((last - first) * per_decade) + 1
    return [float(f"{length:.4g}") for length in np.logspace(first, last, count)]


def friction_run(cell: Cell) -> dict[str, Any]:
    """Run the recipe with the cell's friction; return its errors, and how fast it loses |M|."""
    scene, theory = reference(cell, SAMPLE_INTERVAL)
    settings = _friction_settings(scene.rolling, cell)
    agreement = Agreement(theory, run(build(scene, settings), theory.times))
    motion = agreement.motion
    sizes = np.linalg.norm(motion.momentum, axis=1)
    until = _until(sizes)
    speed = np.linalg.norm(theory.angular_velocity, axis=1).max()
    # A rolling friction μ_r in metres takes at most the torque μ_r N, and N is the weight.
    most = cell["length"] * (scene.ball.mass * scene.gravity)
    return {
        "path_error": agreement.path_error,
        "momentum_error": agreement.momentum_error,
        "left": float(sizes[-1] / sizes[0]),
        "loss": float((sizes[0] - sizes[until]) / motion.times[until]),
        "most_loss": most,
        "expected_loss": most * float(np.mean(_lever(scene, motion)[: until + 1])),
        "until": float(motion.times[until]),
        "relative_spin": float(np.abs(agreement.report.spin).max() / speed),
        "faults": [str(fault) for fault in agreement.faults],
    }


def _friction_settings(rolling: Rolling, cell: Cell) -> Settings:
    """Return the recipe with the cell's friction; a classical ball still spins freely."""
    goes_on = replace(RECIPE, stop_at_fault=False)
    if cell["friction"] == TORSIONAL:
        return replace(goes_on, condim=4, torsional_friction=cell["length"])
    changes: dict[str, Any] = {"condim": 6, "rolling_friction": cell["length"]}
    if rolling == "classical":
        # condim 6 has a torsional row as well, which must not act on a ball that may spin.
        changes["torsional_friction"] = LEAST_FRICTION
    return replace(goes_on, **changes, **(_STIFF if cell["rows"] == HARD else {}))


def friction_study(scene: Scene, results: Sequence[Result]) -> Study:
    """Return the study of the results of `friction_run`."""
    needed = float(integrate(scene).loads.torsional_friction.max())
    return Study(
        scene.name, LABEL, ["friction"], rows_of(results),
        record={
            "scene": scene.name,
            "torsional_friction_needed": needed,
            "runs": [asdict(result) for result in results],
        },
        picture=_friction_picture(scene, results, needed),
    )  # fmt: skip


def _until(sizes: Array) -> int:
    """Return the last sample before more of |M| (n,) is lost than _EATEN; at least the second."""
    lost = np.flatnonzero(sizes < (1 - _EATEN) * sizes[0])
    return max(1, int(lost[0]) - 1) if len(lost) else len(sizes) - 1


def _lever(scene: Scene, motion: Motion) -> Array:
    """Return the part of a unit rolling-friction torque that acts against |M| (n,), in [-1, 1].

    The torque is against the shell's rolling, û across the vertical: L̇ = -û. The classical |M|
    loses û·M̂ of it, and the rubber one, of M = γ×L (3.1), (γ×û)·M̂.
    """
    # The friction is against the shell's rolling, which turns at ω - Ω.
    rate = np.array([scene.drives[0].rate(t) for t in motion.times.tolist()])
    in_frame = motion.angular_velocity - rate[:, None] * scene.ball.shell.axis
    rolling = np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), in_frame) * [1, 1, 0]
    rolling /= np.linalg.norm(rolling, axis=1, keepdims=True)
    if scene.rolling == "rubber":
        rolling = np.cross([0.0, 0.0, 1.0], rolling)
    direction = motion.momentum / np.linalg.norm(motion.momentum, axis=1, keepdims=True)
    return np.einsum("ni,ni->n", rolling, direction)


_INCHES = (11.5, 5.6)
_FLOOR = 1e-10  # of the right panel: what is below is rounding


def _friction_picture(scene: Scene, results: Sequence[Result], needed: float) -> Figure:
    """Draw how fast |M| is lost, and the errors and spin over torsional friction.

    needed: the torsional friction that the motion demands [m].
    """
    rubber = f", torsional friction from {needed:.3g} m on makes it rubber"
    more = rubber if scene.rolling == "rubber" else ""
    heading = f"{scene.name}, the recipe: rolling friction brakes the ball{more}"
    figure, (left, right) = panels(heading, _INCHES, 1, 2)
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
    _rolling(left, scene, results)
    _torsional(right, results, needed if scene.rolling == "rubber" else None)
    return figure


def _friction_rows(results: Sequence[Result], kind: str) -> list[dict[str, Any]]:
    return [{**r.cell, **r.record} for r in results if r.record and r.cell["friction"] == kind]


def _rolling(axes: Axes, scene: Scene, results: Sequence[Result]) -> None:
    weight = scene.ball.mass * scene.gravity
    rows = _friction_rows(results, ROLLING)
    given = np.array(sorted({row["length"] for row in rows}))
    axes.plot(given, weight * given, color=ACCENT, linewidth=1.6, label="$\\mu_r m g$")
    for stiffness, marker, fill, label in (
        (HARD, "o", LABEL.colour, "friction as stiff as the normal force"),
        (SOFT, "o", "none", "the recipe's friction"),
    ):
        mine = [row for row in rows if row["rows"] == stiffness]
        # A logarithm has no place for none.
        losses = [max(row["loss"], 0.0) or np.nan for row in mine]
        lengths = [row["length"] for row in mine]
        axes.plot(lengths, losses, marker, color=LABEL.colour, mfc=fill, label=label)
    axes.set(
        xlabel=r"rolling friction $\mu_r$ [m], condim 6",
        ylabel="loss of |M| in a second [kg m²/s²]",
        title="rolling friction takes the momentum\nthat the rubber model keeps",
    )
    axes.legend(loc="upper left", frameon=False, fontsize=9)


def _torsional(axes: Axes, results: Sequence[Result], needed: float | None) -> None:
    rows = _friction_rows(results, TORSIONAL)
    lengths = [row["length"] for row in rows]
    for key, marker, fill, line, label in (
        ("path_error", "o", LABEL.colour, "-", "path error"),
        ("relative_spin", "s", "none", "--", "spin at the contact / |ω|"),
    ):
        values = [row[key] and max(row[key], _FLOOR) for row in rows]
        axes.plot(lengths, values, f"{marker}{line}", color=LABEL.colour, mfc=fill, label=label)
    if needed is not None:
        axes.axvline(needed, color=ACCENT, linewidth=1.4, linestyle=":")
        places = (
            # Words stand in the middle of their region, by the logarithms of its ends.
            (np.sqrt(lengths[0] * needed / 8), "drag"),
            (needed / 2.2, "transition"),
            (np.sqrt(lengths[-1] * needed), "rubber"),
        )
        style: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "color": INK}
        for x, word in places:
            axes.annotate(word, (x, 1.03), ha="center", **style)
        words = f"the motion needs {needed:.3g} m"
        note(axes, words, (needed, 0.35), (-5, 0), rotation=90, ha="right", va="center", **style)
    label = r"torsional friction $\mu_t$ [m], condim 4"
    axes.set(xlabel=label, ylabel="path error and spin, relative")
    axes.set_title("torsional friction: too little is a drag,\nenough is the rubber model", pad=24)
    axes.legend(loc="center right", frameon=False, fontsize=9)
