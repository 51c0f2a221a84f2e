"""The plane as it moves: where the ball is in space, where it leaves the plane, who refuses it."""

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from robotball.errors import InputError
from robotball.motion import Motion
from robotball.robot.scene import Scene
from robotball.rotations import Array, uneven

_SEEN = 20_001  # times over a scene at which its load is looked at
_FINE = 1e-12  # s, to which the time of the least load is sought


def in_space(motion: Motion) -> Array:
    """Return where the contact point is in space, where the plane moves under the ball.

    The plane is at the origin and at rest at time 0, so one that swings about a place starts at a
    turning point: a sine that has the phase π/2 or -π/2.

    Parameters
    ----------
    motion : Motion
        The motion, whose contact points are seen from the plane.

    Returns
    -------
    array (n, 3)
        The contact points, m, world axes.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.integrate(rb.load_scene("vibrated_ball"), 0.5)
    >>> rb.in_space(motion).shape
    (26, 3)
    """
    from robotball.robot.function_drives import polynomials_of  # the equations do without

    scene = motion.scene.until(float(motion.times[-1]))
    edges = [0.0, *(t for t in scene.breakpoints if t < scene.duration), scene.duration]
    place = np.zeros((len(motion.times), 3))
    place[:, :2] = motion.contact_point
    for axis, drive in enumerate(scene.plane_drives):
        # A drive knows its first integral alone, the velocity.
        of_plane = polynomials_of(drive.angle, edges)
        place[:, axis] += [of_plane.area(t) for t in motion.times.tolist()]
    return place


def check_still(scene: Scene, what: str) -> None:
    """Raise InputError where the plane moves, which `what` cannot hold."""
    if scene.plane_moves:
        raise InputError(f"{scene.name}: {what} cannot hold a plane that moves")


def check_pressed(scene: Scene) -> None:
    """Raise InputError where a balanced ball lifts off the plane, which falls away under it."""

    def load(t: float) -> float:
        return float(-scene.gravity_at(t)[2])

    # A ramp and samples are least at breakpoints, and beside the least load that is seen a sine,
    # which dips alike in every period.
    times = np.union1d(uneven(scene.duration, scene.duration / _SEEN), scene.breakpoints)
    i = int(np.clip(scene.gravity_at(times)[:, 2].argmax(), 1, len(times) - 2))
    beside = (times[i - 1], times[i + 1])
    least = minimize_scalar(load, bounds=beside, method="bounded", options={"xatol": _FINE}).x
    times = np.union1d(times, least)
    off = np.flatnonzero(~(-scene.gravity_at(times)[:, 2] > 0))
    if len(off):
        i = int(off[0])
        raise lift_off(float(brentq(load, times[i - 1], times[i])) if i else 0.0)


def lift_off(t: float) -> InputError:
    """Return the error of a ball that leaves the plane at t [s]."""
    return InputError(
        f"the ball lifts off the plane at t = {t:.9g} s, where its rolling ends; shorten the "
        "motion, or move the bodies and the plane more gently"
    )
