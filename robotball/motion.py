"""Motion: the result of every engine, with its faults and report.

In order: faults, engine settings, the report, Motion, the four errors of a motion against a
reference with one scale each, and the joining of consecutive parts.
"""

import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from enum import Enum
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robotball.errors import InputError, counted, unknown
from robotball.robot.ball import Value
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, angle_between, rotation_matrix

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""

_PACKAGES = ("robotball", "mujoco", "numpy", "scipy")  # on whose versions numbers depend
# The limits that every engine's run is held to.
DIVERGED = 1e10  # a state beyond it is no result; MuJoCo's own limit (mjMAXVAL)
_LEAST_TIME = 1e-9  # s; the resolution of a clock at best
RATE_ERROR = 1e-3  # relative; a prescribed hinge keeps 1e-13, a servo this good passes


class FaultKind(Enum):
    """Name the kinds of fault, causes before their effects.

    The value of a kind is the sentence that a user reads. In it, {subject} stands for the faulty
    part, and {limit} for the limit that was passed, or {percent}.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.FaultKind.CONTACT_LOST.value
    'contact lost'
    """

    DIVERGED = "the state diverged"
    RESET = "time went back: the engine reset the state"
    CONTACT_LOST = "contact lost"
    CONE_SATURATED = "friction cone saturated"
    RATE_OFF = "a hinge turns more than {percent:g} % too fast or too slow"
    TORQUE_LIMIT = "{subject}'s motor at its torque limit"
    ENGINE_WARNED = "the engine warned of {subject}"
    SLIPPED = "slipped over {limit:g} of the path"
    MOMENTUM_OFF = "M off by over {limit:g}"
    OFF = "path or M off by over {limit:g}, as runs in other steps estimate"
    STEP_TOO_SHORT = "the steps became too short ({subject})"
    OUT_OF_STEPS = "max_steps = {limit:.0f} are taken"


def measured_time(seconds: float) -> float:
    """Return a measured time [s] that can be divided by: a coarse clock may show 0."""
    return max(seconds, _LEAST_TIME)


@dataclass(frozen=True)
class Fault:
    """Describe a fault of a run, and when it begins.

    Attributes
    ----------
    kind : FaultKind
        The kind of the fault.
    time : float, s
        The time at which the fault begins.
    subject : str
        The faulty part, if the sentence of the kind names one.
    limit : float
        The limit that was passed, if the sentence of the kind names one.
    fatal : bool
        Whether the fault ended the run.
    note : bool
        Whether the event belongs to the motion and is no fault. A motor at the limit that its scene
        gives is one.

    Examples
    --------
    >>> import robotball as rb
    >>> print(rb.Fault(rb.FaultKind.SLIPPED, 1.5, limit=1e-3))
    slipped over 0.001 of the path at t = 1.5 s
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
        return self.kind.value.format(
            subject=self.subject, limit=self.limit, percent=100 * self.limit
        )

    def __str__(self) -> str:
        when = f"t = {self.time:.6g} s"
        lasts = self.kind is FaultKind.RATE_OFF
        return f"{self.text} from {when} on" if lasts else f"{self.text} at {when}"


@dataclass(frozen=True, kw_only=True)
class EngineSettings:
    """Hold the settings that all engines have.

    The settings of an engine are a subclass, which adds fields of its own.

    Attributes
    ----------
    name : str
        The name of the settings, for tables and files.
    error_tolerance : float
        The largest relative path error and momentum error that the settings are held to, over 10 s
        on the scenes of the catalog.
    accuracy : float or None
        The path error that the settings were chosen for. None if they were not chosen for one.
    stop_at_fault : bool
        Whether a run ends at its first fault. Otherwise it goes on as long as there is a state.

    Examples
    --------
    >>> import robotball as rb
    >>> settings = rb.preset("fast")
    >>> isinstance(settings, rb.EngineSettings), settings.error_tolerance
    (True, 0.0005)
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
    if name not in [*presets]:
        raise unknown("preset", name, presets)
    return presets[name]


@dataclass(frozen=True)
class Label:
    """The name, version, colour and matplotlib's marker of an engine in tables, plots and films."""

    name: str
    version: str
    colour: str
    marker: str = "H"


def versions() -> dict[str, str]:
    """Return the versions and the machine that the numbers of this process depend on."""
    machine = f"{platform.system()} {platform.machine()}"
    packages = {package: _version_of(package) for package in _PACKAGES}
    return {"python": platform.python_version(), "machine": machine, **packages}


def _version_of(package: str) -> str:
    # A package that is loaded knows its version, whatever is installed beside it.
    loaded = getattr(sys.modules.get(package), "__version__", None)
    return str(loaded or _installed(package))


_installed = cache(version)


@dataclass(frozen=True)
class ContactReport(Value):
    """Report on a contact engine's run.

    Arrays (n,) have one value for each time of the motion.

    Attributes
    ----------
    settings : EngineSettings
        The settings of the run.
    slip : (n,), m/s
        The sliding speed of the shell at the contact.
    spin : (n,), rad/s
        The angular velocity of the shell about the vertical.
    depth : (n,), m
        How deep the shell is in the plane. The lever arm of the contact is shorter by as much.
    friction_used : (n,)
        The fraction of the friction cone that the contact force takes. At 1 the cone is saturated.
        NaN if the engine does not report contact forces.
    hinge_rate_error : (n,)
        The largest error of a rate that is given exactly, relative to it. A motor's lag is none.
    faults : tuple of Fault
        The faults, the earliest first. Empty for a sound run.
    timestep : float, s
        The longest step taken.
    steps : int
        The number of steps taken.
    seconds : float, s
        The processor time of the steps, without the set-up.
    total_seconds : float, s
        The processor time together with the runs that chose or checked the settings.
    estimated_error : float or None
        The estimated path error, relative to the path's length. None if no accuracy was requested.
    notes : tuple of Fault
        Events that belong to the motion and are no faults.
    python_seconds : float or None, s
        The part of `seconds` that Python takes at the steps. None if it is not measured.
    versions : mapping of str to str
        The versions of Python and of packages in the process that ran the engine. That may be one
        of the engine's own environment.

    Examples
    --------
    >>> import robotball as rb
    >>> report = rb.simulate(rb.load_scene("fig12"), 0.5, settings="fast").report
    >>> report.steps, report.faults, bool(report.slip.max() < 1e-3)
    (25, (), True)
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
    versions: Mapping[str, str] = field(default_factory=versions, compare=False)

    def __repr__(self) -> str:
        steps = f"{self.steps} steps of at most {self.timestep:g} s"
        largest = {
            "slip [m/s]": self.slip,
            "spin [rad/s]": self.spin,
            "depth [m]": self.depth,
            "share of the friction cone used": self.friction_used,
            "relative error of a hinge's rate": self.hinge_rate_error,
        }
        # A run that broke off in its first step has none.
        readings = [
            f"largest {name}: {np.max(np.abs(row)):.2g}"
            for name, row in largest.items()
            if row.size
        ]
        faults = [f"fault: {fault}" for fault in self.faults] or ["no fault"]
        notes = [f"note: {note}" for note in self.notes]
        cost = f"{steps}, {self.seconds:.2g} s of processor time"
        head = f"<{type(self).__name__}, {self.settings.name}: {cost}"
        return "\n  ".join([head, *readings, *faults, *notes]) + ">"


@dataclass(frozen=True, repr=False)
class Motion(Value):
    """Hold the motion of a scene's ball, sampled at n times, with h hinges.

    The hinges are the frame's, then the rotors'.

    Attributes
    ----------
    scene : Scene
        The scene that was run.
    engine : Label
        The name, version and colour of the engine that made the motion.
    times : (n,), s
        The sample times. Fewer than requested if the run broke off.
    contact_point : (n, 2), m, world
        The point at which the ball touches the plane.
    attitude : (n, 4), frame to world
        Unit quaternions (w, x, y, z) of the frame.
    momentum : (n, 3), kg m²/s, world
        The angular momentum M of the paper. It is constant in space if the scene keeps it.
    angular_velocity : (n, 3), rad/s, frame axes
        The angular velocity of the frame.
    hinge_angles : (n, h), rad
        The angles of the hinges, from those of the scene's start on.
    hinge_rates : (n, h), rad/s
        The rates of the hinges.
    loads : Loads
        The forces and torques that the motion needs.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.integrate(rb.load_scene("fig12"), 0.5)
    >>> motion.attitude.shape, motion.hinge_rates.shape
    ((26, 4), (26, 2))
    >>> print(f"{motion.path_length:.3f} m")
    1.857 m
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

    def __repr__(self) -> str:
        report = getattr(self, "report", None)
        by = f"{self.engine.name} {self.engine.version}"
        reached = f" to {self.times[-1]:g} s" if len(self.times) else ""
        line = f"{counted(len(self.times), 'time')}{reached}, path {self.path_length:.4g} m"
        if report is not None:
            by += f", {report.settings.name}"
            line += f", {counted(len(report.faults), 'fault') if report.faults else 'no fault'}"
        return f"<{type(self).__name__} of {self.scene.name} by {by}: {line}>"

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
        """Write the motion as .csv, .npz or .parquet. `load_motion` restores every bit.

        The header has the scene's TOML, the engine and the units. The report of a contact engine is
        not written. Raises InputError if the file cannot be written.
        """
        from robotball.files.trajectories import write_motion

        report = getattr(self, "report", None)
        timestep = report.timestep if isinstance(report, ContactReport) else None
        write_motion(Path(path), self.scene, asdict(self.engine), dict(arrays_of(self)), timestep)

    def to_xarray(self) -> Any:
        """Return the motion as an xarray.Dataset over `time`, with units as attributes.

        Vectors in world axes have the dimension `world`, those in frame axes `frame`, so that they
        are not mixed. Raises InputError if the optional package xarray is not installed.
        """
        from robotball.files.trajectories import dataset_of

        return dataset_of(self.scene, asdict(self.engine), dict(arrays_of(self)))


def _gamma_of(attitude: Array) -> Array:
    """Return γ (n, 3) of attitudes (n, 4)."""
    return rotation_matrix(attitude)[:, 2, :]


@dataclass(frozen=True, repr=False)
class ReferenceMotion(Motion):
    """Hold a motion by equations, against which other motions are measured.

    It has the attributes of `Motion` as well.

    Attributes
    ----------
    again : callable
        Returns the contact points (n, 2) of the motion by longer steps [m].
    motor_work : (n, h), J, or None
        The work of the motors since the start. None by the reduced equations.
    rolling_loss : (n,), J, or None
        The work lost to rolling resistance. None by the reduced equations.
    plane_work : (n,), J, or None
        The work of a moving plane on the ball since the start, in space. None by the reduced
        equations.
    ended : str or None
        Which joint's range ended the motion early, and when.

    Examples
    --------
    >>> import robotball as rb
    >>> theory = rb.integrate(rb.load_scene("fig12"), 0.5)
    >>> theory.reference_error < 1e-12
    True
    """

    again: Callable[[], Array] = field(compare=False)
    motor_work: Array | None = None
    rolling_loss: Array | None = None
    plane_work: Array | None = None
    ended: str | None = None

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
    """Hold a motion by a contact engine.

    It has the attributes of `Motion` as well.

    Attributes
    ----------
    report : ContactReport
        The report on the run, with its faults.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.simulate(rb.load_scene("fig12"), 0.5, settings="fast")
    >>> motion.report.settings.name, motion.report.faults
    ('fast', ())
    """

    report: ContactReport


_Extended = TypeVar("_Extended", bound=Motion)


def extended(motion: Motion, kind: type[_Extended], **more: Any) -> _Extended:
    """Return a motion as one of a kind with more fields; fields that are given replace its own."""
    return kind(**{each.name: getattr(motion, each.name) for each in fields(Motion)} | more)


_Place = tuple[str, ...]


def arrays_of(record: Any, place: _Place = ()) -> Iterator[tuple[_Place, NDArray[Any]]]:
    """Yield the arrays over time of a motion or of readings, by their names.

    Those of loads and report are among them.
    """
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

    A ball that turns on the spot has no path. At the start the path is still short while
    regularised friction already slips. The radius is the unit until the path is longer.
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


_Record = TypeVar("_Record")


class Joined(Generic[_Record]):
    """One motion, or other record of arrays over time, of consecutive parts.

    count: of the times in all, at most.

    The parts are written into arrays of the whole length as they come: np.concatenate would hold
    every part beside the whole.
    """

    def __init__(self, count: int) -> None:
        self._count, self._done = count, 0
        self._whole: dict[_Place, NDArray[Any]] = {}
        self._last: _Record | None = None

    def add(self, part: _Record) -> None:
        """Append the next part."""
        arrays = dict(arrays_of(part))
        size = len(next(iter(arrays.values())))
        for place, array in arrays.items():
            if place not in self._whole:
                self._whole[place] = np.empty((self._count, *array.shape[1:]), array.dtype)
            self._whole[place][self._done : self._done + size] = array
        self._done, self._last = self._done + size, part

    @property
    def whole(self) -> _Record:
        """The record of the parts so far, which are one at least."""
        assert self._last is not None
        whole = {place: array[: self._done] for place, array in self._whole.items()}
        record: _Record = with_arrays(self._last, whole)
        return record


def joined(parts: Iterable[_Record], count: int) -> _Record:
    """Return one record of its consecutive parts, as Joined; one part is in memory at a time."""
    parts_so_far = Joined[_Record](count)
    for part in parts:
        parts_so_far.add(part)
    return parts_so_far.whole


def with_arrays(record: Any, arrays: Mapping[_Place, NDArray[Any]]) -> Any:
    """Return the record with these arrays in the place of its own: `arrays_of`, the other way."""
    own: dict[str, Any] = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    for name in {place[0] for place in arrays} - set(own):
        inner = {place[1:]: array for place, array in arrays.items() if place[0] == name}
        own[name] = with_arrays(getattr(record, name), inner)
    return replace(record, **own)
