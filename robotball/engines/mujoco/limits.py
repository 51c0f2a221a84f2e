"""Limits of a run predicted before any step: a law a function, and the precheck against them all.

A law is the first line of its function's docstring, from which docs/extremes.md and the legends of
`robotball extremes` have it; the words above the function are what a user is warned of.

The laws are of the time step (what an integrator makes of rotations, springs, dampers and servos),
of the contact (friction, softness, and what numbers can hold) and of the hinges (the part of its
rate that a servo or an armature loses under its load). Each docstring has its derivation and how
near measurements come to it.

A law's numbers follow from the paper's equations where these describe the scene. Where they do not,
and where a law is too rough, they come from short trials, which are loaded only then.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial, wraps

import numpy as np

from robotball.engines.mujoco.model import ModelHinge, hinges_of
from robotball.engines.mujoco.settings import Prescribed, Resolved, Settings
from robotball.engines.observe import step_count
from robotball.errors import InputError, warn
from robotball.motion import RATE_ERROR, path_unit, tolerated
from robotball.robot import formulas as eq
from robotball.robot.formulas import as_vector
from robotball.robot.loads import Loads, loads_of
from robotball.robot.motors import Servo
from robotball.robot.scene import Scene
from robotball.rotations import Array, multiply, rotation_matrix, uneven


@dataclass(frozen=True)
class LimitCheck:
    """A number of a planned run and the limit beyond which the run is predicted to fail.

    words       of the warning, with the fields as {value:.4g}, and with {error} and {allowed} for
                value and limit in percent
    integrator  the run's
    least       whether the value must be at least the limit, instead of at most
    step        a timestep [s] that is inside the limit, of laws whose words advise one
    """

    words: str
    integrator: str
    least: bool
    value: float
    limit: float
    step: float = np.nan

    @property
    def warning(self) -> str:
        """What will happen beyond the limit, with the numbers, and what to do."""
        error, allowed = (f"{float(f'{100 * x:.2g}'):g} %" for x in (self.value, self.limit))
        return self.words.format(**vars(self), error=error, allowed=allowed)

    @property
    def nearness(self) -> float:
        """The used part of the limit: 1 is at the limit, more is beyond it."""
        over, under = (self.limit, self.value) if self.least else (self.value, self.limit)
        # A number that cannot be computed promises nothing, and counts as beyond its limit.
        if np.isnan(over) or np.isnan(under):
            return np.inf
        if under == 0:
            return np.inf if over > 0 else 0.0
        return float(over) / float(under)

    @property
    def exceeded(self) -> bool:
        """True if the run is predicted to fail."""
        return self.nearness > 1


# Times over the run at which drives that change are evaluated. Limits are predicted to a factor, so
# the largest rate between these times need not be found.
_DRIVES_SEEN = 9


# The equations are integrated for the loads of a whole motion at so many times, in as many steps at
# most: a second.
_LOADS_SEEN, _REFERENCE_STEPS = 1001, 5_000


@dataclass(frozen=True)
class PlannedRun(Resolved):
    """A scene under settings over a duration [s], with the numbers that limits are predicted from.

    known_loads: the loads of the whole motion; where they are None, the start's are taken.
    """

    duration: float
    known_loads: Loads | None = None

    @property
    def reduced(self) -> bool:
        """True if (3.2) or (3.3) describes the motion, but for the errors of the servos' rates.

        Otherwise the numbers are measured on MuJoCo's own model at its start.
        """
        scene = self.scene
        kept = all(isinstance(hinge.motor, Servo | None) for hinge in scene.hinges)
        return scene.keeps_momentum and kept and not scene.ball.pendulums

    @cached_property
    def hinges(self) -> tuple[ModelHinge, ...]:
        """The hinges of the model."""
        return hinges_of(self.scene, self.settings)

    @cached_property
    def start_trial(self) -> tuple[Loads, Array]:
        """The start's loads and eigenvalues, measured on MuJoCo's own model."""
        from robotball.engines.mujoco.linearised import linearised_start

        return linearised_start(self.scene, self.settings)

    @cached_property
    def servo_rate(self) -> float:
        """The largest |λ| [1/s] of the hinges' motors; 0 without a motor that settles."""
        if not any(each.settles for each in self.hinges):
            return 0.0
        from robotball.engines.mujoco.linearised import fastest_rate

        return fastest_rate(self.scene, self.hinges)

    @cached_property
    def axes(self) -> Array:
        """The rotation (3, 3) from principal axes to world at the start."""
        return rotation_matrix(multiply(self.scene.start.attitude, self.scene.principal_quaternion))

    @cached_property
    def angular_velocity(self) -> Array:
        """ω (3,) in principal axes at the start [rad/s]."""
        return self.scene.principal_axes.T @ self.scene.angular_velocity_at(self.scene.start)

    @property
    def Omega(self) -> Array:
        """Ω (3,) of the frame in the shell, in principal axes at the start; 0 without [rad/s]."""
        if not self.scene.ball.has_frame:
            return np.zeros(3)
        frame = self.scene.hinges[0]
        return self.scene.principal_axes.T @ (frame.rate * self.scene.ball.shell.axis)

    @cached_property
    def loads(self) -> Loads:
        """The whole motion's loads where they are known, else the start's."""
        if self.known_loads is not None:
            return self.known_loads
        if not self.reduced:
            return self.start_trial[0]
        return loads_of(self.scene, np.zeros(1), self.axes[None], self.angular_velocity[None])

    @cached_property
    def whole_loads(self) -> Loads:
        """The loads of the whole motion, by the equations unless they are known.

        The start's loads if the equations need too many steps or have no such motion.
        """
        if self.known_loads is not None or self.scene.controller is not None:
            return self.loads
        from robotball.engines.equations import integrate  # few runs need it

        times = np.linspace(0.0, self.duration, _LOADS_SEEN)
        with suppress(InputError):
            return integrate(self.scene, times, rtol=1e-8, max_steps=_REFERENCE_STEPS).loads
        return self.loads

    @cached_property
    def rolling_velocity(self) -> Array:
        """The velocity (3,) of the ball's centre at the start, principal axes [m/s]."""
        turning = self.angular_velocity - self.Omega
        return self.scene.ball.radius * np.cross(turning, self.axes[2])

    @cached_property
    def rotation_rate(self) -> float:
        """r [rad/s]: the fastest rotation that an integrator has to follow.

        ω itself, about which all vectors turn in the frame, and the eigenvalues of ∂(dω/dt)/∂ω
        from (2.4), (2.5): the nutation, of about |A K| where fast rotors dominate. The rotors' own
        rates do not count, as their hinges turn evenly. All is evaluated at the start's attitude,
        with the drives as they are at a few times.
        """
        if not self.reduced:
            of_frame = [h for h in self.hinges if h.index == 0 and h.actuation.follows_rate]
            frame = [self.scene.largest_rates[h.index] for h in of_frame]
            size = float(np.linalg.norm(self.angular_velocity))
            return max(size, *frame, float(np.abs(self.start_trial[1].imag).max()))
        times = [0.0] if self.scene.steady else uneven(self.duration, self.duration / _DRIVES_SEEN)
        return max(self._rotation_rate_at(float(t)) for t in times)

    def _rotation_rate_at(self, t: float) -> float:
        """Return the fastest rotation with the drives as they are at t [s]."""
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
        # Quadratic in ω: the central difference is exact at any step.
        step = size or 1.0
        sides = [
            (acceleration(omega + step * e) - acceleration(omega - step * e)) / (2 * step)
            for e in np.eye(3)
        ]
        if not np.all(np.isfinite(sides)):
            return np.inf
        return max(float(np.abs(np.linalg.eigvals(np.array(sides))).max()), size)


# The value, the limit and, where the words advise one, a step [s]; None if a law does not apply.
_Found = tuple[float, float] | tuple[float, float, float] | None
LAWS: dict[str, Callable[[PlannedRun], LimitCheck | None]] = {}


def _law(words: str, *, least: bool = False) -> Callable[..., Callable[..., LimitCheck | None]]:
    """Make a law of a function that finds its numbers, and add it to LAWS."""

    def add(find: Callable[[PlannedRun], _Found]) -> Callable[[PlannedRun], LimitCheck | None]:
        @wraps(find)
        def law(plan: PlannedRun) -> LimitCheck | None:
            found = find(plan)
            return found and LimitCheck(words, plan.integrator.name, least, *found)

        LAWS[law.__name__] = law
        return law

    return add


_STABLE = 6.3  # the longest stable step of DOP853 times the rate at which a motor settles
_MANY_STEPS = 20_000  # adaptive ones, which take ten seconds at least


@_law(
    "the fastest rotation turns by {value:.4g} rad in a step, and {integrator} follows "
    "{limit:.4g} rad: take a timestep below {step:.2g} s, or the adaptive preset"
)
def rotation(plan: PlannedRun) -> _Found:
    """Require r·dt < 2.8 of RK4, with r the rate of the fastest rotation.

    On dy/dt = i r y a step multiplies by R(iθ) = 1 + iθ - θ²/2 - iθ³/6 + θ⁴/24, θ = r dt, and
    |R|² = 1 - θ⁶/72 + θ⁸/576, which is above 1 from θ = √8 on. Beyond, the motion blows up; well
    before it M is lost, which `momentum_lost` predicts. Measured with rotors at 30 times their
    rates, over 60 steps: the path is off by 1e-3 at 0.5, by 0.2 at 2.2, and there is none at 3.0;
    the classical ball is off as much, and takes longer to blow up.
    """
    limit = plan.integrator.rotation_limit
    if limit is None:
        return None
    rate = plan.rotation_rate
    return rate * plan.timestep, limit, limit / rate if rate else np.inf


@_law(
    "{integrator} will change M by about {error}; {allowed} is allowed: take a timestep below "
    "{step:.2g} s, or an integrator of higher order"
)
def momentum_lost(plan: PlannedRun) -> _Found:
    """Predict how much of M fixed steps lose or gain, a part of (r·dt)² or (r·dt)⁶ in each.

    It is of first order, and no warning of MuJoCo's shows it. Per step Euler multiplies a rotation
    by |1 + iθ| = 1 + θ²/2, so that |M| grows as exp(r² dt t/2); discrete and implicitfast, which
    leave the gyroscopic forces explicit, do the same; implicit shrinks it as much. RK4's |R(iθ)| =
    1 - θ⁶/144. The prediction is for all of M in the fastest rotation: measured 0.05 to 1.7 of it
    for Euler and implicit, and 0.3 to 2.3 of it for RK4, on three balls at their rates and at five
    times them. But a nutation of fast rotors may have next to none of M in it. So where this is
    beyond the limit, a trial measures it, which is within 5 % of the run's.
    """
    if plan.integrator.momentum_loss is None:
        return None
    if plan.integrator.order == 4 and not plan.scene.keeps_momentum:
        return None  # M changes by itself, so its change shows no error
    theta = plan.rotation_rate * plan.timestep
    order, factor = plan.integrator.momentum_loss
    steps = plan.duration / plan.timestep
    limit = float(tolerated(plan.settings.error_tolerance, np.array(plan.duration)))
    with np.errstate(over="ignore"):
        value = float(steps * factor * np.float64(theta) ** order)
    # A trial takes some 60 ms, so it is made only where the formula raises an alarm.
    if value > limit and plan.integrator.order == 4 and plan.reduced:
        from robotball.engines.mujoco.linearised import momentum_loss

        value = min(value, momentum_loss(plan.scene, plan.timestep, plan.duration))
    shorter = plan.timestep * (limit / value) ** (1 / (order - 1)) if value > 0 else np.inf
    return value, limit, shorter


_MEASURED = 10.0  # s, the motions on which the next law was measured


@_law(
    "a low weight's swing will put RK4's path off by about {error}; {allowed} is allowed: take a "
    "timestep below {step:.2g} s"
)
def low_weight(plan: PlannedRun) -> _Found:
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
    limit = float(tolerated(plan.settings.error_tolerance, np.array(plan.duration)))
    return value, limit, plan.timestep * (limit / value) ** (1 / 6)


@_law(
    "the errors of all steps may change M by about {error}; {allowed} is allowed: take a smaller "
    "rtol"
)
def errors_added(plan: PlannedRun) -> _Found:
    """Predict the sum of the errors of DOP853's steps: rtol times their number.

    Measured: M drifts by 0.005 to 0.2 of it on four scenes, from 1e-12 to 1e-6; from 1e-4 on the
    contact may be lost as well.
    """
    rtol = plan.settings.rtol
    if not plan.settings.adaptive or rtol is None:
        return None
    from robotball.engines.mujoco.cost_model import COST_MODEL  # few runs choose their steps

    steps = plan.duration * COST_MODEL.steps_per_second(plan.rotation_rate, rtol)
    limit = tolerated(plan.settings.error_tolerance, np.array(plan.duration))
    return rtol * max(steps, 1.0), float(limit)


@_law(
    "slip will grow, as the friction's damping times the timestep is {value:.4g} and {integrator} "
    "bears {limit:.4g}: give solreffriction a weaker damping, as (-1, -0.5)"
)
def friction_damping(plan: PlannedRun) -> _Found:
    """Require b·dt < 2.785 of RK4, 2 of Euler and the implicit ones, b the damping of slip.

    Slip follows dv/dt = -b v. RK4's R(-z) = 1 - z + z²/2 - z³/6 + z⁴/24 is 1 at z = 2.785. Euler
    and the implicit integrators take the contact's force from the start of the step, v → v(1 - b
    dt). Measured: slip dies out at 2.75 and grows at 2.82; at 1.95 and 2.05 under the others.
    Discrete has no such limit.
    """
    limit = plan.integrator.friction_limit
    if limit is None:
        return None
    return plan.friction_damping * plan.timestep, limit


@_law(
    "the contact's vibration will grow {value:.4g} times in each step: take a softer solref, as "
    "(0.04, 1), or a shorter timestep"
)
def contact_spring(plan: PlannedRun) -> _Found:
    """Require that a step does not magnify the contact's vibration ẍ = -k x - b ẋ.

    RK4's |R(s dt)| for the roots s of s² + b s + k; for the others, which take the force first,
    then the velocity, then the position, the spectral radius of
    ((1 - b dt, -k dt), (dt (1 - b dt), 1 - k dt²)). A positive solref is raised to two steps
    without a warning, and stays below. Measured with b dt at 2.7 and 2.9 under RK4, at
    1.9 and 2.1 under Euler and implicit; discrete has no such limit. A start in equilibrium does
    not wake the vibration, and a soft enough damper lets the ball bounce long before.
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
    # A vibration that keeps its size is no fault, and rounding must not make it one.
    return float(growth), 1 + 1e-9


@_law(
    "MuJoCo will raise the contact's time constant from {value:.4g} s to two timesteps without a "
    "warning: give solref {limit:.4g} s",
    least=True,
)
def raised_solref(plan: PlannedRun) -> _Found:
    """Require a contact's time constant of two steps, to which MuJoCo would raise it in silence.

    By its refsafe, so a sweep of the timestep would change the contact as well.
    """
    constant = plan.solref[0]
    if constant <= 0 or not np.isfinite(plan.timestep):
        return None
    # A constant of exactly two steps, as the advice names it, must pass.
    return constant, 2 * plan.timestep * (1 - 1e-12)


@_law(
    "the servos' rate needs {value:.4g} adaptive steps, and more than {limit:.4g} take minutes: "
    "take a lower gain, more armature, or prescribe the rate"
)
def settling(plan: PlannedRun) -> _Found:
    """Predict DOP853's steps of 6.3/λ at most, λ the rate at which a servo settles.

    Longer ones are not stable, whatever their error.
    """
    fastest = plan.servo_rate
    if not plan.settings.adaptive or not fastest:
        return None
    return fastest * plan.duration / _STABLE, _MANY_STEPS


@_law(
    "the servos' rates will grow, as their gain times the timestep over their inertia is "
    "{value:.4g} and {integrator} bears {limit:.4g}: take a lower gain, a shorter timestep, or "
    "prescribe the rate"
)
def servo_gain(plan: PlannedRun) -> _Found:
    """Require kv·dt/j < 2.785 of RK4, 2 of Euler and discrete, kv/j a servo's gain over inertia.

    The implicit integrators have no limit. A velocity servo is a damper, and j the inertia that it
    feels with the ball rolling: kv/j is its `servo_rate`, with springs and position servos the size
    of a complex one. Measured on both models: sound at 2.7 and diverged at 2.9 under RK4, at 1.95
    and 2.1 under Euler.
    """
    limit, fastest = plan.integrator.servo_limit, plan.servo_rate
    if limit is None or not fastest:
        return None
    return fastest * plan.timestep, limit


@_law(
    "a drive changes between a step's instants, which will put its rate off by about {error}; "
    "{allowed} is allowed: take a timestep below {step:.2g} s, or the adaptive preset"
)
def drive_seen(plan: PlannedRun) -> _Found:
    """Predict the error of a drive's rate, of which a step sees begin, middle and end alone.

    It is the mean rate's over a step. The error is Simpson's, of fourth order for slow drives, and
    of the drive's own size for one whose period is no longer than the step. No rate at a step's end
    shows it: there a drive whose period divides the timestep is a constant. Measured on fig12 with
    a sine in the frame's rate: the path is off by 0.64 to 0.7 of it from 7 to 50 Hz, by 1.0 of it
    at half the step's rate, and by 0.6 to 1.9 of it where the period divides the timestep.
    """
    if plan.settings.adaptive or plan.scene.steady:
        return None
    from robotball.robot.drive_sampling import seeing_step  # most scenes are steady

    limit = min(plan.settings.error_tolerance, RATE_ERROR)
    error_of = partial(plan.scene.sampling_error, plan.duration)
    return error_of(plan.timestep), limit, seeing_step(error_of, plan.timestep, limit)


_LARGEST_STATE = 1e10  # mjMAXVAL: MuJoCo calls a larger position, velocity or control bad
_LEAST_DETERMINANT = 1e-10  # below it MuJoCo takes a contact's friction for singular


@_law(
    "the ball will slip, as sliding friction is {value:.4g} and the motion needs {limit:.4g}: "
    "raise sliding_friction",
    least=True,
)
def sliding_friction(plan: PlannedRun) -> _Found:
    """Require μ ≥ |F|/N, with the horizontal force F that the motion by (2.4) needs of the plane.

    Where only the start's loads are known, a demand that grows later is not seen.
    """
    return plan.friction[0], plan.loads.sliding_friction.max()


@_law(
    "the ball will spin on the spot, as torsional friction is {value:.4g} m and the motion needs "
    "{limit:.4g} m: raise torsional_friction",
    least=True,
)
def torsional_friction(plan: PlannedRun) -> _Found:
    """Require μ_t ≥ |λ₀|/N for rubber, with the torque λ₀ that keeps the ball from spinning.

    With less the ball spins under drag, and is not rubber.
    """
    if plan.scene.rolling != "rubber" or plan.condim < 4:
        return None
    return plan.friction[1], plan.loads.torsional_friction.max()


@_law(
    "the ball will spin on the spot, as condim is {value:.4g} and rubber needs {limit:.4g}: leave "
    "condim None",
    least=True,
)
def contact_dimension(plan: PlannedRun) -> _Found:
    """Require condim 4 for rubber, which has the torsional row; with 3 the ball is classical."""
    return (plan.condim, 4) if plan.scene.rolling == "rubber" else None


@_law(
    "rolling or torsional friction, which the rolling model does not have, will reduce M by about "
    "{error}; {allowed} is allowed: leave condim None"
)
def drag(plan: PlannedRun) -> _Found:
    """Predict the part μ m g t of M that rolling and torsional friction take.

    They are rows that the rolling model does not have: rolling friction with condim 6 in both
    models, and torsional friction in the classical one, which may spin. dM/dt = -μ m g at most,
    with the μ of the row [m].
    """
    eats = plan.friction[2] if plan.condim >= 6 else 0.0
    if plan.scene.rolling == "classical" and plan.condim >= 4:
        eats += plan.friction[1]
    if not eats:
        return None
    weight = plan.scene.ball.mass * plan.scene.gravity
    lost = eats * weight * plan.duration / plan.scene.momentum_scale
    return lost, plan.settings.error_tolerance


@_law(
    "with the frame as root the ball will slip off its path by about {error}; {allowed} is "
    'allowed: take root="shell"'
)
def frame_as_root(plan: PlannedRun) -> _Found:
    """Predict the slip |a (ω×Ω)×γ|/(b v) over the speed, of a model whose root is the frame.

    The contact rows' J̇v term, which MuJoCo leaves out, is a(ω×Ω)×γ when the shell hangs on a
    hinge. Friction that reduces slip at the rate b leaves so much of it. M keeps its value all the
    while, so it does not show the slip. Measured 0.6 to 3.5 times what is predicted, for the
    start's numbers stand for the whole motion's.
    """
    if plan.settings.root == "shell" or not plan.reduced:
        return None
    left_out = np.cross(plan.angular_velocity, plan.Omega)
    acceleration = plan.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, plan.axes[2])))
    return _slip(plan, acceleration), plan.settings.error_tolerance


@_law(
    "soft friction will let the ball creep off its path by about {error}; {allowed} is allowed: "
    "give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1"
)
def creep(plan: PlannedRun) -> _Found:
    """Predict the slip (1 - d)/d α/(b v) over the speed, by which soft friction carries its load.

    The noslip solver takes it away. A row of impedance d gives its force with a deviation of (1 -
    d)/d of the acceleration α that the force makes: divided by impratio in an elliptic cone, times
    μ² in a pyramidal one, whose edges lean that far. So b v = (1 - d)/d α. Measured within 3 % on
    fig12, and a sixth of it on classical_regular, whose force is not always that of the start.
    """
    if plan.option("noslip_iterations") or not plan.reduced:
        return None
    softness = (1 - plan.impedance) / plan.impedance
    if plan.option("cone") == "elliptic":
        softness /= plan.option("impratio")
    else:
        softness *= plan.friction[0] ** 2
    force = float(np.linalg.norm(plan.loads.contact_force[:, :2], axis=1).max())
    slip = _slip(plan, softness * force * _inverse_inertia(plan)[0, 0])
    return slip, plan.settings.error_tolerance


def _slip(plan: PlannedRun, acceleration: float) -> float:
    """Return the slip over the path, under an acceleration [m/s²] against damping.

    dv/dt = α - b v from rest has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = plan.friction_damping, plan.duration
    # Over a short time the difference cancels; the series' first term takes its place.
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > 1e-4 else b * T / 2
    path = path_unit(plan.scene, T * float(np.linalg.norm(plan.rolling_velocity)))
    return float(acceleration * (grown / b if b else T / 2) * T / path)


@_law(
    "PGS and noslip will leave friction out, as the determinant or pivot of its inverse inertia "
    "is {value:.4g}, and below {limit:.4g} they take it for singular: scale the masses down or "
    "the friction up, or take solver Newton without noslip",
    least=True,
)
def friction_block(plan: PlannedRun) -> _Found:
    """Require det(D A D) ≥ 1e-10, below which PGS and noslip leave friction out in silence.

    Both solve the block of its friction rows in an elliptic cone: D A D, with A the inverse inertia
    that the rows feel and D their coefficients. PGS adds their softness, (1 - d)/d A_nn μ²/impratio
    in every row. With two or three rows the determinant must be 1e-10, with five each pivot of
    Cholesky's. Below that PGS gives no friction, and noslip leaves what slip there is. A goes with
    1/m: the limit is at 2e6 kg on fig12 with μ = 20, at 1e4 kg with μ = 1.4. Measured on five
    settings: right at 0.95 of that mass, and off by the whole path at 1.05; on classical_regular,
    whose A does not stay the start's, right at half of it.
    """
    noslip = plan.option("noslip_iterations")
    if plan.option("cone") != "elliptic" or not (noslip or plan.option("solver") == "PGS"):
        return None
    rows = plan.condim - 1
    slide, spin, roll = plan.friction
    scale = np.diag([slide, slide, spin, roll, roll][:rows])
    block = scale @ _inverse_inertia(plan)[:rows, :rows] @ scale
    if not noslip:
        softness = plan.settings.softness * (1 - plan.impedance) / plan.impedance
        normal = 1 / plan.scene.ball.mass
        block += softness * normal * slide**2 / plan.option("impratio") * np.eye(rows)
    # The pivots of Cholesky's factors are the ratios of successive leading minors.
    minors = np.array([np.linalg.det(block[:n, :n]) for n in range(1, rows + 1)])
    value = minors[-1] if rows < 5 else (minors / [1.0, *minors[:-1]]).min()
    return value, _LEAST_DETERMINANT


def _inverse_inertia(plan: PlannedRun) -> Array:
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


@_law(
    "the ball will fall into the contact by about {error} of its radius; {allowed} is allowed: "
    "set start_in_equilibrium"
)
def start_depth(plan: PlannedRun) -> _Found:
    """Predict the lever arm's error g (1 - d)/(d² k) over the radius, of a start just touching.

    Half of it is in the path. The contact carries the weight at the depth p = g (1 - d)/(d² k),
    into which the ball falls. A start in equilibrium has it as the pair's margin, and the lever arm
    is a.
    """
    if plan.settings.start_in_equilibrium:
        return None
    return plan.equilibrium_depth / plan.scene.ball.radius, 2 * plan.settings.error_tolerance


@_law(
    "the ball will slip by about {error} of its speed in the first step, which finds no contact; "
    "{allowed} is allowed: set start_in_equilibrium"
)
def first_step(plan: PlannedRun) -> _Found:
    """Predict the slip α dt over the speed of M, which a start just touching begins with.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if plan.settings.start_in_equilibrium or not plan.reduced or not np.isfinite(plan.timestep):
        return None
    force = float(np.linalg.norm(plan.loads.contact_force[0, :2]))
    slip = force * float(_inverse_inertia(plan)[0, 0]) * plan.timestep
    speed = plan.scene.momentum_scale * plan.scene.ball.radius / plan.scene.ball.d
    return slip / speed, plan.settings.error_tolerance


@_law(
    "the solver will stop before it has begun, as its tolerance times the armatures is "
    "{value:.4g}, above {limit:.4g}: give tolerance 0, or solver PGS"
)
def solver_tolerance(plan: PlannedRun) -> _Found:
    """Require that the solver's tolerance times the armatures is below the gradient m g d/(1 - d).

    Else a solver stops before it begins. Newton's stops where the gradient over the sum of the
    inertias, armatures included, is below the tolerance, and without a force yet the gradient is m
    g d/(1 - d). Measured: right at 2 and nothing at 20 times that; CG, which goes by the cost as
    well, stops a hundred times earlier. PGS always takes its first iteration, and that is enough.
    """
    drive = plan.settings.drive
    if not isinstance(drive, Prescribed) or plan.option("solver") == "PGS":
        return None
    prescribed = [each for each in plan.hinges if each.motor is None]
    d, weight = plan.impedance, plan.scene.ball.mass * plan.scene.gravity
    limit = weight * d / (1 - d) / (1 if plan.option("solver") == "Newton" else 100)
    return plan.option("tolerance") * drive.armature * len(prescribed), limit


@_law(
    "a coordinate, rate or control will reach {value:.4g}, and MuJoCo takes more than {limit:.4g} "
    "for a bad state: choose other units or a shorter run"
)
def largest_number(plan: PlannedRun) -> _Found:
    """Require coordinates, rates and controls up to 1e10; MuJoCo takes more for a bad state.

    They are the path at the start's speed, the angles that the hinges turn through, and the
    actuators' controls.
    """
    rates = [abs(hinge.rate) for hinge in plan.scene.hinges]
    speed = float(np.linalg.norm(plan.rolling_velocity))
    controls = [abs(hinge.control(0.0)) for hinge in plan.hinges]
    reach = max(1.0, plan.duration)
    turned = [rate * reach for rate in rates]
    return max(speed * reach, *turned, *controls, plan.rotation_rate), _LARGEST_STATE


_MAGNIFIED = 10.0  # the path's relative error over a rate's, of the 0.1 to 40 that were measured


@_law(
    "loads on a prescribed hinge will put its rate off by about {error}; {allowed} is allowed: "
    "take a larger armature for such heavy bodies"
)
def prescribed_rate(plan: PlannedRun) -> _Found:
    """Predict the rate ∫τ dt/armature that a hinge kept by its armature loses under its load τ.

    Measured to three digits on six scenes with masses of 1e5 and 1e6 times their own. The path is
    off by 0.1 to 40 times as much, relative. The start's loads, which may be zero before a ramp,
    are taken to act for a radian of the fastest rotation. The equations give the loads of the whole
    motion if a mass of the ball's that hangs or turns at its radius could exceed the limit.
    """
    limit = plan.settings.error_tolerance / _MAGNIFIED

    def lost(impulses: Array) -> float:
        kept = [(h, h.actuation) for h in plan.hinges if isinstance(h.actuation, Prescribed)]
        rates = [impulses[h.index] / a.armature / h.rate_scale for h, a in kept]
        return float(max(rates, default=0.0))

    start, rate, T = np.abs(plan.loads.motor_torques[0]), plan.rotation_rate, plan.duration
    lever = plan.scene.ball.mass * plan.scene.ball.radius
    spun_up = lever * plan.scene.ball.radius * np.array(plan.scene.largest_rates)
    most = (lever * (plan.scene.gravity + plan.scene.ball.radius * rate**2) + start) * T + spun_up
    if plan.known_loads is None and lost(most) <= limit:
        return lost(start * min(T, 1 / rate if rate else T)), limit
    whole = plan.whole_loads.motor_torques
    impulses = np.abs(np.cumsum(whole, axis=0)).max(axis=0) * plan.duration / len(whole)
    return lost(impulses), limit


@_law(
    "loads on a servo will put its rate off by about {error}; {allowed} is allowed: take a higher "
    "gain, or prescribe the rate"
)
def servo_droop(plan: PlannedRun) -> _Found:
    """Predict the error τ/kv of a velocity servo's rate under its load, relative to the rate.

    Measured 0.75 to 0.99 of that, where it is small.
    """
    servos = [(h, h.actuation) for h in plan.hinges if isinstance(h.actuation, Servo)]
    if not servos:
        return None
    worst = 0.0
    for hinge, servo in servos:
        torque = float(np.abs(plan.loads.motor_torques[:, hinge.index]).max())
        if hinge.motor is None:  # else its error belongs to the motion
            worst = max(worst, torque / servo.gain / hinge.rate_scale)
    return worst, plan.settings.error_tolerance


def limit_checks(plan: PlannedRun) -> dict[str, LimitCheck]:
    """Return what the laws that apply to a run predict, by their names."""
    # Extreme settings overflow here, and an infinite value exceeds its limit all the same.
    with np.errstate(all="ignore"):
        checks = {name: law(plan) for name, law in LAWS.items()}
    return {name: check for name, check in checks.items() if check is not None}


def exceeded(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> dict[str, LimitCheck]:
    """Return the limits that a run is predicted to exceed, by the names of their laws.

    times: (n,) s, the run's; loads: of the whole motion by the equations, if known already, in
    place of the start's.
    """
    checks = limit_checks(PlannedRun(scene, settings, float(times[-1]), loads))
    return {name: check for name, check in checks.items() if check.exceeded}


def precheck(
    scene: Scene,
    settings: Settings,
    times: Array,
    loads: Loads | None = None,
    *,
    strict: bool = False,
) -> None:
    """Warn, a line each, of the limits that the run exceeds; raise InputError if strict."""
    for check in exceeded(scene, settings, times, loads).values():
        line = f"{scene.name}, {settings.name}: {check.warning}"
        if strict:
            raise InputError(line)
        warn(line)


def check_length(scene: Scene, settings: Settings, times: Array) -> None:
    """Raise InputError for a run of more steps than the settings allow.

    Steps that are chosen by their error are counted as they are taken, but for the least number
    that the servos need.
    """
    plan = PlannedRun(scene, settings, float(times[-1]))
    if settings.adaptive and settings.timestep is None:
        least = settling(plan)
        if least is not None and least.value > settings.max_steps:
            raise InputError(
                f"{scene.name} over {times[-1]:g} s: {least.warning}; "
                f"max_steps = {settings.max_steps}"
            )
        return
    steps = step_count(times, scene.breakpoints, plan.timestep)
    if not steps <= settings.max_steps:  # a NaN is refused as well
        size = f"{steps:.0f}" if steps < 1e15 else f"{steps:.2g}"
        raise InputError(
            f"{scene.name} over {times[-1]:g} s takes {size} steps of {plan.timestep:g} s, more "
            f"than max_steps = {settings.max_steps}: shorten the run, lengthen the timestep, or "
            "raise it"
        )
