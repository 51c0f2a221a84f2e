"""Search for the cheapest settings that reach a requested path error, with an estimate of it.

There are two families of settings: MuJoCo's RK4 at a timestep, and DOP853 at an rtol. Two cheap
runs of RK4 measure the scene's own error, from which the cost model predicts the cost of each
family. The estimate needs no reference. It is the difference of two runs of different steps by
Richardson's rule, or the change of M, which should be none, times the ratio of path error to change
of M that the two RK4 runs showed. `checked` finds by the first rule whether a run in settings is as
good as they say.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from robotball.engines.engine import as_own
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.cost_model import COST_MODEL
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.settings import (
    ADAPTIVE,
    BY_ERROR,
    PRESETS,
    Resolved,
    Settings,
    recipe,
)
from robotball.engines.observe import step_count
from robotball.errors import warn
from robotball.motion import (
    ContactMotion,
    Fault,
    FaultKind,
    momentum_errors,
    path_error,
    path_errors,
    tolerated,
)
from robotball.robot.drive_sampling import seeing_step
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL

_Run = Callable[[Settings, Array], ContactMotion]

# The monitor's tolerance for M and for slip: this multiple of the accuracy, and at most so much.
# The path, not M, is what was requested.
_MONITORED, _MOST_MONITORED = 100.0, 0.1
_PHASE = 0.32  # rad at the scene's rate, in a step of the pilot run: RK4's order shows below it
_STABLE = 1.5  # a step of the pilot run times a servo's rate; RK4 diverges at 2.785
_SEEN = 1e-4  # of a drive: the error about it in a step of the pilot run
_AIM = 0.9  # the part of the requested error at which steps are aimed by a measured error
# The part at which the first rtol is aimed by the cost model alone. It is small because a tenth of
# an rtol takes a third more steps, but a second run twice as many.
_CAUTIOUS = 0.03
_APART = 0.01  # path lengths; no law of errors holds between runs that are farther apart
_FINEST_RTOL, _COARSEST_RTOL = LEAST_RTOL, 1e-7  # with looser ones the contact may be lost
LOOSER = 300.0  # rtol of the run that DOP853's first is compared with, if one is, over its own
_SPARSE = 0.1  # s, between the samples of that run
# Under a load that varies: the least power of the timestep in RK4's error; the smallest error that
# its contact allows, whose time constant has to be two timesteps; and the rtol of the run that
# DOP853's is compared with.
_VARYING_ORDER, _SOFT, _SOFTER_RTOL = 3.4, 1e-9, 1e-14
RK4_EVALUATIONS, _DOP853_EVALUATIONS = 4, 13  # of the forces in a step, rejected steps included
_CORRECTIONS = 2  # runs after the first that was aimed by the model


class _Search:
    """The runs of one scene on the way to an accuracy."""

    def __init__(self, scene: Scene, times: Array, accuracy: float, run: _Run) -> None:
        self.scene, self.times, self.accuracy, self.run = scene, times, accuracy, run
        self.seconds = 0.0
        # A ball that hardly moves still has a duration.
        plan = PlannedRun(self.scene, self.settings(timestep=1.0), float(self.times[-1]))
        rate = scene_rate(self.scene) if plan.reduced else plan.rotation_rate
        self.rate = max(rate, 1 / plan.duration)
        self.servo_rate = plan.servo_rate

    def made(self, settings: Settings, apart: float = 0.0) -> ContactMotion:
        """Return a run at the times, or at those of them that are at least so far apart [s]."""
        motion = self.run(settings, _thinned(self.times, apart))
        self.seconds += motion.report.seconds
        return motion

    def settings(self, **steps: float | str) -> Settings:
        """Return the recipe in these steps, with the tolerances of a run to the accuracy."""
        tolerance = max(self.accuracy, min(_MONITORED * self.accuracy, _MOST_MONITORED))
        chosen = recipe(f"to {self.accuracy:g}", tolerance, **steps)
        return replace(chosen, accuracy=self.accuracy)

    def pilot(self, **steps: float | str) -> Settings:
        """Return the settings of a run that only measures: its errors are no faults yet."""
        return replace(self.settings(**steps), stop_at_fault=False)

    def reach(self) -> ContactMotion:
        """Measure the scene by two runs of RK4, then take the family that is predicted cheaper."""
        longest = PRESETS["fast"].timestep  # the longest that the recipe's contact allows
        assert longest is not None
        timestep = min(longest, _PHASE / self.rate / 2)
        if self.servo_rate > 0:
            timestep = min(timestep, _STABLE / self.servo_rate / 2)
        error_of = partial(self.scene.sampling_error, float(self.times[-1]))
        timestep = seeing_step(error_of, timestep, _SEEN)
        coarse = self.made(self.pilot(timestep=2 * timestep), apart=2 * timestep)
        fine = self.made(self.pilot(timestep=timestep))
        error = self.rk4_error(coarse, fine)
        if error <= self.accuracy:
            # The pilot run is good enough as it is.
            settings = replace(fine.report.settings, stop_at_fault=True)
            return self.result(replace(fine, report=replace(fine.report, settings=settings)), error)
        timestep = fine.report.timestep * self.finer(error, self.order)
        if self.scene.load_varies:
            quicker = 2 * self.adaptive_seconds(_FINEST_RTOL) < self.rk4_seconds(timestep)
            beyond = self.accuracy < _SOFT
            return self.by_contact() if quicker or beyond else self.by_timestep(timestep, fine)
        rtol = self.rtol(error, fine.report.timestep)
        if self.adaptive_seconds(rtol) < self.rk4_seconds(timestep):
            lost = _momentum_change(fine) if self.scene.keeps_momentum else 0.0
            return self.by_rtol(rtol, error / lost if lost > 0 and error <= _APART else np.inf)
        return self.by_timestep(timestep, fine)

    def by_timestep(self, timestep: float, before: ContactMotion) -> ContactMotion:
        """Run RK4 at a timestep, then at finer ones as long as the estimate is too large."""
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(timestep=timestep))
            error = self.rk4_error(before, motion)
            if error <= self.accuracy:
                break
            before, timestep = motion, motion.report.timestep * self.finer(error, self.order)
        return self.result(motion, error)

    def by_rtol(self, rtol: float, magnified: float) -> ContactMotion:
        """Run DOP853 at an rtol, then at smaller ones as long as the estimate is too large.

        magnified: the path error over the change of M, as RK4 showed it; infinite where it showed
        none. By it the change of M in a single run is an estimate. Where there are two runs, their
        difference is another one, and the larger counts.
        """
        before, looser = None, rtol
        if not np.isfinite(magnified):
            looser = rtol * LOOSER
            before = self.made(self.pilot(integrator=ADAPTIVE, rtol=looser), apart=_SPARSE)
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(integrator=ADAPTIVE, rtol=rtol))
            error = self.by_momentum(motion, magnified)
            if before is not None:
                doubled = self.error(before, motion, looser / rtol, COST_MODEL.rtol_order)
                error = max(error, doubled)
            if error <= self.accuracy or rtol <= _FINEST_RTOL:
                break
            before, looser = motion, rtol
            rtol = max(_FINEST_RTOL, rtol * self.finer(error, COST_MODEL.rtol_order))
        return self.result(motion, error)

    def by_contact(self) -> ContactMotion:
        """Run DOP853 at its finest, under a varying load, where the contact's depth is the error.

        A looser rtol would lift the ball off so shallow a contact. A run at a larger time constant,
        whose contact is deeper, gives the error.
        """
        finest = self.settings(integrator=ADAPTIVE, rtol=_FINEST_RTOL)
        softer = self.pilot(integrator=ADAPTIVE, rtol=_SOFTER_RTOL)
        softer = replace(softer, solref=(2 * BY_ERROR[1], 1.0))
        before, motion = self.made(softer, apart=_SPARSE), self.made(finest)
        deeper, depth = (Resolved(self.scene, s).equilibrium_depth for s in (softer, finest))
        return self.result(motion, self.error(before, motion, deeper / depth, 1.0))

    def by_momentum(self, motion: ContactMotion, magnified: float) -> float:
        """Return the path error of a whole run by the change of its M; 0 if no ratio is known."""
        if len(motion.times) < len(self.times):
            return np.inf
        return magnified * _momentum_change(motion) if np.isfinite(magnified) else 0.0

    def rk4_error(self, coarse: ContactMotion, fine: ContactMotion) -> float:
        """Return the fine run's path error, by that of coarser steps or by how steps see drives.

        Both runs step to the same sample times, so their steps have a common multiple, and a drive
        of that period would be the same constant in both.
        """
        step = fine.report.timestep
        error = self.error(coarse, fine, coarse.report.timestep / step, self.order)
        return max(error, self.scene.sampling_error(float(self.times[-1]), step))

    def error(
        self, coarse: ContactMotion, fine: ContactMotion, ratio: float, order: float
    ) -> float:
        """Return the fine run's path error, by its difference from one of steps `ratio` as long.

        It is infinite where either broke off.
        """
        if not len(coarse.times) or len(fine.times) < len(self.times):
            return np.inf
        if coarse.times[-1] < fine.times[-1]:
            return np.inf
        difference = path_error(coarse, fine)
        return difference if difference > _APART else difference / (ratio**order - 1)

    def finer(self, error: float, order: float) -> float:
        """Return the factor for the steps of a run of this error to reach the accuracy."""
        # A run that broke off has no error; half its steps are tried.
        return float((_AIM * self.accuracy / error) ** (1 / order)) if np.isfinite(error) else 0.5

    def rtol(self, error: float, timestep: float) -> float:
        """Return DOP853's rtol for the accuracy, by RK4's error at a timestep [s]."""
        stiffness = error / (self.rate * timestep) ** 4
        gain = COST_MODEL.gain * stiffness**COST_MODEL.power if np.isfinite(stiffness) else np.inf
        return float(np.clip(_CAUTIOUS * self.accuracy / gain, _FINEST_RTOL, _COARSEST_RTOL))

    def rk4_seconds(self, timestep: float) -> float:
        """Return the predicted processor time [s] of RK4 at a timestep [s]."""
        steps = step_count(self.times, self.scene.breakpoints, timestep)
        return steps * (COST_MODEL.step + RK4_EVALUATIONS * self.control)

    def adaptive_seconds(self, rtol: float) -> float:
        """Return the predicted processor time [s] of DOP853 at an rtol."""
        per_second = COST_MODEL.steps_per_second(self.rate, rtol)
        # However small the error, a servo's own rate limits the steps.
        steps = float(self.times[-1]) * max(per_second, self.servo_rate / _STABLE)
        of_steps = steps * (COST_MODEL.adaptive_step + _DOP853_EVALUATIONS * self.control)
        return of_steps + len(self.times) * (COST_MODEL.sample + self.control)

    @property
    def order(self) -> float:
        """The power of the timestep in RK4's error."""
        return _VARYING_ORDER if self.scene.load_varies else COST_MODEL.order

    @property
    def control(self) -> float:
        """The processor time [s] of the controls at each evaluation of the forces."""
        return 0.0 if self.scene.steady else COST_MODEL.control

    def result(self, motion: ContactMotion, error: float) -> ContactMotion:
        """Return the motion with its estimate; warn where that is not what was requested."""
        estimate = error if np.isfinite(error) else None
        if not error <= self.accuracy:
            how = "the run broke off" if estimate is None else f"estimated {error:.1e}"
            warn(
                f"{self.scene.name}: a path error of {self.accuracy:g} was requested, {how}; it "
                "is not reached"
            )
        report = replace(motion.report, estimated_error=estimate, total_seconds=self.seconds)
        return replace(motion, report=report)


def reach(scene: Scene, times: Array, accuracy: float, run: _Run) -> ContactMotion:
    """Return the scene's motion at times (n,) [s] to a path error, as cheaply as is predicted.

    run: makes the motion at given settings and times. Warns where the accuracy is not reached.
    """
    return _Search(scene, times, accuracy, run).reach()


# Other steps and softness, over a run's own, and the part of the tolerance that its error by them
# must not pass. Longer steps find it within a factor of 3, of 14 where it is large, and half ones
# within 5 %. As the ball could be lifted off a contact 16 times as hard, one of a quarter of the
# softness finds 0.8 of what the depth does.
_OTHER_STEPS = ((2.0, 16.0, 0.1), (0.5, 0.25, 0.75))


def checked(motion: ContactMotion, run: _Run) -> ContactMotion:
    """Return a motion with a fault where runs in other steps show that it is off.

    It is of a scene whose M may change, so that M shows no error. RK4 is off by the 4th power
    of its steps, and the contact by its depth, which goes with its softness: a run in steps f times
    as long, on a contact f⁴ times as soft, differs by |f⁴ - 1| times the error of path and M. Steps
    of twice the length, which take half the time again, clear nearly every run; half steps decide
    about the others. run: makes the motion at given settings and times.
    """
    report, scene = motion.report, motion.scene
    settings = as_own(report.settings, Settings, LABEL)
    order = Resolved(scene, settings).integrator.order
    if order != 4 or settings.accuracy or report.faults:
        return motion
    time, seconds = 0.0, report.total_seconds
    for factor, softer, part in _OTHER_STEPS:
        step, at = factor * report.timestep, _thinned(motion.times, factor * report.timestep)
        other = run(_in_steps(settings, step, softer), at)
        measured = path_errors(other, motion) / motion.path_scale, momentum_errors(other, motion)
        ratio = other.report.timestep / report.timestep
        with np.errstate(all="ignore"):  # of a single step, which cannot be any longer
            error = np.maximum(*measured) / abs(ratio**order - 1)
        off = ~(error <= part * tolerated(settings.error_tolerance, other.times))
        seconds += other.report.seconds
        if len(other.times) == len(at) and not off.any():
            return replace(motion, report=replace(report, total_seconds=seconds))
        time = float(other.times[np.argmax(off) if off.any() else -1])
    fault = Fault(FaultKind.OFF, time, limit=settings.error_tolerance)
    return replace(motion, report=replace(report, faults=(fault,), total_seconds=seconds))


def _in_steps(settings: Settings, timestep: float, softer: float) -> Settings:
    """Return settings with the timestep [s] and a contact that is deeper by a factor."""
    constant, ratio = settings.solref or (0.0, 0.0)
    longer = max(constant, 2 * timestep) if constant > 0 else constant
    deeper = (longer / constant) ** 2 if constant > 0 else 1.0
    return replace(
        settings, timestep=timestep, softness=settings.softness * softer / deeper,
        solref=settings.solref and (longer, ratio), stop_at_fault=False, max_steps=2**31 - 1,
    )  # fmt: skip


def scene_rate(scene: Scene) -> float:
    """Return the rate by which the scene's errors scale [1/s], the largest while its drives change.

    It is the root of |AK|² + |Ω|² + |AM|² + |ω|², at the scene's start.
    """
    times = [0.0] if scene.steady else np.linspace(0.0, scene.duration, 50)
    omega = scene.principal_axes.T @ scene.angular_velocity_at(scene.start)
    M = scene.principal_axes.T @ scene.start.to_world.T @ scene.start.momentum
    squares = []
    for parameters in map(scene.parameters_at, times):
        A = np.array(parameters.A)
        rates = (A * parameters.K, parameters.Omega, A * M, omega)
        squares.append(sum(float(np.dot(rate, rate)) for rate in rates))
    return float(np.sqrt(max(squares)))


def _momentum_change(motion: ContactMotion) -> float:
    """Return the largest change of M [kg m²/s]."""
    return float(np.linalg.norm(motion.momentum - motion.momentum[:1], axis=1).max())


def _thinned(times: Array, apart: float) -> Array:
    """Return some of the times, at least so far apart [s] but for the last one."""
    kept = [float(times[0])]
    for t in times[1:-1].tolist():
        if t - kept[-1] >= apart * (1 - 1e-9):
            kept.append(t)
    return np.array([*kept, times[-1]])
