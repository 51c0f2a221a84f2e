"""The cost of a step with each thing that the minimal model leaves out."""

from dataclasses import replace
from functools import partial
from typing import Any

import mujoco

from robotball import PRESETS, Scene, Settings
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.mjcf_export import DEFAULT_ITERATIONS, dress
from robotball.engines.mujoco.model import build, hinges_of
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import InputError
from robotball.motors import Motor, Servo
from validation.output import Show
from validation.studies.extreme_maps import scaled_body
from validation.studies.friction import LEAST_FRICTION
from validation.studies.timing import measure_costs, one_step
from validation.study import Column, Row, Study, table_of

_MINIMAL = PRESETS["accurate"]
_SPLIT = 3  # rotors for each of the scene's
_SENSORS = ("framepos", "framequat", "framelinvel", "frameangvel", "framelinacc", "frameangacc")


def parts_of(scene: Scene) -> dict[str, mujoco.MjModel]:
    """Return the compiled models by what they have: the minimal one, one thing more each, all."""
    classical = scene.rolling == "classical"
    spin: dict[str, Any] = {"torsional_friction": LEAST_FRICTION} if classical else {}
    roll = {**spin, "condim": 6, "rolling_friction": LEAST_FRICTION}
    prescribed = any(not hinge.own_motor for hinge in hinges_of(scene, _MINIMAL))
    servos: dict[str, Any] = {"drive": NAIVE.drive} if prescribed else {}
    parts = {"minimal": _compiled(scene, _MINIMAL)}
    if scene.ball.rotors:
        parts["three rotors for each"] = _compiled(split(scene), _MINIMAL)
    if classical:
        parts["condim 4"] = _compiled(scene, replace(_MINIMAL, condim=4, **spin))
    parts["condim 6"] = _compiled(scene, replace(_MINIMAL, **roll))
    parts["geoms, textures, lights"] = _compiled(scene, _MINIMAL, dressed=True)
    parts["sensors of every body"] = _compiled(scene, _MINIMAL, sensors=True)
    if prescribed:
        parts["servos for the rates"] = _compiled(scene, replace(_MINIMAL, **servos))
    parts["Newton for PGS"] = _compiled(scene, replace(_MINIMAL, solver="Newton"))
    many = replace(_MINIMAL, iterations=DEFAULT_ITERATIONS)
    parts[f"{DEFAULT_ITERATIONS} iterations"] = _compiled(scene, many)
    # Without the huge inertias MuJoCo's own tolerance can stop the iterations early.
    whole = replace(_MINIMAL, **roll, **servos, solver="Newton", iterations=None, tolerance=None)
    parts["all of it"] = _compiled(split(scene), whole, dressed=True, sensors=True)
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
    return Study(scene.name, LABEL, ["parts"], rows, record, [table_of(COLUMNS, rows)])


def _ratio(row: Row) -> str:
    return f"{row['ratio']:.2f} ({row['least']:.2f}-{row['most']:.2f})"


COLUMNS = (
    Column("the minimal model with", "part", words=True),
    Column("a step costs", _ratio),
    *(Column(name, name, form="d") for name in ("bodies", "dofs", "sensors", "geoms")),
)


def split(scene: Scene) -> Scene:
    """Return the scene with every rotor made of three about its axis: inertia and K are equal."""
    ball = scene.ball
    rotors = tuple(scaled_body(rotor, 1 / _SPLIT) for rotor in ball.rotors for _ in range(_SPLIT))
    motors = scene.motors
    if motors:
        own = [motor and _weaker(motor) for motor in motors[1:] for _ in range(_SPLIT)]
        motors = (motors[0], *own)
    return replace(
        scene,
        ball=replace(ball, rotors=rotors),
        rotor_rates=tuple(rate for rate in scene.rotor_rates for _ in range(_SPLIT)),
        motors=motors,
    )


def _weaker(motor: Motor) -> Servo:
    if not isinstance(motor, Servo):
        raise InputError(f"only velocity servos are shared among rotors, not {motor}")
    limit = motor.torque_limit
    return Servo(motor.gain / _SPLIT, None if limit is None else limit / _SPLIT)


def _compiled(
    scene: Scene, settings: Settings, *, dressed: bool = False, sensors: bool = False
) -> mujoco.MjModel:
    model = build(scene, settings)
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
