"""A path error asked for instead of a timestep: settings predicted to reach it, and the proof.

Two families of the recipe are known: MuJoCo's RK4 at a timestep, and DOP853 at an rtol. Two cheap
runs of RK4 measure the scene's own error; the measured front says what each family then costs.
An estimate needs no reference: it compares two runs of different steps, or takes the drift of M,
which should be none, as many times as those two runs say that the path shows it.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from robotball.engines.mujoco.cost_model import FRONT, scene_rate, servo_rate
from robotball.engines.mujoco.settings import (
    ADAPTIVE,
    LEAST_RTOL,
    PRESETS,
    Settings,
    preset,
    recipe,
)
from robotball.engines.mujoco.timing import step_count
from robotball.errors import InputError, SceneWarning
from robotball.motion import Motion
from robotball.rotations import Array
from robotball.scene import Scene

Run = Callable[[Settings, Array], Motion]

DEFAULT = "balanced"
# What a run may lose of M, or slip, before the watch ends it: times the accuracy, and at most.
WATCHED, MOST_WATCHED = 100.0, 0.1
LEAST = 1e-11  # a ball near an unstable motion magnifies the rounding of its start to half of it
PHASE = 0.32  # rad at the scene's rate, in a step of the pilot run: RK4's order shows below it
STABLE = 1.5  # of a servo's rate in a step of the pilot run: RK4 diverges not far above it
AIM = 0.9  # of the error asked for, at which steps are aimed by a measured error
# Of it, at which the first rtol is aimed by the front alone: a tenth of an rtol takes a third more
# steps, and a second run twice as many.
CAUTIOUS = 0.03
APART = 0.01  # path lengths; no law of errors holds between runs that are farther apart
FINEST_RTOL, COARSEST_RTOL = LEAST_RTOL, 1e-7  # with looser ones the contact may be lost
LOOSER = 300.0  # times rtol, of the run that DOP853's first is compared with, if one is
SPARSE = 0.1  # s, between the samples of that run
RK4_EVALUATIONS, DOP853_EVALUATIONS = 4, 13  # of the forces in a step, rejected steps included
CORRECTIONS = 2


@dataclass(frozen=True)
class Reached:
    """The motion of the last run, with its estimate in the diagnostics, and what led to it.

    seconds: processor time of all runs, set-up excluded.
    """

    settings: Settings
    motion: Motion
    seconds: float


def accuracy_name(accuracy: float) -> str:
    """What settings that are chosen for an accuracy are called."""
    return f"to {accuracy:g}"


def asked(settings: Settings | str | None, accuracy: float | None) -> Settings | float:
    """Settings to run, or the path error to reach; raises InputError if both are given."""
    if accuracy is None:
        return preset(settings or DEFAULT) if not isinstance(settings, Settings) else settings
    if settings is not None:
        raise InputError("give settings or an accuracy, not both: an accuracy chooses its own")
    if not LEAST <= accuracy < 1:
        raise InputError(
            f"an accuracy must be at least {LEAST:g}, where rounding ends it, and below 1, "
            f"not {accuracy:g}"
        )
    return float(accuracy)


@dataclass
class _Search:
    """The runs of one scene on the way to an accuracy."""

    scene: Scene
    times: Array
    accuracy: float
    run: Run
    seconds: float = 0.0
    rate: float = field(init=False)

    def __post_init__(self) -> None:
        # A ball that hardly moves still has a duration.
        self.rate = max(scene_rate(self.scene), 1 / float(self.times[-1]))

    def made(self, settings: Settings, apart: float = 0.0) -> Motion:
        """A run at the times, or at those of them that are at least so far apart [s]."""
        motion = self.run(settings, _thinned(self.times, apart))
        assert motion.diagnostics is not None  # contact engines always give them
        self.seconds += motion.diagnostics.seconds
        return motion

    def settings(self, **steps: float | str) -> Settings:
        promise = max(self.accuracy, min(WATCHED * self.accuracy, MOST_WATCHED))
        chosen = recipe(accuracy_name(self.accuracy), promise, **steps)
        return replace(chosen, accuracy=self.accuracy)

    def pilot(self, **steps: float | str) -> Settings:
        """Settings of a run that only measures: its errors are no faults yet."""
        return replace(self.settings(**steps), stop_at_fault=False)

    def reach(self) -> Reached:
        longest = PRESETS["fast"].timestep  # the longest that the recipe's contact allows
        assert longest is not None
        timestep = min(longest, PHASE / self.rate / 2)
        if (servo := servo_rate(self.scene)) > 0:
            timestep = min(timestep, STABLE / servo / 2)
        coarse = self.made(self.pilot(timestep=2 * timestep), apart=2 * timestep)
        fine = self.made(self.pilot(timestep=timestep))
        error = self.error(coarse, fine, _timestep(coarse) / _timestep(fine), FRONT.order)
        if error <= self.accuracy:
            return self.reached(self.settings(timestep=timestep), fine, error)
        timestep = _timestep(fine) * self.finer(error, FRONT.order)
        rtol = self.rtol(error, _timestep(fine))
        if self.adaptive_seconds(rtol) < self.rk4_seconds(timestep):
            drift = _drift(fine)
            return self.by_rtol(rtol, error / drift if drift > 0 and error <= APART else np.inf)
        return self.by_timestep(timestep, fine)

    def by_timestep(self, timestep: float, before: Motion) -> Reached:
        """RK4 at a timestep, with finer ones as long as the estimate asks for them."""
        for _ in range(1 + CORRECTIONS):
            settings = self.settings(timestep=timestep)
            motion = self.made(settings)
            ratio = _timestep(before) / _timestep(motion)
            error = self.error(before, motion, ratio, FRONT.order)
            if error <= self.accuracy:
                break
            before, timestep = motion, _timestep(motion) * self.finer(error, FRONT.order)
        return self.reached(settings, motion, error)

    def by_rtol(self, rtol: float, magnified: float) -> Reached:
        """DOP853 at an rtol, with smaller ones as long as the estimate asks for them.

        magnified: the path error for a drift of M, as RK4 showed it. With it the drift of M, which
        every run tells, is an estimate; two runs give theirs as well, and the larger one counts.
        """
        before, looser = None, rtol
        if not np.isfinite(magnified):
            looser = rtol * LOOSER
            before = self.made(self.pilot(integrator=ADAPTIVE, rtol=looser), apart=SPARSE)
        for _ in range(1 + CORRECTIONS):
            settings = self.settings(integrator=ADAPTIVE, rtol=rtol)
            motion = self.made(settings)
            error = self.by_drift(motion, magnified)
            if before is not None:
                doubled = self.error(before, motion, looser / rtol, FRONT.rtol_order)
                error = max(error, doubled)
            if error <= self.accuracy or rtol <= FINEST_RTOL:
                break
            before, looser = motion, rtol
            rtol = max(FINEST_RTOL, rtol * self.finer(error, FRONT.rtol_order))
        return self.reached(settings, motion, error)

    def by_drift(self, motion: Motion, magnified: float) -> float:
        """The path error of a whole run by the drift of its M; 0 if RK4 told nothing of that."""
        if len(motion.times) < len(self.times):
            return np.inf
        return magnified * _drift(motion) if np.isfinite(magnified) else 0.0

    def error(self, coarse: Motion, fine: Motion, ratio: float, order: float) -> float:
        """The path error of the fine run, by its difference from one of steps `ratio` as long."""
        if not len(coarse.times) or len(fine.times) < len(self.times):
            return np.inf
        if coarse.times[-1] < fine.times[-1]:
            return np.inf
        shared = np.isin(fine.times, coarse.times)
        apart = np.linalg.norm(fine.contact_point[shared] - coarse.contact_point, axis=1).max()
        length = fine.path_length or self.scene.ball.radius
        difference = float(apart) / length
        return difference if difference > APART else difference / (ratio**order - 1)

    def finer(self, error: float, order: float) -> float:
        """By what to multiply the steps of a run of this error to reach the accuracy."""
        # Of a run that broke off no error is known.
        return float((AIM * self.accuracy / error) ** (1 / order)) if np.isfinite(error) else 0.5

    def rtol(self, error: float, timestep: float) -> float:
        """DOP853's rtol for the accuracy, by RK4's error at a timestep [s]."""
        stiffness = error / (self.rate * timestep) ** 4
        gain = FRONT.gain * stiffness**FRONT.power if np.isfinite(stiffness) else np.inf
        return float(np.clip(CAUTIOUS * self.accuracy / gain, FINEST_RTOL, COARSEST_RTOL))

    def rk4_seconds(self, timestep: float) -> float:
        """What RK4 at a timestep will take."""
        steps = step_count(self.times, self.scene.breakpoints, timestep)
        return steps * (FRONT.step + RK4_EVALUATIONS * self.control)

    def adaptive_seconds(self, rtol: float) -> float:
        """What DOP853 at an rtol will take."""
        per_second = FRONT.steps_per_second(self.rate, rtol)
        # However small the error, a servo's own rate limits the steps.
        steps = float(self.times[-1]) * max(per_second, servo_rate(self.scene) / STABLE)
        of_steps = steps * (FRONT.adaptive_step + DOP853_EVALUATIONS * self.control)
        return of_steps + len(self.times) * (FRONT.sample + self.control)

    @property
    def control(self) -> float:
        return 0.0 if self.scene.steady else FRONT.control

    def reached(self, settings: Settings, motion: Motion, error: float) -> Reached:
        """The result, with a warning where it is not what was asked for."""
        estimate = error if np.isfinite(error) else None
        if not error <= self.accuracy:
            how = "the run broke off" if estimate is None else f"estimated {error:.1e}"
            warnings.warn(
                f"{self.scene.name}: asked for a path error of {self.accuracy:g}, {how}; it is "
                "not reached",
                SceneWarning,
                stacklevel=2,
            )
        assert motion.diagnostics is not None
        diagnostics = replace(motion.diagnostics, estimated_error=estimate)
        return Reached(settings, replace(motion, diagnostics=diagnostics), self.seconds)


def reach(scene: Scene, times: Array, accuracy: float, run: Run) -> Reached:
    """The scene's motion at times (n,) [s] to a path error, by the cheapest settings predicted.

    run: makes the motion at given settings and times. Warns where the accuracy is not reached,
    and where the scene's own motors keep the ball from the equations whatever the steps.
    """
    if any(scene.motors):
        warnings.warn(
            f"{scene.name} has motors of its own: the estimated error is that of the steps, not "
            "of what its motors miss",
            SceneWarning,
            stacklevel=2,
        )
    return _Search(scene, times, accuracy, run).reach()


def _timestep(motion: Motion) -> float:
    assert motion.diagnostics is not None
    return motion.diagnostics.timestep


def _drift(motion: Motion) -> float:
    """The largest change of M [kg m²/s]."""
    return float(np.linalg.norm(motion.momentum - motion.momentum[:1], axis=1).max())


def _thinned(times: Array, apart: float) -> Array:
    """Some of the times, at least so far apart [s] but for the last one."""
    kept = [float(times[0])]
    for t in times[1:-1].tolist():
        if t - kept[-1] >= apart * (1 - 1e-9):
            kept.append(t)
    return np.array([*kept, times[-1]])
