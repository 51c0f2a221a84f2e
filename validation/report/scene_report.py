"""Report scenes that were compared: agreement, plots, a view, settings, how to repeat it."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from itertools import groupby, repeat
from pathlib import Path

import numpy as np

from robotball import Motion, scene_toml
from robotball.errors import counted
from robotball.motion import versions
from robotball.rotations import Array
from robotball.view.lines import label_of, line_looks
from robotball.view.web import view_fragment, view_head

from ..agreement import Agreement
from ..output import known, scientific
from ..plots import framed
from ..results import OWN_FILE, growth_of, needs
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
_Columns = tuple[Array, Array, Array | None]  # x, y, and the times where x is something else
_NONE: _Columns = (np.empty(0), np.empty(0), None)  # of the equations, where errors are drawn
_CONSTANT = 1e-9  # part of its size by which a constant may vary
_HIDDEN = 0.01  # part of a curve's range within which another one is not seen beside it


def report(agreements: Sequence[Agreement], command: str, film: Path | None = None) -> str:
    """Return the whole page; agreements of one scene stand together.

    command: what makes it again; film: the mp4 of the first scene, above its 3-D views.
    """
    groups = [list(group) for _, group in groupby(agreements, key=lambda each: each.scene.name)]
    names = ", ".join(group[0].scene.name for group in groups)
    good = sum(each.agrees for each in agreements)
    theory, engine = agreements[0].theory.engine, agreements[0].motion.engine
    engines = {each.motion.engine.name: each.motion.engine.version for each in agreements}
    body = [
        f"<h1>{escape(f'Rolling balls: {names}')}</h1>",
        paragraph(
            f"{counted(len(groups), 'scene')}, run by {engine.name} and by the {theory.name}. "
            f"{counted(len(agreements), 'comparison')}: {good} within the tolerance."
        ),
        *(part for i, group in enumerate(groups) for part in _scene(group, None if i else film)),
        "<h2>How to repeat it</h2>",
        f"<pre>{escape(command)}</pre>",
        folded("Versions", plain(versions() | engines), short=True),
    ]
    return page(f"robotball: {names}", body, view_head())


def _scene(group: Sequence[Agreement], film: Path | None) -> list[str]:
    first = group[0]
    scene, theory = first.scene, first.theory
    shown = _views(group)
    if film:
        source = embedded(film.read_bytes(), "video/mp4")
        shown = f'<video controls muted playsinline src="{source}"></video>{shown}'
    # A scene file holds no links, no shell that is not symmetric, and no controller.
    file = "" if scene.ball.general else scene_toml(replace(scene, controller=None))
    without = ", without its controller" if scene.controller else ""
    grown = [] if first.loop_growth is None else [first.loop_growth]
    return [
        f"<h2>{escape(scene.name)}</h2>",
        paragraph(scene.title),
        paragraph(
            f"{scene.rolling} rolling: {_ROLLING[scene.rolling]}; {theory.times[-1]:g} s; path "
            f"{theory.path_length:.4g} m; radius {scene.ball.radius:.4g} m; mass "
            f"{scene.ball.mass:.4g} kg.",
            "faint",
        ),
        "<h3>Agreement</h3>",
        '<div class="charts"><div>',
        *(paragraph(sentence(each), VERDICTS[each.agrees]) for each in group),
        *(paragraph(f"In the loop {growth_of(growth)}.", "faint") for growth in grown),
        f"</div>{_paths(group)}</div>",
        _ball_numbers(group),
        "<h3>3-D view</h3>",
        shown,
        paragraph(OWN_FILE.format(scene.source), "faint") if scene.ball.general else "",
        "<h3>Errors</h3>",
        f'<div class="charts">{_errors(group)}</div>',
        "<h3>Friction and motors</h3>",
        paragraph(friction_needed(theory)),
        _loads(group),
        "<h3>What was run</h3>",
        *(
            folded(f"Settings of {each.settings.name}", plain(each.settings.plain()), short=True)
            for each in group
        ),
        folded(f"The scene's file{without}", f"<pre>{escape(file)}</pre>") if file else "",
    ]


def sentence(agreement: Agreement) -> str:
    """Return the verdict in words and numbers, with the bound."""
    start = f"{label_of(agreement.motion)}: {agreement.verdict}."
    if not agreement.finished:
        return f"{start} The run ended at {agreement.end:.4g} s."
    apart, error = float(agreement.path_errors.max()), agreement.path_error
    return (
        f"{start} The two contact points are at most {apart:.2g} m apart, which is "
        f"{scientific(error)} of the path; the tolerance is {agreement.tolerance:g}."
    )


def _ball_numbers(group: Sequence[Agreement]) -> str:
    rows = []
    for each in group:
        errors = each.path_error, each.gamma_error, each.attitude_error, each.momentum_error
        given = each.settings.plain().get("sliding_friction", "-")
        part = known(each.report.friction_used.max(initial=0.0))
        used = "-" if part is None else f"{100 * part:.3g} %"
        before = each.settings.name, f"{each.report.timestep * 1e3:.3g}", f"{each.tolerance:g}"
        rows.append((*before, *map(scientific, errors), given, used))
    headings = ("preset", "step [ms]", "tolerance", *_ERRORS, "friction", "used")
    words = "; ".join(f"{name}: {meaning}" for name, meaning in _ERRORS.items())
    words += "; friction: the plane's coefficient (one far above 1 is no material's: it keeps the "
    words += "model from slipping), and the part of its limit used at most"
    words += "; naive: the engine as it comes" * any(e.settings.name == "naive" for e in group)
    own = group[0].reference_error
    if own is not None:
        words += f". The reference's own path error is {scientific(own)}"
    return table(headings, rows) + paragraph(f"{words}.", "faint")


def _views(group: Sequence[Agreement]) -> str:
    """Return 3-D views of the runs beside the equations, one at a time as the reader chooses."""
    # A run that broke off in its first step has nothing to show.
    moving = [each for each in group if len(each.motion.times) > 1]
    options = "".join(f"<option>{text(each.settings.name)}</option>" for each in moving)
    views = [f"<template>{view_fragment([each.motion, each.theory])}</template>" for each in moving]
    choice = f"<label>Settings <select>{options}</select></label>{''.join(views)}<div></div>"
    words = "Two balls of one start are drawn side by side here; a film has each at its own place."
    return f'<div class="views">{choice}</div>{paragraph(words, "faint")}' if moving else ""


def _paths(group: Sequence[Agreement]) -> str:
    lines = _lines(group, [(*each.contact_point.T, each.times) for each in _motions(group)])
    note = "A metre is as long on both axes. The dot is the start; a cross, where a run breaks off."
    caption = "Path of the contact point"
    return plot(caption, lines, "X [m]", "Y [m]", note, frame=framed(group))


def _errors(group: Sequence[Agreement]) -> str:
    """Return plots of the runs' errors, without the exact zero that they start from."""
    series = (
        ("Distance of the two contact points", "distance [m]", [e.path_errors for e in group]),
        ("Error of the momentum M", "error of M, relative", [e.momentum_errors for e in group]),
    )
    drawn = ""
    for caption, label, values in series:
        times = (each.motion.times[1:] for each in group)
        lines = _lines(group, [_NONE, *zip(times, (each[1:] for each in values), repeat(None))])
        drawn += plot(caption, lines, "time [s]", label, log=True) if lines else ""
    return drawn


def _loads(group: Sequence[Agreement]) -> str:
    """Return the friction needed, and the torque, rate and power of each motor.

    A constant is a number. Of curves that hide one another their difference is drawn.
    """
    motions = _motions(group)
    series = [("Friction", "coefficient", "", [each.loads.sliding_friction for each in motions])]
    # A hinge that nothing drives has no torque to plot.
    for i in np.flatnonzero(motions[0].loads.motor_torques.any(axis=0)):
        name = group[0].scene.hinges[i].name
        torques = [each.loads.motor_torques[:, i] for each in motions]
        series += [
            (f"Torque of {name}", "torque", "N m", torques),
            (f"Rate of {name}", "rate", "rad/s", [each.hinge_rates[:, i] for each in motions]),
            (f"Power of {name}", "power", "W", [each.motor_powers[:, i] for each in motions]),
        ]
    said, drawn = "", ""
    for caption, quantity, unit, values in series:
        exact, times = values[0], [each.times for each in motions]
        low, high, most = float(exact.min()), float(exact.max()), float(np.abs(exact).max())
        off = [np.abs(each - exact[: len(each)]) for each in values[1:]]
        # Of runs that broke off in their first step nothing is known.
        worst = max((float(each.max()) for each in off if each.size), default=np.inf)
        label, of = (f"{quantity} [{unit}]", f" {unit}") if unit else (quantity, "")
        if high - low <= _CONSTANT * most and worst <= _HIDDEN * most:
            own = f"{caption}: {exact[0]:.4g}{of} throughout"
            said += paragraph(f"{own}; the runs differ by at most {worst:.1g}{of}.")
        elif worst <= _HIDDEN * (high - low):  # a run's curve would hide in that of the equations
            lines = _lines(group, [_NONE, *zip(times[1:], off, repeat(None))])
            caption += f": from {low:.3g} to {high:.3g}{of}; how far the runs are off"
            drawn += plot(caption, lines, "time [s]", f"difference of {label}", log=True)
        else:
            lines = _lines(group, [*zip(times, values, repeat(None))])
            caption += f": at most {most:.3g}{of}"
            drawn += plot(caption, lines, "time [s]", label, reach=most)
    return f'{said}<div class="charts">{drawn}</div>'


def _motions(group: Sequence[Agreement]) -> list[Motion]:
    return [group[0].theory, *(each.motion for each in group)]


def _lines(group: Sequence[Agreement], columns: Sequence[_Columns]) -> list[Line]:
    """Return a line of each motion's columns, where there are numbers."""
    finished = (True, *(each.finished for each in group))
    return [
        Line(look, *each, width=1.8 if look.marker else 5.0, broken=not whole)
        for look, each, whole in zip(line_looks(_motions(group)), columns, finished, strict=True)
        if np.isfinite(each[1]).any()
    ]


def friction_needed(theory: Motion) -> str:
    """Return a sentence on the friction that the motion needs."""
    need = needs(theory)
    words = f"By the {theory.engine.name} the motion needs a coefficient of sliding friction of "
    spin = f" To keep it from spinning takes a torsional one of {need['torsional_friction']:.3g} m."
    return f"{words}{need['sliding_friction']:.3g}." + spin * (theory.scene.rolling == "rubber")
