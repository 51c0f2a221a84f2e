"""Settings of a MuJoCo run, and the presets: every number of the recipe, once."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple

from robotball.engines.dop853 import LEAST_RTOL
from robotball.engines.mujoco.integrators import ADAPTIVE, INTEGRATORS
from robotball.errors import LARGEST, InputError, check_positive, is_number
from robotball.motors import Servo
from robotball.settings import EngineSettings, preset_named

BY_LOAD: Any = "by load"
MOST_STEPS = 10_000_000  # 1e5 s at 20 ms are half of it


@dataclass(frozen=True)
class Prescribed:
    """Hinges that keep their rates by a huge reflected inertia [kg m²], with no actuator."""

    armature: float

    def __post_init__(self) -> None:
        check_positive("the armature", self.armature, "kg m²")


@dataclass(frozen=True)
class Radii:
    """A length in radii of the ball, which so goes with the ball's size."""

    radii: float


# The recipe's values for a constant load; load.py has those for a varying one.
CONSTANT: dict[str, Any] = {
    "solver": "PGS",
    "iterations": 3,
    # At least twice every timestep, or MuJoCo would raise it in silence.
    "solref": (0.04, 1.0),
    "softness": 1.0,
    "sliding_friction": 20.0,
    "torsional_friction": Radii(20.0),
    "drive": Prescribed(armature=1e14),
}


@dataclass(frozen=True, kw_only=True)
class Settings(EngineSettings):
    """How MuJoCo is to run a scene; None leaves a choice at MuJoCo's own default.

    The integrator is one of MuJoCo's, or DOP853: scipy's, of order 8, driving MuJoCo's forward
    dynamics in steps whose error it holds to rtol and which are no longer than the timestep, if
    there is one. BY_LOAD, for any value of CONSTANT, leaves it to the recipe for the scene's load;
    every other value runs as it is. Raises InputError for what MuJoCo or scipy would refuse, or
    would replace in silence.
    """

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
    torsional_friction: float | Radii = 0.005  # m, MuJoCo's default
    rolling_friction: float = 1e-4  # m, MuJoCo's default; in force where condim is 6
    # The body with the free joint; the other one hangs on it by the frame's hinge.
    root: Literal["shell", "frame"] = "shell"
    # Start at the depth at which the contact carries the weight, with the lever arm exactly a;
    # False starts just touching.
    start_in_equilibrium: bool = False
    # Times the softness of the contact's constraint; set once the model is compiled, for MJCF has
    # no word for it.
    softness: float = 1.0
    max_steps: int = MOST_STEPS  # of a run; a longer one is refused or, if adaptive, stopped
    drive: Servo | Prescribed

    def __post_init__(self) -> None:
        left_open = {each.name for each in fields(self) if each.default is None}
        for name, rule in RULES.items():
            value = getattr(self, name)
            left = name in CONSTANT and isinstance(value, str) and value == BY_LOAD
            if left or (value is None and name in left_open):
                continue
            if not rule.allows(value):
                raise InputError(f"{name} must be {rule.words}, not {value!r}")
            object.__setattr__(self, name, rule.plain(value))
        if self.adaptive and self.rtol is None:
            raise InputError(f"{ADAPTIVE} needs an rtol, the error allowed in one step, as 1e-13")

    def torsional_friction_of(self, radius: float) -> float:
        """Of a ball of this radius [m]: the coefficient [m]."""
        given = self.torsional_friction
        return given.radii * radius if isinstance(given, Radii) else given

    @property
    def adaptive(self) -> bool:
        """Whether the steps are chosen by their error, not by the timestep alone."""
        return self.integrator == ADAPTIVE


class Rule(NamedTuple):
    """What a value of a field has to satisfy, how that is said, and the value as plain data."""

    fits: Callable[[Any], bool]
    words: str
    plain: Callable[[Any], Any] = lambda value: value

    def allows(self, value: Any) -> bool:
        try:
            return bool(self.fits(value))
        except (TypeError, ValueError, OverflowError):  # of another type altogether
            return False


def _numbers(value: Any) -> tuple[float, ...]:
    return tuple(map(float, value))


def _not_huge(*values: float) -> bool:
    return all(is_number(value) and abs(value) <= LARGEST for value in values)  # NaN is not


def _positive(value: float) -> bool:
    return is_number(value) and 1 / LARGEST <= value <= LARGEST


def _not_negative(value: float) -> bool:
    return is_number(value) and 0 <= value <= LARGEST


def _count(least: int) -> Rule:
    return Rule(
        lambda value: is_number(value) and int(value) == value and least <= value < 2**31,
        f"a whole number, {least} at least",
        int,
    )


def _one_of(*names: Any) -> Rule:
    return Rule(
        lambda value: isinstance(value, Hashable) and value in names,
        f"one of {', '.join(map(str, names))}",
        lambda value: names[names.index(value)],
    )


def _reference(value: tuple[float, float]) -> bool:
    """Both positive (time constant, damping ratio), or both not (-stiffness, -damping)."""
    first, second = value
    both = _positive(first) and _positive(second)
    return both or (_not_huge(first, second) and first <= 0 and second <= 0)


def _impedance(value: tuple[float, float, float, float, float]) -> bool:
    least, most, width, midpoint, power = value
    return (
        _not_huge(*value)
        and all(0 < each < 1 for each in (least, most, midpoint))
        and width > 0
        and power >= 1
    )


REFERENCE = Rule(
    _reference,
    "two finite numbers: a positive time constant and ratio, or neither positive",
    _numbers,
)
POSITIVE = Rule(_positive, f"positive and finite, from {1 / LARGEST:g} to {LARGEST:g}", float)
NOT_NEGATIVE = Rule(_not_negative, f"finite and not negative, {LARGEST:g} at most", float)
# What is not None must fit; MuJoCo's own choices are named as it names them.
RULES = {
    "name": Rule(lambda value: isinstance(value, str) and "\0" not in value, "a text"),
    "error_tolerance": POSITIVE,
    "accuracy": POSITIVE,
    "timestep": POSITIVE._replace(words=f"{POSITIVE.words} s"),
    "integrator": _one_of(*INTEGRATORS),
    "rtol": Rule(
        lambda value: is_number(value) and LEAST_RTOL <= value <= LARGEST,
        f"finite and {LEAST_RTOL:g} at least",
        float,
    ),
    "solver": _one_of("PGS", "CG", "Newton"),
    "jacobian": _one_of("dense", "sparse", "auto"),
    "iterations": _count(1),
    "tolerance": NOT_NEGATIVE,
    "ls_tolerance": NOT_NEGATIVE,
    "noslip_iterations": _count(0),
    "noslip_tolerance": NOT_NEGATIVE,
    "cone": _one_of("pyramidal", "elliptic"),
    "impratio": POSITIVE,
    "warmstart": _one_of("enable", "disable"),
    "island": _one_of("enable", "disable"),
    "solref": REFERENCE,
    "solreffriction": REFERENCE,
    "solimp": Rule(
        _impedance,
        "dmin, dmax, width, midpoint, power: the first two and the "
        "midpoint between 0 and 1, the width positive, the power 1 at least",
        _numbers,
    ),
    "condim": _one_of(3, 4, 6),
    "sliding_friction": NOT_NEGATIVE,
    "torsional_friction": Rule(
        lambda value: _not_negative(value.radii if isinstance(value, Radii) else value),
        f"{NOT_NEGATIVE.words}, or Radii of such a number",
        lambda value: value if isinstance(value, Radii) else float(value),
    ),
    "rolling_friction": NOT_NEGATIVE,
    "root": _one_of("shell", "frame"),
    "start_in_equilibrium": _one_of(True, False),
    "stop_at_fault": _one_of(True, False),
    "softness": POSITIVE,
    "max_steps": _count(1),
    "drive": Rule(lambda value: isinstance(value, Servo | Prescribed), "a Servo or Prescribed"),
}
# It is there to show how wrong a newcomer's model gets, so it goes on.
NAIVE = Settings(name="naive", error_tolerance=1e-2, stop_at_fault=False, drive=Servo(gain=10.0))


def recipe(name: str, error_tolerance: float, **steps: Any) -> Settings:
    """What makes MuJoCo roll as the equations do, to the error of its steps.

    steps: the fields timestep, integrator and rtol; the integrator is RK4 if not given.
    """
    return Settings(
        name=name,
        error_tolerance=error_tolerance,
        **{"integrator": "RK4", **steps},
        jacobian="dense",
        tolerance=0.0,
        ls_tolerance=0.01,
        noslip_iterations=1,
        noslip_tolerance=0.0,
        cone="elliptic",
        warmstart="disable",
        # One contact is one island; the search for others would take a twelfth of a step.
        island="disable",
        solimp=(0.9999, 0.9999, 0.001, 0.5, 1.0),
        # Slip decays at a fixed rate 1/s; tied to 1/timestep it would cost an order.
        solreffriction=(-1.0, -0.5),
        start_in_equilibrium=True,
        **dict.fromkeys(CONSTANT, BY_LOAD),
    )


PRESETS: dict[str, Settings] = {
    settings.name: settings
    for settings in (
        NAIVE,
        recipe("fast", 5e-4, timestep=20e-3),
        recipe("balanced", 5e-6, timestep=5e-3),
        recipe("accurate", 1e-8, timestep=1e-3),
        recipe("adaptive", 1e-11, integrator=ADAPTIVE, rtol=LEAST_RTOL),
    )
}


def preset(name: str) -> Settings:
    """The named preset; raises InputError with the near matches where there is none."""
    return preset_named(PRESETS, name)


FORMER_NAMES = {"promise": "error_tolerance"}


def settings_from(plain: Mapping[str, Any]) -> Settings:
    """The settings of plain data, as `Settings.plain` or JSON gives it.

    Raises InputError for an unknown key and where a value is missing or does not fit.
    """
    values: dict[str, Any] = {
        FORMER_NAMES.get(key, key): tuple(value) if isinstance(value, list) else value
        for key, value in plain.items()
    }
    try:
        values.pop("fits_load", None)  # of former files, whose other values are whole
        if isinstance(drive := values["drive"], Mapping):
            values["drive"] = Servo(**drive) if "gain" in drive else Prescribed(**drive)
        if isinstance(spin := values.get("torsional_friction"), Mapping):
            values["torsional_friction"] = Radii(**spin)
        return Settings(**values)
    except (TypeError, KeyError) as error:
        raise InputError(f"these are no settings of a run: {error}") from None
