"""The trade-off in the terminal: the front, the presets, and what first order would cost."""

from collections.abc import Iterable

from rich import box
from rich.console import Console
from rich.table import Table

from validation.comparison.table import scientific
from validation.studies.tradeoff.front import TARGET, Point, Tradeoff, known

NOTE = (
    "CPU: of a simulated second. × bare: the same, relative to a bare loop of mj_step\n"
    "on fig12 at 1 ms, the median of rounds in turn (least-most)."
)


def show_tradeoff(study: Tradeoff, console: Console) -> None:
    """Print the front, the presets, and the ratio at the target."""
    failed = sum(not point.sound for point in study.points)
    console.print(
        f"{study.scene.name}: {len(study.points)} configurations, {failed} of them no result",
        style="bold",
    )
    console.print("The front: nothing is both cheaper and better.")
    console.print(_table(study.front))
    console.print("The presets.")
    console.print(_table(sorted(study.presets.values(), key=lambda p: p.title)))
    console.print(NOTE)
    console.print(verdict(study))


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


def _table(points: Iterable[Point]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("configuration")
    for heading in ("path\nerror", "M drift", "CPU\n\\[ms]", "× bare"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    for point in points:
        least, most = point.spread
        table.add_row(
            point.title,
            scientific(known(point.error)),
            scientific(known(point.drift)),
            f"{point.cost * 1e3:.2f}",
            f"{point.ratio:.3f} ({least:.3f}-{most:.3f})",
            point.trouble.split("; ")[0],
            style="yellow" if point.trouble else "",
        )
    return table
