"""Orders of convergence in the terminal: every run, then a row an integrator."""

from rich import box
from rich.console import Console
from rich.table import Table

from validation.comparison.table import scientific
from validation.studies.convergence.convergence import ORDERS, REFERENCES, Convergence, Reference
from validation.studies.order import Order

NOTE = (
    "Errors are of the path, over its length. own limit: what the contact model\n"
    "tends to as steps shrink. Richardson: an estimate of that error from a run and\n"
    "the one at the next longer step. equations: that error and the model's own.\n"
    "points: of the line. stalls: where shorter steps make no smaller error.\n"
    "DOP853 alone chooses its steps: the order is its power of rtol."
)


def show_convergence(study: Convergence, console: Console) -> None:
    """Print every run, the orders, and the distance of the two references."""
    console.print(_runs(study))
    console.print(_orders(study))
    console.print(NOTE)
    limit, name = study.limit, f"{study.scene.name}, {study.settings.name}"
    console.print(
        f"{name}: the own limit is {limit.model_error:.1e} of the path off the equations;\n"
        f"it is by {limit.method}, and known to {limit.known_to:.1e}."
    )


def _runs(study: Convergence) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("integrator", no_wrap=True)
    for heading in ("step\n\\[ms]", "rtol", "own limit", "Richardson", "equations"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, points in study.by_name.items():
        for point in points:
            table.add_row(
                name,
                "-" if point.step is None else f"{point.step * 1e3:.3g}",
                f"{point.method.rtol:.0e}" if point.method.step is None else "",
                scientific(point.own),
                "" if point.richardson is None else scientific(point.richardson),
                scientific(point.equations),
            )
        table.add_section()
    return table


def _orders(study: Convergence) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("integrator", no_wrap=True)
    headings = ["claim", "own limit", "points", "stalls", "equations", "points", "stalls"]
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    for name in study.by_name:
        found = [cell for against in REFERENCES for cell in _found(study, name, against)]
        table.add_row(name, f"{ORDERS[name]}" if name in ORDERS else "rtol", *found)
    return table


def _found(study: Convergence, name: str, against: Reference) -> tuple[str, str, str]:
    order, stall = study.order(name, against), study.stalled_at(name, against)
    points = f"{order.points}" if order else ""
    return order_text(order), points, "" if stall is None else scientific(stall)


def order_text(order: Order | None) -> str:
    """The order with its standard error; a dash where there is none."""
    return "-" if order is None else f"{order.order:.2f} ± {order.stderr:.2f}"
