"""The monitor of a run: faults that make its numbers no result, found in every step's readings.

MuJoCo itself warns of few of them. A saturated cone, a slip, a lost contact or a servo that misses
its rate changes the motion without a word.
"""

from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from robotball.engines.mujoco.limits import allowed
from robotball.engines.mujoco.model import Model, ModelHinge
from robotball.engines.mujoco.readings import Readings, lengths
from robotball.motion import DIVERGED, RATE_ERROR, Fault, FaultKind, path_unit, slip_with_spin
from robotball.rotations import Array, Mask

_SATURATED = 1 - 1e-6  # of the friction cone; solutions on its surface end this near
_AT_LIMIT = 1 - 1e-9  # of a servo's torque limit, beyond which only rounding lies
_ROUNDING = 2e-15  # of an angle and of its drive's, relative
_LIFTING = 1e-2  # of the weight; a ball that presses less on the plane is about to lift off

# Without MuJoCo's warnings of a bad state (BADQPOS, …), which the state itself shows.
_WARNINGS = {
    int(warning): warning.name.removeprefix("mjWARN_")
    for warning in mujoco.mjtWarning.__members__.values()
    if warning != mujoco.mjtWarning.mjNWARNING and "BADQ" not in warning.name
}


class Found(NamedTuple):
    """A fault, and the row of the readings at which it begins."""

    row: int
    fault: Fault


class Monitor:
    """The monitor's memory from one portion of a run to the next.

    rolled, slipped: the lengths of the path and of the slip along it so far [m], where a rubber
    ball's spin counts as slip at its radius; momentum: M of the first state (3,).
    """

    def __init__(self, model: Model) -> None:
        self.model, self.tolerance, scene = model, model.settings.error_tolerance, model.scene
        self.weight = scene.ball.mass * scene.gravity if scene.load_varies else 0.0  # N
        self.last_time, self.rolled, self.slipped = -np.inf, 0.0, 0.0
        self.momentum: Array | None = None
        self.last_centre: Array | None = None
        self.ahead: Array | None = None

    def look(self, readings: Readings, failure: Fault | None = None) -> list[Found]:
        """Return the first of each kind of fault in the next portion, the earliest first.

        failure: why the integrator could not go on after the last row, if it could not. Where
        settings stop at a fault, those after the first one are left out, and it is fatal.
        """
        # A diverged state's numbers have no squares.
        with np.errstate(all="ignore"):
            seen = [*self._of_the_state(readings), *self._of_the_motion(readings)]
        found = [
            Found(row, replace(fault, time=_time_of(readings.time, row, self.last_time)))
            for mask, fault in seen
            if mask.any()
            for row in [int(np.argmax(mask))]
        ]
        # A state that has diverged is the cause; that the integrator gives up there only follows.
        if failure is not None and not any(each.fault.fatal for each in found):
            row = len(readings.time)
            time = _time_of(readings.time, row, self.last_time)
            found.append(Found(row, replace(failure, time=time)))
        if len(readings.time):
            self.last_time = float(readings.time[-1])
        found.sort(key=lambda each: each.row)
        wrong = [each.row for each in found if not each.fault.note]
        if wrong and self.model.settings.stop_at_fault:
            return [
                Found(row, replace(fault, fatal=row == wrong[0]))
                for row, fault in found
                if row <= wrong[0]
            ]
        return found

    def _of_the_state(self, readings: Readings) -> list[tuple[Mask, Fault]]:
        """Return the faults by the state alone with their rows; their times are not known yet."""
        diverged = ~readings.sound(DIVERGED)
        elapsed = np.diff(readings.time, prepend=self.last_time)
        # A motor of the scene's own may be weak; any other drive has to keep its rate.
        exact = [hinge for hinge in readings.model.hinges if not hinge.own_motor]
        off_rate = readings.hinge_rate_error(exact) > RATE_ERROR
        off_rate |= self._off_between(readings, exact, elapsed)
        saturated = readings.friction_used > _SATURATED
        # A ball that is about to lift off has no cone left, so its contact is what is lost.
        lifting = saturated & (readings.contact_force[:, 0] < _LIFTING * self.weight)
        kind = FaultKind
        return [
            (diverged, Fault(kind.DIVERGED, np.nan, fatal=True)),
            (~diverged & (elapsed <= 0), Fault(kind.RESET, np.nan, fatal=True)),
            (~diverged & (~readings.in_contact | lifting), Fault(kind.CONTACT_LOST, np.nan)),
            (saturated & ~lifting, Fault(kind.CONE_SATURATED, np.nan)),
            (off_rate, Fault(kind.RATE_OFF, np.nan, limit=RATE_ERROR)),
            *(
                (
                    np.abs(readings.motor_torques[:, hinge.index])
                    >= hinge.torque_limit * _AT_LIMIT,
                    Fault(kind.TORQUE_LIMIT, np.nan, hinge.body, note=hinge.own_motor),
                )
                for hinge in readings.model.hinges
                if hinge.torque_limit < np.inf
            ),
            *(
                (~diverged & (readings.warnings[:, i] > 0), Fault(kind.ENGINE_WARNED, np.nan, name))
                for i, name in _WARNINGS.items()
                if readings.warnings[-1:, i].any()  # they only grow
            ),
        ]

    def _off_between(self, readings: Readings, hinges: list[ModelHinge], elapsed: Array) -> Mask:
        """Return the rows since whose last one a hinge has not turned as far as its drive did.

        A drive whose period divides the timestep has the same rate at every row.
        """
        times = np.where(np.isfinite(readings.time), readings.time, 0.0)
        angles = readings.hinge_angles[:, [each.index for each in hinges]]
        ahead = angles - np.array([each.drive.angle(times) for each in hinges]).T
        gained = np.diff(ahead, axis=0, prepend=ahead[:1] if self.ahead is None else self.ahead)
        self.ahead = ahead[-1:] if len(ahead) else self.ahead
        most = RATE_ERROR * np.outer(np.abs(elapsed), [each.largest_rate for each in hinges])
        return np.asarray((np.abs(gained) > most + _ROUNDING * np.abs(angles)).any(axis=1))

    def _of_the_motion(self, readings: Readings) -> list[tuple[Mask, Fault]]:
        """Return the faults by the momentum and by the slip over the path, with their rows."""
        if not len(readings.rows):
            return []
        scene, tolerance = self.model.scene, self.tolerance
        slip = slip_with_spin(scene, readings.slip, readings.spin)
        before = readings.centre[:1] if self.last_centre is None else self.last_centre
        last_time = self.last_time if np.isfinite(self.last_time) else readings.time[0]
        moved = lengths(np.diff(readings.centre[:, :2], axis=0, prepend=before[:, :2]))
        slipped = self.slipped + np.cumsum(slip * np.diff(readings.time, prepend=last_time))
        rolled = self.rolled + np.cumsum(moved)
        self.slipped, self.rolled = float(slipped[-1]), float(rolled[-1])
        self.last_centre = readings.centre[-1:]
        slips = slipped > tolerance * path_unit(scene, rolled)
        faults = [(slips, Fault(FaultKind.SLIPPED, np.nan, limit=tolerance))]
        if scene.keeps_momentum:
            if self.momentum is None:
                self.momentum = readings.momentum[0]
            error = lengths(readings.momentum - self.momentum) / scene.momentum_scale
            off = error > allowed(tolerance, readings.time)
            faults.append((off, Fault(FaultKind.MOMENTUM_OFF, np.nan, limit=tolerance)))
        return faults


def _time_of(times: Array, row: int, last_time: float) -> float:
    """Return the time of a row, or of the last row before it whose time is finite."""
    known = [t for t in (0.0, last_time, *times[max(row - 1, 0) : row + 1]) if np.isfinite(t)]
    return float(known[-1])
