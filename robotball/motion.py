"""Motion, the result of every engine: faults, report, and errors against a reference."""

import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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

_PACKAGES = ("robotball", "mujoco", "numpy", "scipy")  # their versions affect the numbers
# Limits for the runs of every engine.
DIVERGED = 1e10  # SI units: a larger state value means divergence, like MuJoCo's mjMAXVAL
_LEAST_TIME = 1e-9  # s, the resolution of an accurate clock
RATE_ERROR = 1e-3  # relative, of a hinge rate; prescribed rates reach 1e-13, servos 1e-3
_TOLERANCE_TIME = 10.0  # s, the duration for which an error tolerance is stated
_LOOSEST = 1e-2  # upper limit of a tolerance for longer runs
# Long motions are processed in pieces, because temporary arrays of a whole motion would need more
# memory than the motion. The length is a multiple of BLAS's block size, so that results do not
# depend on where a motion is cut.
_PIECE = 65_536  # samples

_Preset = TypeVar("_Preset", bound="EngineSettings")
_Record = TypeVar("_Record")
_ArrayPath = tuple[str, ...]  # names of nested fields, such as ("loads", "motor_torques")

_installed_version = cache(version)


class FaultKind(Enum):
    """List the kinds of fault, each cause before its effects.

    The value of a kind is the text that the user reads. In the text, {subject} stands for the
    faulty part, and {limit} or {percent} for the limit that was exceeded.

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
    OFF = "estimated path or momentum error over {limit:g}"
    STEP_TOO_SHORT = "the steps became too short ({subject})"


def measured_time(seconds: float) -> float:
    """Return a measured time [s] that is safe to divide by: a coarse clock may read 0."""
    return max(seconds, _LEAST_TIME)


@dataclass(frozen=True)
class Fault:
    """Describe a fault of a run.

    Attributes
    ----------
    kind : FaultKind
        The kind of fault.
    time : float, s
        When the fault begins.
    subject : str
        The faulty part, if the text of the kind names one.
    limit : float
        The limit that was exceeded, if the text of the kind names one.
    fatal : bool
        Whether the fault ended the run.
    note : bool
        True for an event that is part of the motion and not a fault, such as a motor at the torque
        limit that its scene specifies.

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
        """The text of the fault, without the time."""
        numbers = {"limit": self.limit, "percent": 100 * self.limit}
        return self.kind.value.format(subject=self.subject, **numbers)

    def __str__(self) -> str:
        when = f"t = {self.time:.6g} s"
        persists = self.kind is FaultKind.RATE_OFF
        return f"{self.text} from {when} on" if persists else f"{self.text} at {when}"


@dataclass(frozen=True, kw_only=True)
class EngineSettings:
    """Hold the settings that all engines share. Each engine adds its own in a subclass.

    Attributes
    ----------
    name : str
        The name of the settings, for tables and files.
    error_tolerance : float
        Limit of the relative path error and of the relative momentum error in 10 s on a catalog
        scene.
    accuracy : float or None
        The path error for which the settings were chosen. None if they were not chosen for one.
    stop_at_fault : bool
        True if a run ends at its first fault. If False, a run continues while its state is finite.

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
        """Return the settings as JSON-compatible data. Settings that are None are left out."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            if value is not None
        }


def preset_named(presets: Mapping[str, _Preset], name: str) -> _Preset:
    """Return a preset by name. Raises InputError, with near matches, if the name is unknown."""
    if name not in [*presets]:
        raise unknown("preset", name, presets)
    return presets[name]


@dataclass(frozen=True)
class Label:
    """Identify an engine in tables, plots and films: name, version, colour, matplotlib marker."""

    name: str
    version: str
    colour: str
    marker: str = "H"


def versions() -> dict[str, str]:
    """Return the machine and package versions that this process's numbers depend on."""
    machine = f"{platform.system()} {platform.machine()}"
    packages = {package: _version_of(package) for package in _PACKAGES}
    return {"python": platform.python_version(), "machine": machine, **packages}


def _version_of(package: str) -> str:
    # Prefer the loaded package: a different version may be installed.
    loaded = getattr(sys.modules.get(package), "__version__", None)
    return str(loaded or _installed_version(package))


@dataclass(frozen=True)
class ContactReport(Value):
    """Report on a contact engine's run. Arrays (n,) hold one value per sample of the motion.

    Attributes
    ----------
    settings : EngineSettings
        The settings of the run.
    slip : (n,), m/s
        The sliding speed of the shell at the contact.
    spin : (n,), rad/s
        The angular velocity of the shell about the vertical.
    depth : (n,), m
        Penetration of the shell into the plane. It shortens the lever arm of the contact.
    friction_used : (n,)
        The friction force as a fraction of its limit, the friction cone; 1 at the limit. NaN if the
        engine does not report contact forces.
    hinge_rate_error : (n,)
        The largest relative error of a prescribed hinge rate. The lag of a motor behind its command
        does not count.
    faults : tuple of Fault
        The faults, earliest first. Empty for a run without faults.
    timestep : float, s
        The longest step taken.
    steps : int
        The number of steps taken.
    seconds : float, s
        Processor time of the steps, without set-up.
    total_seconds : float, s
        Processor time including set-up runs that chose or checked the settings.
    estimated_error : float or None
        The estimated path error, relative to the path length. None if no accuracy was requested.
    notes : tuple of Fault
        Events that are part of the motion and not faults.
    python_seconds : float or None, s
        The part of `seconds` spent in Python code, including the engine's Python code. None if it
        was not measured.
    versions : mapping of str to str
        Versions of Python and packages in the process that ran the engine. The engine may have a
        Python environment of its own.

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
        # A run that ended in its first step has no samples.
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
    """Hold the motion of a scene's ball at n sample times, with h hinges.

    The hinges are in the order of `Ball.hinges`.

    Attributes
    ----------
    scene : Scene
        The scene that was run.
    engine : Label
        The engine that computed the motion.
    times : (n,), s
        The sample times. Fewer than requested if the run ended early.
    contact_point : (n, 2), m, world
        The point at which the ball touches the plane.
    attitude : (n, 4), frame to world
        Unit quaternions (w, x, y, z) of the frame.
    momentum : (n, 3), kg m²/s, world
        The paper's angular momentum M. It is constant if `scene.keeps_momentum`.
    angular_velocity : (n, 3), rad/s, frame axes
        The angular velocity of the frame.
    hinge_angles : (n, h), rad
        The hinge angles, which start at the scene's initial angles.
    hinge_rates : (n, h), rad/s
        The hinge rates.
    loads : Loads
        The forces and torques that the motion requires.
    calls : sequence of mappings of str to float
        One mapping for each call of the scene's controller. It has the readings and commands by
        name, such as `time`, `gyro[0]`, `rates[frame]` and `command[frame]`.

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
    calls: Sequence[Mapping[str, float]] = field(default=(), kw_only=True, compare=False)

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
        """Upward unit vertical γ (n, 3), frame axes."""
        return _gamma_of(self.attitude)

    @property
    def motor_powers(self) -> Array:
        """Motor powers (n, h) [W]."""
        return self.loads.motor_torques * self.hinge_rates

    @property
    def path_length(self) -> float:
        """Length of the sampled contact-point path [m]."""
        return float(np.linalg.norm(np.diff(self.contact_point, axis=0), axis=1).sum())

    @property
    def path_scale(self) -> float:
        """The length by which path errors are divided [m]: `path_unit` of the whole path."""
        return float(path_unit(self.scene, self.path_length))

    def save(self, path: str | Path) -> None:
        """Write the motion as .csv, .npz or .parquet. `load_motion` restores it to the last bit.

        The header holds the scene's TOML, the engine and the units. A contact engine's report is
        not written. Raises InputError if the file cannot be written.
        """
        from robotball.files.trajectories import write_motion

        report = getattr(self, "report", None)
        timestep = report.timestep if isinstance(report, ContactReport) else None
        write_motion(Path(path), self.scene, asdict(self.engine), dict(arrays_of(self)), timestep)

    def to_xarray(self) -> Any:
        """Return the motion as an xarray.Dataset over `time`, with units as attributes.

        Vectors in world axes have the dimension `world`, and vectors in frame axes the dimension
        `frame`, so that xarray does not mix them. Raises InputError if the optional package xarray
        is not installed.
        """
        from robotball.files.trajectories import dataset_of

        return dataset_of(self.scene, asdict(self.engine), dict(arrays_of(self)))


def _gamma_of(attitude: Array) -> Array:
    return rotation_matrix(attitude)[:, 2, :]


@dataclass(frozen=True, repr=False)
class ReferenceMotion(Motion):
    """Hold a motion computed with the equations, the reference for other motions.

    A `ReferenceMotion` also has the attributes of `Motion`.

    Attributes
    ----------
    again : callable
        Integrates the motion with longer steps and returns the contact points (n, 2) [m].
    motor_work : (n, h), J, or None
        Cumulative work of the motors. None if the motion was computed with the reduced equations.
    rolling_loss : (n,), J, or None
        Cumulative loss to rolling resistance. None as for `motor_work`.
    plane_work : (n,), J, or None
        Cumulative work that a moving or turning plane does on the ball, in world axes. None as for
        `motor_work`.
    slip : (n, 3) or None
        Slip relative to the plane: velocity of the shell's point at the contact along X and Y
        [m/s], and spin of a rubber shell about the vertical [rad/s]. None if the shell never slips.
    slipping : tuple of (float, float), s
        The time intervals in which the shell slips.
    friction_loss : (n,), J, or None
        Cumulative loss to sliding and torsional friction. None if the shell never slips.
    ended : str or None
        The joint limit that ended the motion early, and the time. None for a complete motion.

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
    slip: Array | None = None
    slipping: tuple[tuple[float, float], ...] = ()
    friction_loss: Array | None = None
    ended: str | None = None

    @cached_property
    def reference_error(self) -> float:
        """Estimated path error of this motion, divided by `path_scale`.

        On first use, the motion is integrated again with longer steps, and the difference is the
        estimate. It is at least 4 machine epsilons, because two integrations may agree by chance.
        On the steady scenes of the catalog, the true error, measured with an integration in 80-bit
        arithmetic, was 0.06 to 2.1 times the estimate.
        """
        off = _distances(self.contact_point, self.again())
        return max(float(off.max() / self.path_scale), 4 * float(np.finfo(float).eps))


@dataclass(frozen=True, repr=False)
class ContactMotion(Motion):
    """Hold a motion simulated with a contact engine.

    A `ContactMotion` also has the attributes of `Motion`.

    Attributes
    ----------
    report : ContactReport
        The report on the run, which lists the faults.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.simulate(rb.load_scene("fig12"), 0.5, settings="fast")
    >>> motion.report.settings.name, motion.report.faults
    ('fast', ())
    """

    report: ContactReport


def extended(record: Any, kind: Any, **more: Any) -> Any:
    """Return a record of class `kind` with the fields that both have, and with more fields."""
    names = {field.name for field in fields(record)} & {field.name for field in fields(kind)}
    return kind(**{name: getattr(record, name) for name in names} | more)


def arrays_of(record: Any, path: _ArrayPath = ()) -> Iterator[tuple[_ArrayPath, NDArray[Any]]]:
    """Yield the time-dependent arrays of a motion or readings, including loads and report."""
    for member in fields(record):
        value = getattr(record, member.name)
        if isinstance(value, np.ndarray):
            yield (*path, member.name), value
        elif isinstance(value, Loads | ContactReport):
            yield from arrays_of(value, (*path, member.name))


def pieces(count: int) -> Iterator[slice]:
    """Yield consecutive slices of at most _PIECE samples."""
    for i in range(0, count, _PIECE):
        yield slice(i, min(i + _PIECE, count))


def tolerated(tolerance: float, times: ArrayLike) -> Array:
    """Return the allowed momentum error at times [s].

    M drifts at every step, so its error grows with time. The tolerance holds for the first 10 s;
    after them it grows in proportion to the time, up to 1e-2.
    """
    stretched = tolerance * np.maximum(1.0, np.asarray(times) / _TOLERANCE_TIME)
    return np.minimum(stretched, max(tolerance, _LOOSEST))


def path_unit(scene: Scene, length: ArrayLike) -> Array:
    """Return the scale of path errors and slip [m]: the path length, but at least the radius.

    The path of a ball that spins on the spot has length 0. At the start, a shell with regularised
    friction slips while the path is still short.
    """
    return np.maximum(length, scene.ball.radius)


def slip_with_spin(scene: Scene, slip: Array, spin: Array) -> Array:
    """Return the slip (n,) to be compared with the path [m/s].

    slip: of the shell at the contact [m/s]; spin: of the shell about the vertical [rad/s]. For a
    rubber ball, the spin times the radius is added to the slip.
    """
    return slip + scene.ball.radius * np.abs(spin) if scene.rolling == "rubber" else slip


def path_errors(motion: Motion, reference: Motion) -> Array:
    """Return the distances (n,) between the contact points at the motion's times [m].

    Here and below, the reference's times must include all times of the motion; otherwise InputError
    is raised.
    """
    return _distances(motion.contact_point, reference.contact_point[_shared(motion, reference)])


def path_error(motion: Motion, reference: Motion) -> float:
    """Return the largest of `path_errors`, relative to the reference's `path_scale`."""
    return float(path_errors(motion, reference).max() / reference.path_scale)


def attitude_error(motion: Motion, reference: Motion) -> float:
    """Return the largest rotation angle between the two frames [rad]."""
    return _largest(angle_between, motion, reference)


def gamma_error(motion: Motion, reference: Motion) -> float:
    """Return the largest angle between the two verticals in frame axes [rad]."""

    def angles(ours: Array, theirs: Array) -> Array:
        one, other = _gamma_of(ours), _gamma_of(theirs)
        sine = np.linalg.norm(np.cross(one, other), axis=1)
        return np.arctan2(sine, (one * other).sum(axis=1))

    return _largest(angles, motion, reference)


def momentum_errors(motion: Motion, reference: Motion) -> Array:
    """Return |M - M of the reference| (n,), relative to the reference's `momentum_scale`."""
    theirs = reference.momentum[_shared(motion, reference)]
    return _distances(motion.momentum, theirs) / reference.scene.momentum_scale


def momentum_error(motion: Motion, reference: Motion) -> float:
    """Return the largest of `momentum_errors`."""
    return float(momentum_errors(motion, reference).max())


def _distances(ours: Array, theirs: Array) -> Array:
    return np.linalg.norm(ours - theirs, axis=1)


def _largest(angles: Callable[[Array, Array], Array], motion: Motion, reference: Motion) -> float:
    ours, theirs = motion.attitude, reference.attitude[_shared(motion, reference)]
    return max(float(angles(ours[piece], theirs[piece]).max()) for piece in pieces(len(ours)))


def _shared(motion: Motion, reference: Motion) -> NDArray[np.intp] | slice:
    # Usually the motions share all times. A slice then gives a view and copies nothing.
    first = slice(len(motion.times))
    if np.array_equal(reference.times[first], motion.times):
        return first
    indices = np.searchsorted(reference.times, motion.times)
    shared = reference.times[np.minimum(indices, len(reference.times) - 1)]
    if not np.array_equal(shared, motion.times):
        missing = float(motion.times[shared != motion.times][0])
        raise InputError(f"the reference has no sample at t = {missing:g} s of the motion")
    return indices


class Joined(Generic[_Record]):
    """Concatenate the parts of a motion, or of another record of arrays over time.

    count: upper limit of the total number of samples. Arrays of this length are allocated once,
    because np.concatenate would keep all parts and the whole in memory at the same time.
    """

    def __init__(self, count: int) -> None:
        self._count, self._done = count, 0
        self._whole: dict[_ArrayPath, NDArray[Any]] = {}
        self._last: _Record | None = None

    def add(self, part: _Record) -> None:
        """Append the next part."""
        arrays = dict(arrays_of(part))
        size = len(next(iter(arrays.values())))
        for path, array in arrays.items():
            if path not in self._whole:
                self._whole[path] = np.empty((self._count, *array.shape[1:]), array.dtype)
            self._whole[path][self._done : self._done + size] = array
        self._done, self._last = self._done + size, part

    @property
    def whole(self) -> _Record:
        """The record of all parts so far, at least one."""
        assert self._last is not None
        whole = {path: array[: self._done] for path, array in self._whole.items()}
        record: _Record = with_arrays(self._last, whole)
        return record


def joined(parts: Iterable[_Record], count: int) -> _Record:
    """Concatenate consecutive parts, with only one part in memory at a time."""
    parts_so_far = Joined[_Record](count)
    for part in parts:
        parts_so_far.add(part)
    return parts_so_far.whole


def with_arrays(record: Any, arrays: Mapping[_ArrayPath, NDArray[Any]]) -> Any:
    """Return the record with its arrays replaced; the inverse of `arrays_of`."""
    changes: dict[str, Any] = {path[0]: array for path, array in arrays.items() if len(path) == 1}
    for name in {path[0] for path in arrays} - set(changes):
        inner = {path[1:]: array for path, array in arrays.items() if path[0] == name}
        changes[name] = with_arrays(getattr(record, name), inner)
    return replace(record, **changes)
