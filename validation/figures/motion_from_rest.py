"""Figs 5 to 8: motion from rest, M = 0, a flow on the sphere of γ."""

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from robotball import ContactMotion, Motion, sample_times
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import fixed_circle, fixed_points, name_of
from robotball.qualitative.portraits import Separatrix, limit_cycles, separatrices
from robotball.qualitative.sections import own_start
from robotball.scene import Scene
from validation.figures import (
    ENGINE_LINE,
    ENGINE_NAME,
    UNBUILDABLE,
    View,
    draw_paths,
    engine_motion,
    paper_scene,
    sheet,
)
from validation.figures.sphere import (
    FOLLOWED,
    Globe,
    both_charts,
    counted,
    draw_circle,
    draw_cycles,
    draw_field,
    draw_gamma,
    draw_points,
    draw_separatrices,
)
from validation.study import compiled_motion

_BALL_LINES = (
    "A = diag(.5, .4, .3) 1/(kg m²)",
    "Ω = (4, 2, 1) rad/s",
    "a = 1 m, M = 0 (from rest)",
    UNBUILDABLE,
)
_STARTS78 = ("γ(0) = (0, 39/40, √79/40), α(0) = (1, 0, 0)",)  # of Figs 7 and 8
_VIEW5 = View(azimuth=28.0, elevation=-22.0)
_DURATIONS5 = {"b": 16.0, "c": 20.0, "d": 6.0}  # s, chosen: the captions have none
DURATIONS = {6: 40.0, 7: 40.0, 8: 24.0}  # s, of these figures, chosen


def figure5() -> Figure:
    """Draw three motions with K = 0, whose γ follows a curve (Aγ,γ) = const."""
    scenes = {
        name: replace(paper_scene(f"fig05{name}"), duration=duration)
        for name, duration in _DURATIONS5.items()
    }
    ball = scenes["b"].parameters
    circle, points = fixed_circle(ball), fixed_points(ball)
    assert circle is not None
    caption = (
        *_BALL_LINES,
        "K = 0",
        "b: γ(0) = (1/25, √471/50, -9/10)",
        "   α(0) = (√8949/95, -2√19/95, 0) (E17)",
        "c: γ(0) = (19/20, 0, √39/20) (E18)",
        "d: γ(0) = (1, 0, 0); c, d: α(0) = (0, -1, 0)",
        "Durations are chosen.",
    )
    facts = (
        "Fixed points, indices adding up to 2:",
        *counted(points),
        f"  and the circle (Ω,γ) = 0, of index {circle.index}.",
        "(Aγ,γ) is kept: γ runs along a curve of Euler's top, the slower the smaller (Ω,γ).",
        r"b: the curve meets the circle, and γ stays at $\Sigma_s$ (E24); the ball then goes "
        "straight, at a|Ω| = 4.58 m/s.",
        "c: it misses the circle: γ is periodic.",
        "d: γ stays at Γ₁; the path is a circle of radius √5/4 m.",
    )
    figure, axes = sheet(
        "Fig. 5: from rest with K = 0, γ follows a curve (Aγ,γ) = const",
        caption, facts, [["sphere", "b"], ["c", "d"]], (4.2, 4.2), (4.0, 3.6),
    )  # fmt: skip
    globe = Globe(axes["sphere"], _VIEW5, "(a) vertical γ on the Poisson sphere")
    draw_field(globe, ball, 8.0)
    draw_circle(globe, circle)
    draw_points(globe, ball, points)
    for name, scene in scenes.items():
        theory, engine = _both(scene)
        draw_gamma(globe, theory, engine)
        globe.name(theory.gamma[0], name, fontweight="bold", fontsize=13,
                   xytext=(3, -14 if name == "d" else 13), textcoords="offset points")  # fmt: skip
        draw_paths(axes[name], theory, engine, f"({name}) contact point, {scene.duration:g} s")
    axes["b"].legend(loc="best")
    axes["sphere"].legend(loc="upper left", bbox_to_anchor=(-0.2, 1.02), frameon=False, fontsize=9)
    return figure


def figure6() -> Figure:
    """Draw the motion with K₃ = 0.3: ten fixed points, and a motion into a stable focus."""
    facts = (
        "The slow foci Γ₅, Γ₆ have imaginary eigenvalues and attract by their first Lyapunov value "
        "(E6, E7).",
        "Closed contour: back in time the stable manifolds of δ₃, δ₄ end at δ₁, δ₂.",
        "K₃ = 0.503566: manifolds of δ₃, δ₄ join, and a limit cycle takes the contour's place.",
        "|κ₁| = 1 at 0.51503: δ₁ … δ₄ vanish.",
        "|κ₂| = 1 at 2.08207: θ₁ … θ₄ vanish.",
    )
    start = ("γ(0) = (0, 49/50, 3√11/50), α(0) = (1, 0, 0)",)
    return _portrait_figure(6, "0.3", "from rest γ winds into a stable focus", start, facts)


def figure7() -> Figure:
    """Draw the motion with K₃ = 0.52: a slow, unstable limit cycle."""
    facts = (
        f"{ENGINE_NAME}, started on it, must leave it: in a period an error grows by the "
        "multiplier.",
        "The contour of Fig. 6 gave way to a cycle; δ₁ … δ₄ are gone.",
    )
    return _portrait_figure(7, "0.52", "a slow limit cycle repels", _STARTS78, facts)


def figure8() -> Figure:
    """Draw the motion with K₃ = 3: a fast, unstable limit cycle."""
    facts = (f"{ENGINE_NAME}, started on it, follows it once.", "θ₁ … θ₄ are gone as well.")
    return _portrait_figure(8, "3", "a fast limit cycle repels", _STARTS78, facts)


def _portrait_figure(
    number: int, K3: str, finding: str, start: Sequence[str], facts: Sequence[str]
) -> Figure:
    """Draw the portrait on the sphere, also unrolled, with one motion by both engines."""
    scene = replace(paper_scene(f"fig{number:02}"), duration=DURATIONS[number])
    ball = scene.parameters
    points, cycles = fixed_points(ball), limit_cycles(ball)
    manifolds = separatrices(ball, points, FOLLOWED)
    # Where there is a limit cycle the contour has given way to it.
    contour = [] if cycles else closed_contour(scene, manifolds)
    caption = (*_BALL_LINES, f"K = (0, 0, {K3}) kg m²/s", *start, "Duration chosen.")
    found = [f"{len(points)} fixed points:", *counted(points)]
    for cycle in cycles:
        multiplier = f"multiplier {cycle.multipliers[0].real:.3g}: unstable."
        found.append(f"One limit cycle, period {cycle.period:.7f} s, {multiplier}")
    figure, axes = sheet(
        f"Fig. {number}: {finding}, among {len(points)} fixed points (K₃ = {K3})",
        caption, [*found, *facts], [["sphere", "plane"], ["involute", "involute"]],
        (4.2, 4.2), (4.0, 3.5),
    )  # fmt: skip
    theory, engine = _both(scene)
    # What the engine makes of a start on the cycle, which an unstable one leaves as errors grow.
    followed = [_on_cycle(scene, cycle).gamma for cycle in cycles]
    for chart in both_charts(axes["sphere"], axes["involute"]):
        draw_field(chart, ball, 6.0)
        draw_separatrices(chart, manifolds, contour)
        draw_cycles(chart, ball, cycles)
        for each in followed:
            chart.line(each, **ENGINE_LINE, label=f"{ENGINE_NAME}, started on the cycle", zorder=5)
        draw_gamma(chart, theory, engine)
        draw_points(chart, ball, points)
    draw_paths(axes["plane"], theory, engine, f"contact point, {scene.duration:g} s")
    axes["plane"].legend(loc="best")
    axes["involute"].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, fontsize=9,
                            frameon=False)  # fmt: skip
    return figure


def closed_contour(scene: Scene, manifolds: Sequence[Separatrix]) -> list[Separatrix]:
    """Return the stable manifolds of δ₃ and δ₄ that come from δ₁ and δ₂."""
    ball = scene.parameters
    return [
        each
        for each in manifolds
        if each.stable
        and name_of(ball, each.saddle.gamma) in ("δ₃", "δ₄")
        and each.end is not None
        and name_of(ball, each.end.gamma) in ("δ₁", "δ₂")
    ]


def _on_cycle(scene: Scene, cycle: Cycle) -> ContactMotion:
    """Run the engine from a point of a limit cycle, for a period."""
    start = own_start(scene, cycle.attitude, cycle.momentum)
    # For one period alone: over several an unstable cycle is left by the multiplier's growth.
    times = sample_times(cycle.period, cycle.period / 1000)
    return engine_motion(replace(scene, start=start), times)


def _both(scene: Scene) -> tuple[Motion, ContactMotion]:
    """Return the motion by the equations and the engine's."""
    # Sampled by the duration, as a picture's width has so many points however long the motion.
    times = sample_times(scene.duration, scene.duration / 3000)  # enough for a smooth line
    return compiled_motion(scene, times), engine_motion(scene, times)
