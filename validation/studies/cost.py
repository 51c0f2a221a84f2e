"""Error against processor time over many configurations, and the Pareto front.

Every combination of choices would be tens of thousands of runs. The configurations are two stars, a
line through each, and a random sample: the stars change one choice of the recipe, or of the naive
model, at a time; the lines change the steps alone; the sample shows choices that meet.
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
    ADAPTIVE,
    FIRST_ORDER,
    INTEGRATORS,
    MUJOCOS_DEFAULT,
    NAIVE,
    Prescribed,
    recipe,
    settings_from,
)
from robotball.robot.looks import ACCENT, FAINT, INK
from robotball.robot.motors import Servo
from robotball.view.lines import PRESET_LOOKS

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
from .orders import fit_order
from .timing import measure_costs, simulated_second

RECIPE = recipe("recipe", 1.0, timestep=PRESETS["balanced"].timestep)  # no error is a fault

_Options = dict[str, Any]

_ALL = ("RK4", *FIRST_ORDER)
_INTERVAL = 0.1  # s, between samples; no step is longer

# s; a power of two apart, so that few make a slope. Nothing is left to gain for RK4 below 1 ms.
_LINE = tuple(_INTERVAL / 2**k for k in range(10))
STEPS = (20e-3, 5e-3, 1e-3)
_FINE_STEPS = (5e-3, 1e-3, 0.2e-3)  # where first order has its slope
# From 1e-4 on the contact may be lost, which `limits.errors_added` says.
_RTOLS = tuple(10.0**-k for k in range(4, 14))
_SAMPLE = 120  # random combinations
_SEED = 4
_LIMIT = 60.0  # s that a run may take
_ROUNDS = 3  # of timing, after one that warms up


def _both(*names: str) -> tuple[_Options, _Options]:
    """Return the recipe's choice and the naive model's, of settings that go together."""
    return {n: getattr(RECIPE, n) for n in names}, {n: getattr(NAIVE, n) for n in names}


_EXACT = {"tolerance": 0.0, "jacobian": "dense"}  # of any solver with hinges of a huge inertia
_CHOICES: Mapping[str, Sequence[_Options]] = {
    "solver": (
        *_both(
            "solver", "iterations", "tolerance", "ls_tolerance", "jacobian", "warmstart", "island",
        ),
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
    """Return the study's settings, each once, presets first; the quick form has a few a kind."""
    if quick:
        every = [*PRESETS.values(), *_lines((RECIPE,), _LINE[3:6], ("RK4", "Euler"))]
        every += [*_adaptive(_RTOLS[2::4]), *_star(NAIVE, STEPS[1:2], ("RK4",))][::4]
    else:
        every = [
            *PRESETS.values(),
            *_lines((RECIPE, NAIVE), _LINE, _ALL),
            *_adaptive(_RTOLS),
            *_star(RECIPE, STEPS, ("RK4",)),
            # First-order integrators of long steps are wrong whatever the contact, which would hide
            # what a choice is worth.
            *_star(RECIPE, _FINE_STEPS, FIRST_ORDER),
            *_star(NAIVE, STEPS[1:], _ALL),
            *_sample(),
        ]
    distinct: dict[str, Settings] = {}
    for settings in every:
        # A star meets the lines, and the sample may meet both: a cell must be one configuration.
        distinct.setdefault(repr(options_of(settings)), settings)
    return list(distinct.values())


def _lines(
    bases: Sequence[Settings], steps: Sequence[float], integrators: Sequence[str]
) -> Iterator[Settings]:
    """Yield the bases at all steps."""
    for base, integrator, step in product(bases, integrators, steps):
        yield replace(base, integrator=integrator, timestep=step)


def _adaptive(rtols: Sequence[float]) -> list[Settings]:
    return [replace(RECIPE, integrator=ADAPTIVE, timestep=None, rtol=rtol) for rtol in rtols]


def _star(base: Settings, steps: Sequence[float], integrators: Sequence[str]) -> Iterator[Settings]:
    """Yield the base with every single choice made otherwise."""
    for level in chain.from_iterable(_CHOICES.values()):
        if (changed := replace(base, **level)) != base:
            yield from _lines((changed,), steps, integrators)


def _sample() -> Iterator[Settings]:
    """Yield random combinations of all choices."""
    pick = random.Random(_SEED).choice
    for _ in range(_SAMPLE):
        level = {
            name: value for levels in _CHOICES.values() for name, value in pick(levels).items()
        }
        yield replace(RECIPE, integrator=pick(_ALL), timestep=pick(STEPS), **level)


_NOT_OPTIONS = ("name", "error_tolerance", "stop_at_fault", "max_steps")  # no options of MuJoCo
_STEPS = (*_NOT_OPTIONS, "integrator", "timestep", "rtol")
_FEW = 3  # changes that are named
_DEFAULTS = {field.name: field.default for field in fields(Settings)}


def options_of(settings: Settings) -> _Options:
    """Return the options that differ from MuJoCo's defaults, as JSON gives them back."""
    return {
        name: value
        for name, value in settings.plain().items()
        if name not in _NOT_OPTIONS and value != _DEFAULTS[name]
    }


def describe(options: Mapping[str, Any]) -> str:
    """Name the recipe or the naive model, whichever is nearer, and the changes but the steps."""
    described = ([base.name, *_changes(options, options_of(base))] for base in (RECIPE, NAIVE))
    name, *changes = min(described, key=len)
    said = changes if len(changes) <= _FEW else [f"{len(changes)} changes"]
    return ", ".join([name, *said])


def _changes(options: Mapping[str, Any], base: _Options) -> list[str]:
    """Return a description of each option that differs."""
    changed = []
    for name in _DEFAULTS:
        value = options.get(name)
        if name not in _STEPS and value != base.get(name):
            said = "default" if value is None else value
            if isinstance(value, dict):  # a drive
                said = " ".join(f"{key} {number:g}" for key, number in value.items() if number)
            elif isinstance(value, list):
                said = " ".join(f"{number:g}" for number in value)
            elif isinstance(value, float):
                said = f"{value:g}"
            changed.append(f"{name} {said}")
    return changed


def settings_with(options: Mapping[str, Any]) -> Settings:
    """Return settings with these options that go on after a fault; other keys are left out."""
    known = {key: value for key, value in options.items() if key in _DEFAULTS}
    held = {"error_tolerance": RECIPE.error_tolerance, "stop_at_fault": False}
    return settings_from({**known, **held, "name": describe(options)})


TARGET = 1e-6  # the path error at which first order and the front are compared
_ORDER = 1.25  # of a line that is taken for first order: the steeper ones cancel as well
_TIMED = 0.05  # s of processor time that is timed at every turn


def cells_of(shared: Cell, settings: Sequence[Settings], rounds: int) -> list[Cell]:
    """Return a cell for each of the settings, plain data with all their options.

    shared: the scene's part of each; rounds: of timing.
    """
    return [{**shared, "rounds": rounds, **options_of(each)} for each in settings]


def measure_settings(cell: Cell) -> dict[str, Any]:
    """Measure errors against the equations, faults, and the cost of a simulated second."""
    scene, theory = reference(cell, _INTERVAL)
    model = build(scene, settings_with(cell))
    logging.getLogger("absl").setLevel(logging.ERROR)  # a process of its own says it again
    agreement = Agreement(theory, run(model, theory.times))
    # A slow configuration needs less of its motion for the same processor time.
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
    """Return a configuration that was run, or why it could not be, as a row of plain data.

    error          path error; momentum_error: that of M
    ratio          cost of a simulated second, relative to the bare loop's; spread: least and most
    cost           processor time at the study's baseline [s per simulated s]
    trouble        its faults, or why it failed; empty for a sound run
    sound          whether it is a result: no trouble, and no path that is good by accident
    preset         the preset that has just these options

    Where a run broke off or failed, what it has not is None.
    """
    options, record = options_of(settings_with(result.cell)), result.record or {}
    integrator, timestep = options.get("integrator", MUJOCOS_DEFAULT), options.get("timestep", 2e-3)
    steps = f"rtol {options['rtol']:.0e}" if "rtol" in options else f"{timestep * 1e3:.3g} ms"
    preset = _PRESETS.get(repr(sorted(options.items())))
    error, off, ratio, least, most = (
        known(record.get(name))
        for name in ("path_error", "momentum_error", "ratio", "ratio_least", "ratio_most")
    )
    trouble = "; ".join(record["faults"]) if record else result.failure or ""
    # Errors of a path can cancel, M's cannot: a path far better than M is good by accident.
    honest = error is not None and off is not None and off <= CANCELLED * error
    return {
        "title": preset or f"{integrator} {steps}, {describe(options)}",
        "preset": preset, "integrator": integrator, "timestep": timestep,
        "sound": honest and not trouble,
        "error": error, "momentum_error": off,
        "ratio": ratio, "spread": [least, most],
        "cost": None if ratio is None else ratio * baseline,
        "trouble": trouble, "options": options,
    }  # fmt: skip


def first_order_lines(configurations: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the lines of first-order integrators: sound, and no steeper than their order.

    configurations  those of the line, which differ in the timestep alone
    order           of their error in it
    nearest         the configuration whose error is nearest to the target
    cost_at_target  of the target [s per simulated s], from the nearest's cost a step
    extrapolated    whether no configuration reaches the target
    """
    groups: dict[str, list[Row]] = {}
    for each in configurations:
        if each["sound"] and each["integrator"] in FIRST_ORDER:
            # A line is what differs in its timestep alone.
            rest = {k: v for k, v in each["options"].items() if k != "timestep"}
            groups.setdefault(repr(sorted(rest.items())), []).append(each)
    lines = []
    for group in groups.values():
        group.sort(key=itemgetter("timestep"))
        fit = fit_order([p["timestep"] for p in group], [p["error"] for p in group])
        if fit is not None and fit.order <= _ORDER:
            # From the nearest, so that an extrapolation is as short as there is data for.
            nearest = min(group, key=lambda p: abs(math.log(p["error"] / TARGET)))
            cost = nearest["cost"] * (nearest["error"] / TARGET) ** (1 / fit.order)
            extrapolated = all(p["error"] > TARGET for p in group)
            lines.append(
                {
                    "order": fit.order, "extrapolated": extrapolated, "cost_at_target": cost,
                    "nearest": nearest, "configurations": group,
                }
            )  # fmt: skip
    return lines


def costs_of(scene: Scene, results: Sequence[Result]) -> dict[str, Any]:
    """Return the comparison that the results of `measure_settings` make, as plain data.

    baseline: processor time of the bare loop's simulated second [s], by which costs are seconds;
    best: the front's cheapest that reaches the target; first_order: the cheapest line there;
    ratio: its cost at the target over that of the best, None where one of them is not there.
    """
    baselines = [result.record["baseline"] for result in results if result.record is not None]
    # One machine's speed wanders over the hours of a sweep, so seconds are ratios times one number
    # for all.
    baseline = float(np.median(baselines)) if baselines else math.nan
    configurations = [_configuration(result, baseline) for result in results]
    sound = [each for each in configurations if each["sound"]]
    errors = [each["error"] for each in sound]
    front = [sound[i] for i in pareto_front(errors, [each["cost"] for each in sound])]
    # The front is in the order of cost, so the first that reaches the target is the cheapest.
    best = next((each for each in front if each["error"] <= TARGET), None)
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
    "CPU: of a simulated second. × bare: the same, relative to a bare loop of mj_step\n"
    "on fig12 at 1 ms, the median of rounds in turn (least-most)."
)
_WILD = 1e3  # a path error from where on a run is not drawn
_ABOVE = ("adaptive",)  # its place is the left end of the front


def _cost_study(scene: Scene, results: Sequence[Result]) -> Study:
    """Return the study of the results: the front, the presets, and the ratio."""
    study = costs_of(scene, results)
    every = study["configurations"]
    failed = sum(not each["sound"] for each in every)
    presets = sorted((each for each in every if each["preset"]), key=itemgetter("title"))
    counts = f"{scene.name}: {len(every)} configurations, {failed} no result"
    return Study(
        scene.name, LABEL, ["cost"], rows_of(results), study,
        shown=(
            f"[bold]{escape(counts)}[/]",
            "The Pareto front: nothing is both cheaper and better.",
            table_of(_COLUMNS, study["pareto_front"], itemgetter("trouble")),
            "The presets.",
            table_of(_COLUMNS, presets, itemgetter("trouble")),
            _NOTE,
            escape(_verdict(study)),
        ),
        picture=_cost_picture(study),
    )  # fmt: skip


def _verdict(study: Row) -> str:
    """Compare the cost of first order at the target with the front's, in words."""
    best, line = study["best"], study["first_order"]
    if best is None:
        return f"No configuration reaches a path error of {TARGET:g}."
    words = f"At a path error of {TARGET:g}: {best['title']} takes {best['cost']:.2g} s"
    if line is None:
        return f"{words}; no first-order integrator has a line to compare it with."
    nearest, how = line["nearest"], "measured"
    if line["extrapolated"]:
        how = f"extrapolated from {scientific(nearest['error'])} at order {line['order']:.2f}"
    return (
        f"{words};\nthe best of first order ({nearest['title']}) "
        f"{line['cost_at_target']:.2g} s, {study['ratio']:.2g} times as much ({how})."
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
    """Draw all configurations with an error, the front, the presets, and first order prolonged."""
    name, every = study["scene"], study["configurations"]
    words, of = f"no error below {TARGET:g}", f"of {len(every)} configurations"
    if study["ratio"] is not None:
        words = f"{TARGET:g} costs {_times(study)} times less by {study['best']['integrator']}"
        of = f"than by first order, {of}"
    figure, axes = cost_axes(f"{name}: {words} {of}", "path error, relative to the path's length")
    _scatter(axes, every)
    front: dict[str, Any] = {"color": INK, "linewidth": 1.6, "zorder": 3, "label": "Pareto front"}
    _plot(axes, study["pareto_front"], "-", **front)
    if study["first_order"] is not None:
        _prolong(axes, study["first_order"])
    _compare(axes, study)
    for each in every:
        if each["preset"] and each["error"] is not None:
            _name(axes, each["preset"], (each["error"], each["cost"]))
    # Room for the names of the presets, which stand at the ends of the front.
    low, high = axes.get_xlim()
    axes.set_xlim(low / 3, high * 3)
    axes.set_ylim(axes.get_ylim()[0] / 2.5)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _scatter(axes: Axes, configurations: Sequence[Row]) -> None:
    faulty = [p for p in configurations if not p["sound"] and (p["error"] or _WILD) < _WILD]
    _plot(axes, faulty, "x", color=FAINT, ms=4, zorder=1, label="slips, lifts off or misses a rate")
    for integrator in INTEGRATORS.values():
        mine = [p for p in configurations if p["sound"] and p["integrator"] == integrator.name]
        high = integrator.order > 1  # filled; first order is hollow
        fill, size = (LABEL.colour, 5) if high else ("none", 4.5)
        _plot(axes, mine, integrator.marker, color=LABEL.colour, mfc=fill, ms=size, zorder=2,
              linestyle="", label=integrator.name)  # fmt: skip


def _plot(axes: Axes, some: Sequence[Row], mark: str, **style: Any) -> None:
    """Draw configurations by error and cost."""
    axes.plot([p["error"] for p in some], [p["cost"] for p in some], mark, **style)


def _prolong(axes: Axes, line: Row) -> None:
    """Draw the best line of first order, on to the target."""
    style: dict[str, Any] = {"color": ACCENT, "linewidth": 1.4}
    _plot(axes, line["configurations"], "-", **style, label="first order, best")
    if line["extrapolated"]:
        near, words = line["nearest"], f"extrapolated, order {line['order']:.2f}"
        way = [near["error"], TARGET], [near["cost"], line["cost_at_target"]]
        axes.plot(*way, "--", **style, label=words)


def _compare(axes: Axes, study: Row) -> None:
    """Draw the two costs at the target, and their ratio."""
    axes.axvline(TARGET, color=INK, linewidth=0.8, linestyle=":")
    if study["ratio"] is None:
        return
    low, high = study["best"]["cost"], study["first_order"]["cost_at_target"]
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (TARGET, high), xytext=(TARGET, low), arrowprops=arrow)
    words = f"{_times(study)} times\nat {TARGET:g}"
    note(axes, words, (TARGET, high / 4), (-8, 0), ha="right", va="center", color=INK)


def _times(study: Row) -> str:
    """Return the ratio of the two costs in two digits."""
    times = float(f"{study['ratio']:.2g}")
    return f"{times:,.0f}".replace(",", "\u2009")


def _name(axes: Axes, name: str, place: tuple[float, float]) -> None:
    """Draw a preset's own mark and its name, on the side where nothing else is."""
    above = name in _ABOVE
    colour, _, marker = PRESET_LOOKS.get(name, (LABEL.colour, (), LABEL.marker))
    axes.plot(*place, marker, color=colour, mec="white", markersize=11, zorder=4)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    by, va = (0, 10 if above else -12), "bottom" if above else "top"
    note(axes, name, place, by, ha="center", va=va, color=INK, zorder=5, bbox=box)


def cost_study(scene: Scene, shared: Cell, sweep: Sweep) -> Study:
    """Sweep the configurations of a scene; shared: the part of their cells that is alike."""
    cells = cells_of(shared, configurations(sweep.quick), 2 if sweep.quick else _ROUNDS)
    results = sweep.results(measure_settings, cells, f"{scene.name}-cost", _LIMIT)
    return _cost_study(scene, results)
