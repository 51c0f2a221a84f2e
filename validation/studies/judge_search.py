"""The search for mistakes that explain how a trajectory differs from the reference.

Each known mistake (`mistakes.py`) is undone by itself. The one that lessens the errors most is
taken for made, and the search goes on with what is left. Conventions come first: they are cheap to
try, and another scene has to be integrated. A shift in time is reported, and undone nowhere.
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
from robotball.engines import recorded as derivative
from robotball.engines.recorded import sampled_rates
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


def lag_of(file: Trajectory, reference: Motion) -> Lag:
    """Return the lag of a trajectory behind a reference that is sampled as finely."""
    times, end = file.times, float(reference.times[-1])
    most = min(_LONGEST * end, end - float(times[0]))
    step = max(2 * most / _SHIFTS, min(most, float(np.median(np.diff(times)))) / 4)
    error = _error_at(file, reference)
    tried = np.arange(-most, most + step / 2, step)
    shift = _least(lambda shift: error(times - shift), tried, 1e-9)
    return Lag(shift, error(times), error(times - shift))


def _least(error: Callable[[float], float], tried: Array, to: float) -> float:
    """Return where an error is least, up to `to`: near the best of equally spaced values (n,)."""
    best, step = float(min(tried, key=error)), float(tried[1] - tried[0])
    found = minimize_scalar(
        error, bounds=(best - step, best + step), method="bounded", options={"xatol": to}
    )
    return float(found.x)


def _error_at(file: Trajectory, reference: Motion) -> Callable[[Array], float]:
    """Return the error of a trajectory, as in `Lag`, if its rows are of other times (n,) [s].

    Rows whose time is beyond the reference's ends do not count.
    """
    known = reference.times
    values = np.column_stack([reference.contact_point, continuous(reference.attitude)])
    motion = CubicHermiteSpline(known, values, sampled_rates(known, values)[0])

    def error(times: Array) -> float:
        inside = (times >= 0) & (times <= known[-1])
        path, turn = np.split(motion(times[inside]), [2], axis=1)
        apart = ((file.position[inside, :2] - path) ** 2).sum(axis=1) / reference.path_scale**2
        # 2|sin(half the angle)| between them, whatever the signs.
        cosine = np.abs((turn * file.attitude[inside]).sum(axis=1)) / np.linalg.norm(turn, axis=1)
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
_TURNS = "attitude", "world"  # families of conventions that change the attitude
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
    as_well: tuple[str, ...]

    @property
    def left(self) -> float:
        """Return the least part that is left of the largest error of path, attitude or ω."""
        pairs = zip(astuple(self.after), astuple(self.before), strict=True)
        return min(after / before for after, before in pairs if before)

    @property
    def sure(self) -> bool:
        """Return whether so little is left that the mistake is said to be made."""
        return self.left <= SURE


def reference_of(scene: Scene, times: Array, **more: Any) -> Motion:
    """Integrate the scene at 0 and at the times (n,) of a trajectory; more: for `integrate`."""
    return integrate(scene, times if times[0] == 0 else np.concatenate([[0.0], times]), **more)


@dataclass(frozen=True)
class _Option:
    """A mistake that may be the next: some rows without it, and what they should be then.

    angle: the attitude's error (n,), where it is known: most conventions change no attitude.
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
        """Return each error's typical size and its root mean square (2, 2 or 3)."""
        mean_square = np.sqrt(np.mean(np.square(self.errors), axis=1))
        return np.array([np.exp(self.typical), mean_square])


class Search:
    """The mistakes in a file, the one that explains most first.

    plain: the errors of the file as it stands. scene: the one that was simulated, as far as the
    mistakes show; corrected: the file's trajectory in the right conventions; theory: the motion of
    that scene at its times; at: the rows that were searched.
    """

    def __init__(self, trajectory: Trajectory, theory: Motion) -> None:
        """Search a trajectory of which the theory is the reference."""
        self.trajectory, self.theory = trajectory, theory
        self.at = some_of(len(trajectory.times))
        rows, truth = rows_of(trajectory, self.at), self._truth(theory, self.at.step)
        # The file as it stands, then without each mistake as well.
        self.found = [_Option("", "", 0, rows, truth, theory.scene)]
        self.plain = largest(self.found[0].errors)
        self.mistakes = tuple(self._mistakes())
        self.scene = self.found[-1].scene
        self.corrected = self._corrected()

    def _mistakes(self) -> list[Mistake]:
        """Return the mistakes that explain the errors.

        Each, with those after it, removes most of the error that it met, and of path, attitude or ω
        nearly all. Where the mistake is one that is not known, another may undo one of its errors
        by chance, or make one small at the beginning and large later: it is dropped.
        """
        tried = list(self._lessening())
        left = [each.sizes for each in self.found]
        explain = [k for k in range(len(left)) if all(_explain(left[k], each) for each in left[:k])]
        self.found = self.found[: explain[-1] + 1]
        return tried[: explain[-1]]

    def _lessening(self) -> Iterator[Mistake]:
        """Yield mistakes that lessen an error; the next has to explain what each left."""
        while len(self.found) <= _MOST_MISTAKES:
            now = self.found[-1]
            before, families = largest(now.errors), {each.family for each in self.found}
            if before.rate is None:
                families.add(_RATE)
            options = [
                _Option(each.family, each.name, each.parts, each.undo(now.file), now.truth,
                        now.scene, None if each.family in _TURNS else now.errors[1])
                for each in conventions(now.truth, self._has_height)
                if each.family not in families
            ]  # fmt: skip
            best = _best(options, now)
            wrong = max(before.path, before.attitude) > _SOUND
            if wrong and not {_SCENE, _TIME} & families and not (best and _is_clear(best[0])):
                options += [replace(each, file=now.file) for each in self._scenes]
                options += self._stretched()
                best = _best(options, now)
            if _RATE not in families and (before.rate or 0.0) > _ASTRAY:
                own = _best([self._rate_of_attitude()], now)
                if own and (best is None or _is_closer(own[0], best[0])):
                    best = own
            if best is None:
                return
            chosen, as_well = best
            self.found.append(chosen)
            yield Mistake(chosen.family, chosen.name, before, largest(chosen.errors), as_well)

    def _corrected(self) -> Trajectory:
        """Return the whole trajectory without the mistakes found in its conventions.

        `theory` is the motion of the scene as found then, at the trajectory's times.
        """
        first, *found = self.found
        if not found:
            return self.trajectory
        # A stretch is the same for all rows.
        times = self.trajectory.times * (found[-1].file.times[-1] / first.file.times[-1])
        file = replace(self.trajectory, times=times, momentum=None)
        # To integrate at all rows of a long file takes as long as to try many mistakes.
        if self.theory.scene is not found[-1].scene or self.theory.times[-1] != times[-1]:
            self.theory = reference_of(found[-1].scene, times)
        truth = self._truth(self.theory, 1)
        undo = {each.name: each.undo for each in conventions(truth, self._has_height)}
        undo[_NOT_THE_RATE] = _with_own_rate
        for each in found:
            if each.name in undo:
                file = undo[each.name](file)
        return file

    @property
    def _has_height(self) -> bool:
        return bool(np.isfinite(self.trajectory.position[0, 2]))

    def _truth(self, theory: Motion, step: int) -> Truth:
        first = 0 if self.trajectory.times[0] == 0 else 1
        rows = {place: each[first::step] for place, each in arrays_of(theory)}
        return Truth(with_arrays(theory, rows), theory.path_scale)

    @cached_property
    def _scenes(self) -> list[_Option]:
        """Return the motions of scenes that may have been simulated instead, each made once."""
        file, found = self.found[-1].file, []
        for name, scenes in mistaken_scenes(self.found[-1].scene):
            for scene in scenes:
                with contextlib.suppress(InputError):  # of a ball that nobody can have simulated
                    truth = self._truth(reference_of(scene, file.times, rtol=_TRIED), 1)
                    found.append(_Option(_SCENE, name, 1, file, truth, scene))
        return found

    def _stretched(self) -> Iterator[_Option]:
        """Yield the scene's own motion, at times that are not the file's."""
        file, scene = self.found[-1].file, self.found[-1].scene
        later = np.linspace(0, file.times[-1] / (1 - _LONGEST), _FINE)
        tried = np.linspace(1 - _LONGEST, 1 + _LONGEST, _SHIFTS + 1)
        with contextlib.suppress(InputError):  # of a drive that ends before
            error = _error_at(file, integrate(scene, later, rtol=_TRIED))
            stretch = _least(lambda stretch: error(file.times / stretch), tried, 1e-7)
            right = replace(file, times=file.times / stretch)
            truth = self._truth(reference_of(scene, right.times, rtol=_TRIED), 1)
            name = f"the times are {stretch:.5g} times what they should be"
            option = _Option(_TIME, name, 1, right, truth, scene)
            # A wrong clock shows in ω as well; another inertia may slow down the path alone.
            gain = self.found[-1].typical - option.typical
            if file.angular_velocity is None or gain[2] >= _LESSENS:
                yield option

    def _rate_of_attitude(self) -> _Option:
        rate = _with_own_rate(self._corrected()).angular_velocity
        file = replace(self.found[-1].file, angular_velocity=np.asarray(rate)[self.at])
        return replace(self.found[-1], family=_RATE, name=_NOT_THE_RATE, parts=1, file=file)


def _with_own_rate(file: Trajectory) -> Trajectory:
    return replace(file, angular_velocity=derivative.angular_velocity(file.times, file.attitude)[0])


def _explain(after: Array, before: Array) -> bool:
    """Return whether sizes are most of those before in all together, and nearly all in one."""
    all_together = np.linalg.norm(after, axis=1) * _MOST < np.linalg.norm(before, axis=1)
    return bool(all_together.all() and (after < _REMAINING * before).all(axis=0).any())


def _is_closer(own: _Option, best: _Option) -> bool:
    """Return whether the attitude's rate is far nearer to ω than the file's by a convention."""
    return best.family == _RATE and bool(best.typical[2] - own.typical[2] > _LESSENS)


def _is_clear(option: _Option) -> bool:
    typically, at_most = _CLEAR
    return bool(np.all(option.typical[:2] < typically) and np.max(option.errors[:2]) < at_most)


def _best(options: Sequence[_Option], now: _Option) -> tuple[_Option, tuple[str, ...]] | None:
    """Return the simplest of the options that explain most, and the names of others as good."""
    gains = []
    for option in options:
        gain = now.typical - option.typical
        if gain.max() >= _LESSENS and gain.min() >= -_SPOILS:
            gains.append((float(gain.sum()), option))
    if not gains:
        return None
    least = max(gain for gain, _ in gains) - _AS_GOOD
    good = [option for gain, option in gains if gain > least]
    chosen = min(good, key=lambda each: each.parts)
    names = dict.fromkeys(each.name for each in good if each.parts == chosen.parts)
    return chosen, tuple(name for name in names if name != chosen.name)
