"""A trajectory's numbers beside the reference's, and how far they are apart, sample by sample."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotball import Motion, Trajectory
from robotball.mechanics.poses import poses
from robotball.rotations import Array, conjugate, multiply

FLOOR = 1e-6  # an error below it explains as little as none
MOST = 400  # samples that a convention is tried on


@dataclass(frozen=True)
class Numbers:
    """position (n, 3) m; attitude (n, 4); rate (n, 3) rad/s, the frame's in its axes, or None."""

    position: Array
    attitude: Array
    rate: Array | None

    def changed(self, **changes: Any) -> "Numbers":
        return replace(self, **changes)


@dataclass(frozen=True)
class Truth:
    """What the numbers should be, at the same samples.

    times (n,) s; contact_point (n, 2) m; attitude (n, 4); rate (n, 3) rad/s; frame_angle,
    frame_rate (n,) of the frame in the shell; places: of each body's centre of mass from the
    sphere's centre, horizontal (n, 2) m; path_scale m.
    """

    motion: Motion
    times: Array
    contact_point: Array
    attitude: Array
    rate: Array
    frame_angle: Array
    frame_rate: Array
    places: dict[str, Array]
    path_scale: float


@dataclass(frozen=True)
class Errors:
    """Of the path, over its length; of the attitude [rad]; of ω, relative, None without it."""

    path: float
    attitude: float
    rate: float | None

    @property
    def given(self) -> tuple[float, ...]:
        of_both = (self.path, self.attitude)
        return of_both if self.rate is None else (*of_both, self.rate)


def numbers_of(trajectory: Trajectory, at: slice) -> Numbers:
    """Those of a trajectory, at some of its samples."""
    rate = trajectory.angular_velocity
    return Numbers(
        trajectory.position[at], trajectory.attitude[at], None if rate is None else rate[at]
    )


def truth_of(motion: Motion, at: slice) -> Truth:
    """The same of a reference motion that has the trajectory's times."""
    centre = motion.contact_point
    return Truth(
        motion=motion,
        times=motion.times[at],
        contact_point=centre[at],
        attitude=motion.attitude[at],
        rate=motion.angular_velocity[at],
        frame_angle=motion.hinge_angles[at, 0],
        frame_rate=motion.hinge_rates[at, 0],
        places={name: (each.position[:, :2] - centre)[at] for name, each in poses(motion).items()},
        path_scale=motion.path_scale,
    )


def some_of(count: int) -> slice:
    """Some of so many samples, the first among them, at equal distances."""
    return slice(None, None, max(1, count // MOST))


Base = tuple[Numbers, Truth, tuple[Array, ...]]


def errors_at(numbers: Numbers, truth: Truth, base: Base | None = None) -> tuple[Array, ...]:
    """Of path, attitude and, if it is there, ω: (n,) each, in the units of `Errors`.

    base: numbers, truth and their errors, of which those are taken that have not changed.
    """
    known: tuple[Array, ...] = ()
    same = numbers
    if base is not None and base[1] is truth:
        same, known = base[0], base[2]
    if known and numbers.position is same.position:
        path = known[0]
    else:
        apart = numbers.position[:, :2] - truth.contact_point
        path = np.linalg.norm(apart, axis=1) / truth.path_scale
    if known and numbers.attitude is same.attitude:
        angle = known[1]
    else:
        # The vector part of the turn between them has the length |sin(half the angle)|.
        cosine = np.abs((truth.attitude * numbers.attitude).sum(axis=1))
        turn = multiply(conjugate(truth.attitude), numbers.attitude)
        angle = 2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), cosine)
    if numbers.rate is None:
        return path, angle
    if known and numbers.rate is same.rate:
        return path, angle, known[2]
    fastest = np.linalg.norm(truth.rate, axis=1).max()
    return path, angle, np.linalg.norm(numbers.rate - truth.rate, axis=1) / (fastest or 1.0)


def largest(errors: tuple[Array, ...]) -> Errors:
    """The largest of each."""
    path, attitude, *rate = (float(each.max()) for each in errors)
    return Errors(path, attitude, rate[0] if rate else None)


def typical(errors: tuple[Array, ...], times: Array) -> Array:
    """(2 or 3,): the mean over ln(t) of ln(error) of each, at times (n,).

    An engine's error is small at the beginning, and a mistake is there from the beginning on; in a
    chaotic motion both are as large as they can be at the end.
    """
    weights = 1 / (times - times[0] + times[1] - times[0])
    return np.array(
        [np.average(np.log(np.maximum(each, FLOOR)), weights=weights) for each in errors]
    )
