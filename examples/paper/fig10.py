"""Fig. 10: the ball leaves a straight line near σ₊, turns round and rolls along the opposite one.

The caption calls the new line stable. It is stable only for f below 2.08: at the caption's f = 3
the ball leaves it again after about 300 s.

python examples/paper/fig10.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics import straight_motions as straight
from robotball.rotations import rotation_matrix

OUT = Path("out/fig10.png")


def main(duration: float = 80.0) -> dict[str, float]:
    """Draw the motion for a duration [s]; return MuJoCo's path error [m], dY/dt and largest f."""
    scene, times = rb.load_scene("fig10"), rb.sample_times(duration, 0.02)
    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    theory, engine = rb.integrate(scene, times), rb.simulate(scene, times)
    figure = Figure((14, 5), layout="constrained")
    axes = figure.subplot_mosaic("abc", per_subplot_kw={"a": {"projection": "3d"}})
    u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    globe = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes["a"].plot_wireframe(*globe, color="0.85", lw=0.5)
    for motion, style in ((theory, {"lw": 4.0, "alpha": 0.5}), (engine, {"lw": 1.2})):
        style |= {"color": motion.engine.colour, "label": motion.engine.name}
        axes["a"].plot(*motion.gamma.T, **style)
        to_frame = rotation_matrix(motion.attitude).transpose(0, 2, 1)
        momentum = to_frame @ motion.momentum[:, :, None]
        axes["b"].plot(times, momentum[:, :, 0], **style)
        axes["c"].plot(*motion.contact_point.T, **style)
    for line in straight.straight_motions(ball, f):
        axes["a"].plot(*line.gamma, "X", color="k")
        axes["a"].text(*1.15 * line.gamma, straight.name_of_line(ball, line.gamma), fontsize=14)
    axes["a"].set_title("γ on the Poisson sphere")
    axes["a"].set_box_aspect((1, 1, 1), zoom=1.6)
    axes["a"].view_init(azim=48, elev=22)
    axes["a"].set_axis_off()
    axes["b"].set(title="M₁, M₂, M₃", xlabel="time [s]", ylabel="M [kg m²/s]")
    axes["c"].set(title=f"contact point, {duration:g} s", xlabel="X [m]", ylabel="Y [m]")
    axes["c"].set(aspect="equal", adjustable="datalim")
    axes["c"].legend()
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
    speed = np.diff(engine.contact_point[:, 1]) / times[1]
    numbers = {"path error": gap.max(), "least dY/dt": speed.min(), "last dY/dt": speed[-1]}
    return {**numbers, "stable below f": straight.stability_limit(ball) or np.nan}


if __name__ == "__main__":
    print(OUT, main())
