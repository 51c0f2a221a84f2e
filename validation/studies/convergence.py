"""Orders of convergence: one contact model under every integrator, against two references.

Against the limit that the contact model itself tends to as steps shrink, an error is of the
integrator alone. Against the reduced equations it is that and the model's own: once steps are
short enough, what is left is the distance between the two limits. A contact model that rolls
truly has none, and the two errors agree down to rounding.

A run changes nothing but integrator and step. MuJoCo guards soft contacts in silence (refsafe): it
raises solref's time constant to two steps. Steps that long are left out, as the contact would no
longer be the one under study. Steps end on the sample times: MuJoCo's are fractions of the sample
interval.
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
from ..plots import note
from ..study import Column, Row, Study, table_of
from .orders import Order, fit_order, stalled_at

FIXED = f"{ADAPTIVE} fixed"
# The order that theory claims for a smooth motion.
ORDERS = {name: INTEGRATORS[name].order for name in OWN} | {FIXED: INTEGRATORS[ADAPTIVE].order}

# The heading of a column, the title of a panel, and the words for the line in it.
_REFERENCES = {
    "own": ("own limit", "against the contact model's own limit", "the limit is known to this"),
    "equations": ("equations", "against the reduced equations", "the limit is this far off"),
}

_HALVINGS = 8  # of the sample interval, for MuJoCo's shortest step
_LONGEST_STEP, _SHORTEST_STEP = 0.24, 0.005  # s, steps of DOP853, in ratios of √2
_TOLERANCES = tuple(10.0**-n for n in range(4, 15))  # of DOP853 with steps of its own
# Its tolerances for the limit, of which the first counts that comes to its end.
_LIMITS = (LEAST_RTOL, 1e-13, 1e-11, 1e-9)
_ANY = 1.0  # a tolerance that lets every step pass
_STEPS_ALLOWED, _LEAST_ALLOWED = 600, 64  # steps a second, and besides, before DOP853 is given up


@dataclass(frozen=True)
class _Method:
    """An integrator at a step [s], or at a tolerance with the steps that it takes to keep it."""

    integrator: str
    step: float | None = None
    rtol: float | None = None

    @property
    def name(self) -> str:
        """Return the integrator's name, by which runs at many steps belong together."""
        if self.integrator != ADAPTIVE:
            return self.integrator
        return ADAPTIVE if self.step is None else FIXED

    def __str__(self) -> str:
        size = f"rtol {self.rtol:g}" if self.step is None else f"step {self.step * 1e3:.3g} ms"
        return f"{self.name}, {size}"


@dataclass(frozen=True)
class Runs:
    """All runs of one contact model.

    rows   a row each, those of one integrator together, the longest step first. step: s, the mean
           of a run that chooses its own. Errors are of the path, over its length, None where it did
           not come to its end: own_error against the contact model's own limit, equations_error
           against the reduced equations; richardson: what the run at the next longer step says of
           own_error, without either reference
    limit  the limit that the model tends to: the run it is taken from, how well it is known, and
           how far it is from the equations, both over the path's length
    """

    scene: Scene
    settings: Settings
    duration: float
    limit: dict[str, Any]
    rows: list[dict[str, Any]]

    @cached_property
    def by_name(self) -> dict[str, list[dict[str, Any]]]:
        """Return the rows of each integrator."""
        names = dict.fromkeys(row["integrator"] for row in self.rows)
        return {name: [row for row in self.rows if row["integrator"] == name] for name in names}

    def order(self, name: str, against: str) -> tuple[Order | None, float | None]:
        """Return the power of the step, or of DOP853's tolerance, with which its errors fall.

        Besides, the error at which they stop falling; each is None where there is none.
        """
        rows = self.by_name[name]
        # A run that chooses its steps has an order in its tolerance only.
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

    times: (n,) s, equally spaced from 0, the scene's own if None; halvings: of the sample interval,
    down to MuJoCo's shortest step; show: called with the part done and the next run.
    Raises InputError where the contact model breaks off however short the steps.
    """
    theory = integrate(scene, times)
    interval = float(theory.times[1])
    finest = _Method("RK4", interval / 2**halvings)
    # A run at long steps may slip or leave the plane: that is a large error, and no reason to stop.
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
    """Return all integrators at all steps and tolerances, the longest step of each first."""
    timeconst = float(model.compiled.pair_solref[0, 0])
    # A stiffness and damping given directly (negative solref) is left as it is.
    guarded = timeconst / 2 if timeconst > 0 else np.inf
    steps = [interval / 2**n for n in range(halvings)]
    # refsafe would raise the time constant of longer ones, and the contact would be another.
    allowed = [step for step in steps if step <= guarded * (1 + 1e-9)]
    count = int(np.log2(_LONGEST_STEP / _SHORTEST_STEP) * 2) + 1
    return [
        *(_Method(name, step) for name in OWN for step in allowed),
        # DOP853's error falls by 2⁸ at half the step, so that halves alone would leave too few
        # points between its longest step and rounding.
        *(_Method(ADAPTIVE, _LONGEST_STEP / 2 ** (n / 2), _ANY) for n in range(count)),
        *(_Method(ADAPTIVE, None, rtol) for rtol in _TOLERANCES),
    ]


def _whole_run(model: Model, method: _Method, times: Array) -> ContactMotion | None:
    """Return the run of a method; None if it broke off or would not end."""
    with np.errstate(all="ignore"):  # a run that diverges says so itself
        motion = run(_stepped(model, method, float(times[-1])), times)
    return motion if len(motion.times) == len(times) else None


def _stepped(model: Model, method: _Method, duration: float) -> Model:
    """Compile the model's MJCF afresh, under another integrator."""
    settings = replace(
        model.settings, integrator=method.integrator, timestep=method.step, rtol=method.rtol
    )
    if settings.adaptive:
        # Where rounding keeps it from its tolerance, DOP853 would take ever smaller steps.
        patience = _LEAST_ALLOWED + int(_STEPS_ALLOWED * duration)
        return replace(model, settings=replace(settings, max_steps=patience))
    assert method.step is not None
    same = replace(model, settings=settings)
    member = f"mjINT_{method.integrator.upper()}"
    # In the compiled model, not by `build`, so that nothing else can change with the step.
    same.compiled.opt.integrator = getattr(mujoco.mjtIntegrator, member)
    same.compiled.opt.timestep = method.step
    return same


def _limit(run_of: _RunOf, theory: Motion, finest: _Method) -> tuple[Motion, dict[str, Any]]:
    """Return the limit of short steps, by DOP853 where the motion is smooth enough, or RK4."""
    assert finest.step is not None
    # What ten times the tolerance, or twice the step, changes is more than what is still wrong.
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
    """Compare the run of a method with both references, and with the one before it."""
    found, step, rtol = run_of(method), method.step, method.rtol if method.step is None else None
    own = equations = estimate = None
    if found is not None:
        step = _step_of(method, found)
        own, equations = path_error(found, best), path_error(found, theory)
        alike = before is not None and before.name == method.name and method.name in ORDERS
        if before is not None and alike and (longer := run_of(before)) is not None:
            fall = (_step_of(before, longer) / step) ** ORDERS[method.name]
            # By Richardson: e(h) - e(h/r) = e(h/r) (rᵖ - 1) where e goes as hᵖ.
            estimate = path_error(longer, found) / (fall - 1)
    return {
        "integrator": method.name, "step": step, "rtol": rtol,
        "own_error": own, "richardson": estimate, "equations_error": equations,
    }  # fmt: skip


def _step_of(method: _Method, motion: ContactMotion) -> float:
    """Return the step of a run [s], the mean if it chose its steps."""
    return method.step or float(motion.times[-1]) / motion.report.steps


_NOTE = (
    "Errors are of the path, over its length. own limit: what the contact model\n"
    "tends to as steps shrink. Richardson: an estimate of that error from a run and\n"
    "the one at the next longer step. equations: that error and the model's own.\n"
    "points: runs that an order comes from. stalls: the error that no shorter step reduces.\n"
    "DOP853 alone chooses its steps: the order is its power of rtol."
)
_INCHES = (11.0, 6.6)
_NEAR_SLOPES = 2.5  # in ln(step) and ln(error): slopes as near as that get one label


def convergence_study(scene: Scene, settings: Settings, times: Array, quick: bool) -> Study:
    """Run the integrators over `times` (n,) [s], with progress shown."""
    with progress_bar(1) as show:
        halvings = _HALVINGS - 2 * quick
        return _convergence_study(measure_convergence(scene, settings, times, halvings, show))


def _convergence_study(study: Runs) -> Study:
    """Return every run, the orders, and the distance of the two references."""
    limit, name = study.limit, escape(f"{study.scene.name}, {study.settings.name}")
    return Study(
        study.scene.name, LABEL, [study.settings.name, "convergence"], study.rows, _record(study),
        shown=(
            table_of(_RUNS, study.rows, section="integrator"),
            table_of(_ORDER_COLUMNS, [_orders(study, each) for each in study.by_name]),
            _NOTE,
            f"{name}: the own limit is {limit['model_error']:.1e} of the path away from the "
            f"equations; {limit['by']} computes it, right to {limit['known_to']:.1e}.",
        ),
        picture=_convergence_picture(study),
    )  # fmt: skip


_RUNS = (
    Column("integrator", "integrator", words=True),
    Column("step", "step", "ms", form=".3g", scale=1e3),
    Column("rtol", "rtol", form=".0e", missing=""),
    Column("own limit", "own_error"),
    Column("Richardson", "richardson", missing=""),
    Column("equations", "equations_error"),
)


def _orders(study: Runs, name: str) -> Row:
    """Return the texts of an integrator's orders, against each reference."""
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
    """Return the order with its standard error; a dash where there is none."""
    return "-" if order is None else f"{order.order:.2f} ± {order.stderr:.2f}"


def _convergence_picture(study: Runs) -> Figure:
    """Draw path error over step, the fitted slopes and their lower ends, for each reference."""
    falls: dict[int, list[float]] = {}
    for name in study.by_name:
        order, _ = study.order(name, "own")
        if order is not None and name in ORDERS:
            falls.setdefault(ORDERS[name], []).append(order.order)
    found = [f"{2 ** np.mean(some):.0f} at order {claim}" for claim, some in falls.items()]
    words = f"half the step divides errors by {', '.join(found)}" if found else "no order is known"
    heading = f"{study.scene.name}, {study.settings.name}: {words}"
    figure, both = panels(heading, _INCHES, 1, 2, sharex=True, sharey=True)
    levels = (study.limit["known_to"], study.limit["model_error"])
    for axes, level, (against, (_, heading, words)) in zip(
        both, levels, _REFERENCES.items(), strict=True
    ):
        _draw_orders(axes, study, against)
        axes.axhline(level, color=EQUATIONS.colour, linestyle=":", linewidth=2, label=words)
        axes.set_title(heading, loc="left", fontsize=11)
        axes.set(xscale="log", yscale="log", xlabel="step, or its mean [ms]")
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=9, frameon=False,
            title="order: fitted (dashed) ± standard error",
        )  # fmt: skip
    both[0].set_ylabel("largest path error over path length")
    return figure


def _draw_orders(axes: Axes, study: Runs, against: str) -> None:
    labelled: list[Array] = []
    for name, rows in study.by_name.items():
        order, _ = study.order(name, against)
        # By the mean step of a run that chooses them, so that all stand over one scale.
        drawn = [(p["step"] * 1e3, e) for p in rows if p["step"] and (e := p[f"{against}_error"])]
        words = f"{name}, of rtol" if name == ADAPTIVE else name
        label = f"{words}: {_order_text(order)}" if order else f"{name}: no order"
        axes.plot(
            *np.array(drawn).reshape(-1, 2).T,
            linestyle="", markerfacecolor="none", label=label, **_mark(name),
        )  # fmt: skip
        if order is None or name == ADAPTIVE:
            continue
        ends = np.array([order.shortest, order.longest])
        axes.plot(ends * 1e3, order.error_at(ends), "--", color=_mark(name)["color"], linewidth=1)
        place = np.array([order.ln_step, order.ln_error])
        if not any(np.abs(place - other).max() < _NEAR_SLOPES for other in labelled):
            labelled.append(place)
            middle = (np.exp(order.ln_step) * 1e3, np.exp(order.ln_error))
            note(axes, f"slope {order.order:.2f}", middle, (10, -12), fontsize=9)


def _mark(name: str) -> dict[str, Any]:
    """Return the mark of an integrator's runs."""
    of = INTEGRATORS.get(name, INTEGRATORS[ADAPTIVE])
    if name == ADAPTIVE:
        return {"marker": "*", "markersize": 9, "color": INK}
    colour = LABEL.colour if of.own else INK
    return {"marker": of.marker, "markersize": of.size, "color": colour}


def _record(study: Runs) -> dict[str, Any]:
    """Return the study as plain data; an order or a stall that there is not is None."""

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
