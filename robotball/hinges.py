"""The hinges of a scene: where they are, what is commanded, how each is moved."""

from dataclasses import dataclass, replace

import numpy as np

from robotball.bodies import Ball
from robotball.drives import Drive
from robotball.errors import InputError, check_size
from robotball.motors import Motor, Servo
from robotball.rotations import Array
from robotball.start import Start


@dataclass(frozen=True)
class Hinge:
    """One hinge of a scene, seen from the frame.

    name    of the body that turns: frame, rotor1, …, pendulum1, …
    axis    (3,) unit vector, frame axes
    pivot   (3,) m, a point of the axis from the sphere's centre
    command what the motor is told, a function of time: `rate(t)` is its value, whatever its unit
    motor   None: the hinge keeps the commanded rate exactly
    angle   rad at the start
    rate    rad/s at the start
    """

    name: str
    axis: Array
    pivot: Array
    command: Drive
    motor: Motor | None
    angle: float
    rate: float


def hinges_of(
    ball: Ball, drives: tuple[Drive, ...], motors: tuple[Motor | None, ...], start: Start
) -> tuple[Hinge, ...]:
    """A ball's hinges, the frame's, then the rotors', then the pendulums'; no motors are none."""
    angles, rates = start.hinge_angles, start.hinge_rates
    named = [("frame", ball.shell.axis, np.zeros(3))]
    named += [(name, body.axis, body.centre) for name, body in ball.named_rotors]
    named += [(name, body.axis, body.pivot) for name, body in ball.named_pendulums]
    hinges = []
    for i, (name, axis, pivot) in enumerate(named):
        command, motor = drives[i], motors[i] if motors else None
        follows = motor is None or isinstance(motor, Servo)
        rate = float(command.rate(0.0)) if follows else 0.0
        if rates is not None and motor is not None:
            rate = float(rates[i])
        angle = 0.0 if angles is None else float(angles[i])
        hinges.append(Hinge(name, axis, pivot, command, motor, angle, rate))
    return tuple(hinges)


def with_hinges_checked(
    start: Start, drives: tuple[Drive, ...], motors: tuple[Motor | None, ...]
) -> Start:
    """The start with angles None where all are 0, and of rates kept exactly those commanded.

    Raises InputError for angles or rates that are not one for each hinge, or not finite.
    """
    angles, rates = start.hinge_angles, start.hinge_rates
    for name, values, unit in (("angles", angles, "rad"), ("rates", rates, "rad/s")):
        if values is None:
            continue
        if values.shape != (len(drives),):
            raise InputError(
                f"{len(drives)} hinges need as many {name} at the start, not an array of shape "
                f"{values.shape}"
            )
        for value in values.tolist():
            check_size(f"a hinge's {name[:-1]} at the start", value, unit)
    if rates is not None:
        kept = [motor is None for motor in motors or (None,) * len(drives)]
        commanded = [float(drive.rate(0.0)) for drive in drives]
        rates = np.where(kept, commanded, rates)
    if angles is not None and not angles.any():
        angles = None
    return replace(start, hinge_angles=angles, hinge_rates=rates)
