"""The cost model: what each family of steps reaches and costs, by a scene's own rates.

How fast a scene's servos, springs and dampers settle, with the ball rolling under them.

What a model says of its own start: the loads, and how fast it answers to a push.

What is known of a run before it, and how near it is to a limit.

What RK4's steps take of M, measured on the equations: the same integrator on the same variables.

A contact that holds leaves (2.4)-(2.5), which MuJoCo integrates as the velocity of the root, the
shell, in its own axes. In the frame's axes RK4 errs otherwise, by up to 300 times less.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

import robotball.scene
from robotball import equations as eq
from robotball.drives import Free, PositionServo, Servo
from robotball.engines.mujoco.model import Hinge, build, hinges_of
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.settings import Chosen, Settings, recipe
from robotball.engines.mujoco.stepping import controlled, read_row
from robotball.equations import Parameters, Quaternion, Vector, as_vector
from robotball.motion import Loads, loads_of
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Friction, Scene


@dataclass(frozen=True)
class CostModel:
    """What was measured over the catalog and 30 random balls, 10 s each; rate is `scene_rate`.

    `python -m validation.bench.cost_model` measures it again, and says how far scenes scatter.
    """

    # A path error goes at least with this power of the timestep and of rtol.
    order: float = 3.8
    rtol_order: float = 0.85
    # DOP853's error, as the change of its M tells it, over rtol is
    # gain * (RK4's error / (rate * timestep)^4)^power, within a factor of 3 for most scenes.
    gain: float = 400.0
    power: float = 0.64
    # It takes density * rate * duration * (1e-11 / rtol)^growth steps.
    density: float = 2.95
    growth: float = 0.12
    # Seconds: a step of RK4, a step of DOP853, a sample between its steps; and of controls that
    # change in time, at each evaluation of the forces.
    step: float = 17e-6
    adaptive_step: float = 250e-6
    sample: float = 27e-6
    control: float = 8e-6

    def steps_per_second(self, rate: float, rtol: float) -> float:
        """How many steps DOP853 takes in a simulated second."""
        return self.density * rate * (1e-11 / rtol) ** self.growth


COST_MODEL = CostModel()


def scene_rate(scene: Scene) -> float:
    """The rate by which the scene's errors scale [1/s], the largest while its drives change.

    The root of |AK|² + |Ω|² + |AM|² + |ω|², at its start.
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


SEEN = 8  # angles at which pendulums are looked at


def fastest_rate(scene: Scene, hinges: tuple[Hinge, ...]) -> float:
    """|λ| [1/s], the largest of the hinges' motors about the start; 0 without such a motor.

    H du/dt = -C u - K φ for the turning u of the shell and of the hinges that have a motor, where
    C holds its damping or gain and K its stiffness; H is the part of the robot's mass matrix that
    is left once the shell rolls, and once the other hinges keep their rates. With pendulums the
    largest as these stand at eight angles that they come by.
    """
    own = [each for each in hinges if isinstance(each.actuation, Servo | PositionServo | Free)]
    if not own:
        return 0.0
    gamma = rotation_matrix(scene.start.attitude)[2]
    turns = np.linalg.svd(gamma[None])[2][1:] if scene.rolling == "rubber" else np.eye(3)
    angles = np.stack([_angles(scene, each) for each in scene.hinges], axis=1)
    still, upright = np.zeros_like(angles), np.tile(gamma, (SEEN, 1))
    stands = scene.robot.states(upright, angles, np.zeros_like(upright), still)
    rows = [0, 1, 2, *(3 + each.index for each in own)]
    free, n = len(turns), len(own)
    onto = np.zeros((free + n, 3 + n))
    onto[:free, :3], onto[free:, 3:] = turns, np.eye(n)
    stiffness, damping = np.array([_constants(each) for each in own]).T
    worst = 0.0
    for matrix in stands.matrix.transpose(2, 0, 1):
        H = onto @ matrix[np.ix_(rows, rows)] @ onto.T
        back = np.linalg.solve(H, np.eye(free + n)[:, free:])
        system = np.zeros((2 * n + free, 2 * n + free))
        system[:n, n + free :] = np.eye(n)
        system[n:, :n], system[n:, n + free :] = -back * stiffness, -back * damping
        worst = max(worst, float(np.abs(np.linalg.eigvals(system)).max()))
    return worst


def _angles(scene: Scene, hinge: robotball.scene.Hinge) -> Array:
    """(SEEN,) rad: where a servo sends a pendulum, and any other all around."""
    if hinge.name not in dict(scene.ball.named_pendulums):
        return np.full(SEEN, hinge.angle)
    times = np.linspace(0.0, scene.duration, SEEN - 1)
    if isinstance(hinge.motor, PositionServo):
        return np.array([hinge.angle, *hinge.command.rate(times)])
    if isinstance(hinge.motor, Servo):
        return hinge.angle + np.array([0.0, *hinge.command.angle(times)])
    return hinge.angle + np.linspace(0.0, 2 * np.pi, SEEN, endpoint=False)


def _constants(hinge: Hinge) -> tuple[float, float]:
    """Its motor's stiffness [N m/rad] and damping [N m s/rad]."""
    motor = hinge.actuation
    if isinstance(motor, Servo):
        return 0.0, motor.gain
    if isinstance(motor, PositionServo):
        return motor.gain, motor.damping
    assert isinstance(motor, Free)
    return motor.stiffness, motor.damping


PUSH = 1e-6  # of a velocity [m/s or rad/s] and of an angle [rad], to either side


@dataclass(frozen=True)
class StartLook:
    """loads of the start, at one time; rates (2 nv - 3,): the eigenvalues of the model's motion
    about its start, complex [1/s]. Of the real part a push grows or dies out, and with the
    imaginary one it turns.
    """

    loads: Loads
    rates: np.ndarray


def look_at_start(scene: Scene, settings: Settings) -> StartLook:
    """What the scene's model under these settings says of its start."""
    # As much friction as there needs to be: what a run has too little of is to be seen.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(replace(scene, friction=Friction()), replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = Readings(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The place on the plane does not count, and the height is the contact's.
        for of_angle, i in [(True, i) for i in range(3, nv)] + [(False, i) for i in range(nv)]:
            sides = []
            for push in (PUSH, -PUSH):
                data.qpos[:], data.qvel[:] = qpos, qvel
                if of_angle:
                    mujoco.mj_integratePos(compiled, data.qpos, np.eye(nv)[i], push)
                else:
                    data.qvel[i] += push
                mujoco.mj_forward(compiled, data)
                sides.append(data.qacc.copy())
            columns.append((sides[0] - sides[1]) / (2 * PUSH))
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # A turn that is left behind is seen from axes that turn on.
    turning[:3, :3] = -_cross_matrix(qvel[3:6])
    return StartLook(loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T])))


def _cross_matrix(v: Array) -> Array:
    """v× as a matrix (3, 3)."""
    return np.cross(v, np.eye(3)).T


DRIVES_SEEN = 9  # times over the run at which drives in time are looked at


@dataclass(frozen=True)
class PlannedRun(Chosen):
    """A scene under settings over a duration [s], as the predictions of its limits see it.

    loads: those of the whole motion where they are known, else the start's alone are.
    """

    duration: float
    known_loads: Loads | None = None

    @property
    def reduced(self) -> bool:
        """Whether (3.2) or (3.3) tells what the ball does, but for what servos miss of their rates.

        Of any other ball MuJoCo's own model is asked, at its start.
        """
        scene = self.scene
        kept = all(motor is None or isinstance(motor, Servo) for motor in scene.motors)
        return scene.keeps_momentum and kept and not scene.ball.pendulums

    @cached_property
    def hinges(self) -> tuple[Hinge, ...]:
        """Those of the model."""
        return hinges_of(self.scene, self.settings)

    @cached_property
    def look(self) -> StartLook:
        """What MuJoCo's model says of the start."""
        return look_at_start(self.scene, self.settings)

    @cached_property
    def axes(self) -> Array:
        """(3, 3): from principal axes to world, at the start."""
        attitude = multiply(self.scene.start.attitude, self.scene.principal_quaternion)
        return rotation_matrix(attitude)

    @cached_property
    def parameters(self) -> Parameters:
        return self.scene.parameters_at(0.0)

    @cached_property
    def angular_velocity(self) -> Array:
        """ω (3,) in principal axes at the start [rad/s]."""
        return self.scene.principal_axes.T @ self.scene.angular_velocity_at(self.scene.start)

    @property
    def Omega(self) -> Array:
        """Ω (3,) of the frame in the shell, in principal axes at the start [rad/s]."""
        frame = self.scene.hinges[0]
        return self.scene.principal_axes.T @ (frame.rate * frame.axis)

    @cached_property
    def loads(self) -> Loads:
        """Of the whole motion where they are known, else of the start."""
        if self.known_loads is not None:
            return self.known_loads
        if not self.reduced:
            return self.look.loads
        return loads_of(self.scene, np.zeros(1), self.axes[None], self.angular_velocity[None])

    @cached_property
    def rolling_velocity(self) -> Array:
        """(3,): of the ball's centre at the start, principal axes [m/s]."""
        turning = self.angular_velocity - self.Omega
        return self.scene.ball.radius * np.cross(turning, self.axes[2])

    @cached_property
    def rotation_rate(self) -> float:
        """r [rad/s]: the fastest that anything turns which an integrator has to follow.

        ω itself, about which all vectors turn in the frame, and the eigenvalues of ∂(dω/dt)/∂ω
        from (2.4), (2.5): the nutation, of about |A K| where fast rotors rule. The rotors' own
        rates don't count: their hinges turn evenly. At the start's attitude, with the drives as
        they are at a few times.
        """
        if not self.reduced:
            frame = [h.largest_rate for h in self.hinges if h.index == 0 and h.follows_rate]
            size = float(np.linalg.norm(self.angular_velocity))
            return max(size, *frame, float(np.abs(self.look.rates.imag).max()))
        times = [0.0] if self.scene.steady else np.linspace(0.0, self.duration, DRIVES_SEEN)
        return max(self._rotation_rate_at(float(t)) for t in times)

    def _rotation_rate_at(self, t: float) -> float:
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


@dataclass(frozen=True)
class LimitCheck:
    """A number of a planned run beside the limit beyond which the run is predicted to fail.

    what   the number, named; value and limit are in `unit`
    least  whether the limit is the least that the value may be, and not the most
    fix    what to change
    """

    what: str
    value: float
    limit: float
    fix: str
    unit: str = ""
    least: bool = False

    @property
    def nearness(self) -> float:
        """How much of the limit is used: 1 is at the limit, more is beyond it."""
        over, under = (self.limit, self.value) if self.least else (self.value, self.limit)
        if np.isnan(over) or np.isnan(under):
            return np.inf
        if under == 0:
            return np.inf if over > 0 else 0.0
        return float(over / under)

    @property
    def exceeded(self) -> bool:
        return self.nearness > 1

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        bound = "least" if self.least else "most"
        return (
            f"{self.what} is {self.value:.4g}{unit} and must be at {bound} {self.limit:.4g}{unit}: "
            f"{self.fix}"
        )


Prediction = Callable[[PlannedRun], LimitCheck | None]
"""A planned run beside one limit; None where the limit does not concern it."""
Laws = dict[Prediction, str]


MOST_STEPS = 500  # that are taken; what more of them take is in proportion


def measured_loss(plan: PlannedRun) -> float:
    """The largest change of M over the scene's scale that RK4 makes by the end of the plan.

    Takes some 60 ms. Infinite where the steps diverge.
    """
    count = plan.duration / plan.timestep
    steps = int(min(np.ceil(count), MOST_STEPS))
    ball = _Ball(plan)
    try:
        with np.errstate(all="ignore"):
            lost = _loss(ball, plan.timestep, steps)
    except ArithmeticError:  # a number beyond the largest
        return np.inf
    return lost / plan.scene.momentum_scale * max(1.0, count / steps) if lost < np.inf else np.inf


class _Ball:
    """The rolling ball by the shell's turning u in the shell's axes and its quaternion, (7,)."""

    def __init__(self, plan: PlannedRun) -> None:
        scene = plan.scene
        self.scene, self.rubber = scene, scene.rolling == "rubber"
        self.axis = as_vector(scene.principal_axes.T @ scene.ball.shell.axis)
        self.inertia = scene.principal_axes.T @ scene.ball.gyrostatic_inertia
        self.I, self.d = as_vector(scene.ball.principal[0]), scene.ball.d
        attitude = multiply(scene.start.attitude, scene.principal_quaternion)
        shell = plan.angular_velocity - plan.Omega
        self.start = np.array([*shell, *attitude])

    @cached_property
    def drives(self) -> Callable[[float], tuple[float, Array, Array]]:
        """The frame's angle on the shell, and the hinges' rates and accelerations, at a time."""
        drives = self.scene.drives

        def told(t: float) -> tuple[float, Array, Array]:
            rates = np.array([float(drive.rate(t)) for drive in drives])
            changes = np.array([float(drive.acceleration(t)) for drive in drives])
            return float(drives[0].angle(t)), rates, changes

        if not self.scene.steady:
            return told
        _, rates, changes = told(0.0)
        return lambda t: (rates[0] * t, rates, changes)

    def rate(self, t: float, state: Array) -> Array:
        """d/dt of the state by (2.4)-(2.5)."""
        angle, rates, changes = self.drives(t)
        u, q = _parts(state)
        Omega, Omega_rate = eq.scale(rates[0], self.axis), eq.scale(changes[0], self.axis)
        omega, attitude = self._of_frame(u, q, angle, Omega)
        acceleration, _ = eq.full_angular_acceleration(
            omega,
            eq.space_axes(attitude)[2],
            Omega,
            Omega_rate,
            as_vector(self.inertia @ rates),
            as_vector(self.inertia @ changes),
            self.I,
            self.d,
            self.rubber,
        )
        # Of ω - Ω, which turns with the frame about the shell's axis.
        change = eq.subtract(acceleration, Omega_rate)
        change = eq.add(change, eq.cross(Omega, eq.subtract(omega, Omega)))
        return np.array([*_turned(self.axis, angle, change), *eq.attitude_rate(q, u)])

    def momentum(self, t: float, state: Array) -> Array:
        """M (3,) in world axes."""
        angle, rates, _ = self.drives(t)
        Omega = eq.scale(rates[0], self.axis)
        omega, attitude = self._of_frame(*_parts(state), angle, Omega)
        axes = eq.space_axes(attitude)
        k = as_vector(self.inertia @ rates)
        K = eq.subtract(k, eq.scale(self.d, Omega))
        L = eq.contact_angular_momentum(omega, axes[2], Omega, K, self.I, self.d)
        M = eq.cross(axes[2], L) if self.rubber else L
        return np.array([eq.dot(axis, M) for axis in axes])

    def _of_frame(
        self, u: Vector, q: Quaternion, angle: float, Omega: Vector
    ) -> tuple[Vector, Quaternion]:
        """ω in frame axes, and the frame's quaternion."""
        sine = np.sin(angle / 2)
        turn = (np.cos(angle / 2), *eq.scale(sine, self.axis))
        return eq.add(_turned(self.axis, -angle, u), Omega), eq.quaternion_product(q, turn)


def _loss(ball: _Ball, dt: float, steps: int) -> float:
    """The largest change of |M| over the steps [kg m²/s]."""
    state, M, worst = ball.start, ball.momentum(0.0, ball.start), 0.0
    for i in range(steps):
        t = i * dt
        k1 = ball.rate(t, state)
        k2 = ball.rate(t + dt / 2, state + dt / 2 * k1)
        k3 = ball.rate(t + dt / 2, state + dt / 2 * k2)
        k4 = ball.rate(t + dt, state + dt * k3)
        state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        lost = float(np.linalg.norm(ball.momentum(t + dt, state) - M))
        if not np.isfinite(lost):
            return np.inf
        worst = max(worst, lost)
    return worst


def _parts(state: Array) -> tuple[Vector, Quaternion]:
    p, q, r, w, x, y, z = state.tolist()
    return (p, q, r), (w, x, y, z)


def _turned(axis: Vector, angle: float, v: Vector) -> Vector:
    """v turned about a unit axis by Rodrigues' formula."""
    along = (1 - np.cos(angle)) * eq.dot(axis, v)
    across = eq.scale(np.sin(angle), eq.cross(axis, v))
    return eq.add(eq.add(eq.scale(np.cos(angle), v), across), eq.scale(along, axis))
