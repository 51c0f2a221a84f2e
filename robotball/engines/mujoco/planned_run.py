"""What is known of a run before it, and how near it is to a limit."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import mujoco
import numpy as np

from robotball import equations as eq
from robotball.bodies import imbalance
from robotball.drives import turns
from robotball.engines.mujoco.integrators import INTEGRATORS, MUJOCOS_DEFAULT, Integrator
from robotball.engines.mujoco.settings import Settings
from robotball.loads import loads_of
from robotball.motion import Loads
from robotball.motors import Servo
from robotball.parameters import Parameters, as_vector
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Scene


@cache
def _mujocos_own() -> tuple[Any, Any]:
    """MuJoCo's own option and contact pair, for what the settings leave open."""
    return mujoco.MjModel.from_xml_string("<mujoco/>").opt, mujoco.MjSpec().default.pair


DRIVES_SEEN = 9  # times over the run at which drives in time are looked at
CONES = ("pyramidal", "elliptic")
SOLVERS = ("PGS", "CG", "Newton")


@dataclass(frozen=True)
class PlannedRun:
    """A scene under settings over a duration [s], as the predictions of its limits see it.

    loads: those of the whole motion where they are known, else the start's alone are.
    """

    scene: Scene
    settings: Settings
    duration: float
    known_loads: Loads | None = None

    # What the settings come to -----------------------------------------------------------

    @property
    def integrator(self) -> Integrator:
        return INTEGRATORS[self.settings.integrator or MUJOCOS_DEFAULT]

    @property
    def timestep(self) -> float:
        """The longest step [s]; infinite where the steps are chosen by their error alone."""
        if self.settings.timestep is None and self.settings.adaptive:
            return np.inf
        return float(self._option("timestep"))

    @property
    def cone(self) -> str:
        return self.settings.cone or CONES[self._option("cone")]

    @property
    def solver(self) -> str:
        return self.settings.solver or SOLVERS[self._option("solver")]

    @property
    def tolerance(self) -> float:
        return float(self._option("tolerance"))

    @property
    def impratio(self) -> float:
        return float(self._option("impratio"))

    @property
    def noslip(self) -> bool:
        """Whether friction is solved once more without its softness."""
        return bool(self._option("noslip_iterations"))

    @property
    def solref(self) -> tuple[float, float]:
        first, second = self.settings.solref or _mujocos_own()[1].solref
        return float(first), float(second)

    @property
    def impedance(self) -> float:
        """d of a contact pressed in beyond the width of its impedance."""
        return float((self.settings.solimp or _mujocos_own()[1].solimp)[1])

    @property
    def condim(self) -> int:
        return self.settings.condim or self.needed_condim

    @property
    def torsional_friction(self) -> float:
        """The coefficient [m]."""
        return self.settings.torsional_friction_of(self.scene.ball.radius)

    @property
    def needed_condim(self) -> int:
        return 4 if self.scene.rolling == "rubber" else 3

    def _option(self, name: str) -> Any:
        value = getattr(self.settings, name, None)
        return getattr(_mujocos_own()[0], name) if value is None else value

    @cached_property
    def normal_reference(self) -> tuple[float, float]:
        """Stiffness [1/s²] and damping [1/s] of the contact's spring, from solref."""
        return self._reference(self.solref)

    @cached_property
    def friction_damping(self) -> float:
        """b [1/s]: the rate at which slip dies out; solref's where solreffriction is not heard."""
        given = self.settings.solreffriction
        heard = given is not None and any(given) and self.cone == "elliptic"
        return self._reference(given if heard and given else self.solref)[1]

    def _reference(self, solref: tuple[float, float]) -> tuple[float, float]:
        first, second = solref
        if first <= 0:
            return -first / self.impedance**2, -second / self.impedance
        # refsafe: never shorter than two steps.
        constant = max(first, 2 * self.timestep) if np.isfinite(self.timestep) else first
        return (
            1 / (self.impedance * constant * second) ** 2,
            2 / (self.impedance * constant),
        )

    @cached_property
    def servos(self) -> tuple[tuple[int, Servo], ...]:
        """(index among the drives, servo) of the hinges that a servo turns."""
        scene = self.scene
        motors = scene.motors or (None,) * len(scene.drives)
        return tuple(
            (i, by)
            for i, (drive, motor) in enumerate(zip(scene.drives, motors, strict=True))
            if isinstance(by := motor or self.settings.drive, Servo) and (motor or turns(drive))
        )

    # What the scene asks -----------------------------------------------------------------

    @cached_property
    def balanced(self) -> bool:
        """Whether there are equations to tell what the ball does."""
        return imbalance(self.scene.ball) is None

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

    @cached_property
    def loads(self) -> Loads:
        """Of the whole motion where they are known, else of the start."""
        if self.known_loads is not None:
            return self.known_loads
        return loads_of(self.scene, np.zeros(1), self.axes[None], self.angular_velocity[None])

    @cached_property
    def rolling_velocity(self) -> Array:
        """(3,): of the ball's centre at the start, principal axes [m/s]."""
        turning = self.angular_velocity - np.array(self.parameters.Omega)
        return self.scene.ball.radius * np.cross(turning, self.axes[2])

    @cached_property
    def rotation_rate(self) -> float:
        """r [rad/s]: the fastest that anything turns which an integrator has to follow.

        ω itself, about which all vectors turn in the frame, and the eigenvalues of ∂(dω/dt)/∂ω
        from (2.4), (2.5): the nutation, of about |A K| where fast rotors rule. The rotors' own
        rates don't count: their hinges turn evenly. At the start's attitude, with the drives as
        they are at a few times.
        """
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
