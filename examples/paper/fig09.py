"""Fig. 9: the region of K₁, K₂ in which the straight lines σ₋ and δ₊ are stable.

The caption gives no f = M². Only K/√f matters, so one picture holds for all f. Fig. 10's
K = (4, 5, 0) lies outside the region at its f = 3, and inside for f below 2.08.

python examples/paper/fig09.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

import robotball as rb
from robotball.dynamics.straight_motions import name_of_line, straight_motions

OUT = Path("out/fig09.png")
BALL = rb.load_scene("fig10").parameters
SIDE = 5.0  # half the picture's width, in units of √f


def growth_rate(K1: float, K2: float, f: float = 1.0) -> float:
    """Return the largest real part of σ₋'s eigenvalues [1/s]; NaN if σ₋ does not exist."""
    ball = replace(BALL, K=(K1, K2, 0.0))
    for line in straight_motions(ball, f):
        if name_of_line(ball, line.gamma) == "σ₋":
            return float(line.eigenvalues.real.max())
    return np.nan


def main(count: int = 60) -> dict[str, float]:
    """Draw a grid of count x count values of K; return the growth rates at Fig. 10's K [1/s]."""
    rcParams.update({"font.size": 12, "figure.titlesize": 15})
    side = np.linspace(-SIDE, SIDE, count)
    rates = np.array([[growth_rate(K1, K2) for K1 in side] for K2 in side])
    figure = Figure((7, 6.5), layout="constrained")
    axes = figure.subplots()
    axes.contourf(side, side, rates, levels=[-1e9, 0.0], colors=["0.75"])
    axes.contour(side, side, rates, levels=[0.0], colors=["k"])
    angle = np.linspace(0.0, 2 * np.pi, 200)
    axes.fill(np.cos(angle), np.sin(angle), facecolor="none", edgecolor="0.5", hatch="//")
    axes.text(0.0, -1.1, "K² < f: no straight line", ha="center", va="top")
    for sign in (1, -1):
        axes.text(sign * 4.0, sign * 4.0, "σ₋, δ₊\nstable", ha="center", va="center")
    for f in (2.0, 3.0):
        K1, K2 = np.array(BALL.K[:2]) / np.sqrt(f)
        axes.plot(K1, K2, "ko")
        axes.text(K1 - 0.1, K2, f"Fig. 10, f = {f:g}", ha="right")
    axes.set(xlabel="K₁/√f", ylabel="K₂/√f", aspect="equal")
    axes.set_title("The line of Fig. 10 is stable at f = 2, but not at f = 3")
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT)
    return {f"f = {f:g}": growth_rate(*BALL.K[:2], f) for f in (2.0, 3.0)}


if __name__ == "__main__":
    print(OUT, main())
