"""Orders of convergence as a picture: error over step, against each reference."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball.engines.mujoco.settings import ADAPTIVE
from robotball.palette import ENGINE, INK, THEORY
from validation.studies.convergence.convergence import FIXED, Convergence, Reference
from validation.studies.convergence.convergence_table import order_text
from validation.studies.order import Order

INCHES = (11.0, 6.6)
# Of several that make the same error all can be seen: a large mark holds the smaller ones.
MARKS: dict[str, dict[str, Any]] = {
    "Euler": {"marker": "o", "markersize": 11, "color": ENGINE},
    "implicit": {"marker": "v", "markersize": 6, "color": ENGINE},
    "implicitfast": {"marker": "s", "markersize": 6, "color": ENGINE},
    "discrete": {"marker": "x", "markersize": 4, "color": ENGINE},
    "RK4": {"marker": "D", "markersize": 6, "color": ENGINE},
    FIXED: {"marker": "^", "markersize": 7, "color": INK},
    ADAPTIVE: {"marker": "*", "markersize": 9, "color": INK},
}
TITLES: dict[Reference, str] = {
    "own": "against the contact model's own limit",
    "equations": "against the reduced equations",
}
NEAR = 1.5  # in ln(step) and ln(error): slopes as near as that get one label


def convergence_picture(study: Convergence) -> Figure:
    """Two panels of path error over step, with the fitted slopes, and where they cannot go on."""
    figure = Figure(figsize=INCHES, layout="constrained")
    figure.suptitle(f"{study.scene.name}, {study.settings.name}: {study.duration:g} s")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    limit = study.limit
    lines: tuple[tuple[Reference, float, str], ...] = (
        ("own", limit.known_to, "the limit is known to this"),
        ("equations", limit.model_error, "the limit is this far off"),
    )
    for axes, (against, level, words) in zip(panels, lines, strict=True):
        _draw(axes, study, against)
        axes.axhline(level, color=THEORY, linestyle=":", linewidth=2, label=words)
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
    for name, points in study.by_name.items():
        order = study.order(name, against)
        drawn = [(p.step * 1e3, e) for p in points if p.step and (e := p.error(against))]
        words = f"{name}, of rtol" if name == ADAPTIVE else name
        label = f"{words}: {order_text(order)}" if order else f"{name}: no order"
        axes.plot(
            *np.array(drawn).reshape(-1, 2).T,
            linestyle="", markerfacecolor="none", label=label, **MARKS[name],
        )  # fmt: skip
        if order is None or name == ADAPTIVE:
            continue
        ends = np.array([order.shortest, order.longest])
        axes.plot(ends * 1e3, order.error_at(ends), "--", color=MARKS[name]["color"], linewidth=1)
        if not any(_near(order, other) for other in labelled):
            labelled.append(order)
            axes.annotate(
                f"slope {order.order:.2f}",
                (np.exp(order.ln_step) * 1e3, np.exp(order.ln_error)),
                xytext=(10, -12),
                textcoords="offset points",
                fontsize=9,
            )


def _near(order: Order, other: Order) -> bool:
    apart = (order.ln_step - other.ln_step, order.ln_error - other.ln_error)
    return max(map(abs, apart)) < NEAR
