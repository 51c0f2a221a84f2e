"""Settings of a MuJoCo run, and the presets: every number of the recipe, once."""

import difflib
from dataclasses import dataclass

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
    held to over 10 s on the scenes of the catalog; every other field goes into the MJCF.
    """

    name: str
    promise: float
    timestep: float | None = None  # s
    integrator: str | None = None
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
    solref: tuple[float, float] | None = None
    solimp: tuple[float, float, float, float, float] | None = None
    solreffriction: tuple[float, float] | None = None
    sliding_friction: float = 1.0  # MuJoCo's default
    torsional_friction: float = 0.005  # m, MuJoCo's default
    # Start at the depth at which the contact carries the weight, with the lever arm exactly a;
    # False starts just touching.
    start_in_equilibrium: bool = False
    drive: Servo | Prescribed


NAIVE = Settings(name="naive", promise=1e-2, drive=Servo(gain=10.0))


def _recipe(name: str, timestep: float, promise: float) -> Settings:
    return Settings(
        name=name,
        promise=promise,
        timestep=timestep,
        integrator="RK4",
        solver="PGS",
        jacobian="dense",
        iterations=3,
        tolerance=0.0,
        ls_tolerance=0.01,
        noslip_iterations=1,
        noslip_tolerance=0.0,
        cone="elliptic",
        warmstart="disable",
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
        _recipe("fast", timestep=20e-3, promise=5e-4),
        _recipe("balanced", timestep=5e-3, promise=5e-6),
        _recipe("accurate", timestep=1e-3, promise=1e-8),
    )
}


def preset(name: str) -> Settings:
    """The named preset; raises InputError with the near matches where there is none."""
    if name in PRESETS:
        return PRESETS[name]
    near = difflib.get_close_matches(name, PRESETS)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(PRESETS)}"
    raise InputError(f"no preset is called {name!r}; {hint}")
