"""What is known of a run before it, and how near it is to a limit."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball import equations as eq
from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.hinges import Hinge, hinges_of
from robotball.engines.mujoco.start_look import StartLook, look_at_start
from robotball.loads import loads_of
from robotball.motion import Loads
from robotball.motors import Servo
from robotball.parameters import Parameters, as_vector
from robotball.rotations import Array, multiply, rotation_matrix

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
