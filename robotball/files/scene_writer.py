"""Scene → TOML in full precision: `load_scene` reads the same scene back, to the last bit."""

from collections.abc import Iterator

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from robotball.bodies import Frame, Rotor, Shell, thin_shell_inertia
from robotball.drives import Ramp, Rate, Sine
from robotball.errors import InputError
from robotball.motors import Motor, Servo
from robotball.scene import GRAVITY, Scene

AT_REST = "M = 0; ω is not, where frame or rotors turn"


def scene_toml(scene: Scene) -> str:
    """The text of a scene file with the bodies, rates and start of `scene`; its name is the file's.

    Raises InputError for a rate given by a function of time, which no file can hold.
    """
    return "\n".join(_lines(scene)) + "\n"


def _lines(scene: Scene) -> Iterator[str]:
    ball = scene.ball
    hinges = scene.motors or (None,) * (1 + len(ball.rotors))
    yield f"title = {_string(scene.title)}"
    if scene.source:
        source = _escaped(scene.source, keep="\n")
        yield f'source = """\n{source}"""'
    yield f'rolling = "{scene.rolling}"'
    yield f"duration = {_number(scene.duration)}"
    if scene.gravity != GRAVITY:
        yield f"gravity = {_number(scene.gravity)}"
    yield from _shell(ball.shell)
    yield from _frame(ball.frame)
    yield from _hinge(scene.frame_rate, hinges[0])
    for rotor, rate, motor in zip(ball.rotors, scene.rotor_rates, hinges[1:], strict=True):
        yield from _rotor(rotor)
        yield from _hinge(rate, motor)
    yield from ("", "[start]", f"attitude = {_array(scene.start.attitude)}")
    momentum = f"momentum_world = {_array(scene.start.momentum)}"
    yield momentum if np.any(scene.start.momentum) else f"{momentum}  # {AT_REST}"


def _shell(shell: Shell) -> Iterator[str]:
    thin = thin_shell_inertia(shell.radius, shell.mass)
    moments = (shell.axial_inertia, shell.transverse_inertia)
    yield from ("", "[shell]", f"radius = {_number(shell.radius)}", f"mass = {_number(shell.mass)}")
    inertia = _string("thin") if moments == (thin, thin) else _moments(shell)
    yield f"inertia = {inertia}"
    yield f"axis = {_array(shell.axis)}"


def _frame(frame: Frame) -> Iterator[str]:
    rows = [f"    {_array(row)}," for row in frame.inertia]
    yield from ("", "[frame]", f"mass = {_number(frame.mass)}", "inertia = [", *rows, "]")
    yield from _centre(frame)


def _rotor(rotor: Rotor) -> Iterator[str]:
    yield from ("", "[[rotor]]", f"mass = {_number(rotor.mass)}", f"inertia = {_moments(rotor)}")
    yield f"axis = {_array(rotor.axis)}"
    yield from _centre(rotor)


def _moments(body: Shell | Rotor) -> str:
    axial, transverse = _number(body.axial_inertia), _number(body.transverse_inertia)
    return f"{{ axial = {axial}, transverse = {transverse} }}"


def _centre(body: Frame | Rotor) -> Iterator[str]:
    if np.any(body.centre):
        yield f"centre = {_array(body.centre)}"


def _hinge(rate: Rate, motor: Motor | None) -> Iterator[str]:
    yield f"rate = {_rate(rate)}"
    if motor is not None:
        if not isinstance(motor, Servo):
            raise InputError(f"a scene file holds velocity servos only, not {motor}")
        yield from ('drive = "servo"', f"kv = {_number(motor.gain)}")
        if motor.torque_limit is not None:
            yield f"torque_limit = {_number(motor.torque_limit)}"


def _rate(rate: Rate) -> str:
    if isinstance(rate, Ramp | Sine):
        fields = msgspec.to_builtins(rate)
        return f"{{ {', '.join(f'{key} = {_value(value)}' for key, value in fields.items())} }}"
    if isinstance(rate, float | int):
        return _number(rate)
    raise InputError("a rate given by a function of time cannot be written to a scene file")


def _value(value: str | float) -> str:
    return _string(value) if isinstance(value, str) else _number(value)


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
