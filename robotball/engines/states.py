"""The ball for engines of other packages: its links, its states and their readings.

At the start, with hinges at zero, all links have the ball's axes. The shell is the root: the
Jacobian of a contact on the root body has no drift term, and engines omit this term
(docs/findings/mujoco_frame_root.py).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotball.engines.observe import Readings, Recording, attitudes
from robotball.motion import DIVERGED, ContactMotion, EngineSettings, Label, arrays_of, with_arrays
from robotball.robot.ball import Link
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix

_UP = np.array([0.0, 0.0, 1.0])
UNKNOWN_FORCE = np.full(3, np.nan)  # for an engine that does not report the force
_TOGETHER = 64  # balls whose readings are computed together
_LIFTED = 0.01  # radii above the plane at which the shell counts as lifted off


def links_of(scene: Scene) -> tuple[Link, ...]:
    """Return the links of the ball, shell first, with positions relative to their parents.

    `pivot` is relative to the parent's pivot (the shell's pivot is the sphere's centre) and
    `centre` to the link's own pivot [m].
    """
    tree = scene.ball.tree
    pivots = {link.name: link.pivot for link in tree}
    return tuple(
        replace(
            link, centre=link.centre - link.pivot, pivot=link.pivot - pivots.get(link.parent, 0.0)
        )
        for link in tree
    )


def principal_inertia(link: Link) -> tuple[Array, Array]:
    """Return the principal moments (3,) and the quaternion (4,) of their axes."""
    moments, axes = np.linalg.eigh(link.inertia)
    axes = axes if np.linalg.det(axes) > 0 else -axes  # right-handed
    return moments, from_matrix(axes)


def force_on_ball(forces: Iterable[Array]) -> Array:
    """Return the total contact force on the ball (3,), from forces on either body."""
    total = sum(forces, np.zeros(3))
    return total * np.copysign(1.0, total[2])  # the plane pushes the ball up


def force_in(model: Any, data: Any) -> Array:
    """Return the contact force on the ball (3,) [N], world, from MuJoCo's data; 0 if no contact."""
    import mujoco

    wrench, frame = np.zeros(6), data.contact.frame.reshape(-1, 3, 3)
    if data.ncon:
        mujoco.mj_contactForce(model, data, 0, wrench)
    return force_on_ball(wrench[:3] @ axes for axes in frame[:1])


@dataclass(frozen=True)
class State:
    """State of shell and hinges at one time; with a leading axis, at n times or of n balls.

    Attributes
    ----------
    centre : (3,), m, world
        The sphere's centre.
    velocity : (3,), m/s, world
        Velocity of the shell at that point.
    attitude : (4,)
        Quaternion (w, x, y, z) of the shell, shell to world.
    omega : (3,), rad/s, world
        Angular velocity of the shell.
    angles, rates : (h,), rad and rad/s
        Of the frame's hinge first, then of the rotors' hinges in order.
    """

    centre: Array
    velocity: Array
    attitude: Array
    omega: Array
    angles: Array
    rates: Array

    @property
    def row(self) -> Array:
        """All numbers (13 + 2h,), in the order of the fields."""
        parts = (self.centre, self.velocity, self.attitude, self.omega, self.angles, self.rates)
        return np.concatenate(parts, axis=-1)


def _state_of_rows(rows: Array) -> State:
    angles, rates = np.split(rows[:, 13:], 2, axis=1)
    return State(rows[:, :3], rows[:, 3:6], rows[:, 6:10], rows[:, 10:13], angles, rates)


def start_state(scene: Scene) -> State:
    """Return the initial state of the scene, which rolls or has the scene's slip."""
    return State(*(part[0] for part in vars(start_states([scene])).values()))


def start_states(scenes: Sequence[Scene]) -> State:
    """Return the initial states of n scenes that differ only in their starts."""
    scene, starts = scenes[0], [each.start for each in scenes]
    names = ("attitude", "momentum", "slip")
    attitude, momentum, slip = (np.array([getattr(s, name) for s in starts]) for name in names)
    slip = slip + (scene.start_slip - scene.start.slip)  # a turning plane turns a rubber shell
    R, axes = rotation_matrix(attitude), scene.principal_axes
    if scene.not_reduced:
        turning = np.array([scene.angular_velocity_at(start) for start in starts])
    else:
        M, gamma = np.einsum("nji,nj->ni", R, momentum) @ axes, R[:, 2] @ axes
        turning = np.array(scene.parameters_at(0.0).angular_velocity((*M.T,), (*gamma.T,))).T
        turning = turning @ axes.T
    rates = np.array([[float(drive.rate(0.0)) for drive in scene.drives]] * len(starts))
    omega = shell_omega(scene, attitude, turning, rates)
    centre = np.tile(scene.ball.radius * _UP, (len(starts), 1))
    velocity = np.cross(omega, centre) + slip * [1.0, 1.0, 0.0]
    return State(centre, velocity, attitude, omega + slip * _UP, 0.0 * rates, rates)


def shell_omega(scene: Scene, attitude: Array, frame_omega: Array, rates: Array) -> Array:
    """Return the shell's angular velocity (n, 3) [rad/s], world axes.

    The scene gives the angular velocity (n, 3) of the frame, in its axes. The shell turns against
    the frame at the rate of the first hinge, of rates (n, h).
    """
    turned = rates[:, :1].sum(axis=1, keepdims=True) * scene.ball.shell.axis  # 0 without a frame
    return np.einsum("nij,nj->ni", rotation_matrix(attitude), frame_omega - turned)


def readings_of(
    scene: Scene, times: Array, rows: Array, forces: Array, friction: float
) -> Readings:
    """Return the readings of State rows (n, 13 + 2h) at times (n,) [s].

    forces (n, 3) [N]: the plane's forces on the shell in world axes. friction: the contact's
    coefficient. Unknown values are NaN.
    """
    state = _state_of_rows(rows)
    size = np.abs(np.concatenate([state.centre, state.velocity, state.omega], axis=1)).max(1)
    sound = np.isfinite(rows).all(axis=1) & (size <= DIVERGED)
    state = replace(state, attitude=attitudes(state.attitude, sound))
    attitude, omega, L = _frame_and_momentum(scene, state)
    slip = scene.slip_of(times, state.centre[:, :2], state.velocity[:, :2], state.omega)
    loads = replace(Loads.unknown(len(rows), len(scene.drives)), contact_force=forces)
    return Readings(
        time=times,
        centre=state.centre,
        attitude=attitude,
        angular_velocity=np.einsum("nji,nj->ni", rotation_matrix(attitude), omega),
        # (3.1): M = γ×L in the rubber model; the plane's unknown torque acts along γ.
        momentum=np.cross(_UP, L) if scene.rolling == "rubber" else L,
        hinge_angles=state.angles,
        hinge_rates=state.rates,
        loads=loads,
        slip=np.linalg.norm(slip[:, :2], axis=1),
        spin=slip[:, 2],
        friction_used=loads.sliding_friction / friction,
        touching=state.centre[:, 2] <= (1 + _LIFTED) * scene.ball.radius,
        sound=sound,
    )


def link_motions(scene: Scene, state: State) -> Iterator[tuple[Link, Array, Array, Array, Array]]:
    """Yield each link with its attitude, ω, and its pivot's position and velocity, world axes."""
    known: dict[str, tuple[Array, Array, Array, Array]] = {}
    for i, link in enumerate(links_of(scene)):
        q, omega, pivot, velocity = state.attitude, state.omega, state.centre, state.velocity
        if link.parent:
            q, omega, pivot, velocity = known[link.parent]
            angle, rate = state.angles[..., i - 1, None], state.rates[..., i - 1, None]
            R = rotation_matrix(q)
            offset = R @ link.pivot
            pivot, velocity = pivot + offset, velocity + np.cross(omega, offset)
            half = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * link.axis], axis=-1)
            q, omega = multiply(q, half), omega + rate * (R @ link.axis)
        known[link.name] = q, omega, pivot, velocity
        yield link, *known[link.name]


def _frame_and_momentum(scene: Scene, state: State) -> tuple[Array, Array, Array]:
    """Return the frame's attitude and ω, and L about the contact point, in world axes (n, …)."""
    L = np.zeros_like(state.centre)
    for link, q, omega, pivot, pivot_velocity in link_motions(scene, state):
        R = rotation_matrix(q)
        lever = R @ link.centre
        arm = pivot + lever - state.centre * (1.0 - _UP)
        central = np.einsum("nij,jk,nlk,nl->ni", R, link.inertia, R, omega)
        L = L + central + link.mass * np.cross(arm, pivot_velocity + np.cross(omega, lever))
        if link.name in ("shell", "frame"):  # the frame follows the shell, if there is one
            attitude, frame_omega = q, omega
    return attitude, frame_omega, L


def motions_of(
    scenes: Sequence[Scene],
    times: Array,
    rows: Array,
    engine: Label,
    settings: EngineSettings,
    forces: Array = UNKNOWN_FORCE,
    friction: float = float("nan"),
    **cost: Any,
) -> Iterator[ContactMotion]:
    """Yield the motions of scenes that differ in their starts, of State rows (n, k, 13 + 2h).

    The rows are at the first k of times (n,) [s]. forces (k, 3), friction: as in `readings_of`;
    cost: as in `Recording.motion`.
    """
    k = rows.shape[1]
    for i in range(0, len(scenes), _TOGETHER):
        some = rows[i : i + _TOGETHER]
        at = np.tile(times[:k], len(some))
        pushed = np.tile(np.broadcast_to(forces, (k, 3)), (len(some), 1))
        # The numbers of a diverging ball overflow here, before the recording ends.
        with np.errstate(all="ignore"):
            read = readings_of(scenes[i], at, np.concatenate(some), pushed, friction)
            arrays = [*arrays_of(read)]
        for j in range(len(some)):
            recording = Recording(engine, scenes[i + j], settings, times)
            own = {place: array[j * k : (j + 1) * k] for place, array in arrays}
            with np.errstate(all="ignore"):
                recording.add(with_arrays(read, own))
            yield recording.motion(**cost)
