"""The same equations in heyoka, an independent Taylor integrator (extra `reference`)."""

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from robotball import equations as eq
from robotball.engines.reduced.compiled.kernels import Starts
from robotball.engines.reduced.compiled.steppers import BALL, LEVEL, ball_of
from robotball.engines.reduced.compiled.systems import Level, System
from robotball.equations import Vector
from robotball.parameters import Parameters
from robotball.rotations import Array

Equations = list[tuple[Any, Any]]
BALL_SIZE = LEVEL - BALL


def equations_of(system: System, parameters: Parameters) -> Equations:
    """A system of the compiled stepper as heyoka's equations, with pars as `pars_of` gives them.

    A quaternion in them is drawn to length one, which heyoka cannot set at every step.
    """
    symbolic = ball_of(parameters.rolling, [hy.par[i] for i in range(BALL_SIZE)])
    c = hy.par[BALL_SIZE + 1] if parameters.rolling == "classical" else hy.expression(0.0)
    state = hy.make_vars(*(f"y{i}" for i in range(system.size)))
    rates = list(system.rate(state, symbolic, Level(hy.par[BALL_SIZE], c)))
    start = 0
    for size in system.units:
        unit = slice(start, start := start + size)
        excess = 1 - sum(y * y for y in state[unit])
        rates[unit] = [
            rate + 0.5 * excess * y for y, rate in zip(state[unit], rates[unit], strict=True)
        ]
    return list(zip(state, rates, strict=True))


def level_equations(parameters: Parameters) -> Equations:
    """dγ/dt = γ×ω, dM/dt = M×ω in frame axes, with the numbers of the ball put in."""
    gamma = vector(hy.make_vars("gamma1", "gamma2", "gamma3"))
    M = vector(hy.make_vars("M1", "M2", "M3"))
    omega = parameters.angular_velocity(M, gamma)
    rates = (*eq.cross(gamma, omega), *eq.cross(M, omega))
    return list(zip((*gamma, *M), rates, strict=True))


def pars_of(starts: Starts) -> Array:
    """The values (n, k) of the pars, one row a start."""
    used = BALL_SIZE + (2 if starts.parameters.rolling == "classical" else 1)
    return starts.rows[:, :used]


def batch(
    equations: Equations, states: Array, pars: Array | None, tolerance: float, **more: Any
) -> Any:
    """An integrator of n states (n, size) side by side, from time 0."""
    if pars is not None:
        more["pars"] = pars.T.copy()
    return hy.taylor_adaptive_batch(equations, states.T.copy(), tol=tolerance, **more)


def vector(items: Sequence[Any]) -> Vector:
    """Three items as a vector."""
    x, y, z = items
    return (x, y, z)
