"""Figs 6, 7 and 8: motion from rest with K₃ = 0.3, 0.52 and 3, and the flow of γ on the sphere.

python examples/paper/fig06_07_08.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics.cycles import curve_of, involute, limit_cycles, separatrices
from robotball.dynamics.equilibria import fixed_points, name_of

DURATIONS = {6: 40.0, 7: 40.0, 8: 24.0}  # s, chosen: not in the captions


def main(number: int, fraction: float = 1.0) -> dict[str, float]:
    """Draw a fraction of the motion; return MuJoCo's path error [m] and numbers of the flow."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    scene = rb.load_scene(f"fig{number:02}")
    ball, times = scene.parameters, np.linspace(0.0, fraction * DURATIONS[number], 2001)
    theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
    points, cycles = fixed_points(ball), limit_cycles(ball)
    figure = Figure((8, 8.5), layout="constrained")
    axes = figure.subplot_mosaic("aa;bc", height_ratios=(5, 3.5))
    for line in separatrices(ball, points, 60.0):
        dashes = "k--" if line.stable else "k-"
        axes["a"].plot(*involute(line.path).T, dashes, lw=0.8)
    for cycle in cycles:
        curve = involute(curve_of(ball, cycle.gamma, cycle.period))
        axes["a"].plot(*curve.T, color="green", lw=2.5, label="limit cycle")
    for motion, style in ((theory, {"lw": 5.0, "alpha": 0.5}), (engine, {"ls": "--"})):
        style |= {"color": motion.engine.colour, "label": motion.engine.name}
        axes["a"].plot(*involute(motion.gamma).T, **style)
        axes["b"].plot(*motion.contact_point.T, **style)
    for point in points:
        axes["a"].plot(*involute(point.gamma), "kX" if point.kind == "saddle" else "ko")
        axes["a"].text(*involute(point.gamma), "  " + name_of(ball, point.gamma), fontsize=14)
    gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
    axes["c"].semilogy(times[1:], gap[1:], color="k")
    orbit = f"an unstable cycle of {cycles[0].period:.3g} s" if cycles else "a closed contour"
    figure.suptitle(f"K₃ = {ball.K[2]:g}: {len(points)} fixed points and {orbit}")
    axes["a"].set(title="γ on the unrolled sphere", xlabel="π/4 + arctan(γ₁/γ₂)", ylabel="γ₃")
    axes["b"].set(title="path of the contact point [m]", aspect="equal", adjustable="datalim")
    axes["c"].set(title="distance of the two paths [m]", xlabel="time [s]")
    figure.legend(*axes["a"].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    Path("out").mkdir(exist_ok=True)
    figure.savefig(f"out/fig{number:02}.png")
    period = {"period": cycles[0].period} if cycles else {}
    return {"path error": gap.max(), "fixed points": len(points), **period}


if __name__ == "__main__":
    for number in DURATIONS:
        print(f"out/fig{number:02}.png", main(number))
