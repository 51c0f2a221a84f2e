"""Measure whether failures are missed and alarms are false, over three seeded sets of random runs.

Scenes are balls of mass points within their shell, in both rolling models. Extreme runs lie far out
along a few axes each; the others are ordinary. Robots are those of the catalog that the small
equations do not describe, with bodies and motions changed, under a preset.
`python -m bench.random_runs 500` makes so many of each.

A run has failed where its path is over a tenth of its length off the equations', or where it broke
off; a robot's has where path or M is off by more than its preset says. It is reported where the
precheck warned of it or the monitor found a fault.
"""

import logging
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from robotball import (
    InputError,
    Scene,
    SceneWarning,
    Settings,
    catalog,
    integrate,
    load_scene,
    preset,
)
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.run import exceeded
from robotball.engines.mujoco.settings import ADAPTIVE, OWN, Prescribed, recipe
from robotball.robot.ball import Frame, Pendulum, Rotor, Shell
from robotball.robot.motors import Servo
from robotball.robot.variations import scaled, scaled_body, with_bodies
from robotball.rotations import Array
from validation.agreement import compare
from validation.output import Show, progress_bar
from validation.random_starts import random_start
from validation.studies.extremes import WRONG

_LONGEST = 100.0  # s
_STEPS, _TURNS = 3000, 40.0  # a run is cut to so many steps, and radians of its fastest rotation
_MOST_STEPS = 4000
_SAMPLES = 100
_RECIPES = ("fast", "balanced", "accurate", "adaptive")
_STEPPED = ("fast", "balanced", "balanced", "accurate")
_APART = 0.04  # s, between the samples of a robot's run
_EXTREME_AXES = 3  # at most, of one run


@dataclass(frozen=True)
class _RandomRun:
    """A scene, settings and sample times (n,) [s]; what was made extreme, for the eye."""

    scene: Scene
    settings: Settings
    times: Array
    axes: tuple[str, ...] = ()


def ordinary(seed: int, number: int) -> _RandomRun:
    """Return a catalog ball with rates, momentum and attitude varied, at a preset of the recipe."""
    random = np.random.default_rng([seed, number, 0])
    scene = _varied_scene(random)
    duration = float(random.uniform(1.0, 10.0))
    settings = preset(str(random.choice(_RECIPES)))
    return _RandomRun(scene, settings, np.linspace(0.0, duration, _SAMPLES + 1))


def extreme(seed: int, number: int) -> _RandomRun:
    """Return the naive or the recipe's settings on a varied ball, one to three axes far out."""
    random = np.random.default_rng([seed, number, 1])
    scene = _varied_scene(random)
    settings = random.choice(np.array([preset("naive"), recipe("recipe", 1e-2, timestep=5e-3)]))
    settings = replace(settings, stop_at_fault=False, max_steps=_MOST_STEPS)
    chosen = random.choice(list(_AXES), random.integers(1, _EXTREME_AXES + 1), replace=False)
    for axis in chosen:
        scene, settings = _AXES[axis](scene, settings, random)
    return _RandomRun(
        scene, settings, _short_times(scene, settings, random), tuple(map(str, chosen))
    )


def robot(seed: int, number: int) -> _RandomRun:
    """Return a preset on a varied robot of the catalog, one to three of its numbers far out."""
    random = np.random.default_rng([seed, number, 2])
    scene, settings = _varied_scene(random, balanced=False), preset(str(random.choice(_STEPPED)))
    chosen = random.choice(list(_OF_ROBOTS), random.integers(1, _EXTREME_AXES + 1), replace=False)
    for name in chosen:
        scene = _OF_ROBOTS[name](scene, float(10 ** random.uniform(-1.5, 1.5)))
    count = int(random.uniform(1.0, 3.0) / _APART)
    times = np.linspace(0.0, count * _APART, count + 1)
    return _RandomRun(scene, settings, times, tuple(map(str, chosen)))


def _short_times(scene: Scene, settings: Settings, random: np.random.Generator) -> Array:
    """Return times that neither the engine nor the equations need long for."""
    plan = PlannedRun(scene, settings, scene.duration)
    timestep = plan.timestep if np.isfinite(plan.timestep) else 0.02
    turns = _TURNS * random.uniform(0.2, 1.0) / max(plan.rotation_rate, 1e-6)
    duration = min(max(min(turns, _STEPS * timestep, _LONGEST), 10 * timestep), _LONGEST)
    return np.linspace(0.0, duration, _SAMPLES + 1)


@cache
def _scenes(balanced: bool) -> list[Scene]:
    """Return the catalog's balls that the small equations describe, or the others."""
    with warnings.catch_warnings(action="ignore", category=SceneWarning):  # to be built by nobody
        scenes = map(load_scene, catalog())
        return [scene for scene in scenes if (scene.not_reduced is None) == balanced]


def _varied_scene(random: np.random.Generator, balanced: bool = True) -> Scene:
    """Return a ball of the catalog with another start and other rates."""
    scene = _scenes(balanced)[int(random.integers(len(_scenes(balanced))))]
    start = random_start(scene, random)
    frame, rotors = random.uniform(0.3, 1.3, 2).tolist()
    return _faster(replace(scene, start=start), frame, rotors)


def _faster(scene: Scene, frame: float = 1.0, rotors: float = 1.0) -> Scene:
    """Return the scene with the frame's rate and the rotors' times a factor, where constant."""

    def times(rate: Any, factor: float) -> Any:
        return rate * factor if isinstance(rate, float | int) else rate

    turning, *rates = (hinge.command for hinge in scene.ball.hinges)
    rates = [times(rate, rotors) for rate in rates]
    return scene.with_hinges(command=(times(turning, frame), *rates))


def _heavier(scene: Scene, factor: float, kind: type[Shell | Frame | Rotor | Pendulum]) -> Scene:
    """Return the scene with the mass of all bodies of a kind times a factor."""

    def heavier(body: Any) -> Any:
        return scaled_body(body, factor) if isinstance(body, kind) else body

    return replace(scene, ball=with_bodies(scene.ball, heavier))


def _lower(scene: Scene, factor: float) -> Scene:
    """Return the scene with the frame's centre of mass at another distance, within the shell."""
    frame, a = scene.ball.frame, scene.ball.radius
    most = 0.95 * a / max(float(np.linalg.norm(frame.centre)), 1e-9 * a)
    lower = replace(frame, centre=frame.centre * min(factor, most))
    return scene.with_hinges(body={"frame": lower})


_Axis = Callable[[Scene, Settings, np.random.Generator], tuple[Scene, Settings]]


def _of_scene(low: float, high: float, change: Callable[[Scene, float], Scene]) -> _Axis:
    """Return an axis of the scene, from 10**low to 10**high."""
    return lambda scene, settings, random: (
        change(scene, float(10 ** random.uniform(low, high))), settings,
    )  # fmt: skip


def _of_settings(low: float, high: float, change: Callable[[float], dict[str, Any]]) -> _Axis:
    return lambda scene, settings, random: (
        scene, replace(settings, **change(float(10 ** random.uniform(low, high)))),
    )  # fmt: skip


def _choice(*choices: dict[str, Any]) -> _Axis:
    return lambda scene, settings, random: (
        scene, replace(settings, **choices[int(random.integers(len(choices)))]),
    )  # fmt: skip


def _start_times(scene: Scene, factor: float) -> Scene:
    return replace(scene, start=replace(scene.start, momentum=scene.start.momentum * factor))


_AXES: dict[str, _Axis] = {
    "timestep": _of_settings(-4, 0, lambda v: {"timestep": v}),
    "integrator": _choice(*({"integrator": name} for name in OWN)),
    "adaptive": _of_settings(-13, -2, lambda v: {"integrator": ADAPTIVE, "rtol": v}),
    "rotor speed": _of_scene(-2, 4, lambda scene, v: _faster(scene, rotors=v)),
    "frame speed": _of_scene(-2, 3, lambda scene, v: _faster(scene, frame=v)),
    "momentum": _of_scene(-6, 4, _start_times),
    "shell's mass": _of_scene(-6, 6, lambda scene, v: _heavier(scene, v, Shell)),
    "frame's mass": _of_scene(-6, 6, lambda scene, v: _heavier(scene, v, Frame)),
    "rotors' mass": _of_scene(-6, 6, lambda scene, v: _heavier(scene, v, Rotor)),
    "mass": _of_scene(-9, 9, lambda scene, v: scaled(scene, mass=v, gravity=1.0)),
    "radius": _of_scene(-9, 9, lambda scene, v: scaled(scene, length=v, gravity=1.0)),
    "gravity": _of_scene(-9, 6, lambda scene, v: replace(scene, gravity=scene.gravity * v)),
    "friction": _of_settings(-3, 6, lambda v: {"sliding_friction": v}),
    "torsional friction": _of_settings(-3, 6, lambda v: {"torsional_friction": v}),
    "both frictions": _of_settings(
        -3, 6, lambda v: {"sliding_friction": v, "torsional_friction": v}
    ),
    "time constant": _of_settings(-4, 1, lambda v: {"solref": (v, 1.0)}),
    "stiffness": _of_settings(-1, 8, lambda v: {"solref": (-v, -2 * float(np.sqrt(v)))}),
    "friction damping": _of_settings(-3, 5, lambda v: {"solreffriction": (-1.0, -v)}),
    "impedance": _of_settings(-6, -0.2, lambda v: {"solimp": (1 - v, 1 - v, 0.001, 0.5, 1.0)}),
    "impratio": _of_settings(-3, 8, lambda v: {"impratio": v, "cone": "elliptic"}),
    "servo": _of_settings(-3, 5, lambda v: {"drive": Servo(gain=v)}),
    "armature": _of_settings(0, 18, lambda v: {"drive": Prescribed(armature=v)}),
    "tolerance": _of_settings(-16, -2, lambda v: {"tolerance": v}),
    "solver": _choice(*({"solver": name} for name in ("PGS", "CG", "Newton"))),
    "cone": _choice({"cone": "elliptic"}, {"cone": "pyramidal"}),
    "noslip": _choice({"noslip_iterations": 0}, {"noslip_iterations": 3}),
    "rolling friction": _of_settings(-5, 0, lambda v: {"condim": 6, "rolling_friction": v}),
    "condim": _choice({"condim": 3}, {"condim": 4}),
    "root": _choice({"root": "frame"}),
    "start": _choice({"start_in_equilibrium": False}),
}


_OF_ROBOTS: dict[str, Callable[[Scene, float], Scene]] = {
    **{
        f"{kind.__name__.lower()}'s mass": partial(_heavier, kind=kind)
        for kind in (Shell, Frame, Rotor, Pendulum)
    },
    "frame's offset": _lower,
    "radius": lambda scene, v: scaled(scene, length=v, gravity=1.0),
    "gravity": lambda scene, v: replace(scene, gravity=scene.gravity * v),
    "momentum": _start_times,
    "rates": lambda scene, v: _faster(scene, v, v),
}


_REFERENCE_STEPS = 20_000  # of the equations; runs that need more are not judged


@dataclass(frozen=True)
class _Judged:
    """The outcome of a run: its path error (None where it broke off) and what was reported of it.

    within: whether its errors are within its tolerance; warned: by the precheck; refused: why it
    was not run, if it was not.
    """

    run: _RandomRun
    path_error: float | None
    within: bool
    warned: tuple[str, ...]
    faults: tuple[str, ...]
    refused: str = ""

    @property
    def reported(self) -> bool:
        return bool(self.warned or self.faults or self.refused)

    @property
    def failed(self) -> bool:
        return not self.refused and (self.path_error is None or not self.path_error <= WRONG)

    @property
    def off(self) -> bool:
        return not self.refused and not self.within

    @property
    def false_alarm(self) -> bool:
        return self.reported and self.within


def measure_detection(count: int, seed: int, show: Show) -> dict[str, Any]:
    """Judge `count` extreme runs and robots, whose failures should be reported, and ordinary runs.

    Return extreme runs and robots by their outcome, those that were missed, and the false alarms of
    robots and ordinary runs, as plain data.
    """
    logging.getLogger("absl").setLevel(logging.ERROR)

    def runs(make: Callable[[int, int], _RandomRun], done: int, name: str) -> Iterator[_Judged]:
        for number in range(count):
            show(done + number, f"{name} runs")
            yield judged(make(seed, number))

    found: dict[str, Any] = {"missed": [], "false_alarms": []}
    for done, (name, make) in enumerate((("extreme", extreme), ("robot", robot))):
        counts: Counter[str] = Counter()
        for each in runs(make, done * count, name):
            failed = each.off if make is robot else each.failed
            missed = failed and not each.reported
            counts["refused"] += bool(each.refused)
            counts["failed"] += failed
            counts["warned of before"] += failed and bool(each.warned)
            counts["noticed during"] += failed and bool(each.faults)
            counts["missed"] += missed
            found["missed"] += [_words(each)] * missed
            found["false_alarms"] += [_words(each)] * (make is robot and each.false_alarm)
        found[name] = dict(counts)
    alarms = (each for each in runs(ordinary, 2 * count, "ordinary") if each.false_alarm)
    found["false_alarms"] += map(_words, alarms)
    return found


def judged(run: _RandomRun) -> _Judged:
    """Run by the engine and by the equations, and return what was reported of it."""
    with warnings.catch_warnings(action="ignore"):
        try:
            theory = integrate(run.scene, run.times, max_steps=_REFERENCE_STEPS)
            warned = exceeded(run.scene, run.settings, run.times)
            agreement = compare(run.scene, run.settings, theory=theory)
        except InputError as error:
            return _Judged(run, None, False, (), (), str(error))
    measured = (agreement.path_error, agreement.momentum_error)
    return _Judged(
        run,
        agreement.path_error,
        all(value is not None and value <= run.settings.error_tolerance for value in measured),
        tuple(map(str, warned)),
        tuple(map(str, agreement.faults)),
    )


def _main(count: int = 500, seed: int = 0) -> None:
    """Judge so many runs of each set, and print what was missed and which alarms were false."""
    with progress_bar(3 * count) as show:
        found = measure_detection(count, seed, show)

    def outcomes(kind: str) -> str:
        return ", ".join(f"{name} {number}" for name, number in found[kind].items())

    print(
        f"{count} extreme runs: {outcomes('extreme')}",
        f"{count} robots: {outcomes('robot')}",
        *(f"missed: {words}" for words in found["missed"]),
        f"{count} robots and {count} ordinary runs: {len(found['false_alarms'])} false alarms",
        *(f"false alarm: {words}" for words in found["false_alarms"]),
        sep="\n",
    )


def _words(of: _Judged) -> str:
    said = "; ".join((*of.warned, *of.faults, of.refused)).strip("; ")
    axes = ", ".join(of.run.axes)
    return ", ".join(filter(None, (of.run.scene.name, of.run.settings.name, axes, said)))


if __name__ == "__main__":
    _main(*map(int, sys.argv[1:]))
