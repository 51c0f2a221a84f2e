"""Fig. 10: the ball leaves a straight line near σ₊, turns round and rolls along the opposite one.

The new line is stable only for f below 2.08: at the caption's f = 3 the ball leaves it at 300 s.

python examples/paper/fig10.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics import straight_motions as straight
from robotball.rotations import rotation_matrix


def main(duration: float = 80.0) -> dict[str, float]:
    """Draw the motion for a duration [s]; return MuJoCo's path error [m], dY/dt and largest f."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    scene, times = rb.load_scene("fig10"), rb.sample_times(duration, 0.02)
    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
    figure = Figure((8, 8), layout="constrained")
    axes = figure.subplot_mosaic("ac;bd", per_subplot_kw={"a": {"projection": "3d"}})
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    sphere = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*sphere, color="0.85", lw=0.5)
    for motion, style in ((theory, {"lw": 5.0, "alpha": 0.5}), (engine, {"ls": "--"})):
        style |= {"color": motion.engine.colour, "label": motion.engine.name}
        axes["a"].plot(*motion.gamma.T, **style)
        momentum = np.einsum("nji,nj->ni", rotation_matrix(motion.attitude), motion.momentum)
        axes["b"].plot(times, momentum, **style)
        axes["c"].plot(*motion.contact_point.T, **style)
    for i, label in enumerate(("M₁", "M₂", "M₃")):
        peak = np.abs(momentum[:, i]).argmax()
        axes["b"].text(times[peak] + 3, momentum[peak, i], label, va="center")
    for line in straight.straight_motions(ball, f):
        axes["a"].plot(*line.gamma, "X", color="k")
        axes["a"].text(*1.35 * line.gamma, straight.name_of_line(ball, line.gamma), fontsize=14)
    gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
    axes["d"].semilogy(times[1:], gap[1:], color="k")
    figure.suptitle("The ball leaves the unstable line σ₊ and rolls back along δ₊")
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.5)
    axes["a"].view_init(azim=48, elev=22)
    axes["a"].set_axis_off()
    axes["b"].set(title="M in the frame [kg m²/s]", xlabel="time [s]", xlim=(0, 1.2 * duration))
    axes["c"].set(title="path of the contact point [m]", aspect="equal", adjustable="datalim")
    axes["d"].set(title="distance of the two paths [m]", xlabel="time [s]")
    figure.legend(*axes["c"].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    Path("out").mkdir(exist_ok=True)
    figure.savefig("out/fig10.png")
    speed = np.diff(engine.contact_point[:, 1]) / times[1]
    numbers = {"path error": gap.max(), "least dY/dt": speed.min(), "last dY/dt": speed[-1]}
    return {**numbers, "stable below f": straight.stability_limit(ball) or np.nan}


if __name__ == "__main__":
    print("out/fig10.png", main())
