"""Three controllers of a robot ball, each with its scene.

    robotball compare steered_pendulum_robot --controller examples/controllers.py:stop
    python examples/controllers.py

The second line runs each loop with the equations and with MuJoCo at two presets.
"""

from dataclasses import dataclass, replace

import numpy as np

import robotball as rb
from robotball.robot.formulas import space_axes

# Roll to a point and stop: one motor rolls, the other leans the weight to steer.


@dataclass(frozen=True)
class Stop:
    """Roll towards a point as fast as it is far, and lean towards it.

    The gains are for the rate of the axle 1/(m s), for the lean rad/m, and for the lean against a
    swing from side to side s.
    """

    point: tuple[float, float] = (2.0, 0.0)
    roll: float = 5.0
    lean: float = 8.0
    damping: float = 0.3

    def __call__(self, reading: rb.Reading) -> dict[str, float]:
        axle = np.array(space_axes(reading.attitude))[:2, 1]
        axle /= np.linalg.norm(axle)  # it points to the left, seen along the way
        way = np.array(self.point) - reading.contact_point
        ahead, left = way @ [axle[1], -axle[0]], way @ axle
        lean = np.clip(self.lean * left * np.sign(ahead), -0.45, 0.45)
        lean = np.clip(lean + self.damping * reading.gyro[0], -0.6, 0.6)
        return {"frame": -np.clip(self.roll * ahead, -4.0, 4.0), "pendulum1": lean}


stop = rb.Controller(Stop(), period=0.01, sensors=rb.Sensors(contact_point=True))


# Follow a figure of eight. The momentum stays zero, so three rotors turn the ball about any axis.


def rotor_robot() -> rb.Scene:
    """Return the ball of `three_rotors` at rest, with a motor on each hinge."""
    gains = {"frame": 20.0, "rotor1": 2.0, "rotor2": 2.0, "rotor3": 2.0}
    scene = rb.load_scene("three_rotors").with_hinges(
        motor={name: rb.Servo(gain) for name, gain in gains.items()},
        command=dict.fromkeys(gains, 0.0),
        rate=dict.fromkeys(gains, 0.0),
    )
    return replace(scene, name="rotor_robot", start=rb.Start((1, 0, 0, 0), (0, 0, 0)))


class Eight:
    """Follow a figure of eight from rest to rest: the wanted velocity, and more towards the point.

    The velocity asks for an angular velocity of the ball, and M = 0 for the rotors' rates.
    """

    def __init__(self, ball: rb.Ball, size: float = 2.0, duration: float = 10.0, gain: float = 2.0):
        self.ball, self.size, self.duration, self.gain = ball, size, duration, gain
        self.inertia = ball.inertia + ball.d * np.eye(3)

    def wanted(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the point (2,) [m] and its velocity (2,) [m/s] at t [s]."""
        part = min(t / self.duration, 1.0)
        turn = 2 * np.pi * part**3 * (10 + part * (6 * part - 15))
        speed = 2 * np.pi * 30 * (part * (1 - part)) ** 2 / self.duration
        point = self.size * np.array([np.sin(turn), np.sin(2 * turn) / 2])
        return point, self.size * speed * np.array([np.cos(turn), np.cos(2 * turn)])

    def __call__(self, reading: rb.Reading) -> dict[str, float]:
        point, velocity = self.wanted(reading.time)
        x, y = velocity + self.gain * (point - reading.contact_point)
        turning = np.array([-y, x, 0.0]) / self.ball.radius
        momentum = self.inertia @ (turning @ space_axes(reading.attitude))
        rates = [-momentum @ rotor.axis / rotor.axial_inertia for rotor in self.ball.rotors]
        return {"frame": 0.0, **{f"rotor{i}": rate for i, rate in enumerate(rates, start=1)}}


eight = rb.Controller(
    Eight(rotor_robot().ball), period=0.01, sensors=rb.Sensors(contact_point=True)
)


# Damp the swing: the weight leans as the gyro says that the frame swings.


@dataclass(frozen=True)
class Damp:
    """Lean the weight by a gain [s] times the rate of the swing from side to side."""

    gain: float = 0.1

    def __call__(self, reading: rb.Reading) -> dict[str, float]:
        return {"frame": 0.0, "pendulum1": self.gain * reading.gyro[0]}


damp = rb.Controller(Damp(), period=0.01)


def tilted_robot() -> rb.Scene:
    """Return the robot of `steered_pendulum_robot`, tilted at the start."""
    scene = rb.load_scene("steered_pendulum_robot")
    attitude = np.array([1.0, 0.1, 0.2, 0.0])
    start = rb.Start(attitude / np.linalg.norm(attitude), (0, 0, 0))
    return replace(scene, name="tilted_robot", start=start)


# The three loops, and the distance of each from its target.

LOOPS = {
    "stop": rb.load_scene("steered_pendulum_robot").with_controller(stop),
    "eight": rotor_robot().with_controller(eight),
    "damp": tilted_robot().with_controller(damp),
}


def missed(motion: rb.Motion) -> float:
    """Return how far a loop of LOOPS is off: from its point [m], its figure [m], rest [rad/s]."""
    controller = motion.scene.controller
    assert controller is not None
    task, point = controller.function, motion.contact_point
    if isinstance(task, Stop):
        return float(np.linalg.norm(point[-1] - task.point))
    if isinstance(task, Eight):
        wanted = np.array([task.wanted(t)[0] for t in motion.times.tolist()])
        return float(np.linalg.norm(point - wanted, axis=1).max())
    late = motion.times > motion.times[-1] - 1.0
    return float(np.abs(motion.angular_velocity[late, 0]).max())


def main() -> None:
    """Print the distance of each loop from its target, and of MuJoCo from the equations."""
    for name, scene in LOOPS.items():
        theory, unit = rb.integrate(scene), "rad/s" if name == "damp" else "m"
        print(f"{name}: missed by {missed(theory):.2g} {unit} by the equations")
        for settings in ("accurate", "naive"):
            agreement = rb.compare(scene, settings=settings, theory=theory)
            missing, off = missed(agreement.motion), agreement.path_error
            print(f"  {missing:.2g} {unit} by {settings}, off by {off:.1e} of the path")
        print(f"  a start turned by a small δ rad is off by {agreement.loop_growth:.2g} δ")


if __name__ == "__main__":
    main()
