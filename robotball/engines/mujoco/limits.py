"""Laws that predict the limits of a run before its first step.

A law is a function of a planned run. The first line of its docstring is printed in docs/extremes.md
and in the legends of `robotball study extremes`; the rest has the derivation and the measured
accuracy. It returns the number of the run, its limit and the warning, or None if it does not apply.

The laws here apply to every run; `special_limits` has the laws that only some runs need.

The numbers follow from the paper's equations if these describe the scene. Otherwise, or if a law is
too coarse, they are measured in short trials.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball.engines.mujoco.model import ModelHinge, hinges_of
from robotball.engines.mujoco.settings import ORDER_8, Prescribed, Resolved
from robotball.errors import InputError, percent
from robotball.motion import ReferenceMotion, tolerated
from robotball.robot import formulas as eq
from robotball.robot.formulas import as_vector
from robotball.robot.loads import Loads, loads_of
from robotball.robot.motors import Servo
from robotball.rotations import Array, multiply, rotation_matrix, uneven

# Times over the run at which changing drives are evaluated. Limits are predicted to a factor, so
# the largest rate between these times need not be found.
_DRIVE_TIMES = 9
# Samples and largest number of steps of the integration that gives a whole motion's loads: a second
# of time.
_LOAD_TIMES, _REFERENCE_STEPS = 1001, 5_000
_LARGEST_STATE = 1e10  # mjMAXVAL: a larger position, velocity or control is a bad state to MuJoCo
_LEAST_DETERMINANT = 1e-10  # below it MuJoCo takes a contact's friction block for singular
# A ball that slips loads the plane exactly at its limit, but for rounding.
_AT_LIMIT = 1 + 1e-9
# Steps of order 8: the largest rotation [rad], and a servo's largest rate times the step, each over
# the eighth root of the tolerance, and their largest values. They are stable up to 5.96 and 6.39;
# fast rotors need the first: in 50 turns the path is off by a quarter at 2.1 rad, and by up to 0.6
# at 1.2 rad.
_TURNED, _MOST_TURNED, _SETTLED, _MOST_SETTLED = 3.75, 0.8, 30.0, 4.0
_PLANAR = 1e-3  # largest ω across the axis of a planar motion; the square is the change of M
_MAGNIFIED = 10.0  # path error over a rate's relative error; 0.1 to 40 were measured


@dataclass(frozen=True)
class LimitCheck:
    """A number of a planned run, and the limit beyond which the run is predicted to fail.

    Attributes
    ----------
    value, limit : float
        The number and its limit.
    warning : str
        What happens beyond the limit, and the remedy.
    least : bool
        True if the number must be at least the limit, False if at most.
    """

    value: float
    limit: float
    warning: str
    least: bool = False

    @property
    def nearness(self) -> float:
        """The used part of the limit: 1 at the limit, more beyond it."""
        over, under = (self.limit, self.value) if self.least else (self.value, self.limit)
        # A number that cannot be computed counts as beyond its limit.
        if np.isnan(over) or np.isnan(under):
            return np.inf
        if under == 0:
            return np.inf if over > 0 else 0.0
        return float(over) / float(under)

    @property
    def exceeded(self) -> bool:
        """True if the run is predicted to fail."""
        return self.nearness > 1


def error_check(value: float, limit: float, effect: str, remedy: str) -> LimitCheck:
    """Return the check of a predicted relative error."""
    allowed = f"only {percent(limit)} is allowed"
    return LimitCheck(value, limit, f"{effect} by about {percent(value)}; {allowed}: {remedy}")


@dataclass(frozen=True)
class PlannedRun(Resolved):
    """A scene under settings over a duration, with the numbers that laws need.

    Attributes
    ----------
    duration : float, s
        The duration of the run.
    known_loads : Loads or None
        The loads of the whole motion. None if only those of the start are known.
    """

    duration: float
    known_loads: Loads | None = None

    @property
    def reduced(self) -> bool:
        """True if (3.2) or (3.3) describes the motion, apart from the errors of servos.

        Otherwise the numbers are measured on MuJoCo's model at the start.
        """
        scene = self.scene
        prescribed = all(isinstance(hinge.motor, Servo | None) for hinge in scene.hinges)
        rolls = scene.keeps_momentum and not scene.may_slip
        return rolls and prescribed and not scene.ball.pendulums

    @property
    def plain(self) -> bool:
        """True if no law of `special_limits` applies."""
        scene, settings = self.scene, self.settings
        if settings.slips or scene.load_varies or not scene.steady:
            return False
        if scene.plane_turns or settings.condim or settings.root == "frame":
            return False
        if not settings.start_in_equilibrium:
            return False
        prescribed = (isinstance(hinge.actuation, Prescribed) for hinge in self.hinges)
        return bool(self.option("noslip_iterations")) and all(prescribed)

    @cached_property
    def timestep(self) -> float:
        """The longest step [s]; with order 8 it is shorter for fast rotations and servos."""
        if self.settings.integrator != ORDER_8:
            return super().timestep
        part = self.settings.error_tolerance ** (1 / 8)
        turned, settled = min(_TURNED * part, _MOST_TURNED), min(_SETTLED * part, _MOST_SETTLED)
        rate = max(self.rotation_rate / turned, self.servo_rate / settled)
        return min(super().timestep, 1 / rate if rate else np.inf)

    @cached_property
    def hinges(self) -> tuple[ModelHinge, ...]:
        """The hinges of the model."""
        return hinges_of(self.scene, self.settings)

    @cached_property
    def start_trial(self) -> tuple[Loads, Array]:
        """The loads and the eigenvalues of MuJoCo's model at the start."""
        from robotball.engines.mujoco.linearised import linearised_start

        return linearised_start(self.scene, self.settings)

    @cached_property
    def servo_rate(self) -> float:
        """The largest |λ| [1/s] of the motors; 0 if no motor settles."""
        if not any(hinge.settles for hinge in self.hinges):
            return 0.0
        from robotball.engines.mujoco.motor_rates import fastest_rate

        return fastest_rate(self.scene, self.hinges, self.settings.slips)

    @cached_property
    def axes(self) -> Array:
        """The rotation (3, 3) from principal axes to world at the start."""
        return rotation_matrix(multiply(self.scene.start.attitude, self.scene.principal_quaternion))

    @cached_property
    def angular_velocity(self) -> Array:
        """ω (3,) at the start, principal axes [rad/s]."""
        return self.scene.principal_axes.T @ self.scene.angular_velocity_at(self.scene.start)

    @property
    def Omega(self) -> Array:
        """Ω (3,) of the frame in the shell at the start, principal axes [rad/s]."""
        if not self.scene.ball.has_frame:
            return np.zeros(3)
        frame = self.scene.hinges[0]
        return self.scene.principal_axes.T @ (frame.rate * self.scene.ball.shell.axis)

    @cached_property
    def loads(self) -> Loads:
        """The known loads of the whole motion, else those of the start."""
        if self.known_loads is not None:
            return self.known_loads
        if not self.reduced:
            return self.start_trial[0]
        return loads_of(self.scene, np.zeros(1), self.axes[None], self.angular_velocity[None])

    @cached_property
    def whole_loads(self) -> Loads:
        """The loads of the whole motion, integrated if unknown.

        Those of the start if the integration takes too many steps or there is no such motion.
        """
        if self.known_loads is not None or self.whole_motion is None:
            return self.loads
        return self.whole_motion.loads

    @cached_property
    def whole_motion(self) -> ReferenceMotion | None:
        """The motion by the equations; None if it takes too many steps, or there is none."""
        from robotball.engines.equations import integrate  # few runs need it

        times = np.linspace(0.0, self.duration, _LOAD_TIMES)
        with suppress(InputError):
            if self.scene.controller is None:
                return integrate(self.scene, times, rtol=1e-8, max_steps=_REFERENCE_STEPS)
        return None

    @property
    def planar(self) -> bool:
        """True if the ball turns about one fixed axis, by the equations. Then M does not turn."""
        if (motion := self.whole_motion) is None or motion.ended:
            return False
        world = rotation_matrix(motion.attitude) @ motion.angular_velocity[:, :, None]
        first, second, _ = np.linalg.svd(world[:, :, 0], compute_uv=False)
        return bool(second < _PLANAR * first)

    @cached_property
    def rolling_velocity(self) -> Array:
        """The velocity (3,) of the ball's centre at the start, principal axes [m/s]."""
        turning = self.angular_velocity - self.Omega
        return self.scene.ball.radius * np.cross(turning, self.axes[2])

    @cached_property
    def rotation_rate(self) -> float:
        """The fastest rotation that an integrator must follow [rad/s].

        It is the largest of |ω|, with which all vectors turn in the frame, and of the eigenvalues
        of ∂(dω/dt)/∂ω from (2.4), (2.5). These are the nutation, of about |A K| with fast rotors.
        The rates of the rotors do not count, because their hinges turn evenly. It is evaluated at
        the attitude of the start, at several times if the drives change.
        """
        if not self.reduced:
            driven = [h for h in self.hinges if h.index == 0 and h.actuation.follows_rate]
            frame = [self.scene.largest_rates[h.index] for h in driven]
            size = float(np.linalg.norm(self.angular_velocity))
            turning = float(np.abs(self.scene.plane_turn.rate(0.0)))
            return max(size, turning, *frame, float(np.abs(self.start_trial[1].imag).max()))
        times = [0.0] if self.scene.steady else uneven(self.duration, self.duration / _DRIVE_TIMES)
        return max(self._rotation_rate_at(float(t)) for t in times)

    def _rotation_rate_at(self, t: float) -> float:
        """Return the fastest rotation with the drives at t [s]."""
        parameters, gamma = self.scene.parameters_at(t), as_vector(self.axes[2])
        M = as_vector(self.axes.T @ self.scene.start.momentum)
        omega = np.array(parameters.angular_velocity(M, gamma))

        def acceleration(omega: Array) -> Array:
            rate, _ = eq.full_angular_acceleration(
                as_vector(omega), gamma, parameters.Omega, (0.0, 0.0, 0.0), parameters.k,
                (0.0, 0.0, 0.0), parameters.I, parameters.d, self.scene.rolling == "rubber",
            )  # fmt: skip
            return np.array(rate)

        size = float(np.linalg.norm(omega))
        step = size or 1.0  # any: the acceleration is quadratic in ω
        sides = [
            (acceleration(omega + step * e) - acceleration(omega - step * e)) / (2 * step)
            for e in np.eye(3)
        ]
        if not np.all(np.isfinite(sides)):
            return np.inf
        return max(float(np.abs(np.linalg.eigvals(np.array(sides))).max()), size)

    @property
    def tolerance(self) -> float:
        """The momentum error that is tolerated at the end."""
        return float(tolerated(self.settings.error_tolerance, np.array(self.duration)))


Law = Callable[[PlannedRun], LimitCheck | None]


def rotation(plan: PlannedRun) -> LimitCheck | None:
    """Require r·dt < 2.8 for RK4, with the rate r of the fastest rotation.

    On dy/dt = i r y a step multiplies by R(iθ) = 1 + iθ - θ²/2 - iθ³/6 + θ⁴/24, θ = r dt, and
    |R|² = 1 - θ⁶/72 + θ⁸/576 exceeds 1 from θ = √8 on. Beyond, the motion diverges; well before, M
    is lost, which `momentum_lost` predicts. Measured with rotors at 30 times their rates, over 60
    steps: path error 1e-3 at 0.5, 0.2 at 2.2, and divergence at 3.0. The classical ball has the
    same errors and takes longer to diverge.
    """
    limit = plan.integrator.rotation_limit
    if limit is None:
        return None
    rate = plan.rotation_rate
    value, step = rate * plan.timestep, limit / rate if rate else np.inf
    warning = (
        f"the fastest body turns {value:.4g} rad per step, but {plan.integrator.name} is stable "
        f"only up to {limit:.4g} rad: take a timestep below {step:.2g} s, or the preset exact"
    )
    return LimitCheck(value, limit, warning)


def momentum_lost(plan: PlannedRun) -> LimitCheck | None:
    """Predict the relative change of M, which is proportional to (r·dt)ᵖ in every step.

    MuJoCo gives no warning of it. Per step Euler multiplies a rotation by |1 + iθ| = 1 + θ²/2, so
    |M| grows as exp(r² dt t/2). Discrete and implicitfast leave the gyroscopic forces explicit and
    do the same; implicit shrinks |M| as much. RK4 has |R(iθ)| = 1 - θ⁶/144, RK8 1 - 2.4e-8 θ¹⁰. The
    prediction assumes that all of M is in the fastest rotation. Measured over predicted on three
    balls, at their rates and at five times them: 0.05 to 1.7 for Euler and implicit, and 0.3 to 2.3
    for RK4. A nutation of fast rotors may have hardly any of M, so a trial measures the loss if
    this formula exceeds the limit. The trial is within 5 % of the run. In a planar motion ω × M is
    zero, so the law does not apply: measured 1e-3 of this formula.
    """
    if plan.integrator.order > 1 and not plan.scene.keeps_momentum:
        return None  # M changes anyway, so its change shows no error
    theta = plan.rotation_rate * plan.timestep
    order, factor = plan.integrator.momentum_loss
    steps, limit = plan.duration / plan.timestep, plan.tolerance
    with np.errstate(over="ignore"):
        value = float(steps * factor * np.float64(theta) ** order)
    if value > limit and not plan.reduced and plan.planar:
        return None
    if value > limit and plan.integrator.order > 1 and plan.reduced:
        from robotball.engines.mujoco.linearised import momentum_loss  # it takes some 60 ms

        steps_of = plan.integrator.name, plan.timestep
        value = min(value, momentum_loss(plan.scene, *steps_of, plan.duration))
    step = plan.timestep * (limit / value) ** (1 / (order - 1)) if value > 0 else np.inf
    remedy = f"take a timestep below {step:.2g} s, or an integrator of higher order"
    return error_check(value, limit, f"{plan.integrator.name} will change M", remedy)


def friction_damping(plan: PlannedRun) -> LimitCheck | None:
    """Require b·dt < 2.785 for RK4, and b·dt < 2 for Euler and the implicit integrators.

    Slip follows dv/dt = -b v. RK4's R(-z) = 1 - z + z²/2 - z³/6 + z⁴/24 is 1 at z = 2.785. Euler
    and the implicit integrators use the contact force at the start of the step, v → v(1 - b dt).
    Measured with RK4: slip dies out at 2.75 and grows at 2.82; with the others 1.95 and 2.05.
    Discrete has no such limit.
    """
    limit = plan.integrator.friction_limit
    if limit is None:
        return None
    value = plan.friction_damping * plan.timestep
    warning = (
        f"slip will grow: the friction's damping times the timestep is {value:.4g}, but "
        f"{plan.integrator.name} is stable only up to {limit:.4g}: give solreffriction a weaker "
        "damping, such as (-1, -0.5)"
    )
    return LimitCheck(value, limit, warning)


def contact_spring(plan: PlannedRun) -> LimitCheck | None:
    """Require that a step does not magnify the contact's vibration ẍ = -k x - b ẋ.

    For RK4 and RK8 it is |R(s dt)| with the roots s of s² + b s + k. The others take the force
    first, then the velocity, then the position; for them it is the spectral radius of
    ((1 - b dt, -k dt), (dt (1 - b dt), 1 - k dt²)). MuJoCo raises a positive solref to two steps,
    which is below the limit. Measured with b dt at 2.7 and 2.9 for RK4, at 1.9 and 2.1 for Euler
    and implicit. Discrete has no such limit. A start in equilibrium does not excite the vibration,
    and a damper that is soft enough lets the ball bounce long before.
    """
    if plan.integrator.friction_limit is None:
        return None
    # An impedance of d gives the contact the part d of the acceleration that its spring asks for.
    d = plan.impedance
    stiffness, damping = d * d * plan.normal_reference[0], d * plan.normal_reference[1]
    z = plan.timestep * np.roots([1.0, damping, stiffness])
    if plan.integrator.stability:
        growth = np.abs(np.polyval(plan.integrator.stability, z)).max()
    else:
        k, b = stiffness * plan.timestep**2, damping * plan.timestep
        growth = np.abs(np.linalg.eigvals([[1 - b, -k], [1 - b, 1 - k]])).max()
    value = float(growth)
    # Rounding must not turn a vibration of constant size into a fault.
    warning = (
        f"the contact's vibration will grow by a factor of {value:.4g} per step: take a softer "
        "solref, such as (0.04, 1), or a shorter timestep"
    )
    return LimitCheck(value, 1 + 1e-9, warning)


def raised_solref(plan: PlannedRun) -> LimitCheck | None:
    """Require a contact time constant of at least 2 dt; MuJoCo silently raises a smaller one.

    MuJoCo's flag refsafe does so, and a sweep of the timestep would change the contact as well.
    """
    constant = plan.solref[0]
    if constant <= 0:
        return None
    # A constant of exactly two steps, as advised, must pass.
    limit = 2 * plan.model_timestep * (1 - 1e-12)
    warning = (
        f"MuJoCo will raise the contact's time constant from {constant:.4g} s to two timesteps "
        f"without a warning: give solref {limit:.4g} s"
    )
    return LimitCheck(constant, limit, warning, least=True)


def sliding_friction(plan: PlannedRun) -> LimitCheck | None:
    """Require μ ≥ |F|/N, with the horizontal force F that rolling needs, from (2.4).

    If only the loads of the start are known, a demand that grows later is not predicted.
    """
    value, limit = plan.friction[0], plan.loads.sliding_friction.max()
    warning = (
        f"the ball will slip: sliding friction is {value:.4g}, but the motion needs {limit:.4g}: "
        "raise sliding_friction"
    )
    if plan.settings.slips:
        return None
    if plan.scene.friction.sliding is not None:
        warning, limit = _slipping("sliding", value), limit * _AT_LIMIT
    return LimitCheck(value, limit, warning, least=True)


def _slipping(kind: str, value: float) -> str:
    """Return the warning of a ball that slips because the scene limits its friction."""
    return (
        f"the ball slips, because friction.{kind} is {value:.4g}, and the contact of these "
        "settings does not obey Coulomb's law: take a preset such as balanced without other "
        f"values of the contact, or raise friction.{kind}"
    )


def torsional_friction(plan: PlannedRun) -> LimitCheck | None:
    """Require μ_t ≥ |λ₀|/N for rubber rolling, with the torque λ₀ that prevents spin.

    With less the ball spins under drag, and does not roll as rubber does.
    """
    if plan.scene.rolling != "rubber" or plan.condim < 4 or plan.settings.slips:
        return None
    value, limit = plan.friction[1], plan.loads.torsional_friction.max()
    warning = (
        f"the ball will spin on the spot: torsional friction is {value:.4g} m, but the motion "
        f"needs {limit:.4g} m: raise torsional_friction"
    )
    if plan.scene.friction.torsional is not None:
        warning, limit = _slipping("torsional", value), limit * _AT_LIMIT
    return LimitCheck(value, limit, warning, least=True)


def friction_block(plan: PlannedRun) -> LimitCheck | None:
    """Require det(D A D) ≥ 1e-10; below this limit PGS and noslip silently omit friction.

    Both solve the block of the friction rows in an elliptic cone: D A D, with A the inverse inertia
    that the rows feel and D their coefficients. PGS adds their softness, (1 - d)/d A_nn μ²/impratio
    in every row. With two or three rows the determinant must be 1e-10, with five each pivot of the
    Cholesky factors. Below, PGS gives no friction, and noslip leaves the slip. A goes with 1/m: the
    limit is at 2e6 kg on fig12 with μ = 20, at 1e4 kg with μ = 1.4. Measured with five settings:
    right at 0.95 of that mass, and wrong by the whole path at 1.05. On classical_regular, whose A
    changes during the motion, it is right at half of it.
    """
    noslip = plan.option("noslip_iterations")
    if plan.option("cone") != "elliptic" or not (noslip or plan.option("solver") == "PGS"):
        return None
    rows = plan.condim - 1
    slide, spin, roll = plan.friction
    scale = np.diag([slide, slide, spin, roll, roll][:rows])
    block = scale @ inverse_inertia(plan)[:rows, :rows] @ scale
    if not noslip:
        softness = plan.settings.softness * (1 - plan.impedance) / plan.impedance
        normal = 1 / plan.scene.ball.mass
        block += softness * normal * slide**2 / plan.option("impratio") * np.eye(rows)
    # The pivots of Cholesky's factors are the ratios of successive leading minors.
    minors = np.array([np.linalg.det(block[:n, :n]) for n in range(1, rows + 1)])
    value = minors[-1] if rows < 5 else (minors / [1.0, *minors[:-1]]).min()
    warning = (
        "PGS and noslip will leave friction out: the determinant or pivot of friction's inverse "
        f"inertia is {value:.4g}, and below {_LEAST_DETERMINANT:.4g} they treat the matrix as "
        "singular: scale the masses down or the friction up, or take solver Newton without noslip"
    )
    return LimitCheck(value, _LEAST_DETERMINANT, warning, least=True)


def inverse_inertia(plan: PlannedRun) -> Array:
    """Return the accelerations (5, 5) of slip, spin and roll by unit forces and torques.

    World axes. The ball's hinges are held; slip is at the contact, a below the centre.
    """
    ball = plan.scene.ball
    turning = plan.axes @ np.diag(1 / ball.principal[0]) @ plan.axes.T
    x, y, z = np.eye(3)
    arm = np.array([0.0, 0.0, -ball.radius])
    linear = np.array([x, y, *np.zeros((3, 3))])
    angular = np.array([np.cross(arm, x), np.cross(arm, y), z, x, y])
    return linear @ linear.T / ball.mass + angular @ turning @ angular.T


def solver_tolerance(plan: PlannedRun) -> LimitCheck | None:
    """Require that the solver's tolerance times the armatures is below m g d/(1 - d).

    Otherwise a solver stops before its first iteration. Newton stops if the gradient over the sum
    of the inertias, armatures included, is below the tolerance, and without a force the gradient is
    m g d/(1 - d). Measured: right at 2 times that, and no force at 20 times. CG also checks the
    cost and stops at a hundredth of it. PGS always takes its first iteration, which is enough.
    """
    drive = plan.settings.drive
    if not isinstance(drive, Prescribed) or plan.option("solver") == "PGS":
        return None
    prescribed = [hinge for hinge in plan.hinges if hinge.motor is None]
    d, weight = plan.impedance, plan.scene.ball.mass * plan.scene.gravity
    limit = weight * d / (1 - d) / (1 if plan.option("solver") == "Newton" else 100)
    value = plan.option("tolerance") * drive.armature * len(prescribed)
    warning = (
        f"the solver will stop before its first iteration: tolerance times armatures is "
        f"{value:.4g}, but must be below {limit:.4g}: give tolerance 0, or solver PGS"
    )
    return LimitCheck(value, limit, warning)


def largest_number(plan: PlannedRun) -> LimitCheck | None:
    """Require coordinates, rates and controls of at most 1e10; MuJoCo rejects larger values.

    They are the path at the speed of the start, the angles of the hinges, and the controls of the
    actuators.
    """
    rates = [abs(hinge.rate) for hinge in plan.scene.hinges]
    speed = float(np.linalg.norm(plan.rolling_velocity))
    controls, reach = [abs(h.control(0.0)) for h in plan.hinges], max(1.0, plan.duration)
    value = max(*(rate * reach for rate in (speed, *rates)), *controls, plan.rotation_rate)
    warning = (
        f"a coordinate, rate or control will reach {value:.4g}, but MuJoCo rejects values above "
        f"{_LARGEST_STATE:.4g}: choose other units or a shorter run"
    )
    return LimitCheck(value, _LARGEST_STATE, warning)


def prescribed_rate(plan: PlannedRun) -> LimitCheck | None:
    """Predict the change ∫τ dt/armature of a prescribed hinge rate under a load τ.

    Measured to three digits on six scenes with masses of 1e5 and 1e6 times their own. The relative
    path error is 0.1 to 40 times as much. The loads of the start, which may be zero before a ramp,
    are assumed to act for a radian of the fastest rotation. If a pendulum or rotor with the mass of
    the ball at its radius could exceed the limit, the equations give the loads of the whole motion.
    """
    limit = plan.settings.error_tolerance / _MAGNIFIED

    def lost(impulses: Array) -> float:
        kept = [hinge for hinge in plan.hinges if isinstance(hinge.actuation, Prescribed)]
        rates = [impulses[h.index] / h.actuation.armature / h.rate_scale for h in kept]
        return float(max(rates, default=0.0))

    start, rate, T = np.abs(plan.loads.motor_torques[0]), plan.rotation_rate, plan.duration
    lever = plan.scene.ball.mass * plan.scene.ball.radius
    spun_up = lever * plan.scene.ball.radius * np.array(plan.scene.largest_rates)
    most = (lever * (plan.scene.gravity + plan.scene.ball.radius * rate**2) + start) * T + spun_up
    if plan.known_loads is None and lost(most) <= limit:
        value = lost(start * min(T, 1 / rate if rate else T))
    else:
        whole = plan.whole_loads.motor_torques
        impulses = np.abs(np.cumsum(whole, axis=0)).max(axis=0) * plan.duration / len(whole)
        value = lost(impulses)
    remedy = "take a larger armature for such heavy bodies"
    return error_check(value, limit, "loads will change a prescribed rate", remedy)


LAWS: tuple[Law, ...] = (
    rotation, momentum_lost, friction_damping, contact_spring, raised_solref, sliding_friction,
    torsional_friction, friction_block, solver_tolerance, largest_number, prescribed_rate,
)  # fmt: skip
