"""Predicted limits of a run: a law a function, and the precheck of a run against all of them.

The laws are of the contact (friction, softness, and what numbers can hold), of the time step (what
an integrator makes of rotations, springs, dampers and servos) and of the hinges (the part of its
rate that a servo or an armature loses under its load). Each docstring has its derivation and how
near measurements come to it.
"""

import math

import numpy as np

from robotball.drives import Servo
from robotball.engines.mujoco.planned_run import COST_MODEL, Laws, LimitCheck, PlannedRun
from robotball.engines.mujoco.settings import Prescribed, Settings
from robotball.errors import InputError, warn
from robotball.motion import Loads
from robotball.rotations import Array
from robotball.scene import Scene, step_count

LARGEST_STATE = 1e10  # mjMAXVAL: MuJoCo calls a larger position, velocity or control bad
LEAST_DETERMINANT = 1e-10  # below it MuJoCo takes a contact's friction for singular


def sliding_friction(plan: PlannedRun) -> LimitCheck | None:
    """μ ≥ |F_horizontal|/N: what the motion by (2.4) asks of the plane.

    At the start if that is all that is known, so that a demand which grows later is not seen.
    """
    return LimitCheck(
        "sliding friction",
        plan.friction[0],
        float(plan.loads.sliding_friction.max()),
        "the ball slips; give sliding_friction more",
        least=True,
    )


def torsional_friction(plan: PlannedRun) -> LimitCheck | None:
    """μ_t ≥ |λ₀|/N for rubber; with less the ball spins under drag, and that is not rubber."""
    if plan.scene.rolling != "rubber" or plan.condim < 4:
        return None
    return LimitCheck(
        "torsional friction",
        plan.friction[1],
        float(plan.loads.torsional_friction.max()),
        "the ball spins on the spot; give torsional_friction more",
        "m",
        least=True,
    )


def contact_dimension(plan: PlannedRun) -> LimitCheck | None:
    """Rubber needs the torsional row: with condim 3 the ball is the classical one."""
    if plan.scene.rolling != "rubber":
        return None
    return LimitCheck(
        "condim", plan.condim, 4, "the rubber model needs a torsional row; leave condim None",
        least=True,
    )  # fmt: skip


def drag(plan: PlannedRun) -> LimitCheck | None:
    """Rows that the rolling model has not eat M: dM/dt = -μ m g, with the μ of the row [m].

    Rolling friction with condim 6 in both models, torsional friction in the classical one, which
    may spin. The part that is gone by the end, at most.
    """
    eats = plan.friction[2] if plan.condim >= 6 else 0.0
    if plan.scene.rolling == "classical" and plan.condim >= 4:
        eats += plan.friction[1]
    if not eats:
        return None
    weight = plan.scene.ball.mass * plan.scene.gravity
    return LimitCheck(
        "the part of M that rolling and torsional friction may eat",
        eats * weight * plan.duration / plan.scene.momentum_scale,
        plan.settings.error_tolerance,
        "neither rolling model has that friction; leave condim None",
    )


def frame_as_root(plan: PlannedRun) -> LimitCheck | None:
    """The slip of a model whose root is the frame, over the speed: |a (ω×Ω)×γ|/(b v).

    The contact rows' J̇v term, which MuJoCo leaves out, is a(ω×Ω)×γ when the shell hangs on a
    hinge; friction that takes slip away at the rate b lets so much of it stand. M keeps its value
    all the while: it is measured, not rolled. Measured 0.6 to 3.5 times what is predicted, for the
    start's numbers stand for the whole motion's.
    """
    if plan.settings.root == "shell" or not plan.reduced:
        return None
    left_out = np.cross(plan.angular_velocity, plan.Omega)
    acceleration = plan.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, plan.axes[2])))
    return LimitCheck(
        "the part of the path that a model with the frame as root slips",
        _slip(plan, acceleration),
        plan.settings.error_tolerance,
        'take root="shell"',
    )


def creep(plan: PlannedRun) -> LimitCheck | None:
    """The slip that soft friction needs to carry its load, over the speed; noslip takes it away.

    A row of impedance d gives its force with a deviation of (1 - d)/d of the acceleration α that
    the force makes: divided by impratio in an elliptic cone, times μ² in a pyramidal one, whose
    edges lean that far. So b v = (1 - d)/d α. Measured within 3 % on fig12, and a sixth of it on
    classical_regular, whose force is not always that of the start.
    """
    if plan.noslip or not plan.reduced:
        return None
    softness = (1 - plan.impedance) / plan.impedance
    if plan.cone == "elliptic":
        softness /= plan.impratio
    else:
        softness *= plan.friction[0] ** 2
    force = float(np.linalg.norm(plan.loads.contact_force[:, :2], axis=1).max())
    return LimitCheck(
        "the part of the path that soft friction lets the ball creep",
        _slip(plan, softness * force * inverse_inertia(plan)[0, 0]),
        plan.settings.error_tolerance,
        "give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1",
    )


def _slip(plan: PlannedRun, acceleration: float) -> float:
    """The mean slip over the speed under an acceleration [m/s²] that the friction's damping meets.

    dv/dt = α - b v from rest has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = plan.friction_damping, plan.duration
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > 1e-4 else b * T / 2
    speed = float(np.linalg.norm(plan.rolling_velocity))
    return _ratio(acceleration * (grown / b if b else T / 2), speed)


def friction_block(plan: PlannedRun) -> LimitCheck | None:
    """MuJoCo's PGS and noslip take a contact's friction for singular below 1e-10, in silence.

    Both solve the block of its friction rows in an elliptic cone: D A D, with A the inverse inertia
    that the rows feel and D their coefficients. PGS adds their softness, (1 - d)/d A_nn μ²/impratio
    in every row. With two or three rows the determinant must be 1e-10, with five each pivot of
    Cholesky's. Below that PGS gives no friction, and noslip leaves what slip there is. A goes with
    1/m: the limit is at 2e6 kg on fig12 with μ = 20, at 1e4 kg with μ = 1.4. Measured on five
    settings: right at 0.95 of that mass, and off by the whole path at 1.05; on classical_regular,
    whose A does not stay the start's, right at half of it.
    """
    if plan.cone != "elliptic" or not (plan.noslip or plan.solver == "PGS"):
        return None
    rows = plan.condim - 1
    slide, spin, roll = plan.friction
    scale = np.diag([slide, slide, spin, roll, roll][:rows])
    block = scale @ inverse_inertia(plan)[:rows, :rows] @ scale
    if not plan.noslip:
        softness = plan.settings.softness * (1 - plan.impedance) / plan.impedance
        normal = 1 / plan.scene.ball.mass
        block += softness * normal * slide**2 / plan.impratio * np.eye(rows)
    minors = np.array([np.linalg.det(block[:n, :n]) for n in range(1, rows + 1)])
    value = minors[-1] if rows < 5 else (minors / [1.0, *minors[:-1]]).min()
    name = "noslip" if plan.noslip else "PGS"
    return LimitCheck(
        "the determinant of the friction's inverse inertia"
        if rows < 5
        else "the least pivot of the friction's inverse inertia",
        float(value),
        LEAST_DETERMINANT,
        f"MuJoCo's {name} solver takes it for singular; scale the masses down or the friction up, "
        "or take solver Newton without noslip",
        least=True,
    )


def inverse_inertia(plan: PlannedRun) -> Array:
    """(5, 5): accelerations of slip, spin and roll by unit forces and torques, world axes.

    Of the ball with its hinges held; slip is at the contact, a below the centre.
    """
    ball = plan.scene.ball
    turning = plan.axes @ np.diag(1 / ball.principal[0]) @ plan.axes.T
    x, y, z = np.eye(3)
    arm = np.array([0.0, 0.0, -ball.radius])
    linear = np.array([x, y, *np.zeros((3, 3))])
    angular = np.array([np.cross(arm, x), np.cross(arm, y), z, x, y])
    return linear @ linear.T / ball.mass + angular @ turning @ angular.T


def start_depth(plan: PlannedRun) -> LimitCheck | None:
    """The lever arm's error of a start just touching, over the radius: half of it is in the path.

    The contact carries the weight at the depth p = g (1 - d)/(d² k), into which the ball falls.
    A start in equilibrium has it as the pair's margin, and the lever arm is a.
    """
    if plan.settings.start_in_equilibrium:
        return None
    return LimitCheck(
        "the depth into which the ball falls, over its radius",
        plan.equilibrium_depth / plan.scene.ball.radius,
        2 * plan.settings.error_tolerance,
        "set start_in_equilibrium",
    )


def first_step(plan: PlannedRun) -> LimitCheck | None:
    """The slip that a start just touching begins with, α dt, over the speed that M is worth.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if plan.settings.start_in_equilibrium or not plan.reduced or not np.isfinite(plan.timestep):
        return None
    force = float(np.linalg.norm(plan.loads.contact_force[0, :2]))
    slip = force * float(inverse_inertia(plan)[0, 0]) * plan.timestep
    return LimitCheck(
        "the slip that the first step makes, over the speed",
        slip / (plan.scene.momentum_scale * plan.scene.ball.radius / plan.scene.ball.d),
        plan.settings.error_tolerance,
        "set start_in_equilibrium",
    )


def solver_tolerance(plan: PlannedRun) -> LimitCheck | None:
    """A solver that measures itself by the huge armatures stops before it has begun.

    Newton's stops where the gradient over the sum of the inertias, armatures included, is below the
    tolerance, and without a force yet the gradient is m g d/(1 - d). Measured: right at 2 and
    nothing at 20 times that; CG, which goes by the cost as well, stops a hundred times earlier.
    PGS always takes its first iteration, and that is enough.
    """
    drive = plan.settings.drive
    if not isinstance(drive, Prescribed) or plan.solver == "PGS":
        return None
    prescribed = [each for each in plan.hinges if not each.own_motor]
    d, weight = plan.impedance, plan.scene.ball.mass * plan.scene.gravity
    return LimitCheck(
        "the solver's tolerance times the armatures",
        plan.tolerance * drive.armature * len(prescribed),
        weight * d / (1 - d) / (1 if plan.solver == "Newton" else 100),
        "the solver stops before it has begun: give tolerance 0, or solver PGS",
    )


def largest_number(plan: PlannedRun) -> LimitCheck | None:
    """MuJoCo calls a coordinate, a rate or a control beyond 1e10 bad.

    The path by the speed of the start, the angles that the hinges turn through, and the controls
    of the actuators.
    """
    rates = [abs(hinge.rate) for hinge in plan.scene.hinges]
    speed = float(np.linalg.norm(plan.rolling_velocity))
    controls = [abs(hinge.control(0.0)) for hinge in plan.hinges]
    reach = max(1.0, plan.duration)
    return LimitCheck(
        "the largest coordinate, rate or control",
        max(speed * reach, *(rate * reach for rate in rates), *controls, plan.rotation_rate),
        LARGEST_STATE,
        "MuJoCo takes more for a bad state; choose other units or a shorter run",
    )


def _ratio(part: float, whole: float) -> float:
    if part == 0:
        return 0.0
    return part / whole if whole else np.inf


# Each prediction with its law, as a legend states it.
CONTACT_LAWS: Laws = {
    sliding_friction: "μ is at least |F_horizontal|/N",
    torsional_friction: "μ_t is at least |λ₀|/N for rubber",
    contact_dimension: "rubber needs the torsional row, condim 4",
    drag: "rolling and torsional friction eat M at μ m g",
    frame_as_root: "with the frame as root the ball slips by |a (ω×Ω)×γ|/b",
    creep: "soft friction needs slip to carry its load",
    friction_block: "PGS and noslip skip friction with det(D A D) below 1e-10",
    start_depth: "a start just touching falls into the contact",
    first_step: "the first step of a start just touching slips by α dt",
    solver_tolerance: "beside huge armatures a solver stops before it has begun",
    largest_number: "a coordinate, a rate or a control is 1e10 at most",
}


TOLERATED = 10.0  # s, over which the settings' error tolerance holds
STABLE = 6.3  # DOP853's: the longest step, times the rate at which anything settles
MANY_STEPS = 20_000  # adaptive ones: ten seconds' at least
LOOSEST = 1e-2  # to which a tolerance is stretched over a longer run


def allowed(tolerance: float, times: Array) -> Array:
    """Return the part of an error, growing with time, that is tolerated by each of the times [s].

    A tolerance is for ten seconds; a longer run has more, as long as it stays small.
    """
    stretched = tolerance * np.maximum(1.0, np.asarray(times) / TOLERATED)
    return np.minimum(stretched, max(tolerance, LOOSEST))


def rotation(plan: PlannedRun) -> LimitCheck | None:
    """RK4: r·dt < 2.8, with r the fastest rotation.

    On dy/dt = i r y a step multiplies by R(iθ) = 1 + iθ - θ²/2 - iθ³/6 + θ⁴/24, θ = r dt, and
    |R|² = 1 - θ⁶/72 + θ⁸/576, which is above 1 from θ = √8 on. Beyond, the motion blows up; well
    before it M is lost, which `momentum_lost` tells. Measured with rotors at 30 times their rates,
    over 60 steps: the path is off by 1e-3 at 0.5, by 0.2 at 2.2, and there is none at 3.0; the
    classical ball is off as much, and takes longer to blow up.
    """
    limit = plan.integrator.rotation_limit
    if limit is None:
        return None
    value = plan.rotation_rate * plan.timestep
    most = limit / plan.rotation_rate if plan.rotation_rate else np.inf
    return LimitCheck(
        "the fastest rotation times the timestep",
        value,
        limit,
        f"take a timestep below {most:.2g} s, or the adaptive preset",
        "rad",
    )


def momentum_lost(plan: PlannedRun) -> LimitCheck | None:
    """How much of M a fixed step loses or gains by the end, to first order; with no warning.

    Per step Euler multiplies a rotation by |1 + iθ| = 1 + θ²/2, so that |M| grows as
    exp(r² dt t/2); discrete and implicitfast, which leave the gyroscopic forces explicit, do the
    same; implicit shrinks it as much. RK4's |R(iθ)| = 1 - θ⁶/144. It is what the fastest rotation
    would do with all of M in it: measured 0.05 to 1.7 of it for Euler and implicit, and 0.3 to 2.3
    of it for RK4, on three balls at their rates and at five times them. But a nutation of fast
    rotors may have next to none of M in it. So where this is beyond the limit, RK4 is tried on the
    equations: MuJoCo's loss is 0.05 to 3 times theirs on 100 random balls and the catalog.
    """
    if plan.integrator.momentum_loss is None:
        return None
    if plan.integrator.order == 4 and not plan.scene.keeps_momentum:
        return None  # M changes by itself, and tells nothing
    theta = plan.rotation_rate * plan.timestep
    order, factor = plan.integrator.momentum_loss
    steps = plan.duration / plan.timestep
    limit = float(allowed(plan.settings.error_tolerance, np.array(plan.duration)))
    with np.errstate(over="ignore"):
        value = float(steps * factor * np.float64(theta) ** order)
    if value > limit and plan.integrator.order == 4 and plan.reduced:
        value = min(value, plan.measured_loss)
    shorter = plan.timestep * (limit / value) ** (1 / (order - 1)) if value > 0 else np.inf
    fix = f"take a timestep below {shorter:.2g} s"
    fix += ", or RK4" if plan.integrator.order == 1 else ""
    what = f"the part of M that {plan.integrator.name} may lose or gain"
    return LimitCheck(what, value, limit, fix)


def errors_added(plan: PlannedRun) -> LimitCheck | None:
    """What the errors of steps that are chosen may add up to: rtol times their number.

    Measured: M drifts by 0.005 to 0.2 of it on four scenes, from 1e-12 to 1e-6; from 1e-4 on the
    contact may be lost as well.
    """
    rtol = plan.settings.rtol
    if not plan.settings.adaptive or rtol is None:
        return None
    steps = plan.duration * COST_MODEL.steps_per_second(plan.rotation_rate, rtol)
    return LimitCheck(
        "what the steps' errors may add up to",
        float(rtol * max(steps, 1.0)),
        float(allowed(plan.settings.error_tolerance, np.array(plan.duration))),
        "take a smaller rtol",
    )


def friction_damping(plan: PlannedRun) -> LimitCheck | None:
    """b·dt < 2.785 under RK4, 2 under Euler and the implicit ones: slip dies out as dv/dt = -b v.

    RK4's R(-z) = 1 - z + z²/2 - z³/6 + z⁴/24 is 1 at z = 2.785. Euler and the implicit integrators
    take the contact's force from the start of the step, v → v(1 - b dt). Measured: slip dies out at
    2.75 and grows at 2.82; at 1.95 and 2.05 under the others. Discrete has no such limit.
    """
    limit = plan.integrator.friction_limit
    if limit is None:
        return None
    return LimitCheck(
        "the friction's damping times the timestep",
        plan.friction_damping * plan.timestep,
        limit,
        "give solreffriction a weaker damping, as (-1, -0.5)",
    )


def contact_spring(plan: PlannedRun) -> LimitCheck | None:
    """The contact's spring and damper, ẍ = -k x - b ẋ: a step must not make them grow.

    RK4's |R(s dt)| for the roots s of s² + b s + k; for the others, which take the force first,
    then the velocity, then the position, the spectral radius of
    ((1 - b dt, -k dt), (dt (1 - b dt), 1 - k dt²)). A positive solref is raised to two steps in
    silence, and stays below. Measured with b dt at 2.7 and 2.9 under RK4, at 1.9 and 2.1 under
    Euler and implicit; discrete has no such limit. A start in equilibrium does not wake the
    vibration, and a soft enough damper lets the ball bounce long before.
    """
    if plan.integrator.friction_limit is None:
        return None
    stiffness, damping = plan.normal_reference
    z = plan.timestep * np.roots([1.0, damping, stiffness])
    if plan.integrator.order == 4:
        growth = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max()
    else:
        k, b = stiffness * plan.timestep**2, damping * plan.timestep
        growth = np.abs(np.linalg.eigvals([[1 - b, -k], [1 - b, 1 - k]])).max()
    return LimitCheck(
        "what a step makes of the contact's vibration",
        float(growth),
        1 + 1e-9,
        "take a softer solref, as (0.04, 1), or a shorter timestep",
    )


def raised_solref(plan: PlannedRun) -> LimitCheck | None:
    """A time constant below two steps is raised to them in silence (refsafe).

    So a sweep of the timestep changes the contact as well.
    """
    constant = plan.solref[0]
    if constant <= 0 or not np.isfinite(plan.timestep):
        return None
    return LimitCheck(
        "the contact's time constant",
        constant,
        2 * plan.timestep * (1 - 1e-12),
        f"MuJoCo raises it to two timesteps in silence; give solref {2 * plan.timestep:g} s",
        "s",
        least=True,
    )


def servo_gain(plan: PlannedRun) -> LimitCheck | None:
    """kv·dt/j < 2.785 under RK4, 2 under Euler and discrete, no limit under the implicit ones.

    A velocity servo is a damper, and j the inertia that it feels with the ball rolling: kv/j is its
    `servo_rate`, with springs and position servos the size of a complex one. Measured on both
    models: sound at 2.7 and diverged at 2.9 under RK4, at 1.95 and 2.1 under Euler.
    """
    limit, fastest = plan.integrator.servo_limit, plan.servo_rate
    if limit is None or not fastest:
        return None
    return LimitCheck(
        "the servos' gain times the timestep over their inertia",
        fastest * plan.timestep,
        limit,
        "take a lower gain, a shorter timestep, or prescribe the rate",
    )


def settling(plan: PlannedRun) -> LimitCheck | None:
    """DOP853 is stable up to steps of 6.3/λ, λ the `servo_rate`, whatever their error."""
    fastest = plan.servo_rate
    if not plan.settings.adaptive or not fastest:
        return None
    return LimitCheck(
        "the number of steps that the servos' rate takes",
        fastest * plan.duration / STABLE,
        MANY_STEPS,
        "take a lower gain, more armature, or prescribe the rate, or wait for minutes",
    )


# Each prediction with its law, as a legend tells it.
STEP_LAWS: Laws = {
    rotation: "RK4 follows a rotation r up to r·dt = 2.8",
    momentum_lost: "a fixed step loses or gains a part of M",
    errors_added: "errors of chosen steps add up to rtol times their number",
    friction_damping: "b·dt is 2.785 at most under RK4, 2 under Euler and the implicit ones",
    contact_spring: "a step must not make the contact's vibration grow",
    raised_solref: "a time constant below two steps is raised to them",
    settling: "a servo that settles at λ takes adaptive steps of 6.3/λ at most",
    servo_gain: "kv·dt/j is 2.785 at most under RK4, 2 under Euler and discrete",
}


MAGNIFIED = 10.0  # times a relative error of a rate: what it may well make of the path, relative


def servo_droop(plan: PlannedRun) -> LimitCheck | None:
    """A velocity servo gives torque only for an error of its rate: τ/kv, relative to the rate.

    Measured 0.75 to 0.99 of that, where it is small.
    """
    servos = [(h, h.actuation) for h in plan.hinges if isinstance(h.actuation, Servo)]
    if not servos:
        return None
    worst = 0.0
    for hinge, servo in servos:
        torque = float(np.abs(plan.loads.motor_torques[:, hinge.index]).max())
        if not hinge.own_motor and hinge.of.rate:  # else its error belongs to the motion
            worst = max(worst, torque / servo.gain / abs(hinge.of.rate))
    return LimitCheck(
        "the share of its rate that a servo loses under its load",
        worst,
        plan.settings.error_tolerance,
        "take a higher gain, or prescribe the rate",
    )


def prescribed_rate(plan: PlannedRun) -> LimitCheck | None:
    """A hinge kept by its armature gives way to its load all the same: by ∫τ dt/armature.

    Measured to three digits on six scenes with masses of 1e5 and 1e6 times their own. The path is
    off by 0.1 to 40 times as much, relative. Where only the start's loads are known, they are taken
    to act for a radian of the fastest rotation.
    """
    torques, worst = plan.loads.motor_torques, 0.0
    if plan.known_loads is not None:
        impulses = np.abs(np.cumsum(torques, axis=0)).max(axis=0) * plan.duration / len(torques)
    else:
        rate = plan.rotation_rate
        impulses = np.abs(torques[0]) * (min(plan.duration, 1 / rate) if rate else plan.duration)
    for hinge in plan.hinges:
        if isinstance(hinge.actuation, Prescribed):
            lost = float(impulses[hinge.index]) / hinge.actuation.armature / hinge.largest_rate
            worst = max(worst, lost)
    return LimitCheck(
        "the share of its rate that a prescribed hinge loses under its load",
        worst,
        plan.settings.error_tolerance / MAGNIFIED,
        "the hinges' armature is too small for such heavy bodies; take a larger one",
    )


# Each prediction with its law, as a legend states it.
HINGE_LAWS: Laws = {
    prescribed_rate: "a prescribed hinge gives way by ∫τ dt over its armature",
    servo_droop: "a velocity servo loses τ/kv of its rate",
}


LAWS = STEP_LAWS | CONTACT_LAWS | HINGE_LAWS


def limit_checks(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[LimitCheck, ...]:
    """Return every limit that the settings have on this scene, exceeded or not.

    times: (n,) s, the run's; loads: of the whole motion by the equations, if known already, in
    place of the start's.
    """
    plan = PlannedRun(scene, settings, float(times[-1]), loads)
    with np.errstate(all="ignore"):
        found = (predict(plan) for predict in LAWS)
        return tuple(check for check in found if check is not None)


def exceeded(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[LimitCheck, ...]:
    """Return the limits that a run is predicted to exceed; arguments as for `limit_checks`."""
    return tuple(each for each in limit_checks(scene, settings, times, loads) if each.exceeded)


def precheck(
    scene: Scene,
    settings: Settings,
    times: Array,
    loads: Loads | None = None,
    *,
    strict: bool = False,
) -> None:
    """Warn, a line each, of the limits that the run exceeds; raise InputError if strict."""
    for each in exceeded(scene, settings, times, loads):
        line = f"{scene.name}, {settings.name}: {each}"
        if strict:
            raise InputError(line)
        warn(line)


def check_length(scene: Scene, settings: Settings, times: Array) -> None:
    """Raise InputError for a run of more steps than the settings allow.

    Steps that are chosen by their error are counted as they are taken instead, but for the least
    that the servos take.
    """
    if settings.adaptive and settings.timestep is None:
        least = settling(PlannedRun(scene, settings, float(times[-1])))
        if least is not None and least.value > settings.max_steps:
            raise InputError(
                f"{scene.name} over {times[-1]:g} s: {least}; max_steps = {settings.max_steps}"
            )
        return
    timestep = PlannedRun(scene, settings, float(times[-1])).timestep
    steps = step_count(times, scene.breakpoints, timestep)
    if steps > settings.max_steps:
        size = f"{steps:.0f}" if steps < 1e15 else f"{steps:.2g}"
        raise InputError(
            f"{scene.name} over {times[-1]:g} s takes {size} steps of {timestep:g} s, more than "
            f"max_steps = {settings.max_steps}: shorten the run, lengthen the timestep, or raise it"
        )
    assert math.isfinite(steps)
