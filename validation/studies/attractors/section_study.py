"""A scene's Poincaré section by both engines, as points and as a picture."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from robotball import InputError, Scene, Settings
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.engines.reduced.compiled.kernels import Integers
from robotball.qualitative.motion_section import crossings
from robotball.qualitative.sections import section
from robotball.rotations import Array
from validation.output import title
from validation.studies.attractors.contact_map import sound_run


@dataclass(frozen=True)
class Points:
    """Crossings of n motions, m each or joined: times s, l rad, L kg m²/s, directions ±1."""

    times: Array
    l: Array
    L: Array
    directions: Integers

    def late(self, skip: int) -> "Points":
        """Without the first `skip` of each motion, and joined."""
        late = (..., slice(skip, None))
        return Points(
            self.times[late].ravel(),
            self.l[late].ravel(),
            self.L[late].ravel(),
            self.directions[late].ravel(),
        )


def section_by_equations(
    scene: Scene, attitudes: Array, momenta: Array, count: int, g: float
) -> Points:
    """The first `count` crossings of g = `g` of each of n starts, (n, count)."""
    found = section(scene.parameters, attitudes, momenta, count, g)
    if found.status.any():
        raise InputError(f"{np.count_nonzero(found.status)} motions do not keep crossing g = {g:g}")
    return Points(found.times, found.l, found.L, found.directions)


def section_by_contact(scene: Scene, settings: Settings, duration: float, g: float) -> Points:
    """MuJoCo's crossings (m,) from the scene's own start over a duration [s]."""
    model = build(scene, settings)
    found = crossings(sound_run(model, scene.start, duration), scene, g)
    return Points(found.times, found.l, found.L, found.directions)


def draw_section(scene: Scene, theory: Points, engine: Points | None, g: float) -> Figure:
    """The section's points on the annulus; filled where g grows, paler where it falls."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    axes = figure.subplots()
    title(figure, f"{scene.name}: {scene.title}")
    few = 3.0 if engine is None else 7.0
    drawn = [(EQUATIONS.name, theory, EQUATIONS.colour, "o", few if len(theory.l) < 5000 else 1.2)]
    if engine is not None:
        drawn.append((LABEL.name, engine, LABEL.colour, "+", 5.0))
    for name, points, colour, mark, size in drawn:
        for direction, alpha, words in ((1, 1.0, "g grows"), (-1, 0.4, "g falls")):
            some = points.directions == direction
            axes.plot(points.l[some] % (2 * np.pi), points.L[some], mark, color=colour, alpha=alpha,
                      markersize=size, markeredgewidth=0 if mark == "o" else 0.8,
                      label=f"{name}, {words}")  # fmt: skip
    size = float(np.linalg.norm(scene.start.momentum))
    axes.set(xlabel="l [rad], from 0 to 2π", ylabel="L [kg m²/s]", title=f"section g = {g:g}",
             xlim=(0, 2 * np.pi), ylim=(-1.05 * size, 1.05 * size))  # fmt: skip
    axes.grid(alpha=0.3)
    axes.legend(loc="best", markerscale=2)
    return figure
