"""Choose settings that reach a requested path error, and check the error of a finished run.

Settings come in two families: MuJoCo's RK4 at a timestep, and DOP853 at an rtol. Two cheap runs of
RK4 measure the scene, and the cost model predicts from them which family is cheaper. No reference
is needed. The error is estimated from two runs with different steps (Richardson's rule), or from
the change of M, which is constant, times the ratio of path error to change of M in the RK4 runs.
`checked` applies Richardson's rule to a run whose settings were given.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import (
    ADAPTIVE,
    BY_ERROR,
    PRESETS,
    Resolved,
    Settings,
    for_slip,
    recipe,
)
from robotball.engines.mujoco.special_limits import COST_MODEL
from robotball.engines.observe import step_count
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
from robotball.theory.dop853 import LEAST_RTOL

# The monitor's tolerance for M and slip, as a multiple of the accuracy, and its largest value. The
# request is about the path, so M may be off by more.
_MONITORED, _MOST_MONITORED = 100.0, 0.1
_PHASE = 0.32  # rad turned at the scene's rate in a pilot step; RK4 shows its order below it
_STABLE = 1.5  # pilot step times a servo's rate; RK4 diverges at 2.785
_DRIVE_ERROR = 1e-4  # largest error, relative, of a drive that is sampled at the pilot's steps
_AIM = 0.9  # part of the accuracy that a corrected step aims at
# Part of the accuracy that the first rtol aims at. It is small because a second run doubles the
# time, and a tenth of the rtol adds only a third.
_CAUTIOUS = 0.03
_APART = 0.01  # path lengths; runs that differ by more follow no law of errors
_FINEST_RTOL, _COARSEST_RTOL = LEAST_RTOL, 1e-7  # the contact may be lost with a coarser rtol
LOOSER = 300.0  # rtol of the run that DOP853's first run is compared with, over its rtol
_SPARSE = 0.1  # s between the samples of that run
# For a varying load: the least order of RK4; the smallest error that its contact allows, whose time
# constant is at least two timesteps; and the rtol of the run that DOP853's run is compared with.
_VARYING_ORDER, _SOFT, _SOFTER_RTOL = 3.4, 1e-9, 1e-14
RK4_EVALUATIONS, _DOP853_EVALUATIONS = 4, 13  # of the forces per step, rejected steps included
_CORRECTIONS = 2  # runs after the first one


class _Search:
    """The runs of one scene on the way to an accuracy."""

    def __init__(
        self, scene: Scene, times: Array, accuracy: float, progress: Progress | None
    ) -> None:
        self.scene, self.times, self.accuracy, self.progress = scene, times, accuracy, progress
        self.seconds, self.remaining = 0.0, 1.0
        # A ball at rest has no rate, but a duration.
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
        longest = PRESETS["fast"].timestep  # the contact of the recipe allows no longer one
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
        if self.slips:
            return self.by_timestep(timestep, fine)
        if self.scene.load_varies:
            quicker = 2 * self.adaptive_seconds(_FINEST_RTOL) < self.rk4_seconds(timestep)
            unreachable = self.accuracy < _SOFT
            return self.by_contact() if quicker or unreachable else self.by_timestep(timestep, fine)
        rtol = self.rtol(error, fine.report.timestep)
        if self.adaptive_seconds(rtol) < self.rk4_seconds(timestep):
            lost = _momentum_change(fine) if self.scene.keeps_momentum else 0.0
            return self.by_rtol(rtol, error / lost if lost > 0 and error <= _APART else np.inf)
        return self.by_timestep(timestep, fine)

    def by_timestep(self, timestep: float, before: ContactMotion) -> ContactMotion:
        """Run RK4, with smaller timesteps while the estimate exceeds the accuracy."""
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(timestep=timestep))
            error = self.rk4_error(before, motion)
            if error <= self.accuracy:
                break
            before, timestep = motion, motion.report.timestep * self.refinement(error, self.order)
        return self.result(motion, error)

    def by_rtol(self, rtol: float, ratio: float) -> ContactMotion:
        """Run DOP853, with smaller rtols while the estimate exceeds the accuracy.

        ratio: path error over change of M in the runs of RK4; infinite if unknown.
        """
        before, looser = None, rtol
        if not np.isfinite(ratio):
            looser = rtol * LOOSER
            before = self.made(self.pilot(integrator=ADAPTIVE, rtol=looser), apart=_SPARSE)
        for _ in range(1 + _CORRECTIONS):
            motion = self.made(self.settings(integrator=ADAPTIVE, rtol=rtol))
            error = self.by_momentum(motion, ratio)
            if before is not None:
                doubled = self.error(before, motion, looser / rtol, COST_MODEL.rtol_order)
                error = max(error, doubled)
            if error <= self.accuracy or rtol <= _FINEST_RTOL:
                break
            before, looser = motion, rtol
            rtol = max(_FINEST_RTOL, rtol * self.refinement(error, COST_MODEL.rtol_order))
        return self.result(motion, error)

    def by_contact(self) -> ContactMotion:
        """Run DOP853 at the finest rtol; a coarser one would lift the ball off its contact.

        Under a varying load the contact's depth is the error, so a deeper contact estimates it.
        """
        finest = self.settings(integrator=ADAPTIVE, rtol=_FINEST_RTOL)
        softer = self.pilot(integrator=ADAPTIVE, rtol=_SOFTER_RTOL)
        softer = replace(softer, solref=(2 * BY_ERROR[1], 1.0))
        before, motion = self.made(softer, apart=_SPARSE), self.made(finest)
        deeper, depth = (Resolved(self.scene, s).equilibrium_depth for s in (softer, finest))
        return self.result(motion, self.error(before, motion, deeper / depth, 1.0))

    def by_momentum(self, motion: ContactMotion, ratio: float) -> float:
        """Estimate the path error of a complete run from its change of M; 0 for no known ratio."""
        if len(motion.times) < len(self.times):
            return np.inf
        return ratio * _momentum_change(motion) if np.isfinite(ratio) else 0.0

    def rk4_error(self, coarse: ContactMotion, fine: ContactMotion) -> float:
        """Estimate the fine run's path error from a coarse run, and from the drives' sampling.

        A drive whose period divides both steps looks constant in both runs.
        """
        step = fine.report.timestep
        error = self.error(coarse, fine, coarse.report.timestep / step, self.order)
        return max(error, self.scene.sampling_error(float(self.times[-1]), step))

    def error(
        self, coarse: ContactMotion, fine: ContactMotion, ratio: float, order: float
    ) -> float:
        """Estimate the fine run's path error from one with `ratio` times its steps."""
        if not len(coarse.times) or len(fine.times) < len(self.times):
            return np.inf
        if coarse.times[-1] < fine.times[-1]:
            return np.inf
        difference = path_error(coarse, fine)
        return difference if difference > _APART else difference / (ratio**order - 1)

    def refinement(self, error: float, order: float) -> float:
        """Return the factor by which to shorten the steps of a run with this error."""
        # A run that broke off has no error, so its steps are halved.
        return float((_AIM * self.accuracy / error) ** (1 / order)) if np.isfinite(error) else 0.5

    def rtol(self, error: float, timestep: float) -> float:
        """Return DOP853's rtol for the accuracy, given RK4's error at a timestep [s]."""
        stiffness = error / (self.rate * timestep) ** 4
        gain = COST_MODEL.gain * stiffness**COST_MODEL.power if np.isfinite(stiffness) else np.inf
        return float(np.clip(_CAUTIOUS * self.accuracy / gain, _FINEST_RTOL, _COARSEST_RTOL))

    def rk4_seconds(self, timestep: float) -> float:
        """Predict the processor time [s] of RK4 at a timestep [s]."""
        steps = step_count(self.times, self.scene.breakpoints, timestep)
        return steps * (COST_MODEL.step + RK4_EVALUATIONS * self.control)

    def adaptive_seconds(self, rtol: float) -> float:
        """Predict the processor time [s] of DOP853 at an rtol."""
        per_second = COST_MODEL.steps_per_second(self.rate, rtol)
        # A servo's rate limits the steps, whatever their error.
        steps = float(self.times[-1]) * max(per_second, self.servo_rate / _STABLE)
        of_steps = steps * (COST_MODEL.adaptive_step + _DOP853_EVALUATIONS * self.control)
        return of_steps + len(self.times) * (COST_MODEL.sample + self.control)

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
                "a larger one, or a shorter run."
            )
        report = replace(motion.report, estimated_error=estimate, total_seconds=self.seconds)
        return replace(motion, report=report)


def reach(
    scene: Scene, times: Array, accuracy: float, progress: Progress | None = None
) -> ContactMotion:
    """Return the scene's motion at times (n,) [s] to a path error, as cheaply as is predicted.

    Warns if the accuracy is not reached.
    """
    return _Search(scene, times, accuracy, progress).reach()


# Factors of the timestep and of the contact's softness in the runs that check a run, and the part
# of the tolerance that the estimated error must not exceed. Runs with longer steps estimate it
# within a factor of 3, or of 14 where it is large, and runs with half steps within 5 %. A contact
# 16 times as hard could lift the ball off; one 4 times as hard shows 0.8 of the depth's error.
_OTHER_STEPS = ((2.0, 16.0, 0.1), (0.5, 0.25, 0.75))


def checked(motion: ContactMotion) -> ContactMotion:
    """Return a motion, with a fault if runs with other steps show that it is inaccurate.

    Only runs of RK4 whose M may change are checked, and runs of balls that may slip: elsewhere the
    change of M shows the error. While a ball slips, the error is of first order.
    RK4's error goes with the 4th power of the timestep, and the contact's with its depth, which
    goes with its softness. A run with f times the timestep and f⁴ times the softness therefore
    differs by |f⁴ - 1| times the error of path and M. Runs with twice the timestep, which take half
    the time again, clear most runs. Half the timestep decides about the others.
    """
    report, scene, settings = motion.report, motion.scene, motion.report.settings
    constant_momentum = scene.not_reduced is None and not scene.may_slip
    if constant_momentum or settings.accuracy or report.faults:
        return motion
    assert isinstance(settings, Settings)
    if settings.slips:
        order = 1
    elif (order := Resolved(scene, settings).integrator.order) != 4:
        return motion
    time, seconds = 0.0, report.total_seconds
    for factor, softer, part in _OTHER_STEPS:
        step, at = factor * report.timestep, _thinned(motion.times, factor * report.timestep)
        changed = _in_steps(scene, settings, step, softer)
        other = run(build(scene, changed), at)
        measured = path_errors(other, motion) / motion.path_scale, momentum_errors(other, motion)
        ratio = other.report.timestep / report.timestep
        with np.errstate(all="ignore"):  # the ratio is 1 if a single step spans the run
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
    constant, ratio = settings.solref or (0.0, 0.0)
    longer = max(constant, 2 * timestep) if constant > 0 else constant
    deeper = (longer / constant) ** 2 if constant > 0 else 1.0
    return replace(
        unlimited,
        timestep=timestep,
        softness=settings.softness * softer / deeper,
        solref=settings.solref and (longer, ratio),
    )


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


def _momentum_change(motion: ContactMotion) -> float:
    """Return the largest change of M [kg m²/s]."""
    return float(np.linalg.norm(motion.momentum - motion.momentum[:1], axis=1).max())


def _thinned(times: Array, apart: float) -> Array:
    """Return the times that are at least so far apart [s], and the last one."""
    kept = [float(times[0])]
    for t in times[1:-1].tolist():
        if t - kept[-1] >= apart * (1 - 1e-9):
            kept.append(t)
    return np.array([*kept, times[-1]])
