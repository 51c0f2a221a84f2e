"""Figs 9 and 10: motion along straight lines, and turning round from one to another."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Motion, sample_times
from robotball.equations import Parameters, Vector
from robotball.film.looks import INK
from robotball.qualitative.straight_motions import (
    name_of_line,
    stability_limit,
    straight_motion,
    straight_verticals,
)
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene
from validation.figures import (
    ENGINE_LINE,
    FAINT,
    THEORY,
    THEORY_LINE,
    UNBUILDABLE,
    View,
    draw_paths,
    engine_motion,
    paper_scene,
    sheet,
)
from validation.figures.sphere import Globe, draw_gamma
from validation.output import halo
from validation.plots import note
from validation.study import compiled_motion

_SIDE = 5.0  # of Fig. 9's region, in √f
FINENESS = 90  # of the map's grid, each way
SHOWN, LONG = 80.0, 600.0  # s, of Fig. 10
_PERIOD = 2.0  # s, at least that of the oscillation about δ₊, 1.95 s
_VIEW = View(azimuth=48.0, elevation=22.0)
_BALL_LINES = ("A = diag(.5, .3, .6) 1/(kg m²)", "Ω = (0, 0, 1) rad/s, a = 1 m", UNBUILDABLE)


def growth_rate(ball: Parameters, K: Vector, f: float) -> float:
    """Return the largest real part of the eigenvalues of the straight-line motion σ₋ [1/s].

    The ball has K = (K₁, K₂, 0) instead of its own, and Ω along e₃. NaN where K² < f, and there is
    no straight-line motion.
    """
    # M = γ×K is no longer than K.
    if f > K[0] ** 2 + K[1] ** 2:
        return np.nan
    ball = replace(ball, K=K)
    return float(straight_motion(ball, line_verticals(ball, f)["σ₋"]).eigenvalues.real.max())


def line_verticals(ball: Parameters, f: float) -> dict[str, Array]:
    """Return γ (3,) of the straight-line motions σ± and δ± with M² = f by their names."""
    return {name_of_line(ball, gamma): gamma for gamma in straight_verticals(ball, f)}


def figure9() -> Figure:
    """Draw where in the plane of K straight-line motions are stable, in units of √f."""
    ball, side = paper_scene("fig10").parameters, np.linspace(-_SIDE, _SIDE, FINENESS)
    limit = stability_limit(ball)
    edges = np.array(ball.A[:2]) / abs(ball.A[0] - ball.A[1])
    caption = (
        *_BALL_LINES,
        "K = (K₁, K₂, 0) kg m²/s",
        f"The caption has neither f nor the bounds, which are chosen: ±{_SIDE:g} √f.",
    )
    facts = (
        "ω = 0, (Ω,γ) = 0, M = γ×K, f = M²: the shell alone turns, and the ball goes straight "
        "along Y at ∓a|Ω|.",
        "Shaded: σ₋ and δ₊ are stable; σ₊ and δ₋ are so nowhere. The size of Ω does not matter, "
        "and f scales K alone: K₁K₂ > 0 and (a₁/K₁)² + (a₂/K₂)² < (a₁ - a₂)²/f, with the "
        f"asymptotes |K₁| = {edges[0]:g} √f and |K₂| = {edges[1]:g} √f.",
        f"E16: at K = (4, 5, 0) they are stable for f < {limit:.4f} only, not at f = 3.",
    )
    figure, panels = sheet(
        "Fig. 9: straight lines are stable at large K", caption, facts, [["K"]], (6.5,), (5.6,)
    )
    axes = panels["K"]
    # The largest real part changes its sign where stability ends, so its zero is the border.
    rates = np.array([[growth_rate(ball, (K1, K2, 0.0), 1.0) for K1 in side] for K2 in side])
    # Grey, as the caption says.
    axes.contourf(side, side, rates, levels=[-1e9, 0.0], colors=[FAINT], alpha=0.6)
    axes.contour(side, side, rates, levels=[0.0], colors=[THEORY], linewidths=1.5)
    for sign in (1.0, -1.0):
        axes.annotate(
            "σ₋, δ₊ stable", (3.9 * sign, 4.2 * sign), color=INK, ha="center", va="center"
        )
        axes.axvline(sign * edges[0], color=FAINT, linewidth=1, linestyle=":")
        axes.axhline(sign * edges[1], color=FAINT, linewidth=1, linestyle=":")
    turn = np.linspace(0, 2 * np.pi, 300)
    axes.fill(np.cos(turn), np.sin(turn), facecolor="none", edgecolor=FAINT, hatch="////", lw=0.8)
    axes.annotate("K² < f: no such line", (0, -1.1), ha="center", va="top", color=INK)
    for f in (2.0, 3.0):
        at = ball.K[0] / np.sqrt(f), ball.K[1] / np.sqrt(f)
        axes.plot(*at, "o", color=INK)
        note(axes, f"Fig. 10, f = {f:g}", at, (-6, 4), color=INK, ha="right", va="bottom")
    axes.set(xlabel="K₁/√f", ylabel="K₂/√f", aspect="equal")
    return figure


def figure10() -> Figure:
    """Draw how the ball leaves one straight line and takes up another, the opposite way."""
    scene, stable = paper_scene("fig10"), paper_scene("fig10_stable")
    ball = scene.parameters
    verticals, limit = line_verticals(ball, 3.0), stability_limit(ball)
    caption = (
        *_BALL_LINES,
        "K = (4, 5, 0) kg m²/s, f = 3 (kg m²/s)²",
        "start near σ₊; how near is chosen: γ along σ₊ + 0.01 e₃, M along the part of e₃ across γ. "
        "Durations are chosen.",
        "For comparison, below right: f = 2.",
    )
    facts = (
        *(f"{name}: γ = ({v[0]:.4f}, {v[1]:.4f}, 0)" for name, v in verticals.items()),
        "σ: dY/dt = -a|Ω|;  δ: dY/dt = +a|Ω| (E15)",
        "The unstable manifold of σ₊ goes to δ₊, not to σ₋: the ball turns round.",
        f"E16: δ₊ is unstable above f = {limit:.4f}: at f = 3 the ball leaves it again, after "
        "some 300 s; at f = 2 it stays.",
    )
    figure, axes = sheet(
        "Fig. 10: the ball leaves one straight line and turns round to the opposite one",
        caption, facts, [["sphere", "plane"], ["M", "speed"]], (4.2, 4.2), (4.0, 3.2),
    )  # fmt: skip
    times = sample_times(SHOWN, 0.02)
    theory, engine = compiled_motion(scene, times), engine_motion(scene, times)
    globe = Globe(axes["sphere"], _VIEW, f"vertical γ on the Poisson sphere, {SHOWN:g} s")
    draw_gamma(globe, theory, engine)
    for name, gamma in verticals.items():
        globe.marks(gamma[None], "X", color="white", markeredgecolor=INK, markersize=8, zorder=6)
        globe.name(gamma, name, fontsize=14)
    draw_paths(axes["plane"], theory, engine, f"contact point, {SHOWN:g} s")
    axes["plane"].legend(loc="upper left")
    _draw_momentum(axes["M"], theory, engine)
    for each, style in ((scene, "-"), (stable, (0, (3, 1.5)))):
        _draw_speed(axes["speed"], each, style)
    for level, name in ((-1.0, "σ: -a|Ω|"), (1.0, "δ: +a|Ω|")):
        axes["speed"].axhline(level, color=FAINT, linewidth=1, zorder=0)
        note(axes["speed"], name, (0.3 * LONG, level), (0, -6), color=INK, ha="center", va="top",
             path_effects=halo())  # fmt: skip
    axes["speed"].set(xlabel="time [s]", ylabel="dY/dt [m/s]", ylim=(-1.6, 1.9))
    axes["speed"].set_title("range of the speed along Y in each 2 s:\nf = 3 solid, f = 2 dashed")
    return figure


def _draw_momentum(axes: Axes, theory: Motion, engine: Motion) -> None:
    """Draw M₁, M₂, M₃ in principal axes over time, by both engines."""
    exact, ours = (
        np.einsum("nji,nj->ni", rotation_matrix(each.attitude), each.momentum)
        @ each.scene.principal_axes
        for each in (theory, engine)
    )
    for i, dashes in enumerate(("-", "--", ":")):
        axes.plot(theory.times, exact[:, i], **{**THEORY_LINE, "linewidth": 3.5})
        axes.plot(engine.times, ours[:, i], linestyle=dashes, **{**ENGINE_LINE, "linewidth": 1.4},
                  label=f"M{'₁₂₃'[i]}")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="M [kg m²/s]", title="momentum M(t) in the frame's axes")
    axes.legend(loc="upper right")


def _draw_speed(axes: Axes, scene: Scene, dashes: str | tuple[int, tuple[float, float]]) -> None:
    """Draw dY/dt of the contact point over a long time, by both engines.

    Where it oscillates its turns would be a block: drawn are the least and the most in each period.
    """
    # Eight in each period of the oscillation, of which the least and the most are drawn.
    times = sample_times(LONG, _PERIOD / 8)
    theory, engine = compiled_motion(scene, times), engine_motion(scene, times)
    for motion, style in ((theory, THEORY_LINE), (engine, ENGINE_LINE)):
        speed = np.diff(motion.contact_point[:, 1]).reshape(-1, 8) / times[1]
        ends = np.stack([speed.min(axis=1), speed.max(axis=1)], axis=1)
        axes.plot(times[4::8], ends, linestyle=dashes, **style)
