"""Error against processor time for many configurations, and the Pareto front.

All combinations of choices would take tens of thousands of runs. Instead, the configurations form
lines, stars and a random sample. A line varies the timestep of the recipe or of the naive model. A
star varies one choice of the recipe or of the naive model at a time. The sample combines choices at
random.
"""

import logging
import math
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import chain, product
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.markup import escape

from robotball import PRESETS, Scene, Settings
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import (
    FIRST_ORDER,
    INTEGRATORS,
    MUJOCOS_DEFAULT,
    NAIVE,
    ORDER_8,
    Prescribed,
    recipe,
    settings_from,
)
from robotball.robot.looks import ACCENT, FAINT, INK
from robotball.robot.motors import Servo
from robotball.view.tracks import PRESET_LOOKS

from ..agreement import Agreement
from ..options import Sweep
from ..output import known, scientific
from ..plots import note
from ..study import (
    CANCELLED,
    Column,
    Row,
    Study,
    cost_axes,
    pareto_front,
    reference,
    table_of,
)
from ..sweeps import Cell, Result, rows_of
from .measuring import fit_order, measure_costs, simulated_second

_RECIPE = recipe("recipe", 1.0, timestep=PRESETS["balanced"].timestep)  # tolerates any error
TARGET = 1e-6  # the path error at which first order and the front are compared

_Options = dict[str, Any]

_ALL = ("RK4", *FIRST_ORDER)
_INTERVAL = 0.1  # s between samples, and the longest step
_LINE = tuple(_INTERVAL / 2**k for k in range(10))  # s; RK4 gains nothing below 1 ms
_SHOWN_STEPS = (20e-3, 5e-3, 1e-3)  # s
_FINE_STEPS = (5e-3, 1e-3, 0.2e-3)  # s, in the range of first-order convergence
_SAMPLE = 120  # random combinations
_SEED = 4
_LIMIT = 60.0  # s, time limit of a run
_ROUNDS = 3  # rounds of timing, after a warm-up round
_TIMED = 0.05  # s of processor time measured in each round
_ORDER = 1.25  # largest order of a first-order line; a steeper line has cancelling errors
_FEW = 3  # changes named in a description; more are counted
_WILD = 1e3  # relative path error above which a run is not drawn
_ABOVE = ("exact",)  # presets whose names are above their marks, at the left end of the front


def _both(*names: str) -> tuple[_Options, _Options]:
    """Return these options of the recipe and of the naive model."""
    return {n: getattr(_RECIPE, n) for n in names}, {n: getattr(NAIVE, n) for n in names}


_SOLVER = "solver", "iterations", "tolerance", "ls_tolerance", "jacobian", "warmstart", "island"
_EXACT = {"tolerance": 0.0, "jacobian": "dense"}  # needed by solvers if hinges have huge inertias
_CHOICES: Mapping[str, Sequence[_Options]] = {
    "solver": (
        *_both(*_SOLVER),
        {"solver": "PGS", "iterations": 1, "warmstart": "disable", **_EXACT},
        {"solver": "PGS", "iterations": 30, "warmstart": None, **_EXACT},
        {"solver": "Newton", "iterations": 3, "warmstart": "disable", **_EXACT},
        {"solver": "CG", "iterations": 10, "warmstart": "disable", **_EXACT},
    ),
    "cone": _both("cone"),
    "impratio": ({"impratio": None}, {"impratio": 1e2}, {"impratio": 1e4}),
    "noslip": (*_both("noslip_iterations", "noslip_tolerance"), {"noslip_iterations": 5}),
    "solref": (*_both("solref", "solimp"), {"solref": (0.4, 1.0)}),
    "solreffriction": (
        *_both("solreffriction"),
        {"solreffriction": (-1.0, -0.1)},
        {"solreffriction": (-1.0, -10.0)},
    ),
    "drive": (
        *_both("drive"),
        {"drive": Prescribed(armature=1e8)},
        {"drive": Servo(gain=1e4)},
    ),
    "friction": _both("sliding_friction", "torsional_friction"),
    "start": _both("start_in_equilibrium"),
}  # fmt: skip


def configurations(quick: bool = False) -> list[Settings]:
    """Return the distinct settings of the study, presets first; few in the quick form."""
    if quick:
        every = [*PRESETS.values(), *_lines((_RECIPE,), _LINE[3:6], ("RK4", "Euler"))]
        order_8 = _lines((_RECIPE,), _LINE[1:3], (ORDER_8,))
        every += [*order_8, *_star(NAIVE, _SHOWN_STEPS[1:2], ("RK4",))][::4]
    else:
        every = [
            *PRESETS.values(),
            *_lines((_RECIPE, NAIVE), _LINE, _ALL),
            *_lines((_RECIPE,), _LINE[:6], (ORDER_8,)),
            *_star(_RECIPE, _SHOWN_STEPS, ("RK4",)),
            # With long steps, first-order errors would hide the effect of a choice.
            *_star(_RECIPE, _FINE_STEPS, FIRST_ORDER),
            *_star(NAIVE, _SHOWN_STEPS[1:], _ALL),
            *_sample(),
        ]
    distinct: dict[str, Settings] = {}
    for settings in every:  # lines, stars and the sample overlap
        distinct.setdefault(repr(options_of(settings)), settings)
    return list(distinct.values())


def _lines(
    bases: Sequence[Settings], steps: Sequence[float], integrators: Sequence[str]
) -> Iterator[Settings]:
    """Yield the base settings with each integrator at each step."""
    for base, integrator, step in product(bases, integrators, steps):
        yield replace(base, integrator=integrator, timestep=step)


def _star(base: Settings, steps: Sequence[float], integrators: Sequence[str]) -> Iterator[Settings]:
    """Yield the base settings with each alternative of a single choice."""
    for level in chain.from_iterable(_CHOICES.values()):
        if (changed := replace(base, **level)) != base:
            yield from _lines((changed,), steps, integrators)


def _sample() -> Iterator[Settings]:
    """Yield random combinations of all choices."""
    pick = random.Random(_SEED).choice
    for _ in range(_SAMPLE):
        level = dict(chain.from_iterable(pick(levels).items() for levels in _CHOICES.values()))
        yield replace(_RECIPE, integrator=pick(_ALL), timestep=pick(_SHOWN_STEPS), **level)


_NOT_OPTIONS = ("name", "error_tolerance", "stop_at_fault", "max_steps")  # robotball's settings
_STEPS = (*_NOT_OPTIONS, "integrator", "timestep")
_DEFAULTS = {field.name: field.default for field in fields(Settings)}


def options_of(settings: Settings) -> _Options:
    """Return the options that differ from MuJoCo's defaults, as plain JSON data."""
    return {
        name: value
        for name, value in settings.plain().items()
        if name not in _NOT_OPTIONS and value != _DEFAULTS[name]
    }


def describe(options: Mapping[str, Any]) -> str:
    """Describe options by their changes from the recipe or the naive model, without the steps."""
    described = ([base.name, *_changes(options, options_of(base))] for base in (_RECIPE, NAIVE))
    name, *changes = min(described, key=len)
    return ", ".join([name, *(changes if len(changes) <= _FEW else [f"{len(changes)} changes"])])


def _changes(options: Mapping[str, Any], base: _Options) -> list[str]:
    """Describe each option that differs from the base."""
    values = {name: options.get(name) for name in _DEFAULTS if name not in _STEPS}
    return [f"{name} {_text(v)}" for name, v in values.items() if v != base.get(name)]


def _text(value: Any) -> str:
    """Return the value of an option as text; a drive is a mapping of its numbers."""
    if isinstance(value, dict):
        return " ".join(f"{key} {number:g}" for key, number in value.items() if number)
    if isinstance(value, list):
        return " ".join(f"{number:g}" for number in value)
    if value is None:
        return "default"
    return f"{value:g}" if isinstance(value, float) else str(value)


def settings_with(options: Mapping[str, Any]) -> Settings:
    """Return settings with these options that continue after a fault. Other keys are ignored."""
    known = {key: value for key, value in options.items() if key in _DEFAULTS}
    fixed = {"error_tolerance": _RECIPE.error_tolerance, "stop_at_fault": False}
    return settings_from({**known, **fixed, "name": describe(options)})


def cells_of(shared: Cell, settings: Sequence[Settings], rounds: int) -> list[Cell]:
    """Return a cell for each of the settings: the shared scene, rounds of timing, and options."""
    return [{**shared, "rounds": rounds, **options_of(variant)} for variant in settings]


def measure_settings(cell: Cell) -> dict[str, Any]:
    """Measure the errors, the faults, and the cost of a simulated second."""
    scene, theory = reference(cell, _INTERVAL)
    model = build(scene, settings_with(cell))
    logging.getLogger("absl").setLevel(logging.ERROR)  # the record has the faults
    agreement = Agreement(theory, run(model, theory.times))
    # Time a shorter part of the motion if the configuration is slow.
    part = min(1.0, _TIMED / agreement.report.seconds)
    timed = theory.times[: max(2, math.ceil(len(theory.times) * part))]
    (cost,) = measure_costs([simulated_second(model, timed)], cell["rounds"])
    least, most = cost.spread
    return {
        "path_error": known(agreement.path_error),
        "momentum_error": known(agreement.momentum_error),
        "slip": float(agreement.report.slip.max(initial=0.0)),
        "steps": agreement.report.steps,
        "longest_step": agreement.report.timestep,
        "faults": [str(fault) for fault in agreement.faults],
        "ratio": cost.ratio,
        "ratio_least": least,
        "ratio_most": most,
        "baseline": cost.baseline,
    }


_PRESETS = {repr(sorted(options_of(s).items())): name for name, s in PRESETS.items()}


def _configuration(result: Result, baseline: float) -> Row:
    """Return a configuration and its result as a row of plain data.

    `error` is the path error, and `momentum_error` is the error of M. `ratio` is the cost of a
    simulated second relative to the bare loop, and `spread` is its smallest and largest value.
    `cost` is the processor time of a simulated second [s] at the study's baseline. `trouble` gives
    the faults or the reason of the failure, "" for a sound run. `sound` is whether the run counts
    as a result. `preset` is the preset with the same options. Missing numbers are None.
    """
    options, record = options_of(settings_with(result.cell)), result.record or {}
    integrator, timestep = options.get("integrator", MUJOCOS_DEFAULT), options.get("timestep", 2e-3)
    preset = _PRESETS.get(repr(sorted(options.items())))
    error, off, ratio, least, most = (
        known(record.get(name))
        for name in ("path_error", "momentum_error", "ratio", "ratio_least", "ratio_most")
    )
    trouble = "; ".join(record["faults"]) if record else result.failure or ""
    # Path errors can cancel, errors of M cannot: a path far more accurate than M is an accident.
    consistent = error is not None and off is not None and off <= CANCELLED * error
    return {
        "title": preset or f"{integrator} {timestep * 1e3:.3g} ms, {describe(options)}",
        "preset": preset,
        "integrator": integrator,
        "timestep": timestep,
        "sound": consistent and not trouble,
        "error": error,
        "momentum_error": off,
        "ratio": ratio,
        "spread": [least, most],
        "cost": None if ratio is None else ratio * baseline,
        "trouble": trouble,
        "options": options,
    }


def first_order_lines(configurations: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the convergence lines of first-order integrators.

    The `configurations` of a line are sound and differ only in the timestep, and `order` is the
    order of their errors. `nearest` is the configuration nearest to the target. `cost_at_target` [s
    per simulated s] is extrapolated from `nearest`. `extrapolated` is whether no configuration
    reaches the target.
    """
    groups: dict[str, list[Row]] = {}
    for row in configurations:
        if row["sound"] and row["integrator"] in FIRST_ORDER:
            rest = {name: value for name, value in row["options"].items() if name != "timestep"}
            groups.setdefault(repr(sorted(rest.items())), []).append(row)
    lines = []
    for group in groups.values():
        group.sort(key=itemgetter("timestep"))
        errors = [row["error"] for row in group]
        fit = fit_order([row["timestep"] for row in group], errors)
        if fit is not None and fit.order <= _ORDER:
            # Extrapolate from the configuration nearest to the target.
            nearest = min(group, key=lambda row: abs(math.log(row["error"] / TARGET)))
            cost = nearest["cost"] * (nearest["error"] / TARGET) ** (1 / fit.order)
            line: dict[str, Any] = {"order": fit.order, "extrapolated": min(errors) > TARGET}
            line |= {"cost_at_target": cost, "nearest": nearest, "configurations": group}
            lines.append(line)
    return lines


def costs_of(scene: Scene, results: Sequence[Result]) -> dict[str, Any]:
    """Return the comparison of the results of `measure_settings`, as plain data.

    `baseline` is the processor time of a simulated second of the bare loop [s], the unit of costs.
    `best` is the cheapest configuration that reaches the target. `first_order` is the first-order
    line that is cheapest at the target. `ratio` is the cost of this line at the target divided by
    the cost of `best`, or None.
    """
    baselines = [result.record["baseline"] for result in results if result.record is not None]
    # The machine's speed drifts during a sweep, so all seconds are ratios times one baseline.
    baseline = float(np.median(baselines)) if baselines else math.nan
    configurations = [_configuration(result, baseline) for result in results]
    sound = [row for row in configurations if row["sound"]]
    front = [sound[i] for i in pareto_front(*([r[n] for r in sound] for n in ("error", "cost")))]
    # The front is sorted by cost.
    best = next((row for row in front if row["error"] <= TARGET), None)
    line = min(first_order_lines(sound), key=itemgetter("cost_at_target"), default=None)
    return {
        "scene": scene.name,
        "target": TARGET,
        "ratio": line["cost_at_target"] / best["cost"] if best and line else None,
        "baseline": known(baseline),
        "best": best,
        "first_order": line,
        "pareto_front": front,
        "configurations": configurations,
    }


_NOTE = (
    "CPU: processor time of a simulated second. × bare: relative to a bare loop of mj_step on\n"
    "fig12 at 1 ms, median of alternating rounds (least-most)."
)


def _cost_study(scene: Scene, results: Sequence[Result]) -> Study:
    """Return the study of the results: the front, the presets, and the ratio."""
    study = costs_of(scene, results)
    configurations = study["configurations"]
    failed = sum(not row["sound"] for row in configurations)
    presets = sorted((row for row in configurations if row["preset"]), key=itemgetter("title"))
    counts = f"{scene.name}: {len(configurations)} configurations, {failed} without a valid result"
    shown = (
        f"[bold]{escape(counts)}[/]",
        "The Pareto front: no other configuration is both cheaper and more accurate.",
        table_of(_COLUMNS, study["pareto_front"], itemgetter("trouble")),
        "The presets.",
        table_of(_COLUMNS, presets, itemgetter("trouble")),
        _NOTE,
        escape(_verdict(study)),
    )
    picture = _cost_picture(study)
    return Study(scene.name, LABEL, ["cost"], rows_of(results), study, shown, picture)


def _verdict(study: Row) -> str:
    """Compare the costs of first-order integrators and of the front at the target."""
    best, line = study["best"], study["first_order"]
    if best is None:
        return f"No configuration reaches a path error of {TARGET:g}."
    cheapest = f"At a path error of {TARGET:g}: {best['title']} takes {best['cost']:.2g} s"
    if line is None:
        return f"{cheapest}; no first-order integrator converges"
    nearest, source = line["nearest"], "measured"
    if line["extrapolated"]:
        source = f"extrapolated from {scientific(nearest['error'])} at order {line['order']:.2f}"
    return (
        f"{cheapest};\nthe best first-order integrator ({nearest['title']}) takes "
        f"{line['cost_at_target']:.2g} s, {study['ratio']:.2g} times as much ({source})."
    )


def _times_bare(row: Row) -> str:
    if row["ratio"] is None:
        return "-"
    return "{:.3f} ({:.3f}-{:.3f})".format(row["ratio"], *row["spread"])


_COLUMNS = (
    Column("configuration", "title", words=True),
    Column("path\nerror", "error"),
    Column("M error", "momentum_error"),
    Column("CPU", "cost", "ms", form=".2f", scale=1e3),
    Column("× bare", _times_bare),
    Column("first fault", lambda row: row["trouble"].split("; ")[0], words=True),
)


def _cost_picture(study: Row) -> Figure:
    """Draw all configurations, the front, the presets, and the best first-order line."""
    configurations = study["configurations"]
    finding = f"no error below {TARGET:g}"
    if study["ratio"] is not None:
        best = study["best"]["integrator"]
        finding = f"{TARGET:g} costs {_times(study)} times less with {best} than with first order"
    heading = f"{study['scene']}: {finding}, {len(configurations)} configurations"
    figure, axes = cost_axes(heading, "path error, relative to the path's length")
    _scatter(axes, configurations)
    front: dict[str, Any] = {"color": INK, "linewidth": 1.6, "zorder": 3, "label": "Pareto front"}
    _plot(axes, study["pareto_front"], "-", **front)
    if study["first_order"] is not None:
        _prolong(axes, study["first_order"])
    _compare(axes, study)
    for row in configurations:
        if row["preset"] and row["error"] is not None:
            _name(axes, row["preset"], (row["error"], row["cost"]))
    # Leave room for the names of the presets at the ends of the front.
    low, high = axes.get_xlim()
    axes.set_xlim(low / 3, high * 3)
    axes.set_ylim(axes.get_ylim()[0] / 2.5)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _scatter(axes: Axes, configurations: Sequence[Row]) -> None:
    faulty = [p for p in configurations if not p["sound"] and (p["error"] or _WILD) < _WILD]
    _plot(axes, faulty, "x", color=FAINT, ms=4, zorder=1, label="slip, lift-off or rate error")
    for integrator in INTEGRATORS.values():
        rows = [p for p in configurations if p["sound"] and p["integrator"] == integrator.name]
        # Marks of first-order integrators are hollow.
        fill, size = (LABEL.colour, 5) if integrator.order > 1 else ("none", 4.5)
        style: Any = {"color": LABEL.colour, "mfc": fill, "ms": size, "ls": "", "zorder": 2}
        _plot(axes, rows, integrator.marker, label=integrator.name, **style)


def _plot(axes: Axes, rows: Sequence[Row], mark: str, **style: Any) -> None:
    """Plot the cost of configurations against their error."""
    axes.plot([row["error"] for row in rows], [row["cost"] for row in rows], mark, **style)


def _prolong(axes: Axes, line: Row) -> None:
    """Draw the best first-order line, extrapolated to the target."""
    style: dict[str, Any] = {"color": ACCENT, "linewidth": 1.4}
    _plot(axes, line["configurations"], "-", **style, label="first order, best")
    if line["extrapolated"]:
        near, label = line["nearest"], f"extrapolated, order {line['order']:.2f}"
        ends = [near["error"], TARGET], [near["cost"], line["cost_at_target"]]
        axes.plot(*ends, "--", **style, label=label)


def _compare(axes: Axes, study: Row) -> None:
    """Draw the two costs at the target, and their ratio."""
    axes.axvline(TARGET, color=INK, linewidth=0.8, linestyle=":")
    if study["ratio"] is None:
        return
    low, high = study["best"]["cost"], study["first_order"]["cost_at_target"]
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (TARGET, high), xytext=(TARGET, low), arrowprops=arrow)
    label = f"{_times(study)} times\nat {TARGET:g}"
    note(axes, label, (TARGET, high / 4), (-8, 0), ha="right", va="center", color=INK)


def _times(study: Row) -> str:
    """Return the ratio of the two costs, rounded to two digits."""
    times = float(f"{study['ratio']:.2g}")
    return f"{times:,.0f}".replace(",", "\u2009")


def _name(axes: Axes, name: str, place: tuple[float, float]) -> None:
    """Draw a preset's mark with its name above or below."""
    above = name in _ABOVE
    colour, _, marker = PRESET_LOOKS.get(name, (LABEL.colour, (), LABEL.marker))
    axes.plot(*place, marker, color=colour, mec="white", markersize=11, zorder=4)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    by, va = (0, 10 if above else -12), "bottom" if above else "top"
    note(axes, name, place, by, ha="center", va=va, color=INK, zorder=5, bbox=box)


def cost_study(scene: Scene, shared: Cell, sweep: Sweep) -> Study:
    """Sweep the configurations of a scene; shared: the common part of cells."""
    cells = cells_of(shared, configurations(sweep.quick), 2 if sweep.quick else _ROUNDS)
    results = sweep.results(measure_settings, cells, f"{scene.name}-cost", _LIMIT)
    return _cost_study(scene, results)
