"""Search for mistakes that explain the difference between a trajectory and the reference.

Each known mistake (`mistakes.py`) is undone alone. The mistake that reduces the errors most is
accepted, and the search continues with the remaining errors. Conventions are tried first because
they are cheap, whereas every other scene must be integrated. A shift in time is only reported.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from robotball import InputError, Motion, Scene, Trajectory, integrate
from robotball.engines.recorded import angular_velocity, sampled_rates
from robotball.motion import arrays_of, with_arrays
from robotball.rotations import Array, continuous

from .mistakes import (
    Errors,
    Truth,
    conventions,
    errors_at,
    largest,
    mistaken_scenes,
    rows_of,
    some_of,
    typical,
)

_SHIFT_EXPLAINS = 3.0  # a shift is reported if it divides the error by more than this
_SHIFTS = 400  # shifts or stretches tried before the best one is refined
_LONGEST = 0.1  # largest shift and stretch as a fraction of the time
_LESSENS = np.log(5.0)  # a mistake must reduce one of the errors to a fifth
# Factors by which mistakes must divide the typical error and the root mean square of all errors
# together. Measured: 1.008 by chance, at least 2.9 and 1.28 if a planted mistake is undone.
_MOST = (2.0, 1.1)
# Largest remaining fraction of the typical error and of the root mean square, in path, attitude or
# ω. Measured: at most 0.09 and 0.30 if a planted mistake is undone; the rest is the engine's error.
_REMAINING = ((0.1,), (1 / 3,))
_SURE = 0.1  # a mistake is certain if at most this fraction of its largest error remains
_SPOILS = np.log(3.0)  # largest factor by which a mistake may increase another error
_AS_GOOD = np.log(1.5)  # mistakes within this factor explain the errors equally well
_SOUND = 1e-3  # relative, rad; below such errors of path and attitude no other scene is tried
_CLEAR = np.log(1e-2), 0.1  # typical and largest error below which a convention explains all
_MOST_MISTAKES = 4  # mistakes searched for in one file
_TRIED = 1e-9  # rtol of a mistaken scene's motion, far below the errors that matter
_SCENE, _TIME, _RATE = "scene", "time", "angular velocity"
_TURNS = "attitude", "world"  # families of conventions that change the attitude
_NOT_THE_RATE = "the angular velocity is not the rate of the attitude"
_ASTRAY = 1e-2  # relative error of ω from which it is computed anew; half a step late has less
_FINE = 4000  # samples of a motion that is interpolated


@dataclass(frozen=True)
class Lag:
    """Delay of a trajectory behind the reference.

    Attributes
    ----------
    shift : float, s
        The delay.
    before, after : float
        The root mean square of the relative path and attitude errors, without and with the shift.
    """

    shift: float
    before: float
    after: float

    @property
    def explains(self) -> bool:
        """Whether the shift explains most of the error."""
        return self.after * _SHIFT_EXPLAINS < self.before


def lag_of(file: Trajectory, reference: Motion) -> Lag:
    """Return the lag of a trajectory behind a reference with as many samples."""
    times, end = file.times, float(reference.times[-1])
    most = min(_LONGEST * end, end - float(times[0]))
    step = max(2 * most / _SHIFTS, min(most, float(np.median(np.diff(times)))) / 4)
    error = _error_at(file, reference)
    tried = np.arange(-most, most + step / 2, step)
    shift = _least(lambda shift: error(times - shift), tried, 1e-9)
    return Lag(shift, error(times), error(times - shift))


def _least(error: Callable[[float], float], tried: Array, xatol: float) -> float:
    """Minimize an error near the best of equally spaced values (n,)."""
    best, step = float(min(tried, key=error)), float(tried[1] - tried[0])
    bounds = best - step, best + step
    return float(
        minimize_scalar(error, bounds=bounds, method="bounded", options={"xatol": xatol}).x
    )


def _error_at(file: Trajectory, reference: Motion) -> Callable[[Array], float]:
    """Return a function of other times (n,) [s] of the rows: the trajectory's error as in `Lag`.

    Rows with times outside the reference are ignored.
    """
    nodes = reference.times
    values = np.column_stack([reference.contact_point, continuous(reference.attitude)])
    motion = CubicHermiteSpline(nodes, values, sampled_rates(nodes, values)[0])

    def error(times: Array) -> float:
        inside = (times >= 0) & (times <= nodes[-1])
        path, turn = np.split(motion(times[inside]), [2], axis=1)
        apart = ((file.position[inside, :2] - path) ** 2).sum(axis=1) / reference.path_scale**2
        # The attitude error is 2|sin(angle/2)|, for either sign of the quaternions.
        cosine = np.abs((turn * file.attitude[inside]).sum(axis=1)) / np.linalg.norm(turn, axis=1)
        return float(np.sqrt(np.mean(apart + 2 * (1 - np.minimum(cosine, 1.0)))))

    return error


@dataclass(frozen=True)
class Mistake:
    """A mistake, the errors with and without it, and equally good alternatives."""

    family: str
    name: str
    before: Errors
    after: Errors
    as_well: tuple[str, ...]

    @property
    def left(self) -> float:
        """The smallest remaining fraction of the largest error of path, attitude or ω."""
        pairs = zip(astuple(self.after), astuple(self.before), strict=True)
        return min(after / before for after, before in pairs if before)

    @property
    def sure(self) -> bool:
        """Whether so little error remains that the mistake is certain."""
        return self.left <= _SURE


def reference_of(scene: Scene, times: Array, **options: Any) -> Motion:
    """Integrate the scene at 0 and at the times (n,) of a trajectory; options of `integrate`."""
    return integrate(scene, times if times[0] == 0 else np.concatenate([[0.0], times]), **options)


@dataclass(frozen=True)
class _Candidate:
    """A mistake to try: rows of the file with the mistake undone, and their expected values.

    Most conventions leave the attitude as it is; then `angle` (n,) is its known error.
    """

    family: str
    name: str
    parts: int
    file: Trajectory
    truth: Truth
    scene: Scene
    angle: Array | None = None

    @cached_property
    def errors(self) -> tuple[Array, ...]:
        return errors_at(self.file, self.truth, self.angle)

    @cached_property
    def typical(self) -> Array:
        return typical(self.errors, self.file.times)

    @property
    def sizes(self) -> Array:
        """Typical size and root mean square of each error, (2, 2 or 3)."""
        mean_square = np.sqrt(np.mean(np.square(self.errors), axis=1))
        return np.array([np.exp(self.typical), mean_square])


class Search:
    """Search a trajectory for the mistakes that explain its errors, the largest first.

    Attributes
    ----------
    plain : Errors
        The errors of the file as written.
    mistakes : tuple of Mistake
        The mistakes found.
    scene : Scene
        The scene that was simulated, as far as the mistakes show.
    corrected : Trajectory
        The trajectory with wrong conventions undone.
    theory : Motion
        The motion of `scene` at the times of `corrected`.
    at : slice
        The rows that were searched.
    """

    def __init__(self, trajectory: Trajectory, theory: Motion) -> None:
        """Search a trajectory; the theory is its reference."""
        self.trajectory, self.theory = trajectory, theory
        self.at = some_of(len(trajectory.times))
        rows, truth = rows_of(trajectory, self.at), self._truth(theory, self.at.step)
        # The file as written, then with each accepted mistake undone as well.
        self._accepted = [_Candidate("", "", 0, rows, truth, theory.scene)]
        self.plain = largest(self._accepted[0].errors)
        self.mistakes = tuple(self._mistakes())
        self.scene = self._accepted[-1].scene
        self.corrected = self._corrected()

    def _mistakes(self) -> list[Mistake]:
        """Return the mistakes that explain the errors.

        Each mistake, with the mistakes after it, must remove most of the errors before it, and
        nearly all error of path, attitude or ω. An unknown mistake can look like a known one that
        reduces one error by chance, or only at the beginning. Such a candidate is dropped.
        """
        tried = list(self._lessening())
        left = [candidate.sizes for candidate in self._accepted]
        explain = [k for k in range(len(left)) if all(_explain(left[k], b) for b in left[:k])]
        self._accepted = self._accepted[: explain[-1] + 1]
        return tried[: explain[-1]]

    def _lessening(self) -> Iterator[Mistake]:
        """Yield mistakes that each reduce the errors left by the mistakes before it."""
        while len(self._accepted) <= _MOST_MISTAKES:
            now = self._accepted[-1]
            before = largest(now.errors)
            families = {candidate.family for candidate in self._accepted}
            if before.rate is None:
                families.add(_RATE)
            candidates = [
                _Candidate(
                    convention.family, convention.name, convention.parts, convention.undo(now.file),
                    now.truth, now.scene, None if convention.family in _TURNS else now.errors[1],
                )
                for convention in conventions(now.truth, self._has_height)
                if convention.family not in families
            ]  # fmt: skip
            best = _best(candidates, now)
            wrong = max(before.path, before.attitude) > _SOUND
            if wrong and not {_SCENE, _TIME} & families and not (best and _is_clear(best[0])):
                candidates += [replace(other, file=now.file) for other in self._scenes]
                candidates += self._stretched()
                best = _best(candidates, now)
            if _RATE not in families and (before.rate or 0.0) > _ASTRAY:
                # Otherwise limited rates would be called by the nearest convention.
                recomputed = _best([self._rate_of_attitude()], now)
                if recomputed and (best is None or _is_closer(recomputed[0], best[0])):
                    best = recomputed
            if best is None:
                return
            chosen, as_well = best
            self._accepted.append(chosen)
            yield Mistake(chosen.family, chosen.name, before, largest(chosen.errors), as_well)

    def _corrected(self) -> Trajectory:
        """Undo the wrong conventions in all rows, and set `theory` to the motion of `scene`."""
        first, *accepted = self._accepted
        if not accepted:
            return self.trajectory
        last = accepted[-1]
        # A stretch is the same for all rows.
        times = self.trajectory.times * (last.file.times[-1] / first.file.times[-1])
        file = replace(self.trajectory, times=times, momentum=None)
        # Integrating at all rows of a long file takes as long as trying many mistakes.
        if self.theory.scene is not last.scene or self.theory.times[-1] != times[-1]:
            self.theory = reference_of(last.scene, times)
        truth = self._truth(self.theory, 1)
        undo = {
            convention.name: convention.undo for convention in conventions(truth, self._has_height)
        }
        undo[_NOT_THE_RATE] = _with_own_rate
        for candidate in accepted:
            if candidate.name in undo:
                file = undo[candidate.name](file)
        return file

    @property
    def _has_height(self) -> bool:
        return bool(np.isfinite(self.trajectory.position[0, 2]))

    def _truth(self, theory: Motion, step: int) -> Truth:
        first = 0 if self.trajectory.times[0] == 0 else 1
        rows = {place: array[first::step] for place, array in arrays_of(theory)}
        return Truth(with_arrays(theory, rows), theory.path_scale)

    @cached_property
    def _scenes(self) -> list[_Candidate]:
        """The motions of scenes that may have been simulated instead; integrated once."""
        file, candidates = self._accepted[-1].file, []
        for name, scenes in mistaken_scenes(self._accepted[-1].scene):
            for scene in scenes:
                with contextlib.suppress(InputError):  # nobody can have simulated such a ball
                    truth = self._truth(reference_of(scene, file.times, rtol=_TRIED), 1)
                    candidates.append(_Candidate(_SCENE, name, 1, file, truth, scene))
        return candidates

    def _stretched(self) -> Iterator[_Candidate]:
        """Yield the scene's own motion on another clock."""
        file, scene = self._accepted[-1].file, self._accepted[-1].scene
        later = np.linspace(0, file.times[-1] / (1 - _LONGEST), _FINE)
        tried = np.linspace(1 - _LONGEST, 1 + _LONGEST, _SHIFTS + 1)
        with contextlib.suppress(InputError):  # a drive may end before
            error = _error_at(file, integrate(scene, later, rtol=_TRIED))
            stretch = _least(lambda stretch: error(file.times / stretch), tried, 1e-7)
            right = replace(file, times=file.times / stretch)
            truth = self._truth(reference_of(scene, right.times, rtol=_TRIED), 1)
            name = f"the times are too long by a factor of {stretch:.5g}"
            candidate = _Candidate(_TIME, name, 1, right, truth, scene)
            # A wrong clock shows in ω too. Another inertia may slow down the path alone.
            gain = self._accepted[-1].typical - candidate.typical
            if file.angular_velocity is None or gain[2] >= _LESSENS:
                yield candidate

    def _rate_of_attitude(self) -> _Candidate:
        rate = _with_own_rate(self._corrected()).angular_velocity
        file = replace(self._accepted[-1].file, angular_velocity=np.asarray(rate)[self.at])
        return replace(self._accepted[-1], family=_RATE, name=_NOT_THE_RATE, parts=1, file=file)


def _with_own_rate(file: Trajectory) -> Trajectory:
    return replace(file, angular_velocity=angular_velocity(file.times, file.attitude)[0])


def _explain(after: Array, before: Array) -> bool:
    """Return whether most of all errors together are gone, and nearly all of one of them."""
    all_together = np.linalg.norm(after, axis=1) * _MOST < np.linalg.norm(before, axis=1)
    return bool(all_together.all() and (after < _REMAINING * before).all(axis=0).any())


def _is_closer(recomputed: _Candidate, best: _Candidate) -> bool:
    """Return whether ω from the attitude is far more accurate than a convention of ω."""
    return best.family == _RATE and bool(best.typical[2] - recomputed.typical[2] > _LESSENS)


def _is_clear(candidate: _Candidate) -> bool:
    typically, at_most = _CLEAR
    return bool(
        np.all(candidate.typical[:2] < typically) and np.max(candidate.errors[:2]) < at_most
    )


def _best(
    candidates: Sequence[_Candidate], now: _Candidate
) -> tuple[_Candidate, tuple[str, ...]] | None:
    """Return the simplest of the best candidates, and the names of equally good ones."""
    gains = []
    for candidate in candidates:
        gain = now.typical - candidate.typical
        if gain.max() >= _LESSENS and gain.min() >= -_SPOILS:
            gains.append((float(gain.sum()), candidate))
    if not gains:
        return None
    least = max(gain for gain, _ in gains) - _AS_GOOD
    good = [candidate for gain, candidate in gains if gain > least]
    chosen = min(good, key=lambda candidate: candidate.parts)
    names = dict.fromkeys(other.name for other in good if other.parts == chosen.parts)
    return chosen, tuple(name for name in names if name != chosen.name)
