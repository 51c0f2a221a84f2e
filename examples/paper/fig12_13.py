"""Figs 12 and 13: motion on the limit cycle and on the limit torus of Fig. 11a.

python examples/paper/fig12_13.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb

ATTRACTORS = {12: "limit cycle", 13: "limit torus"}


def main(number: int, duration: float = 40.0) -> dict[str, float]:
    """Draw the motion for a duration [s]; return MuJoCo's path error [m] and mean dX/dt [m/s]."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    scene, times = rb.load_scene(f"fig{number}"), rb.sample_times(duration, 0.01)
    theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
    figure = Figure((8, 7.5), layout="constrained")
    axes = figure.subplot_mosaic(
        "ac;bb", height_ratios=(4, 3.5), per_subplot_kw={"a": {"projection": "3d"}}
    )
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    sphere = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*sphere, color="0.85", lw=0.5)
    for motion, style in ((theory, {"lw": 4.0, "alpha": 0.5}), (engine, {"ls": "--"})):
        style |= {"color": motion.engine.colour, "label": motion.engine.name}
        axes["a"].plot(*motion.gamma.T, **style)
        axes["b"].plot(*motion.contact_point.T, **style)
    gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
    axes["c"].semilogy(times[1:], gap[1:], color="k")
    drift, _ = engine.contact_point[-1] / duration
    figure.suptitle(f"On the {ATTRACTORS[number]} the ball drifts along X at {drift:.3g} m/s")
    axes["a"].set_title("γ on the Poisson sphere")
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.4)
    axes["a"].view_init(azim=40, elev=25)
    axes["a"].set_axis_off()
    axes["b"].set(title="path of the contact point, Y stretched", xlabel="X [m]", ylabel="Y [m]")
    axes["c"].set(title="distance of the two paths [m]", xlabel="time [s]")
    figure.legend(*axes["b"].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    Path("out").mkdir(exist_ok=True)
    figure.savefig(f"out/fig{number}.png")
    return {"path error": float(gap.max()), "mean dX/dt": float(drift)}


if __name__ == "__main__":
    for number in ATTRACTORS:
        print(f"out/fig{number}.png", main(number))
