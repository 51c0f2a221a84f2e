"""Fig. 14: the path of the contact point on the strange attractor of Fig. 11b.

The caption says "limit cycle". Neighbouring motions separate as exp(0.116 t), so MuJoCo's path
finally leaves the equations' path, however small the step.

python examples/paper/fig14.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb

OUT = Path("out/fig14.png")
EXPONENT = 0.116  # 1/s, the largest Lyapunov exponent


def main(duration: float = 160.0) -> dict[str, float]:
    """Draw the motion for a duration [s]; return MuJoCo's distances at a quarter and at the end."""
    scene, times = rb.load_scene("fig14"), rb.sample_times(duration, 0.01)
    theory = rb.integrate(scene, times)
    figure = Figure((10, 7), layout="constrained")
    axes = figure.subplot_mosaic("a;b", height_ratios=(3, 2))
    axes["a"].plot(*theory.contact_point.T, color=theory.engine.colour, lw=4, alpha=0.5)
    for preset in ("fast", "balanced", "accurate"):
        engine = rb.simulate(scene, times, settings=preset)
        gap = np.linalg.norm(engine.contact_point - theory.contact_point, axis=1)
        axes["b"].semilogy(times[1:], gap[1:], label=f"{engine.engine.name}, {preset}")
        if preset == "balanced":
            axes["a"].plot(*engine.contact_point.T, color=engine.engine.colour, lw=1.2)
            numbers = {"quarter": float(gap[len(gap) // 4]), "end": float(gap[-1])}
    axes["b"].semilogy(times, 3e-8 * np.exp(EXPONENT * times), "k:", label="exp(0.116 t)")
    axes["a"].set(title=f"contact point, {duration:g} s", xlabel="X [m]", ylabel="Y [m]")
    axes["b"].set(title="distance from the equations", xlabel="time [s]", ylabel="distance [m]")
    axes["a"].legend((theory.engine.name, "MuJoCo, balanced"))
    axes["b"].legend()
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    return numbers


if __name__ == "__main__":
    print(OUT, main())
