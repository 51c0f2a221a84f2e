"""The configurations of the trade-off: two stars, a line through each, and a random sample.

Every combination would be tens of thousands of runs. The stars change one choice of the recipe, or
of the naive model, at a time; the lines change the steps alone; the sample has what happens where
choices meet.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import chain, product
from typing import Any

from robotball import PRESETS, Settings
from robotball.engines.mujoco.integrators import ADAPTIVE, FIRST_ORDER
from robotball.engines.mujoco.settings import NAIVE, Prescribed, recipe, settings_from
from robotball.motors import Servo

Options = dict[str, Any]

ALL = ("RK4", *FIRST_ORDER)
NO_TOLERANCE = 1.0  # an error is what is measured here, so none is a fault
RECIPE = recipe("recipe", NO_TOLERANCE, timestep=PRESETS["balanced"].timestep)
INTERVAL = 0.1  # s, between samples; no step is longer

# s; a power of two apart, so that few make a slope. Nothing is left to gain for RK4 below 1 ms.
LINE = tuple(INTERVAL / 2**k for k in range(10))
STEPS = (20e-3, 5e-3, 1e-3)
FINE_STEPS = (5e-3, 1e-3, 0.2e-3)  # where first order has its slope
RTOLS = tuple(10.0**-k for k in range(4, 14))
SAMPLE = 120  # random combinations
SEED = 4


def _both(*names: str) -> tuple[Options, Options]:
    """The recipe's choice and the naive model's, of settings that go together."""
    return {n: getattr(RECIPE, n) for n in names}, {n: getattr(NAIVE, n) for n in names}


_EXACT = {"tolerance": 0.0, "jacobian": "dense"}  # of any solver with hinges of a huge inertia
CHOICES: Mapping[str, Sequence[Options]] = {
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
    """The study's settings, each once, the presets first; the quick form has a few of each kind."""
    if quick:
        every = [*PRESETS.values(), *_lines((RECIPE,), LINE[3:6], ("RK4", "Euler"))]
        every += [*_line_of_tolerances(RTOLS[2::4]), *_star(NAIVE, STEPS[1:2], ("RK4",))][::4]
    else:
        every = [
            *PRESETS.values(),
            *_lines((RECIPE, NAIVE), LINE, ALL),
            *_line_of_tolerances(RTOLS),
            *_star(RECIPE, STEPS, ("RK4",)),
            *_star(RECIPE, FINE_STEPS, FIRST_ORDER),
            *_star(NAIVE, STEPS[1:], ALL),
            *_sample(),
        ]
    distinct: dict[str, Settings] = {}
    for settings in every:
        distinct.setdefault(repr(options_of(settings)), settings)
    return list(distinct.values())


def _lines(
    bases: Sequence[Settings], steps: Sequence[float], integrators: Sequence[str]
) -> Iterator[Settings]:
    """The bases at all steps."""
    for base, integrator, step in product(bases, integrators, steps):
        yield replace(base, integrator=integrator, timestep=step)


def _line_of_tolerances(rtols: Sequence[float]) -> Iterator[Settings]:
    for rtol in rtols:
        yield replace(RECIPE, integrator=ADAPTIVE, timestep=None, rtol=rtol)


def _star(base: Settings, steps: Sequence[float], integrators: Sequence[str]) -> Iterator[Settings]:
    """The base with every single choice made otherwise."""
    for level in chain.from_iterable(CHOICES.values()):
        if (changed := replace(base, **level)) != base:
            yield from _lines((changed,), steps, integrators)


def _sample() -> Iterator[Settings]:
    """Random combinations of all choices."""
    pick = random.Random(SEED).choice
    for _ in range(SAMPLE):
        level = {name: value for levels in CHOICES.values() for name, value in pick(levels).items()}
        yield replace(RECIPE, integrator=pick(ALL), timestep=pick(STEPS), **level)


_NOT_OPTIONS = ("name", "error_tolerance", "stop_at_fault", "max_steps")  # no options of MuJoCo
_STEPS = (*_NOT_OPTIONS, "integrator", "timestep", "rtol")
FEW = 3  # changes that are named
_DEFAULTS = {field.name: field.default for field in fields(Settings)}


def options_of(settings: Settings) -> Options:
    """What the settings have other than MuJoCo's defaults, as JSON would give it back."""
    return {
        name: value
        for name, value in settings.plain().items()
        if name not in _NOT_OPTIONS and value != _DEFAULTS[name]
    }


def describe(options: Mapping[str, Any]) -> str:
    """The recipe or the naive model, whichever is nearer, and what is otherwise but the steps."""
    name, changes = min(
        ((base.name, _changes(options, options_of(base))) for base in (RECIPE, NAIVE)),
        key=lambda each: len(each[1]),
    )
    return ", ".join([name, *changes]) if len(changes) <= FEW else f"{name}, {len(changes)} changes"


def _changes(options: Mapping[str, Any], base: Options) -> list[str]:
    """What to say of the options that differ."""
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
    """The settings with these options, that go on after a fault; other keys are left out."""
    known = {key: value for key, value in options.items() if key in _DEFAULTS}
    named = {"name": describe(options), "error_tolerance": NO_TOLERANCE, "stop_at_fault": False}
    return settings_from({**known, **named})
