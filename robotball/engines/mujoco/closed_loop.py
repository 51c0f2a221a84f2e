"""The loop of a scene's controller in a run of MuJoCo."""

from collections.abc import Callable

import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model
from robotball.robot import formulas as eq
from robotball.robot.loop import TrueReading


def sensor_reader(model: Model) -> Callable[[mujoco.MjData], TrueReading]:
    """Return a function that reads a robot's sensors in a state, without computing the forces."""
    compiled, columns, count = model.compiled, model.sensor_columns, len(model.scene.hinges)
    places = [
        (hinge.index, columns[f"{hinge.name}_angle"].start, columns[f"{hinge.name}_rate"].start)
        for hinge in model.hinges
    ]

    def sensed(data: mujoco.MjData) -> TrueReading:
        mujoco.mj_kinematics(compiled, data)
        mujoco.mj_comPos(compiled, data)
        mujoco.mj_sensorPos(compiled, data)
        mujoco.mj_comVel(compiled, data)
        mujoco.mj_sensorVel(compiled, data)
        # Plain floats: a lookup in an array takes as long as all the sensors.
        values = data.sensordata.tolist()
        angles, rates = [0.0] * count, [0.0] * count
        for i, angle, rate in places:
            angles[i], rates[i] = values[angle], values[rate]
        attitude, turning = values[columns["attitude"]], values[columns["angular_velocity"]]
        gyro = eq.seen_from_frame(tuple(turning), eq.unit_space_axes(tuple(attitude)))
        point = np.array(values[columns["centre"]][:2])
        return TrueReading(np.array(gyro), np.array(attitude), angles, rates, point)

    return sensed
