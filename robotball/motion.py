"""Motion: the result of every engine, with its loads, faults and report.

In order: faults, engine settings, the report, loads, Motion, the four errors of a motion against a
reference with one scale each, the joining of consecutive parts, and the loads by Newton and Euler.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robotball import equations as eq
from robotball.ball import Value
from robotball.drives import turns
from robotball.equations import as_vector
from robotball.errors import InputError, unknown
from robotball.rotations import Array, angle_between, rotation_matrix
from robotball.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The limits that every engine's run is held to.
DIVERGED = 1e10  # a state beyond it is no result; MuJoCo's own limit (mjMAXVAL)
RATE_ERROR = 1e-3  # relative; a prescribed hinge keeps 1e-13, a servo this good passes


class FaultKind(Enum):
    """The kinds of fault, each with the sentence that a user reads, causes before their effects.

    {subject} stands for the faulty thing, {limit} for the limit that it passed.
    """

    DIVERGED = "the state diverged"
    RESET = "time went back: the engine reset the state"
    CONTACT_LOST = "contact lost"
    CONE_SATURATED = "friction cone saturated"
    RATE_OFF = "hinge rate off by over {limit:g}"
    TORQUE_LIMIT = "{subject}'s motor at its torque limit"
    ENGINE_WARNED = "the engine warned of {subject}"
    SLIPPED = "slipped over {limit:g} of the path"
    MOMENTUM_OFF = "M off by over {limit:g}"
    STEP_TOO_SHORT = "the steps became too short ({subject})"
    OUT_OF_STEPS = "max_steps = {limit:.0f} are taken"


@dataclass(frozen=True)
class Fault:
    """A fault of a run: its kind, and the time at which it begins [s].

    subject, limit: named by its kind's sentence; fatal: whether it ended the run; note: whether
    it belongs to the motion and is no fault, as a motor at the limit that its scene gives it.
    """

    kind: FaultKind
    time: float
    subject: str = ""
    limit: float = 0.0
    fatal: bool = False
    note: bool = False

    @property
    def text(self) -> str:
        """The sentence, without the time."""
        return self.kind.value.format(subject=self.subject, limit=self.limit)

    def __str__(self) -> str:
        return f"{self.text} at t = {self.time:.6g} s"


@dataclass(frozen=True, kw_only=True)
class EngineSettings:
    """The settings that all engines have; each engine's own are added by a subclass.

    error_tolerance: the largest path error and momentum error, both relative, that the settings
    are held to over 10 s on the scenes of the catalog; accuracy: the path error that they were
    chosen for, if they were; stop_at_fault: end the run at its first fault, or go on as long as
    there is a state.
    """

    name: str
    error_tolerance: float
    accuracy: float | None = None
    stop_at_fault: bool = True

    def plain(self) -> dict[str, Any]:
        """Return the settings as plain data, without those that are None."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            if value is not None
        }


_Preset = TypeVar("_Preset", bound=EngineSettings)


def preset_named(presets: Mapping[str, _Preset], name: str) -> _Preset:
    """Return an engine's preset by name. Raises InputError, with near matches, if there is none."""
    if name not in presets:
        raise unknown("preset", name, presets)
    return presets[name]


@dataclass(frozen=True)
class Label:
    """The name, version and colour of an engine in tables, plots and films."""

    name: str
    version: str
    colour: str


@dataclass(frozen=True)
class ContactReport(Value):
    """A contact engine's report on its run; arrays (n,) are at the motion's times.

    settings         those of the run
    slip             m/s      sliding velocity of the shell at the contact
    spin             rad/s    angular velocity of the shell about the vertical
    depth            m        of the plane in the shell, by which the lever arm is short
    friction_used    fraction of the friction cone that the contact force needs; 1 is saturated
    hinge_rate_error largest error of a hinge's rate, relative to the rate
    faults           the earliest first; empty for a sound run
    notes            events that belong to the motion, as a motor at its limit
    timestep         s, the longest step taken
    steps            taken
    seconds          of processor time that they took, set-up excluded
    total_seconds    the same with the runs that chose the settings, if any did
    estimated_error  of the path, over its length; where an accuracy was requested, else None
    python_seconds   the part of `seconds` that Python takes at every step, where it is measured

    friction_used is NaN where an engine does not report contact forces.
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

    def __repr__(self) -> str:
        from robotball.notebook import report_lines

        return report_lines(self)


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

    @classmethod
    def unknown(cls, times: int, hinges: int) -> "Loads":
        """Return loads that are NaN."""
        return cls(*(np.full(shape, np.nan) for shape in ((times, 3), times, (times, hinges))))

    @property
    def sliding_friction(self) -> Array:
        """The least coefficient of friction (n,) at which the shell does not slip."""
        return _per_newton(np.linalg.norm(self.contact_force[:, :2], axis=1), self.normal_force)

    @property
    def torsional_friction(self) -> Array:
        """The least torsional coefficient (n,) at which the shell does not spin [m]."""
        return _per_newton(np.abs(self.spin_torque), self.normal_force)

    @property
    def normal_force(self) -> Array:
        """The force (n,) of the plane on the shell along its normal [N]."""
        return self.contact_force[:, 2]


def _per_newton(load: Array, normal_force: Array) -> Array:
    # 0 where the ball is off the plane: no friction acts there, and none is needed.
    return np.divide(load, normal_force, out=np.zeros_like(load), where=normal_force > 0)


@dataclass(frozen=True, repr=False)
class Motion(Value):
    """A sampled motion of a scene's ball, with n times, h hinges (the frame's, then the rotors').

    scene                     the scene that was run
    engine                    that made the motion
    times             (n,)    s; fewer than requested where an engine's run broke off
    contact_point     (n, 2)  m, world: where the ball touches the plane
    attitude          (n, 4)  quaternion (w, x, y, z) of the frame, frame to world
    momentum          (n, 3)  kg m²/s, world: the paper's M, which is constant in space
    angular_velocity  (n, 3)  rad/s, of the frame, frame axes
    hinge_angles      (n, h)  rad, from those of the scene's start
    hinge_rates       (n, h)  rad/s
    loads                     forces and torques that the motion needs
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

    # The notebook's pictures are loaded when a motion is displayed; a run needs none of them.

    def __repr__(self) -> str:
        from robotball.notebook import motion_line

        return motion_line(self)

    def _repr_html_(self) -> str:
        from robotball.notebook import motion_cell

        return motion_cell(self)

    def plot(self, *others: "Motion") -> "Figure":
        """Draw its path and momentum, with those of other motions of its scene."""
        from robotball.notebook import picture

        return picture([self, *others])

    @property
    def gamma(self) -> Array:
        """γ (n, 3): the upward vertical, frame axes."""
        return _gamma_of(self.attitude)

    @property
    def motor_powers(self) -> Array:
        """The power (n, h) of the motors [W]."""
        return self.loads.motor_torques * self.hinge_rates

    @property
    def path_length(self) -> float:
        """The length of the sampled contact-point path [m]."""
        return float(np.linalg.norm(np.diff(self.contact_point, axis=0), axis=1).sum())

    @property
    def path_scale(self) -> float:
        """The unit of relative path errors [m]: `path_unit` of the whole path."""
        return float(path_unit(self.scene, self.path_length))

    def save(self, path: str | Path) -> None:
        """Write the motion as .csv, .npz or .parquet; `load_motion` restores every bit.

        The header has the scene's TOML, the engine and the units; a contact engine's report is
        left out. Raises InputError where the file cannot be written.
        """
        from robotball.files.trajectories import write_motion

        report = getattr(self, "report", None)
        timestep = report.timestep if isinstance(report, ContactReport) else None
        write_motion(Path(path), self.scene, asdict(self.engine), dict(arrays_of(self)), timestep)


def _gamma_of(attitude: Array) -> Array:
    """Return γ (n, 3) of attitudes (n, 4)."""
    return rotation_matrix(attitude)[:, 2, :]


@dataclass(frozen=True, repr=False)
class ReferenceMotion(Motion):
    """A motion by equations, against which others are measured, with an estimate of its error.

    again               returns the contact points (n, 2) of the motion by longer steps [m]
    motor_work  (n, h)  work of the motors since the start [J]; None by the reduced equations
    rolling_loss  (n,)  work lost to rolling resistance [J]; None by the reduced equations
    """

    again: Callable[[], Array] = field(compare=False)
    motor_work: Array | None = None
    rolling_loss: Array | None = None

    @cached_property
    def reference_error(self) -> float:
        """The motion's own path error over its `path_scale`, estimated by integrating again.

        The second motion has longer steps; it is computed at the first use of this property. The
        estimate is at least a few roundings, as two motions may agree by chance. Against steps in
        80-bit numbers, the error was 0.06 to 2.1 of it on the catalog's steady scenes.
        """
        off = _distances(self.contact_point, self.again())
        return max(float(off.max() / self.path_scale), 4 * float(np.finfo(float).eps))


@dataclass(frozen=True, repr=False)
class ContactMotion(Motion):
    """A motion by a contact engine, with its report."""

    report: ContactReport


_Extended = TypeVar("_Extended", bound=Motion)


def extended(motion: Motion, kind: type[_Extended], **more: Any) -> _Extended:
    """Return a motion as one of a kind with more fields; fields that are given replace its own."""
    return kind(**{each.name: getattr(motion, each.name) for each in fields(Motion)} | more)


_Place = tuple[str, ...]


def arrays_of(record: Any, place: _Place = ()) -> Iterator[tuple[_Place, NDArray[Any]]]:
    """Yield the arrays over time of a motion, of its loads and of its report, by their names."""
    for each in fields(record):
        value = getattr(record, each.name)
        if isinstance(value, np.ndarray):
            yield (*place, each.name), value
        elif isinstance(value, Loads | ContactReport):
            yield from arrays_of(value, (*place, each.name))


# Long motions are made and measured in pieces: temporaries of a whole one would need more memory
# than the motion itself. The length is a multiple of what BLAS takes at once; else the last bits of
# a result would depend on where it is cut.
PIECE = 65_536  # samples


def pieces(count: int) -> Iterator[slice]:
    """Yield the consecutive pieces of `count` samples, of PIECE at most."""
    for i in range(0, count, PIECE):
        yield slice(i, min(i + PIECE, count))


# The errors of a motion against a reference, whose times have the motion's times among them.


_TOLERATED = 10.0  # s, the run for which an error tolerance is stated
_LOOSEST = 1e-2  # to which a tolerance is stretched over a longer run


def tolerated(tolerance: float, times: ArrayLike) -> Array:
    """Return the momentum error that is tolerated by each of the times [s], growing with them.

    Every step loses or gains its part of M, so an error of M grows with time. A tolerance is stated
    for ten seconds; a longer run has more in proportion, up to 1e-2.
    """
    stretched = tolerance * np.maximum(1.0, np.asarray(times) / _TOLERATED)
    return np.minimum(stretched, max(tolerance, _LOOSEST))


def path_unit(scene: Scene, length: ArrayLike) -> Array:
    """Return the unit of errors and slip along paths of these lengths [m]: at least the radius.

    A ball that turns on the spot has no path. One that starts from rest has none yet, and a contact
    that regularizes friction slips from the first step on.
    """
    return np.maximum(length, scene.ball.radius)


def slip_with_spin(scene: Scene, slip: Array, spin: Array) -> Array:
    """Return the slip (n,) that is held to the path [m/s]: with a rubber ball's spin at its radius.

    slip: m/s; spin: rad/s, about the vertical.
    """
    return slip + scene.ball.radius * np.abs(spin) if scene.rolling == "rubber" else slip


def path_errors(motion: Motion, reference: Motion) -> Array:
    """Return the distances (n,) of the two contact points at the motion's times [m]."""
    return _distances(motion.contact_point, reference.contact_point[_shared(motion, reference)])


def path_error(motion: Motion, reference: Motion) -> float:
    """Return the largest of `path_errors` over the reference's `path_scale`."""
    return float(path_errors(motion, reference).max() / reference.path_scale)


def attitude_error(motion: Motion, reference: Motion) -> float:
    """Return the largest angle by which the two frames are turned against each other [rad]."""
    return _largest(angle_between, motion, reference)


def gamma_error(motion: Motion, reference: Motion) -> float:
    """Return the largest angle between the two verticals, seen from the frame [rad]."""

    def angles(ours: Array, theirs: Array) -> Array:
        one, other = _gamma_of(ours), _gamma_of(theirs)
        sine = np.linalg.norm(np.cross(one, other), axis=1)
        return np.arctan2(sine, (one * other).sum(axis=1))

    return _largest(angles, motion, reference)


def momentum_errors(motion: Motion, reference: Motion) -> Array:
    """Return |M - M of the reference| (n,) over its scene's `momentum_scale`."""
    theirs = reference.momentum[_shared(motion, reference)]
    return _distances(motion.momentum, theirs) / reference.scene.momentum_scale


def momentum_error(motion: Motion, reference: Motion) -> float:
    """Return the largest of `momentum_errors`."""
    return float(momentum_errors(motion, reference).max())


def _distances(ours: Array, theirs: Array) -> Array:
    return np.linalg.norm(ours - theirs, axis=1)


def _largest(angles: Callable[[Array, Array], Array], motion: Motion, reference: Motion) -> float:
    """Return the largest of the angles between the attitudes of two motions [rad]."""
    ours, theirs = motion.attitude, reference.attitude[_shared(motion, reference)]
    return max(float(angles(ours[each], theirs[each]).max()) for each in pieces(len(ours)))


def _shared(motion: Motion, reference: Motion) -> NDArray[np.intp] | slice:
    """Return the places (n,) of the motion's times among the reference's."""
    # A slice is a view: the usual motion, at all of the reference's times, copies nothing.
    first = slice(len(motion.times))
    if np.array_equal(reference.times[first], motion.times):
        return first
    places = np.searchsorted(reference.times, motion.times)
    found = reference.times[np.minimum(places, len(reference.times) - 1)]
    if not np.array_equal(found, motion.times):
        missing = float(motion.times[found != motion.times][0])
        raise InputError(f"t = {missing:g} s of the motion is no time of the reference")
    return places


_AnyMotion = TypeVar("_AnyMotion", bound=Motion)


class Joined(Generic[_AnyMotion]):
    """One motion of consecutive parts, of `count` times at most in all.

    The parts are written into arrays of the whole length as they come: np.concatenate would hold
    every part beside the whole.
    """

    def __init__(self, count: int) -> None:
        self._count, self._done = count, 0
        self._whole: dict[_Place, NDArray[Any]] = {}
        self._last: _AnyMotion | None = None

    def add(self, part: _AnyMotion) -> None:
        """Append the next part."""
        size = len(part.times)
        for place, array in arrays_of(part):
            if size == self._count:  # the only part, which need not be copied
                self._whole[place] = array
                continue
            if place not in self._whole:
                self._whole[place] = np.empty((self._count, *array.shape[1:]), array.dtype)
            self._whole[place][self._done : self._done + size] = array
        self._done, self._last = self._done + size, part

    @property
    def motion(self) -> _AnyMotion:
        """The motion of the parts so far, which are one at least."""
        assert self._last is not None
        whole = {place: array[: self._done] for place, array in self._whole.items()}
        motion: _AnyMotion = _with_arrays(self._last, whole)
        return motion


def joined(parts: Iterable[_AnyMotion], count: int) -> _AnyMotion:
    """Return one motion of its consecutive parts, as Joined; one part is in memory at a time."""
    whole = Joined[_AnyMotion](count)
    for part in parts:
        whole.add(part)
    return whole.motion


def _with_arrays(record: Any, arrays: Mapping[_Place, NDArray[Any]]) -> Any:
    """Return the record with these arrays in the place of its own: `arrays_of`, the other way."""
    own: dict[str, Any] = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    for name in {place[0] for place in arrays} - set(own):
        inner = {place[1:]: array for place, array in arrays.items() if place[0] == name}
        own[name] = _with_arrays(getattr(record, name), inner)
    return replace(record, **own)


def loads_of(scene: Scene, times: Array, axes: Array, omega: Array) -> Loads:
    """Return the loads that the constraints (2.1), (2.2) and the drives need, by Newton and Euler.

    The angular acceleration comes from the unreduced equations (2.4)-(2.5). times (n,) s; axes
    (n, 3, 3) from principal axes to world; omega (n, 3) of the frame, in principal axes [rad/s].
    """
    ball, to_principal = scene.ball, scene.principal_axes.T
    rates = np.stack([drive.rate(times) for drive in scene.drives])
    accelerations = np.stack([drive.acceleration(times) for drive in scene.drives])
    hinges = to_principal @ np.stack([ball.shell.axis, *(r.axis for r in ball.rotors)], axis=1)
    gyrostatic_inertia = to_principal @ ball.gyrostatic_inertia
    Omega, Omega_rate = np.outer(hinges[:, 0], rates[0]), np.outer(hinges[:, 0], accelerations[0])
    gamma = axes[:, 2, :].T
    rate, spin_torque = eq.full_angular_acceleration(
        tuple(omega.T),
        tuple(gamma),
        tuple(Omega),
        tuple(Omega_rate),
        tuple(gyrostatic_inertia @ rates),
        tuple(gyrostatic_inertia @ accelerations),
        as_vector(ball.principal[0]),
        ball.d,
        spin_free=scene.rolling == "rubber",
    )
    spin_torque = np.broadcast_to(np.float64(spin_torque), times.shape)
    omega_rate, w = np.array(rate), omega.T

    # Seen from the frame, the shell is symmetric about its hinge, so that its inertia is constant
    # there while it turns.
    turning, turning_rate = w - Omega, omega_rate - Omega_rate
    acceleration = ball.radius * _cross(turning_rate - _cross(w, Omega), gamma)
    force = ball.mass * (acceleration + scene.gravity * gamma)
    shell_inertia = to_principal @ ball.shell.inertia @ to_principal.T
    shell_momentum_rate = shell_inertia @ turning_rate + _cross(w, shell_inertia @ turning)
    # Euler's equation of the shell about its centre: the torque that the plane does not give is the
    # frame's motor's.
    from_plane = spin_torque * gamma - ball.radius * _cross(gamma, force)
    frame_torque = hinges[:, 0] @ (from_plane - shell_momentum_rate)
    moving = np.array([turns(drive) for drive in scene.drives])
    # Along its axis a symmetric rotor has I (dω/dt, n) + I φ̈: the gyroscopic torque is across it.
    rotor_inertias = np.array([rotor.axial_inertia for rotor in ball.rotors])[:, None]
    rotor_torques = rotor_inertias * (hinges[:, 1:].T @ omega_rate + accelerations[1:])
    return Loads(
        contact_force=np.einsum("nij,jn->ni", axes, force),
        spin_torque=spin_torque,
        motor_torques=np.column_stack([frame_torque, rotor_torques.T]) * moving,
    )


def _cross(u: Array, v: Array) -> Array:
    """Return the columns (3, n) of u × v."""
    return np.cross(u, v, axis=0)
