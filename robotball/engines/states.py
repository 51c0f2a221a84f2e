"""The ball as engines of other packages have it: its tree, rows of its states, their readings.

All links have the ball's axes at the start, where hinges are at zero. The shell is the root: as the
body that touches the plane it then has no drift of the contact's Jacobian, which engines leave out
(docs/findings/mujoco_frame_root.py).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotball.engines.observe import Readings, Recording, attitudes
from robotball.motion import DIVERGED, ContactMotion, EngineSettings, Label
from robotball.robot.ball import Link
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix


def links_of(scene: Scene) -> tuple[Link, ...]:
    """Return the bodies of the ball's tree, the shell first, each in its own place.

    Of such a link `pivot` is from its parent's, that of the shell the centre of the sphere, and
    `centre` is from its own pivot.
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
    """Return moments (3,) and their axes' quaternion (4,), for engines that take no tensor."""
    moments, axes = np.linalg.eigh(link.inertia)
    axes = axes if np.linalg.det(axes) > 0 else -axes  # or they would be a reflection
    return moments, from_matrix(axes)


def lifting(forces: Iterable[Array]) -> Array:
    """Return the sum (3,) of a contact's forces, on either body, as that on the ball."""
    total = sum(forces, np.zeros(3))
    return total * np.copysign(1.0, total[2])


def force_in(model: Any, data: Any) -> Array:
    """Return the force (3,) [N] on the ball of the one contact in an MjModel's data, if any."""
    import mujoco

    wrench, frame = np.zeros(6), data.contact.frame.reshape(-1, 3, 3)
    if data.ncon:
        mujoco.mj_contactForce(model, data, 0, wrench)
    return lifting(wrench[:3] @ each for each in frame[:1])


@dataclass(frozen=True)
class State:
    """The state of the shell and the hinges at one time, or at n times or of n balls, a row each.

    centre    (3,) m, world: of the sphere
    velocity  (3,) m/s, world: of the same point of the shell
    attitude  (4,) of the shell, (w, x, y, z), shell to world
    turning   (3,) rad/s, world: of the shell
    angles    (h,) rad, of the frame's hinge, then the rotors'
    rates     (h,) rad/s
    """

    centre: Array
    velocity: Array
    attitude: Array
    turning: Array
    angles: Array
    rates: Array

    @property
    def row(self) -> Array:
        """All numbers (13 + 2h,), in the order of the fields."""
        parts = (self.centre, self.velocity, self.attitude, self.turning, self.angles, self.rates)
        return np.concatenate(parts, axis=-1)


def state_of_rows(rows: Array) -> State:
    """Return the state at n times of rows (n, 13 + 2h)."""
    angles, rates = np.split(rows[:, 13:], 2, axis=1)
    return State(rows[:, :3], rows[:, 3:6], rows[:, 6:10], rows[:, 10:13], angles, rates)


def start_state(scene: Scene) -> State:
    """Return the state of the scene's start on the rolling model."""
    start = scene.start
    rates = np.array([float(drive.rate(0.0)) for drive in scene.drives])
    R = start.to_world
    # A scene gives the frame's ω; the shell turns against it at the first hinge's rate.
    turning = R @ (scene.angular_velocity_at(start) - rates[0] * scene.ball.shell.axis)
    centre = np.array([0.0, 0.0, scene.ball.radius])
    velocity = np.cross(turning, centre)
    return State(centre, velocity, start.attitude, turning, np.zeros(len(rates)), rates)


_UP = np.array([0.0, 0.0, 1.0])
UNKNOWN_FORCE = np.full(3, np.nan)  # of an engine that gives none
_LIFTED = 0.01  # of the radius: a shell this far above the plane has left it


def readings_of(
    scene: Scene, times: Array, rows: Array, forces: Array, friction: float
) -> Readings:
    """Return the readings of rows (n, 13 + 2h) of State at times (n,) [s].

    forces (n, 3) N, world: of the plane on the shell; friction: the contact's coefficient. Both are
    NaN where they are not known.
    """
    state = state_of_rows(rows)
    size = np.abs(np.concatenate([state.centre, state.velocity, state.turning], axis=1)).max(1)
    sound = np.isfinite(rows).all(axis=1) & (size <= DIVERGED)
    state = replace(state, attitude=attitudes(state.attitude, sound))
    attitude, omega, L = _frame_and_momentum(scene, state)
    sliding = state.velocity - scene.ball.radius * np.cross(state.turning, _UP)
    loads = replace(Loads.unknown(len(rows), len(scene.drives)), contact_force=forces)
    return Readings(
        time=times,
        centre=state.centre,
        attitude=attitude,
        angular_velocity=np.einsum("nji,nj->ni", rotation_matrix(attitude), omega),
        # By (3.1) rubber's M = γ×L has no part along γ, in which the plane's torque is unknown.
        momentum=np.cross(_UP, L) if scene.rolling == "rubber" else L,
        hinge_angles=state.angles,
        hinge_rates=state.rates,
        loads=loads,
        slip=np.linalg.norm(sliding[:, :2], axis=1),
        spin=state.turning[:, 2],
        friction_used=loads.sliding_friction / friction,
        touching=state.centre[:, 2] <= (1 + _LIFTED) * scene.ball.radius,
        sound=sound,
    )


def _frame_and_momentum(scene: Scene, state: State) -> tuple[Array, Array, Array]:
    """Return the frame's attitude (n, 4), and its ω (n, 3) and the ball's L (n, 3), world axes.

    L is the angular momentum about the contact point, which is below the centre. It is summed from
    the root outwards: a child's attitude and velocity are its parent's with the hinge's on top.
    """
    arm = state.centre * _UP
    # Of each body by its name: attitude, angular velocity, place of its pivot and velocity there.
    known: dict[str, tuple[Array, Array, Array, Array]] = {}
    L = np.zeros_like(state.centre)
    for i, link in enumerate(links_of(scene)):
        turn, turning, place, moving = state.attitude, state.turning, arm, state.velocity
        if link.parent:
            turn, turning, place, moving = known[link.parent]
            angle, rate = state.angles[:, i - 1, None], state.rates[:, i - 1, None]
            R = rotation_matrix(turn)
            offset = R @ link.pivot
            place, moving = place + offset, moving + np.cross(turning, offset)
            half = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * link.axis], axis=1)
            turn, turning = multiply(turn, half), turning + rate * (R @ link.axis)
        known[link.name] = turn, turning, place, moving
        R = rotation_matrix(turn)
        lever = R @ link.centre
        velocity = moving + np.cross(turning, lever)
        own = np.einsum("nij,jk,nlk,nl->ni", R, link.inertia, R, turning)
        L = L + own + link.mass * np.cross(place + lever, velocity)
    attitude, omega, *_ = known["frame"]
    return attitude, omega, L


def motion_of_rows(
    engine: Label,
    scene: Scene,
    times: Array,
    rows: Array,
    settings: EngineSettings,
    forces: Array = UNKNOWN_FORCE,
    friction: float = float("nan"),
    **cost: Any,
) -> ContactMotion:
    """Return the motion of rows (k, 13 + 2h) of State at the first of times (n,), k <= n [s].

    forces (k, 3), friction: as in `readings_of`; cost: as in `Recording.motion`.
    """
    recording = Recording(engine, scene, settings, times)
    forces = np.broadcast_to(forces, (len(rows), 3))
    # A ball that runs away overflows here, before it is cut off at its fault.
    with np.errstate(all="ignore"):
        recording.add(readings_of(scene, times[: len(rows)], rows, forces, friction))
    return recording.motion(**cost)
