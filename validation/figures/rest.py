"""Figs 5 to 8: motion from rest, M = 0, a flow on the sphere of γ."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import ContactMotion, preset, sample_times
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced.compiled.kernels import orbits
from robotball.palette import INK
from robotball.parameters import Parameters
from robotball.qualitative.equilibria import FixedPoint, attitude_at, fixed_points
from robotball.qualitative.limit_cycles import limit_cycles, spread_points
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene
from validation.figures.parts import (
    ENGINE_LINE,
    FAINT,
    THEORY_LINE,
    UNBUILDABLE,
    arrow,
    disc,
    disc_line,
    draw_paths,
    on_disc,
    paper_scene,
    sheet,
    theory_motion,
)
from validation.studies.attractors.contact_map import own_start

BALL_LINES = (
    "A = diag(.5, .4, .3) 1/(kg m²)",
    "Ω = (4, 2, 1) rad/s",
    "a = 1 m, M = 0 (from rest)",
    UNBUILDABLE,
)
# Filled is stable, open is not; in grey, too.
MARKS = {
    "saddle": ("X", "white"),
    "stable focus": ("o", INK),
    "slow stable focus": ("D", INK),
    "unstable focus": ("o", "white"),
    "stable node": ("s", INK),
    "unstable node": ("s", "white"),
}
STARTS_DRAWN = 40


def figure5() -> Figure:
    """Three motions with K₃ = 0, whose γ follows a curve (Aγ,γ) = const."""
    scenes = {name: paper_scene(f"fig05{name}") for name in "bcd"}
    chosen = ["starts (for the most part chosen):"]
    for name, scene in scenes.items():
        gamma = rotation_matrix(scene.start.attitude)[2]
        chosen.append(f"  {name}: γ = ({', '.join(f'{x:.4g}' for x in gamma)})")
    facts = (
        "(Aγ,γ) is constant: γ runs along a curve",
        "  of Euler's top, slower where (Ω,γ) is small,",
        "  and rests on the circle (Ω,γ) = 0 (dashed).",
        "On the circle the ball goes straight,",
        "  at a|Ω| = 4.58 m/s.",
        "A curve that misses the circle is periodic.",
        "E17: α₂(0) = -2√19/95 in (b)",
        "E18: γ₃(0) = √39/20 in (c)",
    )
    figure, (sphere, *plane) = sheet(
        "Fig. 5: motion from rest without rotor momentum, K₃ = 0",
        [*BALL_LINES, "K = 0", *chosen],
        facts,
        (4.6, 3.2, 3.2, 3.2),
    )
    disc(sphere, "vertical γ, with -γ as the same")
    draw_field(sphere, scenes["b"].parameters, 8.0)
    circle = np.linspace(0, 2 * np.pi, 400)
    across = np.linalg.svd(np.array([[4.0, 2.0, 1.0]]))[2][1:]
    equilibria = np.stack([np.cos(circle), np.sin(circle)], axis=1) @ across
    disc_line(sphere, equilibria, color=INK, linestyle="--", linewidth=1.2)
    for axes, (name, scene) in zip(plane, scenes.items(), strict=True):
        path, theory_gamma, engine = both(scene)
        draw_gamma(sphere, theory_gamma, engine.gamma)
        place = tuple(on_disc(theory_gamma[0]))
        sphere.annotate(name, place, color=INK, fontsize=12, fontweight="bold",
                        xytext=(5, 5), textcoords="offset points")  # fmt: skip
        draw_paths(axes, path, engine, f"({name}) contact point, {scene.duration:g} s")
    plane[0].legend(loc="best")
    return figure


def figure6() -> Figure:
    """K₃ = 0.3: ten fixed points, and motions into the stable foci."""
    scene = replace(paper_scene("fig06"), duration=30.0)
    points = fixed_points(scene.parameters)
    caption = (*BALL_LINES, "K = (0, 0, 0.3) kg m²/s", "start (chosen): γ = (0.6, 0.64, 0.48)")
    facts = (
        f"{len(points)} fixed points, in pairs ±γ:",
        *counted(points),
        "The slow foci Γ₅, Γ₆ have imaginary",
        "  eigenvalues and attract by their first",
        "  Lyapunov value (E9).",
        "|κ₁| = 1 at K₃ = 0.51503, |κ₂| = 1 at",
        "  2.08207: there four fixed points vanish.",
    )
    return portrait("Fig. 6: motion from rest, K₃ = 0.3", scene, points, caption, facts)


def figure7() -> Figure:
    """K₃ = 0.52: a slow, unstable limit cycle."""
    return cycle_figure(
        7, 0.52, "So MuJoCo cannot stay on it: nor could", "  anything that is 1e-9 off."
    )


def figure8() -> Figure:
    """K₃ = 3: a fast, unstable limit cycle."""
    return cycle_figure(8, 3.0)


def cycle_figure(number: int, K3: float, *remark: str) -> Figure:
    """The portrait and the limit cycle, which both engines follow for one period."""
    of_catalog = paper_scene(f"fig{number:02}")
    ball = of_catalog.parameters
    (cycle,) = limit_cycles(ball)[:1]
    start = own_start(of_catalog, cycle.attitude, cycle.momentum)
    scene = replace(of_catalog, start=start, duration=cycle.period)
    points = fixed_points(ball)
    caption = (*BALL_LINES, f"K = (0, 0, {K3:g}) kg m²/s", "start: on the limit cycle")
    facts = (
        f"{len(points)} fixed points:",
        *counted(points),
        "One limit cycle, up to γ → -γ:",
        f"  period {cycle.period:.7f} s",
        f"  multiplier {cycle.multipliers[0].real:.6g}: unstable.",
        "Drawn over one period, in which an error",
        f"  grows {cycle.multipliers[0].real:.3g} times.",
        *remark,
    )
    title = f"Fig. {number}: motion from rest, K₃ = {K3:g}, and its limit cycle"
    return portrait(title, scene, points, caption, facts)


def portrait(
    title: str,
    scene: Scene,
    points: list[FixedPoint],
    caption: tuple[str, ...],
    facts: tuple[str, ...],
) -> Figure:
    """The flow on the sphere with its fixed points, and one motion by both engines."""
    figure, (sphere, plane) = sheet(title, caption, facts, (5.2, 5.2))
    disc(sphere, "vertical γ, with -γ as the same point")
    draw_field(sphere, scene.parameters, 20.0 if scene.duration > 10 else 5.0)
    path, theory_gamma, engine = both(scene)
    draw_gamma(sphere, theory_gamma, engine.gamma)
    for kind in dict.fromkeys(point.kind for point in points):
        mark, fill = MARKS[kind]
        places = on_disc(np.array([point.gamma for point in points if point.kind == kind]))
        sphere.plot(*places.T, mark, color=fill, markeredgecolor=INK, markersize=8, label=kind,
                    linestyle="none", zorder=5)  # fmt: skip
    sphere.legend(
        loc="upper left", bbox_to_anchor=(-0.06, 0.04), ncols=2, frameon=False, fontsize=9
    )
    draw_paths(plane, path, engine, f"contact point, {scene.duration:.4g} s")
    plane.legend(loc="best")
    return figure


def counted(points: list[FixedPoint]) -> list[str]:
    """How many fixed points there are of each type."""
    kinds = [point.kind for point in points]
    return [f"  {kinds.count(kind)} × {kind}" for kind in dict.fromkeys(kinds)]


def both(scene: Scene) -> tuple[Array, Array, ContactMotion]:
    """The equations' contact points (n, 2) and γ (n, 3), and MuJoCo's motion."""
    times = sample_times(scene.duration, scene.duration / 2000)
    attitudes, path = theory_motion(scene, times)
    return path, rotation_matrix(attitudes)[:, 2], run(build(scene, preset("balanced")), times)


def draw_gamma(axes: Axes, theory: Array, engine: Array) -> None:
    disc_line(axes, theory, **THEORY_LINE)
    disc_line(axes, engine, **ENGINE_LINE)


def draw_field(axes: Axes, parameters: Parameters, duration: float) -> None:
    """Pale orbits with arrows from points all over the sphere."""
    starts = spread_points(STARTS_DRAWN)
    attitudes = np.array([attitude_at(gamma) for gamma in starts])
    times = np.linspace(0, duration, 800)
    found = orbits(parameters, attitudes, np.zeros((len(starts), 3)), times, 1e-10)
    for each in found.attitudes:
        gamma = rotation_matrix(each)[:, 2]
        disc_line(axes, gamma, color=FAINT, linewidth=0.6, alpha=0.8)
        length = np.cumsum(np.linalg.norm(np.diff(gamma, axis=0), axis=1))
        if length[-1] > 0.2:
            k = int(np.searchsorted(length, min(0.2, length[-1] / 2))) + 1
            arrow(axes, on_disc(gamma[: 2 * k]), FAINT)
