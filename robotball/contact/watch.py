"""The watch on a MuJoCo run: what makes its numbers no result, found in every step's readings."""

import mujoco
import numpy as np

from robotball.contact.readings import Readings
from robotball.motion import Fault
from robotball.rotations import Array

DIVERGED = 1e10  # MuJoCo's own limit (mjMAXVAL) on a state that it still calls good
SATURATED = 1 - 1e-6  # of the friction cone: contact solutions on its surface end this near
RATE_ERROR = 1e-3  # relative; a prescribed hinge keeps 1e-13, a servo this good passes

# Those that tell of a diverged state say no more than the state itself.
WARNINGS = {
    int(warning): warning.name.removeprefix("mjWARN_")
    for warning in mujoco.mjtWarning.__members__.values()
    if warning != mujoco.mjtWarning.mjNWARNING and "BADQ" not in warning.name
}


def find_faults(readings: Readings, last_time: float, failure: str | None = None) -> list[Fault]:
    """The first of each kind of fault in the readings of one portion of a run.

    last_time: the time of the row before [s]; it tells a reset, which MuJoCo makes silently.
    failure: why the integrator could not go on after the last row, if so.
    """
    sound = np.isfinite(readings.rows) & (np.abs(readings.rows) < DIVERGED)
    diverged = ~sound.all(axis=1)
    elapsed = np.diff(readings.time, prepend=last_time)
    # A motor of the scene's own may be weak; any other drive has to keep its rate.
    exact = [hinge for hinge in readings.model.hinges if not hinge.real]
    off_rate = readings.hinge_rate_error(exact) > RATE_ERROR
    kinds = [
        (diverged, "the state diverged", True),
        (~diverged & (elapsed <= 0), "time went back: MuJoCo reset the state", True),
        (~diverged & ~readings.in_contact, "contact lost", False),
        (readings.friction_used > SATURATED, "friction cone saturated", False),
        (off_rate, f"hinge rate off by over {RATE_ERROR:g}", False),
        *(
            (readings.servo_saturation(hinge), f"{hinge.body}'s motor at its torque limit", False)
            for hinge in readings.model.hinges
        ),
        *(
            (~diverged & (readings.warnings[:, i] > 0), f"MuJoCo warned of {name}", False)
            for i, name in WARNINGS.items()
        ),
    ]
    faults = [
        Fault(_time_of(readings.time, int(np.argmax(mask)), last_time), cause, fatal)
        for mask, cause, fatal in kinds
        if mask.any()
    ]
    if failure is not None and not any(fault.fatal for fault in faults):
        faults.append(Fault(_time_of(readings.time, len(readings.time), last_time), failure, True))
    return faults


def _time_of(times: Array, row: int, last_time: float) -> float:
    """The time of a row, or of the last row before it whose time is finite."""
    known = [t for t in (0.0, last_time, *times[: row + 1]) if np.isfinite(t)]
    return float(known[-1])
