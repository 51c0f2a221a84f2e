"""The introduction's remark: the rubber Chaplygin ball and a classical one wind the same tori."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Scene, sample_times
from robotball.palette import INK
from robotball.qualitative.invariant_curves import InvariantCurve, invariant_curve
from robotball.qualitative.motion_section import Crossings, sampled_crossings
from robotball.qualitative.shared_tori import shared_integral
from robotball.rotations import Array, rotation_matrix
from robotball.start import along_momentum, section_state
from validation.figures.parts import (
    ENGINE_COLOUR,
    ENGINE_LINE,
    ENGINE_NAME,
    FAINT,
    THEORY,
    THEORY_LINE,
    engine_motion,
    sheet,
    theory_motion,
)
from validation.figures.sphere import Globe
from validation.figures.view import View
from validation.paper.scenes import paper_scene
from validation.studies.attractors.clouds import distance_to_curve

VIEW = View(azimuth=30.0, elevation=35.0)
CLASSICAL = "#AA3377"  # the classical ball by the equations; the rubber one has the theory's colour
COLOURS = {"rubber": THEORY, "classical": CLASSICAL}
F = 25.0
LEVELS = (0.2, 0.4, 0.5, 0.6, 1.0, 1.2)  # l of ℓ at the start, where L = 0 [rad]: a torus each
FOLLOWED, SHOWN = 210.0, 12.0  # s
INTERVAL = 0.01  # s, between samples: the error of a crossing goes with its fourth power


def figure_tori() -> Figure:
    """Both balls' γ on one sphere, their sections on the same curves, and how they differ."""
    balls: dict[str, Scene] = {
        scene.rolling: scene
        for scene in map(paper_scene, ("rubber_chaplygin_ball", "chaplygin_ball_same_tori"))
    }
    runs = {
        (rolling, l): crossings_of(started(scene, l))
        for rolling, scene in balls.items()
        for l in LEVELS
    }
    curves = {key: invariant_curve(points_of(found)) for key, found in runs.items()}
    off = max(apart(points_of(runs["rubber", l]), curves["classical", l]) for l in LEVELS)
    caption = (
        "rubber: A = diag(.8, .6, .7) 1/(kg m²)",
        "classical: A' = E/d - A/2, d = 0.9 kg m²,",
        "  A' = diag(.711, .811, .761)",
        "Ω = 0, K = 0: nothing turns inside",
        "f = 25, (M,γ) = 0 (all chosen)",
    )
    facts = (
        "Introduction, 3: the reduced trajectories",
        "  of both balls wind round the same tori.",
        "ℓ = M×γ of the rubber ball, ℓ = M of the",
        "  classical one: both are constant in space.",
        "Each ball keeps the other's energy; from the",
        f"  same (γ, ℓ) it changes by {kept(balls):.0e} in {SHOWN:g} s.",
        "The rubber ball's crossings lie within",
        f"  {off:.0e} of the classical ball's curves.",
        "They differ in how fast they go round: the",
        "  turns along the curve between crossings.",
        f"Dots: equations; rings: {ENGINE_NAME}.",
    )
    figure, axes = sheet(
        "Two rolling models, the same tori: Chaplygin's ball",
        caption, facts, [["sphere", "section", "turns"]], (5.0, 5.0, 3.4),
    )  # fmt: skip
    draw_spheres(axes["sphere"], balls)
    draw_sections(axes["section"], balls, runs, curves)
    for rolling, mark in (("rubber", "o"), ("classical", "s")):
        turns = [curves[rolling, l].rotation for l in LEVELS]
        axes["turns"].plot(LEVELS, turns, mark, color=COLOURS[rolling], label=rolling)
    axes["turns"].set(xlabel="l at the start, L = 0 [rad]", ylim=(0, None))
    axes["turns"].set_title("turns between crossings")
    axes["turns"].legend(loc="lower left")
    return figure


def started(scene: Scene, l: float) -> Scene:
    """The ball at the level (0, l) of ℓ, where (ℓ×γ)₃ = 0."""
    gamma, level = section_state(0.0, l, 0.0, F)
    M = np.cross(gamma, level) if scene.rolling == "rubber" else level
    return replace(scene, start=along_momentum(gamma, M))


def level_states(scene: Scene, duration: float) -> tuple[Array, Array, Array, Array]:
    """Times (n,), γ, ℓ and ω (n, 3) of the ball by the equations."""
    times = sample_times(duration, INTERVAL)
    axes, p = rotation_matrix(theory_motion(scene, times)[0]), scene.parameters
    M = np.einsum("nji,j->ni", axes, scene.start.momentum)
    omega = np.stack(p.angular_velocity(tuple(M.T), tuple(axes[:, 2].T)), axis=1)
    return times, axes[:, 2], of_model(scene, axes[:, 2], M), omega


def of_model(scene: Scene, gamma: Array, M: Array) -> Array:
    """ℓ (n, 3) of γ and M (n, 3)."""
    return np.cross(M, gamma) if scene.rolling == "rubber" else M


def crossings_of(scene: Scene) -> Crossings:
    """Where (ℓ×γ)₃ = 0, in one direction, by the equations."""
    return sampled_crossings(*level_states(scene, FOLLOWED)).only(1)


def engine_crossings_of(scene: Scene) -> Crossings:
    """The same by the engine."""
    motion = engine_motion(scene, sample_times(FOLLOWED), "fast")
    turned = rotation_matrix(motion.attitude) @ scene.principal_axes
    M = np.einsum("nji,nj->ni", turned, motion.momentum)
    level = of_model(scene, turned[:, 2], M)
    omega = motion.angular_velocity @ scene.principal_axes
    return sampled_crossings(motion.times, turned[:, 2], level, omega).only(1)


def points_of(found: Crossings) -> Array:
    """γ and ℓ/√f side by side (n, 6)."""
    return np.concatenate([found.gamma, found.momenta / np.sqrt(F)], axis=1)


def apart(points: Array, curve: InvariantCurve) -> float:
    """How far the farthest of the points (n, 6) is from a curve."""
    return float(distance_to_curve(points, curve.at(np.linspace(0.0, 1.0, 20_000))).max())


def kept(balls: dict[str, Scene]) -> float:
    """By how much, relative, J changes along the motions of both balls."""
    changes = []
    for scene in balls.values():
        _, gamma, level, _ = level_states(started(scene, LEVELS[2]), SHOWN)
        J = shared_integral(balls["rubber"].parameters, gamma, level)
        changes.append(float(np.ptp(J) / J.mean()))
    return max(changes)


def draw_spheres(axes: Axes, balls: dict[str, Scene]) -> None:
    """γ of both balls from the same point, for a while."""
    globe = Globe(axes, VIEW, f"vertical γ, {SHOWN:g} s from the same (γ, ℓ)")
    for rolling, ball in balls.items():
        scene = started(ball, LEVELS[2])
        times, gamma, _, _ = level_states(scene, SHOWN)
        ours = engine_motion(scene, times).gamma @ scene.principal_axes
        globe.line(gamma, **{**THEORY_LINE, "color": COLOURS[rolling]}, zorder=4,
                   label=f"{rolling}, equations")  # fmt: skip
        label = ENGINE_NAME if rolling == "classical" else None
        globe.line(ours, **ENGINE_LINE, zorder=5, label=label)
    globe.marks(gamma[:1], "o", color=INK, markersize=6, zorder=6)
    axes.legend(loc="lower right", bbox_to_anchor=(1.08, -0.08), fontsize=9, frameon=False)


def draw_sections(
    axes: Axes,
    balls: dict[str, Scene],
    runs: dict[tuple[str, float], Crossings],
    curves: dict[tuple[str, float], InvariantCurve],
) -> None:
    """The crossings of both balls by both engines, on the curves of the classical one."""
    for l in LEVELS:
        states = curves["classical", l].at(np.linspace(0.0, 1.0, 2000))
        axes.plot(np.arctan2(states[:, 3], states[:, 4]), states[:, 5], color=FAINT, linewidth=0.8)
        for rolling, ball in balls.items():
            found, ours = runs[rolling, l], engine_crossings_of(started(ball, l))
            first, size = l == LEVELS[0], 8.0 if rolling == "rubber" else 3.5
            axes.plot(found.l, found.L / np.sqrt(F), ".", color=COLOURS[rolling], markersize=size,
                      label=rolling if first else None, zorder=2)  # fmt: skip
            axes.plot(ours.l[::4], ours.L[::4] / np.sqrt(F), "o", mfc="none", mec=ENGINE_COLOUR,
                      markersize=6, mew=0.8, zorder=3,
                      label=ENGINE_NAME if first and rolling == "classical" else None)  # fmt: skip
    title = "section (ℓ×γ)₃ = 0, one direction"
    axes.set(xlabel="l [rad]", ylabel="L/√f", title=title, ylim=(-1.05, 1.05))
    axes.legend(loc="upper center", fontsize=9)
