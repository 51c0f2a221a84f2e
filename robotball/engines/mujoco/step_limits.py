"""Edges of the time step: what each integrator does with rotations, springs, dampers and servos."""

import numpy as np

from robotball.engines.mujoco.cost_model import FRONT
from robotball.engines.mujoco.planned_run import Case, Edge
from robotball.engines.mujoco.settings import ADAPTIVE
from robotball.rotations import Array

RK4_IMAGINARY, RK4_REAL = 2.828, 2.785  # where |R(z)| = 1 on the axes
EXPLICIT_REAL = 2.0  # |1 - z| = 1
IMPLICIT, DISCRETE = ("implicit", "implicitfast"), "discrete"
PROMISED = 10.0  # s, over which the settings' promise holds
RIGID = 1e6  # times the ball's inertia: as good as not turning at all
LOOSEST = 1e-2  # to which a promise is stretched over a longer run


def allowed(promise: float, times: Array) -> Array:
    """What of an error that grows with time may have come up by each of the times [s].

    A promise is for ten seconds; a longer run has more, as long as it stays small.
    """
    stretched = promise * np.maximum(1.0, np.asarray(times) / PROMISED)
    return np.minimum(stretched, max(promise, LOOSEST))


def rotation(case: Case) -> Edge | None:
    """RK4: r·dt < 2.8, with r the fastest rotation.

    On dy/dt = i r y a step multiplies by R(iθ) = 1 + iθ - θ²/2 - iθ³/6 + θ⁴/24, θ = r dt, and
    |R|² = 1 - θ⁶/72 + θ⁸/576, which is above 1 from θ = √8 on. Beyond, the motion blows up; well
    before it M is lost, which `momentum_lost` tells. Measured with rotors at 30 times their rates,
    over 60 steps: the path is off by 1e-3 at 0.5, by 0.2 at 2.2, and there is none at 3.0; the
    classical ball is off as much, and takes longer to blow up.
    """
    if case.integrator != "RK4":
        return None
    value = case.rotation_rate * case.timestep
    most = RK4_IMAGINARY / case.rotation_rate if case.rotation_rate else np.inf
    return Edge(
        "the fastest rotation times the timestep",
        value,
        RK4_IMAGINARY,
        f"take a timestep below {most:.2g} s, or the adaptive preset",
        "rad",
    )


def momentum_lost(case: Case) -> Edge | None:
    """How much of M a fixed step loses or gains by the end, to first order; silently.

    Per step Euler multiplies a rotation by |1 + iθ| = 1 + θ²/2, so that |M| grows as
    exp(r² dt t/2); discrete and implicitfast, which leave the gyroscopic forces explicit, do the
    same; implicit shrinks it as much. RK4's |R(iθ)| = 1 - θ⁶/144. It is what the fastest rotation
    would do with all of M in it: measured 0.05 to 1.7 of it for Euler and implicit, and 0.3 to 2.3
    of it for RK4, on three balls at their rates and at five times them.
    """
    if case.integrator == ADAPTIVE:
        return None
    theta = case.rotation_rate * case.timestep
    order, factor = (6, 1 / 144) if case.integrator == "RK4" else (2, 1 / 2)
    steps = case.duration / case.timestep
    limit = float(allowed(case.settings.promise, np.array(case.duration)))
    with np.errstate(over="ignore"):
        value = float(steps * factor * np.float64(theta) ** order)
    shorter = case.timestep * (limit / value) ** (1 / (order - 1)) if value > 0 else np.inf
    fix = f"take a timestep below {shorter:.2g} s"
    fix += "" if case.integrator == "RK4" else ", or RK4"
    return Edge(f"the part of M that {case.integrator} may lose or gain", value, limit, fix)


def errors_added(case: Case) -> Edge | None:
    """What the errors of steps that are chosen may add up to: rtol times their number.

    Measured: M drifts by 0.005 to 0.2 of it on four scenes, from 1e-12 to 1e-6; from 1e-4 on the
    contact may be lost as well.
    """
    if case.integrator != ADAPTIVE:
        return None
    rtol = case.settings.rtol
    assert rtol is not None
    steps = case.duration * FRONT.steps_per_second(case.rotation_rate, rtol)
    return Edge(
        "what the steps' errors may add up to",
        float(rtol * max(steps, 1.0)),
        float(allowed(case.settings.promise, np.array(case.duration))),
        "take a smaller rtol",
    )


def friction_damping(case: Case) -> Edge | None:
    """b·dt < 2.785 under RK4, 2 under Euler and the implicit ones: slip dies out as dv/dt = -b v.

    RK4's R(-z) = 1 - z + z²/2 - z³/6 + z⁴/24 is 1 at z = 2.785. Euler and the implicit integrators
    take the contact's force from the start of the step, v → v(1 - b dt). Measured: slip dies out at
    2.75 and grows at 2.82; at 1.95 and 2.05 under the others. Discrete has no such limit.
    """
    if case.integrator in (ADAPTIVE, DISCRETE):
        return None
    limit = RK4_REAL if case.integrator == "RK4" else EXPLICIT_REAL
    return Edge(
        "the friction's damping times the timestep",
        case.friction_damping * case.timestep,
        limit,
        "give solreffriction a weaker damping, as (-1, -0.5)",
    )


def contact_spring(case: Case) -> Edge | None:
    """The contact's spring and damper, ẍ = -k x - b ẋ: a step must not make them grow.

    RK4's |R(s dt)| for the roots s of s² + b s + k; for the others, which take the force first,
    then the velocity, then the position, the spectral radius of
    ((1 - b dt, -k dt), (dt (1 - b dt), 1 - k dt²)). A positive solref is raised to two steps in
    silence, and stays below. Measured with b dt at 2.7 and 2.9 under RK4, at 1.9 and 2.1 under
    Euler and implicit; discrete has no such limit. A start in equilibrium does not wake the
    vibration, and a soft enough damper lets the ball bounce long before.
    """
    if case.integrator in (ADAPTIVE, DISCRETE):
        return None
    stiffness, damping = case.normal_reference
    z = case.timestep * np.roots([1.0, damping, stiffness])
    if case.integrator == "RK4":
        growth = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max()
    else:
        k, b = stiffness * case.timestep**2, damping * case.timestep
        growth = np.abs(np.linalg.eigvals([[1 - b, -k], [1 - b, 1 - k]])).max()
    return Edge(
        "what a step makes of the contact's vibration",
        float(growth),
        1 + 1e-9,
        "take a softer solref, as (0.04, 1), or a shorter timestep",
    )


def raised_solref(case: Case) -> Edge | None:
    """A time constant below two steps is raised to them in silence (refsafe).

    So a sweep of the timestep changes the contact as well.
    """
    constant = case.solref[0]
    if constant <= 0 or not np.isfinite(case.timestep):
        return None
    return Edge(
        "the contact's time constant",
        constant,
        2 * case.timestep * (1 - 1e-12),
        f"MuJoCo raises it to two timesteps in silence; give solref {2 * case.timestep:g} s",
        "s",
        least=True,
    )


def servo_gain(case: Case) -> Edge | None:
    """kv·dt/j < 2.785 under RK4, 2 under Euler and discrete, no limit under the implicit ones.

    A velocity servo is a damper: H dv/dt = -diag(kv) (v - rate) for the turning v of the shell and
    the hinges, on which H is the inertia of the ball that rolls as it starts. kv/j is the largest
    eigenvalue of H⁻¹ diag(kv); hinges whose rates are prescribed have no part in it. Measured on
    both models: sound at 2.7 and diverged at 2.9 under RK4, at 1.95 and 2.1 under Euler.
    """
    if case.integrator in (*IMPLICIT, ADAPTIVE) or not case.servos:
        return None
    gains = np.diag([0.0, 0.0, 0.0, *(servo.gain for _, servo in case.servos)])
    inertia = _inertia_of_turning(case, [index for index, _ in case.servos])
    fastest = float(np.abs(np.linalg.eigvals(np.linalg.solve(inertia, gains))).max())
    return Edge(
        "the servos' gain times the timestep over their inertia",
        fastest * case.timestep,
        RK4_REAL if case.integrator == "RK4" else EXPLICIT_REAL,
        "take a lower gain, a shorter timestep, or prescribe the rate",
    )


def _inertia_of_turning(case: Case, hinges: list[int]) -> Array:
    """H (3 + n, 3 + n) of the shell's ω and the rates of n hinges, frame axes [kg m²]."""
    ball = case.scene.ball
    gamma = case.scene.principal_axes @ case.axes[2]
    inertia = np.zeros((3 + len(hinges), 3 + len(hinges)))
    rolling = ball.d * (np.eye(3) - np.outer(gamma, gamma))
    inertia[:3, :3] = ball.inertia + rolling
    if case.scene.rolling == "rubber":  # it may not spin
        inertia[:3, :3] += RIGID * np.trace(ball.inertia + rolling) * np.outer(gamma, gamma)
    for row, index in enumerate(hinges, start=3):
        if index:
            rotor = ball.rotors[index - 1]
            coupling, own = rotor.axial_inertia * rotor.axis, rotor.axial_inertia
        else:  # the frame takes the rotors with it
            carried = ball.inertia - ball.shell.inertia
            coupling = carried @ ball.shell.axis
            own = float(ball.shell.axis @ coupling)
        inertia[:3, row] = inertia[row, :3] = coupling
        inertia[row, row] = own
    if hinges and hinges[0] == 0:
        for row, index in enumerate(hinges[1:], start=4):
            rotor = ball.rotors[index - 1]
            inertia[3, row] = inertia[row, 3] = rotor.axial_inertia * (rotor.axis @ ball.shell.axis)
    return inertia


EDGES = (
    rotation, momentum_lost, errors_added, friction_damping, contact_spring, raised_solref,
    servo_gain,
)  # fmt: skip
