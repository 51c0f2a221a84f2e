"""What settings come to in a model of a scene: MuJoCo's own numbers where they leave it open."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import mujoco
import numpy as np

from robotball.engines.mujoco.integrators import INTEGRATORS, MUJOCOS_DEFAULT, Integrator
from robotball.engines.mujoco.load import on_load
from robotball.engines.mujoco.settings import Settings
from robotball.scene import Scene

CONES = ("pyramidal", "elliptic")
SOLVERS = ("PGS", "CG", "Newton")


@cache
def _mujocos_own() -> tuple[Any, Any]:
    """MuJoCo's own option and contact pair, for what the settings leave open."""
    return mujoco.MjModel.from_xml_string("<mujoco/>").opt, mujoco.MjSpec().default.pair


@dataclass(frozen=True)
class Chosen:
    """A scene under settings: every number that a model of it has, whoever chose it."""

    scene: Scene
    settings: Settings  # BY_LOAD is given, and replaced by what the scene's load makes of it

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", on_load(self.settings, self.scene))

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
        """d of a contact pressed in beyond the width of its impedance, as far as MuJoCo goes."""
        most = (self.settings.solimp or _mujocos_own()[1].solimp)[1]
        return float(np.clip(most, mujoco.mjMINIMP, mujoco.mjMAXIMP))

    @property
    def condim(self) -> int:
        """The contact's dimension: how many directions of force and torque it has."""
        if self.settings.condim is not None:
            return self.settings.condim
        return 4 if self.scene.rolling == "rubber" else 3

    @property
    def friction(self) -> tuple[float, float, float]:
        """The coefficients: sliding, torsional [m] and rolling [m]."""
        own, settings = self.scene.friction, self.settings
        slide = settings.sliding_friction if own.sliding is None else own.sliding
        spin = settings.torsional_friction_of(self.scene.ball.radius)
        if own.torsional is not None:
            spin = own.torsional
        return slide, spin, settings.rolling_friction

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

    @property
    def equilibrium_depth(self) -> float:
        """p = g (1 - d)/(d² k) [m], where a contact of impedance d carries the weight at rest."""
        d, (stiffness, _) = self.impedance, self.normal_reference
        if stiffness == 0:
            return np.inf
        weight = -self.scene.gravity_world[2]
        return self.settings.softness * weight * (1 - d) / (d * d * stiffness)
