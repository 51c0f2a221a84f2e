"""Figs 11a and 11b: the section g = 0 over l and L/√f, with the attractors.

In (a) every start reaches one limit cycle, which crosses twice, once in each direction, or one
torus. In (b) there is a strange attractor.

python examples/paper/fig11.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics import sections

OUT = Path("out/fig11.png")
ROOT_F, EARLY = 5.0, 200  # √f [kg m²/s]; crossings before a start has reached an attractor


def main(starts: int = 40, duration: float = 600.0) -> dict[str, float]:
    """Draw the sections, with MuJoCo for a duration [s].

    Return how far MuJoCo's first ten crossings are from those of the equations, as vectors γ and
    M/√f, and the period of the limit cycle with both [s].
    """
    figure, numbers = Figure((13, 6), layout="constrained"), {}
    random = np.random.default_rng(0)
    L, l = random.uniform(-ROOT_F, ROOT_F, starts), random.uniform(-np.pi, np.pi, starts)
    panels = {"a": ("fig12", "fig13"), "b": ("fig14",)}
    for axes, (panel, names) in zip(figure.subplots(1, 2), panels.items(), strict=True):
        ball = rb.load_scene(names[0]).parameters
        begin = sections.section_starts(L, l, ROOT_F**2)
        theory = sections.sections_of(ball, *begin, 3 * EARLY)
        for some, colour in ((theory[:, :EARLY], "0.8"), (theory[:, EARLY:], "#D55E00")):
            axes.plot(
                some.l.ravel() % (2 * np.pi), some.L.ravel() / ROOT_F, ".", color=colour, ms=2
            )
        for name in names:
            scene = rb.load_scene(name)
            motion = rb.simulate(scene, rb.sample_times(duration, 0.005))
            found = sections.crossings_of_motion(motion, scene)
            axes.plot(found.l % (2 * np.pi), found.L / ROOT_F, "x", color="#0072B2", ms=4)
            exact = rb.section(scene, 10)
            gap = np.linalg.norm(found.states[:10] - exact.states[0], axis=1)
            numbers[f"error of {name}"] = float(gap.max())
            if name == "fig12":  # the cycle crosses twice
                numbers["period, MuJoCo"] = float(found.times[-1] - found.times[-3])
        axes.set(xlabel="l [rad]", ylabel="L/√f", ylim=(-1.05, 1.05))
        axes.set_title(f"({panel}) dots: equations, early ones grey; crosses: MuJoCo")
    ball = rb.load_scene("fig12").parameters
    numbers["period, equations"] = sections.fixed_point(ball, 3.6, 0.6, ROOT_F**2).period
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    return numbers


if __name__ == "__main__":
    print(OUT, main())
