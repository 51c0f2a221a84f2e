"""Write a scene as TOML, in full precision: `load_scene` reads the same scene back to the last bit.

The scene becomes the records of `scene_tables`, and these become text: scalars first, then a table
for each body. Bodies are written by mass, centre and inertia, however they were given.
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
from robotball.robot.scene import Scene
from robotball.rotations import Array

_REST_COMMENT = "M = 0; ω is not, where frame or rotors turn"
# Written even where they have their default: a reader would look for a direction and its place.
_ALWAYS = ("axis", "pivot")


def scene_toml(scene: Scene) -> str:
    """Write a scene as the text of a scene file.

    `load_scene` reads the same scene from it, to the last bit. The name of the scene is the name of
    the file, and is not in the text. Rotors stand before pendulums.

    Parameters
    ----------
    scene : Scene
        The scene to write.

    Returns
    -------
    str
        The text, with the bodies, rates and start of the scene.

    Raises
    ------
    InputError
        If the scene has a rate by a function of time, links, actuators or a controller, which no
        scene file can hold.

    Examples
    --------
    >>> import robotball as rb
    >>> print(rb.scene_toml(rb.load_scene("fig12")).splitlines()[0])
    title = "Drifting along a limit cycle, rubber (Fig. 12)"
    """
    # The start comes last, and its momentum last in it: the remark is on that line. From rest means
    # M = 0 in the paper, where a robot's builder would expect ω = 0.
    text = text_of(_scene_table(scene)).rstrip("\n")
    return f"{text}\n" if np.any(scene.start.momentum) else f"{text}  # {_REST_COMMENT}\n"


def _scene_table(scene: Scene) -> tables.SceneTable:
    scene.check_open("a scene file")
    ball = scene.ball
    if ball.general or scene.actuators:
        raise InputError(
            f"{scene.name}: a scene file holds a symmetric shell, a frame, rotors and pendulums, "
            "but no links or actuators; keep the model file, or the Python that made the scene"
        )
    kinds = (Rotor, Pendulum)
    hung = {kind: [each for each in ball.hinges if isinstance(each.body, kind)] for kind in kinds}
    return tables.SceneTable(
        title=scene.title,
        source=scene.source,
        rolling=scene.rolling,
        duration=scene.duration,
        gravity=scene.gravity,
        gravity_direction=scene.gravity_direction,
        friction=tables.FrictionTable(**asdict(scene.friction)),
        plane=tables.PlaneTable(motion=tuple(map(_command, scene.plane_motion))),
        shell=_shell(ball.shell),
        frame=tables.FrameTable(**_hinge(ball.hinges[0])),
        rotor=tuple(tables.RotorTable(**_hinge(each)) for each in hung[Rotor]),
        pendulum=tuple(tables.PendulumTable(**_hinge(each)) for each in hung[Pendulum]),
        start=tables.StartTable(
            attitude=_numbers(scene.start.attitude), momentum_world=_numbers(scene.start.momentum)
        ),
    )


def _shell(shell: Shell) -> tables.ShellTable:
    # A word where it is exact: so is the reader's formula, and the file says what is meant.
    thin = shell_inertia(shell.radius, shell.mass)
    axial, transverse = shell.axial_inertia, shell.transverse_inertia
    is_thin = (axial, transverse) == (thin, thin)
    return tables.ShellTable(
        radius=shell.radius,
        mass=shell.mass,
        inertia="thin" if is_thin else tables.ShellInertia(axial=axial, transverse=transverse),
        axis=_numbers(shell.axis),
        offset=shell.offset,
    )


def _numbers(values: Array) -> Any:
    """Return a tuple of numbers, whose length the records know."""
    return tuple(values.tolist())


def _hinge(hinge: Hinge) -> dict[str, Any]:
    """Return the keys of a hinge and of its body."""
    body, motor = hinge.body, hinge.motor
    if isinstance(body, Rotor):
        # Its moments, not its tensor, which would come back rounded.
        inertia: Any = tables.Axial(axial=body.axial_inertia, transverse=body.transverse_inertia)
    else:
        inertia = [_numbers(row) for row in body.inertia]
    of_motor = None if motor is None else type(motor).__name__
    named = (each for each in DRIVES.items() if each[1].motor == of_motor)
    name, kind = next(named, (None, None))
    if kind is None:
        raise InputError(f"a scene file cannot hold the motor {motor}")
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
        # A motor's field that is 0 or None has no effect, and is what the reader takes for no key.
        values = astuple(cast(Any, motor))  # each is a dataclass
        keys.update({k: v for k, v in zip(kind.keys, values, strict=True) if v})
    return keys


def _command(rate: Rate) -> Any:
    if isinstance(rate, Sum):
        return [_command(part) for part in rate.terms]
    if isinstance(rate, Ramp | Sine | Samples | float | int):
        return rate
    raise InputError("a rate given by a function of time cannot be written to a scene file")


def text_of(table: tables.SceneTable) -> str:
    """Return the text of a scene file's table."""
    return "\n".join(_lines(table)) + "\n"


def _lines(table: tables.Table) -> Iterator[str]:
    """Yield the lines of a table: its keys, then the tables in it, each below its name."""
    # A body's own keys before those of its hinge, which the records inherit.
    info = sorted(
        msgspec.structs.fields(table), key=lambda each: each.name in HingeTable.__struct_fields__
    )
    for field in info:
        name, value = field.name, getattr(table, field.name)
        if value is None or (value == field.default and name not in _ALWAYS):
            continue
        if name == "source":
            lines = "\n".join(map(_escaped, value.split("\n")))
            yield f'source = """\n{lines}"""'
        elif isinstance(table, tables.SceneTable) and isinstance(value, tables.Table):
            yield from ("", f"[{name}]", *_lines(value))
        elif isinstance(table, tables.SceneTable) and name in ("rotor", "pendulum"):
            for each in value:
                yield from ("", f"[[{name}]]", *_lines(each))
        else:
            yield f"{name} = {_value(value)}"


def _value(value: Any) -> str:
    """Return the text of a value, on one line but for a tensor's rows."""
    if isinstance(value, str):
        return f'"{_escaped(value)}"'
    if isinstance(value, msgspec.Struct):
        builtins = msgspec.to_builtins(value, enc_hook=float)  # msgspec knows no NumPy numbers
        keys = {k: v for k, v in builtins.items() if v is not None}
        return f"{{ {', '.join(f'{k} = {_value(v)}' for k, v in keys.items())} }}"
    if isinstance(value, tuple | list):
        texts = [_value(each) for each in value]
        # An inline table must stay on its line in TOML, a list need not.
        if isinstance(value[0], tuple | tables.Table):
            return "\n".join(["[", *(f"    {row}," for row in texts), "]"])
        return f"[{', '.join(texts)}]"
    return repr(float(value))


def _escaped(text: str) -> str:
    """Return a text with TOML's escapes, which are JSON's and one for DEL."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace("\x7f", "\\u007f")
