"""Orders of convergence of all integrators on one contact model, against two references.

The first reference is the limit of the contact model itself for short steps: an error against it is
an error of the integrator. The second is the reduced equations: an error against them includes the
error of the model. With short steps only the distance between the references remains. A contact
model that rolls without slipping has no such distance, and both errors agree down to rounding.

Runs differ only in the integrator and the step. MuJoCo silently raises the time constant in solref
to two steps (refsafe). Such long steps are left out because they would change the contact. MuJoCo's
steps end on the sample times, so each step is a fraction of the sample interval.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.markup import escape

from robotball import ContactMotion, InputError, Motion, Scene, Settings, integrate
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import INTEGRATORS, MOST_STEPS, ORDER_8, OWN
from robotball.motion import path_error
from robotball.robot.looks import INK
from robotball.rotations import Array
from robotball.theory.reduced import LABEL as EQUATIONS

from ..output import Show, panels, progress_bar, scientific
from ..study import Column, Row, Study, table_of
from .measuring import Order, fit_order, stalled_at

# For each reference: the heading of its column, the title of its panel, the label of its line.
_REFERENCES = {
    "own": ("own limit", "against the contact model's own limit", "uncertainty of the limit"),
    "equations": ("equations", "against the reduced equations", "distance to the limit"),
}

_HALVINGS = 8  # halvings of the sample interval down to MuJoCo's shortest step
# Halving the step divides the error of order 8 by 2⁸. Finer ratios give enough points above
# rounding.
_STEPS_8 = tuple(0.1 / 2 ** (n / 2) for n in range(7))  # s
# Halvings of the sample interval, for the limit. Stiff contacts need short steps of order 8. With
# other contacts, rounding in many steps is larger than the error of the steps.
_LIMIT_8 = range(1, 5)
_INCHES = (11.0, 6.6)


@dataclass(frozen=True)
class _Method:
    """An integrator with a step [s]."""

    integrator: str
    step: float

    def __str__(self) -> str:
        return f"{self.integrator}, step {self.step * 1e3:.3g} ms"


@dataclass(frozen=True)
class Runs:
    """All runs of one contact model.

    Attributes
    ----------
    scene, settings : Scene, Settings
        The scene and the settings of the contact model.
    duration : float, s
        The simulated time.
    limit : dict
        The limit of the model for short steps. `by` is the run that gives the limit, `known_to` its
        uncertainty, and `model_error` its distance from the equations; the last two are relative to
        the path's length.
    rows : list of dict
        The runs of each integrator, the longest step first. `step` is in s. `own_error` against the
        limit and `equations_error` against the equations are relative to the path's length, and
        None if the run failed. `richardson` is the estimate of `own_error` from this run and the
        run with the next longer step.
    """

    scene: Scene
    settings: Settings
    duration: float
    limit: dict[str, Any]
    rows: list[dict[str, Any]]

    @cached_property
    def by_name(self) -> dict[str, list[dict[str, Any]]]:
        """The rows of each integrator."""
        names = dict.fromkeys(row["integrator"] for row in self.rows)
        return {name: [row for row in self.rows if row["integrator"] == name] for name in names}

    def order(self, name: str, against: str) -> tuple[Order | None, float | None]:
        """Return the order and the error at which an integrator's errors stall, or None."""
        rows = self.by_name[name]
        sizes = [row["step"] for row in rows]
        errors = [row[f"{against}_error"] for row in rows]
        known_to = self.limit["known_to"] if against == "own" else 0.0
        return fit_order(sizes, errors, known_to), stalled_at(sizes, errors)


_RunOf = Callable[[_Method], ContactMotion | None]


def measure_convergence(
    scene: Scene,
    settings: Settings,
    times: Array | None = None,
    halvings: int = _HALVINGS,
    show: Show = lambda part, what: None,
) -> Runs:
    """Run every integrator at many steps on the contact model of `settings`.

    Parameters
    ----------
    scene, settings : Scene, Settings
        The scene and the contact model.
    times : (n,), s, optional
        Equally spaced sample times from 0. The default is `scene.times`.
    halvings : int
        Halvings of the sample interval down to MuJoCo's shortest step.
    show : callable
        Called with the fraction done and the next run.

    Raises
    ------
    InputError
        If the contact model fails even at short steps, so that there is no limit.
    """
    theory = integrate(scene, times)
    interval = float(theory.times[1])
    finest = _Method("RK4", interval / 2**halvings)
    # A run with long steps may slip or leave the plane. Its error counts, so it continues.
    contact = replace(settings, stop_at_fault=False, max_steps=MOST_STEPS)
    model = build(scene, replace(contact, integrator="RK4", timestep=finest.step))
    methods = _methods(model, interval, halvings)

    @cache
    def run_of(method: _Method) -> ContactMotion | None:
        part = (run_of.cache_info().misses - 1) / (len(methods) + 1)
        show(min(part, 1.0), f"{scene.name}: {method}")
        return _whole_run(model, method, theory.times)

    finest_8 = [_Method(ORDER_8, interval / 2**n) for n in _LIMIT_8]
    best, limit = _limit(run_of, theory, [finest, *finest_8])
    rows = [
        _order_row(run_of, best, theory, before, method)
        for before, method in zip([None, *methods[:-1]], methods, strict=True)
    ]
    # Steps that are as long as the run, or that end on breakpoints, may be equal.
    different = {(row["integrator"], row["step"]): row for row in rows}
    return Runs(scene, settings, float(theory.times[-1]), limit, [*different.values()])


def _methods(model: Model, interval: float, halvings: int) -> list[_Method]:
    """Return all integrators at all steps, the longest first."""
    timeconst = float(model.compiled.pair_solref[0, 0])
    # refsafe does not change a direct stiffness and damping (negative solref).
    guarded = timeconst / 2 if timeconst > 0 else np.inf
    steps = [interval / 2**n for n in range(halvings)]
    # With longer steps, refsafe would change the contact.
    allowed = [step for step in steps if step <= guarded * (1 + 1e-9)]
    own = [_Method(name, step) for name in OWN for step in allowed]
    return own + [_Method(ORDER_8, step) for step in _STEPS_8]


def _whole_run(model: Model, method: _Method, times: Array) -> ContactMotion | None:
    """Return the run of a method; None if it failed."""
    with np.errstate(all="ignore"):  # the report of a diverging run has the fault
        motion = run(_stepped(model, method), times)
    return motion if len(motion.times) == len(times) else None


def _stepped(model: Model, method: _Method) -> Model:
    """Return the model with another integrator and step."""
    settings = replace(model.settings, integrator=method.integrator, timestep=method.step)
    if not settings.own:  # a tolerance would shorten the steps
        return replace(model, settings=replace(settings, error_tolerance=1.0))
    same = replace(model, settings=settings)
    member = f"mjINT_{method.integrator.upper()}"
    # Change the compiled model: `build` could change more than the step.
    same.compiled.opt.integrator = getattr(mujoco.mjtIntegrator, member)
    same.compiled.opt.timestep = method.step
    return same


def _limit(
    run_of: _RunOf, theory: Motion, finest: Sequence[_Method]
) -> tuple[Motion, dict[str, Any]]:
    """Return the limit of short steps: the finest run with the smallest uncertainty."""
    limits: list[tuple[Motion, dict[str, Any]]] = []
    for method in finest:
        best, near = run_of(method), run_of(replace(method, step=2 * method.step))
        # Breakpoints may end steps so often that a doubled step changes nothing.
        if best and near and near.report.timestep > best.report.timestep:
            # The change from a doubled step bounds the error of the limit.
            known_to, model_error = path_error(near, best), path_error(best, theory)
            limit = {"by": str(method), "known_to": known_to, "model_error": model_error}
            limits.append((best, limit))
    if not limits:
        raise InputError(
            f"{theory.scene.name}: the contact model breaks off even at steps of "
            f"{finest[0].step:g} s; there is no limit to converge to"
        )
    return min(limits, key=lambda known: known[1]["known_to"])


def _order_row(
    run_of: _RunOf, best: Motion, theory: Motion, before: _Method | None, method: _Method
) -> dict[str, Any]:
    """Compare the run of a method with both references, and with the run before it."""
    row: dict[str, Any] = {"integrator": method.integrator, "step": method.step}
    row |= dict.fromkeys(("own_error", "richardson", "equations_error"))
    if (motion := run_of(method)) is None:
        return row
    row["step"] = step = motion.report.timestep
    row["own_error"], row["equations_error"] = path_error(motion, best), path_error(motion, theory)
    same = before is not None and before.integrator == method.integrator
    longer = run_of(before) if before is not None and same else None
    if longer is not None and longer.report.timestep > step:
        # If e ~ hᵖ, then e(h) - e(h/r) = e(h/r) (rᵖ - 1).
        factor = (longer.report.timestep / step) ** INTEGRATORS[method.integrator].order
        row["richardson"] = path_error(longer, motion) / (factor - 1)
    return row


_NOTE = (
    "Errors are path errors over the path's length. own limit: against the contact model with\n"
    "ever shorter steps. Richardson: estimate of that error from this run and the run at the next\n"
    "longer step. equations: against the equations, including the error of the model. points:\n"
    "runs of the fitted line. stalls: the error at which shorter steps stop helping."
)


def convergence_study(scene: Scene, settings: Settings, times: Array, quick: bool) -> Study:
    """Run the integrators over `times` (n,) [s], with progress shown."""
    with progress_bar(1) as show:
        halvings = _HALVINGS - 2 * quick
        return _convergence_study(measure_convergence(scene, settings, times, halvings, show))


def _convergence_study(study: Runs) -> Study:
    """Return the study with all runs, the orders, and the distance of the two references."""
    limit, name = study.limit, escape(f"{study.scene.name}, {study.settings.name}")
    shown = (
        table_of(_RUNS, study.rows, section="integrator"),
        table_of(_ORDER_COLUMNS, [_orders(study, integrator) for integrator in study.by_name]),
        _NOTE,
        f"{name}: the own limit is {limit['model_error']:.1e} of the path away from the equations; "
        f"computed with {limit['by']}, accurate to {limit['known_to']:.1e}.",
    )
    stem, picture = [study.settings.name, "convergence"], _convergence_picture(study)
    return Study(study.scene.name, LABEL, stem, study.rows, _record(study), shown, picture)


_RUNS = (
    Column("integrator", "integrator", words=True),
    Column("step", "step", "ms", form=".3g", scale=1e3),
    Column("own limit", "own_error"),
    Column("Richardson", "richardson", missing=""),
    Column("equations", "equations_error"),
)


def _orders(study: Runs, name: str) -> Row:
    """Return a row with an integrator's order and stall against each reference."""
    row = {"integrator": name, "claim": f"{INTEGRATORS[name].order}"}
    for against in _REFERENCES:
        order, stall = study.order(name, against)
        row[against] = _order_text(order)
        row[f"{against} points"] = f"{order.points}" if order else ""
        row[f"{against} stalls"] = "" if stall is None else scientific(stall)
    return row


_ORDER_COLUMNS = (
    Column("integrator", "integrator", words=True),
    Column("claim", "claim"),
    *(
        Column(name or header, f"{against} {name}".rstrip())
        for against, (header, *_) in _REFERENCES.items()
        for name in ("", "points", "stalls")
    ),
)


def _order_text(order: Order | None) -> str:
    """Return the order with its standard error, or a dash."""
    return "-" if order is None else f"{order.order:.2f} ± {order.stderr:.2f}"


def _convergence_picture(study: Runs) -> Figure:
    """Draw path errors against steps, with fitted lines, in a panel for each reference."""
    slopes: dict[int, list[float]] = {}
    for name in study.by_name:
        order, _ = study.order(name, "own")
        if order is not None:
            slopes.setdefault(INTEGRATORS[name].order, []).append(order.order)
    factors = [f"{2 ** np.mean(fits):.0f} at order {claim}" for claim, fits in slopes.items()]
    finding = f"half the step divides errors by {', '.join(factors)}" if factors else "no order"
    heading = f"{study.scene.name}, {study.settings.name}: {finding}"
    figure, both = panels(heading, _INCHES, 1, 2, sharex=True, sharey=True)
    levels = (study.limit["known_to"], study.limit["model_error"])
    legend: Any = {"title": "order: fitted (dashed) ± standard error", "fontsize": 9, "ncols": 2}
    for axes, level, (against, (_, title, label)) in zip(
        both, levels, _REFERENCES.items(), strict=True
    ):
        _draw_orders(axes, study, against)
        axes.axhline(level, color=EQUATIONS.colour, linestyle=":", linewidth=2, label=label)
        axes.set_title(title, loc="left", fontsize=11)
        axes.set(xscale="log", yscale="log", xlabel="step [ms]")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, **legend)
    both[0].set_ylabel("largest path error over path length")
    return figure


def _draw_orders(axes: Axes, study: Runs, against: str) -> None:
    for name, rows in study.by_name.items():
        order, _ = study.order(name, against)
        drawn = [(p["step"] * 1e3, e) for p in rows if (e := p[f"{against}_error"])]
        label = f"{name}: {_order_text(order)}" if order else f"{name}: no order"
        points = np.array(drawn).reshape(-1, 2).T
        axes.plot(*points, linestyle="", markerfacecolor="none", label=label, **_mark(name))
        if order is not None:
            ends = np.array([order.shortest, order.longest])
            axes.plot(
                ends * 1e3, order.error_at(ends), "--", color=_mark(name)["color"], linewidth=1
            )


def _mark(name: str) -> dict[str, Any]:
    """Return the style of an integrator's marks."""
    integrator, colour = INTEGRATORS[name], INK if name == ORDER_8 else LABEL.colour
    return {"marker": integrator.marker, "markersize": integrator.size, "color": colour}


def _record(study: Runs) -> dict[str, Any]:
    """Return the study as plain data; missing orders and stalls are None."""

    def plain(order: Order | None, stall: float | None) -> dict[str, Any]:
        return {"order": order and asdict(order), "stalled_at": stall}

    return {
        "scene": study.scene.name,
        "settings": study.settings.plain(),
        "duration": study.duration,
        "limit": study.limit,
        "orders": {
            name: {against: plain(*study.order(name, against)) for against in _REFERENCES}
            for name in study.by_name
        },
        "runs": study.rows,
    }
