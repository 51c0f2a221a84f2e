"""What each modelled thing costs: the minimal model beside the same ball with more in it.

What each modelled thing costs a step: a table in the terminal, and plain data.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mujoco
from rich import box
from rich.console import Console
from rich.table import Table

from robotball import PRESETS, Scene, Settings
from robotball.drives import Motor, Servo
from robotball.engines.mujoco.export import DEFAULT_ITERATIONS
from robotball.engines.mujoco.model import build, hinges_of
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import InputError
from robotball.robot import Rotor
from validation.output import print_whole
from validation.studies.friction import LEAST_FRICTION
from validation.studies.timing import Cost, measure_costs, one_step

MINIMAL = PRESETS["accurate"]
SPLIT = 3  # rotors for each of the scene's
SENSORS = ("framepos", "framequat", "framelinvel", "frameangvel", "framelinacc", "frameangacc")


@dataclass(frozen=True)
class Part:
    """A variant of the minimal model: what is on in it, and its compiled model."""

    name: str
    compiled: mujoco.MjModel


def parts_of(scene: Scene) -> list[Part]:
    """The minimal model, the same with one thing more each, and with all of them."""
    classical = scene.rolling == "classical"
    spin: dict[str, Any] = {"torsional_friction": LEAST_FRICTION} if classical else {}
    roll = {**spin, "condim": 6, "rolling_friction": LEAST_FRICTION}
    prescribed = any(not hinge.own_motor for hinge in hinges_of(scene, MINIMAL))
    servos: dict[str, Any] = {"drive": NAIVE.drive} if prescribed else {}
    parts = [_part("minimal", scene, MINIMAL)]
    if scene.ball.rotors:
        parts.append(_part("three rotors for each", split(scene), MINIMAL))
    if classical:
        parts.append(_part("condim 4", scene, replace(MINIMAL, condim=4, **spin)))
    parts += [
        _part("condim 6", scene, replace(MINIMAL, **roll)),
        _part("geoms, textures, lights", scene, MINIMAL, dressed=True),
        _part("sensors of every body", scene, MINIMAL, sensors=True),
        *([_part("servos for the rates", scene, replace(MINIMAL, **servos))] if prescribed else []),
        _part("Newton for PGS", scene, replace(MINIMAL, solver="Newton")),
        _part(
            f"{DEFAULT_ITERATIONS} iterations",
            scene,
            replace(MINIMAL, iterations=DEFAULT_ITERATIONS),
        ),
        _part(
            "all of it",
            split(scene),
            # Without the huge inertias MuJoCo's own tolerance can stop the iterations early.
            replace(MINIMAL, **roll, **servos, solver="Newton", iterations=None, tolerance=None),
            dressed=True,
            sensors=True,
        ),
    ]
    return parts


def measure_parts(
    parts: Sequence[Part], rounds: int, show: Callable[[int], None] | None = None
) -> list[Cost]:
    """What a step of each costs, all in turn, as ratios to one of the first."""
    costs = measure_costs([partial(one_step, part.compiled) for part in parts], rounds, show)
    return [cost.over(costs[0]) for cost in costs]


def split(scene: Scene) -> Scene:
    """The same ball with every rotor made of three, about one axis: the same inertia and K."""
    ball = scene.ball
    rotors = tuple(_third(rotor) for rotor in ball.rotors for _ in range(SPLIT))
    motors = scene.motors
    if motors:
        own = [motor and _weaker(motor) for motor in motors[1:] for _ in range(SPLIT)]
        motors = (motors[0], *own)
    return replace(
        scene,
        ball=replace(ball, rotors=rotors),
        rotor_rates=tuple(rate for rate in scene.rotor_rates for _ in range(SPLIT)),
        motors=motors,
    )


def _third(rotor: Rotor) -> Rotor:
    return replace(
        rotor,
        mass=rotor.mass / SPLIT,
        axial_inertia=rotor.axial_inertia / SPLIT,
        transverse_inertia=rotor.transverse_inertia / SPLIT,
    )


def _weaker(motor: Motor) -> Servo:
    if not isinstance(motor, Servo):
        raise InputError(f"only velocity servos are shared among rotors, not {motor}")
    limit = motor.torque_limit
    return Servo(motor.gain / SPLIT, None if limit is None else limit / SPLIT)


def _part(
    name: str, scene: Scene, settings: Settings, *, dressed: bool = False, sensors: bool = False
) -> Part:
    model = build(scene, settings, dressed=dressed)
    if not sensors:
        return Part(name, model.compiled)
    spec = mujoco.MjSpec.from_string(model.xml)
    for body in spec.bodies[1:]:
        for kind in SENSORS:
            spec.add_sensor(
                type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                objname=body.name,
            )
    return Part(name, spec.compile())


SIZES = ("bodies", "dofs", "sensors", "geoms")


def show_parts(parts: Sequence[Part], costs: Sequence[Cost], console: Console) -> None:
    """Print what a step costs with each part, relative to the minimal model."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("the minimal model with", no_wrap=True)
    table.add_column("a step costs", justify="right", no_wrap=True)
    for name in SIZES:
        table.add_column(name, justify="right")
    for each in rows(parts, costs):
        ratio = f"{each['ratio']:.2f} ({each['least']:.2f}-{each['most']:.2f})"
        table.add_row(each["part"], ratio, *(str(each[name]) for name in SIZES))
    print_whole(table, console)


def rows(parts: Sequence[Part], costs: Sequence[Cost]) -> list[dict[str, Any]]:
    """A row of plain numbers for every part."""
    return [
        {
            "part": part.name,
            "ratio": cost.ratio,
            "least": cost.spread[0],
            "most": cost.spread[1],
            "bodies": part.compiled.nbody,
            "dofs": part.compiled.nv,
            "sensors": part.compiled.nsensor,
            "geoms": part.compiled.ngeom,
        }
        for part, cost in zip(parts, costs, strict=True)
    ]
