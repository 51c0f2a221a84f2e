"""Fig. 14: the path of the contact point on the strange attractor of Fig. 11b.

The caption says "limit cycle". Neighbouring motions separate as exp(0.116 t), so MuJoCo's path
finally leaves the equations' path, however small the step.

python examples/paper/fig14.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb

OUT = Path("out/fig14.png")
EXPONENT = 0.116  # 1/s, the largest Lyapunov exponent


def main(duration: float = 160.0) -> dict[str, float]:
    """Draw the motion for a duration [s]; return MuJoCo's distances at a quarter and at the end."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    scene, times = rb.load_scene("fig14"), rb.sample_times(duration, 0.01)
    theory = rb.integrate(scene, times)
    figure = Figure((8, 8), layout="constrained")
    figure.suptitle("Chaos separates the paths at the rate of the Lyapunov exponent")
    axes = figure.subplot_mosaic("a;b")
    axes["a"].plot(*theory.contact_point.T, color=theory.engine.colour, lw=5, alpha=0.5)
    for preset, colour in ("fast", "0.6"), ("balanced", "#0072B2"), ("accurate", "k"):
        engine = rb.simulate(scene, times, settings=preset)
        gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
        axes["b"].semilogy(times[1:], gap[1:], color=colour, label=f"MuJoCo, {preset}")
        if preset == "balanced":
            axes["a"].plot(*engine.contact_point.T, color=colour, ls="--")
            numbers = {"quarter": float(gap[len(gap) // 4]), "end": float(gap[-1])}
    axes["b"].semilogy(times, 3e-8 * np.exp(EXPONENT * times), "k:", label="exp(0.116 t)")
    title = f"path of the contact point, {duration:g} s, Y stretched"
    axes["a"].set(title=title, xlabel="X [m]", ylabel="Y [m]")
    axes["b"].set(title="distance from the equations [m]", xlabel="time [s]")
    axes["a"].legend((theory.engine.name, "MuJoCo, balanced"))
    axes["b"].legend()
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    return numbers


if __name__ == "__main__":
    print(OUT, main())
