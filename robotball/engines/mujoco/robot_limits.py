"""Limits of motors, changing drives, varying loads and adaptive steps: laws as in `limits`."""

from functools import partial

import numpy as np

from robotball.engines.mujoco.cost_model import COST_MODEL
from robotball.engines.mujoco.limits import Law, LimitCheck, PlannedRun, percent
from robotball.motion import RATE_ERROR
from robotball.robot.drives import seeing_step
from robotball.robot.motors import Servo

_MEASURED = 10.0  # s, the motions on which `low_weight` was measured
_STABLE = 6.3  # longest stable step of DOP853, times the rate at which the fastest motor settles
_MANY_STEPS = 20_000  # adaptive steps, ten seconds of time at least


def low_weight(plan: PlannedRun) -> LimitCheck | None:
    """Predict RK4's path error (r·dt)⁶ in 10 s, r the rate of a low weight at its lowest point.

    There the inertia I about the contact is least; at an angle ψ it is I + a|S|ψ², with S = Σ m r.
    With the energy E above rest, the ball turns at √(2E/I) through the angle √(I/a|S|) in which I
    doubles, and a small swing has the rate √(g|S|/I): r² = |S|(g + 2aE/I)/I. All joints are held.
    Measured 0.7 to 1.5 of (r dt)⁶ over ten seconds, from 2.5e-7 to 8.5e-3, on nine frames of 10 to
    50 kg in a shell of 1 kg, and a fifth to 3 times it on random ones over 1 to 3 s.
    """
    scene = plan.scene
    if plan.integrator.order != 4 or not scene.load_varies:
        return None
    start = scene.states_of(scene.angular_velocity_at(scene.start))
    S, u, gamma = scene.ball.mass * start.centre_of_mass[0], start.u[:3, 0], start.gamma[:, 0]
    if not (size := float(np.linalg.norm(S))):
        return None
    (angles, rates), still = scene.hinged, np.zeros((1, 3))
    low = scene.robot.states(-S[None] / size, angles, still, 0 * rates).matrix[:3, :3, 0]
    across = np.linalg.svd(S[None])[2][1:]
    inertia = np.linalg.eigvalsh(across @ low @ across.T)[0]
    energy = u @ start.matrix[:3, :3, 0] @ u / 2 + scene.gravity * (S @ gamma + size)
    squared = size / inertia * (scene.gravity + 2 * scene.ball.radius * energy / inertia)
    value = float((squared * plan.timestep**2) ** 3 * plan.duration / _MEASURED)
    step = plan.timestep * (plan.tolerance / value) ** (1 / 6)
    warning = (
        f"the swing of a low weight will put RK4's path off by about {percent(value)}; "
        f"{percent(plan.tolerance)} is allowed: take a timestep below {step:.2g} s"
    )
    return LimitCheck(value, plan.tolerance, warning)


def errors_added(plan: PlannedRun) -> LimitCheck | None:
    """Predict the sum of the errors of DOP853's steps: rtol times their number.

    Measured: M drifts by 0.005 to 0.2 of it on four scenes, from 1e-12 to 1e-6; from 1e-4 on the
    contact may be lost as well.
    """
    rtol = plan.settings.rtol
    if not plan.settings.adaptive or rtol is None:
        return None
    steps = plan.duration * COST_MODEL.steps_per_second(plan.rotation_rate, rtol)
    value = rtol * max(steps, 1.0)
    warning = (
        f"the errors of all steps may change M by about {percent(value)}; "
        f"{percent(plan.tolerance)} is allowed: take a smaller rtol"
    )
    return LimitCheck(value, plan.tolerance, warning)


def settling(plan: PlannedRun) -> LimitCheck | None:
    """Predict DOP853's steps of 6.3/λ at most, λ the rate at which a servo settles.

    Longer steps are unstable, whatever their error.
    """
    fastest = plan.servo_rate
    if not plan.settings.adaptive or not fastest:
        return None
    value = fastest * plan.duration / _STABLE
    warning = (
        f"the servos' rate needs {value:.4g} adaptive steps, and more than {_MANY_STEPS:.4g} take "
        "minutes: take a lower gain or more armature, or prescribe the rate"
    )
    return LimitCheck(value, _MANY_STEPS, warning)


def servo_gain(plan: PlannedRun) -> LimitCheck | None:
    """Require kv·dt/j < 2.785 of RK4, 2 of Euler and discrete, kv/j a servo's gain over inertia.

    The implicit integrators have no limit. A velocity servo is a damper, and j the inertia that it
    feels with the ball rolling. kv/j is the plan's `servo_rate`, the size of a complex rate with
    springs and position servos. Measured on both models: sound at 2.7 and diverged at 2.9 with RK4,
    at 1.95 and 2.1 with Euler.
    """
    limit, fastest = plan.integrator.servo_limit, plan.servo_rate
    if limit is None or not fastest:
        return None
    value = fastest * plan.timestep
    warning = (
        f"the servos' rates will grow: their gain times the timestep over their inertia is "
        f"{value:.4g}, and {plan.integrator.name} is stable up to {limit:.4g}: take a lower gain "
        "or a shorter timestep, or prescribe the rate"
    )
    return LimitCheck(value, limit, warning)


def drive_seen(plan: PlannedRun) -> LimitCheck | None:
    """Predict the error of a drive's rate, of which a step sees begin, middle and end alone.

    It is the error of the mean rate over a step: Simpson's, of fourth order, for slow drives, and
    the size of the drive itself if its period is no longer than the step. The rates at the ends of
    steps do not show it, because a drive whose period divides the timestep is a constant there.
    Measured on fig12 with a sine in the frame's rate: path error 0.64 to 0.7 of it from 7 to 50 Hz,
    1.0 of it at half the rate of the steps, and 0.6 to 1.9 of it if the period divides the
    timestep.
    """
    if plan.settings.adaptive or plan.scene.steady:
        return None
    limit = min(plan.settings.error_tolerance, RATE_ERROR)
    error_of = partial(plan.scene.sampling_error, plan.duration)
    value, step = error_of(plan.timestep), seeing_step(error_of, plan.timestep, limit)
    warning = (
        f"a drive changes within a step, which will put its rate off by about {percent(value)}; "
        f"{percent(limit)} is allowed: take a timestep below {step:.2g} s, or the adaptive preset"
    )
    return LimitCheck(value, limit, warning)


def servo_droop(plan: PlannedRun) -> LimitCheck | None:
    """Predict the error τ/kv of a velocity servo's rate under its load, relative to the rate.

    Measured 0.75 to 0.99 of that, if it is small.
    """
    servos = [(h, h.actuation) for h in plan.hinges if isinstance(h.actuation, Servo)]
    if not servos:
        return None
    value = 0.0
    for hinge, servo in servos:
        torque = float(np.abs(plan.loads.motor_torques[:, hinge.index]).max())
        if hinge.motor is None:  # the error of the scene's own servo belongs to the motion
            value = max(value, torque / servo.gain / hinge.rate_scale)
    limit = plan.settings.error_tolerance
    warning = (
        f"loads will change a servo's rate by about {percent(value)}; {percent(limit)} is allowed: "
        "take a higher gain, or prescribe the rate"
    )
    return LimitCheck(value, limit, warning)


LAWS: tuple[Law, ...] = (low_weight, errors_added, settling, servo_gain, drive_seen, servo_droop)
