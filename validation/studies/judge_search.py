"""The search for mistakes that explain how a trajectory differs from the reference.

Each known mistake (`mistakes.py`) is undone by itself. The one that lessens the errors most is
taken for made, and the search goes on with what is left. Conventions come first: they are cheap to
try, and another scene has to be integrated. A shift in time is reported, and undone nowhere.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from robotball import InputError, Motion, Scene, Trajectory, integrate
from robotball.engines import recorded as derivative
from robotball.engines.recorded import sampled_rates
from robotball.rotations import Array, continuous
from validation.studies.mistakes import (
    Errors,
    Numbers,
    Truth,
    conventions,
    errors_at,
    largest,
    mistaken_scenes,
    numbers_of,
    some_of,
    truth_of,
    typical,
)

_SHIFT_EXPLAINS = 3.0  # times less error, from where on a shift is reported
_SHIFTS = 400  # that are tried, at most, before the best is found among its neighbours
_LONGEST = 0.1  # of the time, that a trajectory is shifted by, or stretched


@dataclass(frozen=True)
class Lag:
    """The shift [s] of a trajectory behind the reference, and the errors with and without it.

    before, after: typical errors, the root mean square of path and attitude together, relative.
    """

    shift: float
    before: float
    after: float

    @property
    def explains(self) -> bool:
        return self.after * _SHIFT_EXPLAINS < self.before


def lag_of(times: Array, numbers: Numbers, reference: Motion) -> Lag:
    """Return the lag of numbers at times (n,) [s] behind a reference that is sampled as finely."""
    end = float(reference.times[-1])
    most = min(_LONGEST * end, end - float(times[0]))
    step = max(2 * most / _SHIFTS, min(most, float(np.median(np.diff(times)))) / 4)
    error = _error_at(numbers, reference)
    tried = np.arange(-most, most + step / 2, step)
    shift = _least(lambda shift: error(times - shift), tried, 1e-9)
    return Lag(shift, error(times), error(times - shift))


def _stretch_of(times: Array, numbers: Numbers, reference: Motion) -> float:
    """Return the factor by which the times (n,) [s] of numbers seem too long.

    reference: a motion in fine samples, until after the trajectory's end.
    """
    error = _error_at(numbers, reference)
    tried = np.linspace(1 - _LONGEST, 1 + _LONGEST, _SHIFTS + 1)
    return _least(lambda stretch: error(times / stretch), tried, 1e-7)


def _least(error: Callable[[float], float], tried: Array, to: float) -> float:
    """Return where an error is least, up to `to`: near the best of equally spaced values (n,)."""
    best, step = float(min(tried, key=error)), float(tried[1] - tried[0])
    found = minimize_scalar(
        error, bounds=(best - step, best + step), method="bounded", options={"xatol": to}
    )
    return float(found.x)


def _error_at(numbers: Numbers, reference: Motion) -> Callable[[Array], float]:
    """Return the error of numbers, as in `Lag`, where the reference is taken at times (n,) [s].

    Numbers whose time is beyond the reference's ends do not count.
    """
    known, q = reference.times, continuous(reference.attitude)
    path, attitude = (
        CubicHermiteSpline(known, values, sampled_rates(known, values)[0])
        for values in (reference.contact_point, q)
    )

    def error(times: Array) -> float:
        inside = (times >= 0) & (times <= known[-1])
        ours, theirs = numbers.position[inside, :2], path(times[inside])
        turn = attitude(times[inside])
        # 2|sin(half the angle)| between them, whatever the signs.
        cosine = np.abs((turn * numbers.attitude[inside]).sum(axis=1))
        cosine /= np.linalg.norm(turn, axis=1)
        apart = ((ours - theirs) ** 2).sum(axis=1) / reference.path_scale**2
        return float(np.sqrt(np.mean(apart + 2 * (1 - np.minimum(cosine, 1.0)))))

    return error


_LESSENS = np.log(5.0)  # by how much a mistake must lessen one of the errors
# Times less of all errors together, typical and mean square, that is most of them: 1.008 by chance,
# and at least 2.9 and 1.28 where a planted mistake is undone.
_MOST = (2.0, 1.1)
# Of path, attitude or ω, the part of the typical error and of its mean square that may be left:
# 0.09 and 0.30 at most where a planted mistake is undone, of which the rest is the engine's.
_REMAINING = ((0.1,), (1 / 3,))
SURE = 0.1  # the part of its largest error that a mistake may leave if it is said to be made
_SPOILS = np.log(3.0)  # by how much it may worsen another one, which is wrong anyway
_AS_GOOD = np.log(1.5)  # two mistakes so near explain as much as each other
_SOUND = 1e-3  # errors of path and attitude, below which no other scene is tried
_CLEAR = np.log(1e-2), 0.1  # errors, typical and largest, below which a convention is all
_MOST_MISTAKES = 4  # that are looked for in one file
_TRIED = 1e-9  # of a step, of a mistaken scene's motion: far below what explains anything
_SCENE, _TIME, _RATE = "scene", "time", "angular velocity"
_NOT_THE_RATE = "the angular velocity is not the attitude's rate"
_ASTRAY = 1e-2  # of ω, relative; one that is sampled half a step away is less off
_FINE = 4000  # samples of a motion that is asked between them


@dataclass(frozen=True)
class Mistake:
    """A mistake, the errors with and without it, and others that are as good."""

    family: str
    name: str
    before: Errors
    after: Errors
    as_well: tuple[str, ...] = ()

    @property
    def left(self) -> float:
        """Return the least part that is left of the largest error of path, attitude or ω."""
        pairs = zip(astuple(self.after), astuple(self.before), strict=True)
        return min(after / before for after, before in pairs if before)

    @property
    def sure(self) -> bool:
        """Return whether so little is left that the mistake is said to be made."""
        return self.left <= SURE


def reference_of(scene: Scene, times: Array) -> Motion:
    """Integrate the scene at 0 and at the times (n,) of a trajectory."""
    return integrate(scene, _from_zero(times))


@dataclass(frozen=True)
class _Option:
    """A mistake that may be the next: the numbers without it, and what they should be then."""

    family: str
    name: str
    parts: int
    numbers: Numbers
    truth: Truth
    scene: Scene
    stretch: float = 1.0

    @cached_property
    def errors(self) -> tuple[Array, ...]:
        return errors_at(self.numbers, self.truth)

    @cached_property
    def typical(self) -> Array:
        return typical(self.errors, self.truth.times)

    def mistake(self, before: tuple[Array, ...], as_well: Iterable["_Option"]) -> Mistake:
        """Return the mistake; before: the errors with it, as_well: options that explain as much."""
        names = tuple(each.name for each in as_well)
        return Mistake(self.family, self.name, largest(before), largest(self.errors), names)


class Search:
    """The mistakes in a file, the one that explains most first.

    plain: the errors of the file as it stands. scene: the one that was simulated, as far as the
    mistakes show; corrected: the file's trajectory in the right conventions; theory: the motion of
    that scene at its times.
    """

    def __init__(self, trajectory: Trajectory, theory: Motion, rolling_radius: float) -> None:
        """Search a trajectory of which the theory is the reference.

        rolling_radius: by the file's own path and rotation [m].
        """
        self.trajectory, self.rolling_radius = trajectory, rolling_radius
        self.at = some_of(len(trajectory.times))
        self.theory = theory
        self.scene, self.truth = theory.scene, self._truth(theory, self.at.step)
        self.numbers = numbers_of(trajectory, self.at)
        self.found: list[_Option] = []
        self.plain = largest(errors_at(self.numbers, self.truth))
        self.mistakes = tuple(self._mistakes())
        self.corrected = self._corrected()

    def _mistakes(self) -> list[Mistake]:
        """Return the mistakes that explain the errors.

        Each, with those after it, removes most of the error that it met, and of path, attitude or ω
        nearly all. Where the mistake is one that is not known, another may undo one of its errors
        by chance, or make one small at the beginning and large later: it is dropped.
        """
        meant, left = self.scene, [_sizes(errors_at(self.numbers, self.truth), self.truth)]
        tried = []
        for mistake in self._lessening():
            tried.append(mistake)
            left.append(_sizes(self.found[-1].errors, self.truth))
        explain = [all(_explain(left[k], each) for each in left[:k]) for k in range(1, len(left))]
        count = max((k for k, each in enumerate(explain, start=1) if each), default=0)
        self.found = self.found[:count]
        self.scene = self.found[-1].scene if self.found else meant
        return tried[:count]

    def _lessening(self) -> Iterator[Mistake]:
        """Yield mistakes that lessen an error; the next has to explain what each left."""
        for _ in range(_MOST_MISTAKES):
            before = errors_at(self.numbers, self.truth)
            families = {each.family for each in self.found}
            options = [each for each in self._conventions() if each.family not in families]
            best = _best(options, before)
            wrong = max(largest(before).path, largest(before).attitude) > _SOUND
            if wrong and not {_SCENE, _TIME} & families and not (best and _is_clear(best[0])):
                options += [*self._scenes(), *self._stretched()]
                best = _best(options, before)
            if _RATE not in families and (largest(before).rate or 0.0) > _ASTRAY:
                own = _best([self._rate_of_attitude()], before)
                if own and (best is None or _is_closer(own[0], best[0])):
                    best = own
            if best is None:
                return
            chosen, as_well = best
            self.found.append(chosen)
            self.numbers, self.truth, self.scene = chosen.numbers, chosen.truth, chosen.scene
            yield chosen.mistake(before, as_well)

    def _corrected(self) -> Trajectory:
        """Return the whole trajectory without the mistakes found in its conventions.

        `theory` is the motion of the scene as found then, at the trajectory's times.
        """
        if not self.found:
            return self.trajectory
        times = self.trajectory.times / np.prod([each.stretch for each in self.found])
        numbers = numbers_of(self.trajectory, slice(None))
        # To integrate at all rows of a long file takes as long as to try many mistakes.
        if self.theory.scene is not self.scene or self.theory.times[-1] != times[-1]:
            self.theory = reference_of(self.scene, times)
        truth = self._truth(self.theory, 1)
        undo = {each.name: each.undo for each in conventions(truth, self._has_height)}
        undo[_NOT_THE_RATE] = partial(_with_own_rate, times)
        for each in self.found:
            if each.name in undo:
                numbers = undo[each.name](numbers)
        return replace(
            self.trajectory,
            times=times,
            position=numbers.position,
            attitude=numbers.attitude,
            angular_velocity=numbers.rate,
            momentum=None,
        )

    @property
    def _has_height(self) -> bool:
        return bool(np.isfinite(self.trajectory.position[0, 2]))

    def _truth(self, theory: Motion, step: int) -> Truth:
        first = 0 if self.trajectory.times[0] == 0 else 1
        return truth_of(theory, slice(first, None, step))

    def _conventions(self) -> Iterator[_Option]:
        for each in conventions(self.truth, self._has_height):
            if each.family == _RATE and self.numbers.rate is None:
                continue
            numbers = each.undo(self.numbers)
            yield _Option(each.family, each.name, each.parts, numbers, self.truth, self.scene)

    def _scenes(self) -> list[_Option]:
        """Return the motions of scenes that may have been simulated instead."""
        return [
            _Option(_SCENE, name, 1, self.numbers, truth, scene)
            for name, scene, truth in self._others
        ]

    @cached_property
    def _others(self) -> list[tuple[str, Scene, Truth]]:
        times, found = _from_zero(self.truth.times), []
        for name, scenes in mistaken_scenes(self.scene, self.rolling_radius):
            for scene in scenes:
                with contextlib.suppress(InputError):  # of a ball that nobody can have simulated
                    theory = integrate(scene, times, rtol=_TRIED)
                    found.append((name, scene, self._truth(theory, 1)))
        return found

    def _stretched(self) -> Iterator[_Option]:
        """Yield the scene's own motion, at times that are not the file's."""
        times = self.truth.times
        later = np.linspace(0, times[-1] / (1 - _LONGEST), _FINE)
        with contextlib.suppress(InputError):  # of a drive that ends before
            fine = integrate(self.scene, later, rtol=_TRIED)
            stretch = _stretch_of(times, self.numbers, fine)
            theory = integrate(self.scene, _from_zero(times / stretch), rtol=_TRIED)
            name = f"the times are {stretch:.5g} times what they should be"
            truth = self._truth(theory, 1)
            yield _Option(_TIME, name, 1, self.numbers, truth, self.scene, stretch)

    def _rate_of_attitude(self) -> _Option:
        file = self._corrected()
        rate = _with_own_rate(file.times, numbers_of(file, slice(None))).rate
        numbers = replace(self.numbers, rate=None if rate is None else rate[self.at])
        return _Option(_RATE, _NOT_THE_RATE, 1, numbers, self.truth, self.scene)


def _with_own_rate(times: Array, numbers: Numbers) -> Numbers:
    return replace(numbers, rate=derivative.angular_velocity(times, numbers.attitude)[0])


def _sizes(errors: tuple[Array, ...], truth: Truth) -> Array:
    """Return each error's typical size and its root mean square (2, 2 or 3)."""
    mean_square = np.sqrt(np.mean(np.square(errors), axis=1))
    return np.array([np.exp(typical(errors, truth.times)), mean_square])


def _explain(after: Array, before: Array) -> bool:
    """Return whether sizes are most of those before in all together, and nearly all in one."""
    all_together = np.linalg.norm(after, axis=1) * _MOST < np.linalg.norm(before, axis=1)
    return bool(all_together.all() and (after < _REMAINING * before).all(axis=0).any())


def _from_zero(times: Array) -> Array:
    return times if times[0] == 0 else np.concatenate([[0.0], times])


def _is_closer(own: _Option, best: _Option) -> bool:
    """Return whether the attitude's rate is far nearer to ω than the file's by a convention."""
    return best.family == _RATE and bool(best.typical[2] - own.typical[2] > _LESSENS)


def _is_clear(option: _Option) -> bool:
    typically, at_most = _CLEAR
    return bool(np.all(option.typical[:2] < typically) and np.max(option.errors[:2]) < at_most)


def _best(
    options: Sequence[_Option], errors: tuple[Array, ...]
) -> tuple[_Option, list[_Option]] | None:
    """Return the simplest of the options that explain most, and the others as good."""
    gains = []
    before = typical(errors, options[0].truth.times)
    for option in options:
        gain = before - option.typical
        if gain.max() >= _LESSENS and gain.min() >= -_SPOILS:
            gains.append((float(gain.sum()), option))
    if not gains:
        return None
    most = max(gain for gain, _ in gains)
    good = sorted(
        (option for gain, option in gains if gain > most - _AS_GOOD), key=lambda each: each.parts
    )
    chosen = good[0]
    others = [each for each in good[1:] if each.parts == chosen.parts]
    as_well = {each.name: each for each in others if each.name != chosen.name}
    return chosen, list(as_well.values())
