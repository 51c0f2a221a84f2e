"""Measure the cost per step of each addition to the minimal model.

`python -m bench.parts fig12` prints the table of docs/cost.md; any scene may be named.
"""

import sys
from dataclasses import replace
from functools import partial
from typing import Any

import mujoco

from robotball import PRESETS, Scene, load_scene
from robotball.engines.mujoco.mjcf_export import dress
from robotball.engines.mujoco.model import build, hinges_of
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import InputError
from robotball.robot.motors import Motor, Servo
from robotball.robot.variations import scaled_body
from validation.studies.measuring import measure_costs, one_step
from validation.study import Column, Row, show, table_of

_MINIMAL = PRESETS["accurate"]
_ROUNDS = 15
_LEAST_FRICTION = 1e-5  # m, MuJoCo's smallest coefficient: almost no friction
_ITERATIONS = 100  # MuJoCo's default
_SPLIT = 3  # rotors in place of one
_SENSORS = ("framepos", "framequat", "framelinvel", "frameangvel", "framelinacc", "frameangacc")


def parts_of(scene: Scene) -> dict[str, mujoco.MjModel]:
    """Return compiled models by name: the minimal model, one per addition, and one with all."""
    classical = scene.rolling == "classical"
    spin: dict[str, Any] = {"torsional_friction": _LEAST_FRICTION} if classical else {}
    roll = {**spin, "condim": 6, "rolling_friction": _LEAST_FRICTION}
    prescribed = any(hinge.motor is None for hinge in hinges_of(scene, _MINIMAL))
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
    parts[f"{_ITERATIONS} iterations"] = _compiled(scene, iterations=_ITERATIONS)
    # With the huge inertias MuJoCo's tolerance could end the iterations early.
    whole = {**roll, **servos, "solver": "Newton", "iterations": None, "tolerance": None}
    parts["all of it"] = _compiled(split(scene), dressed=True, sensors=True, **whole)
    return parts


def rows_of(scene: Scene, rounds: int) -> list[Row]:
    """Measure the cost of a step of all models in turn, relative to the minimal model."""
    parts = parts_of(scene)
    costs = measure_costs([partial(one_step, model) for model in parts.values()], rounds)
    rows: list[Row] = []
    for (name, model), cost in zip(parts.items(), costs, strict=True):
        ratio = cost.over(costs[0])
        least, most = ratio.spread
        sizes = {
            "bodies": model.nbody,
            "dofs": model.nv,
            "sensors": model.nsensor,
            "geoms": model.ngeom,
        }
        rows.append({"part": name, "ratio": ratio.ratio, "least": least, "most": most, **sizes})
    return rows


_COLUMNS = (
    Column("the minimal model with", "part", words=True),
    Column("a step costs", lambda row: "{ratio:.2f} ({least:.2f}-{most:.2f})".format(**row)),
    *(Column(name, name, form="d") for name in ("bodies", "dofs", "sensors", "geoms")),
)


def split(scene: Scene) -> Scene:
    """Return the scene with each rotor split into three; inertia and K stay equal."""
    frame, *rotors = scene.ball.hinges
    thirds = [
        replace(
            hinge, body=scaled_body(rotor, 1 / _SPLIT), motor=hinge.motor and _weaker(hinge.motor)
        )
        for hinge, rotor in zip(rotors, scene.ball.rotors, strict=True)
        for _ in range(_SPLIT)
    ]
    return replace(scene, ball=replace(scene.ball, hinges=(frame, *thirds)))


def _weaker(motor: Motor) -> Servo:
    if not isinstance(motor, Servo):
        raise InputError(f"only velocity servos can be split among rotors, not {motor}")
    limit = motor.torque_limit
    return Servo(motor.gain / _SPLIT, None if limit is None else limit / _SPLIT)


def _compiled(
    scene: Scene, *, dressed: bool = False, sensors: bool = False, **changes: Any
) -> mujoco.MjModel:
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


if __name__ == "__main__":
    for _name in sys.argv[1:]:
        show([table_of(_COLUMNS, rows_of(load_scene(_name), _ROUNDS))])
