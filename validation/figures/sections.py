"""Figs 11 to 14: the attractors on the section g = 0, and the contact point's paths on them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Scene, load_scene, preset, sample_times
from robotball.engines.mujoco import LABEL as ENGINE
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as THEORY
from robotball.palette import INK
from robotball.qualitative.sections import fixed_point, section
from robotball.rotations import Array
from validation.figures.parts import FAINT, draw_paths, sheet, theory_motion
from validation.studies.attractors.contact_map import contact_cycle
from validation.studies.attractors.sampling import (
    COARSE,
    Recipe,
    Torus,
    cloud_by_contact,
    cloud_by_equations,
)

F = 25.0
TORUS = Torus(L=0.0, l=1.96, spread=0.2, f=F, starts=16, skipped=200, count=300, direction=0)
TORUS_BY_CONTACT = Torus(
    L=0.0, l=1.96, spread=0.0, f=F, starts=1, skipped=60, count=160, direction=0
)
CHAOS = Recipe(f=F, starts=40, skipped=20, count=500, direction=0)
CHAOS_BY_CONTACT = replace(CHAOS, count=60)


def figure11a() -> Figure:
    """A periodic orbit and a limit torus, by both engines on one annulus."""
    scene = load_scene("fig12")
    cycle = fixed_point(scene.parameters, 3.6, 0.6, F)
    own = section(scene.parameters, cycle.attitude[None], cycle.momentum[None], 2)
    balanced = build(scene, preset("balanced"))
    ours = [
        contact_cycle(balanced, float(L), float(l), F, cycle.period, int(direction))
        for L, l, direction in zip(own.L[0], own.l[0], own.directions[0], strict=True)
    ]
    contact = ours[0]
    facts = (
        "One periodic orbit, crossing twice (E23):",
        f"  period {cycle.period:.7f} s, MuJoCo's {contact.period:.7f} s,",
        f"  |multiplier| {abs(cycle.multipliers[0]):.7f}, {abs(contact.multipliers[0]):.7f}.",
        "One limit torus, in both directions.",
        "The section is an annulus (E25): at L = ±√f",
        "  states differ with l, and curves end there",
        "  or turn into the other direction's.",
    )
    figure, (axes,) = sheet(
        "Fig. 11a: a limit cycle and a limit torus", caption_of(scene), facts, (8.2,)
    )
    curve = cloud_by_equations(scene.parameters, TORUS, seed=0)
    points = cloud_by_contact(build(scene, preset("fast")), TORUS_BY_CONTACT, seed=0)
    axes.plot(around(curve.l), curve.L, ".", color=THEORY.colour, alpha=0.35, markersize=6, mew=0,
              label="torus, equations")  # fmt: skip
    axes.plot(around(points.l), points.L, "o", color=ENGINE.colour, markersize=3.5, mfc="none",
              mew=0.8, label=f"torus, {ENGINE.name}")  # fmt: skip
    axes.plot(around(own.l[0]), own.L[0], "s", color=THEORY.colour, alpha=0.55, markersize=13,
              label="periodic orbit, equations")  # fmt: skip
    crossed = np.array([[each.l % (2 * np.pi), each.L] for each in ours]).T
    axes.plot(*crossed, "+", color=ENGINE.colour, markersize=13, mew=2,
              label="periodic orbit, MuJoCo")  # fmt: skip
    annulus(axes, "section g = 0, both directions")
    axes.legend(loc="lower right")
    return figure


def figure11b(report: Callable[[float], None] = lambda _: None) -> Figure:
    """The strange attractor, by the equations and by MuJoCo side by side."""
    scene = load_scene("fig14")
    facts = (
        "A strange attractor:",
        "  λ₁ = 0.1160 ± 0.0001, λ₆ = -0.1394 1/s",
        "  (E26), dimension 1.832 on the section.",
        "Equations: 20,000 points, MuJoCo: 2400,",
        "  from 40 random starts each, after 20",
        "  crossings. As clouds they cannot be told",
        "  apart (python -m validation.studies.attractors.study).",
        "Dark: g grows; pale: g falls.",
    )
    figure, panels = sheet("Fig. 11b: a strange attractor", caption_of(scene), facts, (5.2, 5.2))
    theory = cloud_by_equations(scene.parameters, CHAOS, seed=1)
    engine = cloud_by_contact(build(scene, COARSE), CHAOS_BY_CONTACT, seed=2, progress=report)
    for axes, cloud, colour, size, name in (
        (panels[0], theory, THEORY.colour, 1.6, "equations"),
        (panels[1], engine, ENGINE.colour, 3.2, "MuJoCo"),
    ):
        for direction, alpha in ((1, 1.0), (-1, 0.35)):
            which = cloud.directions == direction
            axes.plot(around(cloud.l[which]), cloud.L[which], ".", color=colour, alpha=alpha,
                      markersize=size, mew=0)  # fmt: skip
        annulus(axes, f"section g = 0, {name}")
    return figure


def figure12() -> Figure:
    """The path on the limit cycle."""
    return path_figure(12, "on the limit cycle", "dX/dt = 3.65907 m/s in the mean", 40.0, 0.0)


def figure13() -> Figure:
    """The path on the limit torus."""
    return path_figure(13, "on the limit torus", "dX/dt = 3.665 m/s in the mean", 40.0, 0.0)


def figure14() -> Figure:
    """The path on the strange attractor, and how the engines part on it."""
    fact = "dX/dt = 3.276 m/s in the mean"
    return path_figure(14, "on the strange attractor (E22)", fact, 160.0, 0.116)


def path_figure(number: int, where: str, drift: str, duration: float, exponent: float) -> Figure:
    """The contact point's path by both engines, and below how far apart they are."""
    scene = load_scene(f"fig{number}")
    times = sample_times(duration)
    _, theory = theory_motion(scene, times)
    facts = [
        f"{drift},",
        "  none along Y: the attractors are the same",
        "  under (γ,M) → -(γ,M), which flips dY/dt.",
        "OX lies against M, which is constant.",
    ]
    if exponent:
        facts += [
            f"Chaos: errors grow as exp({exponent:g} t) (dotted),",
            "  so beyond some time both motions are",
            "  right, and different.",
        ]
    title = f"Fig. {number}: the contact point {where}"
    figure, (plane, apart) = sheet(title, caption_of(scene), facts, (6.4, 3.6))
    for style, name in (("-.", "fast"), ("--", "balanced"), ("-", "accurate")):
        engine = run(build(scene, preset(name)), times)
        distance = np.linalg.norm(engine.contact_point - theory, axis=1)
        apart.semilogy(times[1:], distance[1:], style, color=ENGINE.colour, linewidth=1)
        apart.annotate(name, (times[-1], distance[-1]), color=INK, ha="right", va="bottom")
    if exponent:
        apart.semilogy(times, 3e-8 * np.exp(exponent * times), ":", color=INK, linewidth=1.5)
    draw_paths(plane, theory, engine, f"contact point, {duration:g} s (X and Y to unlike scales)")
    plane.set_aspect("auto")
    plane.margins(y=0.2)
    plane.legend(loc="upper center", ncols=3)
    apart.set(xlabel="time [s]", ylabel="distance [m]", title="between the engines")
    return figure


def annulus(axes: Axes, title: str) -> None:
    axes.axhline(np.sqrt(F), color=FAINT)
    axes.axhline(-np.sqrt(F), color=FAINT)
    axes.set(xlabel="l [rad], from 0 to 2π", ylabel="L [kg m²/s]", title=title,
             xlim=(0, 2 * np.pi), ylim=(-5.3, 5.3))  # fmt: skip


def around(l: Array) -> Array:
    """Angles between 0 and 2π: the attractors lie in one piece there."""
    return l % (2 * np.pi)


def caption_of(scene: Scene) -> tuple[str, ...]:
    p = scene.parameters

    def row(v: tuple[float, ...]) -> str:
        return ", ".join(f"{round(x, 9) + 0.0:g}" for x in v)

    return (
        f"A = diag({row(p.A)}) 1/(kg m²)",
        f"Ω = ({row(p.Omega)}) rad/s, a = {p.a:g} m",
        f"K = ({row(p.K)}) kg m²/s",
        f"M² = f = {F:g} (kg m²/s)²",
        scene.source.split("start ")[1].split(".\n")[0].join(("start ", "")),
    )
