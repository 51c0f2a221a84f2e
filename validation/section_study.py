"""A scene's Poincaré section by both engines, as points and as a picture."""

import numpy as np
from matplotlib.figure import Figure

from robotball import InputError, Scene, Settings, sample_times
from robotball.model import build
from robotball.motion_section import crossings
from robotball.palette import ENGINE, THEORY
from robotball.rotations import Array
from robotball.sections import section
from robotball.simulate import run

POINT = np.dtype([("time", float), ("l", float), ("L", float), ("direction", int)])


def section_by_equations(
    scene: Scene, attitudes: Array, momenta: Array, count: int, g: float
) -> Array:
    """The first `count` crossings of g = `g` of each of n starts: POINT records (n, count)."""
    found = section(scene.parameters, attitudes, momenta, count, g)
    if found.status.any():
        raise InputError(f"{np.count_nonzero(found.status)} motions do not keep crossing g = {g:g}")
    points = np.empty(found.times.shape, POINT)
    points["time"], points["l"], points["L"] = found.times, found.l, found.L
    points["direction"] = found.directions
    return points


def section_by_contact(scene: Scene, settings: Settings, duration: float, g: float) -> Array:
    """MuJoCo's crossings from the scene's own start over a duration [s]: POINT records (m,)."""
    model = build(scene, settings)
    motion = run(model, sample_times(duration, model.compiled.opt.timestep))
    assert motion.diagnostics is not None
    if motion.diagnostics.faults:
        raise InputError(f"MuJoCo's run is no result: {motion.diagnostics.faults[0]}")
    found = crossings(motion, scene, g)
    points = np.empty(len(found.times), POINT)
    points["time"], points["l"], points["L"] = found.times, found.l, found.L
    points["direction"] = found.directions
    return points


def draw_section(scene: Scene, theory: Array, engine: Array | None, g: float) -> Figure:
    """The section's points on the annulus; filled where g grows, paler where it falls."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    axes = figure.subplots()
    figure.suptitle(f"{scene.name}: {scene.title}")
    drawn = [("equations", theory, THEORY, "o", 3.0 if len(theory) < 5000 else 1.2)]
    if engine is not None:
        drawn.append(("MuJoCo", engine, ENGINE, "+", 5.0))
    for name, points, colour, mark, size in drawn:
        for direction, alpha, words in ((1, 1.0, "g grows"), (-1, 0.4, "g falls")):
            some = points[points["direction"] == direction]
            axes.plot(some["l"] % (2 * np.pi), some["L"], mark, color=colour, alpha=alpha,
                      markersize=size, markeredgewidth=0 if mark == "o" else 0.8,
                      label=f"{name}, {words}")  # fmt: skip
    size = float(np.linalg.norm(scene.start.momentum))
    axes.set(xlabel="l [rad], from 0 to 2π", ylabel="L [kg m²/s]", title=f"section g = {g:g}",
             xlim=(0, 2 * np.pi), ylim=(-1.05 * size, 1.05 * size))  # fmt: skip
    axes.grid(alpha=0.3)
    axes.legend(loc="best", markerscale=2)
    return figure
