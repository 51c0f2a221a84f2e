"""Write a scene as TOML in full precision, so that `load_scene` restores it to the last bit.

The scene is converted to the records of `scene_tables`, and the records to text: scalars first,
then one table per body. Bodies are written with mass, centre and inertia, even if they had parts.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, astuple
from typing import Any, cast

import msgspec
import numpy as np

from robotball.errors import InputError
from robotball.files import scene_tables as tables
from robotball.files.scene_tables import DRIVES, HingeTable
from robotball.robot.ball import Hinge, Pendulum, Rotor, Shell, shell_inertia
from robotball.robot.drives import Ramp, Rate, Samples, Sine, Sum
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array

# At rest means M = 0 in the paper, but ω = 0 to a robot's builder.
_REST_COMMENT = "  # M = 0; ω is not, where frame or rotors turn"
# These keys are written even if they have default values, because a human reader expects an axis to
# have a direction and a point.
_ALWAYS = ("axis", "pivot")


def toml_of(scene: Scene) -> str:
    """Return the text of a scene file.

    Raises InputError for a rate given as a function of time, links, actuators or a controller.
    """
    return text_of(_scene_table(scene))


def _scene_table(scene: Scene) -> tables.SceneTable:
    scene.check_open("a scene file")
    ball = scene.ball
    if ball.general or scene.actuators:
        raise InputError(
            f"{scene.name}: a scene file holds a symmetric shell, a frame, rotors and pendulums, "
            "but not links or actuators; keep the model file or the Python that made the scene"
        )
    kinds = (Rotor, Pendulum)
    hung = {kind: [h for h in ball.hinges if isinstance(h.body, kind)] for kind in kinds}
    return tables.SceneTable(
        **{name: getattr(scene, name) for name in (*tables.SAME, "gravity_direction")},
        friction=tables.FrictionTable(**asdict(scene.friction)),
        plane=tables.PlaneTable(
            motion=tuple(map(_command, scene.plane_motion)), rotation=_command(scene.plane_rotation)
        ),
        shell=_shell(ball.shell),
        frame=tables.FrameTable(**_hinge(ball.hinges[0])),
        rotor=tuple(tables.RotorTable(**_hinge(hinge)) for hinge in hung[Rotor]),
        pendulum=tuple(tables.PendulumTable(**_hinge(hinge)) for hinge in hung[Pendulum]),
        start=tables.StartTable(**start_keys(scene.start)),
    )


def start_keys(start: Start) -> dict[str, Any]:
    """Return the keys of a scene file's start."""
    *slip, spin = start.slip.tolist()
    vectors = {"attitude": start.attitude, "momentum_world": start.momentum}
    return {name: _numbers(v) for name, v in vectors.items()} | {"slip": tuple(slip), "spin": spin}


def _shell(shell: Shell) -> tables.ShellTable:
    # Write "thin" if this is exact. The reader uses the same formula.
    thin = shell_inertia(shell.radius, shell.mass)
    axial, transverse = shell.axial_inertia, shell.transverse_inertia
    is_thin = (axial, transverse) == (thin, thin)
    return tables.ShellTable(
        radius=shell.radius,
        mass=shell.mass,
        inertia="thin" if is_thin else tables.Axial(axial=axial, transverse=transverse),
        axis=_numbers(shell.axis),
        offset=shell.offset,
    )


def _numbers(values: Array) -> Any:
    """Return a tuple of numbers."""
    return tuple(values.tolist())


def _hinge(hinge: Hinge) -> dict[str, Any]:
    """Return the keys of a hinge and of its body."""
    body, motor = hinge.body, hinge.motor
    if isinstance(body, Rotor):
        # Moments that were computed from the rotor's tensor would be rounded.
        inertia: Any = tables.Axial(axial=body.axial_inertia, transverse=body.transverse_inertia)
    else:
        inertia = [_numbers(row) for row in body.inertia]
    motor_name = None if motor is None else type(motor).__name__
    drives = ((name, kind) for name, kind in DRIVES.items() if kind.motor == motor_name)
    name, kind = next(drives, (None, None))
    if kind is None:
        raise InputError(f"a scene file cannot hold the motor {motor}: keep the Python code")
    keys: dict[str, Any] = {
        "mass": body.mass,
        "inertia": inertia,
        "centre": _numbers(body.centre) if np.any(body.centre) else None,
        "drive": name,
        "initial_angle": hinge.angle,
        "initial_rate": hinge.rate,
    }
    if isinstance(body, Rotor | Pendulum):
        keys["axis"] = _numbers(body.axis)
    if isinstance(body, Pendulum):
        keys["pivot"] = _numbers(body.pivot)
    if kind.command is not None:
        keys[kind.command] = _command(hinge.command)
    if motor is not None:
        # A field of 0 or None has no effect, the same as a missing key.
        values = astuple(cast(Any, motor))  # every motor is a dataclass
        keys.update({k: v for k, v in zip(kind.keys, values, strict=True) if v})
    return keys


def _command(rate: Rate) -> Any:
    if isinstance(rate, Sum):
        return [_command(part) for part in rate.terms]
    if isinstance(rate, Ramp | Sine | Samples | float | int):
        return rate
    raise InputError("a function of time cannot be written to a scene file; use Samples")


def text_of(table: tables.SceneTable) -> str:
    """Return the text of a scene file's table."""
    return "\n".join(_lines(table)) + "\n"


def _lines(table: tables.Table) -> Iterator[str]:
    """Yield the lines of a table: its keys, then the inner tables with their names."""
    # Write the keys of a body before the keys of its hinge, which the record inherits.
    in_hinge = HingeTable.__struct_fields__
    for field in sorted(msgspec.structs.fields(table), key=lambda field: field.name in in_hinge):
        name, value = field.name, getattr(table, field.name)
        if value is None or (value == field.default and name not in _ALWAYS):
            continue
        if name == "source":
            lines = "\n".join(map(_escaped, value.split("\n")))
            yield f'source = """\n{lines}"""'
        elif isinstance(table, tables.SceneTable) and isinstance(value, tables.Table):
            yield from ("", f"[{name}]", *_lines(value))
        elif isinstance(table, tables.SceneTable) and name in ("rotor", "pendulum"):
            for body in value:
                yield from ("", f"[[{name}]]", *_lines(body))
        else:
            comment = _REST_COMMENT * (name == "momentum_world" and not any(value))
            yield f"{name} = {_value(value)}{comment}"


def _value(value: Any) -> str:
    """Return the text of a value, on one line except for the rows of a tensor."""
    if isinstance(value, str):
        return f'"{_escaped(value)}"'
    if isinstance(value, msgspec.Struct):
        builtins = msgspec.to_builtins(value, enc_hook=float)  # float: msgspec has no NumPy numbers
        keys = {k: v for k, v in builtins.items() if v is not None}
        return f"{{ {', '.join(f'{k} = {_value(v)}' for k, v in keys.items())} }}"
    if isinstance(value, tuple | list):
        texts = [_value(item) for item in value]
        # In TOML, an inline table must be on one line; a list may have several lines.
        if isinstance(value[0], tuple | tables.Table):
            return "\n".join(["[", *(f"    {row}," for row in texts), "]"])
        return f"[{', '.join(texts)}]"
    return repr(float(value))


def _escaped(text: str) -> str:
    """Return a text with the escapes of TOML, which are the escapes of JSON and that of DEL."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace("\x7f", "\\u007f")
