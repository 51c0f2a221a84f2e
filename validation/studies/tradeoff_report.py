"""The trade-off: the Pareto front in the terminal, a picture of all of it, and plain data."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.integrators import INTEGRATORS
from robotball.palette import ACCENT, FAINT, INK
from validation.output import in_picture, print_whole, scientific
from validation.studies.tradeoff import TARGET, Configuration, Line, Tradeoff, known

NOTE = (
    "CPU: of a simulated second. × bare: the same, relative to a bare loop of mj_step\n"
    "on fig12 at 1 ms, the median of rounds in turn (least-most)."
)
INCHES = (10.0, 7.2)
WILD = 1e3  # a path error from where on a run is not drawn
ABOVE = ("adaptive",)  # its place is the left end of the front


def show_tradeoff(study: Tradeoff, console: Console) -> None:
    """Print the front, the presets, and the ratio at the target."""
    failed = sum(not each.sound for each in study.configurations)
    console.print(
        f"{escape(study.scene.name)}: {len(study.configurations)} configurations, "
        f"{failed} no result",
        style="bold",
    )
    console.print("The Pareto front: nothing is both cheaper and better.")
    print_whole(_table(study.pareto_front), console)
    console.print("The presets.")
    print_whole(_table(sorted(study.presets.values(), key=lambda p: p.title)), console)
    console.print(NOTE)
    console.print(escape(verdict(study)))


def verdict(study: Tradeoff) -> str:
    """What first order costs at the target, beside the front."""
    if study.best is None:
        return f"No configuration reaches a path error of {TARGET:g}."
    best = f"At a path error of {TARGET:g}: {study.best.title} takes {study.best.cost:.2g} s"
    if study.first_order is None or study.ratio is None:
        return f"{best}; no first-order integrator has a line to compare it with."
    line = study.first_order
    how = (
        f"extrapolated from {scientific(line.nearest.error)} at order {line.order:.2f}"
        if line.extrapolated
        else "measured"
    )
    return (
        f"{best};\nthe best of first order ({line.nearest.title}) "
        f"{line.at_target:.2g} s, {study.ratio:.2g} times as much ({how})."
    )


def _table(configurations: Iterable[Configuration]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("configuration")
    for heading in ("path\nerror", "M error", "CPU\n\\[ms]", "× bare"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    for each in configurations:
        least, most = each.spread
        table.add_row(
            each.title,
            scientific(known(each.error)),
            scientific(known(each.momentum_error)),
            f"{each.cost * 1e3:.2f}",
            f"{each.ratio:.3f} ({least:.3f}-{most:.3f})",
            each.trouble.split("; ")[0],
            style="yellow" if each.trouble else "",
        )
    return table


def tradeoff_picture(study: Tradeoff) -> Figure:
    """Every configuration that has an error, the front, the presets, and first order prolonged."""
    figure = Figure(figsize=INCHES, layout="constrained")
    name = in_picture(study.scene.name)
    figure.suptitle(f"{name}: what accuracy costs, {len(study.configurations)} configurations")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="path error, relative to the path's length")
    axes.set_ylabel("processor time of a simulated second [s]")
    axes.grid(alpha=0.3)
    _scatter(axes, study.configurations)
    errors, costs = zip(*((p.error, p.cost) for p in study.pareto_front), strict=True)
    axes.plot(errors, costs, color=INK, linewidth=1.6, zorder=3, label="Pareto front")
    if study.first_order is not None:
        _prolong(axes, study.first_order)
    _compare(axes, study)
    for name, each in study.presets.items():
        if not math.isnan(each.error):
            _name(axes, name, (each.error, each.cost))
    low, high = axes.get_xlim()
    axes.set_xlim(low / 3, high * 3)
    axes.set_ylim(axes.get_ylim()[0] / 2.5)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _scatter(axes: Axes, configurations: Sequence[Configuration]) -> None:
    faulty = [p for p in configurations if not p.sound and p.error < WILD]
    axes.plot(
        [p.error for p in faulty],
        [p.cost for p in faulty],
        "x",
        color=FAINT,
        markersize=4,
        zorder=1,
        label="slips, lifts off or misses a rate",
    )
    for integrator in INTEGRATORS.values():
        mine = [p for p in configurations if p.sound and p.integrator == integrator.name]
        high = integrator.order > 1  # filled; first order is hollow
        axes.plot(
            [p.error for p in mine],
            [p.cost for p in mine],
            integrator.marker,
            color=LABEL.colour,
            markerfacecolor=LABEL.colour if high else "none",
            markersize=5 if high else 4.5,
            linestyle="",
            zorder=2,
            label=integrator.name,
        )


def _prolong(axes: Axes, line: Line) -> None:
    """The best line of first order, on to the target."""
    configurations = [(p.error, p.cost) for p in line.configurations]
    axes.plot(
        *zip(*configurations, strict=True), color=ACCENT, linewidth=1.4, label="first order, best"
    )
    if line.extrapolated:
        axes.plot(
            [line.nearest.error, TARGET],
            [line.nearest.cost, line.at_target],
            color=ACCENT,
            linewidth=1.4,
            linestyle="--",
            label=f"extrapolated, order {line.order:.2f}",
        )


def _compare(axes: Axes, study: Tradeoff) -> None:
    """The two costs at the target, and how many times one is the other."""
    axes.axvline(TARGET, color=INK, linewidth=0.8, linestyle=":")
    if study.best is None or study.first_order is None or study.ratio is None:
        return
    low, high = study.best.cost, study.first_order.at_target
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (TARGET, high), xytext=(TARGET, low), arrowprops=arrow)
    times = float(f"{study.ratio:.2g}")
    axes.annotate(
        f"{times:,.0f}".replace(",", "\u2009") + f" times\nat {TARGET:g}",
        (TARGET, high / 4),
        xytext=(-8, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        color=INK,
    )


def _name(axes: Axes, name: str, place: tuple[float, float]) -> None:
    """A preset's ring and its name, on the side where nothing else is."""
    above = name in ABOVE
    axes.plot(*place, "o", color=INK, markerfacecolor="none", markersize=11, zorder=4)
    axes.annotate(
        name,
        place,
        xytext=(0, 10 if above else -12),
        textcoords="offset points",
        ha="center",
        va="bottom" if above else "top",
        color=INK,
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
    )


def record(study: Tradeoff) -> dict[str, Any]:
    """The study as plain data; what has no number is None."""
    line = study.first_order
    return {
        "scene": study.scene.name,
        "target": TARGET,
        "ratio": study.ratio,
        "baseline": study.baseline,
        "best": study.best and _record(study.best),
        "first_order": line
        and {
            "order": line.order,
            "extrapolated": line.extrapolated,
            "cost_at_target": line.at_target,
            "nearest": _record(line.nearest),
        },
        "pareto_front": [_record(each) for each in study.pareto_front],
        "configurations": [_record(each) for each in study.configurations],
    }


def _record(of: Configuration) -> dict[str, Any]:
    names = ("error", "momentum_error", "ratio", "cost")
    return {
        "title": of.title,
        "sound": of.sound,
        **{name: known(getattr(of, name)) for name in names},
        "spread": [known(end) for end in of.spread],
        "trouble": of.trouble,
        "options": of.options,
    }
