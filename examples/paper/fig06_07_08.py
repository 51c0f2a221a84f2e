"""Figs 6, 7 and 8: motion from rest with K₃ = 0.3, 0.52 and 3, and the flow of γ on the sphere.

python examples/paper/fig06_07_08.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics.cycles import curve_of, involute, limit_cycles, separatrices
from robotball.dynamics.equilibria import fixed_points, name_of

DURATIONS = {6: 40.0, 7: 40.0, 8: 24.0}  # s, chosen: not in the captions


def main(number: int, fraction: float = 1.0) -> dict[str, float]:
    """Draw a fraction of the motion; return MuJoCo's path error [m] and numbers of the flow."""
    scene = rb.load_scene(f"fig{number:02}")
    ball, times = scene.parameters, np.linspace(0.0, fraction * DURATIONS[number], 2001)
    theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
    points, cycles = fixed_points(ball), limit_cycles(ball)
    figure = Figure((11, 9), layout="constrained")
    axes = figure.subplot_mosaic("ac;bb", per_subplot_kw={"a": {"projection": "3d"}})
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    globe = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*globe, color="0.85", lw=0.5)

    def draw(gamma, **style):
        axes["a"].plot(*gamma.T, **style)
        axes["b"].plot(*involute(gamma).T, **style)

    for line in separatrices(ball, points, 60.0):
        draw(line.path, color="k", lw=0.8, ls="--" if line.stable else "-")
    for curve in (curve_of(ball, cycle.gamma, cycle.period) for cycle in cycles):
        draw(curve, color="green", lw=2.5)  # symmetric under γ → -γ
    for motion, style in ((theory, {"lw": 4.0, "alpha": 0.5}), (engine, {"lw": 1.2})):
        style |= {"color": motion.engine.colour, "label": motion.engine.name}
        draw(motion.gamma, **style)
        axes["c"].plot(*motion.contact_point.T, **style)
    for point in points:
        draw(point.gamma[None], color="k", marker="X" if point.kind == "saddle" else "o")
        axes["b"].text(*involute(point.gamma), " " + name_of(ball, point.gamma), fontsize=13)
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.5)
    axes["a"].set_axis_off()
    axes["b"].set(xlabel="φ = π/4 + arctan(γ₁/γ₂)", ylabel="γ₃", title="γ on the unrolled sphere")
    axes["c"].set(title=f"contact point, {times[-1]:g} s", xlabel="X [m]", ylabel="Y [m]")
    axes["c"].set(aspect="equal", adjustable="datalim")
    axes["c"].legend()
    Path("out").mkdir(exist_ok=True)
    figure.savefig(f"out/fig{number:02}.png")
    gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
    numbers = {"path error": gap.max(), "fixed points": len(points)}
    return numbers | ({"period": cycles[0].period} if cycles else {})


if __name__ == "__main__":
    for number in DURATIONS:
        print(f"out/fig{number:02}.png", main(number))
