"""The moving plane: the ball's path in space, lift-off, and refusals of a plane that moves."""

import numpy as np

from robotball.errors import EarlyEndError, InputError
from robotball.motion import Motion
from robotball.robot.scene import Scene
from robotball.rotations import Array, uneven

_LOAD_TIMES = 20_001  # times over a scene at which the load is computed
_FINE = 1e-12  # s, the tolerance of the time of the least load


def in_space(motion: Motion) -> Array:
    """Return the contact points in space of a motion on a moving plane.

    At time 0 the plane is at the origin and at rest. A plane that oscillates therefore starts at a
    turning point, and its acceleration is a sine with the phase π/2 or -π/2.

    Parameters
    ----------
    motion : Motion
        The motion, whose contact points are relative to the plane.

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
    from robotball.robot.function_drives import polynomials_of  # not needed by the equations

    scene = motion.scene.until(float(motion.times[-1]))
    edges = [0.0, *(t for t in scene.breakpoints if t < scene.duration), scene.duration]
    place = np.zeros((len(motion.times), 3))
    place[:, :2] = motion.contact_point
    for axis, drive in enumerate(scene.plane_drives):
        # A drive gives only its first integral, here the velocity.
        of_plane = polynomials_of(drive.angle, edges)
        place[:, axis] += [of_plane.area(t) for t in motion.times.tolist()]
    return place


def check_still(scene: Scene, what: str) -> None:
    """Raise InputError if the plane moves or turns, which `what` cannot express."""
    check_no_turn(scene, what)
    if scene.plane_moves:
        raise InputError(f"{scene.name}: {what} cannot have a moving plane")


def check_no_turn(scene: Scene, what: str) -> None:
    """Raise InputError if the plane turns, which `what` cannot express."""
    if scene.plane_turns:
        raise InputError(f"{scene.name}: {what} cannot have a turning plane")


def check_pressed(scene: Scene) -> None:
    """Raise InputError if a balanced ball lifts off the moving plane."""
    from scipy.optimize import brentq, minimize_scalar  # late: few planes move

    def load(t: float) -> float:
        return float(-scene.gravity_at(t)[2])

    # With ramps and samples, the load is least at a breakpoint. With a sine, all periods have the
    # same least load, and one of these minima is next to the sampled time with the least load.
    times = np.union1d(uneven(scene.duration, scene.duration / _LOAD_TIMES), scene.breakpoints)
    i = int(np.clip(scene.gravity_at(times)[:, 2].argmax(), 1, len(times) - 2))
    beside = (times[i - 1], times[i + 1])
    least = minimize_scalar(load, bounds=beside, method="bounded", options={"xatol": _FINE}).x
    times = np.union1d(times, least)
    off = np.flatnonzero(~(-scene.gravity_at(times)[:, 2] > 0))
    if len(off):
        i = int(off[0])
        raise lift_off(float(brentq(load, times[i - 1], times[i])) if i else 0.0)


def lift_off(t: float) -> EarlyEndError:
    """Return the error of a ball that leaves the plane at t [s]."""
    return EarlyEndError(
        f"the ball lifts off the plane at t = {t:.9g} s and stops rolling: shorten the motion, or "
        "move the bodies and the plane more gently"
    )
