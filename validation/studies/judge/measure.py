"""A trajectory held against the equations: how far off it is, and which mistakes explain that."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from robotball import (
    InputError,
    Motion,
    RecordedMotion,
    Scene,
    Trajectory,
    read_trajectory,
    recorded,
    scene_toml,
)
from robotball.engines import derivative
from robotball.motion import attitude_error, gamma_error, momentum_error, path_error
from robotball.rotations import Array
from validation.studies.judge.lag import Lag, lag_of
from validation.studies.judge.numbers import Errors, numbers_of, some_of
from validation.studies.judge.search import Explanation, Mistake, explain, reference_of
from validation.studies.order import LEAST, fit_order

TOLERANCE = 1e-2  # of path, momentum and the hinges' rates, relative; of the attitude in rad
ENOUGH = 0.1  # of the scene's duration; a file that covers less says too little to agree
ROWS = 20_000  # that are judged, at most, where the frame turns little between them
TURN = 0.1  # rad
LONGEST = 100  # times the scene's duration; a longer file is in another unit


@dataclass(frozen=True)
class Beside:
    """A trajectory's motion beside the reference's, and the measures of their difference."""

    motion: RecordedMotion
    theory: Motion

    @cached_property
    def path_error(self) -> float:
        """The largest contact-point error over the path's length or the radius."""
        return path_error(self.motion, self.theory)

    @cached_property
    def attitude_error(self) -> float:
        """The largest angle between the two attitudes [rad]."""
        return attitude_error(self.motion, self.theory)

    @cached_property
    def gamma_error(self) -> float:
        """The largest angle between the two verticals, seen from the frame [rad]."""
        return gamma_error(self.motion, self.theory)

    @cached_property
    def momentum_error(self) -> float | None:
        """Of M from the file's attitude and ω, or of its own M, relative; None if not known."""
        error = momentum_error(self.motion, self.theory)
        return error if np.isfinite(error) else None

    @property
    def momentum_known_to(self) -> float:
        """What numerical rates may have made of the momentum error."""
        return float(self.motion.momentum_error.max() / self.theory.scene.momentum_scale)

    @property
    def slip(self) -> tuple[float, float] | None:
        """The largest [m/s], and what numerical rates may have made of it; None if not known."""
        return _largest(self.motion.slip, self.motion.slip_error)

    @property
    def spin(self) -> tuple[float, float] | None:
        """The same of the spin, either way round [rad/s]."""
        return _largest(np.abs(self.motion.spin), self.motion.spin_error)

    @cached_property
    def hinge_rates(self) -> dict[str, tuple[float, float]]:
        """Of each hinge whose rate is known: how far it is off, relative, and its factor.

        Both by the mean square: the factor takes the reference's rate nearest to the file's.
        """
        found = {}
        ours, theirs = self.motion.hinge_rates, self.theory.hinge_rates[-len(self.motion.times) :]
        fastest = float(np.linalg.norm(self.theory.angular_velocity, axis=1).max()) or 1.0
        for hinge, a, b in zip(self.motion.scene.hinges, ours.T, theirs.T, strict=True):
            if np.isfinite(a).all():
                size = float(b @ b) or len(b) * fastest**2
                found[hinge.name] = float(np.sqrt((a - b) @ (a - b) / size)), float(a @ b / size)
        return found

    @property
    def unknown_hinges(self) -> tuple[str, ...]:
        """The hinges with a motor of which the file says nothing."""
        known = np.asarray(np.isfinite(self.motion.hinge_rates).all(axis=0))
        names = [hinge.name for hinge in self.motion.scene.hinges]
        return tuple(name for name, sure in zip(names, known, strict=True) if not sure)


def _largest(values: Array, errors: Array) -> tuple[float, float] | None:
    i = int(values.argmax())
    return (float(values[i]), float(errors[i])) if np.isfinite(values).all() else None


@dataclass(frozen=True)
class FileJudgement:
    """A trajectory as it stands, what is wrong with it, and how it is without these mistakes.

    corrected: beside the motion of the scene that was simulated, where that is another one; None
    where no mistake was found. lag: of what is left.
    """

    trajectory: Trajectory
    plain: Beside
    explanation: Explanation
    corrected: Beside | None
    lag: Lag
    timestep: float
    tolerance: float

    @property
    def name(self) -> str:
        return self.trajectory.name

    @property
    def other_scene(self) -> str | None:
        """The name of the scene in the file's header, where that is not the one that was meant."""
        header = self.trajectory.header or {}
        given = header.get("scene_toml")
        with contextlib.suppress(InputError):  # of a rate by a function, which no header can hold
            if given and given.strip() != scene_toml(self.plain.theory.scene).strip():
                return header.get("scene", "?")
        return None

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        return self.explanation.mistakes

    @property
    def plain_errors(self) -> Errors:
        """Of the file as it stands."""
        return self.explanation.plain

    @property
    def best(self) -> Beside:
        """The trajectory without its mistakes."""
        return self.corrected or self.plain

    @property
    def covers(self) -> float:
        """The time from the file's first row to its last [s]."""
        return float(self.trajectory.times[-1] - self.trajectory.times[0])

    @property
    def too_short(self) -> bool:
        return self.covers < ENOUGH * (1 - 1e-9) * self.plain.theory.scene.duration

    @property
    def within(self) -> bool:
        """Whether all that is known is within the tolerance, and no mistake was found."""
        of_momentum = (self.plain.momentum_error or 0.0) - self.plain.momentum_known_to
        of_hinges = (error for error, _ in self.plain.hinge_rates.values())
        errors = (self.plain.path_error, self.plain.attitude_error, of_momentum, *of_hinges)
        return not self.mistakes and max(errors) <= self.tolerance

    @property
    def agrees(self) -> bool:
        return self.within and not self.too_short


@dataclass(frozen=True)
class Order:
    """The order of a measure over several files; None where the errors are no straight line."""

    measure: str
    order: float | None
    stderr: float | None = None


@dataclass(frozen=True)
class Judgement:
    """Files of one scene, the one with the longest step first, and orders of convergence."""

    scene: Scene
    files: tuple[FileJudgement, ...]
    orders: tuple[Order, ...]

    @property
    def agrees(self) -> bool:
        return all(each.agrees for each in self.files)


def judge(
    scene: Scene,
    files: Sequence[Path | str | Trajectory] | Path | str | Trajectory,
    *,
    timesteps: Sequence[float] = (),
    tolerance: float = TOLERANCE,
    progress: Callable[[float], None] | None = None,
) -> Judgement:
    """What is wrong with trajectories of a scene, each from a file or as `read_trajectory` gives.

    timesteps: the engine's in each file [s]; by the file's header, or else the interval of its
    samples, where they are not given. tolerance: of path, momentum and hinges' rates, relative, and
    of the attitude in rad. progress is called with the fraction that is done. Raises InputError as
    `read_trajectory`, `recorded` and `integrate` do, and for a file that is many times longer than
    the scene.
    """
    given = [files] if isinstance(files, Path | str | Trajectory) else list(files)
    if timesteps and len(timesteps) != len(given):
        raise InputError(f"each file needs its timestep: {len(given)}, not {len(timesteps)}")
    trajectories = [
        each if isinstance(each, Trajectory) else read_trajectory(Path(each)) for each in given
    ]
    for each in trajectories:
        _check_end(scene, each)
    steps = timesteps or [timestep_of(each) for each in trajectories]
    judged = []
    for i, (trajectory, timestep) in enumerate(zip(trajectories, steps, strict=True)):
        judged.append(_judged(scene, _thinned(trajectory), timestep, tolerance))
        if progress is not None:
            progress((i + 1) / len(trajectories))
    judged.sort(key=lambda each: -each.timestep)
    return Judgement(scene, tuple(judged), tuple(_orders(judged)))


def _thinned(trajectory: Trajectory) -> Trajectory:
    """Some of the rows of a long trajectory, the first and the last among them."""
    count, rows = len(trajectory.times), ROWS
    while rows < count:
        at = np.linspace(0, count - 1, rows).round().astype(int)
        if derivative.turned_between(trajectory.attitude[at]).max() <= TURN:
            own = {
                name: each[at]
                for name, each in vars(trajectory).items()
                if isinstance(each, np.ndarray)
            }
            others = {name: each[at] for name, each in (trajectory.others or {}).items()}
            note = f"judged by {rows} of its {count} rows"
            return replace(trajectory, **own, others=others, notes=(*trajectory.notes, note))
        rows *= 2
    return trajectory


def timestep_of(trajectory: Trajectory) -> float:
    """The engine's step that the file's header gives, or else the interval of its samples [s]."""
    given = (trajectory.header or {}).get("timestep", "")
    try:
        return float(given)
    except ValueError:
        return float(np.median(np.diff(trajectory.times)))


def _check_end(scene: Scene, trajectory: Trajectory) -> None:
    end = float(trajectory.times[-1])
    if end > LONGEST * scene.duration:
        raise InputError(
            f"{trajectory.name}: t goes to {end:g} s, and {scene.name} lasts {scene.duration:g} s; "
            "if t is in another unit, call the column t [ms], t [us] or t [ns]"
        )


def _judged(
    scene: Scene, trajectory: Trajectory, timestep: float, tolerance: float
) -> FileJudgement:
    plain = _beside(scene, trajectory)
    found = explain(trajectory, plain.theory, plain.motion.rolling_radius)
    corrected = _beside(found.scene, found.trajectory) if found.mistakes else None
    at = some_of(len(trajectory.times))
    best = (corrected or plain).theory
    return FileJudgement(
        trajectory=trajectory,
        plain=plain,
        explanation=found,
        corrected=corrected,
        lag=lag_of(found.trajectory.times[at], numbers_of(found.trajectory, at), best),
        timestep=timestep,
        tolerance=tolerance,
    )


def _beside(scene: Scene, trajectory: Trajectory) -> Beside:
    motion = recorded(scene, trajectory)
    return Beside(motion, reference_of(scene, trajectory.times))


def _orders(judged: Sequence[FileJudgement]) -> Iterator[Order]:
    """Of path and attitude, where the files have at least two different steps."""
    steps = [each.timestep for each in judged]
    if len(set(steps)) < 2:
        return
    measures = {
        "path error": [each.best.path_error for each in judged],
        "attitude error": [each.best.attitude_error for each in judged],
    }
    for name, errors in measures.items():
        if len(set(steps)) < LEAST:
            fall = np.log(errors[0] / errors[-1]) / np.log(steps[0] / steps[-1])
            yield Order(name, float(fall))
            continue
        found = fit_order(steps, errors)
        yield Order(name, *((found.order, found.stderr) if found else (None, None)))
