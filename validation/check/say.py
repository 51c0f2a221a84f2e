"""Say the outcome of a check: lines, a table, a record, a picture, a page and the mended file."""

import difflib
from collections.abc import Iterator, Sequence
from html import escape as html_escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape

from robotball.engines.mujoco import LABEL
from robotball.motion import Motion, versions
from robotball.robot.drives import as_drive
from robotball.rotations import Array
from robotball.view.tracks import PRESET_LOOKS
from robotball.view.web import view_fragment, view_head

from .. import report
from ..output import known, panels, scientific
from ..study import Column, Study, table_of
from .ablate import Checked
from .observe import distances, unusual_numbers
from .propose import collisions

COLUMNS = (
    Column("change", "change", words=True),
    Column("path error\nwithout it", "without"),
    Column("what it mends", "words", words=True),
)
_LEAST_PATH = 0.1  # of the radius: a slip over a shorter path is not worth a line
_LAG = 0.1  # of the command: a smaller tracking error is not worth a line
_MOST_LINES = 60  # of a difference


def study_of(checked: Checked, notes: Sequence[str]) -> Study:
    """Return the table, record, picture and lines of a check. notes: lines to begin with."""
    seen, theory = checked.observation, checked.observation.theory
    file = seen.user.robot.path
    rows = [_row(f"+ {change.name}", change.words, without) for change, without in checked.needed]
    rows += [_row(f"({change.name})", change.words) for change in checked.spared]
    lines = [*notes, *_verdict(checked), *_symptoms(checked)]
    if checked.needed:
        missed = f", more than {seen.accuracy:g}" if checked.mended_error > seen.accuracy else ""
        lines.append(f"mended: path error {scientific(known(checked.mended_error))}{missed}")
    # The error of a motion that breaks off, or in which nothing moves, has no meaning.
    meant = seen.judged and not seen.symptoms.failure
    others = {name: error for name, error in seen.errors.items() if name != theory.scene.rolling}
    record = {
        "file": str(file),
        "agrees": checked.agrees,
        "rolling": theory.scene.rolling,
        "duration": float(theory.times[-1]),
        "accuracy": seen.accuracy,
        "path_error": known(seen.error) if meant else None,
        "since": seen.since,
        "fails": seen.failure,
        "ends_early": checked.short,
        "other_rolling": {name: known(error) for name, error in others.items()},
        "causes": causes_of(checked),
        "lines": lines,
        "changes": rows,
        "mended_error": known(checked.mended_error),
    }
    shown = [f"[bold]{escape(file.name)}[/]", *map(escape, lines)]
    tables = [table_of(COLUMNS, rows)] if checked.needed else []
    return Study(file.stem, None, ["check"], rows, record, [*shown, *tables], _picture(checked))


def _row(change: str, words: str, without: float | None = None) -> dict[str, Any]:
    return {"change": change, "without": known(without), "words": words}


def causes_of(checked: Checked) -> list[str]:
    """Return the causes of an error, the most important first. A right file may be unusual.

    Unusual numbers come first. But an unusual gear, which acts on the reference too, comes last
    if changes to the file mend it.
    """
    seen, needed = checked.observation, checked.needed
    causes = []
    for change, error in needed:
        worth = f"path error {scientific(error)}" if np.isfinite(error) else "diverges"
        causes.append(f"{change.name}: {change.words} ({worth} without this change)")
    causes += [checked.short] if checked.short and seen.theory.ended else []
    rolls = seen.theory.path_length >= seen.user.robot.radius
    helped = rolls and needed and checked.mended_error <= seen.accuracy
    for name, words in reversed([*unusual_numbers(seen.user, seen.theory.scene)]):
        causes.insert(len(causes) if name == "gear" and helped else 0, f"{name}: {words}")
    if not causes and seen.judged and not checked.agrees and not checked.short:
        perhaps = "a stiff joint or a high gain may need a shorter timestep"
        if not seen.symptoms.diverged:
            perhaps = "any two paths part if the motion is sensitive, so try a shorter --duration"
        causes.append(f"unknown: no change of the recipe helps; {perhaps}")
    return causes


def _verdict(checked: Checked) -> Iterator[str]:
    """Yield whether the file agrees, or how it fails, and the first cause."""
    seen, accuracy = checked.observation, checked.observation.accuracy
    theory, radius = seen.theory, seen.user.robot.radius
    length, end = theory.path_length, theory.times[-1]
    unit = f"a path of {length:.3g} m" if length >= radius else f"the radius of {radius:.3g} m"
    error = f"Path error {scientific(known(seen.error))} of {unit} in {end:.3g} s; "
    error += f"the accuracy asked for is {accuracy:g}"
    if seen.failure:
        verdict = seen.failure
    elif seen.error > accuracy:
        verdict = f"does not agree. {error}, exceeded from t = {seen.since:.2g} s on"
    elif checked.short:
        verdict = f"no verdict on {checked.duration:.3g} s. {error}"
    else:
        verdict = f"agrees. {error}"
    yield f"unmodified: {verdict}."
    if checked.short:
        yield checked.short
    if seen.judged:
        errors = {name: scientific(known(error)) for name, error in seen.errors.items()}
        nearest = theory.scene.rolling
        others = "".join(f" ({name}: {it})" for name, it in errors.items() if name != nearest)
        yield f"rolling: {nearest}{others}"
    for cause in causes_of(checked)[:1]:
        yield f"{'unusual' if checked.agrees else 'cause'}: {cause}"
    if checked.needed and checked.tried < end:
        yield f"causes are sought in the first {checked.tried:.3g} s"


def _symptoms(checked: Checked) -> Iterator[str]:
    """Yield facts about contacts, joints and servos that the path alone does not show.

    They are measured up to the failure of the file and the end of the reference.
    """
    seen, symptoms = checked.observation, checked.observation.symptoms
    measured, radius, scene = seen.motion.report, seen.user.robot.radius, seen.theory.scene
    rolls = seen.motion.times <= min(symptoms.until, seen.theory.times[-1])
    if (lost := np.isnan(measured.depth[rolls])).any() and not symptoms.failure:
        yield f"contact: lost for {lost.mean():.2%} of the time"
    points = seen.motion.contact_point[rolls]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length > _LEAST_PATH * radius:
        speed = length / seen.motion.times[rolls][-1]
        yield f"slip: {scientific(measured.slip[rolls].mean() / speed)} of its path"
        if scene.rolling == "rubber":
            spin = radius * np.abs(measured.spin[rolls]).mean() / speed
            yield f"spin: {scientific(spin)} of its path"
    for actuator in scene.actuators:
        commands = as_drive(actuator.command, scene.duration).rate(seen.theory.times)
        clipped = np.clip(commands, *actuator.within)
        if (beyond := clipped != commands).any():
            asked, limited = (values[np.argmax(beyond)] for values in (commands, clipped))
            yield f"control: {actuator.name} is {asked:.3g}; ctrlrange limits it to {limited:.3g}"
    if symptoms.delivered is not None and seen.judged and not symptoms.failure:
        declared = f"the file and the reference declare {scene.friction.rolling:g} m"
        yield f"rolling resistance: {declared}; the contact delivers {symptoms.delivered:.0%} of it"
    yield from (f"inside: {collision}" for collision in collisions(seen))
    for name, time_reached in symptoms.limits.items():
        if time_reached <= symptoms.until:
            yield f"limit: {name} reaches its range at t = {time_reached:.3g} s"
    for name, lag in symptoms.lag.items():
        if lag > _LAG and not symptoms.failure:
            yield f"servo: {name} has a tracking error of {lag:.0%} (root mean square)"


def difference(checked: Checked) -> list[str]:
    """Return the lines of a diff from the user's file to the mended file."""
    before, after = checked.source.splitlines(), checked.text.splitlines()
    lines = difflib.unified_diff(before, after, "unmodified", "mended", n=0, lineterm="")
    return [*lines][:_MOST_LINES]


def _picture(checked: Checked) -> Figure:
    """Draw the paths, and the path errors over time, of the file and the mended file."""
    seen, theory = checked.observation, checked.observation.theory
    colour, dashes, _ = PRESET_LOOKS["mended"]
    curves: list[tuple[str, Array, str, Any]] = [("unmodified", seen.path, LABEL.colour, "-")]
    if checked.needed:
        curves.append(("mended", checked.mended, colour, (0, dashes)))
    largest = [scientific(known(distances(path, theory).max())) for _, path, *_ in curves]
    titles = [f"{label} off by {it}" for (label, *_), it in zip(curves, largest, strict=True)]
    if seen.failure:
        titles[0] = f"unmodified: {seen.failure}"
    heading = f"{seen.user.robot.path.name}: {'; '.join(titles)}"
    figure, (left, right) = panels(heading, (11.0, 5.4), 1, 2)
    left.plot(*theory.contact_point.T, c=theory.engine.colour, lw=5, alpha=0.6, label="equations")
    for label, path, color, dash in curves:
        # Mark the end, because a path may end within another.
        last = np.flatnonzero(np.isfinite(path[:, 0]))[-1:].tolist()
        left.plot(*path[:, :2].T, ls=dash, marker="o", markevery=last, color=color, label=label)
        away = distances(path, theory)[1:]
        right.semilogy(theory.times[1:], away, ls=dash, color=color, label=label)
    left.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal", title="contact point")
    left.set_adjustable("datalim")
    if not np.any(theory.contact_point) or not np.nansum(np.abs(seen.path)):
        right.set_yscale("linear")
    right.axhline(seen.accuracy, color="gray", linestyle=":", label="asked for")
    right.set(xlabel="t [s]", title="path error over the path's length or the radius")
    left.legend()
    right.legend()
    return figure


def page_of(study: Study, checked: Checked, picture: Path, motions: Sequence[Motion]) -> str:
    """Return the HTML page of a check, with its picture and a view of the motions."""
    lines = study.record["lines"] if study.record else [""]
    cells = [[column.text(row) for column in COLUMNS] for row in study.rows]
    body = [
        f"<h1>{report.text(study.scene)}</h1>",
        *map(report.paragraph, lines),
        report.picture(picture),
        "<h2>3-D view</h2>",
        view_fragment(motions),
        "<h2>What each change is worth</h2>",
        report.table([column.header for column in COLUMNS], cells, "words"),
        "<h2>The changes</h2>",
        f'<pre class="wide">{html_escape(chr(10).join(difference(checked)))}</pre>',
        report.folded("Versions", report.plain(versions()), short=True),
    ]
    return report.page(f"robotball: check of {study.scene}", body, view_head())
