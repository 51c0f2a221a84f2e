"""Report scenes that were compared: agreement, plots, a view, settings, how to repeat it."""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from pathlib import Path

import numpy as np

from robotball import scene_toml
from robotball.film.web import view_fragment, view_head
from robotball.notebook import counted
from robotball.rotations import Array
from validation.agreement import Agreement
from validation.output import scientific, versions
from validation.report import embedded, folded, page, paragraph, plain, plot, table
from validation.report.chart import Line
from validation.results import needs

_DASHES = ("", "7 4", "2 3", "10 3 2 3")  # of lines in SVG: they differ without colour, too
_ERRORS = {
    "path error": "the largest distance of the two contact points, over the path's length",
    "γ error": "the largest angle between the two verticals [rad]",
    "attitude error": "the largest angle between the two attitudes [rad]",
    "momentum error": "the largest difference of the two M, over the size of M",
}


def report(agreements: Sequence[Agreement], command: str, film: Path | None = None) -> str:
    """Return the whole page; agreements of one scene stand together.

    command: what makes it again; film: the mp4 of the first agreement, in place of its 3-D view.
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
    return page(f"robotball: {names}", body, "" if film else view_head())


def _scene(group: Sequence[Agreement], film: Path | None) -> list[str]:
    first = group[0]
    scene, theory = first.scene, first.theory
    shown = ""
    if film:
        source = embedded(film.read_bytes(), "video/mp4")
        shown = f'<video controls muted playsinline src="{source}"></video>'
    elif len(first.motion.times) > 1:
        shown = view_fragment([first.motion, theory])
    file = f"<pre>{escape(scene_toml(scene))}</pre>" if not scene.ball.general else ""
    return [
        f"<h2>{escape(scene.name)}</h2>",
        paragraph(scene.title),
        paragraph(
            f"{scene.rolling} rolling; {theory.times[-1]:g} s; path {theory.path_length:.4g} m; "
            f"radius {scene.ball.radius:.4g} m; mass {scene.ball.mass:.4g} kg.",
            "faint",
        ),
        "<h3>Agreement</h3>",
        *(paragraph(sentence(e), f"verdict {'good' if e.agrees else 'bad'}") for e in group),
        _numbers(group),
        "<h3>To be looked at</h3>",
        shown,
        "<h3>Plots</h3>",
        f'<div class="charts">{"".join(_plots(group))}</div>',
        "<h3>Friction</h3>",
        *map(paragraph, friction_words(group)),
        "<h3>What was run</h3>",
        *(
            folded(f"Settings of {each.settings.name}", plain(each.settings.plain()), short=True)
            for each in group
        ),
        *([folded("The scene's file", file)] if file else []),
    ]


def sentence(agreement: Agreement) -> str:
    """Return the verdict in words and numbers, with the bound."""
    engine, name = agreement.motion.engine.name, agreement.settings.name
    start = f"{engine}, {name}: {agreement.verdict}."
    if not agreement.finished:
        return f"{start} The run ended at {agreement.end:.4g} s."
    apart, error = float(agreement.path_errors.max()), agreement.path_error
    return (
        f"{start} The two contact points are at most {apart:.2g} m apart, which is "
        f"{scientific(error)} of the path; the tolerance is {agreement.tolerance:g}."
    )


def _numbers(group: Sequence[Agreement]) -> str:
    rows = []
    for each in group:
        errors = each.path_error, each.gamma_error, each.attitude_error, each.momentum_error
        step = f"{each.report.timestep * 1e3:.3g}"
        rows.append((each.settings.name, step, *map(scientific, errors), f"{each.tolerance:g}"))
    headings = ("preset", "step [ms]", *_ERRORS, "tolerance")
    words = "; ".join(f"{name}: {meaning}" for name, meaning in _ERRORS.items())
    own = group[0].reference_error
    if own is not None:
        words += f". The reference's own path error is {scientific(own)}"
    return table(headings, rows) + paragraph(f"{words}.", "faint")


def _plots(group: Sequence[Agreement]) -> list[str]:
    theory = group[0].theory
    names = [theory.engine.name, *(f"{e.motion.engine.name}, {e.settings.name}" for e in group)]
    paths = [
        Line(
            name,
            each.engine.colour,
            each.contact_point[:, 0],
            each.contact_point[:, 1],
            dash=_DASHES[i % len(_DASHES)],
            width=1.8 if i else 4,  # the equations' path is wide below the others
            times=each.times,
        )
        for i, (name, each) in enumerate(
            zip(names, [theory, *(e.motion for e in group)], strict=True)
        )
    ]
    note = "A metre is as long on both axes."
    drawn = [plot("Path of the contact point", paths, "X [m]", "Y [m]", equal=True, note=note)]
    series = (
        ("Distance of the two contact points", "distance [m]", [e.path_errors for e in group]),
        ("Error of the momentum M", "error of M, relative", [e.momentum_errors for e in group]),
    )
    for caption, label, values in series:
        if lines := _over_time(group, values):
            drawn.append(plot(caption, lines, "time [s]", label, log=True))
    used = [each.report.friction_used for each in group]
    if all(len(each) for each in used):
        limit = Line("limit", "#808080", theory.times[[0, -1]], np.ones(2), dash="1 3", width=2.5)
        lines = [*_over_time(group, used), limit]
        note = "The part of the friction cone that the contact force needs. At 1 the ball slips."
        drawn.append(plot("Friction used", lines, "time [s]", "part of the limit", note=note))
    return drawn


def _over_time(group: Sequence[Agreement], values: Sequence[Array]) -> list[Line]:
    """Return lines without the exact zero that they start from, of runs that went on from there."""
    return [
        Line(
            each.settings.name,
            each.motion.engine.colour,
            each.motion.times[1:],
            np.abs(value[1:]),
            dash=_DASHES[i % len(_DASHES)],
        )
        for i, (each, value) in enumerate(zip(group, values, strict=True))
        if len(value) > 1
    ]


def friction_words(group: Sequence[Agreement]) -> list[str]:
    """Return sentences on the friction that the motion needs and that each settings give."""
    first, asked = group[0], needs(group[0].theory)
    sliding, torsional = asked["sliding_friction"], asked["torsional_friction"]
    words = [
        f"By the {first.theory.engine.name} the motion needs a coefficient of sliding friction of "
        f"{sliding:.3g}."
    ]
    if first.scene.rolling == "rubber":
        words[0] += f" So that it does not spin, it needs a torsional one of {torsional:.3g} m."
    for each in group:
        given = each.settings.plain().get("sliding_friction")
        most = float(each.report.friction_used.max(initial=0.0))
        gives = "" if given is None else f" the plane gives {given:g}, and"
        words.append(
            f"With the settings {each.settings.name}{gives} the run uses at most "
            f"{100 * most:.3g} % of the friction limit."
        )
    return words
