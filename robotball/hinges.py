"""The hinges of a scene: where they are, what is commanded, how each is moved."""

from dataclasses import dataclass

from robotball.drives import Drive
from robotball.motors import Motor
from robotball.rotations import Array


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
