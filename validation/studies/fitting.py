"""Fit a scene's numbers to a robot's logs, with the equations and with engines.

The result is shown as text, as a scene file, as a page with the residuals and as JSON.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.columns import Columns
from rich.console import Console

from robotball import InputError
from robotball.engines.engine import request_of, run_request
from robotball.files import MODEL_FILES
from robotball.files.scene_tables import Numbers
from robotball.fit.evidence import Estimate, SensorFit
from robotball.fit.fitting import Fit as Fitted
from robotball.fit.fitting import fit
from robotball.fit.logs import read_log
from robotball.fit.scene_numbers import numbers_of
from robotball.view.lines import PRESET_LOOKS, LineStyle

from ..options import AGREES, DISAGREES
from ..output import (
    known,
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
from ..report.chart import Line

_EQUATIONS = "equations"
_STRONG = 0.9  # a correlation that is worth a line


def as_it_is(numbers: Numbers) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield how `fit` fits a robot's own file as it is, by the toolbox of its engine, and the name.

    Prints a line where the toolbox is not installed.
    """
    if numbers.suffix not in MODEL_FILES:
        return
    from robotball.engines.mujoco import toolbox

    try:
        toolbox.check_toolbox()
    except InputError as error:
        print(error)
        return
    yield "the file as it is", {"run": toolbox.roll, "minimize": toolbox.least_squares}


def lines(found: Fitted) -> Iterator[str]:
    """Yield what a fit says, a line each: the verdict, then what the logs do not tell."""
    chi2, probability = found.chi2 / found.degrees, found.probability
    told = f"χ² is {chi2:.4g} for each of {found.degrees} degrees of freedom"
    if found.explains and not _tells(found):
        yield f"the logs tell none of the numbers, and are explained whatever these are: {told}"
    elif found.explains:
        yield f"the model explains the logs: {told}, its probability {probability:.2g}"
    else:
        yield f"the model does not explain the logs; numbers may be off by more than ±: {told}"
    if not found.complete:
        yield "the fit stopped before the minimum of χ²: begin nearer, or from the scene it wrote"
    for sensor in found.strays:
        yield (
            f"  {sensor.name} of {sensor.log} from t = {sensor.since or 0.0:.3g} s on: it is off "
            f"by {scientific(sensor.residual)}, and its noise is {scientific(sensor.noise)}"
        )
    if any(sensor.name == "position" for sensor in found.strays):
        yield (
            "  where the capture's unit, origin or axes are not the scene's no position fits: see "
            "its unit, and --also world.origin,world.yaw"
        )
    yield from found.contradictions
    yield from found.at_limits
    yield from found.undetermined
    yield from found.influences
    names = [each.name for each in found.found]
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        if abs(found.correlations[i, j]) > _STRONG and not found.undetermined:
            yield (
                f"{names[i]} and {names[j]} are told apart badly: their correlation is "
                f"{found.correlations[i, j]:.3f}"
            )


def _tells(found: Fitted) -> bool:
    """Return whether the logs tell at least one of the numbers."""
    return any(each.determined for each in found.found)


def _numbers(found: Sequence[Estimate]) -> Iterator[list[str]]:
    for each in found:
        size = known(each.deviation)
        digits = 6 if not size else max(0, int(2 - np.floor(np.log10(size))))
        value = f"{each.value:.{digits}f}" if digits < 12 else f"{each.value:.6g}"
        yield [
            each.name,
            value if each.determined else "not determined",
            f"{each.deviation:.2g}" if each.determined else "-",
            f"{each.began:.6g}",
            each.unit,
        ]


_HEADINGS = ("number", "value", "±", "began at", "unit")
_SENSORS = ("log", "sensor", "readings", "noise", "residual", "probability")


def _sensor_rows(found: Fitted) -> Iterator[list[str]]:
    for held_out, sensors in ((False, found.sensors), (True, found.held_out)):
        for each in sensors:
            yield [
                f"{each.log} (held out)" if held_out else each.log,
                each.name,
                str(len(each.times)),
                scientific(each.noise),
                scientific(each.residual),
                f"{each.probability:.2g}",
            ]


def _beside(fits: Mapping[str, Fitted]) -> tuple[list[str], list[list[str]]]:
    """Return a table of what each engine makes of the numbers, beside the equations."""
    truth = fits[_EQUATIONS]
    headings = ["fitted by", *(each.name for each in truth.found), "χ²/n"]
    rows = []
    for name, each in fits.items():
        cells = [f"{own.value:.6g}" for own in each.found]
        if each is not truth:
            pairs = zip(each.found, truth.found, strict=True)
            cells = [_relative(own.value - of.value, of.value, "+") for own, of in pairs]
        rows.append([name, *cells, f"{each.chi2 / each.degrees:.3g}"])
    deviations = [_relative(each.deviation, abs(each.value)) for each in truth.found]
    rows.append(["(one standard deviation)", *deviations, ""])
    return headings, rows


def _relative(part: float, of: float, sign: str = "") -> str:
    """Return a part of a number in percent; of zero the part itself."""
    return f"{part / of:{sign}.2%}".replace("%", " %") if of else f"{part:{sign}.3g}"


def _fit_page(scene: str, fits: Mapping[str, Fitted]) -> str:
    """Return the page of a fit: what it found, what the logs do not tell, and the residuals."""
    found = fits[_EQUATIONS]
    body = [
        f"<h1>{text(scene)}: fitted to its logs</h1>",
        paragraph(next(lines(found)), VERDICTS[found.explains and _tells(found)]),
        *(paragraph(each) for each in [*lines(found)][1:]),
        "<h2>Numbers</h2>",
        table(_HEADINGS, _numbers((*found.found, *found.of_logs))),
        "<h2>Sensors</h2>",
        table(_SENSORS, _sensor_rows(found)),
    ]
    if len(fits) > 1:
        words = "A wrong contact is paid by the numbers: each engine's, less the equations'."
        body += ["<h2>By engines</h2>", paragraph(words), table(*_beside(fits))]
    body += ["<h2>Residuals</h2>", *map(_residual_plot, (*found.sensors, *found.held_out))]
    return page(f"robotball: {scene}, fitted", body)


def _residual_plot(sensor: SensorFit) -> str:
    colours = [colour for colour, _, _ in PRESET_LOOKS.values()]
    names = "xyz" if sensor.residuals.shape[1] > 1 else (sensor.name,)
    columns = [
        Line(LineStyle(name, colour), sensor.times, column / sensor.noise, width=0.8)
        for name, colour, column in zip(names, colours, sensor.residuals.T, strict=False)
    ]
    caption = f"{sensor.name} of {sensor.log}: readings less the model's, over the noise"
    return plot(caption, columns, "t [s]", "residual over noise")


_MEASURES = ("noise", "residual", "probability", "since")


def _record(scene: str, fits: Mapping[str, Fitted]) -> dict[str, Any]:
    found = fits[_EQUATIONS]
    return {
        "program": program(),
        "scene": scene,
        "explains": found.explains,
        "chi2": found.chi2,
        "degrees_of_freedom": found.degrees,
        "probability": found.probability,
        "complete": found.complete,
        "numbers": [_plain(each) for each in found.found],
        "of_logs": [_plain(each) for each in found.of_logs],
        "correlations": found.correlations.tolist(),
        "undetermined": list(found.undetermined),
        "contradictions": list(found.contradictions),
        "at_limits": list(found.at_limits),
        "influences": list(found.influences),
        "sensors": [
            {
                "log": each.log,
                "name": each.name,
                "held_out": each in found.held_out,
                "readings": len(each.times),
                **{name: getattr(each, name) for name in _MEASURES},
            }
            for each in (*found.sensors, *found.held_out)
        ],
        "by_engines": [
            {
                "name": name,
                "chi2_per_degree": each.chi2 / each.degrees,
                "numbers": [_plain(own) for own in each.found],
            }
            for name, each in fits.items()
            if name != _EQUATIONS
        ],
    }


def _plain(found: Estimate) -> dict[str, Any]:
    return {name: known(v) if isinstance(v, float) else v for name, v in asdict(found).items()}


def fit_logs(
    scene_name: str,
    paths: Sequence[Path],
    free: Sequence[str],
    *,
    also: Sequence[str],
    noise: Sequence[str],
    loss: str,
    hold_out: bool,
    engine: str,
    presets: Sequence[str],
    out: Path,
    json: Path | None,
) -> int:
    """Fit a scene's numbers to logs, present and write the result; return the exit status."""
    if not paths:
        raise InputError("fit needs a log: a table of t and what the sensors read")
    numbers = numbers_of(scene_name)
    if not free:
        Console().print(Columns(numbers.known))
        raise InputError("name the numbers to find with --free; the scene has those above")
    if engine != "mujoco" and not presets:
        raise InputError("--engine is of the presets: name some, as --preset naive,balanced")
    scene = numbers.scene({})
    logs = [read_log(path, scene) for path in paths]
    runs: dict[str, dict[str, Any]] = {_EQUATIONS: {}, **dict(as_it_is(numbers))}
    for preset in presets:
        # To its end, whatever the engine does.
        request = request_of(engine, preset, keep_going=True)
        runs[f"{engine}, {preset}"] = {"run": partial(run_request, request=request)}
    fitted = partial(
        fit, numbers, logs, free, circumstances=also, noise=_noise_of(noise), loss=loss,
        hold_out=len(logs) - 1 if len(logs) > 1 and hold_out else None,
    )  # fmt: skip
    writable_folder(out)
    fits: dict[str, Fitted] = {}
    with progress_bar(len(runs)) as bar:
        for name, how in runs.items():

            def show(part: float, chi2: float, name: str = name) -> None:
                bar(len(fits) + part, f"{name}: χ²/n = {chi2:.3g} over {part:.0%} of the logs")

            fits[name] = fitted(**how, progress=show)
    for log in logs:
        for note in log.notes:
            print(f"{log.name}: {note}")
    found, console = fits[_EQUATIONS], Console()
    table_of_numbers = _HEADINGS, _numbers((*found.found, *found.of_logs))
    others = [_beside(fits)] if len(fits) > 1 else []
    for headings, rows in (table_of_numbers, (_SENSORS, _sensor_rows(found)), *others):
        print_whole(plain_table(headings, rows=rows), console)
    for line in lines(found):
        print(line)
    scene_file, page_file = (out / f"fit-{scene.name}{end}" for end in (numbers.suffix, ".html"))
    write_text(scene_file, found.text)
    write_text(page_file, _fit_page(scene.name, fits))
    write_record(json, _record(scene.name, fits))
    print(scene_file, page_file, sep="\n")
    return AGREES if found.explains and _tells(found) and not found.at_limits else DISAGREES


def _noise_of(texts: Sequence[str]) -> dict[str, float]:
    noise = {}
    for each in texts:
        name, _, value = each.partition("=")
        try:
            noise[name] = float(value)
        except ValueError:
            raise InputError(f"--noise takes SENSOR=NUMBER, as gyro=0.02, not {each!r}") from None
    return noise
