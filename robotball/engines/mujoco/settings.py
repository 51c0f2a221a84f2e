"""Settings of a MuJoCo run: integrators, checks, presets, and the recipes for the contact.

A recipe is a set of values for the contact and the drive. The ball sinks into the contact to a
depth that depends on the load. Under a constant load the initial depth stays correct, however soft
the contact; the recipe is CONSTANT. Under a varying load the ball's centre rises and sinks, which
changes the lever arm. If the centre of mass is not the sphere's centre, the normal force is also
coupled with friction, and three iterations of PGS do not solve for the two forces; the recipe is
VARYING. With these two recipes a slip of the ball decays slowly, so the recipe for a motion that
exceeds the scene's friction is `for_slip`. `Resolved` chooses one of the three. A setting that is
None keeps MuJoCo's default.
"""

from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, cached_property
from types import NoneType
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin, get_type_hints

import msgspec
import mujoco
import numpy as np
from msgspec import Meta

from robotball.engines.equations import slips
from robotball.errors import LARGEST, InputError, check_positive
from robotball.motion import EngineSettings, preset_named
from robotball.robot.motors import Servo
from robotball.robot.scene import Scene

_RK4_REAL, _RK4_IMAGINARY = 2.785, 2.828  # where |1 + z + z²/2 + z³/6 + z⁴/24| = 1 on the axes
_RK8_REAL, _RK8_IMAGINARY = 6.39, 5.96
_EXPLICIT_REAL = 2.0  # where |1 - z| = 1


@dataclass(frozen=True)
class _Integrator:
    """An integrator of MuJoCo, or ours of order 8, with its limits of stability.

    A limit is the largest stable product of a rate and the timestep. The rate is that of a
    rotation, of the decay of slip, or of a servo (its gain divided by inertia); limits.py has the
    measurements. momentum_loss (p, f): a step with the rotation θ changes |M| by the fraction f θᵖ.
    stability: the coefficients of R(z), highest power first; a step multiplies y by R(z) if dy/dt =
    z y / dt. marker, size: the symbol in plots.
    """

    name: str
    order: int
    rotation_limit: float | None
    friction_limit: float | None
    servo_limit: float | None
    momentum_loss: tuple[int, float]
    marker: str
    size: float = 6.0
    stability: tuple[float, ...] = ()


# One step on dy/dt = i r y multiplies |y| by |1 + iθ| = 1 + θ²/2 at first order, θ = r dt, and by
# 1 - θ⁶/144 under RK4, by 1 - 2.4e-8 θ¹⁰ under RK8.
_ONE_TO_FOUR = (1 / 24, 1 / 6, 1 / 2, 1.0, 1.0)
_TWELVE = (
    *(3.613324578128e-10, 1.494736485459e-8, 2.341345108210e-7, 2.691692200169e-6),
    *(1 / 40320, 1 / 5040, 1 / 720, 1 / 120),
)
_FIRST, _FOURTH, _EIGHTH = (2, 1 / 2), (6, 1 / 144), (10, 2.4e-8)
ORDER_8 = "RK8"
INTEGRATORS = {
    integrator.name: integrator
    for integrator in (
        _Integrator("Euler", 1, None, _EXPLICIT_REAL, _EXPLICIT_REAL, _FIRST, "o", 11.0),
        _Integrator("implicit", 1, None, _EXPLICIT_REAL, None, _FIRST, "v"),
        _Integrator("implicitfast", 1, None, _EXPLICIT_REAL, None, _FIRST, "s"),
        _Integrator("discrete", 1, None, None, _EXPLICIT_REAL, _FIRST, "x", 4.0),
        _Integrator(
            "RK4", 4, _RK4_IMAGINARY, _RK4_REAL, _RK4_REAL, _FOURTH, "D", stability=_ONE_TO_FOUR
        ),
        _Integrator(
            *(ORDER_8, 8, _RK8_IMAGINARY, _RK8_REAL, _RK8_REAL, _EIGHTH, "*", 9.0),
            stability=_TWELVE + _ONE_TO_FOUR,
        ),
    )
}
OWN = tuple(name for name in INTEGRATORS if name != ORDER_8)
FIRST_ORDER = tuple(name for name, integrator in INTEGRATORS.items() if integrator.order == 1)
MUJOCOS_DEFAULT = "Euler"


def _one_of(*names: str) -> Meta:
    return Meta(pattern=f"^({'|'.join(names)})$", description=f"one of {', '.join(names)}")


# Types of the fields. msgspec checks their bounds, and error messages quote their descriptions.
# With LARGEST as their bound, a product of a few fields does not overflow.
_FROM_TO = f"a number from {1 / LARGEST:g} to {LARGEST:g}"
_Positive = Annotated[float, Meta(ge=1 / LARGEST, le=LARGEST, description=_FROM_TO)]
_NotNegative = Annotated[
    float, Meta(ge=0, le=LARGEST, description=f"a number from 0 to {LARGEST:g}")
]
# MuJoCo's counters have 32 bits.
_Count = Annotated[int, Meta(ge=0, lt=2**31, description="a whole number of at least 0")]
_AtLeastOne = Annotated[int, Meta(ge=1, lt=2**31, description="a whole number of at least 1")]
_Reference = Annotated[
    tuple[float, float],
    Meta(description="two finite numbers, both positive (time constant, ratio) or neither"),
]
_Inside = Annotated[float, Meta(gt=0, lt=1)]
_Width = Annotated[float, Meta(gt=0, le=LARGEST)]
_Power = Annotated[float, Meta(ge=1, le=LARGEST)]
_Impedance = Annotated[
    tuple[_Inside, _Inside, _Width, _Inside, _Power],
    Meta(
        description="(dmin, dmax, width, midpoint, power), with dmin, dmax and midpoint between 0 "
        "and 1, width above 0 and power at least 1"
    ),
]


def _checked(name: str, value: Any, kind: Any) -> Any:
    """Return a field's value as plain data. Raises InputError if `kind` forbids it."""
    if is_dataclass(value) and type(value) in get_args(kind):
        return value  # checked when it was made
    try:
        return msgspec.convert(_plain(value), kind)
    # msgspec raises TypeError for a drive that is neither a Servo nor Prescribed.
    except (msgspec.ValidationError, TypeError):
        raise InputError(f"{name} must be {_allowed(kind)}, not {value!r}") from None


def _plain(value: Any) -> Any:
    """Convert NumPy numbers to Python numbers, which msgspec requires."""
    if isinstance(value, tuple | list | np.ndarray):
        return tuple(map(_plain, value))
    number = value.item() if isinstance(value, np.generic) else value
    # msgspec converts an int to a float field, but not 3.0 to an int field.
    whole = isinstance(number, float) and number.is_integer() and abs(number) < 2**31
    return int(number) if whole else number


def _allowed(kind: Any) -> str:
    """Describe the values that a field's type allows."""
    if get_origin(kind) is Annotated:
        return str(kind.__metadata__[0].description)
    if get_origin(kind) is Literal:
        return f"one of {', '.join(map(str, get_args(kind)))}"
    members = [member for member in get_args(kind) if member is not NoneType]
    return " or ".join(map(_allowed, members)) or f"a {kind.__name__}"


def _is_reference(value: tuple[float, float]) -> bool:
    """Return whether both numbers are positive, or neither is.

    These are the two formats of MuJoCo's solref: (time constant, damping ratio) and (-stiffness,
    -damping).
    """
    positive = all(1 / LARGEST <= number <= LARGEST for number in value)
    return positive or all(-LARGEST <= number <= 0 for number in value)


_BY_LOAD: Any = "by load"
MOST_STEPS = 10_000_000  # 2e5 s at 20 ms


@dataclass(frozen=True)
class Prescribed:
    """Hinges whose reflected inertia [kg m²] is so large that no load changes their rates.

    The armature acts on the hinge alone and adds no gyroscopic momentum, so the ball rolls as it
    would without the armature. A velocity servo with kv = 100 under RK4 has a path error of 5e-3.
    """

    armature: float
    follows_rate: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_positive("the armature", self.armature, "kg m²")


@dataclass(frozen=True)
class Radii:
    """A length in radii of the ball, so that it scales with the ball."""

    radii: _NotNegative

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", _checked("radii", self.radii, _NotNegative))


# The recipe's values for a constant load.
CONSTANT: dict[str, Any] = {
    # Newton gives the same motion and takes 1.9 times as long per evaluation of the forces.
    "solver": "PGS",
    "iterations": 3,
    # MuJoCo raises a time constant below two timesteps to two timesteps, without a warning, so a
    # sweep of the timestep would change the contact. 0.04 s is twice the 20 ms of the preset
    # "fast".
    "solref": (0.04, 1.0),
    "softness": 1.0,
    # At g = 9.81 motions need a sliding friction of 0.2 to 1.6 and a torsional friction of up to 6
    # m. MuJoCo does not warn if the friction cone is saturated.
    "sliding_friction": 20.0,
    "torsional_friction": Radii(20.0),
    # The path error is proportional to the load divided by the armature: it is 5e-9 at 1e8, and
    # rounding dominates from 1e12 on.
    "drive": Prescribed(armature=1e14),
}


@dataclass(frozen=True, kw_only=True)
class Settings(EngineSettings):
    """Settings of a MuJoCo run.

    Fields have the names of MJCF, and a field that is None keeps MuJoCo's default. In every preset
    except "naive" the values for the contact and the drive depend on the scene's load. Values that
    you give are used unchanged.

    Attributes
    ----------
    name : str
        The name of the settings, for tables and files.
    error_tolerance : float
        The largest relative path error and momentum error that the settings may have, over 10 s on
        the scenes of the catalog.
    accuracy : float or None
        The path error that the settings were chosen for. None if they were not chosen for one.
    stop_at_fault : bool
        Whether a run ends at its first fault. If False, the run continues as long as the ball has a
        state.
    timestep : float or None, s
        The length of a step. For RK8 it is the longest step; RK8 takes shorter steps if rotations
        or servos are fast.
    integrator : str or None
        One of MuJoCo's integrators, or "RK8", which takes steps of order 8 over MuJoCo's forward
        dynamics.
    solver : {"PGS", "CG", "Newton"} or None
        The constraint solver.
    jacobian : {"dense", "sparse", "auto"} or None
        The storage of the constraint Jacobian.
    iterations : int or None
        The largest number of iterations of the solver.
    tolerance : float or None
        The improvement below which the solver stops.
    ls_tolerance : float or None
        The tolerance of the solver's line search.
    noslip_iterations : int or None
        The number of iterations of the noslip solver.
    noslip_tolerance : float or None
        The improvement below which the noslip solver stops.
    cone : {"pyramidal", "elliptic"} or None
        The shape of the friction cone.
    impratio : float or None
        The ratio of the impedances of friction and normal force, for elliptic cones.
    warmstart : {"enable", "disable"} or None
        Whether the solver starts from the solution of the previous step.
    island : {"enable", "disable"} or None
        Whether MuJoCo looks for groups of constraints that it can solve separately.
    solref : (float, float) or None
        The time constant [s] and damping ratio of the contact, or its stiffness and damping, both
        with a minus sign.
    solimp : tuple of 5 float or None
        The impedance of the contact: dmin, dmax, width, midpoint and power.
    solreffriction : (float, float) or None
        The reference parameters of friction, in either format of `solref`.
    condim : {3, 4, 6} or None
        The dimension of the contact. None chooses 4 for the rubber model of rolling and 3 for the
        classical model.
    sliding_friction : float
        The coefficient of sliding friction.
    torsional_friction : float, m, or Radii
        The coefficient of torsional friction, a length or a multiple of the ball's radius.
    rolling_friction : float, m
        The coefficient of rolling friction. It acts if `condim` is 6.
    root : {"shell", "frame"}
        The body with the free joint. The frame's hinge connects the other body to it.
    start_in_equilibrium : bool
        Whether the ball starts at the depth at which the contact carries its weight. If False, the
        ball just touches the plane at the start.
    softness : float
        A factor on the softness of the contact's constraint. MJCF cannot express this factor.
    slips : bool or None
        True: the contact has the recipe for a ball that slips, and the error is of first order.
        False: the motion does not exceed the scene's friction, so the contact has the larger
        friction of the recipe.
    max_steps : int
        The largest number of steps of a run. A longer run is refused.
    drive : Servo or Prescribed
        How a hinge keeps its given rate.

    Raises
    ------
    InputError
        If MuJoCo would refuse a value, or would replace it without a warning.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import robotball as rb
    >>> finer = replace(rb.preset("fast"), name="finer", timestep=0.01)
    >>> rb.simulate(rb.load_scene("fig12"), 0.5, settings=finer).report.steps
    50
    """

    name: Annotated[str, Meta(pattern=r"^[^\0]*$", description="a text")]
    error_tolerance: _Positive
    accuracy: _Positive | None = None
    timestep: _Positive | None = None  # s
    integrator: Annotated[str, _one_of(*INTEGRATORS)] | None = None
    solver: Annotated[str, _one_of("PGS", "CG", "Newton")] | None = None
    jacobian: Annotated[str, _one_of("dense", "sparse", "auto")] | None = None
    iterations: _AtLeastOne | None = None
    tolerance: _NotNegative | None = None
    ls_tolerance: _NotNegative | None = None
    noslip_iterations: _Count | None = None
    noslip_tolerance: _NotNegative | None = None
    cone: Annotated[str, _one_of("pyramidal", "elliptic")] | None = None
    impratio: _Positive | None = None
    warmstart: Annotated[str, _one_of("enable", "disable")] | None = None
    island: Annotated[str, _one_of("enable", "disable")] | None = None
    solref: _Reference | None = None
    solimp: _Impedance | None = None
    solreffriction: _Reference | None = None
    condim: Literal[3, 4, 6] | None = None
    # These three are MuJoCo's defaults.
    sliding_friction: _NotNegative = 1.0
    torsional_friction: _NotNegative | Radii = 0.005  # m
    rolling_friction: _NotNegative = 1e-4  # m
    root: Literal["shell", "frame"] = "shell"
    start_in_equilibrium: bool = False
    softness: _Positive = 1.0
    slips: bool | None = None
    max_steps: _AtLeastOne = MOST_STEPS
    drive: Servo | Prescribed

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(Settings, include_extras=True).items():
            value = getattr(self, name)
            if name in CONSTANT and isinstance(value, str) and value == _BY_LOAD:
                continue
            object.__setattr__(self, name, _checked(name, value, kind))
            # A msgspec schema cannot require that two numbers have the same sign.
            if _Reference in get_args(kind) and not (value is None or _is_reference(value)):
                raise InputError(f"{name} must be {_allowed(kind)}, not {value!r}")
        if self.integrator == ORDER_8 and self.timestep is None:
            raise InputError(f"{ORDER_8} needs a timestep [s], such as 0.05")

    @property
    def own(self) -> bool:
        """True if an integrator of MuJoCo takes the steps."""
        return self.integrator != ORDER_8


# It shows how wrong a newcomer's model becomes, so a run continues after its first fault.
NAIVE = Settings(name="naive", error_tolerance=1e-2, stop_at_fault=False, drive=Servo(gain=1.0))


def recipe(name: str, error_tolerance: float, **steps: Any) -> Settings:
    """Return settings with which MuJoCo follows the equations up to the error of its steps.

    steps: the fields timestep and integrator. The default integrator is RK4.
    """
    return Settings(
        name=name,
        error_tolerance=error_tolerance,
        # The other integrators are of first order: at 1 ms Euler's path error is 9e-3, RK4's 3e-12.
        **{"integrator": "RK4", **steps},
        # With so few rows a sparse Jacobian takes 10 % longer per evaluation.
        jacobian="dense",
        # Any tolerance above 0 is scaled with the armatures and stops the solver at once.
        tolerance=0.0,
        ls_tolerance=0.01,
        # The softness causes a slip of 1.5e-3 of the path, and one iteration removes this slip.
        noslip_iterations=1,
        noslip_tolerance=0.0,
        # A pyramidal cone ignores solreffriction, and noslip treats the edges of the pyramid
        # separately.
        cone="elliptic",
        # So few iterations need no initial guess. Without a guess a motion depends on its state
        # alone.
        warmstart="disable",
        # One contact is one island; the search for islands would take a twelfth of a step.
        island="disable",
        # MuJoCo's largest impedance d: the depth and the slip of soft friction are proportional to
        # (1 - d)/d.
        solimp=(0.9999, 0.9999, 0.001, 0.5, 1.0),
        # Slip decays at a fixed rate [1/s]; a rate proportional to 1/timestep would lower the order
        # of convergence by one.
        solreffriction=(-1.0, -0.5),
        # A ball that just touches the plane has no normal force at first. This causes a path error
        # of 1e-3.
        start_in_equilibrium=True,
        **dict.fromkeys(CONSTANT, _BY_LOAD),
    )


PRESETS: dict[str, Settings] = {
    settings.name: settings
    for settings in (
        NAIVE,
        recipe("fast", 5e-4, timestep=20e-3),
        recipe("balanced", 5e-6, timestep=5e-3),
        recipe("accurate", 1e-8, timestep=1e-3),
        recipe("efficient", 1e-7, integrator=ORDER_8, timestep=50e-3),
        recipe("exact", 1e-10, integrator=ORDER_8, timestep=20e-3),
    )
}
"""Presets of MuJoCo by name, from the coarsest to the finest.

"naive" has the settings that a newcomer would write. The other presets have different steps, and
their values of the contact depend on the scene's load.

Examples
--------
>>> import robotball as rb
>>> for name, settings in rb.PRESETS.items():
...     print(name, settings.error_tolerance, settings.timestep)
naive 0.01 None
fast 0.0005 0.02
balanced 5e-06 0.005
accurate 1e-08 0.001
efficient 1e-07 0.05
exact 1e-10 0.02
"""


def preset(name: str) -> Settings:
    """Return a preset of MuJoCo by name.

    Parameters
    ----------
    name : str
        A name of `PRESETS`.

    Returns
    -------
    Settings
        The settings.

    Raises
    ------
    InputError
        If the preset is unknown. The message lists similar names.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.preset("balanced").timestep
    0.005
    """
    return preset_named(PRESETS, name)


def settings_from(plain: Mapping[str, Any]) -> Settings:
    """Return settings from plain data, which `Settings.plain` or a JSON file gives.

    Raises InputError for an unknown key, and for a value that is missing or invalid.
    """
    lists = {key: tuple(value) for key, value in plain.items() if isinstance(value, list)}
    values: dict[str, Any] = {**plain, **lists}
    try:
        if isinstance(drive := values["drive"], Mapping):
            values["drive"] = Servo(**drive) if "gain" in drive else Prescribed(**drive)
        if isinstance(spin := values.get("torsional_friction"), Mapping):
            values["torsional_friction"] = Radii(**spin)
        return Settings(**values)
    except (TypeError, KeyError) as error:
        raise InputError(f"invalid settings of a run: {error}") from None


# The recipe's values for a varying load; docs/cost.md has the effect of each.
VARYING: dict[str, Any] = {
    # An off-centre mass couples the normal force with friction. PGS then has errors of up to 1e-1
    # after three iterations, without a warning, and needs a hundred to converge. Newton needs
    # three, and ten iterations take 20 % more time.
    "solver": "Newton",
    "iterations": 10,
    # The noslip solver treats a contact as singular if the product of the inverse inertia and these
    # coefficients is small. With 20 this happens from about 1e6 kg on, with 2000 only far above.
    "sliding_friction": 2000.0,
    "torsional_friction": Radii(2000.0),
    # The weight of a pendulum acts on its hinge all the time, and changes the hinge's rate by ∫τ dt
    # divided by the armature.
    "drive": Prescribed(armature=1e18),
}
# The contact's softness and time constant [s], for MuJoCo's steps and for steps of order 8. The
# contact's depth is an error. It is proportional to the softness and to the square of the time
# constant. Newton's method stops at 1e-15 m/s². Divided by the softness, this is a force; with a
# softness of 1e-5 it can lift a ball at rest out of its contact. The time constant is at least two
# timesteps, or twice 2 ms in a model that MuJoCo does not step.
_BY_MUJOCO, _BY_ORDER_8 = (3e-4, 0.01), (1e-4, 0.004)
_OF_STEP = 1 / 3  # time constant divided by a step of order 8; at 1/4 some fast robots lift off
# Replaces noslip for steps of order 8. The rounding errors of noslip's forces would lift a robot at
# rest off so hard a contact. The contact creeps in proportion to (1 - d)/d/impratio. If impratio is
# 1e6 or more, Newton's method needs more steps.
_WITHOUT_NOSLIP: dict[str, Any] = {"noslip_iterations": 0, "impratio": 1e5}
_SLIP_STEP = 2e-4  # s, in place of steps that the contact for slipping would shorten
# Impedance divided by timestep, 1/s. If a ball slips at the speed u, MuJoCo's cone pushes it up
# with the acceleration d·b·μ·u, where b is the damping of friction. More than g lifts the ball off.
_SLIP_IMPEDANCE = 0.2
_SLIP_DAMPING = 0.9  # of the largest stable damping of friction
# Tolerance divided by timestep, 1/s. With 0.4 of the friction that rolling needs, 31 of the
# catalog's 34 scenes stay below this tolerance over 10 s. The other three are reported as
# sensitive, or as too stiff for the step.
_SLIP_ERROR = 2.0


def for_slip(scene: Scene, settings: Settings, step: float) -> Settings:
    """Return settings with the recipe for a ball that slips, for steps of `step` [s].

    Three values are needed together. The low impedance makes the contact a spring and damper, so
    that MuJoCo's cone does not lift a ball that slips. The high impratio still allows the ball to
    stick. The damping of friction ends a slip in a step or two. During a slip, friction opposes the
    slip that the ball will have after the time 1/damping; this is an error of first order.
    """
    d = float(np.clip(_SLIP_IMPEDANCE * step, mujoco.mjMINIMP, 1e-3))
    integrator = (settings.integrator or MUJOCOS_DEFAULT) if settings.own else "RK4"
    damping = _SLIP_DAMPING * (INTEGRATORS[integrator].friction_limit or _EXPLICIT_REAL) / step
    lever = scene.ball.mass * scene.ball.radius**2
    return replace(
        settings,
        timestep=step,
        integrator=integrator,
        error_tolerance=max(settings.error_tolerance, _SLIP_ERROR * step),
        slips=True,
        # A larger armature or tolerance stops the solver too early.
        drive=Prescribed(armature=1e10 * lever),
        tolerance=1e-16,
        solver="Newton",
        iterations=30,
        noslip_iterations=0,
        solimp=(d, d, 0.001, 0.5, 1.0),
        impratio=1e6 / d,
        # A critically damped spring of the period 2π·step, whatever the gravity.
        solref=(-1 / step**2, -2 / step),
        solreffriction=(-1.0, -d * damping),
        **{name: CONSTANT[name] for name in ("softness", "sliding_friction", "torsional_friction")},
    )


# Settings that `for_slip` replaces if they have the values of `recipe`.
_OF_CONTACT = (
    *("tolerance", "noslip_iterations", "solimp", "impratio", "solreffriction"),
    *CONSTANT,
)
_RECIPE = recipe("", 1.0)


def _for_load(settings: Settings, scene: Scene) -> Settings:
    """Return the settings with each value that is _BY_LOAD replaced by the recipe's value.

    The recipe is `for_slip` if the scene's friction is exceeded. Otherwise it is CONSTANT if the
    normal force is constant, else VARYING with the softness and the time constant for the kind of
    steps.
    """
    pending = [name for name in CONSTANT if getattr(settings, name) == _BY_LOAD]
    if not pending:
        return settings
    if scene.may_slip and all(getattr(settings, n) == getattr(_RECIPE, n) for n in _OF_CONTACT):
        if slips(scene):
            step = settings.timestep if settings.own else None
            return for_slip(scene, settings, step or _SLIP_STEP)
        # Under a varying load, Newton's method with noslip can lift off a ball whose friction cone
        # is small.
        settings = replace(settings, slips=False)
    chosen = CONSTANT
    if scene.load_varies:
        eighth = not settings.own
        softness, constant = _BY_ORDER_8 if eighth else _BY_MUJOCO
        constant = max(constant, (_OF_STEP if eighth else 2.0) * (settings.timestep or 0.0))
        chosen = VARYING | {"softness": softness, "solref": (constant, 1.0)}
        if eighth and all(getattr(settings, n) == getattr(_RECIPE, n) for n in _WITHOUT_NOSLIP):
            chosen, pending = chosen | _WITHOUT_NOSLIP, [*pending, *_WITHOUT_NOSLIP]
    return replace(settings, **{name: chosen[name] for name in pending})


# MuJoCo's enumerations count their values from 0.
_VALUES = {"cone": ("pyramidal", "elliptic"), "solver": ("PGS", "CG", "Newton")}


@cache
def _defaults() -> tuple[Any, Any]:
    """Return MuJoCo's default option and contact pair."""
    return mujoco.MjModel.from_xml_string("<mujoco/>").opt, mujoco.MjSpec().default.pair


@dataclass(frozen=True)
class Resolved:
    """A scene and its settings, with the numbers of the MuJoCo model.

    The settings have the recipe's values for the scene's load. A number that is None in the
    settings is MuJoCo's default.
    """

    scene: Scene
    settings: Settings

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", _for_load(self.settings, self.scene))

    @property
    def integrator(self) -> _Integrator:
        """The integrator."""
        return INTEGRATORS[self.settings.integrator or MUJOCOS_DEFAULT]

    @property
    def timestep(self) -> float:
        """The longest step [s]."""
        return float(self.option("timestep"))

    @property
    def model_timestep(self) -> float:
        """The timestep of MuJoCo's model [s]; time constants are raised to two timesteps."""
        return self.timestep if self.settings.own else float(_defaults()[0].timestep)

    @property
    def solref(self) -> tuple[float, float]:
        """The contact's solref."""
        first, second = self.settings.solref or _defaults()[1].solref
        return float(first), float(second)

    @property
    def impedance(self) -> float:
        """The impedance d of a contact deeper than its width, clipped as in MuJoCo."""
        most = (self.settings.solimp or _defaults()[1].solimp)[1]
        return float(np.clip(most, mujoco.mjMINIMP, mujoco.mjMAXIMP))

    @property
    def condim(self) -> int:
        """The number of directions of force and torque that the contact has."""
        if self.settings.condim is not None:
            return self.settings.condim
        return 4 if self.scene.rolling == "rubber" else 3

    @property
    def friction(self) -> tuple[float, float, float]:
        """The contact's coefficients of sliding, torsional [m] and rolling [m] friction."""
        scene, settings = self.scene.friction, self.settings
        slide, spin = settings.sliding_friction, settings.torsional_friction
        if isinstance(spin, Radii):
            spin = spin.radii * self.scene.ball.radius
        if settings.slips is not False:
            slide = slide if scene.sliding is None else scene.sliding
            spin = spin if scene.torsional is None else scene.torsional
        return slide, spin, settings.rolling_friction

    def option(self, name: str) -> Any:
        """Return a setting, or MuJoCo's default if it is open."""
        if (value := getattr(self.settings, name)) is not None:
            return value
        default = getattr(_defaults()[0], name)
        return _VALUES[name][default] if name in _VALUES else default

    @cached_property
    def normal_reference(self) -> tuple[float, float]:
        """Stiffness [1/s²] and damping [1/s] of the contact's spring, from solref."""
        return self._reference(self.solref)

    @cached_property
    def friction_damping(self) -> float:
        """The rate b [1/s] at which slip decays."""
        reference = self.settings.solreffriction
        # MuJoCo uses solref in a pyramidal cone, and if both numbers of solreffriction are 0.
        if not reference or not any(reference) or self.option("cone") != "elliptic":
            reference = self.solref
        return self._reference(reference)[1]

    def _reference(self, solref: tuple[float, float]) -> tuple[float, float]:
        """Return stiffness [1/s²] and damping [1/s] of a solref in either of its formats."""
        first, second = solref
        if first <= 0:
            return -first / self.impedance**2, -second / self.impedance
        # MuJoCo's flag refsafe raises a time constant to two steps.
        rate = self.impedance * max(first, 2 * self.model_timestep)
        return 1 / (rate * second) ** 2, 2 / rate

    @property
    def equilibrium_depth(self) -> float:
        """The depth p = g (1 - d)/(d² k) [m] at which the contact carries the weight at rest."""
        d, (stiffness, _) = self.impedance, self.normal_reference
        if stiffness == 0:
            return np.inf
        weight = -self.scene.gravity_world[2]
        return self.settings.softness * weight * (1 - d) / (d * d * stiffness)
