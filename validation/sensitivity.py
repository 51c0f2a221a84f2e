"""Estimate how much of the path error is due to the sensitivity of the motion.

The reference is divided into equal stretches. The engine starts on the reference at the beginning
of each stretch; its error at the end, the defect, is the error of the engine. The equations
determine how a defect grows afterwards; to first order the growth is linear. The growth is computed
from the difference of two neighbouring motions of the equations. The sum of all grown defects is
the expected error.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from robotball import Engine, Motion, Scene, integrate
from robotball.engines.engine import Runner
from robotball.motion import ContactMotion, path_error, path_errors
from robotball.robot.scene import Start
from robotball.rotations import Array, turn_between, turned

_STRETCH = 2.5  # s; differences double in 2 to 6 s in the chaotic scenes of the catalog
_FEWEST_STRETCHES, _MOST_STRETCHES = 8, 400
_LONG = 100.0  # s, long enough to show chaos
_NEAR = 1e-6  # rad, difference of neighbouring motions; its square and rounding are far smaller
_TURN = np.array([0.6, 0.48, 0.64])  # a rotation axis that is not an axis of the frame
_EXPONENTIAL = 10.0  # growth in twice the time; it is 2 in a regular motion
# Largest ratio of the measured to the expected error. Measured in the chaotic scenes: 0.02 to 1.8
# with the finer presets, and 4.9 and 7.9 with `fast`.
_LEEWAY = 20.0


@dataclass(frozen=True)
class Sensitivity:
    """Growth of an engine's small errors due to the motion. Path errors are relative.

    Attributes
    ----------
    exponent : float, 1/s
        The growth rate of a small rotation of the start, in the second half of the motion.
    doubling : float
        The growth in the second half of the motion; 2 if it is regular.
    defect : float
        The sum of the engine's errors over the stretches.
    expected : float
        The path error expected from the defects.
    measured : float
        The measured path error.
    tolerance : float
        The tolerance of the settings.
    agrees_until : float, s
        The time at which the path error exceeds the tolerance.
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
        """Whether the defects are within the tolerance and the growth explains the path error.

        The growth must be exponential.
        """
        return (
            self.defect <= self.tolerance
            and self.doubling > _EXPONENTIAL
            and self.measured <= _LEEWAY * self.expected
        )

    def __str__(self) -> str:
        return (
            f"sensitive: agrees until t = {self.agrees_until:.3g} s; then errors of "
            f"{self.defect:.1e} grow beyond {self.tolerance:g} because the motion is chaotic "
            f"(exponent {self.exponent:.3g} 1/s)"
        )


def sensitivity(engine: Engine, motion: ContactMotion, theory: Motion) -> Sensitivity | None:
    """Estimate the sensitivity of a motion to the errors of the engine.

    Returns None if commands change in time, the plane turns or a run fails. The estimate takes as
    long as a run of the engine and three integrations.
    """
    scene, settings = theory.scene, motion.report.settings
    errors, path_scale = path_errors(motion, theory), theory.path_scale
    if not scene.steady:
        return None
    duration = float(theory.times[-1])
    stretches = _stretches_of(theory)
    defects = _defects(engine.prepare(scene, settings), stretches)
    if defects is None:
        return None
    expected = max(math.hypot(*error[-2:]) for error in _carried(stretches, defects))
    doubling = _doubling(stretches)
    middle = float(stretches.times[(len(stretches.times) - 1) // 2])
    passed = errors > settings.error_tolerance * path_scale
    return Sensitivity(
        exponent=doubling / (duration - middle),
        doubling=math.exp(min(doubling, 700.0)),  # finite
        defect=_total(defects, path_scale),
        expected=expected / path_scale,
        measured=float(errors.max() / path_scale),
        tolerance=settings.error_tolerance,
        agrees_until=float(theory.times[np.argmax(passed)] if passed.any() else duration),
    )


def _stretches_of(theory: Motion) -> Motion:
    """Return the reference motion at the ends of equal stretches."""
    duration = float(theory.times[-1])
    count = int(np.clip(duration / _STRETCH, _FEWEST_STRETCHES, _MOST_STRETCHES))
    return integrate(theory.scene, np.linspace(0.0, duration, count + 1))


def total_defect(run: Runner, theory: Motion) -> float | None:
    """Return the sum of an engine's defects, divided by the path's length; None if a run fails."""
    defects = _defects(run, _stretches_of(theory))
    return None if defects is None else _total(defects, theory.path_scale)


def _total(defects: Array, path_scale: float) -> float:
    return float(np.linalg.norm(defects[:, -2:], axis=1).sum() / path_scale)


def growth(theory: Motion) -> float | None:
    """Return the relative path error per radian of a small rotation of the start.

    This replaces `sensitivity` in closed loops, because a controller cannot start in the middle of
    a motion. Returns None if the neighbouring motion ends early.
    """
    near = integrate(neighbour(theory), theory.times)
    return None if len(near.times) < len(theory.times) else path_error(near, theory) / _NEAR


def neighbour(motion: Motion, hinges: bool = False) -> Scene:
    """Return the scene of a motion with a slightly rotated start.

    hinges: also disturb angles and rates of the hinges with motors.
    """
    error = np.zeros(8 + 2 * len(_moving(motion.scene)))
    error[:3] = _NEAR * _TURN
    error[6:-2] = _NEAR * hinges
    return _started(motion, 0, error)


def chaotic(scene: Scene, duration: float = _LONG) -> bool:
    """Return whether a small rotation of the start grows exponentially over `duration` [s].

    False if the commands change in time, because then the growth is unknown.
    """
    if not scene.steady:
        return False
    reference = integrate(scene, np.linspace(0.0, duration, int(duration / _STRETCH) + 1))
    return _doubling(reference) > math.log(_EXPONENTIAL)


def _defects(run: Runner, reference: Motion) -> Array | None:
    """Return an engine's errors (k, e) at the ends of k stretches; None if they are unknown."""
    if reference.scene.plane_turns:
        return None  # runs start at the axis, not at the beginning of a stretch
    defects = []
    for i, length in enumerate(np.diff(reference.times)):
        motion = run(np.array([0.0, length]), _started(reference, i))
        if len(motion.times) < 2:
            return None
        defects.append(_difference(motion, reference, i))
    return np.array(defects)


# An error (e,): a rotation (3) [rad], frame axes; the change of M (3) in world axes, divided by the
# scale of M; changes of angles (f) [rad] and rates (f) [rad/s] of hinges with motors; a change of
# path (2) [m].


def _moving(scene: Scene) -> list[int]:
    """Return the indices of the hinges with motors."""
    return [i for i, hinge in enumerate(scene.hinges) if hinge.motor is not None]


def _started(reference: Motion, i: int, error: Array | None = None) -> Scene:
    """Return the scene that starts at the beginning of stretch i, with an error (e,) if given."""
    scene = reference.scene
    attitude, M = reference.attitude[i], reference.momentum[i]
    angles, rates = reference.hinge_angles[i].copy(), reference.hinge_rates[i].copy()
    if error is not None:
        attitude = turned(attitude, error[:3])
        M = M + error[3:6] * scene.momentum_scale
        if scene.rolling == "rubber":
            M[2] = 0.0  # (3.1)
        angle_errors, rate_errors = np.split(error[6:-2], 2)
        angles[_moving(scene)] += angle_errors
        rates[_moving(scene)] += rate_errors
    at = replace(scene, start=Start(attitude, M))
    return at.with_hinges(angle=angles, rate=rates) if scene.not_reduced else at


def _difference(other: Motion, reference: Motion, i: int) -> Array:
    """Return the error (e,) at the end of a motion over stretch i."""
    scene = reference.scene
    turn = turn_between(reference.attitude[i + 1], other.attitude[-1])
    moved = other.momentum[-1] - reference.momentum[i + 1]
    way = reference.contact_point[i + 1] - reference.contact_point[i]
    off = other.contact_point[-1] - other.contact_point[0] - way
    free = _moving(scene)
    angles = (other.hinge_angles[-1] - reference.hinge_angles[i + 1])[free]
    rates = (other.hinge_rates[-1] - reference.hinge_rates[i + 1])[free]
    return np.concatenate([turn, moved / scene.momentum_scale, angles, rates, off])


def _transfer(reference: Motion, i: int, error: Array) -> Array:
    """Propagate an error (e,) linearly from the beginning to the end of stretch i."""
    size = float(np.linalg.norm(error[:-2]))
    if not size > 0:
        return error
    stretch = np.array([0.0, reference.times[i + 1] - reference.times[i]])
    near = _started(reference, i, _NEAR / size * error)
    grown = _difference(integrate(near, stretch), reference, i)
    grown *= size / _NEAR
    grown[-2:] += error[-2:]
    return grown


def _carried(reference: Motion, defects: Array) -> list[Array]:
    """Return the error (e,) at the end of every stretch: the propagated error and the defect."""
    error, errors = np.zeros(defects.shape[1]), []
    for i, defect in enumerate(defects):
        error = _transfer(reference, i, error) + defect
        # Rotation errors are at most a full turn.
        error[:-2] *= min(1.0, 2 * math.pi / max(float(np.linalg.norm(error[:-2])), 1e-300))
        errors.append(error)
    return errors


def _doubling(reference: Motion) -> float:
    """Return the logarithmic growth of a small rotation in the second half of the motion."""
    error, total, growth = np.zeros(8 + 2 * len(_moving(reference.scene))), 0.0, []
    error[:3] = _TURN
    for i in range(len(reference.times) - 1):
        error = _transfer(reference, i, error)
        size = float(np.linalg.norm(error[:-2]))
        total += math.log(size)
        error = error / size
        error[-2:] = 0.0
        growth.append(total)
    return growth[-1] - growth[len(growth) // 2 - 1]
