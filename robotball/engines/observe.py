"""Observe a run: states of the ball → readings, the faults that they show, and the motion.

Every engine's run is cut into steps, judged and recorded here, so that one law holds for all. In
order: the steps of a run, the readings of states, the monitor, the recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robotball.motion import (
    RATE_ERROR,
    ContactMotion,
    ContactReport,
    EngineSettings,
    Fault,
    FaultKind,
    Joined,
    Label,
    arrays_of,
    measured_time,
    path_unit,
    slip_with_spin,
    tolerated,
    with_arrays,
)
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, Mask


def spans(
    times: Array, breakpoints: tuple[float, ...], timestep: float
) -> tuple[Array, Array, Array]:
    """Cut a run into equal steps that end on its times and on the drives' breakpoints [s].

    Returns the ends (m, 2) between two of these, with the lengths (m,) and the counts (m,) of the
    fewest steps that are not longer than `timestep`.
    """
    inside = [t for t in breakpoints if t < times[-1]]
    # Most runs have no breakpoints: union1d would sort and copy their times for nothing.
    stops = times
    if inside:
        # One that rounding sets apart from a sample time is that time: no step is so short.
        apart, given = 1e-9 * timestep, np.array(inside)
        following = times[np.searchsorted(times, given - apart)]
        stops = np.union1d(times, given[np.abs(following - given) > apart])
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    lengths = np.diff(stops)
    if np.ptp(lengths) <= 4 * np.spacing(stops[-1]):  # equal but for the rounding of the times
        lengths[:] = (stops[-1] - stops[0]) / len(lengths)
    # Times such as 0.02 i are rounded, and a length that exceeds its steps by that needs no more.
    counts = np.ceil(lengths / timestep * (1 - 1e-9))
    return ends, np.minimum(lengths / counts, timestep), counts


def step_count(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    """Count the steps of `spans`."""
    with np.errstate(over="ignore"):
        return float(spans(times, breakpoints, timestep)[2].sum())


@dataclass(frozen=True)
class Readings:
    """The readings of m states of a run: what a motion records, and what shows its faults.

    Attributes
    ----------
    time : (m,), s
    centre : (m, 3), m, world
        The sphere's centre.
    attitude : (m, 4)
        The frame's quaternion, frame to world.
    angular_velocity : (m, 3), rad/s, frame axes
        The frame's ω.
    momentum : (m, 3), kg m²/s, world
        The paper's M (3.1).
    hinge_angles, hinge_rates : (m, h), rad and rad/s
    loads : Loads
        NaN where the engine gives none.
    slip : (m,), m/s
        The sliding velocity of the shell at the contact.
    spin : (m,), rad/s
        The shell's angular velocity about the vertical.
    friction_used : (m,)
        The used part of the friction cone; NaN where it is not known.
    touching : (m,), bool
        Whether the plane carries the shell.
    sound : (m,), bool
        Whether the state is finite and its numbers below DIVERGED.
    """

    time: Array
    centre: Array
    attitude: Array
    angular_velocity: Array
    momentum: Array
    hinge_angles: Array
    hinge_rates: Array
    loads: Loads
    slip: Array
    spin: Array
    friction_used: Array
    touching: Mask
    sound: Mask


def attitudes(given: Array, sound: Mask) -> Array:
    """Return quaternions (m, 4) as given, and no turn for those of states that are not sound.

    Such a state may have zeros for a quaternion, whose axes cannot be computed.
    """
    return given if sound.all() else np.where(sound[:, None], given, [1.0, 0.0, 0.0, 0.0])


class Found(NamedTuple):
    """A fault, and the row of the readings at which it begins."""

    row: int
    fault: Fault


Sign = tuple[Mask, Fault]
"""The rows (m,) that show a fault, and the fault, whose time is not known yet."""
_ROUNDING = 2e-15  # of an angle and of its drive's, relative
_ORDER = {kind: i for i, kind in enumerate(FaultKind)}


class Monitor:
    """The memory, from one look to the next, of what makes the numbers of a run no result.

    Engines warn of little of it: a slip, a lost contact or a servo that misses its rate changes the
    motion without a word.

    rolled, slipped: the lengths of the path and of the slip along it so far [m], where a rubber
    ball's spin counts as slip at its radius; momentum: M of the first state (3,); ahead (1, k): how
    much farther the hinges have turned than their drives [rad].
    """

    def __init__(self, scene: Scene, settings: EngineSettings) -> None:
        self.scene, self.settings = scene, settings
        self.last_time, self.rolled, self.slipped = -np.inf, 0.0, 0.0
        self.momentum: Array | None = None
        self.last_centre: Array | None = None
        self.ahead: Array | None = None

    def look(
        self, readings: Readings, own: Sequence[Sign] = (), failure: Fault | None = None
    ) -> list[Found]:
        """Return the first of each kind of fault in the next readings, the earliest first.

        If the settings stop at a fault, the first that is no event is fatal.

        Parameters
        ----------
        readings : Readings
            Of the next m states.
        own : sequence of Sign
            Found by laws of the engine's own.
        failure : Fault, optional
            Why the integrator could not go on after the last row.
        """
        # A diverged state's numbers have no squares.
        with np.errstate(all="ignore"):
            elapsed = np.diff(readings.time, prepend=self.last_time)
            of_the_state = self._of_the_state(readings, elapsed)
            seen = [*of_the_state, *own, *self._of_the_path(readings, elapsed)]
        first = [(int(np.argmax(mask)), fault) for mask, fault in seen if mask.any()]
        # A state that has diverged is the cause; that the integrator gives up there only follows.
        if failure is not None and not any(fault.fatal for _, fault in first):
            first.append((len(readings.time), failure))
        found = [
            Found(row, replace(fault, time=_time_of(readings.time, row, self.last_time)))
            for row, fault in first
        ]
        if len(readings.time):
            self.last_time = float(readings.time[-1])
        found.sort(key=lambda each: (each.row, _ORDER[each.fault.kind]))
        wrong = [each.row for each in found if not each.fault.note]
        if wrong and self.settings.stop_at_fault:
            return [Found(row, replace(fault, fatal=row == wrong[0])) for row, fault in found]
        return found

    def _of_the_state(self, readings: Readings, elapsed: Array) -> list[Sign]:
        """Return the faults that each state shows by itself."""
        sound, kind = readings.sound, FaultKind
        # A motor of the scene's own may be weak; any other drive has to keep its rate.
        exact = [i for i, hinge in enumerate(self.scene.hinges) if hinge.motor is None]
        off_rate = np.asarray((rate_errors_of(self.scene, readings) > RATE_ERROR).any(axis=1))
        if exact and not self.scene.steady:
            off_rate |= self._off_between(readings, elapsed, exact).any(axis=1)
        return [
            (~sound, Fault(kind.DIVERGED, np.nan, fatal=True)),
            (sound & (elapsed <= 0), Fault(kind.RESET, np.nan, fatal=True)),
            (sound & ~readings.touching, Fault(kind.CONTACT_LOST, np.nan)),
            (off_rate, Fault(kind.RATE_OFF, np.nan, limit=RATE_ERROR)),
        ]

    def _off_between(self, readings: Readings, elapsed: Array, exact: Sequence[int]) -> Mask:
        """Return the rows (m, k) since whose last one a hinge has not turned as its drive did.

        A drive whose period divides the timestep has the same rate at every row.
        """
        times = np.where(np.isfinite(readings.time), readings.time, 0.0)
        angles, drives = readings.hinge_angles[:, exact], [self.scene.drives[i] for i in exact]
        ahead = angles - np.stack([drive.angle(times) for drive in drives], axis=1)
        gained = np.diff(ahead, axis=0, prepend=ahead[:1] if self.ahead is None else self.ahead)
        self.ahead = ahead[-1:] if len(ahead) else self.ahead
        most = RATE_ERROR * np.outer(np.abs(elapsed), np.array(self.scene.rate_scales)[exact])
        return np.asarray(np.abs(gained) > most + _ROUNDING * np.abs(angles))

    def _of_the_path(self, readings: Readings, elapsed: Array) -> list[Sign]:
        """Return the faults by the slip over the path, and by the momentum."""
        if not len(readings.time):
            return []
        scene, tolerance = self.scene, self.settings.error_tolerance
        slip = slip_with_spin(scene, readings.slip, readings.spin)
        before = readings.centre[:1] if self.last_centre is None else self.last_centre
        moved = lengths(np.diff(readings.centre[:, :2], axis=0, prepend=before[:, :2]))
        # Of the first state no time has elapsed yet.
        slipped = self.slipped + np.cumsum(slip * np.where(elapsed == np.inf, 0.0, elapsed))
        rolled = self.rolled + np.cumsum(moved)
        self.slipped, self.rolled = float(slipped[-1]), float(rolled[-1])
        self.last_centre = readings.centre[-1:]
        slips = slipped > tolerance * path_unit(scene, rolled)
        faults = [(slips, Fault(FaultKind.SLIPPED, np.nan, limit=tolerance))]
        if scene.keeps_momentum:
            if self.momentum is None:
                self.momentum = readings.momentum[0]
            error = lengths(readings.momentum - self.momentum) / scene.momentum_scale
            off = error > tolerated(tolerance, readings.time)
            faults.append((off, Fault(FaultKind.MOMENTUM_OFF, np.nan, limit=tolerance)))
        return faults


def rate_errors_of(scene: Scene, readings: Readings) -> Array:
    """Return the errors (m, h) of the hinges' rates in the unit `Scene.rate_scales`.

    A hinge with a motor has no error, because its lag belongs to the motion.
    """
    rates, errors = readings.hinge_rates, np.zeros_like(readings.hinge_rates)
    # A diverged state's time may be none, which no drive can be evaluated at.
    times = np.where(np.isfinite(readings.time), readings.time, 0.0)
    for i, (hinge, scale) in enumerate(zip(scene.hinges, scene.rate_scales, strict=True)):
        if hinge.motor is None:
            errors[:, i] = np.abs(rates[:, i] - hinge.command.rate(times)) / scale
    return errors


def lengths(v: Array) -> Array:
    """Return the lengths (m,) of vectors (m, k), by columns: NumPy's norm of rows is slow."""
    return np.asarray(np.sqrt(sum(column * column for column in v.T)))


def _time_of(times: Array, row: int, last_time: float) -> float:
    """Return the time of a row, or of the last row before it whose time is finite."""
    known = [t for t in (0.0, last_time, *times[max(row - 1, 0) : row + 1]) if np.isfinite(t)]
    return float(known[-1])


class Recording:
    """The motion of a run as it grows, until it ends or breaks off at a fault.

    ended: whether a fault has ended it; faults: the first of each kind and subject.
    """

    def __init__(self, engine: Label, scene: Scene, settings: EngineSettings, times: Array) -> None:
        self.engine, self.scene, self.settings, self.times = engine, scene, settings, times
        self.monitor = Monitor(scene, settings)
        self.faults: dict[tuple[FaultKind, str], Fault] = {}
        self.ended = False
        self._samples = Joined[Readings](len(times))

    def add(
        self,
        readings: Readings,
        sampled: NDArray[np.int64] | None = None,
        own: Sequence[Sign] = (),
        failure: Fault | None = None,
    ) -> None:
        """Judge the next readings, and record those at sample times.

        sampled (k,): the rows at the run's sample times, all if None; own, failure: as in
        `Monitor.look`.
        """
        found = self.monitor.look(readings, own, failure)
        ends = next((each.row for each in found if each.fault.fatal), None)
        self.ended = ends is not None
        for row, fault in found:
            if ends is None or row <= ends:
                self.faults.setdefault((fault.kind, fault.subject), fault)
        rows = np.arange(len(readings.time)) if sampled is None else sampled
        kept = rows if ends is None else rows[rows < ends]  # that of the fatal fault is bad itself
        sampled_arrays = {place: array[kept] for place, array in arrays_of(readings)}
        self._samples.add(with_arrays(readings, sampled_arrays))

    def motion(
        self, timestep: float, steps: int, seconds: float, python_seconds: float | None = None
    ) -> ContactMotion:
        """Return the recorded motion.

        timestep: of the longest step [s]; steps: taken, in so many seconds of processor time, of
        which python_seconds are Python's, where that is measured.
        """
        read, faults = self._samples.whole, self.faults.values()
        seconds = measured_time(seconds)
        return ContactMotion(
            scene=self.scene,
            engine=self.engine,
            # An engine's clock adds up its steps; the sample times are those that were asked for.
            times=self.times[: len(read.time)],
            contact_point=read.centre[:, :2],
            attitude=read.attitude,
            momentum=read.momentum,
            angular_velocity=read.angular_velocity,
            hinge_angles=read.hinge_angles,
            hinge_rates=read.hinge_rates,
            loads=read.loads,
            report=ContactReport(
                settings=self.settings,
                slip=read.slip,
                spin=read.spin,
                depth=self.scene.ball.radius - read.centre[:, 2],
                friction_used=read.friction_used,
                hinge_rate_error=rate_errors_of(self.scene, read).max(axis=1, initial=0.0),
                faults=tuple(each for each in faults if not each.note),
                timestep=timestep,
                steps=steps,
                seconds=seconds,
                total_seconds=seconds,
                # Events of the motion, as a motor at the limit that its scene gives it.
                notes=tuple(each for each in faults if each.note),
                python_seconds=python_seconds,
            ),
        )
