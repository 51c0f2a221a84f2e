"""Figs 11 to 14: the section g = 0 over (l, L/√f) with its attractors, and motion on them.

And the introduction's remark: the rubber Chaplygin ball and a classical one wind the same tori.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Motion, Scene, load_scene, preset, sample_times
from robotball.engines.mujoco.model import build
from robotball.film.lines import line_looks
from robotball.film.looks import INK
from robotball.qualitative.sections import (
    Crossings,
    InvariantCurve,
    crossings_of_motion,
    fixed_point,
    invariant_curve,
    section,
    shared_integral,
)
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from validation.figures import (
    ENGINE_COLOUR,
    ENGINE_LINE,
    ENGINE_NAME,
    FAINT,
    THEORY,
    THEORY_LINE,
    View,
    draw_paths,
    engine_motion,
    paper_scene,
    sheet,
)
from validation.figures.sphere import Globe, draw_gamma
from validation.studies.contact_sections import (
    COARSE,
    Recipe,
    Torus,
    cloud_by_contact,
    cloud_by_equations,
    distance_to_curve,
)
from validation.studies.contact_tangent import contact_cycle, cycle_crossings
from validation.study import compiled_motion

_F = 25.0
_ROOT_F = float(np.sqrt(_F))
# Of these starts the first crossings are the transient, drawn grey.
REGULAR = Recipe(f=_F, starts=64, skipped=0, count=600, direction=0)
_REGULAR_TRANSIENT = 300
REGULAR_BY_CONTACT = Recipe(f=_F, starts=16, skipped=0, count=100, direction=0)
# Many starts around Fig. 13's, so that a dense curve comes from short runs.
TORUS = Torus(L=0.0, l=1.96, spread=0.2, f=_F, starts=64, skipped=400, count=1000, direction=0)
TORUS_BY_CONTACT = replace(TORUS, spread=0.0, starts=1, skipped=200, count=1200)
CHAOS = Recipe(f=_F, starts=40, skipped=0, count=520, direction=0)
# A crossing by the engine takes longer, and fewer show the same cloud.
CHAOS_BY_CONTACT = replace(CHAOS, count=150)
_CHAOS_TRANSIENT = 20


def figure11a() -> Figure:
    """Draw a periodic orbit and a limit torus, with what settles on them, by both engines."""
    scene = load_scene("fig12")
    ball, balanced = scene.parameters, build(scene, preset("balanced"))
    cycle = fixed_point(ball, 3.6, 0.6, _F)
    # Two crossings of one orbit, one in each direction of g: which the paper's figure shows as two
    # concentrations (E23).
    own = section(ball, cycle.attitude[None], cycle.momentum[None], 2)
    ours = contact_cycle(balanced, cycle)
    through = cycle_crossings(balanced, ours)[:2]
    curve = cloud_by_equations(ball, TORUS, seed=0)
    points, _ = cloud_by_contact(scene, preset("fast"), TORUS_BY_CONTACT, seed=0)
    off = float(distance_to_curve(points.states, curve.states).max())
    facts = (
        f"One periodic orbit, crossing twice, once in each direction (E23): period "
        f"{cycle.period:.6f} s, {ENGINE_NAME}'s {ours.period:.6f} s; |multiplier| "
        f"{abs(cycle.multipliers[0]):.5f}, {ENGINE_NAME}'s {abs(ours.multipliers[0]):.5f}.",
        f"One limit torus, in both directions: all {len(points.L)} points of {ENGINE_NAME}'s lie "
        f"within {off:.1g} of that of the equations (γ and M/√f as unit vectors).",
        f"{ENGINE_NAME}'s steps: 5 ms for the periodic orbit, 20 for the torus, 50 on the way to "
        "them.",
        "The section is an annulus (E25): at L = ±√f states differ with l.",
    )
    figure, axes = sheet(
        "Fig. 11a: every start settles on one periodic orbit or on one torus",
        _caption_of(scene), facts, [["theory", "engine"]], (4.6, 4.6),
    )  # fmt: skip
    # On the way to an attractor errors do not add up, as the attractor takes them back, so long
    # steps will do.
    coarse, _ = cloud_by_contact(scene, COARSE, REGULAR_BY_CONTACT, seed=2)
    for each, cloud, count, torus, orbit, colour, name in (
        (axes["theory"], cloud_by_equations(ball, REGULAR, seed=1), REGULAR.count, curve,
         own[0], THEORY, "equations"),
        (axes["engine"], coarse, REGULAR_BY_CONTACT.count, points, through, ENGINE_COLOUR,
         ENGINE_NAME),
    ):  # fmt: skip
        # The points of a cloud stand start by start.
        early = np.arange(len(cloud.L)) % count < _REGULAR_TRANSIENT
        _dots(each, cloud[early], color=FAINT, markersize=2.2, label="on the way")
        _dots(each, torus, color=colour, markersize=3.5, label="limit torus")
        _dots(each, cloud[~early], color=colour, markersize=4)
        each.plot(*_places(orbit), "o", mfc="none", mec=INK, ms=12)
        each.plot(*_places(orbit), "+", color=colour, ms=8, mew=2, label="periodic orbit")
        _annulus(each, f"section g = 0, {name}")
        each.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, frameon=False,
                    fontsize=9, columnspacing=1.0, markerscale=1.5)  # fmt: skip
    return figure


def figure11b() -> Figure:
    """Draw the strange attractor, by the equations and by the engine side by side."""
    scene = load_scene("fig14")
    theory = cloud_by_equations(scene.parameters, CHAOS, seed=1)
    engine, _ = cloud_by_contact(scene, COARSE, CHAOS_BY_CONTACT, seed=2)
    facts = (
        "A strange attractor: λ₁ = 0.1160 ± 0.0001, λ₆ = -0.1394 1/s (E26), dimension 1.832 on the "
        "section.",
        f"From {CHAOS.starts} random starts: grey the first {_CHAOS_TRANSIENT} crossings, then "
        f"{CHAOS.count - _CHAOS_TRANSIENT} of each by the equations, "
        f"{CHAOS_BY_CONTACT.count - _CHAOS_TRANSIENT} by {ENGINE_NAME}. As clouds they cannot be "
        "told apart (robotball attractors).",
        f"Dark: g grows; pale: g falls. {ENGINE_NAME}'s steps are 50 ms.",
    )
    figure, axes = sheet(
        "Fig. 11b: a strange attractor, the same by both",
        _caption_of(scene), facts, [["theory", "engine"]], (4.6, 4.6),
    )  # fmt: skip
    for each, cloud, count, colour, size, name in (
        (axes["theory"], theory, CHAOS.count, THEORY, 1.8, "equations"),
        (axes["engine"], engine, CHAOS_BY_CONTACT.count, ENGINE_COLOUR, 3.4, ENGINE_NAME),
    ):
        late = np.arange(len(cloud.L)) % count >= _CHAOS_TRANSIENT
        _dots(each, cloud[~late], color=FAINT, markersize=2.2)
        for direction, alpha in ((1, 1.0), (-1, 0.35)):
            some = cloud[late].only(direction)
            _dots(each, some, color=colour, alpha=alpha, markersize=size)
        _annulus(each, f"section g = 0, {name}")
    return figure


def _dots(axes: Axes, found: Crossings, **style: Any) -> None:
    """Draw crossings as dots."""
    axes.plot(*_places(found), ".", mew=0, **style)


def _places(found: Crossings) -> Array:
    """Return points (2, n) of the picture: l, from 0 to 2π, and L/√f.

    With this cut of l the attractors lie in one piece.
    """
    return np.stack([found.l % (2 * np.pi), found.L / _ROOT_F])


def _annulus(axes: Axes, title: str) -> None:
    """Draw the section's bounds and scales."""
    axes.axhline(1.0, color=FAINT)
    axes.axhline(-1.0, color=FAINT)
    axes.set(xlabel="l [rad], once round", ylabel="L/√f", title=title,
             xlim=(0, 2 * np.pi), ylim=(-1.06, 1.06))  # fmt: skip
    axes.set_xticks(np.pi / 2 * np.arange(5), ["0", "π/2", "π", "3π/2", "2π"])


def _caption_of(scene: Scene) -> tuple[str, ...]:
    """Return the caption's numbers, of Figs 11 to 14."""
    p = scene.parameters

    def row(v: tuple[float, ...]) -> str:
        return ", ".join(f"{round(x, 9) + 0.0:g}" for x in v)

    return (
        f"A = diag({row(p.A)}) 1/(kg m²)",
        f"Ω = ({row(p.Omega)}) rad/s, a = {p.a:g} m",
        f"K = ({row(p.K)}) kg m²/s",
        f"M² = f = {_F:g} (kg m²/s)², g₀ = 0",
    )


# Motion on the attractors -------------------------------------------------------------------

_VIEW = View(azimuth=40.0, elevation=25.0)
_NO_DRIFT = (
    "none along Y: the attractors are the same under (γ,M) → -(γ,M), which flips dY/dt. The axis "
    "OX points opposite to M."
)


def figure12() -> Figure:
    """Draw γ and the path on the limit cycle."""
    fact = f"Near the periodic orbit of Fig. 11a: dX/dt = 3.65907 m/s in the mean, {_NO_DRIFT}"
    return _sphere_and_path(12, "(L, l) = (3.6, 0.6)", "on the limit cycle", fact)


def figure13() -> Figure:
    """Draw γ and the path on the limit torus."""
    fact = f"Near the limit torus of Fig. 11a: dX/dt = 3.665 m/s in the mean, {_NO_DRIFT}"
    return _sphere_and_path(13, "(L, l) = (0, 1.96)", "on the limit torus", fact)


def _sphere_and_path(number: int, start: str, where: str, fact: str) -> Figure:
    """Draw the two panels of Figs 12 and 13, and below how far apart the engines are."""
    scene, duration = load_scene(f"fig{number}"), 40.0
    caption = (*_caption_of(scene), f"start: {start}", f"Duration chosen: {duration:g} s.")
    figure, axes = sheet(
        f"Fig. {number}: {where} {ENGINE_NAME} keeps to the equations' path for {duration:g} s",
        caption, [fact], [["sphere", "apart"], ["plane", "plane"]], (4.3, 4.3), (4.0, 3.0),
    )  # fmt: skip
    theory = _draw_long_paths(axes, scene, duration)
    globe = Globe(axes["sphere"], _VIEW, f"vertical γ on the Poisson sphere, {duration:g} s")
    draw_gamma(globe, theory, engine_motion(scene, theory.times))
    return figure


def figure14() -> Figure:
    """Draw the path on the strange attractor, and how the engines part on it."""
    scene, duration, exponent = load_scene("fig14"), 160.0, 0.116
    caption = (*_caption_of(scene), "start: (L, l) = (0, 0.6)", f"Duration chosen: {duration:g} s.")
    facts = (
        "On the strange attractor of Fig. 11b, not on a limit cycle (E22).",
        f"dX/dt = 3.276 m/s in the mean, {_NO_DRIFT}",
        f"Chaos: errors grow as exp({exponent:g} t), so beyond some time both motions are right, "
        "and different.",
    )
    figure, axes = sheet(
        "Fig. 14: on the strange attractor the two motions part in the end",
        caption, facts, [["plane"], ["apart"]], (8.6,), (3.6, 3.0),
    )  # fmt: skip
    times = _draw_long_paths(axes, scene, duration).times
    # By λ₁ alone; the height is chosen, so that the line lies beside the curves.
    axes["apart"].semilogy(times, 3e-8 * np.exp(exponent * times), ":", color=INK, linewidth=1.5,
                           label=f"exp({exponent:g} t)")  # fmt: skip
    axes["apart"].legend(loc="lower right", ncols=4, fontsize=9)
    return figure


def _draw_long_paths(panels: Mapping[str, Axes], scene: Scene, duration: float) -> Motion:
    """Draw both contact points, and by three presets the engine's distance from the equations'."""
    axes, theory = panels["plane"], compiled_motion(scene, sample_times(duration))
    engine = engine_motion(scene, theory.times)
    draw_paths(axes, theory, engine, f"contact point, {duration:g} s (X and Y to unlike scales)")
    # Stretched in width, as a long path is not seen otherwise.
    axes.set_aspect("auto")
    axes.margins(y=0.25)
    axes.legend(loc="upper center", ncols=3)
    axes, times = panels["apart"], theory.times
    for motion in (engine_motion(scene, times, name) for name in ("fast", "balanced", "accurate")):
        (look,) = line_looks([motion])
        distance = np.linalg.norm(motion.contact_point - theory.contact_point, axis=1)
        axes.semilogy(times[1:], distance[1:], linestyle=(0, look.dash), color=look.colour,
                      linewidth=1.2, label=motion.report.settings.name)  # fmt: skip
    title = f"contact points: {ENGINE_NAME} from the equations"
    axes.set(xlabel="time [s]", ylabel="distance [m]", title=title)
    axes.legend(loc="lower right", ncols=3, fontsize=9)
    return theory


# Two rolling models on the same tori ---------------------------------------------------------

_TORI_VIEW = View(azimuth=210.0, elevation=35.0)
_COLOURS = {"rubber": THEORY, "classical": "#AA3377"}  # of both balls by the equations
LEVELS = (0.2, 0.4, 0.5, 0.6, 1.0, 1.2)  # l of ℓ at the start, where L = 0 [rad]: a torus each
_FOLLOWED, SHOWN = 210.0, 12.0  # s
_INTERVAL = 0.01  # s, between samples: the error of a crossing goes with its fourth power


def figure_tori() -> Figure:
    """Draw both balls' γ on one sphere, their sections on the same curves, and how they differ."""
    balls: dict[str, Scene] = {
        scene.rolling: scene
        for scene in map(paper_scene, ("rubber_chaplygin_ball", "chaplygin_ball_same_tori"))
    }
    runs = {
        (rolling, l): crossings_of(followed(started(scene, l)))
        for rolling, scene in balls.items()
        for l in LEVELS
    }
    curves = {key: invariant_curve(found.states) for key, found in runs.items()}
    off = max(apart(runs["rubber", l].states, curves["classical", l]) for l in LEVELS)
    caption = (
        "rubber: A = diag(.8, .6, .7) 1/(kg m²)",
        "classical: A' = E/d - A/2, d = 0.9 kg m²,",
        "  A' = diag(.711, .811, .761)",
        "Ω = 0, K = 0: nothing turns inside",
        "f = 25 (kg m²/s)², (M,γ) = 0 (all chosen)",
    )
    facts = (
        "Introduction, 3: the reduced trajectories of both balls wind round the same tori.",
        "ℓ = M×γ of the rubber ball, ℓ = M of the classical one: both are constant in space.",
        "Each ball keeps the other's energy; from the same (γ, ℓ) it changes by "
        f"{kept(balls):.0e} in {SHOWN:g} s.",
        f"The rubber ball's crossings lie within {off:.0e} of the classical ball's curves.",
        "They differ in how fast they go round: the turns along the curve between crossings.",
        f"Dots: equations; rings: {ENGINE_NAME}.",
    )
    figure, axes = sheet(
        "Two rolling models, the same tori: Chaplygin's ball",
        caption, facts, [["sphere", "section", "turns"]], (4.2, 4.2, 3.0),
    )  # fmt: skip
    _draw_spheres(axes["sphere"], balls)
    _draw_sections(axes["section"], balls, runs, curves)
    for rolling, mark in (("rubber", "o"), ("classical", "s")):
        turns = [curves[rolling, l].rotation for l in LEVELS]
        axes["turns"].plot(LEVELS, turns, mark, color=_COLOURS[rolling], label=rolling)
    axes["turns"].set(xlabel="l [rad] at the start, L = 0", ylim=(0, None))
    axes["turns"].set_title("turns between crossings")
    axes["turns"].legend(loc="lower left")
    return figure


def started(scene: Scene, l: float) -> Scene:
    """Start the ball at the level (0, l) of ℓ, where (ℓ×γ)₃ = 0."""
    gamma, level = section_state(0.0, l, 0.0, _F)
    # (γ×ℓ)×γ = ℓ for ℓ across γ, so both balls start with the same γ and the same ℓ.
    M = np.cross(gamma, level) if scene.rolling == "rubber" else level
    return replace(scene, start=along_momentum(gamma, M))


def followed(scene: Scene, duration: float | None = None) -> Motion:
    """Return the ball's motion by the equations, over _FOLLOWED where no duration [s] is given."""
    return compiled_motion(scene, sample_times(duration or _FOLLOWED, _INTERVAL))


def engine_followed(scene: Scene) -> Motion:
    """Return the ball's motion by the engine, over _FOLLOWED."""
    return engine_motion(scene, sample_times(_FOLLOWED), "fast")


def _levelled(motion: Motion) -> Motion:
    """Return the motion with ℓ in the place of M, which is as constant in space."""
    if motion.scene.rolling == "classical":
        return motion
    # M×γ with γ upright in the world: the rubber ball's momentum, turned back by a right angle.
    return replace(motion, momentum=np.cross(motion.momentum, [0.0, 0.0, 1.0]))


def crossings_of(motion: Motion) -> Crossings:
    """Find where (ℓ×γ)₃ = 0 along a motion, in one direction."""
    return crossings_of_motion(_levelled(motion), motion.scene).only(1)


def apart(points: Array, curve: InvariantCurve) -> float:
    """Measure how far the farthest of the points (n, 6) is from a curve."""
    return float(distance_to_curve(points, curve.at(np.linspace(0.0, 1.0, 20_000))).max())


def kept(balls: dict[str, Scene]) -> float:
    """Measure by how much, relative, J changes along the motions of both balls."""
    changes = []
    for scene in balls.values():
        motion = _levelled(followed(started(scene, LEVELS[2]), SHOWN))
        # In principal axes, as the integral that both balls share is written in them.
        axes = rotation_matrix(motion.attitude) @ scene.principal_axes
        level = np.einsum("nji,nj->ni", axes, motion.momentum)
        J = shared_integral(balls["rubber"].parameters, axes[:, 2], level)
        changes.append(float(np.ptp(J) / J.mean()))
    return max(changes)


def _draw_spheres(axes: Axes, balls: dict[str, Scene]) -> None:
    """Draw γ of both balls from the same point, for a while."""
    globe = Globe(axes, _TORI_VIEW, f"vertical γ, {SHOWN:g} s from the same (γ, ℓ)")
    for rolling, ball in balls.items():
        scene = started(ball, LEVELS[2])
        theory = followed(scene, SHOWN)
        engine = engine_motion(scene, theory.times)
        gamma, ours = (each.gamma @ scene.principal_axes for each in (theory, engine))
        globe.line(gamma, **{**THEORY_LINE, "color": _COLOURS[rolling]}, zorder=4,
                   label=f"{rolling}, equations")  # fmt: skip
        label = ENGINE_NAME if rolling == "classical" else None
        globe.line(ours, **ENGINE_LINE, zorder=5, label=label)
    globe.marks(gamma[:1], "o", color=INK, markersize=6, zorder=6)
    axes.legend(loc="lower right", bbox_to_anchor=(1.08, -0.08), fontsize=9, frameon=False)


def _draw_sections(
    axes: Axes,
    balls: dict[str, Scene],
    runs: dict[tuple[str, float], Crossings],
    curves: dict[tuple[str, float], InvariantCurve],
) -> None:
    """Draw the crossings of both balls by both engines, on the curves of the classical one."""
    for l in LEVELS:
        states = curves["classical", l].at(np.linspace(0.0, 1.0, 2000))
        axes.plot(np.arctan2(states[:, 3], states[:, 4]), states[:, 5], color=FAINT, linewidth=0.8)
        for rolling, ball in balls.items():
            found, ours = runs[rolling, l], crossings_of(engine_followed(started(ball, l)))
            first, size = l == LEVELS[0], 8.0 if rolling == "rubber" else 3.5
            axes.plot(found.l, found.L / _ROOT_F, ".", color=_COLOURS[rolling], markersize=size,
                      label=rolling if first else None, zorder=2)  # fmt: skip
            axes.plot(ours.l[::16], ours.L[::16] / _ROOT_F, "o", mfc="none", mec=ENGINE_COLOUR,
                      markersize=9, mew=1.2, zorder=3,
                      label=ENGINE_NAME if first and rolling == "classical" else None)  # fmt: skip
    title = "section (ℓ×γ)₃ = 0, one direction"
    axes.set(xlabel="l [rad]", ylabel="L/√f", title=title, ylim=(-1.05, 1.05))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
