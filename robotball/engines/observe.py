"""Turn the states of a run into readings, faults and the recorded motion.

Every engine uses the same steps, fault criteria and recording. In order: the depth at the start,
the steps of a run, the readings, the monitor, the recording.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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
    extended,
    measured_time,
    path_unit,
    slip_with_spin,
    tolerated,
    with_arrays,
)
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, Mask

_ROUNDING = 2e-15  # relative rounding error of a hinge angle and of its drive's angle
_ORDER = {kind: i for i, kind in enumerate(FaultKind)}
_TRIALS = 50  # trials of a depth; the force is nearly linear, so three or four suffice


def depth_at_rest(
    upward: Callable[[float], float], near: float, far: float, tolerance: float
) -> float:
    """Return the depth [m] of a contact at which the net force is 0, or NaN if none is found.

    upward: the force or acceleration at a depth. near, far: two different trial depths. The secant
    method ends when the depth changes by no more than `tolerance` [m].
    """
    before, last = upward(near), upward(far)
    for _ in range(_TRIALS):
        if last == before:
            break
        near, far = far, far - last * (far - near) / (last - before)
        if abs(far - near) <= tolerance:
            return far
        before, last = last, upward(far)
    return np.nan


def spans(
    times: Array, breakpoints: tuple[float, ...], timestep: float
) -> tuple[Array, Array, Array]:
    """Cut a run into equal steps that end on its times (n,) and on the drives' breakpoints [s].

    Returns the intervals (m, 2) between these times, the step lengths (m,) and the numbers of steps
    (m,). The steps are as few as possible without a step longer than `timestep`.
    """
    inside = [t for t in breakpoints if t < times[-1]]
    # Most runs have no breakpoints, and union1d would sort and copy their times.
    stops = times
    if inside:
        # A breakpoint that differs from a sample time only by rounding is dropped: a step between
        # the two would be far too short.
        apart, breaks = 1e-9 * timestep, np.array(inside)
        following = times[np.searchsorted(times, breaks - apart)]
        stops = np.union1d(times, breaks[np.abs(following - breaks) > apart])
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    lengths = np.diff(stops)
    if np.ptp(lengths) <= 4 * np.spacing(stops[-1]):  # equal up to rounding
        lengths[:] = (stops[-1] - stops[0]) / len(lengths)
    # Times such as 0.02 i are rounded: an excess of 1e-9 needs no further step.
    counts = np.ceil(lengths / timestep * (1 - 1e-9))
    return ends, np.minimum(lengths / counts, timestep), counts


def step_count(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    with np.errstate(over="ignore"):
        return float(spans(times, breakpoints, timestep)[2].sum())


@dataclass(frozen=True)
class Readings:
    """Readings of m states of a run: the numbers that a motion records and the monitor checks.

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
        NaN if not reported.
    slip : (m,), m/s
        The sliding velocity of the shell at the contact.
    spin : (m,), rad/s
        The shell's angular velocity about the vertical.
    friction_used : (m,)
        The used fraction of the friction cone; NaN if unknown.
    touching : (m,), bool
        Whether the plane carries the shell.
    sound : (m,), bool
        Whether the state is finite and no number exceeds DIVERGED.
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


def attitudes(q: Array, sound: Mask) -> Array:
    """Return quaternions q (m, 4), with the identity for states that are not sound.

    Such a state may have a zero quaternion, which is not a rotation.
    """
    return q if sound.all() else np.where(sound[:, None], q, [1.0, 0.0, 0.0, 0.0])


class _FaultAt(NamedTuple):
    """A fault and the row of the readings at which it begins."""

    row: int
    fault: Fault


Sign = tuple[Mask, Fault]
"""The rows (m,) that show a fault, and the fault, without its time."""


class _Monitor:
    """Detect faults: slip, lost contact, wrong hinge rates, drifting momentum, divergence.

    rolled, slipped: lengths so far [m]; in the rubber model, slip includes spin times radius.
    momentum: M at the start. ahead (1, k): hinge angles minus the angles of their drives [rad].
    """

    def __init__(self, scene: Scene, settings: EngineSettings) -> None:
        self.scene, self.settings = scene, settings
        self.last_time, self.rolled, self.slipped = -np.inf, 0.0, 0.0
        self.momentum: Array | None = None
        self.last_centre: Array | None = None
        self.ahead: Array | None = None

    def look(
        self, readings: Readings, extra: Sequence[Sign] = (), failure: Fault | None = None
    ) -> list[_FaultAt]:
        """Return the first fault of each kind in the next readings, the earliest first.

        extra: faults that the engine found. failure: why the integrator could not continue after
        the last row. If the settings stop at a fault, the first fault that is not just an event is
        fatal.
        """
        # Squares of a diverged state's numbers overflow.
        with np.errstate(all="ignore"):
            elapsed = np.diff(readings.time, prepend=self.last_time)
            of_the_state = self._of_the_state(readings, elapsed)
            signs = [*of_the_state, *extra, *self._of_the_path(readings, elapsed)]
        first = [(int(np.argmax(mask)), fault) for mask, fault in signs if mask.any()]
        # A diverged state is the cause of an integrator's failure, so report only the divergence.
        if failure is not None and not any(fault.fatal for _, fault in first):
            first.append((len(readings.time), failure))
        faults = [
            _FaultAt(row, replace(fault, time=_time_of(readings.time, row, self.last_time)))
            for row, fault in first
        ]
        if len(readings.time):
            self.last_time = float(readings.time[-1])
        faults.sort(key=lambda at: (at.row, _ORDER[at.fault.kind]))
        wrong = [at.row for at in faults if not at.fault.note]
        if wrong and self.settings.stop_at_fault:
            return [_FaultAt(row, replace(fault, fatal=row == wrong[0])) for row, fault in faults]
        return faults

    def _of_the_state(self, readings: Readings, elapsed: Array) -> list[Sign]:
        sound, kind = readings.sound, FaultKind
        # A motor in the scene may be too weak for its command; any other drive must keep the given
        # rate.
        exact = [i for i, hinge in enumerate(self.scene.hinges) if hinge.motor is None]
        off_rate = np.asarray((_rate_errors_of(self.scene, readings) > RATE_ERROR).any(axis=1))
        if exact and not self.scene.steady:
            off_rate |= self._off_between(readings, elapsed, exact).any(axis=1)
        return [
            (~sound, Fault(kind.DIVERGED, np.nan, fatal=True)),
            (sound & (elapsed <= 0), Fault(kind.RESET, np.nan, fatal=True)),
            (sound & ~readings.touching, Fault(kind.CONTACT_LOST, np.nan)),
            (off_rate, Fault(kind.RATE_OFF, np.nan, limit=RATE_ERROR)),
        ]

    def _off_between(self, readings: Readings, elapsed: Array, exact: Sequence[int]) -> Mask:
        """Return the rows (m, k) before which a hinge left its drive's angle.

        If a drive's period divides the timestep, rates are right at every row.
        """
        times = np.where(np.isfinite(readings.time), readings.time, 0.0)
        angles, drives = readings.hinge_angles[:, exact], [self.scene.drives[i] for i in exact]
        ahead = angles - np.stack([drive.angle(times) for drive in drives], axis=1)
        gained = np.diff(ahead, axis=0, prepend=ahead[:1] if self.ahead is None else self.ahead)
        self.ahead = ahead[-1:] if len(ahead) else self.ahead
        most = RATE_ERROR * np.outer(np.abs(elapsed), np.array(self.scene.rate_scales)[exact])
        return np.asarray(np.abs(gained) > most + _ROUNDING * np.abs(angles))

    def _of_the_path(self, readings: Readings, elapsed: Array) -> list[Sign]:
        """Return the faults of slip relative to path length, and of momentum.

        A ball may slip on a plane whose friction is limited.
        """
        if not len(readings.time) or self.scene.may_slip:
            return []
        scene, tolerance = self.scene, self.settings.error_tolerance
        slip = slip_with_spin(scene, readings.slip, readings.spin)
        before = readings.centre[:1] if self.last_centre is None else self.last_centre
        moved = lengths(np.diff(readings.centre[:, :2], axis=0, prepend=before[:, :2]))
        # No time has elapsed before the first state.
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


def _rate_errors_of(scene: Scene, readings: Readings) -> Array:
    """Return hinge rate errors (m, h) in `Scene.rate_scales`; a motor's lag is not an error."""
    rates, errors = readings.hinge_rates, np.zeros_like(readings.hinge_rates)
    # A diverged state's time may not be finite; drives cannot be evaluated there.
    times = np.where(np.isfinite(readings.time), readings.time, 0.0)
    for i, (hinge, scale) in enumerate(zip(scene.hinges, scene.rate_scales, strict=True)):
        if hinge.motor is None:
            errors[:, i] = np.abs(rates[:, i] - hinge.command.rate(times)) / scale
    return errors


def lengths(v: Array) -> Array:
    """Return the lengths (m,) of vectors (m, k). Summing columns is faster than NumPy's norm."""
    return np.asarray(np.sqrt(sum(column * column for column in v.T)))


def _time_of(times: Array, row: int, last_time: float) -> float:
    """Return the time of a row, or the last finite time before it."""
    known = [t for t in (0.0, last_time, *times[max(row - 1, 0) : row + 1]) if np.isfinite(t)]
    return float(known[-1])


class Recording:
    """The recorded motion of a run, up to the run's end or its first fatal fault.

    Attributes
    ----------
    ended : bool
        Whether a fault has ended the run.
    faults : dict
        The first fault by (kind, subject).
    """

    def __init__(self, engine: Label, scene: Scene, settings: EngineSettings, times: Array) -> None:
        self.engine, self.scene, self.settings, self.times = engine, scene, settings, times
        self.monitor = _Monitor(scene, settings)
        self.faults: dict[tuple[FaultKind, str], Fault] = {}
        self.ended = False
        self._samples = Joined[Readings](len(times))

    def add(
        self,
        readings: Readings,
        sampled: NDArray[np.int64] | None = None,
        extra: Sequence[Sign] = (),
        failure: Fault | None = None,
    ) -> None:
        """Check the next readings and record the readings at sample times.

        sampled (k,): the rows at sample times, None for all; extra, failure: as in `_Monitor.look`.
        """
        faults = self.monitor.look(readings, extra, failure)
        ends = next((at.row for at in faults if at.fault.fatal), None)
        self.ended = ends is not None
        for row, fault in faults:
            if ends is None or row <= ends:
                self.faults.setdefault((fault.kind, fault.subject), fault)
        rows = np.arange(len(readings.time)) if sampled is None else sampled
        kept = rows if ends is None else rows[rows < ends]  # the row of a fatal fault is invalid
        sampled_arrays = {place: array[kept] for place, array in arrays_of(readings)}
        self._samples.add(with_arrays(readings, sampled_arrays))

    def motion(self, timestep: float, steps: int, seconds: float, **others: Any) -> ContactMotion:
        """Return the recorded motion.

        timestep: the longest step [s]; steps: the number of steps; seconds: processor time; others:
        fields of ContactReport.
        """
        read, faults = self._samples.whole, self.faults.values()
        seconds = measured_time(seconds)
        cost = {"timestep": timestep, "steps": steps, "seconds": seconds, "total_seconds": seconds}
        report = extended(
            read,
            ContactReport,
            settings=self.settings,
            depth=self.scene.ball.radius - read.centre[:, 2],
            hinge_rate_error=_rate_errors_of(self.scene, read).max(axis=1, initial=0.0),
            faults=tuple(fault for fault in faults if not fault.note),
            # Events, such as a motor at the limit that the scene sets.
            notes=tuple(fault for fault in faults if fault.note),
            **cost | others,
        )
        # An engine's clock sums up its steps; record the sample times as requested.
        times, point = self.times[: len(read.time)], read.centre[:, :2]
        whose = {"scene": self.scene, "engine": self.engine, "report": report}
        return extended(read, ContactMotion, times=times, contact_point=point, **whose)
