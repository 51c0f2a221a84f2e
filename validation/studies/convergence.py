"""Orders of convergence of all integrators on one contact model, against two references.

The first reference is the limit of the contact model itself for short steps: an error against it is
an error of the integrator. The second is the reduced equations: an error against them includes the
error of the model. With short steps only the distance between the references remains. A contact
model that rolls without slipping has no such distance, and both errors agree down to rounding.

Runs differ in the integrator and the step alone. MuJoCo silently raises the time constant in
solref to two steps (refsafe). Such long steps are left out because they would change the contact.
All steps end on the sample times, so MuJoCo's steps are fractions of the sample interval.
"""

from collections.abc import Callable
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
from robotball.engines.mujoco.settings import ADAPTIVE, INTEGRATORS, MOST_STEPS, OWN
from robotball.motion import path_error
from robotball.robot.looks import INK
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.reduced import LABEL as EQUATIONS

from ..output import Show, panels, progress_bar, scientific
from ..study import Column, Row, Study, table_of
from .measuring import Order, fit_order, stalled_at

FIXED = f"{ADAPTIVE} fixed"
# The order in theory, for a smooth motion.
ORDERS = {name: INTEGRATORS[name].order for name in OWN} | {FIXED: INTEGRATORS[ADAPTIVE].order}

# For each reference: the heading of its column, the title of its panel, the label of its line.
_REFERENCES = {
    "own": ("own limit", "against the contact model's own limit", "uncertainty of the limit"),
    "equations": ("equations", "against the reduced equations", "distance to the limit"),
}

_HALVINGS = 8  # halvings of the sample interval down to MuJoCo's shortest step
_LONGEST_STEP, _SHORTEST_STEP = 0.24, 0.005  # s, fixed steps of DOP853, in ratios of √2
_TOLERANCES = tuple(10.0**-n for n in range(4, 15))  # rtol of DOP853 with adaptive steps
# rtol of DOP853 for the limit; the first run that reaches the end counts.
_LIMITS = (LEAST_RTOL, 1e-13, 1e-11, 1e-9)
_ANY = 1.0  # an rtol that accepts every step
_STEPS_ALLOWED, _LEAST_ALLOWED = 600, 64  # DOP853's limit of steps: per second, and added
_INCHES = (11.0, 6.6)


@dataclass(frozen=True)
class _Method:
    """An integrator with a fixed step [s], or with adaptive steps for a tolerance."""

    integrator: str
    step: float | None = None
    rtol: float | None = None

    @property
    def name(self) -> str:
        """The name that all runs of a line share."""
        if self.integrator != ADAPTIVE:
            return self.integrator
        return ADAPTIVE if self.step is None else FIXED

    def __str__(self) -> str:
        size = f"rtol {self.rtol:g}" if self.step is None else f"step {self.step * 1e3:.3g} ms"
        return f"{self.name}, {size}"


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
        The limit of the model for short steps: the run `by` which it is computed, its uncertainty
        `known_to`, and `model_error`, its distance to the equations; both over the path's length.
    rows : list of dict
        The runs of each integrator, the longest step first: `step` [s], the mean if adaptive;
        `own_error` against the limit and `equations_error` against the equations, over the path's
        length, None if the run broke off; `richardson`, the estimate of `own_error` from this run
        and the run with the next longer step.
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
        """Return the order and the error at which an integrator's errors stall, or None.

        The order is the power of the step, or of the tolerance if steps are adaptive.
        """
        rows = self.by_name[name]
        sizes = [row["rtol"] or row["step"] for row in rows]
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
        If the contact model breaks off at any step.
    """
    theory = integrate(scene, times)
    interval = float(theory.times[1])
    finest = _Method("RK4", interval / 2**halvings)
    # A run with long steps may slip or leave the plane. Its error counts, so it continues.
    contact = replace(settings, stop_at_fault=False, max_steps=MOST_STEPS)
    model = build(scene, replace(contact, integrator="RK4", timestep=finest.step, rtol=None))
    methods = _methods(model, interval, halvings)

    @cache
    def run_of(method: _Method) -> ContactMotion | None:
        part = (run_of.cache_info().misses - 1) / (len(methods) + 1)
        show(min(part, 1.0), f"{scene.name}: {method}")
        return _whole_run(model, method, theory.times)

    best, limit = _limit(run_of, theory, finest)
    rows = [
        _order_row(run_of, best, theory, before, method)
        for before, method in zip([None, *methods[:-1]], methods, strict=True)
    ]
    return Runs(scene, settings, float(theory.times[-1]), limit, rows)


def _methods(model: Model, interval: float, halvings: int) -> list[_Method]:
    """Return all integrators at all steps and tolerances, the longest step first."""
    timeconst = float(model.compiled.pair_solref[0, 0])
    # refsafe does not change a direct stiffness and damping (negative solref).
    guarded = timeconst / 2 if timeconst > 0 else np.inf
    steps = [interval / 2**n for n in range(halvings)]
    # With longer steps, refsafe would change the contact.
    allowed = [step for step in steps if step <= guarded * (1 + 1e-9)]
    count = int(np.log2(_LONGEST_STEP / _SHORTEST_STEP) * 2) + 1
    return [
        *(_Method(name, step) for name in OWN for step in allowed),
        # Halving the step divides DOP853's error by 2⁸. Finer ratios give enough points above
        # rounding.
        *(_Method(ADAPTIVE, _LONGEST_STEP / 2 ** (n / 2), _ANY) for n in range(count)),
        *(_Method(ADAPTIVE, None, rtol) for rtol in _TOLERANCES),
    ]


def _whole_run(model: Model, method: _Method, times: Array) -> ContactMotion | None:
    """Return the run of a method; None if it broke off or took too many steps."""
    with np.errstate(all="ignore"):  # the report of a diverging run has the fault
        motion = run(_stepped(model, method, float(times[-1])), times)
    return motion if len(motion.times) == len(times) else None


def _stepped(model: Model, method: _Method, duration: float) -> Model:
    """Return the model with another integrator and step."""
    settings = replace(
        model.settings, integrator=method.integrator, timestep=method.step, rtol=method.rtol
    )
    if settings.adaptive:
        # DOP853 would take ever shorter steps if rounding prevents the tolerance.
        patience = _LEAST_ALLOWED + int(_STEPS_ALLOWED * duration)
        return replace(model, settings=replace(settings, max_steps=patience))
    assert method.step is not None
    same = replace(model, settings=settings)
    member = f"mjINT_{method.integrator.upper()}"
    # Change the compiled model: `build` could change more than the step.
    same.compiled.opt.integrator = getattr(mujoco.mjtIntegrator, member)
    same.compiled.opt.timestep = method.step
    return same


def _limit(run_of: _RunOf, theory: Motion, finest: _Method) -> tuple[Motion, dict[str, Any]]:
    """Return the limit of short steps, computed with DOP853, or with RK4 if that fails."""
    assert finest.step is not None
    # The change from a tenfold tolerance, or a doubled step, bounds the error of the limit.
    candidates = [
        *((_Method(ADAPTIVE, None, rtol), _Method(ADAPTIVE, None, 10 * rtol)) for rtol in _LIMITS),
        (finest, replace(finest, step=2 * finest.step)),
    ]
    for method, coarser in candidates:
        best, near = run_of(method), run_of(coarser)
        if best is not None and near is not None:
            known_to, model_error = path_error(near, best), path_error(best, theory)
            return best, {"by": str(method), "known_to": known_to, "model_error": model_error}
    raise InputError(
        f"{theory.scene.name}: the contact model breaks off even at steps of "
        f"{finest.step:g} s; there is no limit to converge to"
    )


def _order_row(
    run_of: _RunOf, best: Motion, theory: Motion, before: _Method | None, method: _Method
) -> dict[str, Any]:
    """Compare the run of a method with both references, and with the run before it."""
    row: dict[str, Any] = {"integrator": method.name, "step": method.step}
    row["rtol"] = method.rtol if method.step is None else None
    row |= dict.fromkeys(("own_error", "richardson", "equations_error"))
    if (motion := run_of(method)) is None:
        return row
    row["step"] = step = _step_of(method, motion)
    row["own_error"], row["equations_error"] = path_error(motion, best), path_error(motion, theory)
    same = before is not None and before.name == method.name and method.name in ORDERS
    if before is not None and same and (longer := run_of(before)) is not None:
        # If e ~ hᵖ, then e(h) - e(h/r) = e(h/r) (rᵖ - 1).
        factor = (_step_of(before, longer) / step) ** ORDERS[method.name]
        row["richardson"] = path_error(longer, motion) / (factor - 1)
    return row


def _step_of(method: _Method, motion: ContactMotion) -> float:
    """Return the step of a run [s], the mean if adaptive."""
    return method.step or float(motion.times[-1]) / motion.report.steps


_NOTE = (
    "Errors are path errors over the path's length. own limit: against the contact model with\n"
    "ever shorter steps. Richardson: estimate of that error from this run and the run at the next\n"
    "longer step. equations: against the equations, including the error of the model. points:\n"
    "runs of the fitted line. stalls: the error at which shorter steps stop helping. For DOP853\n"
    "with adaptive steps the order is a power of rtol."
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
    Column("rtol", "rtol", form=".0e", missing=""),
    Column("own limit", "own_error"),
    Column("Richardson", "richardson", missing=""),
    Column("equations", "equations_error"),
)


def _orders(study: Runs, name: str) -> Row:
    """Return a row with an integrator's order and stall against each reference."""
    row = {"integrator": name, "claim": f"{ORDERS[name]}" if name in ORDERS else "rtol"}
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
    """Draw path error over step and the fitted lines, in a panel for each reference."""
    slopes: dict[int, list[float]] = {}
    for name in study.by_name:
        order, _ = study.order(name, "own")
        if order is not None and name in ORDERS:
            slopes.setdefault(ORDERS[name], []).append(order.order)
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
        axes.set(xscale="log", yscale="log", xlabel="step, or its mean [ms]")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, **legend)
    both[0].set_ylabel("largest path error over path length")
    return figure


def _draw_orders(axes: Axes, study: Runs, against: str) -> None:
    for name, rows in study.by_name.items():
        order, _ = study.order(name, against)
        drawn = [(p["step"] * 1e3, e) for p in rows if p["step"] and (e := p[f"{against}_error"])]
        line = f"{name} over rtol" if name == ADAPTIVE else name
        label = f"{line}: {_order_text(order)}" if order else f"{name}: no order"
        points = np.array(drawn).reshape(-1, 2).T
        axes.plot(*points, linestyle="", markerfacecolor="none", label=label, **_mark(name))
        if order is not None and name != ADAPTIVE:
            ends = np.array([order.shortest, order.longest])
            axes.plot(
                ends * 1e3, order.error_at(ends), "--", color=_mark(name)["color"], linewidth=1
            )


def _mark(name: str) -> dict[str, Any]:
    """Return the style of an integrator's marks."""
    integrator = INTEGRATORS.get(name, INTEGRATORS[ADAPTIVE])
    if name == ADAPTIVE:
        return {"marker": "*", "markersize": 9, "color": INK}
    colour = LABEL.colour if integrator.own else INK
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
