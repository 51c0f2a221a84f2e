"""Which hinges a model needs, and how each is driven."""

from dataclasses import dataclass

import numpy as np

from robotball import hinges
from robotball.drives import Drive, turns
from robotball.engines.mujoco.settings import Prescribed, Settings
from robotball.motors import Free, Motor, PositionServo, Servo
from robotball.scene import Scene

RATES_SEEN = 501  # times over a scene at which the largest rate of a hinge is looked for


@dataclass(frozen=True)
class Hinge:
    """A hinge of the model.

    index         its place among the scene's hinges
    joint         the MJCF name of its joint and of the body that hangs on it
    of            the scene's own words for it
    actuation     a motor, or the armature that lets its rate be prescribed
    largest_rate  of the drive during the scene, by which errors are measured [rad/s]
    """

    index: int
    joint: str
    of: hinges.Hinge
    actuation: Motor | Prescribed
    largest_rate: float

    @property
    def body(self) -> str:
        return self.of.name

    @property
    def drive(self) -> Drive:
        return self.of.command

    @property
    def own_motor(self) -> bool:
        """Whether the motor is the scene's own, whose errors belong to the motion."""
        return self.of.motor is not None

    @property
    def actuated(self) -> bool:
        """Whether an actuator of the model turns it; a free hinge has none."""
        return not isinstance(self.actuation, Free)

    @property
    def torque_limit(self) -> float | None:
        """Of its servo, if it has one [N m]."""
        if isinstance(self.actuation, Servo | PositionServo):
            return self.actuation.torque_limit
        return None

    @property
    def follows_rate(self) -> bool:
        """Whether its command is a rate."""
        return isinstance(self.actuation, Servo | Prescribed)

    def control(self, t: float) -> float:
        """Its actuator's control at t [s]: the command or, of a prescribed rate, the slope."""
        prescribed = isinstance(self.actuation, Prescribed)
        return float((self.drive.acceleration if prescribed else self.drive.rate)(t))


def hinges_of(scene: Scene, settings: Settings) -> tuple[Hinge, ...]:
    """The hinges that turn or stand at an angle; any other body is fixed to its parent."""
    times = np.linspace(0.0, scene.duration, RATES_SEEN)
    hung = "frame" if settings.root == "shell" else "shell"
    return tuple(
        Hinge(
            index,
            each.name if index else hung,
            each,
            actuation=each.motor or settings.drive,
            largest_rate=float(np.abs(each.command.rate(times)).max()) or 1.0,
        )
        for index, each in enumerate(scene.hinges)
        if each.motor or turns(each.command) or each.angle
    )
