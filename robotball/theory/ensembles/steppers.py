"""Systems of equations, and their compiled Runge-Kutta step for LANES orbits at a time.

The systems are plain arithmetic on unit quaternions in the axes of section 3.3, in which
M = -mα + cγ. M is constant in space, so only an attitude is integrated.

The pair of explicit methods of orders 9 and 8, with 16 stages, is the most efficient 9(8) of
J. H. Verner, "Numerically optimal Runge-Kutta pairs with interpolants", Numerical Algorithms 53
(2010) 383-396, with his coefficients of 2024. On these equations it takes 10 to 27 % less time than
scipy's DOP853 at the same error.

A step is a plain function of the state and the length of the step. It is traced with symbols
(flatten.py) and compiled once for each rolling model; the parameters of the ball are data. Only the
errors of unit vectors are controlled, so tolerances have no unit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from robotball import rotations
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters, Rolling, Scalar, Vector
from robotball.rotations import Quaternion, unit_space_axes
from robotball.theory.compiled import compiled_from, inlined, text_of
from robotball.theory.ensembles import flatten
from robotball.theory.ensembles.flatten import LANES, along, lane_function, least, slopes

State = Sequence[Scalar]


@dataclass(frozen=True)
class Level:
    """The constant momentum, in the axes of section 3.3: M = -mα + cγ, kg m²/s."""

    m: Scalar
    c: Scalar

    def momentum(self, alpha: Vector, gamma: Vector) -> Vector:
        """Return M in frame axes."""
        return eq.subtract(eq.scale(self.c, gamma), eq.scale(self.m, alpha))


_SectionValue = tuple[Scalar, Scalar, Scalar]
"""A section function's value, its rate [1/s], and a number that is positive on the section."""


@dataclass(frozen=True)
class System:
    """Equations to step: their right-hand side, and the unit vectors in their state.

    rate: (state, parameters, level) -> d(state)/dt. units: the dimensions of the unit vectors
    with which the state starts. Only the error of unit vectors is controlled, and they are
    normalised at every step. The other numbers of the state are quadratures of the unit vectors.
    loose: the factor of the tolerance for each unit vector. section: (state, parameters, level,
    numbers of the section) -> `_SectionValue`, if there is a section.
    """

    name: str
    size: int
    units: tuple[int, ...]
    rate: Callable[[State, Parameters, Level], State]
    loose: tuple[float, ...] = (1.0,)
    section: Callable[[State, Parameters, Level, State], _SectionValue] | None = None

    @property
    def allowed(self) -> list[float]:
        """The factors of the tolerance for each number whose error is controlled."""
        return [times for n, times in zip(self.units, self.loose, strict=True) for _ in range(n)]


def _path_rate(state: State, parameters: Parameters, level: Level) -> State:
    """Return d/dt of (q, X, Y): attitude and contact point."""
    q, alpha, beta, _, omega = _turning(state, parameters, level)
    velocity = eq.contact_velocity(alpha, beta, omega, parameters.Omega, parameters.a)
    return (*eq.attitude_rate(q, omega), *velocity)


def _attitude_rate(state: State, parameters: Parameters, level: Level) -> State:
    """Return d/dt of q."""
    q, _, _, _, omega = _turning(state, parameters, level)
    return eq.attitude_rate(q, omega)


def _deviation_rate(state: State, parameters: Parameters, level: Level) -> State:
    """Return d/dt of (q, ξ, ln growth, ln volume): a neighbouring orbit's direction and distance.

    A small turn ξ of the start, in frame axes, obeys dξ/dt = Dω·ξ - ω×ξ. The state has the
    direction of ξ as a unit vector, and the logarithm of the length of ξ.
    """
    q, alpha, _, gamma, omega = _turning(state, parameters, level)
    xi: Vector = (state[4], state[5], state[6])
    moving_gamma = along(gamma, eq.cross(gamma, xi))
    moving_M = along(level.momentum(alpha, gamma), eq.cross(level.momentum(alpha, gamma), xi))
    change = slopes(parameters.angular_velocity(moving_M, moving_gamma))
    growth = eq.dot(xi, change)
    xi_rate = eq.subtract(eq.subtract(change, eq.cross(omega, xi)), eq.scale(growth, xi))
    return (*eq.attitude_rate(q, omega), *xi_rate, growth, parameters.divergence(gamma))


def _turning(
    state: State, parameters: Parameters, level: Level
) -> tuple[Quaternion, Vector, Vector, Vector, Vector]:
    """Return q, α, β, γ and ω of a state that starts with q."""
    w, x, y, z = state[:4]
    alpha, beta, gamma = unit_space_axes((w, x, y, z))
    omega = parameters.angular_velocity(level.momentum(alpha, gamma), gamma)
    return (w, x, y, z), alpha, beta, gamma, omega


def _section_function(
    state: State, parameters: Parameters, level: Level, section: State
) -> _SectionValue:
    """Return sin(g - g₀), its rate and cos(g - g₀), all times √(1 - L²/f), of a state with q first.

    section: (cos g₀, sin g₀, m/√f, c/√f). With γ₀ = (m/√f)γ + (c/√f)α of (5.5) the definition of
    g reads √(1 - L²/f) (sin g, cos g) = (-β₃, -γ₀₃); no angle is needed.
    """
    cos_g, sin_g, across = section[:3]
    along_M = section[3] if parameters.rolling == "classical" else 0.0
    _, alpha, beta, gamma, omega = _turning(state, parameters, level)
    node = eq.add(eq.scale(across, gamma), eq.scale(along_M, alpha))
    ahead = eq.subtract(eq.scale(sin_g, node), eq.scale(cos_g, beta))
    facing = -(cos_g * node[2] + sin_g * beta[2])
    return ahead[2], eq.cross(ahead, omega)[2], facing


def _arc_function(state: State, parameters: Parameters, level: Level, arc: State) -> _SectionValue:
    """Return (γ, n), its rate and (γ, e) of a state with q first; arc: unit vectors n, e."""
    normal: Vector = (arc[0], arc[1], arc[2])
    middle: Vector = (arc[3], arc[4], arc[5])
    _, _, _, gamma, omega = _turning(state, parameters, level)
    return eq.dot(normal, gamma), eq.dot(normal, eq.cross(gamma, omega)), eq.dot(middle, gamma)


# The factor of the tolerance for the direction of a neighbouring orbit, which is needed only for
# the mean growth. The error of the direction is about 10 times that of the attitude. With the same
# tolerance, the direction would determine the step, and the same exponents would need a seventh
# more steps.
_DIRECTION = 100.0

PATH = System("path", 6, (4,), _path_rate)
RETURN = System("return", 4, (4,), _attitude_rate, section=_section_function)
ARC = System("arc", 4, (4,), _attitude_rate, section=_arc_function)
DEVIATION = System("deviation", 9, (4, 3), _deviation_rate, loose=(1.0, _DIRECTION))


# Rows of a workspace: the length of the next trial, the tolerance, the time, the target; the ball,
# the level set, the section; and from STATE on the state, its slope, the new state, the flag and
# the section value, whose sizes depend on the system.
LENGTH, ALLOWED, TIME, TARGET, BALL, LEVEL, SECTION, STATE = 0, 1, 2, 3, 4, 15, 17, 23
REJECTED, MARCHED, LOOKED = 0.0, 1.0, 2.0
# A free order of sums saves up to a tenth of the time. Rounding errors are as large, and NaN stays.
_FREEDOM = {"contract", "reassoc", "nsz"}
_SEEN = 3  # numbers of a section


@inlined
def places(size: int) -> tuple[int, int, int, int]:
    """Return the first rows of slope, new state and flag, and the number of rows, for a size."""
    slope, new, flag = STATE + size, STATE + 2 * size, STATE + 3 * size
    return slope, new, flag, flag + 1 + _SEEN


# fmt: off
# The weights of the slopes before each stage but the first, whose slope is that of the state.
STAGES: tuple[tuple[float, ...], ...] = (
    (0.03571,),
    (-0.03833735636677017, 0.13739763727944432),
    (0.0371476053422528, 0, 0.11144281602675842),
    (2.674764429871505, 0, -9.982382134885293, 7.921017705013789),
    (0.05242104050577351, 0, 0, 0.17969111891759532, 0.0006237879371938568),
    (0.15924922236476322, 0, 0, -0.4298429877241087, 0.06665266542726088, 0.757805152571522),
    (0.07283333333333333, 0, 0, 0, 0, 0.33593445906651037, 0.2467322076001563),
    (0.0729755859375, 0, 0, 0, 0, 0.33480097296993333, 0.11841582390506665, -0.0345673828125),
    (
        0.049112136634520964, 0, 0, 0, 0, 0.03983857361308652, 0.10696752889393547,
        -0.021742591654586477, -0.10559564748695649,
    ),
    (
        -0.027079888186412805, 0, 0, 0, 0, 0.0333, -0.16455260700360572, 0.0342826630649739,
        0.1585264064439221, 0.2185234256811225,
    ),
    (
        0.05584657769108863, 0, 0, 0, 0, 0.09166533166672539, 0.2392399655523627,
        0.01023834712248415, -0.0026793313228595426, 0.04235624181474285, 0.2253970470166604,
    ),
    (
        -0.4802510512725196, 0, 0, 0, 0, -6.35961016255593, -0.2762313898040841,
        -6.500796633979847, 0.5734765877040957, 1.3471259948681389, 5.936840409706221,
        6.590346245333925,
    ),
    (
        0.3307533067671401, 0, 0, 0, 0, 5.956207776829962, -0.4868316400481528,
        4.462055288206771, 0.7410258231442072, -0.7118192034575913, -5.454619594516665,
        -4.14080372924471, 0.20383197231903866,
    ),
    (
        -0.5847111122998944, 0, 0, 0, 0, -12.41268417116267, 1.360245445660928,
        -22.42610531111868, -0.8828857055865458, 1.7701551285382304, 12.15809651918534,
        22.230375204077607, -0.6634483760201249, 0.45096237872581374,
    ),
    (
        1.9405755498106487, 0, 0, 0, 0, 21.977984081145564, 0.8230747326984728,
        68.16441683626356, -3.117097463620267, -4.56884102182244, -18.74190987126265,
        -66.57711839637832, 1.0989155531654418, 0, 0,
    ),
)
# The weights of the slopes in the steps of orders 9 and 8.
NINTH: tuple[float, ...] = (
    0.015006690149797247, 0, 0, 0, 0, 0, 0, -1.0551809927463813, 0.2384947263782183,
    0.12881517742829915, 0.22766231110462157, 1.2295325874375174, 0.04624976662810384,
    0.13861963193662938, 0.030800101683194355, 0,
)
EIGHTH: tuple[float, ...] = (
    0.018972105324811014, 0, 0, 0, 0, 0, 0, 3.4081103145494938, 0.1260323883820921,
    0.11883750634511497, 0.24910419978386877, -3.2699662199289783, 0.3023798100228883, 0, 0,
    0.04652989552070924,
)
# fmt: on
_ERROR = tuple(ninth - eighth for ninth, eighth in zip(NINTH, EIGHTH, strict=True))


# Step control: limits of change, and a safety with which about 2 % of the steps are rejected. With
# 0.9 it is 23 %, and the same error costs a third more time.
_SAFETY, _LEAST_CHANGE, _MOST_CHANGE = 0.75, 0.2, 6.0


def runge_kutta(
    rate: Callable[[State], State], state: State, slope: State, h: Scalar, allowed: Sequence[float]
) -> tuple[list[Scalar], Scalar]:
    """Return the state after one step of length h with Verner's pair, and 1/error² of the step.

    slope: of the state, from the end of the last step; allowed: the tolerances of the first numbers
    of the state; the errors of the others are not controlled.
    """

    def combination(row: Sequence[float], i: int) -> Scalar:
        return sum(a * slope[i] for a, slope in zip(row, known, strict=False) if a != 0)

    def moved(row: Sequence[float]) -> list[Scalar]:
        return [y + h * combination(row, i) for i, y in enumerate(state)]

    known = [slope]
    for row in STAGES:
        known.append(rate(moved(row)))
    errors = [combination(_ERROR, i) * (1 / part) for i, part in enumerate(allowed)]
    # The tiny term avoids a division by zero if nothing moves.
    return moved(NINTH), 1 / (h * h * sum(e * e for e in errors) + 1e-200)


def _step(read: Callable[[int], Any], system: System, rolling: Rolling) -> dict[int, Any]:
    """Return the rows of a workspace after a system's step, from `read`, which gives a row.

    A lane only looks if its target is nearer than the length of its step: it then writes the state
    at the target to the rows of the new state. Otherwise it marches: time, state and slope advance
    if the error is within the tolerance. The flag and the section value of the new state follow the
    new state.
    """
    SLOPE, NEW, FLAG, _ = places(system.size)
    row = [read(i) for i in range(NEW)]
    parameters = ball_of(rolling, row[BALL:LEVEL])
    level = level_of(rolling, row[LEVEL:SECTION])

    def rate(state: State) -> State:
        return system.rate(state, parameters, level)

    length = least(row[TARGET] - row[TIME], row[LENGTH])
    new, per_error_squared = runge_kutta(
        rate, row[STATE:SLOPE], row[SLOPE:], length, system.allowed
    )
    start = 0
    for size in system.units:
        unit = slice(start, start := start + size)
        per_length = 1 / sum(x * x for x in new[unit]).sqrt()
        new[unit] = [x * per_length for x in new[unit]]

    # (tolerance/error)^(1/8): a step longer by this factor would just keep to the tolerance.
    fits = (per_error_squared * (row[ALLOWED] * row[ALLOWED])).sqrt().sqrt().sqrt().sqrt()
    accepted, marching = fits >= 1.0, row[LENGTH] <= length
    marched, looked = accepted & marching, accepted & (length < row[LENGTH])
    change = _SAFETY * fits
    change = (change >= _LEAST_CHANGE).choose(least(change, _MOST_CHANGE), _LEAST_CHANGE)
    flag = marched.choose(MARCHED, looked.choose(LOOKED, REJECTED))
    results = {
        LENGTH: looked.choose(row[LENGTH], length * change),
        TIME: marched.choose(row[TIME] + length, row[TIME]),
        **{STATE + i: marched.choose(x, row[STATE + i]) for i, x in enumerate(new)},
        **{SLOPE + i: marched.choose(x, row[SLOPE + i]) for i, x in enumerate(rate(new))},
        **{NEW + i: x for i, x in enumerate(new)},
        FLAG: flag,
    }
    if system.section is not None:
        seen = system.section(new, parameters, level, row[SECTION:STATE])
        results |= {FLAG + 1 + i: x for i, x in enumerate(seen)}
    return results


def ball_of(rolling: Rolling, row: Sequence[Any]) -> Parameters:
    """Return the Parameters whose numbers are in the rows from BALL to LEVEL."""
    I1, I2, I3, d, a, Omega1, Omega2, Omega3, K1, K2, K3 = row
    return Parameters(rolling, (I1, I2, I3), d, a, (Omega1, Omega2, Omega3), (K1, K2, K3))


def level_of(rolling: Rolling, row: Sequence[Any]) -> Level:
    """Return the Level of the rows from LEVEL to SECTION; only classical balls have M along γ."""
    return Level(row[0], row[1] if rolling == "classical" else 0.0)


def row_of(parameters: Parameters) -> list[float]:
    """Return the numbers (11,) that `ball_of` takes."""
    p = parameters
    return [*p.I, p.d, p.a, *p.Omega, *p.K]


@cache
def stepper(system: System, rolling: Rolling, lanes: int = LANES) -> Any:
    """Return the compiled step (workspace) -> None of a system, which is cached on disk."""
    name = f"{system.name}_{rolling}_{lanes}"
    function = lane_function(name, lanes, _step, system, rolling)
    made_from = name + text_of(rotations.__file__, eq.__file__, flatten.__file__, __file__)
    # The loops take the compiled function as an argument.
    return compiled_from(made_from, "void(f8[::1])", fastmath=_FREEDOM)(function).code
