"""A run as it is planned: the numbers from which its limits are predicted, before any step.

They follow from the paper's equations where these describe the scene. Where they do not, and where
a law is too rough, the numbers come from short trials, which are loaded only then.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball import equations as eq
from robotball.drives import Free, PositionServo, Servo
from robotball.engines.mujoco.model import ModelHinge, hinges_of
from robotball.engines.mujoco.settings import Chosen
from robotball.equations import Parameters, as_vector
from robotball.motion import Loads, loads_of
from robotball.rotations import Array, multiply, rotation_matrix


@dataclass(frozen=True)
class CostModel:
    """Error and cost of each family of steps, fitted to the catalog and 30 random balls, 10 s each.

    The rate is `scene_rate`. `python -m validation.bench.cost_model` fits the numbers again and
    prints how far scenes scatter about them.
    """

    # A path error goes at least with this power of the timestep and of rtol.
    order: float = 3.8
    rtol_order: float = 0.85
    # DOP853's error over rtol, estimated from the change of its M, is
    # gain * (RK4's error / (rate * timestep)^4)^power, within a factor of 3 for most scenes.
    gain: float = 400.0
    power: float = 0.64
    # DOP853 takes density * rate * duration * (1e-11 / rtol)^growth steps.
    density: float = 2.95
    growth: float = 0.12
    # Seconds: a step of RK4, a step of DOP853, a sample between its steps; and of controls that
    # change in time, at each evaluation of the forces.
    step: float = 17e-6
    adaptive_step: float = 250e-6
    sample: float = 27e-6
    control: float = 8e-6

    def steps_per_second(self, rate: float, rtol: float) -> float:
        """Return the number of steps that DOP853 takes in a simulated second."""
        return self.density * rate * (1e-11 / rtol) ** self.growth


COST_MODEL = CostModel()


@dataclass(frozen=True)
class LimitCheck:
    """A number of a planned run and the limit beyond which the run is predicted to fail.

    what   the number's name; value and limit are in `unit`
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
        """The used part of the limit: 1 is at the limit, more is beyond it."""
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


DRIVES_SEEN = 9  # times over the run at which drives that change are evaluated


@dataclass(frozen=True)
class PlannedRun(Chosen):
    """A scene under settings over a duration [s], with the numbers that limits are predicted from.

    known_loads: those of the whole motion; where they are None, the start's are taken.
    """

    duration: float
    known_loads: Loads | None = None

    @property
    def reduced(self) -> bool:
        """Whether (3.2) or (3.3) describes the motion, but for the errors of the servos' rates.

        The numbers of any other ball are measured on MuJoCo's own model, at its start.
        """
        scene = self.scene
        kept = all(motor is None or isinstance(motor, Servo) for motor in scene.motors)
        return scene.keeps_momentum and kept and not scene.ball.pendulums

    @cached_property
    def hinges(self) -> tuple[ModelHinge, ...]:
        """The hinges of the model."""
        return hinges_of(self.scene, self.settings)

    @cached_property
    def start_trial(self) -> tuple[Loads, Array]:
        """The start's loads and eigenvalues, measured on MuJoCo's own model."""
        from robotball.engines.mujoco.trials import linearised_start

        return linearised_start(self.scene, self.settings)

    @cached_property
    def servo_rate(self) -> float:
        """|λ| [1/s], the largest of the hinges' motors; 0 without a motor that settles."""
        motors = [each.actuation for each in self.hinges]
        if not any(isinstance(each, Servo | PositionServo | Free) for each in motors):
            return 0.0
        from robotball.engines.mujoco.trials import fastest_rate

        return fastest_rate(self.scene, self.hinges)

    @cached_property
    def measured_loss(self) -> float:
        """The largest change of M over the scene's scale that RK4 makes by the end of the run."""
        from robotball.engines.mujoco.trials import momentum_loss

        turning = self.angular_velocity - self.Omega
        return momentum_loss(self.scene, turning, self.timestep, self.duration)

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
        """The whole motion's loads where they are known, else the start's."""
        if self.known_loads is not None:
            return self.known_loads
        if not self.reduced:
            return self.start_trial[0]
        return loads_of(self.scene, np.zeros(1), self.axes[None], self.angular_velocity[None])

    @cached_property
    def rolling_velocity(self) -> Array:
        """(3,): of the ball's centre at the start, principal axes [m/s]."""
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
            frame = [h.largest_rate for h in self.hinges if h.index == 0 and h.follows_rate]
            size = float(np.linalg.norm(self.angular_velocity))
            return max(size, *frame, float(np.abs(self.start_trial[1].imag).max()))
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


Prediction = Callable[[PlannedRun], LimitCheck | None]
"""A planned run → its check against one limit; None where the limit does not apply."""
Laws = dict[Prediction, str]
