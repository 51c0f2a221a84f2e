"""Fig. 5: motion from rest with K = 0: γ on the Poisson sphere (a) and three contact paths (b-d).

python examples/paper/fig05.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics.equilibria import fixed_circle, fixed_points

DURATIONS = {"b": 16.0, "c": 20.0, "d": 6.0}  # s, chosen: not in the caption
SPHERE = {"projection": "3d", "azim": 28, "elev": -22, "title": "(a) γ on the Poisson sphere"}
LAYOUT = {"height_ratios": (4, 4, 2), "per_subplot_kw": {"a": SPHERE}}


def main(fraction: float = 1.0) -> dict[str, float]:
    """Draw a fraction of each motion; return MuJoCo's path errors and the radius in (d) [m]."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    figure, numbers = Figure((8, 10), layout="constrained"), {}
    axes = figure.subplot_mosaic("ab;cd;ee", **LAYOUT)
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    sphere = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*sphere, color="0.85", lw=0.5)
    for name, duration in DURATIONS.items():
        scene = rb.load_scene(f"fig05{name}")
        times = np.linspace(0.0, fraction * duration, 2001)
        theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
        for motion, style in ((theory, {"lw": 5.0, "alpha": 0.5}), (engine, {"ls": "--"})):
            style |= {"color": motion.engine.colour, "label": motion.engine.name}
            axes["a"].plot(*motion.gamma.T, **style)
            axes[name].plot(*motion.contact_point.T, **style)
        axes["a"].text(*1.15 * theory.gamma[0], name)
        axes[name].set(title=f"({name}) path [m]", aspect="equal", adjustable="datalim")
        gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
        axes["e"].semilogy(times[1:], gap[1:], color="k")
        axes["e"].text(times[-1], gap[-1], f" {name}")
        numbers[f"path error of {name}"] = float(gap.max())
    largest = 1e6 * max(numbers.values())
    figure.suptitle(f"From rest with K = 0, MuJoCo is within {largest:.0f} µm of the equations")
    circle, quarter = fixed_circle(scene.parameters), np.linspace(0.0, np.pi / 2, 50)
    for i, dashes in enumerate(("k-", "k:", "k-", "k:")):  # solid: stable, dotted: unstable
        axes["a"].plot(*circle.at(quarter + i * np.pi / 2).T, dashes)
    for point in fixed_points(scene.parameters):
        axes["a"].plot(*point.gamma, "X" if point.kind == "saddle" else "o", color="0.3")
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.5)
    axes["a"].set_axis_off()
    axes["b"].legend()
    axes["e"].set(title="(e) distance of the two paths [m]", xlabel="time [s]")
    Path("out").mkdir(exist_ok=True)
    figure.savefig("out/fig05.png")
    # In (d) γ stays at the fixed point Γ₁, so the path is a circle.
    return {**numbers, "radius of d": np.ptp(engine.contact_point[:, 0]) / 2}


if __name__ == "__main__":
    print("out/fig05.png", main())
