"""Choose settings that reach a requested path error, and check the error of a finished run.

There are two families of settings: MuJoCo's RK4, and steps of order 8. Two cheap runs of RK4
measure the scene, and from these runs the cost model predicts which family is cheaper. No reference
is needed. The error is estimated from two runs with different steps (Richardson's rule). `checked`
applies Richardson's rule to a run with settings that the user gave.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.order8 import RULE
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import ORDER_8, PRESETS, Resolved, Settings, for_slip, recipe
from robotball.engines.mujoco.special_limits import COST_MODEL
from robotball.engines.observe import spans, step_count
from robotball.errors import warn
from robotball.motion import (
    ContactMotion,
    Fault,
    FaultKind,
    Progress,
    momentum_errors,
    path_error,
    path_errors,
    tolerated,
)
from robotball.robot.drives import seeing_step
from robotball.robot.scene import Scene
from robotball.rotations import Array

# The monitor's tolerance for M and slip, as a multiple of the accuracy, and the largest tolerance.
# The accuracy is requested for the path, so the error of M may be larger.
_MONITORED, _MOST_MONITORED = 100.0, 0.1
_PHASE = 0.32  # rad, rotation at the scene's rate in a pilot step; below, RK4 shows its order
_STABLE = 1.5  # pilot step times a servo's rate; RK4 diverges at 2.785
_DRIVE_ERROR = 1e-4  # largest error, relative, of a drive that is sampled at the pilot's steps
_AIM = 0.9  # fraction of the accuracy that a corrected step aims at
# Fraction of the accuracy that the first steps of order 8 aim at. It is small because a second run
# doubles the time, and a fifth of the error adds only a fifth.
_CAUTIOUS = 0.2
_APART = 0.01  # path lengths; if runs differ by more, no law of errors applies
_LONGEST = 0.1  # s, steps of order 8; the contact is stable up to 0.25
# For a varying load: the least order of RK4, and the smallest error that its contact allows, whose
# time constant is at least two timesteps.
_VARYING_ORDER, _SOFT = 3.4, 1e-9
RK4_EVALUATIONS, _ORDER_8_EVALUATIONS = 4, 12  # of the forces per step
_INSIDE_ORDER = 7.0  # order of the interpolated samples inside steps of order 8
_CERTAIN = 1.25  # factor on an estimate from two runs, which may be 10 % too small
_ALIKE = 0.2  # logarithm of the ratio of steps whose runs are too alike to compare
_CORRECTIONS = 2  # number of runs after the first run


class _Search:
    """The runs of one scene on the way to an accuracy."""

    def __init__(
        self, scene: Scene, times: Array, accuracy: float, progress: Progress | None
    ) -> None:
        self.scene, self.times, self.accuracy, self.progress = scene, times, accuracy, progress
        self.seconds, self.remaining = 0.0, 1.0
        # For a ball at rest there is no rate, so use the duration.
        plan = PlannedRun(self.scene, self.settings(timestep=1.0), float(self.times[-1]))
        self.slips = plan.settings.slips
        rate = scene_rate(self.scene) if plan.reduced else plan.rotation_rate
        self.rate = max(rate, 1 / plan.duration)
        self.servo_rate = plan.servo_rate

    def made(self, settings: Settings, apart: float = 0.0) -> ContactMotion:
        """Return a run, sampled at the times that are at least so far apart [s]."""
        # The number of runs is unknown, so each takes half of the remaining progress.
        self.remaining = part = self.remaining / 2
        progress = self.progress
        share = progress and (lambda fraction: progress(1 - 2 * part + part * fraction))
        motion = run(build(self.scene, settings), _thinned(self.times, apart), share)
        self.seconds += motion.report.seconds
        return motion

    def settings(self, **steps: float | str) -> Settings:
        """Return the recipe with these steps, and with the tolerance for the accuracy."""
        tolerance = max(self.accuracy, min(_MONITORED * self.accuracy, _MOST_MONITORED))
        chosen = recipe(f"to {self.accuracy:g}", tolerance, **steps)
        return replace(chosen, accuracy=self.accuracy)

    def pilot(self, **steps: float | str) -> Settings:
        """Return the settings of a run that measures the scene and does not stop at a fault."""
        return replace(self.settings(**steps), stop_at_fault=False)

    def reach(self) -> ContactMotion:
        """Measure the scene with two runs of RK4, then use the cheaper family."""
        longest = PRESETS["fast"].timestep  # the recipe's contact allows no longer step
        assert longest is not None
        timestep = min(longest, _PHASE / self.rate / 2)
        if self.servo_rate > 0:
            timestep = min(timestep, _STABLE / self.servo_rate / 2)
        error_of = partial(self.scene.sampling_error, float(self.times[-1]))
        timestep = seeing_step(error_of, timestep, _DRIVE_ERROR)
        coarse = self.made(self.pilot(timestep=2 * timestep), apart=2 * timestep)
        fine = self.made(self.pilot(timestep=timestep))
        error = self.rk4_error(coarse, fine)
        if error <= self.accuracy:
            settings = replace(fine.report.settings, stop_at_fault=True)
            return self.result(replace(fine, report=replace(fine.report, settings=settings)), error)
        timestep = fine.report.timestep * self.refinement(error, self.order)
        step = self.order_8_step(error, fine.report.timestep)
        reachable = self.accuracy >= _SOFT or not self.scene.load_varies
        quicker = reachable and self.rk4_seconds(timestep) <= self.order_8_seconds(step)
        if self.slips or quicker:
            return self.by_timestep(timestep, fine)
        return self.by_order_8(step)

    def by_timestep(self, timestep: float, before: ContactMotion) -> ContactMotion:
        """Run RK4, with smaller timesteps while the estimate exceeds the accuracy."""
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(timestep=timestep))
            error = self.rk4_error(before, motion)
            if error <= self.accuracy:
                break
            before, timestep = motion, motion.report.timestep * self.refinement(error, self.order)
        return self.result(motion, error)

    def by_order_8(self, step: float) -> ContactMotion:
        """Run with steps of order 8 [s], and shorter steps while the estimate is too large."""
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(integrator=ORDER_8, timestep=step))
            error = self.by_other_steps(motion)
            if error <= self.accuracy:
                break
            # Under a varying load the contact's part of the error falls more slowly.
            order = _VARYING_ORDER if self.scene.load_varies else _INSIDE_ORDER
            step = motion.report.timestep * self.refinement(error, order)
        return self.result(motion, error)

    def by_other_steps(self, motion: ContactMotion) -> float:
        """Estimate the path error of a run from a run with longer or shorter steps.

        Breakpoints and fast servos may not allow longer steps. Under a varying load the depth of
        the contact is changed as well.
        """
        settings, step = motion.report.settings, motion.report.timestep
        assert isinstance(settings, Settings)
        stops, breakpoints = self.times[[0, -1]], self.scene.breakpoints
        for factor, softer in _OTHER_8:
            other = _in_steps(self.scene, settings, factor * step, softer)
            longest = PlannedRun(self.scene, other, float(stops[-1])).timestep
            ratio = spans(stops, breakpoints, longest)[1].max() / step
            if abs(np.log(ratio)) > _ALIKE:
                break
        compared = self.made(other)
        if min(len(motion.times) - len(self.times), compared.times[-1] - self.times[-1]) < 0:
            return np.inf
        changes = [ratio**_INSIDE_ORDER] + [softer] * self.scene.load_varies
        difference = path_error(compared, motion)
        part = _CERTAIN * difference / min(abs(change - 1) for change in changes)
        return max(difference if difference > _APART else part, self.sampling_error_8(step))

    def rk4_error(self, coarse: ContactMotion, fine: ContactMotion) -> float:
        """Estimate the fine run's path error from a coarse run, and from the drives' sampling.

        A drive whose period divides both steps looks constant in both runs.
        """
        step, end = fine.report.timestep, max(coarse.times, default=0.0)
        ratio = coarse.report.timestep / step
        # A controller that acts within both steps shortens the two steps to the same length.
        if len(fine.times) < len(self.times) or end < fine.times[-1] or ratio == 1.0:
            return np.inf
        difference = path_error(coarse, fine)
        error = difference if difference > _APART else difference / (ratio**self.order - 1)
        return max(error, self.scene.sampling_error(float(self.times[-1]), step))

    def refinement(self, error: float, order: float) -> float:
        """Return the factor by which to shorten the steps of a run with this error."""
        # A failed run has no error, so its steps are halved.
        return float((_AIM * self.accuracy / error) ** (1 / order)) if np.isfinite(error) else 0.5

    def order_8_step(self, error: float, timestep: float) -> float:
        """Return the step of order 8 [s] for the accuracy, given RK4's error at a timestep [s]."""
        stiffness = error / (self.rate * timestep) ** 4
        gain = COST_MODEL.gain * stiffness**COST_MODEL.power if np.isfinite(stiffness) else np.inf
        step = float((_CAUTIOUS * self.accuracy / gain) ** (1 / 8) / self.rate)
        settings = self.settings(integrator=ORDER_8, timestep=min(max(step, 1e-3), _LONGEST))
        step = PlannedRun(self.scene, settings, float(self.times[-1])).timestep
        return seeing_step(self.sampling_error_8, step, self.accuracy, 8)

    def sampling_error_8(self, step: float) -> float:
        """Return the error of the drives in steps of order 8 [s]."""
        return self.scene.sampling_error(float(self.times[-1]), step, RULE)

    def rk4_seconds(self, timestep: float) -> float:
        """Predict the processor time [s] of RK4 at a timestep [s]."""
        steps = step_count(self.times, self.scene.breakpoints, timestep)
        return steps * (COST_MODEL.step + RK4_EVALUATIONS * self.control)

    def order_8_seconds(self, step: float) -> float:
        """Predict the processor time [s] of steps of order 8 [s]."""
        stops, breakpoints = self.times[[0, -1]], self.scene.breakpoints
        steps = step_count(stops, breakpoints, step)
        inside = step_count(self.times, breakpoints, step) - steps
        of_steps = steps * (COST_MODEL.order_8_step + _ORDER_8_EVALUATIONS * self.control)
        return of_steps + max(inside, 0.0) * (COST_MODEL.sample + self.control)

    @property
    def order(self) -> float:
        """The power of the timestep in RK4's error."""
        if self.slips:
            return 1.0
        return _VARYING_ORDER if self.scene.load_varies else COST_MODEL.order

    @property
    def control(self) -> float:
        """The processor time [s] of the controls per evaluation of the forces."""
        return 0.0 if self.scene.steady else COST_MODEL.control

    def result(self, motion: ContactMotion, error: float) -> ContactMotion:
        """Return the motion with its estimate. Warn if the accuracy is not reached."""
        estimate = error if np.isfinite(error) else None
        if not error <= self.accuracy:
            reached = "the run broke off" if estimate is None else f"reached about {error:.1e}"
            warn(
                f"{self.scene.name}: path error {self.accuracy:g} not reached: {reached}. Request "
                "a larger error, or a shorter run."
            )
        report = replace(motion.report, estimated_error=estimate, total_seconds=self.seconds)
        return replace(motion, report=report)


def reach(
    scene: Scene, times: Array, accuracy: float, progress: Progress | None = None
) -> ContactMotion:
    """Return the scene's motion at times (n,) [s] to a path error, at the least predicted cost.

    Warns if the accuracy is not reached.
    """
    return _Search(scene, times, accuracy, progress).reach()


# Factors of the timestep and of the contact's softness in the runs that check a run, with RK4 and
# with order 8, and the fraction of the tolerance that the estimated error must not exceed. Runs
# with longer steps estimate the error within a factor of 3, or of 14 if the error is large, and
# runs with shorter steps within 5 %. A contact 16 times as hard could lift the ball off. A contact
# 4 times as hard shows 0.8 of the error due to the depth.
_OTHER, _OTHER_8 = ((2.0, 16.0), (0.5, 0.25)), ((2**0.5, 16.0), (0.5**0.5, 0.25))
_PARTS = 0.1, 0.75


def checked(motion: ContactMotion) -> ContactMotion:
    """Return a motion, with a fault if runs with other steps show that it is inaccurate.

    Only runs with RK4 and RK8 are checked, and only if M may change or the ball may slip. In other
    runs the change of M shows the error. While a ball slips, the error is of first order. RK4's
    error is proportional to the 4th power of the timestep. The contact's error is proportional to
    its depth, and the depth to the softness. A run with f times the timestep and f⁴ times the
    softness therefore differs by |f⁴ - 1| times the error of path and M. Runs with twice the
    timestep clear most runs and take half of a run's time. For the remaining runs, a run with half
    the timestep decides. For steps of order 8, the powers apply to the square root of f.
    """
    report, scene, settings = motion.report, motion.scene, motion.report.settings
    constant_momentum = scene.not_reduced is None and not scene.may_slip
    if constant_momentum or settings.accuracy or report.faults:
        return motion
    assert isinstance(settings, Settings)
    if settings.slips:
        order = 1
    elif (order := Resolved(scene, settings).integrator.order) == 1:
        return motion
    time, seconds = 0.0, report.total_seconds
    for (factor, softer), part in zip(_OTHER_8 if order == 8 else _OTHER, _PARTS, strict=True):
        step, at = factor * report.timestep, _thinned(motion.times, factor * report.timestep)
        changed = _in_steps(scene, settings, step, softer)
        other = run(build(scene, changed), at)
        measured = path_errors(other, motion) / motion.path_scale, momentum_errors(other, motion)
        ratio = other.report.timestep / report.timestep
        with np.errstate(all="ignore"):  # the ratio is 1 if a single step covers the run
            error = np.maximum(*measured) / abs(ratio**order - 1)
        off = ~(error <= part * tolerated(settings.error_tolerance, other.times))
        seconds += other.report.seconds
        if len(other.times) == len(at) and not off.any():
            return replace(motion, report=replace(report, total_seconds=seconds))
        time = float(other.times[np.argmax(off) if off.any() else -1])
    fault = Fault(FaultKind.OFF, time, limit=settings.error_tolerance)
    return replace(motion, report=replace(report, faults=(fault,), total_seconds=seconds))


def _in_steps(scene: Scene, settings: Settings, timestep: float, softer: float) -> Settings:
    """Return settings with another timestep [s] and a contact that is `softer` times as deep.

    The depth of the contact for slipping follows from the timestep.
    """
    unlimited = replace(settings, stop_at_fault=False, max_steps=2**31 - 1)
    if settings.slips:
        return for_slip(scene, unlimited, timestep)
    if not settings.own:  # the tolerance may limit the steps, but not the contact
        tolerance, softness = softer * settings.error_tolerance, softer * settings.softness
        return replace(unlimited, timestep=timestep, softness=softness, error_tolerance=tolerance)
    constant, ratio = settings.solref or (0.0, 0.0)
    longer = max(constant, 2 * timestep) if constant > 0 else constant
    deeper = (longer / constant) ** 2 if constant > 0 else 1.0
    softness, solref = settings.softness * softer / deeper, settings.solref and (longer, ratio)
    return replace(unlimited, timestep=timestep, softness=softness, solref=solref)


def scene_rate(scene: Scene) -> float:
    """Return the rate that the scene's errors scale with [1/s], the largest while drives change.

    It is the root of |AK|² + |Ω|² + |AM|² + |ω|² at the start.
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


def _thinned(times: Array, apart: float) -> Array:
    """Return the times that are at least so far apart [s], and the last one."""
    kept = [float(times[0])]
    for t in times[1:-1].tolist():
        if t - kept[-1] >= apart * (1 - 1e-9):
            kept.append(t)
    return np.array([*kept, times[-1]])
