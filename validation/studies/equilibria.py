"""Fixed points, limit cycles and straight-line motions of a scene: a list and a picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich import box
from rich.table import Table

from robotball import InputError, Scene
from robotball.dynamics.cycles import Cycle, curve_of, involute, limit_cycles, separatrices
from robotball.dynamics.equilibria import (
    ContactPath,
    FixedCircle,
    FixedPoint,
    contact_path,
    fixed_circle,
    fixed_points,
    flow,
    index_sum,
    name_of,
)
from robotball.dynamics.straight_motions import (
    StraightMotion,
    name_of_line,
    stability_limit,
    straight_motion,
    straight_motions,
)
from robotball.robot.formulas import Parameters
from robotball.robot.looks import INK
from robotball.rotations import Array, ComplexArray, rotation_matrix

from ..output import halo, progress_bar
from ..study import Study
from .contact_sections import level_starts, steady_scene

_DURATION = 400.0  # s, length of a manifold in time
_LENGTH = 5.0  # rad, length of a manifold that is drawn; beyond it may wind around a focus
# Symbols of stable points are filled.
_MARKERS = {
    "saddle": ("X", "white"),
    "stable focus": ("o", INK),
    "slow stable focus": ("D", INK),
    "centre": ("P", "white"),
    "unstable focus": ("o", "white"),
    "slow unstable focus": ("D", "white"),
    "stable node": ("s", INK),
    "unstable node": ("s", "white"),
    "degenerate": ("*", "white"),
}
_VIEW = np.array([0.77, 0.54, 0.34])  # direction from which the sphere is seen
_ROUNDING = 1e-7  # 1/s, rounding error of an eigenvalue, which may be double
_NEARLY_STRAIGHT = 1e9  # radii of the ball; a path with a larger radius is bent only by rounding
_Point = tuple[str, FixedPoint, ContactPath]
_Cells = tuple[str, str, str, str]


def _point_cells(point: _Point, a: float) -> _Cells:
    """Return a fixed point of a ball of radius a [m] as a row of the table."""
    name, fixed, path = point
    if path.speed < a * max(abs(path.turning), 1.0) / _NEARLY_STRAIGHT:
        words = "spins on the spot" if path.turning else "at rest"
    else:
        straight = path.radius > _NEARLY_STRAIGHT * a
        words = "straight line" if straight else f"circle of {path.radius:.4g} m"
    kind = f"{fixed.kind},\n{words}"
    return name or "fixed", _join(fixed.gamma), _join(fixed.eigenvalues), kind


def _half_circle_cells(circle: FixedCircle, name: str, first: float, word: str) -> _Cells:
    """Return the cells of half of the circle of fixed points, which begins at an angle [rad]."""
    last = first + np.pi / 2
    ends = circle.at(np.array([first, last]))
    # The transverse eigenvalue varies along the circle. It is 0 at the points between the halves.
    rates = circle.rate(circle.at(np.linspace(first, last, 400)))
    fastest = rates[np.argmax(np.abs(rates))]
    span = f"± from {_join(ends[0])}\nto {_join(ends[1])}"
    return name, span, f"0, and 0 to {fastest:.4g}", f"{word},\nstraight line"


def _cycle_cells(cycle: Cycle) -> _Cells:
    return ("cycle", _join(cycle.gamma), _join(cycle.multipliers), f"period {cycle.period:.7f} s")


def _straight_cells(line: StraightMotion, name: str) -> _Cells:
    # If the largest real part is zero, the eigenvalues do not decide the stability.
    rate = line.eigenvalues.real.max()
    kind = "neutral" if abs(rate) < _ROUNDING else "stable" if rate < 0 else "unstable"
    words = f"{kind},\n{'straight line' if line.speed else 'at rest'}"
    return name or "straight", _join(line.gamma), _join(line.eigenvalues), words


def _join(values: Array | ComplexArray) -> str:
    """Return numbers side by side, without rounding errors; conjugate pairs as a ± bi."""
    # Adding 0.0 makes a zero of -0.0.
    rounded = np.round(values, 12) + 0.0
    if np.isrealobj(rounded) or not np.any(rounded.imag):
        return ", ".join(f"{x:.5g}" for x in rounded.real)
    # Complex eigenvalues of a real matrix come in pairs, so one of a pair with ± stands for both.
    above = [z for z in rounded if z.imag >= 0]
    return ", ".join(f"{z.real:.4g} ± {z.imag:.4g}i" if z.imag else f"{z.real:.4g}" for z in above)


def _found_record(
    points: Sequence[_Point],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
    lines: Sequence[tuple[StraightMotion, str]],
) -> dict[str, Any]:
    """Return all results as plain data."""
    return {
        "fixed_points": [
            {
                "name": name,
                **_lists(point, "gamma", "eigenvalues", "kind"),
                "contact_speed": path.speed,
                "contact_turning": path.turning,
            }
            for name, point, path in points
        ],
        "fixed_circle": circle and _lists(circle, "axes", "index"),
        "limit_cycles": [_lists(cycle, "gamma", "period", "multipliers") for cycle in cycles],
        "straight_motions": [
            {"name": name, **_lists(line, "gamma", "eigenvalues", "speed")} for line, name in lines
        ],
    }


def _lists(found: object, *names: str) -> dict[str, Any]:
    """Return fields by name, with complex numbers as [real, imaginary]."""
    plain = {name: getattr(found, name) for name in names}
    for name, value in plain.items():
        if name in ("eigenvalues", "multipliers"):
            plain[name] = [[float(z.real), float(z.imag)] for z in value]
    return plain


def portrait(
    title: str,
    parameters: Parameters,
    points: Sequence[FixedPoint],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
) -> Figure:
    """Draw fixed points, their manifolds and limit cycles on the sphere, also unrolled."""
    figure = Figure(figsize=(13.0, 6.4), layout="constrained")
    ends = sorted(name_of(parameters, it.gamma) for it in points if "stable" in it.kind.split())
    ends += ["Σ_s"] * bool(circle)
    ends += ["a limit cycle"] * any(abs(cycle.multipliers[0]) < 1 for cycle in cycles)
    finding = f"motions end at {', '.join(ends)}" if ends else f"{len(points)} fixed points"
    figure.suptitle(f"{title}: {finding}", color=INK, size="x-large")
    views: Any = {"sphere": {"projection": "3d"}}
    axes: dict[str, Any] = figure.subplot_mosaic(
        [["sphere", "involute"]], width_ratios=(4.6, 8.4), per_subplot_kw=views
    )
    sphere, chart = axes["sphere"], axes["involute"]

    def draw(gamma: Array, **style: Any) -> None:
        label = style.pop("label", None)
        if label in chart.get_legend_handles_labels()[1]:  # only one entry in the legend
            label = None
        # The flow is the same at γ and -γ, so the far side would show the same.
        sphere.plot(*np.where(gamma @ _VIEW > 0, gamma.T, np.nan), **style)
        chart.plot(*involute(gamma).T, label=label, **style)

    _draw_field(sphere, chart, parameters)
    for manifold in separatrices(parameters, points, _DURATION):
        length = np.cumsum(np.linalg.norm(np.diff(manifold.path, axis=0), axis=1))
        word, dashes = ("stable", "--") if manifold.stable else ("unstable", "-")
        path = manifold.path[: int(np.searchsorted(length, _LENGTH)) + 2]
        draw(path, color=INK, lw=0.9, ls=dashes, label=f"{word} manifolds of the saddles")
    for quarter in range(4 if circle else 0):
        assert circle is not None
        arc = circle.at(np.linspace(quarter, quarter + 1, 100) * np.pi / 2)
        colour, word = ("#AA4499", "Σ_u, repels") if quarter % 2 else ("#117733", "Σ_s, attracts")
        draw(arc, color=colour, lw=2.6, label=word)
    for cycle in cycles:
        curve = curve_of(parameters, cycle.gamma, cycle.period)
        word, dashes = ("stable", "-") if abs(cycle.multipliers[0]) < 1 else ("unstable", "--")
        for gamma in (curve, -curve):  # γ → -γ is a symmetry
            draw(gamma, color="#3344DD", lw=3.2, ls=dashes, label=f"{word} limit cycle")
    for point in sorted(points, key=lambda point: point.kind):
        marker, colour = _MARKERS[point.kind]
        style = {"marker": marker, "color": colour, "mec": INK, "ms": 8, "ls": "", "zorder": 6}
        draw(point.gamma[None], **style, label=point.kind)
        name = name_of(parameters, point.gamma)
        style = {"fontsize": 14, "zorder": 9, "path_effects": halo()}
        if point.gamma @ _VIEW > 0:
            sphere.text(*point.gamma, f"  {name}", **style)
        chart.text(*involute(point.gamma), f"  {name}", **style)
    sphere.set_box_aspect((1, 1, 1), zoom=1.5)
    sphere.set_axis_off()
    sphere.view_init(*np.degrees([np.arcsin(_VIEW[2]), np.arctan2(_VIEW[1], _VIEW[0])]))
    sphere.set_title("vertical γ on the near side of the Poisson sphere")
    chart.set(xlim=(0.0, 2 * np.pi), ylim=(-1.2, 1.2), title="the same sphere unrolled")
    chart.set(xlabel="φ = π/4 + arctan(γ₁/γ₂) [rad], full circle", ylabel="γ₃")
    handles, labels = chart.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_field(sphere: Any, chart: Any, parameters: Parameters) -> None:
    """Draw a grid on the sphere, and streamlines of (4.1) on the unrolled sphere."""
    phi, height = np.meshgrid(np.linspace(0.0, 2 * np.pi, 80), np.linspace(-0.99, 0.99, 40))
    across, turn = np.sqrt(1 - height**2), phi - np.pi / 4
    gamma = across * np.sin(turn), across * np.cos(turn), height
    sphere.plot_wireframe(*gamma, rcount=12, ccount=24, color="0.85", lw=0.5)
    rates = flow(parameters, gamma)
    turning = (gamma[1] * rates[0] - gamma[0] * rates[1]) / across**2
    chart.streamplot(phi, height, turning, rates[2], color="0.8", linewidth=0.6)


def equilibria_study(name: str, longest: float) -> Study:
    """List and draw a scene's equilibria, and limit cycles with periods up to `longest` [s]."""
    scene = steady_scene(name, "an equilibrium")
    if scene.rolling == "classical":
        return _classical(scene)
    # Here (4.1) is zero everywhere, so every point of the sphere is a fixed point.
    if not np.any([scene.parameters.Omega, scene.parameters.K]):
        raise InputError(
            f"{scene.name}: nothing turns inside (Ω = 0, K = 0), so a ball that starts from rest "
            f"stays at rest; 'robotball dynamics section {name}' shows how it rolls"
        )
    return _rubber(scene, longest)


def _classical(scene: Scene) -> Study:
    """List the straight motion at the scene's γ: a classical ball has one at every γ."""
    gamma = rotation_matrix(level_starts(scene, 1, 0)[0])[0, 2]
    line = straight_motion(scene.parameters, gamma)
    table = Table("", "γ", "eigenvalues [1/s]", "", box=box.SIMPLE_HEAD)
    table.add_row(*_straight_cells(line, ""))
    momentum = f"M = ({_join(line.momentum)}) kg m²/s; γ in principal axes:"
    above = "A classical ball can roll straight on at any γ. At the γ of the scene it has"
    record = {"scene": scene.name, **_found_record((), None, (), ((line, ""),))}
    return Study(scene.name, None, ["equilibria"], (), record, [above, momentum, table])


def _rubber(scene: Scene, longest: float) -> Study:
    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    with progress_bar(3) as progress:
        progress(0, f"{scene.name}: fixed points")
        points, circle = fixed_points(ball), fixed_circle(ball)
        points.sort(key=lambda point: name_of(ball, point.gamma))
        # With M = 0 a straight line is already listed as a fixed point. With Ω = 0 the ball does
        # not move along the line.
        motions = straight_motions(ball, f) if f > 0 and np.any(ball.Omega) else []
        lines = [(line, name_of_line(ball, line.gamma)) for line in motions]
        progress(1, f"{scene.name}: limit cycles")
        cycles = limit_cycles(ball, longest) if longest > 0 else []
        progress(2, f"{scene.name}: picture")
        picture = portrait(scene.title, ball, points, circle, cycles)
    known = [(name_of(ball, p.gamma), p, contact_path(ball, p.gamma)) for p in points]
    table = Table("", "γ", "eigenvalues [1/s] or multiplier", "", box=box.SIMPLE_HEAD)
    rows = [_point_cells(point, ball.a) for point in known]
    if circle is not None:
        rows.append(_half_circle_cells(circle, "Σ_s", 0.0, "attracts"))
        rows.append(_half_circle_cells(circle, "Σ_u", np.pi / 2, "repels"))
    rows += [*map(_cycle_cells, cycles), *(_straight_cells(*line) for line in lines)]
    for cells in rows:
        table.add_row(*cells)
    shown: list[Table | str] = [
        "Fixed points and cycles of the motion from rest (M = 0); γ in principal axes."
    ]
    if lines:
        shown.append(f"The straight-line motions have the M² of the scene, {f:g} (kg m²/s)².")
    # A check that no point is missing, by the Poincaré–Hopf theorem.
    indices = f"The indices of the points add up to {index_sum(points)}"
    if circle is not None:
        indices += f"; the circle (Ω, γ) = 0 adds {circle.index}, which makes 2"
    below = [f"{indices}. On a sphere the sum must be 2."]
    if limit := stability_limit(ball):
        below.append(f"Two straight-line motions are stable where M² < {limit:.6g} (kg m²/s)².")
    if not np.any(ball.Omega):
        below.append("Ω = 0: every motion from rest is closed and does not attract others.")
    record = {"scene": scene.name, **_found_record(known, circle, cycles, lines)}
    shown += [table, *below]
    return Study(scene.name, None, ["equilibria"], (), record, shown, picture)
