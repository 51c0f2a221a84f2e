"""Report compared scenes: agreement, plots, 3-D views, settings, and the command."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from itertools import chain, groupby, repeat
from pathlib import Path

import numpy as np

from robotball import Motion, scene_toml
from robotball.errors import counted
from robotball.motion import ReferenceMotion, versions
from robotball.robot.controllers import SENSORS
from robotball.rotations import Array
from robotball.view.tracks import LineStyle, label_of, line_looks, slips_of
from robotball.view.web import view_fragment, view_head

from ..agreement import Agreement
from ..margins import WORKS, Margin, Margins
from ..output import known, scientific
from ..plots import framed
from ..results import NAIVE, OWN_FILE, growth_of, needs
from . import VERDICTS, embedded, folded, page, paragraph, plain, plot, table, text
from .chart import Line

_ERRORS = {
    "path error": "the largest distance of the two contact points, over the path's length",
    "γ error": "the largest angle between the two γ, the vertical as the frame sees it [rad]",
    "attitude error": "the largest angle between the two attitudes [rad]",
    "momentum error": "the largest difference of the two momenta M, over the size of M",
}
_ROLLING = {
    "rubber": "the ball neither slips nor spins about the vertical",
    "classical": "the ball does not slip, and may spin about the vertical",
}
_MARGIN = (
    "Growth of a small disturbance of the start from the second quarter of the run to its second "
    f"half. The loop works up to {WORKS:g}-fold. Cross: a run breaks off or does not settle."
)
_UNITS = {**SENSORS, "attitude": "1", "command": "as its motor"}
_Columns = tuple[Array, Array, Array | None]  # x, y, and the times if x is not the time
_NONE: _Columns = (np.empty(0), np.empty(0), None)  # columns of the reference in plots of errors
_CONSTANT = 1e-9  # relative variation of a quantity that counts as constant
_HIDDEN = 0.01  # of a quantity: runs whose difference from a constant is smaller are printed


def report(
    agreements: Sequence[Agreement],
    command: str,
    film: Path | None = None,
    margins: Margins | None = None,
) -> str:
    """Return the page of agreements, grouped by scene.

    `command` is the command that makes the page. `film` is an mp4 of the first scene. `margins` are
    the margins of closed loops, by the name of the scene.
    """
    groups = [list(group) for _, group in groupby(agreements, key=lambda run: run.scene.name)]
    names = ", ".join(group[0].scene.name for group in groups)
    good = sum(run.agrees for run in agreements)
    theory, engine = agreements[0].theory.engine, agreements[0].motion.engine
    engines = {run.motion.engine.name: run.motion.engine.version for run in agreements}
    body = [
        f"<h1>{escape(f'Rolling balls: {names}')}</h1>",
        paragraph(
            f"{counted(len(groups), 'scene')}: {engine.name} compared with the {theory.name}. "
            f"{counted(len(agreements), 'comparison')}: {good} within the tolerance."
        ),
        *chain.from_iterable(
            map(_scene, groups, chain([film], repeat(None)), repeat(margins or {}))
        ),
        "<h2>How to repeat it</h2>",
        f"<pre>{escape(command)}</pre>",
        folded("Versions", plain(versions() | engines), short=True),
    ]
    return page(f"robotball: {names}", body, view_head())


def _scene(group: Sequence[Agreement], film: Path | None, margins: Margins) -> list[str]:
    first = group[0]
    scene, theory = first.scene, first.theory
    shown = _views(group)
    if film:
        source = embedded(film.read_bytes(), "video/mp4")
        shown = f'<video controls muted playsinline src="{source}"></video>{shown}'
    # A scene file cannot have links, an asymmetric shell, or a controller.
    file = "" if scene.ball.general else scene_toml(replace(scene, controller=None))
    without = ", without its controller" if scene.controller else ""
    grown = [] if first.loop_growth is None else [first.loop_growth]
    rolling = "the ball slips where rolling needs more friction"
    if not slips_of(theory):
        rolling = _ROLLING[scene.rolling]
    return [
        f"<h2>{escape(scene.name)}</h2>",
        paragraph(scene.title),
        paragraph(
            f"{scene.rolling} rolling: {rolling}; {theory.times[-1]:g} s; path "
            f"{theory.path_length:.4g} m; radius {scene.ball.radius:.4g} m; mass "
            f"{scene.ball.mass:.4g} kg.",
            "faint",
        ),
        paragraph(_speed_and_tilt(theory)),
        "<h3>Agreement</h3>",
        '<div class="charts"><div>',
        *(paragraph(sentence(run), VERDICTS[run.agrees]) for run in group),
        *map(paragraph, dict.fromkeys(filter(None, map(_slip_sentence, group)))),
        *(paragraph(f"Closed loop: {growth_of(growth)}.", "faint") for growth in grown),
        f"</div>{_paths(group)}</div>",
        _ball_numbers(group),
        "<h3>3-D view</h3>",
        shown,
        paragraph(OWN_FILE.format(scene.source), "faint") if scene.ball.general else "",
        "<h3>Errors</h3>",
        f'<div class="charts">{_errors(group)}</div>',
        "<h3>Friction and motors</h3>",
        "" if slips_of(theory) else paragraph(friction_needed(theory)),
        _loads(group),
        _closed_loop(group, margins.get(scene.name, ())),
        "<h3>Settings and scene</h3>",
        *(
            folded(f"Settings of {run.settings.name}", plain(run.settings.plain()), short=True)
            for run in group
        ),
        folded(f"The scene's file{without}", f"<pre>{escape(file)}</pre>") if file else "",
    ]


def _speed_and_tilt(theory: Motion) -> str:
    steps = np.linalg.norm(np.diff(theory.contact_point, axis=0), axis=1)
    speeds = [0.0, *(steps / np.diff(theory.times))]  # a motion may end at its first sample
    tilt = np.degrees(np.arccos(np.clip(theory.gamma[:, 2].min(), -1.0, 1.0)))
    speed = f"Speed of the ball: at most {max(speeds):.3g} m/s, at the end {speeds[-1]:.3g} m/s. "
    return f"{speed}The frame tilts by at most {tilt:.3g}°."


def sentence(agreement: Agreement) -> str:
    """Return the verdict with the errors and the tolerance."""
    start = f"{label_of(agreement.motion)}: {agreement.verdict}."
    if not agreement.finished:
        return f"{start} The run ended at {agreement.end:.4g} s."
    apart, error = float(agreement.path_errors.max()), agreement.path_error
    return (
        f"{start} The two contact points are at most {apart:.2g} m apart, "
        f"{scientific(error)} of the path; the tolerance is {agreement.tolerance:g}."
    )


def _slip_sentence(agreement: Agreement) -> str:
    """Return the effect of limited friction on the motion, "" if friction suffices for rolling."""
    if (slip := agreement.slip) is None:
        return ""
    whose = label_of(agreement.motion) if slip.of_settings else "Friction of the scene"
    return f"{whose}: {slip}."


def _ball_numbers(group: Sequence[Agreement]) -> str:
    rows = []
    for run in group:
        errors = run.path_error, run.gamma_error, run.attitude_error, run.momentum_error
        coefficient = run.scene.friction.sliding
        if coefficient is None:
            coefficient = run.settings.plain().get("sliding_friction", "-")
        part = known(run.report.friction_used.max(initial=0.0))
        used = "-" if part is None else f"{100 * part:.3g} %"
        settings = run.settings.name, f"{run.report.timestep * 1e3:.3g}", f"{run.tolerance:g}"
        rows.append((*settings, *map(scientific, errors), coefficient, used))
    headings = ("preset", "step [ms]", "tolerance", *_ERRORS, "friction", "used")
    meanings = [f"{name}: {meaning}" for name, meaning in _ERRORS.items()]
    meanings.append(
        "friction: the coefficient of the plane (a value far above 1 prevents slip of the model "
        "and is not a material's value), and the largest fraction of its limit that is used"
    )
    if any(run.settings.name == "naive" for run in group):
        meanings.append(NAIVE)
    if (error := group[0].reference_error) is not None:
        meanings.append(f"the reference has a path error of {scientific(error)}")
    return table(headings, rows) + paragraph(f"{'; '.join(meanings)}.", "faint")


def _views(group: Sequence[Agreement]) -> str:
    """Return 3-D views of the runs and the reference; the reader selects one."""
    # A run that failed in its first step has no view.
    moving = [run for run in group if len(run.motion.times) > 1]
    options = "".join(f"<option>{text(run.settings.name)}</option>" for run in moving)
    views = [f"<template>{view_fragment([run.motion, run.theory])}</template>" for run in moving]
    choice = f"<label>Settings <select>{options}</select></label>{''.join(views)}<div></div>"
    remark = "Balls with the same start are drawn side by side here; a film overlays them."
    return f'<div class="views">{choice}</div>{paragraph(remark, "faint")}' if moving else ""


def _paths(group: Sequence[Agreement]) -> str:
    paths = [(*motion.contact_point.T, motion.times) for motion in _motions(group)]
    lines = _lines(group, paths)
    note = "Both axes have the same scale. Dot: start. Cross: end of a run that broke off."
    caption = "Path of the contact point"
    slips = slips_of(group[0].theory)
    return plot(caption, lines, "X [m]", "Y [m]", note, frame=framed(group), slips=slips)


def _errors(group: Sequence[Agreement]) -> str:
    """Return plots of the errors, without the start, where they are exactly 0."""
    series = (
        ("Distance of the two contact points", "distance [m]", [e.path_errors for e in group]),
        ("Error of the momentum M", "error of M, relative", [e.momentum_errors for e in group]),
    )
    drawn = ""
    for caption, label, values in series:
        times = (run.motion.times[1:] for run in group)
        lines = _lines(group, [_NONE, *zip(times, (error[1:] for error in values), repeat(None))])
        slips = slips_of(group[0].theory)
        drawn += plot(caption, lines, "time [s]", label, log=True, slips=slips) if lines else ""
    return drawn


def _loads(group: Sequence[Agreement]) -> str:
    """Return plots of the needed friction, and of torque, rate and power of each motor.

    Constants are printed instead.
    """
    motions = _motions(group)
    theory, slips = group[0].theory, slips_of(group[0].theory)
    series = [("Friction", "coefficient", "", [m.loads.sliding_friction for m in motions])]
    if isinstance(theory, ReferenceMotion) and theory.slip is not None:
        speeds = [np.hypot(*theory.slip[:, :2].T), *(run.report.slip for run in group)]
        series.append(("Slip", "speed of the contact's point", "m/s", speeds))
    for i in np.flatnonzero(motions[0].loads.motor_torques.any(axis=0)):
        name = group[0].scene.hinges[i].name
        torques = [motion.loads.motor_torques[:, i] for motion in motions]
        series += [
            (f"Torque of {name}", "torque", "N m", torques),
            (f"Rate of {name}", "rate", "rad/s", [m.hinge_rates[:, i] for m in motions]),
            (f"Power of {name}", "power", "W", [m.motor_powers[:, i] for m in motions]),
        ]
    constants, drawn = "", ""
    for caption, quantity, unit, values in series:
        exact, times = values[0], [motion.times for motion in motions]
        low, high, most = float(exact.min()), float(exact.max()), float(np.abs(exact).max())
        errors = [np.abs(value - exact[: len(value)]) for value in values[1:]]
        # Runs that failed in their first step have no values.
        worst = max((float(error.max()) for error in errors if error.size), default=np.inf)
        label, suffix = (f"{quantity} [{unit}]", f" {unit}") if unit else (quantity, "")
        differ = f"; the runs differ by at most {worst:.1g}{suffix}" if np.isfinite(worst) else ""
        if high - low <= _CONSTANT * most and worst <= _HIDDEN * most:
            constant = f"{caption}: {exact[0]:.4g}{suffix}, constant"
            constants += paragraph(f"{constant}{differ}.")
        else:
            lines = _lines(group, [*zip(times, values, repeat(None))])
            caption += f": at most {most:.3g}{suffix}{differ}"
            drawn += plot(caption, lines, "time [s]", label, reach=most, slips=slips)
    return f'{constants}<div class="charts">{drawn}</div>'


def _closed_loop(group: Sequence[Agreement], margins: Sequence[Margin]) -> str:
    """Return plots of the margins, commands and readings of a controller, "" without one."""
    motions, said, drawn = _motions(group), "", ""
    for margin in margins:
        said += paragraph(f"The loop {margin}.", VERDICTS[not np.isnan(margin.works)])
        x, y = np.array(sorted(margin.tried.items())).T
        growth = Line(LineStyle("growth", "#0072B2"), x, y, broken=not np.isfinite(y[-1]))
        lines = [growth, Line(LineStyle("limit", "#D55E00", (6, 2)), x, 0 * x + WORKS)]
        caption, label = f"Margin: {margin.what}", "growth of a disturbance"
        drawn += plot(caption, lines, margin.what, label, _MARGIN, log=True)
    for name in {name: 1 for call in motions[0].calls for name in call if name != "time"}:
        times, values = (
            [np.array([call.get(key, np.nan) for call in run.calls]) for run in motions]
            for key in ("time", name)
        )
        lines = _lines(group, [*zip(times, values, repeat(None))])
        label, reach = f"{name} [{_UNITS[name.partition('[')[0]]}]", np.nanmax(np.abs(values[0]))
        drawn += plot(name, lines, "time [s]", label, reach=float(reach))
    return f'<h3>Closed loop</h3>{said}<div class="charts">{drawn}</div>' if drawn else ""


def _motions(group: Sequence[Agreement]) -> list[Motion]:
    return [group[0].theory, *(run.motion for run in group)]


def _lines(group: Sequence[Agreement], columns: Sequence[_Columns]) -> list[Line]:
    """Return the lines of the motions that have numbers in their columns."""
    finished = (True, *(run.finished for run in group))
    return [
        Line(look, *points, width=1.8 if look.marker else 5.0, broken=not whole)
        for look, points, whole in zip(line_looks(_motions(group)), columns, finished, strict=True)
        if np.isfinite(points[1]).any()
    ]


def friction_needed(theory: Motion) -> str:
    """Describe the friction that the motion needs."""
    need = needs(theory)
    sliding = f"a coefficient of sliding friction of {need['sliding_friction']:.3g}"
    torsional = f" and, to prevent spin, a torsional one of {need['torsional_friction']:.3g} m"
    rubber = theory.scene.rolling == "rubber"
    return f"According to the {theory.engine.name}, rolling needs {sliding}{torsional * rubber}."
