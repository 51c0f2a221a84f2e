"""A scene as plain data, with the numbers that an engine's model is made of."""

from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np

from robotball.drives import Constant, Drive, Total
from robotball.hinges import Hinge
from robotball.mechanics.poses import poses
from robotball.motion import Motion
from robotball.motors import Free, PositionServo, Servo
from robotball.rates import Ramp, Samples, Sine
from robotball.rotations import Array

FORMAT = "robotball scene 1"
SHAPES = {"linear": "u", "smooth": "3u² - 2u³", "quintic": "10u³ - 15u⁴ + 6u⁵"}
COMMANDED = {Servo: "rad/s", PositionServo: "rad", Free: "none"}


def plain(motion: Motion) -> dict[str, Any]:
    """The scene of a reference motion, as JSON takes it; SI units, quaternions (w, x, y, z).

    The bodies' states are those of the start, in world axes; friction is what the whole motion
    needs.
    """
    scene, ball = motion.scene, motion.scene.ball
    moments, axes = ball.principal
    return {
        "format": FORMAT,
        "name": scene.name,
        "title": scene.title,
        "rolling": scene.rolling,
        "duration": float(motion.times[-1]),
        "sample_times": {"count": len(motion.times), "file": "reference.csv", "column": "t"},
        "gravity": (scene.gravity * np.array(scene.gravity_direction)).tolist(),
        "ball": {
            "radius": ball.radius,
            "mass": ball.mass,
            "centre_of_mass": ball.centre_of_mass.tolist(),
            "inertia_about_centre": ball.inertia.tolist(),
            "principal_moments": moments.tolist(),
            "principal_axes": axes.tolist(),
        },
        "bodies": _bodies(motion),
        "start": {
            "attitude": motion.attitude[0].tolist(),
            "angular_velocity": motion.angular_velocity[0].tolist(),
            "momentum_world": motion.momentum[0].tolist(),
            "centre": [*motion.contact_point[0].tolist(), ball.radius],
        },
        "friction_needed": friction_needed(motion),
        "friction": asdict(scene.friction),
    }


def friction_needed(motion: Motion) -> dict[str, Any]:
    """The least coefficients without which the ball slips or, a rubber one, spins."""
    sliding = float(motion.loads.sliding_friction.max())
    torsional = float(motion.loads.torsional_friction.max())
    return {
        "sliding": sliding,
        "torsional": torsional if motion.scene.rolling == "rubber" else 0.0,
        "torsional_unit": "m",
        "least_normal_force": float(motion.loads.normal_force.min()),
    }


def _bodies(motion: Motion) -> list[dict[str, Any]]:
    scene = motion.scene
    hinges = {hinge.name: hinge for hinge in scene.hinges}
    placed = poses(motion)
    return [
        {
            "name": name,
            "mass": body.mass,
            "centre_of_mass": body.centre.tolist(),
            "inertia": body.inertia.tolist(),
            "inertia_about_centre": _about_centre(body.mass, body.centre, body.inertia).tolist(),
            "hinge": _hinge(hinges[name]) if name in hinges else None,
            "start": {
                "position": placed[name].position[0].tolist(),
                "attitude": placed[name].attitude[0].tolist(),
                "velocity": placed[name].velocity[0].tolist(),
                "angular_velocity": placed[name].angular_velocity[0].tolist(),
            },
        }
        for name, body in scene.ball.named_bodies
    ]


def _about_centre(mass: float, centre: Array, inertia: Array) -> Array:
    """By Steiner's theorem."""
    return inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def _hinge(hinge: Hinge) -> dict[str, Any]:
    motor = hinge.motor
    unit = "rad/s" if motor is None else COMMANDED.get(type(motor), "N m")
    return {
        "parent": "shell" if hinge.name == "frame" else "frame",
        "axis": hinge.axis.tolist(),
        "pivot": hinge.pivot.tolist(),
        "angle": hinge.angle,
        "rate": hinge.rate,
        "motor": None if motor is None else _motor(motor),
        "command": {"unit": unit, **formula(hinge.command), "breakpoints": _times(hinge.command)},
    }


def _motor(motor: Any) -> dict[str, Any]:
    """Its kind and numbers; what it does with its command is in docs/scene.md."""
    return {"kind": type(motor).__name__, **asdict(motor)}


def _times(command: Drive) -> list[float]:
    return [float(t) for t in command.breakpoints]


def formula(command: Drive) -> dict[str, Any]:
    """A command by its formula, in plain data; one that has none is told by drives.csv alone."""
    if isinstance(command, Constant):
        value = float(command.value)
        return {"kind": "constant", "value": value, "formula": repr(value)}
    if isinstance(command, Ramp):
        first, last, start, end = map(
            float, (command.initial, command.final, command.start, command.end)
        )
        u = f"u = clip((t - {start})/({end} - {start}), 0, 1)"
        text = f"{first} + ({last} - {first})*({SHAPES[command.shape]}), {u}"
        return {**msgspec.to_builtins(command), "formula": text}
    if isinstance(command, Sine):
        swing, often, phase, mean = map(
            float, (command.amplitude, command.frequency, command.phase, command.mean)
        )
        text = f"{mean} + {swing}*sin(2*pi*{often}*t + {phase})"
        return {**msgspec.to_builtins(command), "formula": text}
    if isinstance(command, Samples):
        return {**msgspec.to_builtins(command), "formula": "see drives.csv"}
    if isinstance(command, Total):
        parts = [formula(part) for part in command.drives]
        return {"kind": "sum", "parts": parts, "formula": "the sum of the parts"}
    return {"kind": "function", "formula": "see drives.csv"}
