"""Errors of MuJoCo's friction cones for several frictions, compared with the equations.

The runs differ only in the cone and the contact pair. All runs use RK4, prescribe the rates of
driven hinges and start at the depth at which the contact carries the ball, so that the error is an
error of friction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure

from robotball import InputError, Scene, Settings, integrate
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import for_slip, preset
from robotball.motion import path_error
from robotball.robot.looks import ACCENT, INK
from robotball.rotations import Array

from ..output import known, panels, progress_bar, scientific
from ..study import Column, Row, Study, table_of

_STEPS = {5e-3: "--", 1e-3: "-"}  # s, and the lines' styles
_FROM, _TO, _COUNT = 0.05, 2.0, 25  # of the friction that rolling needs
_QUICK_COUNT = 4
_COLOURS = {"pyramidal": INK, "elliptic": LABEL.colour, "recipe": ACCENT}
_INCHES = (10.0, 5.6)


def _contacts(scene: Scene, step: float) -> Mapping[str, Settings]:
    """Return MuJoCo's default contact with both cones, and the recipe for a ball that slips."""
    whole = replace(preset("balanced"), stop_at_fault=False)
    slipping = for_slip(scene, whole, step)
    elliptic = replace(slipping, impratio=None, solref=None, solimp=None, solreffriction=None)
    pyramidal = replace(elliptic, cone=None)
    return dict(zip(_COLOURS, (pyramidal, elliptic, slipping), strict=True))


def cones_study(scene: Scene, times: Array, quick: bool) -> Study:
    """Run a scene over `times` (n,) [s] with each contact and friction, with progress shown."""
    need = float(integrate(scene.ideal, times).loads.sliding_friction.max())
    if need * _FROM < mujoco.mjMINMU:
        raise InputError(
            f"{scene.name} needs a friction of {need:.3g}, and {_FROM} times this is below "
            f"{LABEL.name}'s least, {mujoco.mjMINMU:g}: choose a scene that needs more friction"
        )
    rows, parts = [], np.geomspace(_FROM, _TO, _QUICK_COUNT if quick else _COUNT)
    with progress_bar(len(parts)) as show:
        for i, part in enumerate(parts):
            show(i, f"{scene.name}: friction {part * need:.3g}")
            limits = replace(scene.friction, sliding=part * need)
            limited = replace(scene, friction=limits)
            theory = integrate(limited, times)
            for step in _STEPS:
                row: dict[str, Any] = {"part": part, "friction": part * need, "step": step}
                for name, settings in _contacts(limited, step).items():
                    motion = run(build(limited, settings), times)
                    whole = len(motion.times) == len(times)
                    row[name] = known(path_error(motion, theory)) if whole else None
                rows.append(row)
    record = {"scene": scene.name, "needed_friction": need, "runs": rows}
    picture = _picture(scene.name, rows)
    return Study(scene.name, LABEL, ["cones"], rows, record, [table_of(_COLUMNS, rows)], picture)


_COLUMNS = (
    Column("friction\nover need", "part", form=".3f"),
    Column("step", "step", "ms", form=".0f", scale=1e3),
    *(Column(name, name) for name in _COLOURS),
)


def _picture(name: str, rows: Sequence[Row]) -> Figure:
    slips, fine = [row for row in rows if row["part"] < 1], min(_STEPS)
    worst = {
        contact: scientific(max(row[contact] or 0.0 for row in slips if row["step"] == fine))
        for contact in _COLOURS
    }
    finding = ", ".join(f"{error} ({contact})" for contact, error in worst.items())
    heading = f"{name}, slipping, {1e3 * fine:g} ms: off by {finding}"
    figure, axes = panels(heading, _INCHES)
    for contact, colour in _COLOURS.items():
        for step, dashes in _STEPS.items():
            line = np.array([(r["part"], r[contact] or np.nan) for r in rows if r["step"] == step])
            axes.plot(*line.T, dashes, color=colour, label=f"{contact}, {1e3 * step:g} ms")
    axes.axvline(1.0, color=INK, linestyle=":", linewidth=1)
    axes.set(xscale="log", yscale="log", xlabel="sliding friction over the one that rolling needs")
    axes.set_ylabel("largest path error over path length")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
