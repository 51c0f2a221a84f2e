"""Fig. 11: the section g = 0 over (l, L/√f), with its attractors and the way to them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from robotball import Scene, load_scene, preset
from robotball.engines.mujoco.model import build
from robotball.palette import INK
from robotball.qualitative.sections import fixed_point, section
from robotball.rotations import Array
from validation.figures.parts import ENGINE_COLOUR, ENGINE_NAME, FAINT, THEORY, sheet
from validation.studies.attractors.clouds import distance_to_curve
from validation.studies.attractors.contact_map import contact_cycle
from validation.studies.attractors.sampling import (
    COARSE,
    Cloud,
    Recipe,
    Torus,
    cloud_by_contact,
    cloud_by_equations,
)

F = 25.0
ROOT_F = float(np.sqrt(F))
# Of these starts the first crossings are the transient, drawn grey.
REGULAR = Recipe(f=F, starts=64, skipped=0, count=600, direction=0)
REGULAR_TRANSIENT = 300
REGULAR_BY_CONTACT = Recipe(f=F, starts=16, skipped=0, count=100, direction=0)
TORUS = Torus(L=0.0, l=1.96, spread=0.2, f=F, starts=64, skipped=400, count=1000, direction=0)
TORUS_BY_CONTACT = replace(TORUS, spread=0.0, starts=1, skipped=200, count=1200)
CHAOS = Recipe(f=F, starts=40, skipped=0, count=520, direction=0)
CHAOS_BY_CONTACT = replace(CHAOS, count=150)
CHAOS_TRANSIENT = 20
DOT: dict[str, Any] = {"marker": ".", "linestyle": "none", "mew": 0}


def figure11a() -> Figure:
    """A periodic orbit and a limit torus, with what settles on them, by both engines."""
    scene = load_scene("fig12")
    ball, balanced, coarse = (
        scene.parameters,
        build(scene, preset("balanced")),
        build(scene, COARSE),
    )
    cycle = fixed_point(ball, 3.6, 0.6, F)
    own = section(ball, cycle.attitude[None], cycle.momentum[None], 2)
    ours = [
        contact_cycle(balanced, float(L), float(l), F, cycle.period, int(direction))
        for L, l, direction in zip(own.L[0], own.l[0], own.directions[0], strict=True)
    ]
    curve = cloud_by_equations(ball, TORUS, seed=0)
    points = cloud_by_contact(build(scene, preset("fast")), TORUS_BY_CONTACT, seed=0)
    off = float(distance_to_curve(points.states, curve.states).max())
    facts = (
        "One periodic orbit, crossing twice, once in",
        f"  each direction (E23): period {cycle.period:.6f} s,",
        f"  {ENGINE_NAME}'s {ours[0].period:.6f} s; |multiplier|",
        f"  {abs(cycle.multipliers[0]):.5f}, {ENGINE_NAME}'s {abs(ours[0].multipliers[0]):.5f}.",
        "One limit torus, in both directions:",
        f"  all {len(points.L)} points of {ENGINE_NAME}'s lie within",
        f"  {off:.1g} of that of the equations (γ and",
        "  M/√f as unit vectors).",
        f"{ENGINE_NAME}'s steps: 5 ms for the periodic orbit, 20",
        "  for the torus, 50 on the way to them.",
        "The section is an annulus (E25): at L = ±√f",
        "  states differ with l.",
    )
    figure, axes = sheet(
        "Fig. 11a: a limit cycle and a limit torus",
        caption_of(scene), facts, [["theory", "engine"]], (5.6, 5.6),
    )  # fmt: skip
    crossed = np.array([[each.l, each.L] for each in ours])
    of_theory = cloud_by_equations(ball, REGULAR, seed=1), curve, np.stack([own.l[0], own.L[0]], 1)
    of_engine = cloud_by_contact(coarse, REGULAR_BY_CONTACT, seed=2), points, crossed
    for each, (clouds, colour, name, transient) in zip(
        axes.values(),
        (
            (of_theory, THEORY, "equations", REGULAR_TRANSIENT),
            (of_engine, ENGINE_COLOUR, ENGINE_NAME, REGULAR_BY_CONTACT.count),
        ),
        strict=True,
    ):
        cloud, torus, orbit = clouds
        starts = len(cloud.L) // (REGULAR.count if name == "equations" else transient)
        early, late = parted(cloud, starts, transient)
        each.plot(*early, **DOT, color=FAINT, markersize=2.2, label="on the way")
        each.plot(*places(torus.l, torus.L), **DOT, color=colour, markersize=3.5,
                  label="limit torus")  # fmt: skip
        each.plot(*late, **DOT, color=colour, markersize=4)
        each.plot(*places(*orbit.T), "o", mfc="none", mec=INK, ms=12, label="periodic orbit")
        each.plot(*places(*orbit.T), "+", color=colour, ms=9, mew=2)
        annulus(each, f"section g = 0, {name}")
        for handle in each.legend(loc="lower right", fontsize=9).legend_handles:
            if isinstance(handle, Line2D):
                handle.set_markersize(9)
    return figure


def figure11b(report: Callable[[float], None] = lambda _: None) -> Figure:
    """The strange attractor, by the equations and by the engine side by side."""
    scene = load_scene("fig14")
    theory = cloud_by_equations(scene.parameters, CHAOS, seed=1)
    engine = cloud_by_contact(build(scene, COARSE), CHAOS_BY_CONTACT, seed=2, progress=report)
    facts = (
        "A strange attractor:",
        "  λ₁ = 0.1160 ± 0.0001, λ₆ = -0.1394 1/s",
        "  (E26), dimension 1.832 on the section.",
        f"From {CHAOS.starts} random starts: grey the first",
        f"  {CHAOS_TRANSIENT} crossings, then {CHAOS.count - CHAOS_TRANSIENT} of each by the",
        f"  equations, {CHAOS_BY_CONTACT.count - CHAOS_TRANSIENT} by {ENGINE_NAME}. As clouds they",
        "  cannot be told apart (robotball attractors).",
        f"Dark: g grows; pale: g falls. {ENGINE_NAME}'s steps",
        "  are 50 ms.",
    )
    figure, axes = sheet(
        "Fig. 11b: a strange attractor",
        caption_of(scene), facts, [["theory", "engine"]], (5.6, 5.6),
    )  # fmt: skip
    for each, (cloud, colour, size, name) in zip(
        axes.values(),
        ((theory, THEORY, 1.8, "equations"), (engine, ENGINE_COLOUR, 3.4, ENGINE_NAME)),
        strict=True,
    ):
        early, _ = parted(cloud, CHAOS.starts, CHAOS_TRANSIENT)
        each.plot(*early, **DOT, color=FAINT, markersize=2.2)
        late = np.arange(len(cloud.L)) % (len(cloud.L) // CHAOS.starts) >= CHAOS_TRANSIENT
        for direction, alpha in ((1, 1.0), (-1, 0.35)):
            which = late & (cloud.directions == direction)
            each.plot(*places(cloud.l[which], cloud.L[which]), **DOT, color=colour, alpha=alpha,
                      markersize=size)  # fmt: skip
        annulus(each, f"section g = 0, {name}")
    return figure


def parted(cloud: Cloud, starts: int, transient: int) -> tuple[Array, Array]:
    """Places (2, n) of the first `transient` crossings of each start, and of the others."""
    early = np.arange(len(cloud.L)) % (len(cloud.L) // starts) < transient
    return places(cloud.l[early], cloud.L[early]), places(cloud.l[~early], cloud.L[~early])


def places(l: Array, L: Array) -> Array:
    """Points (2, n) of the picture: l from 0 to 2π, where attractors lie in one piece, and L/√f."""
    return np.stack([np.asarray(l) % (2 * np.pi), np.asarray(L) / ROOT_F])


def annulus(axes: Axes, title: str) -> None:
    """The section's bounds and scales."""
    axes.axhline(1.0, color=FAINT)
    axes.axhline(-1.0, color=FAINT)
    axes.set(xlabel="l [rad], once round", ylabel="L/√f", title=title,
             xlim=(0, 2 * np.pi), ylim=(-1.06, 1.06))  # fmt: skip
    axes.set_xticks(np.pi / 2 * np.arange(5), ["0", "π/2", "π", "3π/2", "2π"])


def caption_of(scene: Scene) -> tuple[str, ...]:
    """The caption's numbers, of Figs 11 to 14."""
    p = scene.parameters

    def row(v: tuple[float, ...]) -> str:
        return ", ".join(f"{round(x, 9) + 0.0:g}" for x in v)

    return (
        f"A = diag({row(p.A)}) 1/(kg m²)",
        f"Ω = ({row(p.Omega)}) rad/s, a = {p.a:g} m",
        f"K = ({row(p.K)}) kg m²/s",
        f"M² = f = {F:g} (kg m²/s)², g₀ = 0",
    )
