"""The engines beside each other: a table, a picture of error against processor time, plain data."""

import math
from dataclasses import asdict
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball.palette import INK
from validation.output import in_picture, print_whole, scientific
from validation.studies.engines.measure import EngineStudy, Run

INCHES = (10.0, 7.2)
MARKERS = "osD^vPX*<>hp"
STYLES = ("-", "--", ":", "-.")  # of an engine's presets, in their order
LEAST = 1e-15  # below it no error is told apart
NOTE = (
    "CPU: processor time of a simulated second, set-up excluded. Python: the part of it\n"
    "that Python takes at every step. * on the Pareto front: nothing is both cheaper and better."
)


def show_study(study: EngineStudy, console: Console) -> None:
    """Print every run, those that gave none, and what is on the front."""
    scene = study.scene
    console.print(f"{escape(scene.name)} ({scene.rolling}): {what(study)}", style="bold")
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("")
    table.add_column("engine, preset, step or rtol")
    for heading in ("error", "order", "M error", "slip\n\\[m/s]", "CPU\n\\[ms]", "Python"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    front = {id(run) for run in study.pareto_front}
    for run in study.runs:
        order = study.orders.get((run.contestant, run.preset))
        share = run.python_share
        table.add_row(
            "*" if id(run) in front else "",
            escape(run.title),
            scientific(run.error),
            "-" if order is None else f"{order.order:.2f}",
            scientific(run.momentum_error),
            scientific(run.record["slip"]),
            f"{run.cost * 1e3:.3g}",
            "-" if share is None else f"{share:.0%}",
            escape(run.faults[0]) if run.faults else "",
            style="" if run.usable else "yellow",
        )
    for contestant, preset, value, why in study.failed:
        title = f"{contestant}, {preset}, {value:g}"
        table.add_row("", escape(title), *["-"] * 6, escape(why), style="yellow")
    print_whole(table, console)
    console.print(NOTE)


def what(study: EngineStudy) -> str:
    """What the errors are of."""
    if study.by_defects:
        return "chaotic, so errors are the sum of defects over short stretches"
    return "path errors"


def engines_picture(study: EngineStudy) -> Figure:
    """Every engine's error against its cost: filled at its best, hollow as it comes."""
    figure = Figure(figsize=INCHES, layout="constrained")
    name = in_picture(study.scene.name)
    figure.suptitle(f"{name} ({study.scene.rolling}): {what(study)}")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="error, relative to the path's length")
    axes.set_ylabel("processor time of a simulated second [s]")
    axes.grid(alpha=0.3)
    _draw(axes, study)
    front = study.pareto_front
    axes.plot(
        [max(run.error, LEAST) for run in front], [run.cost for run in front],
        color=INK, linewidth=1.4, zorder=1, label="Pareto front",
    )  # fmt: skip
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _draw(axes: Axes, study: EngineStudy) -> None:
    keys = list(dict.fromkeys((run.contestant, run.preset) for run in study.runs))
    of_engine: dict[str, int] = {}
    for contestant, preset in keys:
        mine = [r for r in study.runs if (r.contestant, r.preset) == (contestant, preset)]
        marker = MARKERS[of_engine.setdefault(contestant, len(of_engine)) % len(MARKERS)]
        first = mine[0]
        nth = [key for key in keys if key[0] == contestant].index((contestant, preset))
        order = study.orders.get((contestant, preset))
        label = f"{first.name}, {preset}" + (f" (order {order.order:.1f})" if order else "")
        axes.plot(
            [min(max(r.error, LEAST), 10.0) for r in mine],
            [r.cost for r in mine],
            marker=marker,
            linestyle=STYLES[nth % len(STYLES)],
            color=first.colour,
            markerfacecolor="none" if first.newcomer else first.colour,
            markersize=6,
            linewidth=1,
            zorder=2,
            label=in_picture(label),
        )


def record(study: EngineStudy) -> dict[str, Any]:
    """The study as plain data: all settings, versions, faults and costs."""
    front = {id(run) for run in study.pareto_front}
    return {
        "scene": study.scene.name,
        "rolling": study.scene.rolling,
        "errors": what(study),
        "runs": [_plain(run) | {"on_the_pareto_front": id(run) in front} for run in study.runs],
        "orders": [
            {"contestant": contestant, "preset": preset, **asdict(order)}
            for (contestant, preset), order in study.orders.items()
        ],
        "failed": [
            dict(zip(("contestant", "preset", "value", "why"), each, strict=True))
            for each in study.failed
        ],
    }


def _plain(run: Run) -> dict[str, Any]:
    plain = asdict(run)
    record = plain.pop("record")
    own = {name: value for name, value in plain.items() if not _is_nan(value)}
    return {**record, **own}


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)
