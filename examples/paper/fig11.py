"""Figs 11a and 11b: the section g = 0 over l and L/√f, with the attractors.

In (a) every orbit reaches a limit cycle or a torus, in (b) a strange attractor. Grey: before that.

python examples/paper/fig11.py
"""

from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics import sections
from robotball.dynamics.cycles import fixed_point

ROOT_F, EARLY = 5.0, 200  # √f [kg m²/s]; crossings before an orbit has reached an attractor


def main(starts: int = 40, duration: float = 600.0) -> dict[str, float]:
    """Draw the sections, with MuJoCo for a duration [s].

    Return the largest distance of MuJoCo's first ten crossings to the crossings of the equations,
    as vectors γ and M/√f, and the period of the limit cycle with both [s].
    """
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    figure, numbers = Figure((8, 5.5), layout="constrained"), {}
    figure.suptitle("MuJoCo (blue) crosses the section on the equations' attractors (orange)")
    random = np.random.default_rng(0)
    L, l = random.uniform(-ROOT_F, ROOT_F, starts), random.uniform(-np.pi, np.pi, starts)
    panels = {"a: cycle or torus": ("fig12", "fig13"), "b: strange attractor": ("fig14",)}
    for axes, (title, names) in zip(figure.subplots(1, 2), panels.items(), strict=True):
        ball = rb.load_scene(names[0]).parameters
        theory = sections.sections_of(ball, *sections.section_starts(L, l, ROOT_F**2), 3 * EARLY)
        for points, colour in ((theory[:, :EARLY], "0.8"), (theory[:, EARLY:], "#F2B48A")):
            axes.plot(
                points.l.ravel() % (2 * np.pi), points.L.ravel() / ROOT_F, ".", color=colour, ms=2
            )
        for name in names:
            scene = rb.load_scene(name)
            motion = rb.simulate(scene, rb.sample_times(duration, 0.005))
            crossings = sections.crossings_of_motion(motion, scene)
            late = crossings[20:]
            axes.plot(late.l % (2 * np.pi), late.L / ROOT_F, "x", color="#0072B2", ms=5)
            exact = rb.section(scene, 10)
            gap = np.linalg.norm(crossings.states[:10] - exact.states[0], axis=1)
            numbers[f"error of {name}"] = float(gap.max())
            if name == "fig12":  # the cycle crosses twice per period
                numbers["period, MuJoCo"] = float(crossings.times[-1] - crossings.times[-3])
        axes.set(xlabel="l [rad]", ylabel="L/√f", ylim=(-1.05, 1.05), title=title)
    ball = rb.load_scene("fig12").parameters
    numbers["period, equations"] = fixed_point(ball, 3.6, 0.6, ROOT_F**2).period
    Path("out").mkdir(exist_ok=True)
    figure.savefig("out/fig11.png")
    return numbers


if __name__ == "__main__":
    print("out/fig11.png", main())
