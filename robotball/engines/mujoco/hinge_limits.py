"""Limits of the hinges: how much of its rate a servo or an armature loses under its load."""

import numpy as np

from robotball.engines.mujoco.planned_run import Laws, LimitCheck, PlannedRun
from robotball.engines.mujoco.settings import Prescribed
from robotball.motors import Servo

MAGNIFIED = 10.0  # times a relative error of a rate: what it may well make of the path, relative


def servo_droop(plan: PlannedRun) -> LimitCheck | None:
    """A velocity servo gives torque only for an error of its rate: τ/kv, relative to the rate.

    Measured 0.75 to 0.99 of that, where it is small.
    """
    servos = [(h, h.actuation) for h in plan.hinges if isinstance(h.actuation, Servo)]
    if not servos:
        return None
    worst = 0.0
    for hinge, servo in servos:
        torque = float(np.abs(plan.loads.motor_torques[:, hinge.index]).max())
        if not hinge.own_motor and hinge.of.rate:  # else its error belongs to the motion
            worst = max(worst, torque / servo.gain / abs(hinge.of.rate))
    return LimitCheck(
        "the share of its rate that a servo loses under its load",
        worst,
        plan.settings.error_tolerance,
        "take a higher gain, or prescribe the rate",
    )


def prescribed_rate(plan: PlannedRun) -> LimitCheck | None:
    """A hinge kept by its armature gives way to its load all the same: by ∫τ dt/armature.

    Measured to three digits on six scenes with masses of 1e5 and 1e6 times their own. The path is
    off by 0.1 to 40 times as much, relative. Where only the start's loads are known, they are taken
    to act for a radian of the fastest rotation.
    """
    torques, worst = plan.loads.motor_torques, 0.0
    if plan.known_loads is not None:
        impulses = np.abs(np.cumsum(torques, axis=0)).max(axis=0) * plan.duration / len(torques)
    else:
        rate = plan.rotation_rate
        impulses = np.abs(torques[0]) * (min(plan.duration, 1 / rate) if rate else plan.duration)
    for hinge in plan.hinges:
        if isinstance(hinge.actuation, Prescribed):
            lost = float(impulses[hinge.index]) / hinge.actuation.armature / hinge.largest_rate
            worst = max(worst, lost)
    return LimitCheck(
        "the share of its rate that a prescribed hinge loses under its load",
        worst,
        plan.settings.error_tolerance / MAGNIFIED,
        "the hinges' armature is too small for such heavy bodies; take a larger one",
    )


# Each prediction with its law, as a legend tells it.
LAWS: Laws = {
    prescribed_rate: "a prescribed hinge gives way by ∫τ dt over its armature",
    servo_droop: "a velocity servo loses τ/kv of its rate",
}
