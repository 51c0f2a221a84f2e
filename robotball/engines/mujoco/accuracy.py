"""A path error requested instead of a timestep: settings predicted to reach it, and the proof.

Two families of the recipe are known: MuJoCo's RK4 at a timestep, and DOP853 at an rtol. Two cheap
runs of RK4 measure the scene's own error; the cost model says what each family then costs.
An estimate needs no reference: it compares two runs of different steps, or takes the change of
M, which should be none, as many times as those two runs say that the path shows it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from robotball.engines import LEAST_RTOL
from robotball.engines.mujoco.planned_run import COST_MODEL, PlannedRun
from robotball.engines.mujoco.settings import ADAPTIVE, BY_ERROR, PRESETS, Settings, recipe
from robotball.errors import warn
from robotball.motion import ContactMotion, path_error
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene, step_count

Run = Callable[[Settings, Array], ContactMotion]

# What a run may lose of M, or slip, before the monitor ends it: times the accuracy, and at most.
MONITORED, MOST_MONITORED = 100.0, 0.1
PHASE = 0.32  # rad at the scene's rate, in a step of the pilot run: RK4's order shows below it
STABLE = 1.5  # of a servo's rate in a step of the pilot run: RK4 diverges not far above it
AIM = 0.9  # of the error requested, at which steps are aimed by a measured error
# Of it, at which the first rtol is aimed by the cost model alone: a tenth of an rtol takes a third
# more steps, and a second run twice as many.
CAUTIOUS = 0.03
APART = 0.01  # path lengths; no law of errors holds between runs that are farther apart
FINEST_RTOL, COARSEST_RTOL = LEAST_RTOL, 1e-7  # with looser ones the contact may be lost
LOOSER = 300.0  # times rtol, of the run that DOP853's first is compared with, if one is
SPARSE = 0.1  # s, between the samples of that run
# Under a load that varies: the power of the timestep with which RK4's error goes at least; the
# smallest error that its contact allows, whose time constant has to be two timesteps; and the rtol
# of the run that DOP853's is compared with.
VARYING_ORDER, SOFT, SOFTER_RTOL = 3.4, 1e-9, 1e-14
RK4_EVALUATIONS, DOP853_EVALUATIONS = 4, 13  # of the forces in a step, rejected steps included
CORRECTIONS = 2


@dataclass
class _Search:
    """The runs of one scene on the way to an accuracy."""

    scene: Scene
    times: Array
    accuracy: float
    run: Run
    seconds: float = 0.0
    rate: float = field(init=False)
    servo_rate: float = field(init=False)

    def __post_init__(self) -> None:
        # A ball that hardly moves still has a duration.
        plan = PlannedRun(self.scene, self.settings(timestep=1.0), float(self.times[-1]))
        rate = scene_rate(self.scene) if plan.reduced else plan.rotation_rate
        self.rate = max(rate, 1 / plan.duration)
        self.servo_rate = plan.servo_rate

    def made(self, settings: Settings, apart: float = 0.0) -> ContactMotion:
        """A run at the times, or at those of them that are at least so far apart [s]."""
        motion = self.run(settings, _thinned(self.times, apart))
        self.seconds += motion.report.seconds
        return motion

    def settings(self, **steps: float | str) -> Settings:
        tolerance = max(self.accuracy, min(MONITORED * self.accuracy, MOST_MONITORED))
        chosen = recipe(f"to {self.accuracy:g}", tolerance, **steps)
        return replace(chosen, accuracy=self.accuracy)

    def pilot(self, **steps: float | str) -> Settings:
        """Settings of a run that only measures: its errors are no faults yet."""
        return replace(self.settings(**steps), stop_at_fault=False)

    def reach(self) -> ContactMotion:
        longest = PRESETS["fast"].timestep  # the longest that the recipe's contact allows
        assert longest is not None
        timestep = min(longest, PHASE / self.rate / 2)
        if self.servo_rate > 0:
            timestep = min(timestep, STABLE / self.servo_rate / 2)
        coarse = self.made(self.pilot(timestep=2 * timestep), apart=2 * timestep)
        fine = self.made(self.pilot(timestep=timestep))
        error = self.error(coarse, fine, coarse.report.timestep / fine.report.timestep, self.order)
        if error <= self.accuracy:
            # The pilot run is good enough as it is.
            settled = replace(
                fine.report, settings=replace(fine.report.settings, stop_at_fault=True)
            )
            return self.result(replace(fine, report=settled), error)
        timestep = fine.report.timestep * self.finer(error, self.order)
        if self.scene.load_varies:
            quicker = 2 * self.adaptive_seconds(FINEST_RTOL) < self.rk4_seconds(timestep)
            beyond = self.accuracy < SOFT
            return self.by_contact() if quicker or beyond else self.by_timestep(timestep, fine)
        rtol = self.rtol(error, fine.report.timestep)
        if self.adaptive_seconds(rtol) < self.rk4_seconds(timestep):
            lost = _momentum_change(fine) if self.scene.keeps_momentum else 0.0
            return self.by_rtol(rtol, error / lost if lost > 0 and error <= APART else np.inf)
        return self.by_timestep(timestep, fine)

    def by_timestep(self, timestep: float, before: ContactMotion) -> ContactMotion:
        """RK4 at a timestep, with finer ones as long as the estimate asks for them."""
        for _ in range(1 + CORRECTIONS):
            settings = self.settings(timestep=timestep)
            motion = self.made(settings)
            ratio = before.report.timestep / motion.report.timestep
            error = self.error(before, motion, ratio, self.order)
            if error <= self.accuracy:
                break
            before, timestep = motion, motion.report.timestep * self.finer(error, self.order)
        return self.result(motion, error)

    def by_rtol(self, rtol: float, magnified: float) -> ContactMotion:
        """DOP853 at an rtol, with smaller ones as long as the estimate asks for them.

        magnified: the path error for a change of M, as RK4 showed it. With it the change of M,
        which every run tells, is an estimate; two runs give theirs as well, and the larger counts.
        """
        before, looser = None, rtol
        if not np.isfinite(magnified):
            looser = rtol * LOOSER
            before = self.made(self.pilot(integrator=ADAPTIVE, rtol=looser), apart=SPARSE)
        for _ in range(1 + CORRECTIONS):
            settings = self.settings(integrator=ADAPTIVE, rtol=rtol)
            motion = self.made(settings)
            error = self.by_momentum(motion, magnified)
            if before is not None:
                doubled = self.error(before, motion, looser / rtol, COST_MODEL.rtol_order)
                error = max(error, doubled)
            if error <= self.accuracy or rtol <= FINEST_RTOL:
                break
            before, looser = motion, rtol
            rtol = max(FINEST_RTOL, rtol * self.finer(error, COST_MODEL.rtol_order))
        return self.result(motion, error)

    def by_contact(self) -> ContactMotion:
        """DOP853 at its finest under a load that varies, where the contact's depth is what errs.

        A looser rtol would lift the ball off so shallow a contact. The depth goes as the square of
        the contact's time constant, so a run at twice that tells the error.
        """
        finest = self.settings(integrator=ADAPTIVE, rtol=FINEST_RTOL)
        softer = self.pilot(integrator=ADAPTIVE, rtol=SOFTER_RTOL)
        softer = replace(softer, solref=(2 * BY_ERROR[1], 1.0))
        before, motion = self.made(softer, apart=SPARSE), self.made(finest)
        return self.result(motion, self.error(before, motion, 2.0, 2.0))

    def by_momentum(self, motion: ContactMotion, magnified: float) -> float:
        """The path error of a whole run by the change of its M; 0 if RK4 told nothing of that."""
        if len(motion.times) < len(self.times):
            return np.inf
        return magnified * _momentum_change(motion) if np.isfinite(magnified) else 0.0

    def error(
        self, coarse: ContactMotion, fine: ContactMotion, ratio: float, order: float
    ) -> float:
        """The path error of the fine run, by its difference from one of steps `ratio` as long."""
        if not len(coarse.times) or len(fine.times) < len(self.times):
            return np.inf
        if coarse.times[-1] < fine.times[-1]:
            return np.inf
        difference = path_error(coarse, fine)
        return difference if difference > APART else difference / (ratio**order - 1)

    def finer(self, error: float, order: float) -> float:
        """By what to multiply the steps of a run of this error to reach the accuracy."""
        # Of a run that broke off no error is known.
        return float((AIM * self.accuracy / error) ** (1 / order)) if np.isfinite(error) else 0.5

    def rtol(self, error: float, timestep: float) -> float:
        """DOP853's rtol for the accuracy, by RK4's error at a timestep [s]."""
        stiffness = error / (self.rate * timestep) ** 4
        gain = COST_MODEL.gain * stiffness**COST_MODEL.power if np.isfinite(stiffness) else np.inf
        return float(np.clip(CAUTIOUS * self.accuracy / gain, FINEST_RTOL, COARSEST_RTOL))

    def rk4_seconds(self, timestep: float) -> float:
        """What RK4 at a timestep will take."""
        steps = step_count(self.times, self.scene.breakpoints, timestep)
        return steps * (COST_MODEL.step + RK4_EVALUATIONS * self.control)

    def adaptive_seconds(self, rtol: float) -> float:
        """What DOP853 at an rtol will take."""
        per_second = COST_MODEL.steps_per_second(self.rate, rtol)
        # However small the error, a servo's own rate limits the steps.
        steps = float(self.times[-1]) * max(per_second, self.servo_rate / STABLE)
        of_steps = steps * (COST_MODEL.adaptive_step + DOP853_EVALUATIONS * self.control)
        return of_steps + len(self.times) * (COST_MODEL.sample + self.control)

    @property
    def order(self) -> float:
        """Of RK4's error."""
        return VARYING_ORDER if self.scene.load_varies else COST_MODEL.order

    @property
    def control(self) -> float:
        return 0.0 if self.scene.steady else COST_MODEL.control

    def result(self, motion: ContactMotion, error: float) -> ContactMotion:
        """The motion with its estimate, and a warning where it is not what was requested."""
        estimate = error if np.isfinite(error) else None
        if not error <= self.accuracy:
            how = "the run broke off" if estimate is None else f"estimated {error:.1e}"
            warn(
                f"{self.scene.name}: a path error of {self.accuracy:g} was requested, {how}; it "
                "is not reached"
            )
        report = replace(motion.report, estimated_error=estimate, total_seconds=self.seconds)
        return replace(motion, report=report)


def reach(scene: Scene, times: Array, accuracy: float, run: Run) -> ContactMotion:
    """The scene's motion at times (n,) [s] to a path error, by the cheapest settings predicted.

    run: makes the motion at given settings and times. Warns where the accuracy is not reached.
    """
    return _Search(scene, times, accuracy, run).reach()


def scene_rate(scene: Scene) -> float:
    """Return the rate by which the scene's errors scale [1/s], the largest while its drives change.

    The root of |AK|² + |Ω|² + |AM|² + |ω|², at the scene's start.
    """
    times = [0.0] if scene.steady else np.linspace(0.0, scene.duration, 50)
    omega = scene.principal_axes.T @ scene.angular_velocity_at(scene.start)
    M = scene.principal_axes.T @ rotation_matrix(scene.start.attitude).T @ scene.start.momentum
    squares = []
    for parameters in map(scene.parameters_at, times):
        A = np.array(parameters.A)
        rates = (A * parameters.K, parameters.Omega, A * M, omega)
        squares.append(sum(float(np.dot(rate, rate)) for rate in rates))
    return float(np.sqrt(max(squares)))


def _momentum_change(motion: ContactMotion) -> float:
    """The largest change of M [kg m²/s]."""
    return float(np.linalg.norm(motion.momentum - motion.momentum[:1], axis=1).max())


def _thinned(times: Array, apart: float) -> Array:
    """Some of the times, at least so far apart [s] but for the last one."""
    kept = [float(times[0])]
    for t in times[1:-1].tolist():
        if t - kept[-1] >= apart * (1 - 1e-9):
            kept.append(t)
    return np.array([*kept, times[-1]])
