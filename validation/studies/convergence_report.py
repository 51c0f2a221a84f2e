"""Orders of convergence: tables in the terminal, a picture, and plain data."""

from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.integrators import ADAPTIVE, INTEGRATORS
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.palette import INK
from validation.output import in_picture, print_whole, scientific
from validation.studies.convergence import ORDERS, REFERENCES, Convergence, Reference
from validation.studies.order import Order

NOTE = (
    "Errors are of the path, over its length. own limit: what the contact model\n"
    "tends to as steps shrink. Richardson: an estimate of that error from a run and\n"
    "the one at the next longer step. equations: that error and the model's own.\n"
    "points: of the line. stalls: where shorter steps make no smaller error.\n"
    "DOP853 alone chooses its steps: the order is its power of rtol."
)
INCHES = (11.0, 6.6)
TITLES: dict[Reference, str] = {
    "own": "against the contact model's own limit",
    "equations": "against the reduced equations",
}
NEAR = 1.5  # in ln(step) and ln(error): slopes as near as that get one label


def show_convergence(study: Convergence, console: Console) -> None:
    """Print every run, the orders, and the distance of the two references."""
    print_whole(_runs(study), console)
    print_whole(_orders(study), console)
    console.print(NOTE)
    limit, name = study.limit, escape(f"{study.scene.name}, {study.settings.name}")
    console.print(
        f"{name}: the own limit is {limit.model_error:.1e} of the path off the equations;\n"
        f"it is by {limit.method}, and known to {limit.known_to:.1e}."
    )


def _runs(study: Convergence) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("integrator", no_wrap=True)
    for heading in ("step\n\\[ms]", "rtol", "own limit", "Richardson", "equations"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, trials in study.by_name.items():
        for trial in trials:
            table.add_row(
                name,
                "-" if trial.step is None else f"{trial.step * 1e3:.3g}",
                f"{trial.method.rtol:.0e}" if trial.method.step is None else "",
                scientific(trial.own),
                "" if trial.richardson is None else scientific(trial.richardson),
                scientific(trial.equations),
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


def convergence_picture(study: Convergence) -> Figure:
    """Two panels of path error over step, with the fitted slopes, and where they cannot go on."""
    figure = Figure(figsize=INCHES, layout="constrained")
    title = f"{study.scene.name}, {study.settings.name}: {study.duration:g} s"
    figure.suptitle(in_picture(title))
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    limit = study.limit
    lines: tuple[tuple[Reference, float, str], ...] = (
        ("own", limit.known_to, "the limit is known to this"),
        ("equations", limit.model_error, "the limit is this far off"),
    )
    for axes, (against, level, words) in zip(panels, lines, strict=True):
        _draw(axes, study, against)
        axes.axhline(level, color=EQUATIONS.colour, linestyle=":", linewidth=2, label=words)
        axes.set_title(TITLES[against], loc="left", fontsize=11)
        axes.set(xscale="log", yscale="log", xlabel="step, or its mean [ms]")
        axes.grid(alpha=0.3)
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(
            handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=9,
            frameon=False, title="order: fitted (dashed) ± standard error",
        )  # fmt: skip
    panels[0].set_ylabel("largest path error over path length")
    return figure


def _draw(axes: Axes, study: Convergence, against: Reference) -> None:
    labelled: list[Order] = []
    for name, trials in study.by_name.items():
        order = study.order(name, against)
        drawn = [(p.step * 1e3, e) for p in trials if p.step and (e := p.error(against))]
        words = f"{name}, of rtol" if name == ADAPTIVE else name
        label = f"{words}: {order_text(order)}" if order else f"{name}: no order"
        axes.plot(
            *np.array(drawn).reshape(-1, 2).T,
            linestyle="", markerfacecolor="none", label=label, **_mark(name),
        )  # fmt: skip
        if order is None or name == ADAPTIVE:
            continue
        ends = np.array([order.shortest, order.longest])
        axes.plot(ends * 1e3, order.error_at(ends), "--", color=_mark(name)["color"], linewidth=1)
        if not any(_near(order, other) for other in labelled):
            labelled.append(order)
            axes.annotate(
                f"slope {order.order:.2f}",
                (np.exp(order.ln_step) * 1e3, np.exp(order.ln_error)),
                xytext=(10, -12),
                textcoords="offset points",
                fontsize=9,
            )


def _mark(name: str) -> dict[str, Any]:
    """The mark of an integrator's trials; of the adaptive one, its fixed steps have its own."""
    of = INTEGRATORS.get(name, INTEGRATORS[ADAPTIVE])
    if name == ADAPTIVE:
        return {"marker": "*", "markersize": 9, "color": INK}
    colour = LABEL.colour if of.own else INK
    return {"marker": of.marker, "markersize": of.size, "color": colour}


def _near(order: Order, other: Order) -> bool:
    apart = (order.ln_step - other.ln_step, order.ln_error - other.ln_error)
    return max(map(abs, apart)) < NEAR


def rows(study: Convergence) -> list[dict[str, Any]]:
    """A row of plain numbers for every run."""
    return [
        {
            "integrator": trial.method.name,
            "step": trial.step,
            "rtol": trial.method.rtol if trial.method.step is None else None,
            "own_error": trial.own,
            "richardson": trial.richardson,
            "equations_error": trial.equations,
        }
        for trial in study.trials
    ]


def record(study: Convergence) -> dict[str, Any]:
    """The study as plain data; an order or a stall that there is not is None."""
    orders = {
        name: {
            against: {
                "order": asdict(order) if (order := study.order(name, against)) else None,
                "stalled_at": study.stalled_at(name, against),
            }
            for against in REFERENCES
        }
        for name in study.by_name
    }
    return {
        "scene": study.scene.name,
        "settings": study.settings.plain(),
        "duration": study.duration,
        "limit": {
            "by": str(study.limit.method),
            "known_to": study.limit.known_to,
            "model_error": study.limit.model_error,
        },
        "orders": orders,
        "runs": rows(study),
    }
