"""Read a motion of a scene from a file, with the slip that its samples imply.

Quantities that the file lacks are computed from its samples. Rates are slopes of polynomials
through neighbouring samples, with estimated errors.
"""

import contextlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball.engines.equations import scene_of
from robotball.errors import InputError, named, warn
from robotball.files import as_path, readable
from robotball.files.columns import read_table
from robotball.files.trajectories import FORMAT, Trajectory, arrays_of, read_trajectory
from robotball.motion import Label, Motion, pieces
from robotball.robot.loads import Loads, loads_of
from robotball.robot.scene import Scene
from robotball.rotations import Array, angle_between, conjugate, continuous, rotation_matrix

# Odd numbers, so that a sample has equally many neighbours on both sides.
_POINTS = 7  # samples per polynomial; 5 for the error estimate
_NOISE = 2.5  # factor on the largest noise near a sample; noise at the sample may be larger
_COLOUR = "#56B4E9"  # for a file that does not name its engine
_LARGEST_TURN = np.pi / 2  # rad between samples; above, the direction of rotation is uncertain


def sampled_rates(times: Array, values: Array) -> tuple[Array, Array]:
    """Return d/dt (n, k) of values (n, k) at increasing times (n,), and its estimated error (n,).

    The rate is the slope of the polynomial through 7 neighbours. The error is the sum of two terms,
    and each term is its largest value near the sample. The first term is the difference from the
    slope through 5 neighbours; it bounds the truncation error. The second term is the effect of
    noise, estimated from the residual of a polynomial of degree 5 through the 7 samples.
    """
    fine, noise = _slopes(times, values, _POINTS)
    coarse, _ = _slopes(times, values, _POINTS - 2)
    truncation = np.linalg.norm(fine - coarse, axis=1)
    return fine, _largest_near(truncation, _POINTS) + _NOISE * _largest_near(noise, 3 * _POINTS)


def angular_velocity(times: Array, attitude: Array) -> tuple[Array, Array]:
    """Return ω (n, 3) in frame axes from attitudes (n, 4), and its estimated error (n,) [rad/s]."""
    q = continuous(attitude)
    rate, error = sampled_rates(times, q)
    # dq/dt = q∘(0, ω)/2. The numerical rate also has a part along q, which is dropped.
    w, v = conjugate(q)[:, :1], conjugate(q)[:, 1:]
    half_omega = w * rate[:, 1:] + rate[:, :1] * v + np.cross(v, rate[:, 1:])
    return 2 * half_omega, 2 * error


def turned_between(attitude: Array) -> Array:
    """Return the rotation angles (n - 1,) [rad] between successive attitudes (n, 4)."""
    return angle_between(attitude[:-1], attitude[1:])


def _slopes(times: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Return slopes (n, k) and noise (n,) of polynomials through `points` neighbours each."""
    every = np.arange(len(times))
    parts = [_slopes_at(every[piece], times, values, points) for piece in pieces(len(times))]
    slopes, noise = zip(*parts, strict=True)
    return np.concatenate(slopes), np.concatenate(noise)


def _slopes_at(
    samples: NDArray[np.intp], times: Array, values: Array, points: int
) -> tuple[Array, Array]:
    """Return slopes and noise at the samples with indices (m,)."""
    points = min(points, len(times))
    first = np.clip(samples - points // 2, 0, len(times) - points)
    near: NDArray[np.intp] = first[:, None] + np.arange(points)
    rows, node = np.arange(len(samples)), samples - first
    # Derivatives of Lagrange's basis at a node. Scaled, because products of short intervals
    # underflow.
    t = times[near]
    scale = (t[:, -1] - t[:, 0])[:, None]
    u = (t - times[samples, None]) / scale
    gaps = u[:, :, None] - u[:, None, :]
    gaps[:, range(points), range(points)] = 1.0
    difference = 1 / gaps.prod(axis=2)  # weights of the highest divided difference, up to a factor
    there = -u
    there[rows, node] = 1.0
    weights = difference / difference[rows, node][:, None] / there
    weights[rows, node] = 0.0
    weights[rows, node] = -weights.sum(axis=1)
    weights /= scale
    from_node = values[near] - values[samples, None]
    left = np.linalg.norm(np.einsum("np,npk->nk", difference, from_node), axis=1)
    noise = left * np.linalg.norm(weights, axis=1) / np.linalg.norm(difference, axis=1)
    return np.einsum("np,npk->nk", weights, from_node), noise


def _largest_near(error: Array, count: int) -> Array:
    """Return the largest error near each sample: a single one may be small by chance."""
    padded = np.pad(error, count // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, count // 2 * 2 + 1)
    return np.asarray(windows.max(axis=1))


@dataclass(frozen=True, repr=False)
class RecordedMotion(Motion):
    """Hold a motion from a file, with the slip and spin that its samples imply.

    It also has the attributes of `Motion`. Slip and spin come from the rate of the path and from
    the shell's angular velocity. Errors estimate how inexact rates computed from samples are, not
    how inexact the engine is; they are 0 for quantities that the file contains. The angle and the
    rate of a motor's hinge are NaN if the file has no columns for them.

    Attributes
    ----------
    angular_velocity_error : (n,), rad/s
        Estimated error of `angular_velocity`.
    momentum_error : (n,), kg m²/s
        Estimated error of `momentum`.
    slip : (n,), m/s
        Sliding speed of the shell at the contact.
    slip_error : (n,), m/s
        Estimated error of `slip`.
    spin : (n,), rad/s
        Angular velocity of the shell about the vertical.
    spin_error : (n,), rad/s
        Estimated error of `spin`.
    rolling_radius : float, m
        The radius that minimises slip, by least squares.
    height : (n,), m
        Height of the centre. NaN if not in the file.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> rb.integrate(scene, 0.5).save("run.csv")
    >>> motion = rb.recorded(scene, rb.read_trajectory("run.csv"))
    >>> print(f"{motion.rolling_radius:.3f} m")
    1.000 m
    """

    angular_velocity_error: Array
    momentum_error: Array
    slip: Array
    slip_error: Array
    spin: Array
    spin_error: Array
    rolling_radius: float
    height: Array


def load_motion(path: str | Path, scene: Scene | str | Path) -> Motion:
    """Read the motion of a scene from a file.

    Parameters
    ----------
    path : str or Path
        A file that `Motion.save` wrote, or a trajectory of any simulator as CSV, NPZ or Parquet.
    scene : Scene, str or Path
        The scene of the motion, its name or its file.

    Returns
    -------
    Motion
        The saved motion, equal to the last bit. For any other trajectory a RecordedMotion, which
        `recorded` makes.

    Raises
    ------
    InputError
        If the file cannot be read; see `read_trajectory`.

    Warns
    -----
    SceneWarning
        If the file names another scene.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> motion = rb.integrate(scene, 0.5)
    >>> motion.save("run.csv")
    >>> bool((rb.load_motion("run.csv", scene).momentum == motion.momentum).all())
    True
    """
    path, scene = as_path("a motion", path), scene_of(scene)
    table = read_table(path)
    if table.header.get("format") != FORMAT:
        return recorded(scene, read_trajectory(path))
    if table.header.get("scene", scene.name) != scene.name:
        warn(f"{path} holds a motion of {table.header['scene']}, but is read as {scene.name}")
    with named(path):
        arrays = arrays_of(table, scene)
    loads = {place[1]: array for place, array in arrays.items() if place[0] == "loads"}
    data: Any = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    return Motion(scene=scene, engine=_label(table.header, path.stem), **data, loads=Loads(**loads))


def recorded(scene: Scene | str | Path, trajectory: Trajectory) -> RecordedMotion:
    """Convert a trajectory to a motion of a scene.

    Quantities that the trajectory lacks are computed from its samples. Rates are slopes of
    polynomials through neighbouring samples.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene of the trajectory, its name or its file.
    trajectory : Trajectory
        The trajectory, as `read_trajectory` returns it.

    Returns
    -------
    RecordedMotion
        The motion, with estimated errors of the rates that are computed from samples.

    Raises
    ------
    InputError
        If the trajectory has no angular velocity and its attitudes are too far apart to compute it.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> rb.integrate(scene, 0.5).save("run.csv")
    >>> motion = rb.recorded(scene, rb.read_trajectory("run.csv"))
    >>> bool(motion.slip.max() < 1e-3)
    True
    """
    scene = scene_of(scene)
    times, attitude = trajectory.times, trajectory.attitude
    omega, omega_error = _angular_velocity(trajectory)
    angles, hinge_rates = _hinges(scene, trajectory)
    to_world = rotation_matrix(attitude)
    velocity, velocity_error = sampled_rates(times, trajectory.position[:, :2])
    shell = omega - np.outer(hinge_rates[:, 0], scene.ball.shell.axis)
    omega_world = np.einsum("nij,nj->ni", to_world, shell)
    per_radius = omega_world[:, [1, 0]] * [1.0, -1.0]  # v = a (ω - Ω)×e_z
    slip = scene.slip_of(times, trajectory.position[:, :2], velocity, omega_world)
    momentum, momentum_error = trajectory.momentum, np.zeros(len(times))
    if momentum is None:
        gamma = to_world[:, 2]
        states = scene.robot.states(gamma, angles, omega, hinge_rates)
        momentum = states.momentum(scene.rolling)
        # L = Ĩω + …, with inertia of at most I + d in any direction.
        largest = np.linalg.eigvalsh(scene.ball.inertia)[-1] + scene.ball.d
        momentum_error = largest * omega_error
        if scene.contact_moves:
            moved, pushes = velocity - scene.ball.radius * per_radius, states.pushes[:, :3]
            pushed = np.einsum("nji,nj,ikn->nk", to_world[:, :2], moved, pushes)
            pushed = np.cross(gamma, pushed) if scene.rolling == "rubber" else pushed
            momentum = momentum + pushed
            momentum_error += np.linalg.norm(pushes, axis=(0, 1)) * velocity_error
        momentum = np.einsum("nij,nj->ni", to_world, momentum)
    squares = float((per_radius**2).sum())
    if scene.not_reduced:
        loads = Loads.unknown(len(times), len(scene.hinges))
    else:
        axes = scene.principal_axes
        loads = loads_of(scene, times, to_world @ axes, omega @ axes)
    return RecordedMotion(
        scene=scene, engine=_label(trajectory.header or {}, Path(trajectory.name).stem),
        times=times, contact_point=trajectory.position[:, :2], attitude=attitude,
        momentum=momentum, momentum_error=momentum_error,
        angular_velocity=omega, angular_velocity_error=omega_error,
        hinge_angles=angles, hinge_rates=hinge_rates, loads=loads,
        slip=np.linalg.norm(slip[:, :2], axis=1),
        slip_error=velocity_error + scene.ball.radius * omega_error,
        spin=slip[:, 2], spin_error=omega_error,
        # Least squares of v = r (ω - Ω)×e_z over all samples.
        rolling_radius=float((velocity * per_radius).sum()) / squares if squares else np.nan,
        height=trajectory.position[:, 2],
    )  # fmt: skip


def _angular_velocity(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return ω (n, 3) [rad/s], frame axes, and its estimated error (n,)."""
    if trajectory.angular_velocity is not None:
        return trajectory.angular_velocity, np.zeros(len(trajectory.times))
    turned = turned_between(trajectory.attitude)
    if turned.max() > _LARGEST_TURN:
        i = int(turned.argmax())
        raise InputError(
            f"{trajectory.name}: between t = {trajectory.times[i]:g} and "
            f"{trajectory.times[i + 1]:g} s the frame turns by {turned[i]:.3g} rad, more than "
            f"{_LARGEST_TURN:.3g}: write more samples, or the angular velocity wx,wy,wz"
        )
    return angular_velocity(trajectory.times, trajectory.attitude)


def _hinges(scene: Scene, trajectory: Trajectory) -> tuple[Array, Array]:
    times, others = trajectory.times, trajectory.others or {}
    angles = np.full((len(times), len(scene.hinges)), np.nan)
    rates = angles.copy()
    for i, hinge in enumerate(scene.hinges):
        # A motor's angle depends on its load, so the command does not determine it.
        if hinge.motor is None:
            angles[:, i] = hinge.angle + hinge.command.angle(times)
            rates[:, i] = hinge.command.rate(times)
        angle, rate = others.get(f"{hinge.name}_angle"), others.get(f"{hinge.name}_rate")
        if angle is not None:
            angles[:, i] = angle
            rates[:, i] = sampled_rates(times, angle[:, None])[0][:, 0]
        if rate is not None:
            rates[:, i] = rate
    return angles, rates


def _label(header: dict[str, str] | object, name: str) -> Label:
    """Return the engine's label from the file, or one with the file's name."""
    engine = header.get("engine", "") if isinstance(header, dict) else ""
    with contextlib.suppress(InputError), readable(name):
        return Label(**json.loads(engine))
    return Label(engine or name, "", _COLOUR)
