"""Readings from the sensors of a model, and the faults that only MuJoCo can have.

The readings of many rows are computed at once, by columns: at this size NumPy's norm and cross
product of rows take several times as long.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model
from robotball.engines.observe import Readings, Sign, attitudes, lengths
from robotball.motion import DIVERGED, Fault, FaultKind
from robotball.robot import formulas as eq
from robotball.robot.loads import Loads
from robotball.robot.motors import Free
from robotball.rotations import Array, Mask, rotation_matrix, unit_space_axes

# Sensors of coordinates and velocities, which show whether a state has diverged.
_STATE_SENSORS = [
    mujoco.mjtSensor.mjSENS_FRAMEPOS,
    mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    mujoco.mjtSensor.mjSENS_SUBTREELINVEL,
    mujoco.mjtSensor.mjSENS_JOINTPOS,
    mujoco.mjtSensor.mjSENS_JOINTVEL,
]
_UP = np.array([0.0, 0.0, 1.0])
_SATURATED = 1 - 1e-6  # of the friction cone; the tolerance of solutions on its surface
_LIFTING = 1e-2  # of the weight; a ball with a smaller normal force is about to lift off
_AT_LIMIT = 1 - 1e-9  # of a servo's torque limit; the tolerance of rounding
# The state itself shows a bad state (BADQPOS, …).
_WARNINGS = {
    int(warning): warning.name.removeprefix("mjWARN_")
    for warning in mujoco.mjtWarning.__members__.values()
    if warning != mujoco.mjtWarning.mjNWARNING and "BADQ" not in warning.name
}


def readings_of(model: Model, rows: Array) -> Readings:
    """Return the readings of rows (m, nsensordata + 7), one per state.

    A row is the sensordata followed by the warning counters.
    """
    scene, columns = model.scene, model.sensor_columns
    contact, sound = rows[:, columns["contact"]], _sound(model, rows)
    slip, spin = _slip(model, rows)
    attitude = attitudes(rows[:, columns["attitude"]], sound)
    to_world = rotation_matrix(attitude)
    angles, rates, torques = _of_hinges(model, rows)
    # Squares of a diverged state overflow.
    with np.errstate(all="ignore"):
        used = _friction_used(model, contact)
        # A ball that is about to lift off saturates its vanishing cone: the fault is then lost
        # contact.
        weight = scene.ball.mass * scene.gravity if scene.load_varies else 0.0
        lifting = (used > _SATURATED) & (contact[:, 1] < _LIFTING * weight)
        return Readings(
            time=rows[:, columns["time"]][:, 0],
            centre=rows[:, columns["centre"]],
            attitude=attitude,
            # The sensor has world axes.
            angular_velocity=np.einsum(
                "nji,nj->ni", to_world, rows[:, columns["angular_velocity"]]
            ),
            momentum=_momentum(model, rows),
            hinge_angles=angles,
            hinge_rates=rates,
            loads=Loads(_force_in_world(contact), contact[:, 4], torques),
            slip=slip,
            spin=spin,
            friction_used=used,
            touching=(contact[:, 0] > 0) & ~lifting,
            sound=sound,
        )


def _momentum(model: Model, rows: Array) -> Array:
    """Return the paper's M (m, 3), world: L = G + r×mv about the contact, γ×L for rubber (3.1)."""
    scene, columns = model.scene, model.sensor_columns
    centre = rows[:, columns["centre"]]
    linear = scene.ball.mass * rows[:, columns["velocity"]]
    if scene.load_varies:
        arm = rows[:, columns["centre_of_mass"]] - centre * [1.0, 1.0, 0.0]
    else:  # the centre of mass is the sphere's centre and has no sensor
        arm = centre * _UP
    spin = tuple(rows[:, columns["angular_momentum"]].T)
    L = eq.add(spin, eq.cross(tuple(arm.T), tuple(linear.T)))
    return np.stack(eq.cross(tuple(_UP), L) if scene.rolling == "rubber" else L, axis=1)


def _slip(model: Model, rows: Array) -> tuple[Array, Array]:
    """Return the slip [m/s] and the spin [rad/s] of the shell (m,) relative to the plane."""
    scene, columns = model.scene, model.sensor_columns
    contact = rows[:, columns["contact"]]
    velocity, spin, (tx, ty) = contact[:, 14:16], contact[:, 16], contact[:, 10:12].T
    if not scene.plane_turns:
        return lengths(velocity), spin
    # The sensor is relative to the geom, which does not turn.
    times, points = rows[:, columns["time"]][:, 0], rows[:, columns["centre"]][:, :2]
    x, y, turning = scene.plane_velocity(times, points).T
    of_plane = np.stack([tx * x + ty * y, tx * y - ty * x], axis=1)
    return lengths(velocity - of_plane), spin - turning


def _force_in_world(contact: Array) -> Array:
    """Return the force (m, 3) of the plane on the shell along the world axes [N]."""
    N, T, B, *_, nx, ny, nz, tx, ty, tz = contact[:, 1:13].T
    axes = zip((nx, ny, nz), (tx, ty, tz), eq.cross((nx, ny, nz), (tx, ty, tz)), strict=True)
    return np.stack([N * n + T * t + B * b for n, t, b in axes], axis=1)


def _friction_used(model: Model, contact: Array) -> Array:
    """Return the used fraction (m,) of the friction cone; a pyramid limits a sum of components.

    The coefficients are taken from the scene if it gives them, and else from the contact.
    """
    compiled, limits = model.compiled, model.scene.friction
    # MuJoCo raises smaller coefficients to mjMINMU.
    slide, _, spin, roll, _ = np.maximum(compiled.pair_friction[0], mujoco.mjMINMU)
    slide, spin = limits.sliding or slide, limits.torsional or spin
    normal, *tangential = contact[:, 1:4].T
    torques = contact[:, 4:7].T / np.array([[spin], [roll], [roll]])
    demand = np.concatenate([tangential, torques * slide]) / slide
    if compiled.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL:
        needed = np.abs(demand).sum(axis=0)
    else:
        needed = np.linalg.norm(demand, axis=0)
    return np.divide(needed, normal, out=np.zeros_like(needed), where=normal > 0)


def _sound(model: Model, rows: Array) -> Mask:
    """Return whether each row (m,) is finite, with state below DIVERGED; forces may exceed it."""
    # These two passes make no copy and suffice for most portions; a NaN fails both comparisons.
    if len(rows) and rows.min() > -DIVERGED and rows.max() < DIVERGED:
        return np.ones(len(rows), bool)
    compiled = model.compiled
    state = np.repeat(np.isin(compiled.sensor_type, _STATE_SENSORS), compiled.sensor_dim)
    small = np.abs(rows[:, : compiled.nsensordata][:, state]) < DIVERGED
    return np.asarray(np.isfinite(rows).all(axis=1) & small.all(axis=1))


def _of_hinges(model: Model, rows: Array) -> Array:
    """Return angles, rates and torques (3, m, h) of the scene's hinges; 0 for fixed hinges."""
    columns, values = model.sensor_columns, np.zeros((3, len(rows), len(model.scene.hinges)))
    for hinge in model.hinges:
        angle = rows[:, columns[f"{hinge.name}_angle"].start]
        rate = rows[:, columns[f"{hinge.name}_rate"].start]
        torque = _torque(rows, columns.get(f"{hinge.name}_torque"))
        if isinstance(hinge.actuation, Free):
            torque = torque + hinge.actuation.torque(0.0, angle, rate)
        elif hinge.law:  # MuJoCo's actuators have no dry friction
            torque = torque + hinge.law.dry_friction(rate)
        values[:, :, hinge.index] = angle, rate, torque
    return values


def _torque(rows: Array, columns: slice | None) -> Array:
    """Return a motor's torque or a prescribed joint's load (m,) [N m]; 0 for a passive hinge."""
    return np.zeros(len(rows)) if columns is None else rows[:, columns.stop - 1]


def own_faults(model: Model, rows: Array, readings: Readings) -> list[Sign]:
    """Return the faults of the friction cone, of torque limits, and of MuJoCo's warnings."""
    kind, warnings = FaultKind, rows[:, model.compiled.nsensordata :]
    saturated = (readings.friction_used > _SATURATED) & readings.touching
    torques = np.abs(readings.loads.motor_torques)
    return [
        *([] if model.scene.may_slip else [(saturated, Fault(kind.CONE_SATURATED, np.nan))]),
        *(
            (
                torques[:, hinge.index] >= hinge.torque_limit * _AT_LIMIT,
                Fault(kind.TORQUE_LIMIT, np.nan, hinge.name, note=hinge.motor is not None),
            )
            for hinge in model.hinges
            if hinge.torque_limit < np.inf
        ),
        *(
            (readings.sound & (warnings[:, i] > 0), Fault(kind.ENGINE_WARNED, np.nan, name))
            for i, name in _WARNINGS.items()
            if warnings[-1:, i].any()  # counters only grow
        ),
    ]


def sensor_reader(model: Model) -> Callable[[mujoco.MjData], Any]:
    """Return a function that reads a robot's sensors in a state, without computing the forces."""
    from robotball.robot.loop import TrueReading  # few scenes need it

    compiled, columns, count = model.compiled, model.sensor_columns, len(model.scene.hinges)
    places = [
        (hinge.index, *(columns[f"{hinge.name}_{kind}"].start for kind in ("angle", "rate")))
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
        gyro = eq.seen_from_frame(tuple(turning), unit_space_axes(tuple(attitude)))
        point, *axes = map(np.array, (values[columns["centre"]][:2], gyro, attitude))
        return TrueReading(axes[0], axes[1], angles, rates, point)

    return sensed
