"""Figs 9 and 10: motion along straight lines, and turning round from one to another."""

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from robotball import preset, sample_times
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as THEORY
from robotball.equations import Vector
from robotball.palette import INK
from robotball.parameters import Parameters
from robotball.qualitative.straight_motions import straight_motion
from robotball.rotations import Array
from validation.figures.parts import (
    ENGINE_LINE,
    FAINT,
    THEORY_LINE,
    UNBUILDABLE,
    draw_paths,
    paper_scene,
    sheet,
    theory_motion,
)

LEVELS = (2.0, 3.0)  # f: on either side of the limit for K = (4, 5, 0)
LINE_K = (4.0, 5.0, 0.0)  # of Fig. 10
LIMIT = 2.0806242  # of f there: above it σ₋ and δ₊ are unstable saddle-foci
FINENESS = 90  # of the map's grid, each way
BALL_LINES = (
    "A = diag(.5, .3, .6) 1/(kg m²)",
    "Ω = (0, 0, 2) rad/s (chosen), a = 1 m",
    UNBUILDABLE,
)


def growth_rate(ball: Parameters, K: Vector, f: float, which: str = "σ₋") -> float:
    """The largest real part of the eigenvalues of a straight-line motion of the
    ball with K = (K₁, K₂, 0) instead of its own, and Ω along e₃ [1/s].

    NaN where K² < f, and there is no straight-line motion.
    """
    if f > K[0] ** 2 + K[1] ** 2:
        return np.nan
    motion = straight_motion(replace(ball, K=K), line_verticals(f, K)[which])
    return float(motion.eigenvalues.real.max())


def line_verticals(f: float, K: Vector) -> dict[str, Array]:
    """γ (3,) of the straight-line motions σ± (M along e₃) and δ± (against it), with Ω along e₃.

    There γ is across Ω and M = γ×K, whose square is f: (K,γ)² = K² - f.
    """
    angle, off = np.arctan2(K[1], K[0]), np.arcsin(np.sqrt(f) / np.hypot(K[0], K[1]))
    turns = {"σ₊": -off, "σ₋": off + np.pi, "δ₊": off, "δ₋": np.pi - off}
    return {
        name: np.array([np.cos(angle + turn), np.sin(angle + turn), 0.0])
        for name, turn in turns.items()
    }


def figure9() -> Figure:
    """Where in the plane of K straight-line motions are stable, for two values of f."""
    caption = (
        *BALL_LINES,
        "K = (K₁, K₂, 0) kg m²/s",
        "f = 2 and f = 3 (chosen: the paper",
        "  does not state its f)",
    )
    facts = (
        "ω = 0, (Ω,γ) = 0, M = γ×K, f = M²:",
        "  the shell alone turns, and the ball goes",
        "  straight along Y at ∓a|Ω|.",
        "Shaded: σ₋ and δ₊ are stable; σ₊ and δ₋",
        "  are so nowhere here. The size of Ω",
        "  does not matter.",
        "E16: at K = (4, 5, 0) they are stable for",
        f"  f < {LIMIT:.4f} only, not at f = 3.",
    )
    figure, panels = sheet("Fig. 9: stability of straight-line motions", caption, facts, (4.8, 4.8))
    ball, side = paper_scene("fig10").parameters, np.linspace(-8, 8, FINENESS)
    for axes, f in zip(panels, LEVELS, strict=True):
        rates = np.array([[growth_rate(ball, (K1, K2, 0.0), f) for K1 in side] for K2 in side])
        axes.contourf(side, side, rates, levels=[-1e9, 0.0], colors=[THEORY.colour], alpha=0.45)
        axes.contour(side, side, rates, levels=[0.0], colors=[THEORY.colour], linewidths=1.5)
        for x in (6.8, -6.8):
            axes.annotate("σ₋, δ₊", (x, x), color=INK, ha="center")
        turn = np.linspace(0, 2 * np.pi, 300)
        axes.fill(
            np.sqrt(f) * np.cos(turn), np.sqrt(f) * np.sin(turn), color=FAINT, alpha=0.5, lw=0
        )
        axes.annotate("K² < f", (0, 0), ha="center", va="center", color=INK)
        axes.plot(*LINE_K[:2], "o", color=INK)
        axes.annotate("Fig. 10", LINE_K[:2], xytext=(6, 6), textcoords="offset points", color=INK)
        axes.set(xlabel="K₁ [kg m²/s]", ylabel="K₂ [kg m²/s]", title=f"f = {f:g} (kg m²/s)²")
        axes.set_aspect("equal")
    return figure


def figure10() -> Figure:
    """The ball leaves one straight line and takes up another, the opposite way."""
    caption = (
        *BALL_LINES,
        "K = (4, 5, 0) kg m²/s, f = 3 and 2 (kg m²/s)²",
        "starts (chosen): γ ∝ σ₊ + 0.01 e₃,",
        "  M along the part of e₃ across γ",
    )
    verticals = line_verticals(3.0, LINE_K)
    facts = (
        *(f"{name}: γ = ({v[0]:.4f}, {v[1]:.4f}, 0) at f = 3" for name, v in verticals.items()),
        "σ: dY/dt = -a|Ω|;  δ: dY/dt = +a|Ω| (E15)",
        "The unstable manifold of σ₊ goes to δ₊,",
        "  not to σ₋: the ball turns round.",
        f"E16: δ₊ is unstable above f = {LIMIT:.4f}; at",
        "  f = 3 the ball will leave it again, slowly.",
    )
    figure, (plane, speed) = sheet(
        "Fig. 10: turning round from σ₊ to δ₊", caption, facts, (4.8, 4.8)
    )
    times = sample_times(30.0, 0.01)
    for f in (3.0, 2.0):
        scene = paper_scene("fig10" if f == 3 else "fig10_stable")
        _, path = theory_motion(scene, times)
        engine = run(build(scene, preset("balanced")), times)
        draw_paths(plane, path, engine, "contact point, 30 s")
        middle = (times[1:] + times[:-1]) / 2
        speed.plot(middle, np.diff(path[:, 1]) / np.diff(times), **THEORY_LINE)
        speed.plot(middle, np.diff(engine.contact_point[:, 1]) / np.diff(times), **ENGINE_LINE)
        plane.annotate(f"f = {f:g}", path[-1], color=INK, ha="center", va="bottom")
        if f == 3:
            plane.legend(loc="center", bbox_to_anchor=(0.5, 0.75))
    for level, name in ((-2.0, "σ: -a|Ω|"), (2.0, "δ: +a|Ω|")):
        speed.axhline(level, color=INK, linestyle="--", linewidth=1)
        speed.annotate(name, (15, level), xytext=(0, 4), textcoords="offset points", color=INK)
    speed.set(xlabel="time [s]", ylabel="dY/dt [m/s]", title="speed along Y")
    return figure
