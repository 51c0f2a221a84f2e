"""The steps that are compiled: a Runge-Kutta step of the equations, of LANES orbits at a time.

A step is a plain function of the state and its length, here run on symbols (flatten.py) and
compiled once a rolling model; a ball is data. Only unit vectors are judged for their error, so
no tolerance has a unit.
"""

import math
import sys
from collections.abc import Callable, Sequence
from functools import cache
from types import ModuleType
from typing import Any

import numba
from numba.core.codegen import get_host_cpu_features
from numba.extending import register_jitable

from robotball.engines.kept import compiled_from
from robotball.engines.reduced.compiled.flatten import LANES, Tape, lane_function, least
from robotball.engines.reduced.compiled.systems import Level, State, System
from robotball.engines.reduced.compiled.verner import ERROR, NINTH, STAGES
from robotball.equations import Scalar
from robotball.parameters import Parameters, Rolling

# LLVM holds some processors to half of their vectors' width, a third slower here. Only a process
# that has compiled nothing yet can still be told, and one whose user has said so is not.
if "+avx512f" in get_host_cpu_features() and numba.config.CPU_FEATURES is None:
    numba.config.CPU_FEATURES = get_host_cpu_features() + ",-prefer-256-bit"

# Rows of a workspace: how long a step to try, the error allowed, the time, where to stop; the
# ball, the level set, the section; and from STATE on the state, its slope, the new state, FLAG and
# what is seen of a section, of each as many as the system says.
LENGTH, ALLOWED, TIME, TARGET, BALL, LEVEL, SECTION, STATE = 0, 1, 2, 3, 4, 15, 17, 23
REJECTED, MARCHED, LOOKED = 0.0, 1.0, 2.0
# Sums in any order cost up to a tenth less and round no worse; what is not a number stays so.
FREEDOM = {"contract", "reassoc", "nsz"}
SEEN = 3  # numbers


def places(size: int) -> tuple[int, int, int, int]:
    """The rows where, for a state of so many numbers, slope, new state and flag begin; and all."""
    slope, new, flag = STATE + size, STATE + 2 * size, STATE + 3 * size
    return slope, new, flag, flag + 1 + SEEN


register_jitable(places)  # the loops ask too


# Control of the length: the usual limits of change, and a safety at which some 2 % of the steps are
# rejected. At 0.9 it is 23 %, and the same error costs a third more time.
SAFETY, LEAST_CHANGE, MOST_CHANGE = 0.75, 0.2, 6.0


def runge_kutta(
    rate: Callable[[State], State], state: State, slope: State, h: Scalar, allowed: Sequence[float]
) -> tuple[list[Scalar], Scalar]:
    """The state after one step of length h by Verner's pair, and 1/error² of the step.

    slope: of the state, which the step before ended with; allowed: the parts in which the errors
    of the first numbers of the state are measured, which alone are judged.
    """

    def combination(row: Sequence[float], i: int) -> Scalar:
        return sum(a * slope[i] for a, slope in zip(row, slopes, strict=False) if a != 0)

    def moved(row: Sequence[float]) -> list[Scalar]:
        return [y + h * combination(row, i) for i, y in enumerate(state)]

    slopes = [slope]
    for row in STAGES:
        slopes.append(rate(moved(row)))
    errors = [combination(ERROR, i) * (1 / part) for i, part in enumerate(allowed)]
    # The tiny term stands for no error at all, where nothing moves.
    return moved(NINTH), 1 / (h * h * sum(e * e for e in errors) + 1e-200)


def flat_step(system: System, rolling: Rolling, lanes: int = LANES) -> str:
    """Source of the step of a system, over the rows of a workspace.

    A lane whose target is nearer than its length only looks: it leaves the state there in the
    rows of the new state, and stands still. Otherwise it marches: time, state and slope move, if
    the error is within the tolerance. After the new state come the flag, and what the system sees
    of the section in the new state.
    """
    tape = Tape(lanes)
    SLOPE, NEW, FLAG, _ = places(system.size)
    row = [tape.read(i) for i in range(NEW)]
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

    # (tolerance/error)^(1/8): so much longer a step would just keep to it.
    fits = (per_error_squared * (row[ALLOWED] * row[ALLOWED])).sqrt().sqrt().sqrt().sqrt()
    accepted, marching = fits.at_least(1.0), row[LENGTH].at_most(length)
    marched, looked = accepted & marching, accepted & length.below(row[LENGTH])
    change = SAFETY * fits
    change = change.at_least(LEAST_CHANGE).choose(least(change, MOST_CHANGE), LEAST_CHANGE)
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
    return lane_function("step", tape, results)


def ball_of(rolling: Rolling, row: Sequence[Any]) -> Parameters:
    """The Parameters whose numbers are in the rows from BALL to LEVEL."""
    I1, I2, I3, d, a, Omega1, Omega2, Omega3, K1, K2, K3 = row
    return Parameters(rolling, (I1, I2, I3), d, a, (Omega1, Omega2, Omega3), (K1, K2, K3))


def level_of(rolling: Rolling, row: Sequence[Any]) -> Level:
    """The Level of the rows from LEVEL to SECTION; only classical balls have a momentum along γ."""
    return Level(row[0], row[1] if rolling == "classical" else 0.0)


def row_of(parameters: Parameters) -> list[float]:
    """What `ball_of` takes (11,)."""
    p = parameters
    return [*p.I, p.d, p.a, *p.Omega, *p.K]


@cache
def stepper(system: System, rolling: Rolling, lanes: int = LANES) -> Any:
    """The compiled step (workspace) -> None of a system; kept from one process to the next."""
    source = flat_step(system, rolling, lanes)
    name = f"robotball_{system.name}_{rolling}_{lanes}"
    module = ModuleType(name)
    sys.modules[name] = module  # by its name numba finds it when it loads the compiled step
    vars(module)["sqrt"] = math.sqrt
    exec(compile(source, f"<{name}, from robotball's equations>", "exec"), vars(module))
    options = {"nogil": True, "error_model": "numpy", "fastmath": FREEDOM}
    module.__dict__["step"] = step = compiled_from(source, "void(f8[::1])", **options)(module.step)
    return step
