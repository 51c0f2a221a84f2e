"""First values of a fit, from the readings: the initial state, the world's axes and a resistance.

A local polynomial of the track gives the speed, its direction and its rate of change. A scene with
a bad start or resistance is therefore fitted as quickly as a good scene.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from robotball.errors import LARGEST, InputError, check_positive
from robotball.fit.evidence import SHOWN
from robotball.fit.logs import Log, Sensor
from robotball.fit.residuals import FIRST, FittedLog
from robotball.fit.sensing import FEWEST, noise_of
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, multiply, rotation_matrix, turned

_SMALLEST = 1e-7  # of a sensor's readings: least noise, above the errors of equations and engines
_SMOOTH = 4.0  # largest mean of (residual/noise)² for which a track is a parabola


def track_of(sensor: Sensor, noise: float) -> tuple[Array, float]:
    """Return position, velocity and acceleration (3, 2) of a track at t = 0, and the velocity's ±.

    They belong to a parabola through the longest first part of the track that is a parabola, with
    10, 20, … readings. A track that begins long after t = 0 is treated as if it began at t = 0.
    """
    t, values = sensor.times, sensor.values[:, :2]
    count, best = min(FIRST, len(t)), None
    while best is None or count < 2 * len(t):
        part = slice(min(count, len(t)))
        at = t[part] if t[0] <= t[part][-1] - t[0] else t[part] - t[0]
        powers = at[:, None] ** np.arange(min(3, len(at))) / [1.0, 1.0, 2.0][: len(at)]
        found = np.linalg.lstsq(powers, values[part])[0]
        left = ((values[part] - powers @ found) ** 2).sum() / noise**2
        if best is not None and left > _SMOOTH * 2 * len(at):
            break
        spread = noise * float(np.sqrt(np.linalg.pinv(powers.T @ powers)[1, 1]))
        best = found, spread
        count *= 2
    return best


def first_values(
    scene: Scene, log: Log, noise: Mapping[str, float], freed: Sequence[str]
) -> FittedLog:
    """Return a log with its sensors' noise, and the first values that its readings give.

    freed: the circumstances of the log that are fitted.
    """
    sizes, first = [], {}
    for sensor in log.sensors:
        first[sensor.name] = np.median(sensor.values[:FIRST], axis=0)
        least = _SMALLEST * float(np.abs(sensor.values).max())
        specified = noise.get(sensor.name)
        if specified is not None:
            check_positive(f"the noise of {sensor.name}", specified)
        # A smaller spread would make squared residuals overflow.
        constant = np.ptp(sensor.values, axis=0).max() < 1 / LARGEST
        few = len(sensor.times) < FEWEST
        if specified is None and (few or constant):
            fault = "is constant" if constant else f"has only {len(sensor.times)} readings"
            raise InputError(
                f"{log.name}: {sensor.name} {fault}, so its noise cannot be estimated; specify its "
                "noise or remove its columns"
            )
        sizes.append(max(noise_of(sensor) if specified is None else specified, least))
    motors = [hinge.name for hinge in scene.hinges if hinge.motor is not None]
    begins = {
        kind: {n: float(first[f"{n}_{kind}"][0]) for n in motors if f"{n}_{kind}" in first}
        for kind in ("angle", "rate")
    }
    started = scene.with_hinges(**begins)
    # A single reading, because a median of quaternions is not a rotation.
    attitudes = (sensor.values[0] for sensor in log.sensors if sensor.name == "attitude")
    attitude = next(attitudes, scene.start.attitude)
    omega = first.get("gyro", scene.angular_velocity_at(scene.start))
    spreads, values = dict(zip(first, sizes, strict=True)), dict[str, Array]()
    started = replace(started, start=Start(attitude, np.zeros(3), scene.start.slip))
    slip = _first_slip(started, log, spreads, omega)
    slip = scene.start.slip if slip is None else slip
    if "position" in first:
        sensor = next(sensor for sensor in log.sensors if sensor.name == "position")
        track, error = track_of(sensor, spreads["position"])
        values["world.origin" if "world.origin" in freed else "start.place"] = track[0]
        turn, omega = _first_motion(started, slip, track[1], SHOWN * error, omega, "gyro" in first)
        if "world.yaw" in freed and "attitude" not in first:
            values["world.yaw"] = np.array([turn])
        elif "attitude" not in first:
            attitude = multiply(turned(np.eye(4)[0], np.array([0.0, 0.0, turn])), attitude)
    started = replace(started, start=Start(attitude, np.zeros(3), slip))
    started = replace(started, start=Start(attitude, started.momentum_of(omega), slip))
    if "position" in first and (speed := float(np.hypot(*track[1]))):
        # Rolling friction times the weight is the torque that slows a ball without drives.
        slowing = float(-track[2] @ track[1]) / speed**2
        torque = slowing * float(np.linalg.norm(started.start.momentum))
        values["friction.rolling"] = np.array([torque / (scene.ball.mass * scene.gravity)])
    estimated = tuple(sensor.name not in noise for sensor in log.sensors)
    return FittedLog(log, tuple(sizes), estimated, started, values)


def _first_motion(
    scene: Scene, slip: Array, velocity: Array, error: float, omega: Array, sensed: bool
) -> tuple[float, Array]:
    """Return the angle about the vertical from a scene's start to a velocity, and ω of the frame.

    The scene's start is rotated by this angle. Then ω [rad/s] gives it the velocity (2,) [m/s],
    unless a gyro has `sensed` it. Differences below `error` [m/s] are ignored.
    """
    to_world, drive = scene.start.to_world, scene.hinges[0].rate * scene.ball.shell.axis
    shell, turn = to_world @ (omega - drive), 0.0
    own = slip[:2] - scene.slip_of(0.0, np.zeros(2), np.zeros(2), shell)[:2]
    if min(np.hypot(*own), np.hypot(*velocity)) > error:
        turn = float(np.angle(complex(*velocity) / complex(*own)))
        turned = complex(*velocity) * np.exp(-1j * turn)
        velocity = np.array([turned.real, turned.imag])
    if not sensed and np.hypot(*(velocity - own)) > error:
        x, y = (velocity - own) / scene.ball.radius
        omega = to_world.T @ (shell + np.array([-y, x, 0.0])) + drive
    return turn, omega


def _first_slip(scene: Scene, log: Log, noise: Mapping[str, float], omega: Array) -> Array | None:
    """Return the slip of a start (3,) that the first readings show; None if they cannot show it.

    omega (3,): of the frame at the start, frame axes [rad/s].
    """
    place = next((s for s in log.sensors if s.name == "position"), None)
    if place is None or "gyro" not in noise or not scene.may_slip:
        return None
    t = place.times[:FIRST] - place.times[:FIRST].mean()
    velocity = t @ place.values[:FIRST, :2] / (t @ t)
    # The attitude in the middle of these readings, because a fast ball turns during them.
    attitudes = [s.values[FIRST // 2] for s in log.sensors if s.name == "attitude"]
    to_world = rotation_matrix(attitudes[0]) if attitudes else scene.start.to_world
    shell = omega - scene.hinges[0].rate * scene.ball.shell.axis
    slip = scene.slip_of(0.0, np.zeros(2), velocity, to_world @ shell)
    turn = noise.get("attitude", 0.0) * float(np.linalg.norm(shell))
    of_gyro = scene.ball.radius * float(np.hypot(noise["gyro"], turn))
    slide = float(np.hypot(noise["position"] / np.sqrt(t @ t), of_gyro))
    errors = np.array([slide, slide, noise["gyro"]])
    slip[np.isinf(scene.slip_limits)] = 0.0
    return slip * bool((np.abs(slip) > SHOWN * errors).any())
