"""Observe a run: cut it into steps, find the faults in its readings, and record its motion.

All engines use the same monitor.
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
    """Cut a run into spans between its times and the drives' breakpoints [s].

    Returns the ends (m, 2) of the spans, and the lengths (m,) and counts (m,) of the fewest equal
    steps in each that are not longer than `timestep`.
    """
    inside = np.array([t for t in breakpoints if t < times[-1]])
    stops = times
    if len(inside):
        # A breakpoint that differs from a sample time by rounding is that time.
        apart = 1e-9 * timestep
        following = times[np.searchsorted(times, inside - apart)]
        stops = np.union1d(times, inside[np.abs(following - inside) > apart])
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    lengths = np.diff(stops)
    if np.ptp(lengths) <= 4 * np.spacing(stops[-1]):  # equal up to the rounding of the times
        lengths[:] = (stops[-1] - stops[0]) / len(lengths)
    # The rounding of times such as 0.02 i must not add a step.
    counts = np.ceil(lengths / timestep * (1 - 1e-9))
    return ends, np.minimum(lengths / counts, timestep), counts


def step_count(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    """Count the steps of `spans`."""
    with np.errstate(over="ignore"):
        return float(spans(times, breakpoints, timestep)[2].sum())


@dataclass(frozen=True)
class Readings:
    """Readings of m states of a run: the numbers of a motion, and those that show its faults.

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
        NaN if the engine gives no loads.
    slip : (m,), m/s
        The sliding velocity of the shell at the contact.
    spin : (m,), rad/s
        The shell's angular velocity about the vertical.
    friction_used : (m,)
        The used part of the friction cone; NaN if unknown.
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


def attitudes(quaternions: Array, sound: Mask) -> Array:
    """Return quaternions (m, 4), with the identity for states that are not sound.

    The quaternion of such a state may be zero, which has no axes.
    """
    identity = [1.0, 0.0, 0.0, 0.0]
    return quaternions if sound.all() else np.where(sound[:, None], quaternions, identity)


class FaultAt(NamedTuple):
    """A fault, and the row of the readings at which it begins."""

    row: int
    fault: Fault


Sign = tuple[Mask, Fault]
"""The rows (m,) that show a fault, and the fault, without its time."""
_ROUNDING = 2e-15  # relative, of an angle and of its drive
_ORDER = {kind: i for i, kind in enumerate(FaultKind)}


class Monitor:
    """Monitor of a run, which finds its faults.

    Engines do not warn of slip, a lost contact or the tracking error of a servo.

    Attributes
    ----------
    rolled, slipped : float, m
        The lengths of the path and of the slip so far. The spin of a rubber ball counts as slip at
        its radius.
    momentum : (3,) or None
        M of the first state.
    ahead : (1, k) or None, rad
        How much farther the hinges have turned than their drives.
    """

    def __init__(self, scene: Scene, settings: EngineSettings) -> None:
        self.scene, self.settings = scene, settings
        self.last_time, self.rolled, self.slipped = -np.inf, 0.0, 0.0
        self.momentum: Array | None = None
        self.last_centre: Array | None = None
        self.ahead: Array | None = None

    def look(
        self, readings: Readings, own: Sequence[Sign] = (), failure: Fault | None = None
    ) -> list[FaultAt]:
        """Return the first fault of each kind in the next readings, the earliest first.

        If the settings stop at a fault, the first one that is not a note is fatal.

        Parameters
        ----------
        readings : Readings
            The readings of the next m states.
        own : sequence of Sign
            Faults that only this engine can have.
        failure : Fault, optional
            Why the integrator could not continue after the last row.
        """
        # Squares of a diverged state overflow.
        with np.errstate(all="ignore"):
            elapsed = np.diff(readings.time, prepend=self.last_time)
            of_the_state = self._of_the_state(readings, elapsed)
            signs = [*of_the_state, *own, *self._of_the_path(readings, elapsed)]
        first = [(int(np.argmax(mask)), fault) for mask, fault in signs if mask.any()]
        # A failure of the integrator only follows from a diverged state.
        if failure is not None and not any(fault.fatal for _, fault in first):
            first.append((len(readings.time), failure))
        faults = [
            FaultAt(row, replace(fault, time=_time_of(readings.time, row, self.last_time)))
            for row, fault in first
        ]
        if len(readings.time):
            self.last_time = float(readings.time[-1])
        faults.sort(key=lambda at: (at.row, _ORDER[at.fault.kind]))
        wrong = [row for row, fault in faults if not fault.note]
        if wrong and self.settings.stop_at_fault:
            return [FaultAt(row, replace(fault, fatal=row == wrong[0])) for row, fault in faults]
        return faults

    def _of_the_state(self, readings: Readings, elapsed: Array) -> list[Sign]:
        """Return the faults that single states show."""
        sound, kind = readings.sound, FaultKind
        # The scene's motors may be weak; any other drive must keep its rate.
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
        """Return the rows (m, k) before which a hinge has not turned as its drive.

        The rates do not show it for a drive whose period divides the timestep.
        """
        times = np.where(np.isfinite(readings.time), readings.time, 0.0)
        angles, drives = readings.hinge_angles[:, exact], [self.scene.drives[i] for i in exact]
        ahead = angles - np.stack([drive.angle(times) for drive in drives], axis=1)
        gained = np.diff(ahead, axis=0, prepend=ahead[:1] if self.ahead is None else self.ahead)
        self.ahead = ahead[-1:] if len(ahead) else self.ahead
        most = RATE_ERROR * np.outer(np.abs(elapsed), np.array(self.scene.rate_scales)[exact])
        return np.asarray(np.abs(gained) > most + _ROUNDING * np.abs(angles))

    def _of_the_path(self, readings: Readings, elapsed: Array) -> list[Sign]:
        """Return the faults of slip along the path and of momentum."""
        if not len(readings.time):
            return []
        scene, tolerance = self.scene, self.settings.error_tolerance
        slip = slip_with_spin(scene, readings.slip, readings.spin)
        before = readings.centre[:1] if self.last_centre is None else self.last_centre
        moved = lengths(np.diff(readings.centre[:, :2], axis=0, prepend=before[:, :2]))
        # No time has elapsed at the first state.
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

    The error of a hinge with a motor is 0, because its lag belongs to the motion.
    """
    rates, errors = readings.hinge_rates, np.zeros_like(readings.hinge_rates)
    # The time of a diverged state may be NaN, and drives cannot be evaluated there.
    times = np.where(np.isfinite(readings.time), readings.time, 0.0)
    for i, (hinge, scale) in enumerate(zip(scene.hinges, scene.rate_scales, strict=True)):
        if hinge.motor is None:
            errors[:, i] = np.abs(rates[:, i] - hinge.command.rate(times)) / scale
    return errors


def lengths(v: Array) -> Array:
    """Return the lengths (m,) of vectors (m, k); NumPy's norm of rows is slower."""
    return np.asarray(np.sqrt(sum(column * column for column in v.T)))


def _time_of(times: Array, row: int, last_time: float) -> float:
    """Return the time of a row, or of the last row before it whose time is finite."""
    known = [t for t in (0.0, last_time, *times[max(row - 1, 0) : row + 1]) if np.isfinite(t)]
    return float(known[-1])


class Recording:
    """Record of a run, up to its end or its first fatal fault.

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
        """Find the faults of the next readings, and record those at sample times.

        sampled (k,): the rows at the run's sample times, all if None; own, failure: as in
        `Monitor.look`.
        """
        faults = self.monitor.look(readings, own, failure)
        ends = next((row for row, fault in faults if fault.fatal), None)
        self.ended = ends is not None
        for row, fault in faults:
            if ends is None or row <= ends:
                self.faults.setdefault((fault.kind, fault.subject), fault)
        rows = np.arange(len(readings.time)) if sampled is None else sampled
        kept = rows if ends is None else rows[rows < ends]  # the row of the fatal fault is bad
        sampled_arrays = {place: array[kept] for place, array in arrays_of(readings)}
        self._samples.add(with_arrays(readings, sampled_arrays))

    def motion(
        self, timestep: float, steps: int, seconds: float, python_seconds: float | None = None
    ) -> ContactMotion:
        """Return the recorded motion.

        timestep: the longest step [s]; steps: their number; seconds: their processor time;
        python_seconds: Python's part of it, if measured.
        """
        read, faults = self._samples.whole, self.faults.values()
        seconds = measured_time(seconds)
        return ContactMotion(
            scene=self.scene,
            engine=self.engine,
            # The requested times; the engine's clock adds up its steps.
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
                faults=tuple(fault for fault in faults if not fault.note),
                timestep=timestep,
                steps=steps,
                seconds=seconds,
                total_seconds=seconds,
                notes=tuple(fault for fault in faults if fault.note),
                python_seconds=python_seconds,
            ),
        )
