"""The search for the mistakes that explain how a trajectory differs from the reference."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robotball import InputError, Motion, Scene, Trajectory, integrate
from robotball.rotations import Array
from validation.studies.judge.conventions import conventions
from validation.studies.judge.mistaken_scenes import mistaken_scenes
from validation.studies.judge.numbers import (
    Errors,
    Numbers,
    Truth,
    errors_at,
    largest,
    numbers_of,
    some_of,
    truth_of,
    typical,
)

EXPLAINS = np.log(5.0)  # by how much a mistake must lessen an error to explain it
SPOILS = np.log(3.0)  # by how much it may worsen another one, which is wrong anyway
AS_GOOD = np.log(1.5)  # two mistakes so near explain as much as each other
SOUND = 1e-3  # errors of path and attitude, below which no other scene is tried
CLEAR = np.log(1e-2)  # typical errors, below which a convention is the whole explanation
MOST_MISTAKES = 4  # that are looked for in one file
TRIED = 1e-9  # of a step, of a mistaken scene's motion: far below what explains anything
SCENE = "scene"


@dataclass(frozen=True)
class Trial:
    """A mistake that was tried on a file, and the errors if it was made."""

    family: str
    name: str
    errors: Errors


@dataclass(frozen=True)
class Mistake:
    """One that explains an error, the errors with and without it, and others that do as well."""

    family: str
    name: str
    before: Errors
    after: Errors
    as_well: tuple[str, ...] = ()


@dataclass(frozen=True)
class Explanation:
    """The mistakes in a file, the one that explains most first, and all that were tried.

    plain: the errors of the file as it stands.
    scene: the one that was simulated, as far as the mistakes tell; trajectory: the file's, in the
    right conventions.
    """

    plain: Errors
    mistakes: tuple[Mistake, ...]
    trials: tuple[Trial, ...]
    scene: Scene
    trajectory: Trajectory


def reference_of(scene: Scene, times: Array) -> Motion:
    """The scene's motion by the equations, at 0 and the times (n,) of a trajectory."""
    return integrate(scene, _from_zero(times))


def explain(trajectory: Trajectory, theory: Motion, rolling_radius: float) -> Explanation:
    """What may be wrong with a trajectory, of which the theory is the reference.

    rolling_radius: as the file tells it [m].
    """
    search = _Search(trajectory, theory, rolling_radius)
    plain = largest(errors_at(search.numbers, search.truth))
    mistakes = tuple(search.mistakes())
    return Explanation(plain, mistakes, tuple(search.trials), search.scene, search.corrected())


@dataclass(frozen=True)
class _Option:
    """A mistake that may be the next: the numbers without it, and what they should be then."""

    family: str
    name: str
    parts: int
    numbers: Numbers
    truth: Truth
    scene: Scene
    base: tuple[Numbers, Truth, tuple[Array, ...]]

    @cached_property
    def errors(self) -> tuple[Array, ...]:
        return errors_at(self.numbers, self.truth, self.base)

    @property
    def typical(self) -> Array:
        return typical(self.errors, self.truth.times)


class _Search:
    def __init__(self, trajectory: Trajectory, theory: Motion, rolling_radius: float) -> None:
        self.trajectory, self.rolling_radius = trajectory, rolling_radius
        self.at = some_of(len(trajectory.times))
        self.scene, self.truth = theory.scene, self._truth(theory, self.at.step)
        self.numbers = numbers_of(trajectory, self.at)
        self.trials: list[Trial] = []
        self.found: list[_Option] = []
        self._others: list[tuple[str, Scene, Truth]] | None = None

    def mistakes(self) -> Iterator[Mistake]:
        """Those that explain the errors; what each left is what the next has to explain."""
        for _ in range(MOST_MISTAKES):
            before = errors_at(self.numbers, self.truth)
            families = {each.family for each in self.found}
            options = [each for each in self._conventions(before) if each.family not in families]
            best = _best(options, before)
            wrong = max(largest(before).path, largest(before).attitude) > SOUND
            if wrong and SCENE not in families and not (best and _is_clear(best[0])):
                options += self._scenes(before)
                best = _best(options, before)
            if not self.found:
                self.trials = [
                    Trial(each.family, each.name, largest(each.errors))
                    for each in options
                    if each.parts == 1
                ]
            if best is None:
                return
            chosen, as_well = best
            self.found.append(chosen)
            self.numbers, self.truth, self.scene = chosen.numbers, chosen.truth, chosen.scene
            errors = largest(before), largest(chosen.errors)
            yield Mistake(chosen.family, chosen.name, *errors, tuple(each.name for each in as_well))

    def corrected(self) -> Trajectory:
        """The whole trajectory without the mistakes that were found in its conventions."""
        if not self.found:
            return self.trajectory
        times, names = self.trajectory.times, {(each.family, each.name) for each in self.found}
        numbers = numbers_of(self.trajectory, slice(None))
        truth = self._truth(reference_of(self.scene, times), 1)
        for each in conventions(truth, self._has_height):
            if (each.family, each.name) in names:
                numbers = each.undo(numbers)
        return replace(
            self.trajectory,
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

    def _conventions(self, before: tuple[Array, ...]) -> Iterator[_Option]:
        base = (self.numbers, self.truth, before)
        for each in conventions(self.truth, self._has_height):
            if each.family == "angular velocity" and self.numbers.rate is None:
                continue
            numbers = each.undo(self.numbers)
            yield _Option(each.family, each.name, each.parts, numbers, self.truth, self.scene, base)

    def _scenes(self, before: tuple[Array, ...]) -> list[_Option]:
        """The motions of scenes that may have been simulated instead."""
        if self._others is None:
            self._others = list(self._integrated())
        base = (self.numbers, self.truth, before)
        return [
            _Option(SCENE, name, 1, self.numbers, truth, scene, base)
            for name, scene, truth in self._others
        ]

    def _integrated(self) -> Iterator[tuple[str, Scene, Truth]]:
        times = _from_zero(self.trajectory.times[self.at])
        for each in mistaken_scenes(self.scene, self.rolling_radius):
            for scene in each.scenes:
                try:
                    theory = integrate(scene, times, rtol=TRIED)
                except InputError:  # a ball that nobody can have simulated
                    continue
                yield each.name, scene, self._truth(theory, 1)


def _from_zero(times: Array) -> Array:
    return times if times[0] == 0 else np.concatenate([[0.0], times])


def _is_clear(option: _Option) -> bool:
    return bool(np.all(option.typical[:2] < CLEAR))


def _best(
    options: Sequence[_Option], errors: tuple[Array, ...]
) -> tuple[_Option, list[_Option]] | None:
    """The option that explains most, the simplest of those, and the others as good."""
    gains = []
    before = typical(errors, options[0].truth.times)
    for option in options:
        gain = before - option.typical
        if gain.max() >= EXPLAINS and gain.min() >= -SPOILS:
            gains.append((float(gain.sum()), option))
    if not gains:
        return None
    most = max(gain for gain, _ in gains)
    good = sorted(
        (option for gain, option in gains if gain > most - AS_GOOD), key=lambda each: each.parts
    )
    chosen = good[0]
    as_well = {
        each.name: each
        for each in good[1:]
        if each.parts == chosen.parts and each.name != chosen.name
    }
    return chosen, list(as_well.values())
