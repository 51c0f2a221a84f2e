"""Estimate how much of the distance between two motions is the motion's own sensitivity.

The engine starts anew on the equations' motion at equal stretches and runs to the end of each: its
error there, the defect, is all that it can be blamed for. The growth of a defect afterwards is a
matter of the equations alone, and linear to first order. All defects, carried on by the difference
of two neighbouring motions of the equations and added, are the error to expect.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from robotball import Engine, Motion, Scene, integrate
from robotball.engines.engine import Runner
from robotball.motion import ContactMotion, path_error, path_errors
from robotball.robot.scene import Start
from robotball.rotations import Array, turn_between, turned

# Short beside the time in which a chaotic motion of the catalog doubles a difference, 2 to 6 s.
_STRETCH = 2.5  # s
_FEWEST_STRETCHES, _MOST_STRETCHES = 8, 400  # stretches
_LONG = 100.0  # s, in which chaos shows itself
# The difference of two neighbouring motions, in rad: its square and rounding are far below it.
_NEAR = 1e-6
_TURN = np.array([0.6, 0.48, 0.64])  # about no axis of the frame
# Twice the time doubles the growth of a regular motion; more than this is exponential.
_EXPONENTIAL = 10.0
# How many times the expected error the measured one may be. On the chaotic scenes 0.02 to 1.8 at
# the finer presets, to round-off, and 4.9 and 7.9 at `fast`.
_LEEWAY = 20.0


@dataclass(frozen=True)
class Sensitivity:
    """The growth of an engine's small errors by the motion itself.

    exponent     1/s  of the growth of a small turn of the start, over the motion's second half
    doubling     by how much twice the time multiplies that growth; 2 in a regular motion
    defect       of the engine over stretches from states of the equations, over the path's length
    expected     the path error over the path's length that the motion makes of the defects
    measured     the path error over the path's length
    tolerance      that the settings are held to
    agrees_until s    when the path error passes the tolerance
    """

    exponent: float
    doubling: float
    defect: float
    expected: float
    measured: float
    tolerance: float
    agrees_until: float

    @property
    def explains(self) -> bool:
        """Whether the engine keeps its tolerance, and the motion's own growth does the rest.

        Errors beyond what the growth makes of the defects stay the engine's, and so do all errors
        of a motion that is regular.
        """
        return (
            self.defect <= self.tolerance
            and self.doubling > _EXPONENTIAL
            and self.measured <= _LEEWAY * self.expected
        )

    def __str__(self) -> str:
        return (
            f"sensitive: agrees until t = {self.agrees_until:.3g} s; from then on the motion "
            f"itself makes errors of {self.defect:.1e} grow beyond {self.tolerance:g} "
            f"(exponent {self.exponent:.3g} 1/s)"
        )


def sensitivity(engine: Engine, motion: ContactMotion, theory: Motion) -> Sensitivity | None:
    """Estimate the sensitivity of a scene's motion to the errors that an engine makes.

    motion: the engine's, by the settings in its report; theory: the equations' motion at the same
    times. None where the commands change in time and where the engine breaks off: there it is not
    known. Costs as much as the engine's motion and three by the equations.
    """
    scene, settings = theory.scene, motion.report.settings
    errors, path_scale = path_errors(motion, theory), theory.path_scale
    if not scene.steady:
        return None
    duration = float(theory.times[-1])
    right = _stretches_of(theory)
    defects = _defects(engine.prepare(scene, settings), right)
    if defects is None:
        return None
    expected = max(math.hypot(*error[-2:]) for error in _carried(right, defects))
    doubling = _doubling(right)
    passed = errors > settings.error_tolerance * path_scale
    return Sensitivity(
        exponent=doubling / (duration - float(right.times[(len(right.times) - 1) // 2])),
        doubling=math.exp(min(doubling, 700.0)),  # finite
        defect=_total(defects, path_scale),
        expected=expected / path_scale,
        measured=float(errors.max() / path_scale),
        tolerance=settings.error_tolerance,
        agrees_until=float(theory.times[np.argmax(passed)] if passed.any() else duration),
    )


def _stretches_of(theory: Motion) -> Motion:
    """Return the equations' motion at the ends of equal stretches of a longer one."""
    duration = float(theory.times[-1])
    count = int(np.clip(duration / _STRETCH, _FEWEST_STRETCHES, _MOST_STRETCHES))
    return integrate(theory.scene, np.linspace(0.0, duration, count + 1))


def total_defect(run: Runner, theory: Motion) -> float | None:
    """Return the sum of an engine's path errors over stretches that start on the right motion.

    It is over the path's length; None where a stretch is not run to its end.
    """
    defects = _defects(run, _stretches_of(theory))
    return None if defects is None else _total(defects, theory.path_scale)


def _total(defects: Array, path_scale: float) -> float:
    return float(np.linalg.norm(defects[:, -2:], axis=1).sum() / path_scale)


def growth(theory: Motion) -> float | None:
    """Return the path error, over the path's length, that a turn of the start makes, over the turn.

    It takes the place of `sensitivity` where a controller closes the loop, which cannot start anew
    in the midst of its motion: twice the growth makes twice of an engine's error. None where the
    neighbouring motion ends early.
    """
    error = np.zeros(8 + 2 * len(_moving(theory.scene)))
    error[:3] = _NEAR * _TURN
    near = integrate(_started(theory, 0, error), theory.times)
    return None if len(near.times) < len(theory.times) else path_error(near, theory) / _NEAR


def chaotic(scene: Scene, duration: float = _LONG) -> bool:
    """Return whether a small turn of the start grows exponentially over `duration` [s].

    It is False where the commands change in time, as it is not known there.
    """
    if not scene.steady:
        return False
    right = integrate(scene, np.linspace(0.0, duration, int(duration / _STRETCH) + 1))
    return _doubling(right) > math.log(_EXPONENTIAL)


def _defects(run: Runner, right: Motion) -> Array | None:
    """Return an engine's errors (k, e) at the ends of k stretches that start on the right motion.

    It is None where a stretch is not run to its end.
    """
    defects = []
    for i, length in enumerate(np.diff(right.times)):
        motion = run(np.array([0.0, length]), _started(right, i))
        if len(motion.times) < 2:
            return None
        defects.append(_difference(motion, right, i))
    return np.array(defects)


# An error (e,): a turn (3) rad, frame axes; the change of M (3), world, over its scale; of the
# angles (f) rad and rates (f) rad/s of hinges whose rate is not given; last, of the path (2) m.


def _moving(scene: Scene) -> list[int]:
    """Return the indices of the hinges whose rate is not given."""
    return [i for i, hinge in enumerate(scene.hinges) if hinge.motor is not None]


def _started(right: Motion, i: int, error: Array | None = None) -> Scene:
    """Return the scene as it is at the start of stretch i, off by an error (e,) if one is given."""
    scene = right.scene
    attitude, M = right.attitude[i], right.momentum[i]
    angles, rates = right.hinge_angles[i].copy(), right.hinge_rates[i].copy()
    if error is not None:
        attitude = turned(attitude, error[:3])
        M = M + error[3:6] * scene.momentum_scale
        if scene.rolling == "rubber":
            M[2] = 0.0  # by (3.1)
        of_angles, of_rates = np.split(error[6:-2], 2)
        angles[_moving(scene)] += of_angles
        rates[_moving(scene)] += of_rates
    at = replace(scene, start=Start(attitude, M))
    return at.with_hinges(angle=angles, rate=rates) if scene.not_reduced else at


def _difference(other: Motion, right: Motion, i: int) -> Array:
    """Return the error (e,) at the end of a motion over stretch i."""
    scene = right.scene
    turn = turn_between(right.attitude[i + 1], other.attitude[-1])
    moved = other.momentum[-1] - right.momentum[i + 1]
    way = right.contact_point[i + 1] - right.contact_point[i]
    off = other.contact_point[-1] - other.contact_point[0] - way
    free = _moving(scene)
    angles = (other.hinge_angles[-1] - right.hinge_angles[i + 1])[free]
    rates = (other.hinge_rates[-1] - right.hinge_rates[i + 1])[free]
    return np.concatenate([turn, moved / scene.momentum_scale, angles, rates, off])


def _transfer(right: Motion, i: int, error: Array) -> Array:
    """Return an error (e,) at the start of stretch i as it is at its end, to first order."""
    size = float(np.linalg.norm(error[:-2]))
    if not size > 0:
        return error
    stretch = np.array([0.0, right.times[i + 1] - right.times[i]])
    near = _started(right, i, _NEAR / size * error)
    grown = _difference(integrate(near, stretch), right, i)
    grown *= size / _NEAR
    grown[-2:] += error[-2:]
    return grown


def _carried(right: Motion, defects: Array) -> list[Array]:
    """Return the error (e,) at the end of every stretch, of which each adds its defect."""
    error, errors = np.zeros(defects.shape[1]), []
    for i, defect in enumerate(defects):
        error = _transfer(right, i, error) + defect
        # Beyond a whole turn nothing grows any more.
        error[:-2] *= min(1.0, 2 * math.pi / max(float(np.linalg.norm(error[:-2])), 1e-300))
        errors.append(error)
    return errors


def _doubling(right: Motion) -> float:
    """Return the logarithm of the growth of a small turn of the start over the second half."""
    error, total, growth = np.zeros(8 + 2 * len(_moving(right.scene))), 0.0, []
    error[:3] = _TURN
    for i in range(len(right.times) - 1):
        error = _transfer(right, i, error)
        size = float(np.linalg.norm(error[:-2]))
        total += math.log(size)
        error = error / size
        error[-2:] = 0.0
        growth.append(total)
    return growth[-1] - growth[len(growth) // 2 - 1]
