"""What a steered robot cannot do: torques, rates and friction beyond what there is."""

import math

import numpy as np

from robotball.motion import Motion
from robotball.scene import Scene


def shortfalls(robot: Scene, motion: Motion, rate_limit: float = math.inf) -> list[str]:
    """A line for each thing that the motion needs and the robot or the plane has not.

    robot: the scene with its motors and its friction; motion: of the steered scene; rate_limit: the
    fastest that a hinge may turn [rad/s].
    """
    lines, loads = [], motion.loads
    for i, hinge in enumerate(robot.hinges):
        torque = float(np.abs(loads.motor_torques[:, i]).max())
        limit = hinge.motor.law.limit if hinge.motor else math.inf
        if torque > limit:
            lines.append(f"{hinge.name} needs {torque:.3g} N m, and its motor gives {limit:g} N m")
        rate = float(np.abs(motion.hinge_rates[:, i]).max())
        if rate > rate_limit:
            lines.append(f"{hinge.name} turns at {rate:.3g} rad/s, of at most {rate_limit:g}")
    friction = robot.friction
    sliding = float(loads.sliding_friction.max())
    if friction.sliding is not None and sliding > friction.sliding:
        lines.append(f"it slips: it needs a friction of {sliding:.3g}, of {friction.sliding:g}")
    torsional = float(loads.torsional_friction.max())
    if friction.torsional is not None and torsional > friction.torsional:
        lines.append(
            f"it spins: it needs a torsional friction of {torsional:.3g} m, of "
            f"{friction.torsional:g} m"
        )
    return lines
