"""Logs with one circumstance that is not what the fit takes it for, such as a clock that is late."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.files.scene_numbers import numbers_of
from robotball.motion import Motion
from robotball.residuals import held
from robotball.rotations import conjugate, multiply, rotation_matrix, turned
from validation.commands.fitting import lines

Change = Callable[[np.ndarray], np.ndarray]
NOISE = {
    "position": 1e-3, "attitude": 1e-2, "gyro": 2e-2, "accelerometer": 0.1, "frame_angle": 5e-3,
    "frame_torque": 5e-3, "pendulum1_angle": 5e-3,
}  # fmt: skip
TIMES = rb.sample_times(3.0, 1 / 25)


@cache
def driven(robot: str, delay: float) -> Motion:
    """The motion of a robot with the commands of its scene, sampled, and so late."""
    scene = rb.load_scene(robot)
    commands = {name: held(t + delay, v) for name, (t, v) in commands_of(scene).items()}
    return rb.integrate(scene.with_hinges(command=commands), TIMES, 1e-12)


def commands_of(scene: rb.Scene) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The commands of a scene's motors as a log has them, each rounded and held for 0.1 s."""
    times = np.arange(0.0, TIMES[-1], 0.1)
    return {
        hinge.name: (times, np.round(hinge.command.rate(times), 2))
        for hinge in scene.hinges
        if hinge.name == "frame"
    }


def read(motion: Motion, name: str) -> np.ndarray:
    """The readings of a sensor without noise; those of an accelerometer by second differences."""
    hinges = [hinge.name for hinge in motion.scene.hinges]
    if name in ("position", "attitude", "gyro"):
        values = (motion.contact_point, motion.attitude, motion.angular_velocity)
        return values[["position", "attitude", "gyro"].index(name)]
    of, _, kind = name.rpartition("_")
    i = hinges.index(of)
    of_kind = {"angle": motion.hinge_angles, "torque": motion.loads.motor_torques}
    return of_kind[kind][:, i : i + 1]


@dataclass(frozen=True)
class Planted:
    """A log with one circumstance, and what a line may call it."""

    names: tuple[str, ...]
    robot: str = "pendulum_robot"
    sensors: tuple[str, ...] = ("position", "gyro")
    free: tuple[str, ...] = ("frame.kv",)
    late: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, Change] = field(default_factory=dict)
    delay: float | None = None

    def log(self, seed: int) -> rb.Log:
        """The log, with noise."""
        scene, rng = rb.load_scene(self.robot), np.random.default_rng(seed)
        motion = (
            rb.integrate(scene, TIMES, 1e-12)
            if self.delay is None
            else driven(self.robot, self.delay)
        )
        sensors = []
        for name in self.sensors:
            values = self.change.get(name, lambda v: v)(read(motion, name))
            noise = rng.normal(0.0, NOISE[name], (len(TIMES), min(3, values.shape[1])))
            values = turned(values, noise) if name == "attitude" else values + noise
            late = self.late.get(name, self.late.get("all", 0.0))
            sensors.append(rb.Sensor(name, TIMES + late, values))
        commands = {} if self.delay is None else commands_of(scene)
        return rb.Log("run.csv", tuple(sensors), commands)


MY, STEERED = "examples/my_robot.toml", "steered_pendulum_robot"
ALL = ("position", "attitude", "gyro")
CLOCK = ("sensors.clock",)


def yaw(angle: float) -> tuple[Change, Change]:
    """What a yaw of the world makes of positions, and of attitudes."""
    q = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
    return (
        lambda v: v @ rotation_matrix(q)[:2, :2].T,
        lambda v: multiply(np.broadcast_to(q, v.shape), v),
    )


TURNED, TURNED_ATTITUDE = yaw(np.radians(2.0))
PLANTED: Mapping[str, Planted] = {
    "a clock 10 ms late": Planted(CLOCK, late={"all": 0.01}),
    "a clock 10 ms late, another robot": Planted(CLOCK, MY, late={"all": 0.01}),
    "a clock 20 ms late, with attitudes": Planted(CLOCK, STEERED, ALL, late={"all": 0.02}),
    "a capture 10 ms late": Planted(("position.clock",), late={"position": 0.01}),
    "a gyro 20 ms late": Planted(("gyro.clock",), MY, late={"gyro": 0.02}),
    "commands 20 ms late": Planted(("commands.delay",), delay=0.02),
    "commands 10 ms late, another robot": Planted(("commands.delay",), MY, delay=0.01),
    "a capture turned by 2°": Planted(
        ("world.yaw",), sensors=ALL, change={"position": TURNED, "attitude": TURNED_ATTITUDE}
    ),
    "a capture turned by 2° beside an attitude": Planted(
        ("world.yaw",), sensors=ALL, change={"position": TURNED}
    ),
    "an origin 1 mm off": Planted(("world.origin",), change={"position": lambda v: v + 1e-3}),
    "an origin 10 cm off": Planted(("world.origin",), MY, change={"position": lambda v: v + 0.1}),
    "a gyro's bias along the axle": Planted(
        ("gyro.bias",), change={"gyro": lambda v: v + [0.0, 0.02, 0.0]}
    ),
    "a gyro's bias across the axle": Planted(
        ("gyro.bias",), MY, ("gyro",), ("frame.kv", "frame.part.2.mass"),
        change={"gyro": lambda v: v + [0.02, 0.0, 0.0]},
    ),
    "an encoder's zero": Planted(
        ("frame_angle.zero",), MY, ("position", "frame_angle"), change={"frame_angle": lambda v: v + 0.02}
    ),
    "the zero of a pendulum's encoder": Planted(
        ("pendulum1_angle.zero",), STEERED, ("position", "pendulum1_angle"), ("pendulum1.kp",),
        change={"pendulum1_angle": lambda v: v + 0.02},
    ),
    "a gyro's sign": Planted(("gyro.scale",), change={"gyro": np.negative}),
    "the sign of a gyro alone": Planted(
        ("gyro.scale",), sensors=("gyro",), free=("frame.rate.final",), change={"gyro": np.negative}
    ),
    "a torque's sign": Planted(
        ("frame_torque.scale",), sensors=("position", "frame_torque"), free=("frame.part.battery.mass",), change={"frame_torque": np.negative}
    ),
    "a torque before the gear's loss": Planted(
        ("frame_torque.scale",), sensors=("frame_torque",), free=("frame.part.battery.mass",),
        change={"frame_torque": lambda v: v / 0.9},
    ),
    "positions 1 % long": Planted(("position.scale",), change={"position": lambda v: 1.01 * v}),
    "positions in mm": Planted(("position.scale",), change={"position": lambda v: 1e3 * v}),
    "a marker 5 mm beside the axle": Planted(("position.marker",), sensors=ALL),
}  # fmt: skip
