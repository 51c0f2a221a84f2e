"""Settings of a MuJoCo run, and the presets: every number of the recipe, once."""

import difflib
from dataclasses import dataclass
from typing import Any, Literal

from robotball.drives import Servo
from robotball.errors import InputError


@dataclass(frozen=True)
class Prescribed:
    """Hinges that keep their rates by a huge reflected inertia [kg m²], with no actuator."""

    armature: float


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How MuJoCo is to run a scene; None leaves a choice at MuJoCo's own default.

    promise is the largest path error and momentum drift, both relative, that the settings are
    held to over 10 s on the scenes of the catalog. The integrator is one of MuJoCo's, or DOP853:
    scipy's, of order 8, driving MuJoCo's forward dynamics in steps whose error it holds to rtol
    and which are no longer than the timestep, if there is one. The rest goes into the MJCF.
    """

    name: str
    promise: float
    timestep: float | None = None  # s
    integrator: str | None = None
    rtol: float | None = None  # DOP853's alone: the error allowed in one step, relative
    solver: str | None = None
    jacobian: str | None = None
    iterations: int | None = None
    tolerance: float | None = None
    ls_tolerance: float | None = None
    noslip_iterations: int | None = None
    noslip_tolerance: float | None = None
    cone: str | None = None
    impratio: float | None = None
    warmstart: str | None = None
    island: str | None = None
    solref: tuple[float, float] | None = None
    solimp: tuple[float, float, float, float, float] | None = None
    solreffriction: tuple[float, float] | None = None
    # The contact's dimension; None is what the rolling model needs: 4 for rubber, 3 for classical.
    condim: int | None = None
    sliding_friction: float = 1.0  # MuJoCo's default
    torsional_friction: float = 0.005  # m, MuJoCo's default
    rolling_friction: float = 1e-4  # m, MuJoCo's default; in force where condim is 6
    # The body with the free joint; the other one hangs on it by the frame's hinge.
    root: Literal["shell", "frame"] = "shell"
    # Start at the depth at which the contact carries the weight, with the lever arm exactly a;
    # False starts just touching.
    start_in_equilibrium: bool = False
    drive: Servo | Prescribed

    @property
    def adaptive(self) -> bool:
        """Whether the steps are chosen by their error, not by the timestep alone."""
        return self.integrator == ADAPTIVE


ADAPTIVE = "DOP853"
NAIVE = Settings(name="naive", promise=1e-2, drive=Servo(gain=10.0))


def recipe(name: str, promise: float, **steps: Any) -> Settings:
    """What makes MuJoCo roll as the equations do, to the error of its steps.

    steps: the fields timestep, integrator and rtol; the integrator is RK4 if not given.
    """
    return Settings(
        name=name,
        promise=promise,
        **{"integrator": "RK4", **steps},
        solver="PGS",
        jacobian="dense",
        iterations=3,
        tolerance=0.0,
        ls_tolerance=0.01,
        noslip_iterations=1,
        noslip_tolerance=0.0,
        cone="elliptic",
        warmstart="disable",
        # One contact is one island; the search for others would take a twelfth of a step.
        island="disable",
        # At least twice every timestep, or MuJoCo would raise it in silence.
        solref=(0.04, 1.0),
        solimp=(0.9999, 0.9999, 0.001, 0.5, 1.0),
        # Slip decays at a fixed rate 1/s; tied to 1/timestep it would cost an order.
        solreffriction=(-1.0, -0.5),
        sliding_friction=20.0,
        torsional_friction=20.0,
        start_in_equilibrium=True,
        drive=Prescribed(armature=1e14),
    )


PRESETS: dict[str, Settings] = {
    settings.name: settings
    for settings in (
        NAIVE,
        recipe("fast", 5e-4, timestep=20e-3),
        recipe("balanced", 5e-6, timestep=5e-3),
        recipe("accurate", 1e-8, timestep=1e-3),
        recipe("adaptive", 1e-10, integrator=ADAPTIVE, rtol=1e-13),
    )
}


def preset(name: str) -> Settings:
    """The named preset; raises InputError with the near matches where there is none."""
    if name in PRESETS:
        return PRESETS[name]
    near = difflib.get_close_matches(name, PRESETS)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(PRESETS)}"
    raise InputError(f"no preset is called {name!r}; {hint}")
