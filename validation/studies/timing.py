"""The cost of work as a ratio to a bare loop of mj_step, taken in turn with it in one run.

A machine's speed wanders, and other work shares its caches: seconds are one machine's at one time.
The ratio of two neighbours in time is what lasts; seconds are derived from it.

By such ratios `measure_parts` finds the cost of each thing that the minimal model leaves out.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import mujoco

from robotball import PRESETS, Scene, load_scene
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.mjcf_export import DEFAULT_ITERATIONS, dress
from robotball.engines.mujoco.model import Model, build, hinges_of
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import InputError
from robotball.motors import Motor, Servo
from robotball.rotations import Array
from validation.output import Show
from validation.studies.extreme_maps import scaled_body
from validation.studies.friction import LEAST_FRICTION
from validation.study import Column, Row, Study, table_of

_MINIMAL = PRESETS["accurate"]  # the model of the bare loop, on fig12
_STEPS = 250  # of it, at every turn

_Work = Callable[[], float]
"""Does a piece of work, set-up excluded, and returns its processor time [s]."""


@dataclass(frozen=True)
class Cost:
    """The cost of a piece of work, over rounds.

    ratios    of its processor time to the bare loop's of one simulated second, one a round
    baseline  s, processor time of the bare loop for one simulated second, the rounds' median
    """

    ratios: tuple[float, ...]
    baseline: float

    @property
    def ratio(self) -> float:
        """Return the rounds' median."""
        return statistics.median(self.ratios)

    @property
    def spread(self) -> tuple[float, float]:
        """Return the least and the largest of the rounds' ratios."""
        return min(self.ratios), max(self.ratios)

    @property
    def seconds(self) -> float:
        """Return the processor time [s] at the baseline's median speed."""
        return self.ratio * self.baseline

    def over(self, other: "Cost") -> "Cost":
        """Return the cost relative to another's of the same rounds, which becomes the baseline."""
        ratios = zip(self.ratios, other.ratios, strict=True)
        return Cost(tuple(ours / theirs for ours, theirs in ratios), other.seconds)


def bare_loop() -> float:
    """Return the processor time [s] of one simulated second of mj_step alone, unmonitored."""
    compiled = _baseline_model().compiled
    return one_step(compiled) / compiled.opt.timestep


@cache
def _baseline_model() -> Model:
    return build(load_scene("fig12"), _MINIMAL)


def one_step(compiled: mujoco.MjModel, steps: int = _STEPS) -> float:
    """Return the processor time of one mj_step [s], the mean of `steps` from the model's start."""
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    began = time.thread_time()
    for _ in range(steps):
        mujoco.mj_step(compiled, data)
    return (time.thread_time() - began) / steps


def simulated_second(model: Model, times: Array) -> _Work:
    """Return the work of a simulated second of a run over `times` (n,) [s]: stepping, reading."""

    def work() -> float:
        motion = run(model, times)
        done = motion.report
        # A run that breaks off has stepped on to where it was looked at next.
        broken = len(motion.times) < len(times)
        return done.seconds / (done.steps * done.timestep if broken else float(times[-1]))

    return work


def measure_costs(
    works: Sequence[_Work], rounds: int = 5, show: Callable[[int], object] = lambda done: None
) -> list[Cost]:
    """Measure every work, all in turn, each between two bare loops; one round more warms up.

    show: called with the number of works done, of (rounds + 1) times as many.
    """
    ratios: list[list[float]] = [[] for _ in works]
    loops: list[float] = []
    before = bare_loop()
    for turn in range(rounds + 1):
        for i, work in enumerate(works):
            seconds, after = work(), bare_loop()
            if turn:
                loops.append(after)
                ratios[i].append(2 * seconds / (before + after))
            before = after
            show(turn * len(works) + i + 1)
    baseline = statistics.median(loops)
    return [Cost(tuple(each), baseline) for each in ratios]


_SPLIT = 3  # rotors for each of the scene's
_SENSORS = ("framepos", "framequat", "framelinvel", "frameangvel", "framelinacc", "frameangacc")


def parts_of(scene: Scene) -> dict[str, mujoco.MjModel]:
    """Return the compiled models by what they have: the minimal one, one thing more each, all."""
    classical = scene.rolling == "classical"
    spin: dict[str, Any] = {"torsional_friction": LEAST_FRICTION} if classical else {}
    roll = {**spin, "condim": 6, "rolling_friction": LEAST_FRICTION}
    prescribed = any(not hinge.own_motor for hinge in hinges_of(scene, _MINIMAL))
    servos: dict[str, Any] = {"drive": NAIVE.drive} if prescribed else {}
    parts = {"minimal": _compiled(scene)}
    if scene.ball.rotors:
        parts["three rotors for each"] = _compiled(split(scene))
    if classical:
        parts["condim 4"] = _compiled(scene, condim=4, **spin)
    parts["condim 6"] = _compiled(scene, **roll)
    parts["geoms, textures, lights"] = _compiled(scene, dressed=True)
    parts["sensors of every body"] = _compiled(scene, sensors=True)
    if prescribed:
        parts["servos for the rates"] = _compiled(scene, **servos)
    parts["Newton for PGS"] = _compiled(scene, solver="Newton")
    parts[f"{DEFAULT_ITERATIONS} iterations"] = _compiled(scene, iterations=DEFAULT_ITERATIONS)
    # Without the huge inertias MuJoCo's own tolerance can stop the iterations early.
    whole = {**roll, **servos, "solver": "Newton", "iterations": None, "tolerance": None}
    parts["all of it"] = _compiled(split(scene), dressed=True, sensors=True, **whole)
    return parts


def measure_parts(scene: Scene, rounds: int, show: Show) -> Study:
    """Measure the cost of a step of each variant, all in turn, as ratios to the minimal model's."""
    parts = parts_of(scene)
    costs = measure_costs(
        [partial(one_step, compiled) for compiled in parts.values()],
        rounds,
        lambda done: show(done / (rounds + 1) / len(parts), f"{scene.name}: parts"),
    )
    rows: list[Row] = []
    for (name, of), cost in zip(parts.items(), costs, strict=True):
        ratio = cost.over(costs[0])
        least, most = ratio.spread
        rows.append(
            {
                "part": name, "ratio": ratio.ratio, "least": least, "most": most,
                "bodies": of.nbody, "dofs": of.nv, "sensors": of.nsensor, "geoms": of.ngeom,
            }
        )  # fmt: skip
    record = {"scene": scene.name, "rounds": rounds, "parts": rows}
    return Study(scene.name, LABEL, ["parts"], rows, record, [table_of(_COLUMNS, rows)])


def _ratio(row: Row) -> str:
    return f"{row['ratio']:.2f} ({row['least']:.2f}-{row['most']:.2f})"


_COLUMNS = (
    Column("the minimal model with", "part", words=True),
    Column("a step costs", _ratio),
    *(Column(name, name, form="d") for name in ("bodies", "dofs", "sensors", "geoms")),
)


def split(scene: Scene) -> Scene:
    """Return the scene with every rotor made of three about its axis: inertia and K are equal."""
    frame, *rotors = scene.ball.hinges
    thirds = [
        replace(own, body=scaled_body(rotor, 1 / _SPLIT), motor=own.motor and _weaker(own.motor))
        for own, rotor in zip(rotors, scene.ball.rotors, strict=True)
        for _ in range(_SPLIT)
    ]
    return replace(scene, ball=replace(scene.ball, hinges=(frame, *thirds)))


def _weaker(motor: Motor) -> Servo:
    if not isinstance(motor, Servo):
        raise InputError(f"only velocity servos are shared among rotors, not {motor}")
    limit = motor.torque_limit
    return Servo(motor.gain / _SPLIT, None if limit is None else limit / _SPLIT)


def _compiled(
    scene: Scene, *, dressed: bool = False, sensors: bool = False, **changes: Any
) -> mujoco.MjModel:
    """Return the model of the minimal settings with some changes."""
    model = build(scene, replace(_MINIMAL, **changes))
    model = dress(model) if dressed else model
    if not sensors:
        return model.compiled
    spec = mujoco.MjSpec.from_string(model.xml)
    for body in spec.bodies[1:]:
        for kind in _SENSORS:
            spec.add_sensor(
                type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                objname=body.name,
            )
    return spec.compile()
