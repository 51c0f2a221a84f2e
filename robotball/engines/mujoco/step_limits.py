"""Limits of the time step: what an integrator does with rotations, springs, dampers, servos."""

import numpy as np

from robotball.engines.mujoco.cost_model import COST_MODEL
from robotball.engines.mujoco.momentum_loss import measured_loss
from robotball.engines.mujoco.planned_run import Laws, LimitCheck, PlannedRun
from robotball.engines.mujoco.servo_rates import fastest_rate
from robotball.rotations import Array

TOLERATED = 10.0  # s, over which the settings' error tolerance holds
STABLE = 6.3  # DOP853's: the longest step, times the rate at which anything settles
MANY_STEPS = 20_000  # adaptive ones: ten seconds' at least
LOOSEST = 1e-2  # to which a tolerance is stretched over a longer run


def allowed(tolerance: float, times: Array) -> Array:
    """What of an error that grows with time may have come up by each of the times [s].

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
        value = min(value, measured_loss(plan))
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
    `fastest_rate`, with springs and position servos the size of a complex one. Measured on both
    models: sound at 2.7 and diverged at 2.9 under RK4, at 1.95 and 2.1 under Euler.
    """
    limit, fastest = plan.integrator.servo_limit, fastest_rate(plan.scene, plan.hinges)
    if limit is None or not fastest:
        return None
    return LimitCheck(
        "the servos' gain times the timestep over their inertia",
        fastest * plan.timestep,
        limit,
        "take a lower gain, a shorter timestep, or prescribe the rate",
    )


def settling(plan: PlannedRun) -> LimitCheck | None:
    """DOP853 is stable up to steps of 6.3/λ, λ the servos' `fastest_rate`, whatever their error."""
    fastest = fastest_rate(plan.scene, plan.hinges)
    if not plan.settings.adaptive or not fastest:
        return None
    return LimitCheck(
        "the number of steps that the servos' rate takes",
        fastest * plan.duration / STABLE,
        MANY_STEPS,
        "take a lower gain, more armature, or prescribe the rate, or wait for minutes",
    )


# Each prediction with its law, as a legend tells it.
LAWS: Laws = {
    rotation: "RK4 follows a rotation r up to r·dt = 2.8",
    momentum_lost: "a fixed step loses or gains a part of M",
    errors_added: "errors of chosen steps add up to rtol times their number",
    friction_damping: "b·dt is 2.785 at most under RK4, 2 under Euler and the implicit ones",
    contact_spring: "a step must not make the contact's vibration grow",
    raised_solref: "a time constant below two steps is raised to them",
    settling: "a servo that settles at λ takes adaptive steps of 6.3/λ at most",
    servo_gain: "kv·dt/j is 2.785 at most under RK4, 2 under Euler and discrete",
}
