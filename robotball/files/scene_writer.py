"""Scene → TOML in full precision: `load_scene` reads the same scene back, to the last bit."""

from collections.abc import Iterator

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from robotball.drives import (
    Free,
    Motor,
    PositionServo,
    Ramp,
    Rate,
    Samples,
    Servo,
    Sine,
    Sum,
    Torque,
)
from robotball.errors import InputError
from robotball.robot import Frame, Pendulum, Rotor, Shell, thin_shell_inertia
from robotball.rotations import Array
from robotball.scene import DOWN, GRAVITY, Friction, Scene

AT_REST = "M = 0; ω is not, where frame or rotors turn"


def scene_toml(scene: Scene) -> str:
    """The text of a scene file with the bodies, rates and start of `scene`; its name is the file's.

    Raises InputError for a rate given by a function of time, which no file can hold.
    """
    return "\n".join(_lines(scene)) + "\n"


def _lines(scene: Scene) -> Iterator[str]:
    ball = scene.ball
    hinges = list(_hinges(scene))
    yield f"title = {_string(scene.title)}"
    if scene.source:
        source = _escaped(scene.source, keep="\n")
        yield f'source = """\n{source}"""'
    yield f'rolling = "{scene.rolling}"'
    yield f"duration = {_number(scene.duration)}"
    if scene.gravity != GRAVITY:
        yield f"gravity = {_number(scene.gravity)}"
    if scene.gravity_direction != DOWN:
        yield f"gravity_direction = {_array(scene.gravity_direction)}"
    yield from _friction(scene.friction)
    yield from _shell(ball.shell)
    yield from (*_frame(ball.frame), *hinges.pop(0))
    for rotor in ball.rotors:
        yield from (*_rotor(rotor), *hinges.pop(0))
    for pendulum in ball.pendulums:
        yield from (*_pendulum(pendulum), *hinges.pop(0))
    yield from ("", "[start]", f"attitude = {_array(scene.start.attitude)}")
    momentum = f"momentum_world = {_array(scene.start.momentum)}"
    yield momentum if np.any(scene.start.momentum) else f"{momentum}  # {AT_REST}"


def _friction(friction: Friction) -> Iterator[str]:
    if friction != Friction():
        yield from ("", "[friction]")
        for name in ("sliding", "torsional", "rolling"):
            if value := getattr(friction, name):
                yield f"{name} = {_number(value)}"


def _shell(shell: Shell) -> Iterator[str]:
    thin = thin_shell_inertia(shell.radius, shell.mass)
    moments = (shell.axial_inertia, shell.transverse_inertia)
    yield from ("", "[shell]", f"radius = {_number(shell.radius)}", f"mass = {_number(shell.mass)}")
    inertia = _string("thin") if moments == (thin, thin) else _moments(shell)
    yield f"inertia = {inertia}"
    yield f"axis = {_array(shell.axis)}"
    if shell.offset:
        yield f"offset = {_number(shell.offset)}"


def _frame(frame: Frame) -> Iterator[str]:
    yield from ("", "[frame]", f"mass = {_number(frame.mass)}", *_tensor(frame.inertia))
    yield from _centre(frame)


def _pendulum(body: Pendulum) -> Iterator[str]:
    yield from ("", "[[pendulum]]", f"mass = {_number(body.mass)}", *_tensor(body.inertia))
    yield from _centre(body)
    yield from (f"axis = {_array(body.axis)}", f"pivot = {_array(body.pivot)}")


def _tensor(inertia: Array) -> list[str]:
    return ["inertia = [", *(f"    {_array(row)}," for row in inertia), "]"]


def _rotor(rotor: Rotor) -> Iterator[str]:
    yield from ("", "[[rotor]]", f"mass = {_number(rotor.mass)}", f"inertia = {_moments(rotor)}")
    yield f"axis = {_array(rotor.axis)}"
    yield from _centre(rotor)


def _moments(body: Shell | Rotor) -> str:
    axial, transverse = _number(body.axial_inertia), _number(body.transverse_inertia)
    return f"{{ axial = {axial}, transverse = {transverse} }}"


def _centre(body: Frame | Rotor | Pendulum) -> Iterator[str]:
    if np.any(body.centre):
        yield f"centre = {_array(body.centre)}"


def _hinges(scene: Scene) -> Iterator[list[str]]:
    """The lines of each hinge."""
    commands = (scene.frame_rate, *scene.rotor_rates, *scene.pendulum_rates)
    motors, angles = scene.motors or (None,) * len(commands), scene.start.hinge_angles
    rates = scene.start.hinge_rates
    for i, (command, motor) in enumerate(zip(commands, motors, strict=True)):
        lines = list(_moved(command, motor))
        if angles is not None and angles[i]:
            lines.append(f"initial_angle = {_number(angles[i])}")
        if rates is not None and motor is not None:
            lines.append(f"initial_rate = {_number(rates[i])}")
        yield lines


def _moved(command: Rate, motor: Motor | None) -> Iterator[str]:
    match motor:
        case None:
            yield f"rate = {_rate(command)}"
        case Servo(gain, limit, armature):
            yield from (f"rate = {_rate(command)}", 'drive = "servo"', f"kv = {_number(gain)}")
            yield from _nonzero(torque_limit=limit, armature=armature)
        case PositionServo(gain, damping, limit, armature):
            yield from (f"angle = {_rate(command)}", 'drive = "position"', f"kp = {_number(gain)}")
            yield from _nonzero(kd=damping, torque_limit=limit, armature=armature)
        case Torque(armature):
            yield from (f"torque = {_rate(command)}", 'drive = "torque"')
            yield from _nonzero(armature=armature)
        case Free(damping, stiffness, rest, armature):
            yield 'drive = "free"'
            yield from _nonzero(damping=damping, stiffness=stiffness, rest=rest, armature=armature)
        case _:
            raise InputError(f"a scene file cannot hold the motor {motor}")


def _nonzero(**numbers: float | None) -> Iterator[str]:
    for key, value in numbers.items():
        if value:
            yield f"{key} = {_number(value)}"


def _rate(rate: Rate) -> str:
    if isinstance(rate, Sum):
        return f"[{', '.join(map(_rate, rate.parts))}]"
    if isinstance(rate, Ramp | Sine | Samples):
        fields = msgspec.to_builtins(rate)
        return f"{{ {', '.join(f'{key} = {_value(value)}' for key, value in fields.items())} }}"
    if isinstance(rate, float | int):
        return _number(rate)
    raise InputError("a rate given by a function of time cannot be written to a scene file")


def _value(value: str | float | tuple[float, ...]) -> str:
    if isinstance(value, str):
        return _string(value)
    return _array(value) if isinstance(value, tuple | list) else _number(value)


def _array(values: ArrayLike) -> str:
    return f"[{', '.join(map(_number, np.asarray(values).tolist()))}]"


def _number(value: float) -> str:
    return repr(float(value))


def _string(text: str) -> str:
    return f'"{_escaped(text)}"'


def _escaped(text: str, keep: str = "") -> str:
    """TOML's escapes for quotes, backslashes and control characters other than `keep`."""

    def escaped(character: str) -> str:
        if character in '"\\':
            return "\\" + character
        control = ord(character) < 0x20 or ord(character) == 0x7F
        return f"\\u{ord(character):04x}" if control and character not in keep else character

    return "".join(map(escaped, text))
