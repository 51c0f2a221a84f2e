"""Fig. 5: motion from rest with K = 0: γ on the Poisson sphere (a) and three contact paths (b-d).

python examples/paper/fig05.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics.equilibria import fixed_circle, fixed_points

OUT = Path("out/fig05.png")
DURATIONS = {"b": 16.0, "c": 20.0, "d": 6.0}  # s, chosen: not in the caption


def main(fraction: float = 1.0) -> dict[str, float]:
    """Draw a fraction of each motion; return MuJoCo's path errors and the radius in (d) [m]."""
    figure, numbers = Figure((10, 9), layout="constrained"), {}
    on_sphere = {"a": {"projection": "3d", "title": "(a) γ on the Poisson sphere"}}
    axes = figure.subplot_mosaic("ab;cd", per_subplot_kw=on_sphere)
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    globe = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*globe, color="0.85", lw=0.5)
    for name, duration in DURATIONS.items():
        scene = rb.load_scene(f"fig05{name}")
        times = np.linspace(0.0, fraction * duration, 2001)
        theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
        for motion, style in ((theory, {"lw": 4.0, "alpha": 0.5}), (engine, {"lw": 1.2})):
            line = {"color": motion.engine.colour, "label": motion.engine.name, **style}
            axes["a"].plot(*motion.gamma.T, **line)
            axes[name].plot(*motion.contact_point.T, **line)
        axes["a"].text(*1.15 * theory.gamma[0], name, fontsize=14)
        axes[name].set(title=f"({name}) contact point, {times[-1]:g} s", xlabel="X [m]")
        axes[name].set(ylabel="Y [m]", aspect="equal", adjustable="datalim")
        gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
        numbers[f"path error of {name}"] = float(gap.max())
    # In (d) γ stays at the fixed point Γ₁, so the path is a circle.
    numbers["radius of d"] = float(np.ptp(engine.contact_point[:, 0])) / 2
    circle = fixed_circle(scene.parameters)
    assert circle is not None
    for quarter, dashes in enumerate(("-", ":", "-", ":")):  # solid: stable, dotted: unstable
        arc = circle.at(np.linspace(quarter, quarter + 1, 50) * np.pi / 2)
        axes["a"].plot(*arc.T, color="k", ls=dashes)
    for point in fixed_points(scene.parameters):
        axes["a"].plot(*point.gamma, "X" if point.kind == "saddle" else "o", color="0.3")
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.6)
    axes["a"].set_axis_off()
    axes["a"].view_init(azim=28, elev=-22)
    axes["b"].legend()
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    return numbers


if __name__ == "__main__":
    print(OUT, main())
