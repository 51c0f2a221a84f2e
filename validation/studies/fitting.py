"""Fit a scene's numbers to a robot's logs.

The result is printed and written to three files: a scene, a page with residuals, and JSON.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from rich.columns import Columns
from rich.console import Console

from robotball import InputError
from robotball.fit.evidence import Estimate, SensorFit, strays
from robotball.fit.fitting import Fit as Fitted
from robotball.fit.fitting import fit
from robotball.fit.logs import read_log
from robotball.fit.scene_numbers import numbers_of
from robotball.rotations import Array
from robotball.view.tracks import PRESET_LOOKS, LineStyle

from ..options import AGREES, DISAGREES
from ..output import (
    known,
    pairs_of,
    plain_table,
    print_whole,
    program,
    progress_bar,
    scientific,
    writable_folder,
    write_record,
    write_text,
)
from ..report import VERDICTS, page, paragraph, plot, table, text
from ..report.chart import Line, chart, legend

_STRONG = 0.9  # smallest correlation to report
_GAP = 3.0  # median intervals; a longer interval is a gap
_FAR, _BARS = 4.5, 18  # range of the histogram in noises, and number of bars
_LONGEST_NAME = 100  # characters; a longer file name ends with a checksum
_COLOURS = [colour for colour, _, _ in PRESET_LOOKS.values()]


def lines(fitted: Fitted) -> Iterator[str]:
    """Yield the report of a fit, one fact per line: the verdict, then the uncertainties."""
    probability = fitted.probability
    chi2 = f"χ²/n = {fitted.chi2 / fitted.degrees:.4g} with n = {fitted.degrees} degrees of freedom"
    if fitted.explains and not _constrained(fitted):
        yield (
            "the logs do not constrain any of these parameters: every value fits equally well "
            f"({chi2})"
        )
    elif fitted.explains:
        yield f"the model explains the logs: {chi2}, probability {probability:.2g}"
    elif not strays(fitted.sensors):
        logs = ", ".join(dict.fromkeys(sensor.log for sensor in fitted.sensors))
        weighed = np.concatenate([(s.residuals / s.noise).ravel() for s in fitted.held_out])
        yield (
            f"the model explains {logs}: {chi2}; it does not explain the held-out log "
            f"{fitted.held_out[0].log}: χ²/n = {(weighed**2).mean():.4g}"
        )
    else:
        yield f"the model does not explain the logs, so errors may exceed the ± shown: {chi2}"
    if not fitted.complete:
        yield (
            "the fit stopped before the minimum of χ² and gives its best values so far: continue "
            "with the scene that it wrote, or with more --patience"
        )
        yield from fitted.moving
    for sensor in fitted.strays:
        yield (
            f"  {sensor.name} of {sensor.log} is off by {scientific(sensor.residual)} from "
            f"t = {sensor.since or 0.0:.3g} s on; its noise is {scientific(sensor.noise)}"
        )
    yield from (line for line in fitted.contradictions if line != fitted.reason)
    yield from fitted.at_limits
    yield from fitted.undetermined
    yield from fitted.influences
    names = [number.name for number in fitted.found]
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        if abs(fitted.correlations[i, j]) > _STRONG and not fitted.undetermined:
            yield (
                f"the logs hardly distinguish {names[i]} from {names[j]}: their correlation is "
                f"{fitted.correlations[i, j]:.3f}"
            )
    if fitted.reason:
        yield f"most probable reason: {fitted.reason}"


def _constrained(fitted: Fitted) -> bool:
    """Return whether the logs constrain at least one number."""
    return any(number.determined for number in fitted.found)


def _numbers(estimates: Sequence[Estimate]) -> Iterator[list[str]]:
    for estimate in estimates:
        size = known(estimate.deviation)
        digits = 6 if not size else max(0, int(2 - np.floor(np.log10(size))))
        value = f"{estimate.value:.{digits}f}" if digits < 12 else f"{estimate.value:.6g}"
        found = [value, f"{estimate.deviation:.2g}"]
        found = found if estimate.determined else ["not determined", "-"]
        yield [estimate.name, *found, f"{estimate.began:.6g}", estimate.unit]


_HEADINGS = ("number", "value", "±", "started at", "unit")
_SENSORS = ("log", "sensor", "readings", "noise", "residual", "probability")


def _sensor_rows(fitted: Fitted) -> Iterator[list[str]]:
    for sensor in (*fitted.sensors, *fitted.held_out):
        log = sensor.log + " (held out)" * (sensor in fitted.held_out)
        errors = map(scientific, (sensor.noise, sensor.residual))
        yield [log, sensor.name, str(len(sensor.times)), *errors, f"{sensor.probability:.2g}"]


def _fit_page(scene: str, fitted: Fitted) -> str:
    """Return the page of a fit: its report, the numbers, and the residuals."""
    verdict, *others = lines(fitted)
    body = [
        f"<h1>{text(scene)}: fitted to its logs</h1>",
        paragraph(verdict, VERDICTS[fitted.explains and _constrained(fitted)]),
        *map(paragraph, others),
        "<h2>Numbers</h2>",
        table(_HEADINGS, _numbers((*fitted.found, *fitted.of_logs))),
        "<h2>Sensors</h2>",
        table(_SENSORS, _sensor_rows(fitted)),
        "<h2>Readings and model</h2>",
        *map(_sensor_plots, (*fitted.sensors, *fitted.held_out)),
    ]
    return page(f"robotball: {scene}, fitted", body)


def _sensor_plots(sensor: SensorFit) -> str:
    """Return plots of the readings and the model, of the residuals, and of their histogram."""
    scaled, steps = sensor.residuals / sensor.noise, np.diff(sensor.times)
    names = "xyz" if scaled.shape[1] > 1 else (sensor.name,)
    looks = [LineStyle(*look[:2]) for look in zip(names, _COLOURS, strict=False)]
    gaps = 1 + np.flatnonzero(steps > _GAP * np.median(steps))
    times = np.insert(sensor.times, gaps, sensor.times[gaps])

    def lines(values: Array, looks: Sequence[LineStyle]) -> list[Line]:
        columns = np.insert(values, gaps, np.nan, axis=0).T
        return [Line(look, times, it, width=1.3) for look, it in zip(looks, columns, strict=False)]

    heading, drawn = f"{sensor.name} of {sensor.log}: ", ""
    if sensor.readings.shape == scaled.shape:  # an attitude has quaternions
        models = [LineStyle(f"{name}, model", "currentColor", (6, 4)) for name in names]
        both = [*lines(sensor.readings, looks), *lines(sensor.readings - sensor.residuals, models)]
        drawn = plot(f"{heading}readings over the model", both, "t [s]", sensor.name)
    caption = f"{heading}reading minus model, over the noise"
    drawn += plot(caption, lines(scaled, looks), "t [s]", "residual over noise")
    counts, edges = np.histogram(np.clip(scaled, -_FAR, _FAR), _BARS, (-_FAR, _FAR))
    normal = np.exp(-(edges**2) / 2) * scaled.size * np.diff(edges)[0] / np.sqrt(2 * np.pi)
    bars = [
        Line(LineStyle("readings", _COLOURS[0]), np.repeat(edges, 2)[1:-1], np.repeat(counts, 2)),
        Line(LineStyle("normal distribution", "currentColor", (6, 4)), edges, normal),
    ]
    histogram = chart(bars, "residual over noise", "number of readings")
    caption = f"<figcaption>{text(f'{heading}histogram of the residuals')}</figcaption>"
    drawn += f"<figure>{caption}<div>{legend(bars)}</div>{histogram}</figure>"
    return f'<div class="charts">{drawn}</div>'


_MEASURES = ("noise", "residual", "probability", "since")


def _record(scene: str, fitted: Fitted) -> dict[str, Any]:
    names = ("explains", "chi2", "probability", "complete", "reason")
    texts = ("undetermined", "contradictions", "at_limits", "influences", "moving")
    return {
        "program": program(),
        "scene": scene,
        **{name: getattr(fitted, name) for name in names},
        "degrees_of_freedom": fitted.degrees,
        "numbers": fitted.found,
        "of_logs": fitted.of_logs,
        "correlations": fitted.correlations,
        **{name: getattr(fitted, name) for name in texts},
        "sensors": [
            {
                "log": sensor.log,
                "name": sensor.name,
                "held_out": sensor in fitted.held_out,
                "readings": len(sensor.times),
                **{name: getattr(sensor, name) for name in _MEASURES},
            }
            for sensor in (*fitted.sensors, *fitted.held_out)
        ],
    }


def fit_logs(
    scene_name: str,
    paths: Sequence[Path],
    free: Sequence[str],
    *,
    also: Sequence[str],
    noise: Sequence[str],
    names: Mapping[str, str],
    patience: float,
    hold_out: bool,
    suffix: str,
    out: Path,
    json: Path | None,
) -> int:
    """Fit a scene's numbers to logs, present and write the result; return the exit status.

    suffix: of the files' names, with the logs and options.
    """
    if not paths:
        raise InputError("fit needs a log: a table of t and sensor readings")
    numbers = numbers_of(scene_name)
    if not free:
        Console().print(Columns(numbers.known))
        raise InputError("name the numbers to find with --free; the list above shows all numbers")
    scene = numbers.scene({})
    logs = [read_log(path, scene, names) for path in paths]
    held = len(logs) - 1 if len(logs) > 1 and hold_out else None
    writable_folder(out)
    with progress_bar(1) as bar:

        def show(part: float, chi2: float) -> None:
            bar(part, f"χ²/n = {chi2:.3g} over {part:.0%} of the logs")

        fitted = fit(
            numbers, logs, free, circumstances=also, noise=_noise_of(noise), patience=patience,
            hold_out=held, progress=show,
        )  # fmt: skip
    for log in logs:
        for note in log.notes:
            print(f"{log.name}: {note}")
    console = Console()
    estimates = _HEADINGS, _numbers((*fitted.found, *fitted.of_logs))
    for headings, rows in (estimates, (_SENSORS, _sensor_rows(fitted))):
        print_whole(plain_table(headings, rows=rows), console)
    print(*lines(fitted), sep="\n")
    name = f"fit-{scene.name}{suffix}"
    if len(name) > _LONGEST_NAME:
        name = f"{name[:_LONGEST_NAME]}-{crc32(name.encode(errors='replace')):08x}"
    scene_file, page_file = (out / f"{name}{end}" for end in (numbers.suffix, ".html"))
    write_text(scene_file, fitted.text)
    write_text(page_file, _fit_page(scene.name, fitted))
    write_record(json, _record(scene.name, fitted))
    print(scene_file, page_file, sep="\n")
    return AGREES if fitted.explains and _constrained(fitted) else DISAGREES


def _noise_of(texts: Sequence[str]) -> dict[str, float]:
    form = "--noise takes SENSOR=NUMBER, such as gyro=0.02"
    try:
        return {name: float(value) for name, value in pairs_of(form, texts).items()}
    except ValueError:
        raise InputError(f"{form}, not {', '.join(texts)}") from None
