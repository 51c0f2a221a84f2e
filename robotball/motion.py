"""Motion: what every engine returns, and how far two motions of one scene are apart."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball.errors import InputError
from robotball.faults import Fault
from robotball.room import let_go
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from robotball.scene import Scene
from robotball.settings import EngineSettings
from robotball.shown import Shown
from robotball.value import Value


@dataclass(frozen=True)
class Label:
    """What an engine is called in tables, plots and films: its name, version and colour."""

    name: str
    version: str
    colour: str


@dataclass(frozen=True)
class ContactReport(Value):
    """What a contact engine did besides moving the ball; arrays (n,) are at the motion's times.

    settings         those of the run
    slip             m/s      sliding velocity of the shell at the contact
    spin             rad/s    angular velocity of the shell about the vertical
    depth            m        of the plane in the shell, by which the lever arm is short
    friction_used    fraction of the friction cone that the contact force needs; 1 is saturated
    hinge_rate_error largest error of a hinge's rate, relative to the rate
    faults           what went wrong, the earliest first; empty for a sound run
    notes            what belongs to the motion and is worth telling, as a motor at its limit
    timestep         s, the longest step taken
    steps            taken
    seconds          of processor time that they took, set-up excluded
    total_seconds    the same with the runs that chose the settings, if any did
    estimated_error  of the path, over its length; where an accuracy was requested, else None
    python_seconds   of `seconds`, what Python does at every step, where that is told apart

    friction_used is NaN where an engine does not tell it.
    """

    settings: EngineSettings
    slip: Array
    spin: Array
    depth: Array
    friction_used: Array
    hinge_rate_error: Array
    faults: tuple[Fault, ...]
    timestep: float
    steps: int
    seconds: float = field(compare=False)
    total_seconds: float = field(compare=False)
    estimated_error: float | None = None
    notes: tuple[Fault, ...] = ()
    python_seconds: float | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Loads(Value):
    """Forces and torques at n times, on h hinges (the frame's, then the rotors').

    contact_force  (n, 3)  N, world: of the plane on the shell, the normal force last
    spin_torque    (n,)    N m: λ₀, of the plane on the shell about the vertical
    motor_torques  (n, h)  N m: of the shell on the frame and of the frame on the rotors, along
                           the hinges; 0 where a hinge never turns
    """

    contact_force: Array
    spin_torque: Array
    motor_torques: Array

    @property
    def sliding_friction(self) -> Array:
        """(n,): the least coefficient of friction at which the shell does not slip."""
        return _per_newton(np.linalg.norm(self.contact_force[:, :2], axis=1), self.normal_force)

    @property
    def torsional_friction(self) -> Array:
        """(n,) m: the least torsional coefficient at which the shell does not spin."""
        return _per_newton(np.abs(self.spin_torque), self.normal_force)

    @property
    def normal_force(self) -> Array:
        """(n,) N."""
        return self.contact_force[:, 2]


def _per_newton(load: Array, normal_force: Array) -> Array:
    return np.divide(load, normal_force, out=np.zeros_like(load), where=normal_force > 0)


@dataclass(frozen=True, repr=False)
class Motion(Shown, Value):
    """A sampled motion of a scene's ball, with n times, h hinges (the frame's, then the rotors').

    scene                     what moved
    engine                    who says so
    times             (n,)    s; fewer than requested where an engine's run broke off
    contact_point     (n, 2)  m, world: where the ball touches the plane
    attitude          (n, 4)  quaternion (w, x, y, z) of the frame, frame to world
    momentum          (n, 3)  kg m²/s, world: the paper's M, which is constant in space
    angular_velocity  (n, 3)  rad/s, of the frame, frame axes
    hinge_angles      (n, h)  rad, from those of the scene's start
    hinge_rates       (n, h)  rad/s
    loads             what the motion asks of the plane and of the motors
    """

    scene: Scene
    engine: Label
    times: Array
    contact_point: Array
    attitude: Array
    momentum: Array
    angular_velocity: Array
    hinge_angles: Array
    hinge_rates: Array
    loads: Loads

    @property
    def gamma(self) -> Array:
        """γ (n, 3): the upward vertical, frame axes."""
        return gamma_of(self.attitude)

    @property
    def motor_powers(self) -> Array:
        """(n, h) W: what the motors put in."""
        return self.loads.motor_torques * self.hinge_rates

    @property
    def path_length(self) -> float:
        """The length of the sampled contact-point path [m]."""
        return float(np.linalg.norm(np.diff(self.contact_point, axis=0), axis=1).sum())

    @property
    def path_scale(self) -> float:
        """What path errors are measured by: the path's length or the radius, the longer [m].

        A ball that turns on the spot has no path.
        """
        return max(self.path_length, self.scene.ball.radius)

    def save(self, path: str | Path) -> None:
        """Write it as .csv, .npz or .parquet, from which `load_motion` has every bit again.

        The header has the scene's TOML, the engine and the units; a contact engine's report is
        left out. Raises InputError where the file cannot be written.
        """
        from robotball.files.motion_file import write_motion

        report = getattr(self, "report", None)
        timestep = report.timestep if isinstance(report, ContactReport) else None
        write_motion(Path(path), self.scene, asdict(self.engine), dict(arrays_of(self)), timestep)


def gamma_of(attitude: Array) -> Array:
    """γ (n, 3) of attitudes (n, 4)."""
    return rotation_matrix(attitude)[:, 2, :]


@dataclass(frozen=True, repr=False)
class ReferenceMotion(Motion):
    """A motion that others are measured by, and that knows how good it is itself.

    again               the contact points (n, 2) of the same motion, made by longer steps [m]
    motor_work  (n, h)  J: what the motors have put in since the start; None of the small equations
    rolling_loss  (n,)  J: what the plane's resistance to rolling has taken; None likewise
    """

    again: Callable[[], Array] = field(compare=False)
    motor_work: Array | None = None
    rolling_loss: Array | None = None

    @cached_property
    def reference_error(self) -> float:
        """The motion's own path error, over its `path_scale`, as other steps tell it.

        Taken when it is first asked for, in the time of another motion. At least a few roundings,
        as two motions may agree by chance. Measured 0.06 to 2.1 of the estimate on the catalog's
        steady scenes, against steps in 80-bit numbers.
        """
        off = np.linalg.norm(self.contact_point - self.again(), axis=1)
        return max(float(off.max() / self.path_scale), 4 * float(np.finfo(float).eps))


@dataclass(frozen=True, repr=False)
class ContactMotion(Motion):
    """A motion by a contact engine, with its report."""

    report: ContactReport


Place = tuple[str, ...]


def arrays_of(record: Any, place: Place = ()) -> Iterator[tuple[Place, NDArray[Any]]]:
    """The arrays over the times of a motion, of its loads and of its report, by their names."""
    for each in fields(record):
        value = getattr(record, each.name)
        if isinstance(value, np.ndarray):
            yield (*place, each.name), value
        elif isinstance(value, Loads | ContactReport):
            yield from arrays_of(value, (*place, each.name))


# Long motions are made and measured in pieces, so that what is needed on the way stays small.

PIECE = 65_536  # samples; a multiple of what BLAS takes at once, or last bits would change


def pieces(count: int) -> Iterator[slice]:
    """Consecutive slices over `count` samples; memory is given back of each after its use."""
    for i in range(0, count, PIECE):
        yield slice(i, min(i + PIECE, count))
        let_go()


# How far a motion is from a reference, whose times have the motion's times among them.


def path_errors(motion: Motion, reference: Motion) -> Array:
    """(n,) m: the distance between the two contact points, at the motion's times."""
    ours, theirs = motion.contact_point, reference.contact_point[_shared(motion, reference)]
    errors = np.empty(len(ours))
    for piece in pieces(len(ours)):
        errors[piece] = np.linalg.norm(ours[piece] - theirs[piece], axis=1)
    return errors


def path_error(motion: Motion, reference: Motion) -> float:
    """The largest of `path_errors` over the reference's `path_scale`."""
    return float(path_errors(motion, reference).max() / reference.path_scale)


def attitude_error(motion: Motion, reference: Motion) -> float:
    """The largest angle by which the two frames are turned against each other [rad]."""
    there, largest = reference.attitude[_shared(motion, reference)], []
    for piece in pieces(len(motion.times)):
        turn = multiply(conjugate(there[piece]), motion.attitude[piece])
        half = np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0]))
        largest.append((2 * half).max())
    return float(max(largest))


def gamma_error(motion: Motion, reference: Motion) -> float:
    """The largest angle between the two verticals, seen from the frame [rad]."""
    there, largest = reference.attitude[_shared(motion, reference)], []
    for piece in pieces(len(motion.times)):
        ours, theirs = gamma_of(motion.attitude[piece]), gamma_of(there[piece])
        sine = np.linalg.norm(np.cross(ours, theirs), axis=1)
        largest.append(np.arctan2(sine, (ours * theirs).sum(axis=1)).max())
    return float(max(largest))


def momentum_errors(motion: Motion, reference: Motion) -> Array:
    """(n,): |M - M of the reference| over the scene's `momentum_scale`, at the motion's times."""
    ours, theirs = motion.momentum, reference.momentum[_shared(motion, reference)]
    errors = np.empty(len(ours))
    for piece in pieces(len(ours)):
        off = np.linalg.norm(ours[piece] - theirs[piece], axis=1)
        errors[piece] = off / reference.scene.momentum_scale
    return errors


def momentum_error(motion: Motion, reference: Motion) -> float:
    """The largest of `momentum_errors`."""
    return float(momentum_errors(motion, reference).max())


def _shared(motion: Motion, reference: Motion) -> NDArray[np.intp] | slice:
    """The places (n,) of the motion's times among the reference's."""
    first = slice(len(motion.times))
    if np.array_equal(reference.times[first], motion.times):
        return first
    places = np.searchsorted(reference.times, motion.times)
    found = reference.times[np.minimum(places, len(reference.times) - 1)]
    if not np.array_equal(found, motion.times):
        missing = float(motion.times[found != motion.times][0])
        raise InputError(f"t = {missing:g} s of the motion is no time of the reference")
    return places
