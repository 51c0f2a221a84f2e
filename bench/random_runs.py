"""Measure missed failures and false alarms over three seeded sets of random runs.

Ordinary and extreme runs are balanced balls of the catalog, varied; extreme runs have one to three
parameters far outside the usual range. Robots are the unbalanced scenes of the catalog, varied,
with one to three extreme parameters. `python -m bench.random_runs 500` makes 500 of each.

A run has failed if it broke off or its path error exceeds a tenth of the path; a robot's run, if
the error of path or M exceeds the preset's tolerance. It is reported if the precheck warned of it
or the monitor found a fault.
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
from robotball.engines.mujoco.settings import ORDER_8, OWN, Prescribed, recipe
from robotball.robot.ball import Frame, Pendulum, Rotor, Shell
from robotball.robot.motors import Servo
from robotball.robot.variations import scaled, scaled_body, with_bodies
from robotball.rotations import Array
from validation.agreement import compare
from validation.many_runs import random_start
from validation.output import Show, known, progress_bar
from validation.studies.extremes import WRONG

_LONGEST = 100.0  # s
_STEPS, _TURNS = 3000, 40.0  # limits of a run: steps, and radians of its fastest rotation
_MOST_STEPS = 4000
_SAMPLES = 100
_RECIPES = ("fast", "balanced", "accurate", "exact")
_STEPPED = ("fast", "balanced", "balanced", "accurate")
_APART = 0.04  # s between the samples of a robot's run
_EXTREME_AXES = 3  # most extreme parameters of a run
_REFERENCE_STEPS = 20_000  # of the equations; runs that need more are refused


@dataclass(frozen=True)
class _RandomRun:
    """A scene, settings, sample times (n,) [s] and the names of its extreme parameters."""

    scene: Scene
    settings: Settings
    times: Array
    axes: tuple[str, ...] = ()


def ordinary(seed: int, number: int) -> _RandomRun:
    """Return a catalog ball with varied rates, momentum and attitude, and one of the presets."""
    random = np.random.default_rng([seed, number, 0])
    scene = _varied_scene(random)
    duration = float(random.uniform(1.0, 10.0))
    settings = preset(str(random.choice(_RECIPES)))
    return _RandomRun(scene, settings, np.linspace(0.0, duration, _SAMPLES + 1))


def extreme(seed: int, number: int) -> _RandomRun:
    """Return a varied ball with naive or recommended settings and one to three extremes."""
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
    """Return a varied robot of the catalog with a preset and one to three extremes."""
    random = np.random.default_rng([seed, number, 2])
    scene, settings = _varied_scene(random, balanced=False), preset(str(random.choice(_STEPPED)))
    chosen = random.choice(list(_OF_ROBOTS), random.integers(1, _EXTREME_AXES + 1), replace=False)
    for name in chosen:
        scene = _OF_ROBOTS[name](scene, float(10 ** random.uniform(-1.5, 1.5)))
    count = int(random.uniform(1.0, 3.0) / _APART)
    times = np.linspace(0.0, count * _APART, count + 1)
    return _RandomRun(scene, settings, times, tuple(map(str, chosen)))


def _short_times(scene: Scene, settings: Settings, random: np.random.Generator) -> Array:
    """Return sample times that limit the cost of the engine and of the equations."""
    plan = PlannedRun(scene, settings, scene.duration)
    turns = _TURNS * random.uniform(0.2, 1.0) / max(plan.rotation_rate, 1e-6)
    duration = min(max(min(turns, _STEPS * plan.timestep, _LONGEST), 10 * plan.timestep), _LONGEST)
    return np.linspace(0.0, duration, _SAMPLES + 1)


@cache
def _scenes(balanced: bool) -> list[Scene]:
    with warnings.catch_warnings(action="ignore", category=SceneWarning):  # unbuildable balls
        scenes = map(load_scene, catalog())
        return [scene for scene in scenes if (scene.not_reduced is None) == balanced]


def _varied_scene(random: np.random.Generator, balanced: bool = True) -> Scene:
    scene = _scenes(balanced)[int(random.integers(len(_scenes(balanced))))]
    start = random_start(scene, random)
    frame, rotors = random.uniform(0.3, 1.3, 2).tolist()
    return _faster(replace(scene, start=start), frame, rotors)


def _faster(scene: Scene, frame: float = 1.0, rotors: float = 1.0) -> Scene:
    def times(rate: Any, factor: float) -> Any:
        return rate * factor if isinstance(rate, float | int) else rate

    rate, *rates = (hinge.command for hinge in scene.ball.hinges)
    rates = [times(value, rotors) for value in rates]
    return scene.with_hinges(command=(times(rate, frame), *rates))


def _heavier(scene: Scene, factor: float, kind: type[Shell | Frame | Rotor | Pendulum]) -> Scene:
    def heavier(body: Any) -> Any:
        return scaled_body(body, factor) if isinstance(body, kind) else body

    return replace(scene, ball=with_bodies(scene.ball, heavier))


def _lower(scene: Scene, factor: float) -> Scene:
    """Return the scene with the frame's centre of mass moved, within the shell."""
    frame, a = scene.ball.frame, scene.ball.radius
    most = 0.95 * a / max(float(np.linalg.norm(frame.centre)), 1e-9 * a)
    lower = replace(frame, centre=frame.centre * min(factor, most))
    return scene.with_hinges(body={"frame": lower})


_Axis = Callable[[Scene, Settings, np.random.Generator], tuple[Scene, Settings]]


def _of_scene(low: float, high: float, change: Callable[[Scene, float], Scene]) -> _Axis:
    """Return a parameter of the scene that varies from 10**low to 10**high."""
    return lambda scene, settings, random: (
        change(scene, float(10 ** random.uniform(low, high))),
        settings,
    )


def _of_settings(low: float, high: float, change: Callable[[float], dict[str, Any]]) -> _Axis:
    return lambda scene, settings, random: (
        scene,
        replace(settings, **change(float(10 ** random.uniform(low, high)))),
    )


def _choice(*choices: dict[str, Any]) -> _Axis:
    return lambda scene, settings, random: (
        scene,
        replace(settings, **choices[int(random.integers(len(choices)))]),
    )


def _start_times(scene: Scene, factor: float) -> Scene:
    return replace(scene, start=replace(scene.start, momentum=scene.start.momentum * factor))


_AXES: dict[str, _Axis] = {
    "timestep": _of_settings(-4, 0, lambda v: {"timestep": v}),
    "integrator": _choice(*({"integrator": name} for name in OWN)),
    "order 8": _of_settings(-3, 0, lambda v: {"integrator": ORDER_8, "timestep": v}),
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


@dataclass(frozen=True)
class _Judged:
    """Outcome of a run.

    Attributes
    ----------
    path_error : float, optional
        None if the run broke off.
    within : bool
        Whether all errors are within the settings' tolerance.
    warned, faults : tuple of str
        Warnings of the precheck, and faults of the run.
    refused : str
        Why the run was refused, "" if it was not.
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
    """Judge `count` extreme runs, robots and ordinary runs, as plain data.

    Returns the outcomes of extreme runs and robots, the missed failures, and the false alarms of
    robots and ordinary runs.
    """
    logging.getLogger("absl").setLevel(logging.ERROR)

    def runs(make: Callable[[int, int], _RandomRun], done: int, name: str) -> Iterator[_Judged]:
        for number in range(count):
            show(done + number, f"{name} runs")
            yield judged(make(seed, number))

    results: dict[str, Any] = {"missed": [], "false_alarms": []}
    for done, (name, make) in enumerate((("extreme", extreme), ("robot", robot))):
        counts: Counter[str] = Counter()
        for outcome in runs(make, done * count, name):
            failed = outcome.off if make is robot else outcome.failed
            missed = failed and not outcome.reported
            counts["refused"] += bool(outcome.refused)
            counts["failed"] += failed
            counts["warned of before"] += failed and bool(outcome.warned)
            counts["noticed during"] += failed and bool(outcome.faults)
            counts["missed"] += missed
            results["missed"] += [_line(outcome)] * missed
            results["false_alarms"] += [_line(outcome)] * (make is robot and outcome.false_alarm)
        results[name] = dict(counts)
    ordinary_runs = runs(ordinary, 2 * count, "ordinary")
    results["false_alarms"] += [_line(outcome) for outcome in ordinary_runs if outcome.false_alarm]
    return results


def judged(run: _RandomRun) -> _Judged:
    with warnings.catch_warnings(action="ignore"):
        try:
            theory = integrate(run.scene, run.times, max_steps=_REFERENCE_STEPS)
            warned = exceeded(run.scene, run.settings, run.times)
            agreement = compare(run.scene, settings=run.settings, theory=theory)
        except InputError as error:
            return _Judged(run, None, False, (), (), str(error))
    measured = (agreement.path_error, agreement.momentum_error)
    return _Judged(
        run,
        known(agreement.path_error),
        all(value <= run.settings.error_tolerance for value in measured),
        tuple(map(str, warned)),
        tuple(map(str, agreement.faults)),
    )


def _main(count: int = 500, seed: int = 0) -> None:
    """Judge `count` runs of each set, and print missed failures and false alarms."""
    with progress_bar(3 * count) as show:
        results = measure_detection(count, seed, show)

    def outcomes(kind: str) -> str:
        return ", ".join(f"{name} {number}" for name, number in results[kind].items())

    print(
        f"{count} extreme runs: {outcomes('extreme')}",
        f"{count} robots: {outcomes('robot')}",
        *(f"missed: {line}" for line in results["missed"]),
        f"{count} robots and {count} ordinary runs: {len(results['false_alarms'])} false alarms",
        *(f"false alarm: {line}" for line in results["false_alarms"]),
        sep="\n",
    )


def _line(outcome: _Judged) -> str:
    reports = "; ".join((*outcome.warned, *outcome.faults, outcome.refused)).strip("; ")
    axes = ", ".join(outcome.run.axes)
    names = (outcome.run.scene.name, outcome.run.settings.name, axes, reports)
    return ", ".join(filter(None, names))


if __name__ == "__main__":
    _main(*map(int, sys.argv[1:]))
