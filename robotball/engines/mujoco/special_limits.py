"""Limits that only some runs have: laws as in `limits`, and the cost model of fixed steps.

First the laws of motors, changing drives and varying loads, then the laws of contacts and starts
that differ from the recipe's.
"""

from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from robotball.engines.mujoco.limits import (
    Law,
    LimitCheck,
    PlannedRun,
    error_check,
    inverse_inertia,
)
from robotball.engines.mujoco.model import ROW_DAMPING, motors_of
from robotball.engines.mujoco.settings import ORDER_8
from robotball.errors import percent
from robotball.motion import RATE_ERROR, path_unit
from robotball.robot.drives import SIMPSON, seeing_step
from robotball.robot.motors import Servo

_MEASURED = 10.0  # s, the motions on which `low_weight` was measured
_ROW = 0.02  # s, time constant of `frictionloss`, which MuJoCo raises to two timesteps
_MINUTE = 60.0  # s of processor time
_PART = 1e-4  # s of processor time: a part of a step with dry friction
_SLIPPING = 1 - 1e-6  # used part of the friction cone from which the ball slips
_SHORT = 1e-4  # of 1/b: the series' first term replaces a difference that cancels


@dataclass(frozen=True)
class _CostModel:
    """Error and cost by steps, fitted by bench.cost_model to the catalog and 30 random balls."""

    # RK4's path error goes at least with this power of the timestep.
    order: float = 3.8
    # The path error of order 8 is gain * (rate * timestep)^8 * stiffness^power, within a factor of
    # 1.8 in the timestep; the stiffness is RK4's error / (rate * timestep)^4.
    gain: float = 6.0e-5
    power: float = 0.745
    # Seconds: a step of RK4, a step of order 8, a sample inside it; and of controls that change in
    # time, at each evaluation of the forces.
    step: float = 17e-6
    order_8_step: float = 98e-6
    sample: float = 35e-6
    control: float = 8e-6


COST_MODEL = _CostModel()


def low_weight(plan: PlannedRun) -> LimitCheck | None:
    """Predict RK4's path error (r·dt)⁶ in 10 s, with the rate r of a low weight's swing.

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
    effect = "the low weight makes the ball swing fast, which will change RK4's path"
    return error_check(value, plan.tolerance, effect, f"take a timestep below {step:.2g} s")


def servo_gain(plan: PlannedRun) -> LimitCheck | None:
    """Require kv·dt/j < 2.785 for RK4, and < 2 for Euler and discrete (gain kv, inertia j).

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
        f"{value:.4g}, but {plan.integrator.name} is stable only up to {limit:.4g}: take a lower "
        "gain or a shorter timestep, or prescribe the rate"
    )
    return LimitCheck(value, limit, warning)


def late_friction(plan: PlannedRun) -> LimitCheck | None:
    """Predict the path error: in a slip, friction opposes the slip velocity of a time 1/b later.

    The friction row's force in a slip is against a + b v, with the slip v, its acceleration a and
    the damping b. So the velocity of the ball is off by Δf/(b m), with Δf the change of the
    friction's force since the ball began to slip. When it sticks again, the error of the velocity
    ends, because friction does not change the momentum about the contact. Measured 0.03 to 3.7 of
    the prediction, half of them 0.4 to 0.9, on 31 scenes of the catalog with 0.6 and 0.25 of the
    friction that they need, over 3 s.
    """
    if not plan.settings.slips:
        return None
    loads, mass = plan.whole_loads, plan.scene.ball.mass
    force, step = loads.contact_force[:, :2] / mass, plan.duration / len(loads.spin_torque)
    slips = loads.grip(plan.scene.slip_limits) > _SLIPPING
    begins = np.maximum.accumulate(np.where(slips, 0, np.arange(len(slips))))
    late = (force - force[begins]) * slips[:, None] / plan.friction_damping
    off = np.linalg.norm(np.cumsum(late, axis=0), axis=1).max() * step
    start = (plan.axes @ plan.rolling_velocity)[:2] + plan.scene.start.slip[:2]
    path = np.linalg.norm(start + np.cumsum(force, axis=0) * step, axis=1).sum() * step
    value, limit = float(off / path_unit(plan.scene, path)), plan.settings.error_tolerance
    within = plan.timestep * limit / value if value else np.inf
    effect = "friction follows the slip late, which will change the path of a slipping ball"
    return error_check(value, limit, effect, f"take a timestep below {within:.2g} s")


def lifted(plan: PlannedRun) -> LimitCheck | None:
    """Require d·b·|Wv| < g for a start with the slip v; otherwise the cone lifts the ball off.

    The normal row sees the slip times the coefficients W, with the damping b of friction and the
    impedance d. Measured with spheres that slide or spin: in contact at 0.95 of the limit, and off
    the plane at 1.05, or from 1.2 or 1.5 on if the slip ends within some hundred steps.
    """
    if not plan.settings.slips or not plan.scene.start.slips:
        return None
    slide, spin, _ = plan.friction
    slip = float(np.linalg.norm(plan.scene.start.slip * [slide, slide, spin]))
    value, limit = plan.impedance * plan.friction_damping * slip, -plan.scene.gravity_world[2]
    part = percent(limit / value) if value else ""
    warning = (
        f"the cone will accelerate the slipping ball upwards at {value:.4g} m/s², more than "
        f"gravity's {limit:.4g} m/s²: start with {part} of the slip, or give less friction"
    )
    return LimitCheck(value, limit, warning)


def raised_friction(plan: PlannedRun) -> LimitCheck | None:
    """Require friction coefficients of at least 1e-5; MuJoCo silently raises smaller ones."""
    value, limit = min(plan.friction[: plan.condim // 2]), mujoco.mjMINMU
    warning = (
        f"MuJoCo will raise a coefficient of friction from {value:.4g} to {limit:g} without a "
        f"warning: give at least {limit:g}"
    )
    return LimitCheck(value, limit, warning, least=True)


def friction_row(plan: PlannedRun) -> LimitCheck | None:
    """Predict the relative error 2F/(b M) of M: MuJoCo's soft row delays dry friction F by 1/b.

    A row of damping b acts against a + b v in place of the rate v, with a the acceleration without
    it. So it pushes along v for the time 1/b before a load reverses v. Steps of first order have
    such rows; others apply the torque. Path error measured with the rows under RK4, on 23 robots
    over 0.5 to 1 s: 0.4 to 5.7 of it with MuJoCo's b.
    """
    if plan.integrator.order > 1 or not (friction := _dry_friction(plan)):
        return None
    hard = plan.settings.solreffriction is not None
    delay = plan.timestep / ROW_DAMPING if hard else max(_ROW, 2 * plan.timestep) / 2
    value = 2 * friction * delay / plan.scene.momentum_scale
    effect = "frictionloss will push a hinge along its motion before it reverses, and change M"
    remedy = "take RK4; then robotball applies friction as a torque"
    return error_check(value, plan.settings.error_tolerance, effect, remedy)


def friction_parts(plan: PlannedRun) -> LimitCheck | None:
    """Predict the computing time if dry friction stops a hinge at a rate λ, in steps of 2/λ.

    It is an upper limit, because λ is F/(I SLOW) below SLOW only, and hinges that turn take long
    steps.
    """
    if plan.integrator.order == 1 or not _dry_friction(plan):
        return None
    from robotball.engines.mujoco.dry_friction import STABLE
    from robotball.engines.mujoco.motor_rates import fastest_rate

    fastest = fastest_rate(plan.scene, plan.hinges, plan.settings.slips, dry=True)
    value = fastest * plan.duration * _PART / STABLE
    warning = (
        f"dry friction may stop a hinge within 1/{fastest:.3g} s, and such short steps may take "
        f"{value:.3g} s to compute: give the hinge more armature, or less friction"
    )
    return LimitCheck(value, _MINUTE, warning)


def _dry_friction(plan: PlannedRun) -> float:
    """Return the sum of the motors' dry friction [N m]."""
    return sum(motor.law.friction for motor in motors_of(plan.scene, plan.hinges))


def drive_seen(plan: PlannedRun) -> LimitCheck | None:
    """Predict the error of a drive's mean rate: a step reads the drive at few times only.

    It is the error of the mean rate over a step, relative to the drive's largest rate. A slow drive
    has the small error of a quadrature rule: the rule of the steps of order 8, or Simpson's. If the
    drive's period is no longer than the step, the error may be as large as the drive itself. The
    rates at the ends of steps do not show it, because a drive whose period divides the timestep is
    constant there.
    Measured on fig12 with a sine in the frame's rate: path error 0.64 to 0.7 of it from 7 to 50 Hz,
    1.0 of it at half the rate of the steps, and 0.6 to 1.9 of it if the period divides the
    timestep.
    """
    if plan.scene.steady:
        return None
    limit = min(plan.settings.error_tolerance, RATE_ERROR)
    rule, order = SIMPSON, max(4, plan.integrator.order)
    if plan.integrator.name == ORDER_8:
        from robotball.engines.mujoco.order8 import RULE

        rule = RULE
    error_of = partial(plan.scene.sampling_error, plan.duration, rule=rule)
    value, step = error_of(plan.timestep), seeing_step(error_of, plan.timestep, limit, order)
    effect = "a drive changes within a step, which will change its mean rate"
    remedy = f"take a timestep below {step:.2g} s, or the preset exact"
    return error_check(value, limit, effect, remedy)


def servo_droop(plan: PlannedRun) -> LimitCheck | None:
    """Predict the error τ/kv of a velocity servo's rate under a load τ, relative to the rate.

    Measured 0.75 to 0.99 of that, if it is small.
    """
    gain = plan.settings.drive.gain if isinstance(plan.settings.drive, Servo) else np.inf
    # The error of the scene's own servo belongs to the motion.
    servos = [hinge for hinge in plan.hinges if hinge.actuation is plan.settings.drive]
    if gain == np.inf or not servos:
        return None
    torques = np.abs(plan.loads.motor_torques).max(axis=0)
    value = float(max(torques[hinge.index] / gain / hinge.rate_scale for hinge in servos))
    effect, remedy = "loads will change a servo's rate", "take a higher gain, or prescribe the rate"
    return error_check(value, plan.settings.error_tolerance, effect, remedy)


def contact_dimension(plan: PlannedRun) -> LimitCheck | None:
    """Require condim 4 for rubber rolling; with condim 3 the ball can spin."""
    if plan.scene.rolling != "rubber" or plan.settings.condim is None:
        return None
    warning = (
        f"the ball will spin on the spot: condim is {plan.condim}, but the rubber model needs 4: "
        "leave condim at None"
    )
    return LimitCheck(plan.condim, 4, warning, least=True)


def drag(plan: PlannedRun) -> LimitCheck | None:
    """Predict the loss μ m g t of M to rolling and torsional friction.

    The rolling model has no such rows: rolling friction with condim 6 in both models, and torsional
    friction in the classical one, which may spin. dM/dt = -μ m g at most, with the μ of the row
    [m].
    """
    coefficient = plan.friction[2] if plan.condim >= 6 else 0.0
    if plan.scene.rolling == "classical" and plan.condim >= 4:
        coefficient += plan.friction[1]
    if not coefficient:
        return None
    weight = plan.scene.ball.mass * plan.scene.gravity
    value = coefficient * weight * plan.duration / plan.scene.momentum_scale
    effect = "rolling or torsional friction, absent from the rolling model, will reduce M"
    return error_check(value, plan.settings.error_tolerance, effect, "leave condim at None")


def frame_as_root(plan: PlannedRun) -> LimitCheck | None:
    """Predict the ratio |a (ω×Ω)×γ|/(b v) of slip to speed if the frame is the model's root.

    MuJoCo leaves the J̇v term out of its contact rows, which is a(ω×Ω)×γ if the shell hangs on a
    hinge. Friction that reduces slip at the rate b leaves this slip. M stays constant, so it does
    not show the slip. Measured 0.6 to 3.5 times the prediction, which is made from the numbers of
    the start.
    """
    if plan.settings.root == "shell" or not plan.reduced:
        return None
    left_out = np.cross(plan.angular_velocity, plan.Omega)
    acceleration = plan.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, plan.axes[2])))
    value = _slip(plan, acceleration)
    effect = "with the frame as root, slip will take the ball off its path"
    return error_check(value, plan.settings.error_tolerance, effect, 'take root="shell"')


def turning_plane(plan: PlannedRun) -> LimitCheck | None:
    """Predict the ratio |Ω|v/(b v) of slip to speed on a rotating plane with a pyramidal cone.

    MuJoCo leaves the acceleration of the surface under the ball out of its contact rows. Runs add
    it to the rows of an elliptic cone; a pyramidal cone has no rows of friction alone. Measured
    1.07 of the prediction for a solid sphere.
    """
    if not plan.scene.plane_turns or plan.option("cone") == "elliptic":
        return None
    speed = float(np.linalg.norm(plan.rolling_velocity))
    value = _slip(plan, abs(float(plan.scene.plane_turn.rate(0.0))) * speed)
    effect = "on a turning plane, slip under a pyramidal cone will take the ball off its path"
    return error_check(value, plan.settings.error_tolerance, effect, 'take cone="elliptic"')


def creep(plan: PlannedRun) -> LimitCheck | None:
    """Predict the ratio (1 - d)/d α/(b v) of slip to speed at which soft friction carries its load.

    The noslip solver removes it. A row of impedance d gives its force with a deviation of
    (1 - d)/d of the acceleration α that the force makes: divided by impratio in an elliptic cone,
    times μ² in a pyramidal one, whose edges lean that far. So b v = (1 - d)/d α. Measured within
    3 % on fig12, and a sixth of it on classical_regular, whose force changes during the motion.
    """
    if plan.option("noslip_iterations") or not plan.reduced:
        return None
    softness = (1 - plan.impedance) / plan.impedance
    if plan.option("cone") == "elliptic":
        softness /= plan.option("impratio")
    else:
        softness *= plan.friction[0] ** 2
    force = float(np.linalg.norm(plan.loads.contact_force[:, :2], axis=1).max())
    value = _slip(plan, softness * force * inverse_inertia(plan)[0, 0])
    effect = "creep under soft friction will take the ball off its path"
    remedy = "give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1"
    return error_check(value, plan.settings.error_tolerance, effect, remedy)


def _slip(plan: PlannedRun, acceleration: float) -> float:
    """Return slip over path under an acceleration α [m/s²] and damping b.

    From rest dv/dt = α - b v has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = plan.friction_damping, plan.duration
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > _SHORT else b * T / 2
    path = path_unit(plan.scene, T * float(np.linalg.norm(plan.rolling_velocity)))
    return float(acceleration * (grown / b if b else T / 2) * T / path)


def start_depth(plan: PlannedRun) -> LimitCheck | None:
    """Predict the relative error g (1 - d)/(d² k a) of the lever arm after a start at depth 0.

    Half of it is in the path. The contact carries the weight at the depth p = g (1 - d)/(d² k),
    into which the ball falls. A start in equilibrium has this depth as the margin of the pair, and
    the lever arm is a.
    """
    if plan.settings.start_in_equilibrium:
        return None
    value, limit = plan.equilibrium_depth / plan.scene.ball.radius, plan.settings.error_tolerance
    effect = "relative to its radius, the ball will sink into the plane"
    return error_check(value, 2 * limit, effect, "set start_in_equilibrium")


def first_step(plan: PlannedRun) -> LimitCheck | None:
    """Predict the ratio α dt/v of slip to speed in the first step from a start at depth 0.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if plan.settings.start_in_equilibrium or not plan.reduced:
        return None
    force = float(np.linalg.norm(plan.loads.contact_force[0, :2]))
    slip = force * float(inverse_inertia(plan)[0, 0]) * plan.timestep
    value = slip / (plan.scene.momentum_scale * plan.scene.ball.radius / plan.scene.ball.d)
    effect = "the first step finds no contact. Relative to its speed, the ball will slip"
    return error_check(value, plan.settings.error_tolerance, effect, "set start_in_equilibrium")


LAWS: tuple[Law, ...] = (
    low_weight, servo_gain, friction_row, friction_parts, drive_seen, servo_droop, late_friction,
    lifted, raised_friction, contact_dimension, drag, frame_as_root, turning_plane, creep,
    start_depth, first_step,
)  # fmt: skip
