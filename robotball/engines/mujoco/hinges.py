"""Which hinges a model needs, and how each is driven."""

from dataclasses import dataclass

import numpy as np

from robotball.drives import Drive, turns
from robotball.engines.mujoco.settings import Prescribed, Settings
from robotball.errors import InputError
from robotball.motors import Motor, Servo
from robotball.scene import Scene

RATES_SEEN = 501  # times over a scene at which the largest rate of a hinge is looked for


@dataclass(frozen=True)
class Hinge:
    """A hinge of the model.

    index         its place among the scene's drives: 0 the frame's, then the rotors'
    joint         the MJCF name of its joint and of the body that hangs on it
    actuation     a servo, or the armature that lets its rate be prescribed
    own_motor     whether the servo is the scene's own, whose error belongs to the motion
    largest_rate  of the drive during the scene, by which errors are measured [rad/s]
    """

    index: int
    joint: str
    drive: Drive
    actuation: Servo | Prescribed
    own_motor: bool
    largest_rate: float

    @property
    def body(self) -> str:
        return f"rotor{self.index}" if self.index else "frame"

    def control(self, t: float) -> float:
        """Its actuator's control at t [s]: of a servo the rate, of a motor the acceleration."""
        of = self.drive.rate if isinstance(self.actuation, Servo) else self.drive.acceleration
        return float(of(t))


def hinges_of(scene: Scene, settings: Settings) -> tuple[Hinge, ...]:
    """The hinges that turn; any other body is fixed to its parent."""
    times = np.linspace(0.0, scene.duration, RATES_SEEN)
    hung = "frame" if settings.root == "shell" else "shell"
    motors = scene.motors or (None,) * len(scene.drives)
    return tuple(
        Hinge(
            index,
            f"rotor{index}" if index else hung,
            drive,
            actuation=_own(motor) or settings.drive,
            own_motor=motor is not None,
            largest_rate=float(np.abs(drive.rate(times)).max()) or 1.0,
        )
        for index, (drive, motor) in enumerate(zip(scene.drives, motors, strict=True))
        if motor or turns(drive)
    )


def _own(motor: Motor | None) -> Servo | None:
    if motor is not None and not isinstance(motor, Servo):
        raise InputError(f"the model has velocity servos only, not {motor}")
    return motor
