"""Numbers of a robot file that the simulation and the reference share, but are rarely meant."""

from collections.abc import Iterator

import numpy as np

from robotball import Scene
from robotball.engines.mujoco.user_model import UserModel
from robotball.robot.drives import as_drive
from robotball.robot.scene import DOWN, GRAVITY

_GRAVITY = 0.02  # relative difference from the Earth: a smaller one is usual
_ROLLING_FRICTION = 0.1  # of the radius: less is usual
_SMALL_GEAR = 0.01  # larger ones are usual


def unusual_numbers(user: UserModel, scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield each unusual setting, and its number beside the usual one.

    Settings that affect the whole robot come first.
    """
    if abs(scene.gravity / GRAVITY - 1) > _GRAVITY:
        yield "gravity", f"{scene.gravity:g} m/s²; the Earth has {GRAVITY:g} m/s²"
    level = np.allclose(user.robot.plane_axes(user.begin()), np.eye(3))
    if level and scene.gravity_direction != DOWN:
        tilt = np.degrees(np.arccos(-scene.gravity_direction[2]))
        yield "gravity", f"tilted by {tilt:.3g} deg, above a level plane"
    rolling, radius = scene.friction.rolling, scene.ball.radius
    if rolling > _ROLLING_FRICTION * radius:
        words = f"declared rolling friction is {rolling:g} m, {rolling / radius:.0%} of the radius"
        yield "resistance", words
    yield from _unusual_gears(scene)


def _unusual_gears(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield tiny gears, and gears with a lasting torque that no weight inside can balance."""
    inside = {link.name: link for link in scene.ball.tree[1:]}
    levers = sum(link.mass * float(np.linalg.norm(link.centre)) for link in inside.values())
    times = np.linspace(0.0, scene.duration, 101)
    for actuator in scene.actuators:
        law, command = actuator.law, as_drive(actuator.command, scene.duration)
        # The torque of a servo falls with its error; the torque of a motor lasts.
        lasts = not (law.per_angle or law.per_rate)
        torque = float(np.abs(law.torque(command.rate(times), 0.0, 0.0)).max())
        for name, gear in actuator.gears:
            slides = inside[name].slides
            load, unit = torque * abs(gear), "N" if slides else "N m"
            weight = scene.gravity * (inside[name].mass if slides else levers)
            if lasts and load > weight > 0:
                words = f"exerts {load:.3g} {unit} on {name} with a gear of {gear:g}; the weights "
                words += f"exert at most {weight:.3g} {unit}"
                yield "gear", f"{actuator.name} {words}"
            elif 0 < abs(gear) <= _SMALL_GEAR:
                yield "gear", f"{actuator.name} moves {name} with a gear of only {gear:g}"
