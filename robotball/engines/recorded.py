"""A trajectory from a file → the Motion of a scene, with what the file itself says of slip."""

import json
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from robotball.engines import derivative
from robotball.errors import InputError, warn
from robotball.files.motion_file import FORMAT, arrays_of
from robotball.files.table_file import read_table
from robotball.files.trajectory_file import Trajectory, read_trajectory
from robotball.loads import loads_of
from robotball.motion import Label, Loads, Motion
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene

COLOUR = "#56B4E9"  # of a motion whose file names no engine
HALF_TURN = np.pi / 2  # rad between two samples, beyond which no turning can be told from them


@dataclass(frozen=True, repr=False)
class RecordedMotion(Motion):
    """A motion from a file, with what its own numbers say; arrays (n,), errors estimated.

    slip, spin are those of the shell at the plane: from the path's rate and the shell's turning.
    The errors are those of numerical rates of the file's numbers, and not the engine's; what the
    file gives itself has none. What a hinge does that has a motor is nan unless the file says it.

    angular_velocity_error  rad/s
    momentum_error          kg m²/s
    slip, slip_error        m/s
    spin, spin_error        rad/s
    rolling_radius          m, at which the ball would not have slipped
    height                  m, of the centre; nan where the file has none
    """

    angular_velocity_error: Array
    momentum_error: Array
    slip: Array
    slip_error: Array
    spin: Array
    spin_error: Array
    rolling_radius: float
    height: Array


def load_motion(path: str | Path, scene: Scene) -> Motion:
    """The motion of a file: one that `Motion.save` wrote to the last bit, any other as recorded.

    Warns where the file is of another scene. Raises InputError as `read_trajectory` does.
    """
    path = Path(path)
    table = read_table(path)
    if table.header.get("format") != FORMAT:
        return recorded(scene, read_trajectory(path))
    if table.header.get("scene", scene.name) != scene.name:
        warn(f"{path} is a motion of {table.header['scene']}, and is taken as one of {scene.name}")
    try:
        arrays = arrays_of(table, scene)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    loads = {place[1]: array for place, array in arrays.items() if place[0] == "loads"}
    own = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    return Motion(scene=scene, engine=_label(table.header, path.stem), **own, loads=Loads(**loads))


def recorded(scene: Scene, trajectory: Trajectory) -> RecordedMotion:
    """The scene's motion of a trajectory, taken as it stands.

    Raises InputError where its attitudes are too far apart to tell an angular velocity, and the
    file gives none.
    """
    times, attitude = trajectory.times, trajectory.attitude
    omega, omega_error = _angular_velocity(trajectory)
    angles, hinge_rates = _hinges(scene, trajectory)
    to_world = rotation_matrix(attitude)
    momentum, momentum_error = trajectory.momentum, np.zeros(len(times))
    if momentum is None:
        states = scene.robot.states(to_world[:, 2], angles, omega, hinge_rates)
        momentum = np.einsum("nij,nj->ni", to_world, states.momentum(scene.rolling))
        # L = (Ĩ)ω + …, in which no direction weighs more than I + d.
        largest = np.linalg.eigvalsh(scene.ball.inertia)[-1] + scene.ball.d
        momentum_error = largest * omega_error
    velocity, velocity_error = derivative.rates(times, trajectory.position[:, :2])
    shell = omega - np.outer(hinge_rates[:, 0], scene.ball.shell.axis)
    turning = np.einsum("nij,nj->ni", to_world, shell)
    per_radius = turning[:, [1, 0]] * [1.0, -1.0]  # v = a (ω - Ω)×e_z
    rolled = scene.ball.radius * per_radius
    turned = float((per_radius**2).sum())
    return RecordedMotion(
        scene=scene,
        engine=_label(trajectory.header or {}, Path(trajectory.name).stem),
        times=times,
        contact_point=trajectory.position[:, :2],
        attitude=attitude,
        momentum=momentum,
        angular_velocity=omega,
        hinge_angles=angles,
        hinge_rates=hinge_rates,
        loads=_loads(scene, times, attitude, omega),
        angular_velocity_error=omega_error,
        momentum_error=momentum_error,
        slip=np.linalg.norm(velocity - rolled, axis=1),
        slip_error=velocity_error + scene.ball.radius * omega_error,
        spin=turning[:, 2],
        spin_error=omega_error,
        rolling_radius=float((velocity * per_radius).sum()) / turned if turned else np.nan,
        height=trajectory.position[:, 2],
    )


def _angular_velocity(trajectory: Trajectory) -> tuple[Array, Array]:
    """ω (n, 3) [rad/s], frame axes, and its estimated error (n,)."""
    if trajectory.angular_velocity is not None:
        return trajectory.angular_velocity, np.zeros(len(trajectory.times))
    turned = derivative.turned_between(trajectory.attitude)
    if turned.max() > HALF_TURN:
        i = int(turned.argmax())
        raise InputError(
            f"{trajectory.name}: between t = {trajectory.times[i]:g} and "
            f"{trajectory.times[i + 1]:g} s the frame turns by {turned[i]:.3g} rad, too far to "
            "tell how: write more samples, or the angular velocity wx,wy,wz"
        )
    return derivative.angular_velocity(trajectory.times, trajectory.attitude)


def _hinges(scene: Scene, trajectory: Trajectory) -> tuple[Array, Array]:
    """The hinges' angles and rates (n, h): as the file says, or as they are commanded."""
    times, others = trajectory.times, trajectory.others or {}
    angles = np.full((len(times), len(scene.hinges)), np.nan)
    rates = angles.copy()
    for i, hinge in enumerate(scene.hinges):
        if hinge.motor is None:
            angles[:, i] = hinge.angle + hinge.command.angle(times)
            rates[:, i] = hinge.command.rate(times)
        angle, rate = others.get(f"{hinge.name}_angle"), others.get(f"{hinge.name}_rate")
        if angle is not None:
            angles[:, i] = angle
            rates[:, i] = derivative.rates(times, angle[:, None])[0][:, 0]
        if rate is not None:
            rates[:, i] = rate
    return angles, rates


def _loads(scene: Scene, times: Array, attitude: Array, omega: Array) -> Loads:
    """What the equations would ask of plane and motors at these states; nan where unknown."""
    if scene.not_reduced:
        n, h = len(times), len(scene.hinges)
        return Loads(np.full((n, 3), np.nan), np.full(n, np.nan), np.full((n, h), np.nan))
    axes = rotation_matrix(attitude) @ scene.principal_axes
    return loads_of(scene, times, axes, omega @ scene.principal_axes)


def _label(header: dict[str, str] | object, name: str) -> Label:
    """The engine's label that the file gives; one by the file's name where it gives none."""
    given = header.get("engine", "") if isinstance(header, dict) else ""
    try:
        known = json.loads(given)
        return Label(**{each.name: str(known[each.name]) for each in fields(Label)})
    except (ValueError, TypeError, KeyError):
        return Label(given or name, "", COLOUR)
