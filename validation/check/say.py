"""Say the outcome of a check: lines, a table, a record, a picture, a page and the mended file."""

import difflib
from collections.abc import Iterator, Sequence
from html import escape as html_escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from rich.markup import escape

from robotball.engines.mujoco import LABEL
from robotball.motion import Motion, versions
from robotball.user_model.robot_file import friction_source
from robotball.view.tracks import PRESET_LOOKS
from robotball.view.web import view_fragment, view_head

from .. import report
from ..output import known, panels, scientific
from ..slip import listed
from ..study import Column, Study, table_of
from .ablate import Checked
from .observe import Observation, distances, is_shock, resistance_per_deceleration, unusual_numbers
from .propose import collisions, limited_actuators, needed_friction, slip_causes, too_high_gain

COLUMNS = (
    Column("change", "change", words=True),
    Column("path error\nwithout it", "without"),
    Column("what it mends", "words", words=True),
)
_LEAST_PATH = 0.1  # of the radius: a slip over a shorter path is not worth a line
_LAG = 0.1  # of the command: a smaller tracking error is not worth a line
_AFTER = "0.6"  # grey
_EARLY = 0.05  # of the run: with an earlier fault, the axis of time is logarithmic
_MOST_LINES = 60  # of a difference


def study_of(checked: Checked, notes: Sequence[str]) -> Study:
    """Return the table, record, picture and lines of a check. notes: lines to begin with."""
    seen, theory = checked.observation, checked.observation.theory
    file = seen.user.robot.path
    causes = causes_of(checked)
    rows, lines = _rows(checked, causes), lines_of(checked, notes)
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
        "causes": causes,
        "lines": lines,
        "changes": rows,
        "mended_error": known(checked.mended_error),
    }
    shown = [f"[bold]{escape(file.name)}[/]", *map(escape, lines)]
    tables = [table_of(COLUMNS, rows)] if rows else []
    return Study(file.stem, None, ["check"], rows, record, [*shown, *tables], _picture(checked))


def lines_of(checked: Checked, notes: Sequence[str]) -> list[str]:
    """Return the lines of a check: the notes, the verdict, the symptoms and the mended error."""
    accuracy, causes = checked.observation.accuracy, causes_of(checked)
    lines = [*notes, *_verdict(checked, causes), *_symptoms(checked)]
    if checked.is_changed:
        error = checked.mended_error
        marked = any(row["change"].startswith("!") for row in _rows(checked, causes))
        todo = "mend what is marked !, and check again" if marked else "try a shorter --duration"
        missed = f", above {accuracy:g}: {todo}" if error > accuracy else ""
        words = f"path error {scientific(error)}{missed}" if np.isfinite(error) else "it diverges"
        lines.append(f"mended: {words}")
    return lines


def _rows(checked: Checked, causes: Sequence[str]) -> list[dict[str, Any]]:
    repairs = checked.observation.user.robot.repairs
    rows = [_row(f"+ {name}", words) for name, words in repairs.items()]
    rows += [_row(f"+ {change.name}", change.words, without) for change, without in checked.needed]
    named = {row["change"] for row in rows}
    parts = (cause.partition(": ") for cause in causes)
    rows += [_row(f"! {name}", words) for name, _, words in parts if f"+ {name}" not in named]
    rows += [_row(f"({change.name})", change.words) for change in checked.spared]
    return rows


def _row(change: str, words: str, without: float | None = None) -> dict[str, Any]:
    return {"change": change, "without": known(without), "words": words}


def causes_of(checked: Checked) -> list[str]:
    """Return the causes of an error, the most important first. A right file may be unusual.

    Unusual numbers come first. But those that the user may mean come last if changes to the file
    mend it.
    """
    seen, needed = checked.observation, checked.needed
    causes = []
    for change, error in needed:
        which = "your file" if seen.symptoms.diverged else "the mended contact"
        worth = f"path error {scientific(error)}" if np.isfinite(error) else f"{which} diverges"
        causes.append(f"{change.name}: {change.words} ({worth} without this change)")
    if checked.short and not checked.short.startswith("only"):
        causes.append(checked.short)
    rolls = seen.theory.slipping or seen.theory.path_length >= seen.user.robot.radius
    helped = (rolls or seen.symptoms.diverged) and needed and checked.mended_error <= seen.accuracy
    unusual = [*slip_causes(seen), *unusual_numbers(seen.user, seen.theory.scene)]
    unusual += limited_actuators(seen.theory)
    meant = dict.fromkeys(("gear", "ctrlrange", "forcerange"), True)
    meant["start"] = not is_shock(seen.user, seen.theory)
    meant["gravity"] = bool(seen.theory.slipping)
    meant["friction"] = seen.friction_worth < seen.error or seen.symptoms.diverged
    gain = too_high_gain(seen.user) if seen.symptoms.failure else None
    if gain and not any(change.name == "gain" for change, _ in needed):
        steps = f"; steps of at most {1e3 * gain.step:.2g} ms are stable" if gain.step else ""
        causes.insert(0, f"gain: {gain.words}{steps}")
    for name, words in reversed(unusual):
        causes.insert(len(causes) if helped and meant.get(name) else 0, f"{name}: {words}")
    # An unstable servo makes the ball slip, whatever the friction.
    names = [cause.partition(": ")[0] for cause in causes]
    if "gain" in names and "friction" in names[: names.index("gain")]:
        causes.insert(names.index("gain"), causes.pop(names.index("friction")))
    causes = [f"{name}: {words}" for name, words in seen.user.robot.repairs.items()] + causes
    if not causes and seen.judged and not checked.agrees and not checked.short:
        tried = ", ".join(dict.fromkeys(change.name for change in checked.spared))
        perhaps = "a stiff joint or a high gain may need a shorter timestep"
        if not seen.symptoms.diverged:
            perhaps = "if the motion is sensitive, any two paths diverge: try a shorter --duration"
        tried = f"the start, gains and inertias are right, and no change of {tried} helps"
        causes.append(f"unknown: {tried}; {perhaps}")
    return causes


def _verdict(checked: Checked, causes: Sequence[str]) -> Iterator[str]:
    """Yield whether the file agrees, or how it fails, and the first cause."""
    seen, accuracy = checked.observation, checked.observation.accuracy
    theory, radius = seen.theory, seen.user.robot.radius
    length, end = theory.path_length, theory.times[-1]
    unit = f"a path of {length:.3g} m" if length >= radius else f"the radius of {radius:.3g} m"
    error = f"Path error {scientific(known(seen.error))} of {unit} in {end:.3g} s; "
    error += f"the limit is {accuracy:g}"
    if seen.failure:
        verdict = seen.failure
    elif seen.error > accuracy:
        verdict = f"does not agree. {error}, exceeded from t = {seen.since:.2g} s on"
    elif checked.short:
        verdict = f"no verdict on {checked.duration:.3g} s. {error}"
    else:
        verdict = f"agrees. {error}"
    if repairs := seen.user.robot.repairs:
        yield f"unmodified: wrong before the first step: {'; '.join(repairs.values())}."
    yield f"{'repaired' if repairs else 'unmodified'}: {verdict}."
    if checked.short:
        yield checked.short
    if seen.judged:
        errors = {name: scientific(known(error)) for name, error in seen.errors.items()}
        nearest = theory.scene.rolling
        others = "".join(f" ({name}: {it})" for name, it in errors.items() if name != nearest)
        yield f"rolling: {nearest}{others}"
    # Friction that is too small is not an error of the contact, which may have another.
    friction = causes[:1] and causes[0].startswith("friction: it")
    many = 1 + bool(friction and checked.needed) + len(repairs) * bool(seen.failure)
    for cause in causes[:many]:
        yield f"{'unusual' if checked.agrees else 'cause'}: {cause}"
    yield from _slipping(seen)
    if checked.needed and checked.tried < end:
        yield f"causes are sought in the first {checked.tried:.3g} s"


def _slipping(seen: Observation) -> Iterator[str]:
    """Yield when the reference slips, and under which friction."""
    theory, robot = seen.theory, seen.user.robot
    if not theory.slipping:
        return
    part = sum(end - begin for begin, end in theory.slipping) / theory.times[-1]
    yield f"slips: {listed(theory.slipping)} ({part:.1%} of the time), as its friction implies"
    yield f"friction: {needed_friction(seen)}. {LABEL.name} takes {friction_source(robot)}"
    if not seen.failure:
        yield f"the file is {seen.error:.2%} off the path under Coulomb's law with this friction"


def _resistance(checked: Checked) -> Iterator[str]:
    """Yield why a ball never stops, and which rolling friction would stop it."""
    if (found := checked.resistance) is None:
        return
    condim, ratio = checked.observation.contact.dim, found.friction / found.deceleration
    yield f"never stops: keeps {found.speed:.3g} m/s, as condim {condim} does not resist rolling"
    line = f"third friction coefficient a r(1 + k)/g = {ratio:.3g} a"
    parts = " and ".join(f"{part:.0%} ({cone} cone)" for cone, part in found.delivered.items())
    seconds = found.speed / found.deceleration
    stops = f"{found.friction:.3g} stops the ball in {seconds:g} s; {LABEL.name} delivers {parts}"
    yield f"to stop: for a deceleration a take condim 6 and the {line}. {stops}"


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
    if length > _LEAST_PATH * radius and not (seen.theory.slipping or symptoms.diverged):
        speed = length / seen.motion.times[rolls][-1]
        yield f"slip: {scientific(measured.slip[rolls].mean() / speed)} of its path"
        if scene.rolling == "rubber":
            spin = radius * np.abs(measured.spin[rolls]).mean() / speed
            yield f"spin: {scientific(spin)} of its path"
    if symptoms.delivered is not None and seen.judged and not symptoms.failure:
        declared = f"the file and the reference declare {scene.friction.rolling:g} m"
        line = (
            f"rolling resistance: {declared}; the contact delivers {symptoms.delivered:.0%} of this"
        )
        if ratio := resistance_per_deceleration(scene):
            line += f". All of it slows the ball by {scene.friction.rolling / ratio:.2g} m/s²"
        yield line
    yield from _resistance(checked)
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
    """Draw the paths, and the path errors over time, of the file and the mended file.

    The file is grey from its first bad state on. If that comes early, the time is logarithmic.
    """
    seen, theory = checked.observation, checked.observation.theory
    end, radius, until = theory.times[-1], theory.scene.ball.radius, seen.symptoms.until
    name = "repaired" if seen.user.robot.repairs else "unmodified"
    compared = seen.motion.times <= end
    times, path = seen.motion.times[compared], seen.symptoms.path[compared]
    cross: dict[str, Any] = {"marker": "X", "ms": 11, "mec": "white"}
    curves = [(name, times, path, LABEL.colour, cross)]
    if seen.symptoms.failure:
        good = times < until
        curves = [("after its first bad state", times, path, _AFTER, cross)]
        curves += [(name, times[good], path[good], LABEL.colour, {})] * bool(good.any())
    if checked.needed:
        colour, dashes, _ = PRESET_LOOKS["mended"]
        style = {"ls": (0, dashes), "marker": "o"}
        curves.append(("mended", theory.times, checked.mended, colour, style))
    verdict = seen.failure or f"path error {scientific(known(seen.error))}"
    heading = f"{seen.user.robot.path.name}, {name}: {verdict.partition('. ')[0]}"
    if checked.needed:
        heading += f"; mended: path error {scientific(known(checked.mended_error))}"
    figure, (left, right) = panels(heading, (11.0, 5.4), 1, 2)
    left.plot(*theory.contact_point.T, c=theory.engine.colour, lw=5, alpha=0.6, label="equations")
    left.plot(
        *theory.contact_point[0],
        "o",
        color="black",
        mfc="none",
        ms=16,
        label="start (other marks: end)",
    )
    for label, times, path, colour, style in curves:
        # Mark the end, because a path may end within another.
        last = np.flatnonzero(np.isfinite(path[:, 0]))[-1:].tolist()
        left.plot(*path[:, :2].T, c=colour, markevery=last, label=label, **style)
        away = np.linalg.norm(path[:, [0, 1, 3]], axis=1) / radius
        away = distances(path, theory, times) if seen.judged else away
        right.plot(times[1:], away[1:], c=colour, ls=style.get("ls", "-"))
    if seen.symptoms.failure:
        right.axvline(until, color=_AFTER, ls="--", label="first bad state")
        if until < _EARLY * end:
            right.set(xscale="log", xlim=(seen.motion.times[1], end))
    shown = [path[:, :2] for *_, path, colour, _ in curves if colour != _AFTER]
    points = np.concatenate([theory.contact_point, *shown])
    ends = np.array([np.nanmin(points, axis=0), np.nanmax(points, axis=0)])
    x, y = ends.mean(axis=0)
    half = 0.6 * max(np.ptp(ends, axis=0).max(), 2 * radius)
    left.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
    left.set(xlabel="X [m]", ylabel="Y [m]", aspect="equal", title="contact point")
    right.set(xlabel="t [s]", title="path error over the path's length or the radius")
    if seen.judged:
        positive = any(np.nansum(line.get_ydata()) for line in right.lines)
        right.set_yscale("log" if positive else "linear")
        right.axhline(seen.accuracy, color="gray", linestyle=":", label="asked for")
    else:
        left.add_patch(Circle((x, y), radius, fill=False, ls=":"))
        right.set(title="distance rolled, or turned in place, over the radius")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
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
