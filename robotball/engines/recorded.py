"""A trajectory from a file → the Motion of a scene, with what its own numbers say of slip.

What the file does not give is computed from its samples: rates are slopes of polynomials through
neighbouring samples, each with an estimate of its error, and the rest follows from them.
"""

import contextlib
import json
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robotball.engines.engine import scene_of
from robotball.errors import InputError, named, warn
from robotball.files import as_path, readable
from robotball.files.columns import read_table
from robotball.files.trajectories import FORMAT, Trajectory, arrays_of, read_trajectory
from robotball.motion import Label, Motion, pieces
from robotball.robot.loads import Loads, loads_of
from robotball.robot.scene import Scene
from robotball.rotations import Array, angle_between, conjugate, continuous, rotation_matrix

# An odd number, to have as many neighbours on each side.
_POINTS = 7  # of the polynomial through a sample and its neighbours; 5 for the estimate
# Times the effect on a rate of the largest noise near a sample: at the sample it may lie worse.
_NOISE = 2.5


def sampled_rates(times: Array, values: Array) -> tuple[Array, Array]:
    """Return d/dt (n, k) of values (n, k) at increasing times (n,), and its estimated error (n,).

    It is the slope of the polynomial through seven neighbours. The error has two parts, each the
    largest near the sample: how far the slope by five neighbours is off, which is more than the
    truncation error; and the effect of rounding or noise on a rate, estimated from the part that no
    polynomial through six of the seven follows.
    """
    fine, noise = _slopes(times, values, _POINTS)
    coarse, _ = _slopes(times, values, _POINTS - 2)
    truncation = np.linalg.norm(fine - coarse, axis=1)
    return fine, _largest_near(truncation, _POINTS) + _NOISE * _largest_near(noise, 3 * _POINTS)


def angular_velocity(times: Array, attitude: Array) -> tuple[Array, Array]:
    """Return ω (n, 3) in frame axes of attitudes (n, 4), and its estimated error (n,) [rad/s]."""
    q = continuous(attitude)
    rate, error = sampled_rates(times, q)
    # dq/dt = q∘(0, ω)/2; the polynomials leave a part along q, which is no turning.
    w, v = conjugate(q)[:, :1], conjugate(q)[:, 1:]
    turned = w * rate[:, 1:] + rate[:, :1] * v + np.cross(v, rate[:, 1:])
    return 2 * turned, 2 * error


def turned_between(attitude: Array) -> Array:
    """Return the angles (n - 1,) [rad] by which attitudes (n, 4) turn from one to the next."""
    return angle_between(attitude[:-1], attitude[1:])


def _slopes(times: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Return the slopes (n, k) at the samples of polynomials through `points` of them each.

    With them the noise (n,) of the slopes, if the highest differences are nothing but noise.
    """
    every = np.arange(len(times))
    parts = [_slopes_at(every[piece], times, values, points) for piece in pieces(len(times))]
    slopes, noise = zip(*parts, strict=True)
    return np.concatenate(slopes), np.concatenate(noise)


def _slopes_at(
    samples: NDArray[np.intp], times: Array, values: Array, points: int
) -> tuple[Array, Array]:
    """Return slopes and noise at some of the samples, by their places (m,)."""
    points = min(points, len(times))
    first = np.clip(samples - points // 2, 0, len(times) - points)
    near: NDArray[np.intp] = first[:, None] + np.arange(points)
    rows, own = np.arange(len(samples)), samples - first
    # The derivative of Lagrange's basis at one of its nodes; scaled, as products of short
    # intervals vanish.
    t = times[near]
    scale = (t[:, -1] - t[:, 0])[:, None]
    u = (t - times[samples, None]) / scale
    gaps = u[:, :, None] - u[:, None, :]
    gaps[:, range(points), range(points)] = 1.0
    difference = 1 / gaps.prod(axis=2)  # divided, of the highest order, but for its unit
    there = -u
    there[rows, own] = 1.0
    weights = difference / difference[rows, own][:, None] / there
    weights[rows, own] = 0.0
    weights[rows, own] = -weights.sum(axis=1)
    weights /= scale
    from_own = values[near] - values[samples, None]
    left = np.linalg.norm(np.einsum("np,npk->nk", difference, from_own), axis=1)
    noise = left * np.linalg.norm(weights, axis=1) / np.linalg.norm(difference, axis=1)
    return np.einsum("np,npk->nk", weights, from_own), noise


def _largest_near(error: Array, count: int) -> Array:
    """Return the largest errors (n,) near each sample; the two parts of a single one may cancel."""
    padded = np.pad(error, count // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, count // 2 * 2 + 1)
    return np.asarray(windows.max(axis=1))


_COLOUR = "#56B4E9"  # of a motion whose file names no engine
_HALF_TURN = np.pi / 2  # rad between two samples, beyond which its direction is uncertain


@dataclass(frozen=True, repr=False)
class RecordedMotion(Motion):
    """Hold a motion from a file, with the slip and spin that its own numbers imply.

    It has the attributes of `Motion` as well. Slip and spin are the shell's at the plane, from the
    rate of the path and the turning of the shell. The errors are estimated errors of numerical
    rates, and not the engine's. A quantity that the file gives has the error 0. The hinge of a
    motor has NaN for its angle and rate unless the file has them.

    Attributes
    ----------
    angular_velocity_error : (n,), rad/s
        The error of `angular_velocity`.
    momentum_error : (n,), kg m²/s
        The error of `momentum`.
    slip : (n,), m/s
        The sliding speed of the shell at the contact.
    slip_error : (n,), m/s
        The error of `slip`.
    spin : (n,), rad/s
        The angular velocity of the shell about the vertical.
    spin_error : (n,), rad/s
        The error of `spin`.
    rolling_radius : float, m
        The radius at which the ball would not have slipped.
    height : (n,), m
        The height of the centre. NaN if the file has none.

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
        The scene that the file is a motion of, its name or its file.

    Returns
    -------
    Motion
        The motion that was saved, to the last bit. Of another trajectory a RecordedMotion, as
        `recorded` returns it.

    Raises
    ------
    InputError
        If the file cannot be read, as `read_trajectory` says.

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
        warn(f"{path} is a motion of {table.header['scene']}, and is taken as one of {scene.name}")
    with named(path):
        arrays = arrays_of(table, scene)
    loads = {place[1]: array for place, array in arrays.items() if place[0] == "loads"}
    own = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    return Motion(scene=scene, engine=_label(table.header, path.stem), **own, loads=Loads(**loads))


def recorded(scene: Scene | str | Path, trajectory: Trajectory) -> RecordedMotion:
    """Take a trajectory as a motion of a scene.

    What the trajectory does not have is computed from its samples. Rates are slopes of polynomials
    through neighbouring samples.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene that the trajectory is a motion of, its name or its file.
    trajectory : Trajectory
        The trajectory, as `read_trajectory` returns it.

    Returns
    -------
    RecordedMotion
        The motion, with estimated errors of the numerical rates.

    Raises
    ------
    InputError
        If the attitudes are too far apart for an angular velocity, and the trajectory has none.

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
    momentum, momentum_error = trajectory.momentum, np.zeros(len(times))
    if momentum is None:
        states = scene.robot.states(to_world[:, 2], angles, omega, hinge_rates)
        momentum = np.einsum("nij,nj->ni", to_world, states.momentum(scene.rolling))
        # L = (Ĩ)ω + …, in which no direction weighs more than I + d.
        largest = np.linalg.eigvalsh(scene.ball.inertia)[-1] + scene.ball.d
        momentum_error = largest * omega_error
    velocity, velocity_error = sampled_rates(times, trajectory.position[:, :2])
    shell = omega - np.outer(hinge_rates[:, 0], scene.ball.shell.axis)
    turning = np.einsum("nij,nj->ni", to_world, shell)
    per_radius = turning[:, [1, 0]] * [1.0, -1.0]  # v = a (ω - Ω)×e_z
    rolled = scene.ball.radius * per_radius
    turned = float((per_radius**2).sum())
    if scene.not_reduced:
        loads = Loads.unknown(len(times), len(scene.hinges))
    else:  # those that the equations need at these states
        axes = scene.principal_axes
        loads = loads_of(scene, times, to_world @ axes, omega @ axes)
    return RecordedMotion(
        scene=scene, engine=_label(trajectory.header or {}, Path(trajectory.name).stem),
        times=times, contact_point=trajectory.position[:, :2], attitude=attitude,
        momentum=momentum, momentum_error=momentum_error,
        angular_velocity=omega, angular_velocity_error=omega_error,
        hinge_angles=angles, hinge_rates=hinge_rates, loads=loads,
        slip=np.linalg.norm(velocity - rolled, axis=1),
        slip_error=velocity_error + scene.ball.radius * omega_error,
        spin=turning[:, 2], spin_error=omega_error,
        # Least squares of v = r (ω - Ω)×e_z over all samples.
        rolling_radius=float((velocity * per_radius).sum()) / turned if turned else np.nan,
        height=trajectory.position[:, 2],
    )  # fmt: skip


def _angular_velocity(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return ω (n, 3) [rad/s], frame axes, and its estimated error (n,)."""
    if trajectory.angular_velocity is not None:
        return trajectory.angular_velocity, np.zeros(len(trajectory.times))
    turned = turned_between(trajectory.attitude)
    if turned.max() > _HALF_TURN:
        i = int(turned.argmax())
        raise InputError(
            f"{trajectory.name}: between t = {trajectory.times[i]:g} and "
            f"{trajectory.times[i + 1]:g} s the frame turns by {turned[i]:.3g} rad, too far to "
            "tell how: write more samples, or the angular velocity wx,wy,wz"
        )
    return angular_velocity(trajectory.times, trajectory.attitude)


def _hinges(scene: Scene, trajectory: Trajectory) -> tuple[Array, Array]:
    """Return the hinges' angles and rates (n, h): those of the file, or else those commanded."""
    times, others = trajectory.times, trajectory.others or {}
    angles = np.full((len(times), len(scene.hinges)), np.nan)
    rates = angles.copy()
    for i, hinge in enumerate(scene.hinges):
        # The angle of a motor's hinge depends on its load, which the commands do not give.
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
    """Return the engine's label in the file, or one by the file's name where it has none."""
    given = header.get("engine", "") if isinstance(header, dict) else ""
    with contextlib.suppress(InputError), readable(name):
        known = {"marker": "H", **json.loads(given)}  # files of earlier releases have no marker
        return Label(**{each.name: str(known[each.name]) for each in fields(Label)})
    return Label(given or name, "", _COLOUR)
