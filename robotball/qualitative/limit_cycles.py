"""Limit cycles of the motion from rest, section 4: found by settling onto them, then closed."""

from dataclasses import replace

import numpy as np

from robotball import equations as eq
from robotball.engines.reduced.compiled.kernels import orbit, orbits
from robotball.errors import InputError
from robotball.parameters import Parameters, as_vector
from robotball.qualitative.cycles import Cycle, close
from robotball.qualitative.equilibria import attitude_at, flow, rate_scale
from robotball.rotations import Array, rotation_matrix

NO_MOMENTUM = np.zeros(3)
SETTLING = 10  # of the longest period, before an orbit counts as on its cycle
SAMPLES = 4000  # of the longest period
AT_REST = 1e-6  # of the flow's rates: an orbit that slow has settled on a fixed point
# Of a multiplier from 1. Orbits still on their way to a slow focus seem to close, too.
HYPERBOLIC = 1e-5


def limit_cycles(parameters: Parameters, longest: float = 200.0, starts: int = 32) -> list[Cycle]:
    """The limit cycles of (4.1), stable and unstable, with periods up to `longest` [s].

    From `starts` points spread over the sphere the flow and the flow back in time are followed
    until they settle: a cycle that attracts none of these starts is not found. Raises InputError
    for a classical ball.
    """
    if parameters.rolling != "rubber":
        raise InputError("(4.1) is the rubber model's: M = 0 has no classical counterpart")
    cycles: list[Cycle] = []
    curves: list[Array] = []
    # A cycle is closed in the direction of time in which it attracts: the other loses all digits.
    for ball, sense in ((parameters, 1), (reversed_in_time(parameters), -1)):
        for gamma in settled(ball, SETTLING * longest, starts):
            if any(lies_on(gamma, curve) for curve in curves):
                continue
            cycle = cycle_near(ball, gamma, longest)
            if cycle and not any(lies_on(cycle.gamma, curve) for curve in curves):
                cycles.append(replace(cycle, multipliers=cycle.multipliers**sense))
                curves.append(curve_of(ball, cycle.gamma, cycle.period))
    return cycles


def reversed_in_time(parameters: Parameters) -> Parameters:
    """The ball that goes through the motions backwards: ω is linear in M, K and Ω together."""
    return replace(
        parameters, Omega=eq.scale(-1.0, parameters.Omega), K=eq.scale(-1.0, parameters.K)
    )


def settled(parameters: Parameters, duration: float, starts: int) -> Array:
    """Where the flow takes points of the sphere, (n, 3): those that do not come to rest."""
    attitudes = np.array([attitude_at(gamma) for gamma in spread_points(starts)])
    end = orbits(parameters, attitudes, np.zeros((starts, 3)), np.array([0.0, duration]), 1e-12)
    gamma = rotation_matrix(end.attitudes[:, 1])[:, 2]
    rates = np.linalg.norm(flow(parameters, tuple(gamma.T)), axis=0)
    return gamma[rates > AT_REST * rate_scale(parameters)]


def cycle_near(parameters: Parameters, gamma: Array, longest: float) -> Cycle | None:
    """The cycle that passes near γ (3,), if there is one."""
    times = np.linspace(0.0, longest, SAMPLES)
    path = rotation_matrix(orbit(parameters, attitude_at(gamma), NO_MOMENTUM, times)[0])[:, 2]
    direction = np.array(flow(parameters, as_vector(gamma)))
    ahead = (path - gamma) @ direction
    returns = np.flatnonzero((ahead[1:-1] < 0) & (ahead[2:] >= 0)) + 1
    near = returns[np.linalg.norm(path[returns] - gamma, axis=1) < 0.1]
    if not len(near):
        return None
    try:
        cycle = close(parameters, attitude_at(gamma), NO_MOMENTUM, times[near[0]])
    except InputError:
        return None
    # A fixed point, too, is where it was after any time.
    rate = np.linalg.norm(flow(parameters, as_vector(cycle.gamma)))
    moves = rate > AT_REST * rate_scale(parameters)
    return cycle if moves and abs(cycle.multipliers[0] - 1) > HYPERBOLIC else None


def curve_of(parameters: Parameters, gamma: Array, period: float) -> Array:
    """γ (SAMPLES, 3) over a period from γ (3,)."""
    times = np.linspace(0.0, period, SAMPLES)
    return rotation_matrix(orbit(parameters, attitude_at(gamma), NO_MOMENTUM, times)[0])[:, 2]


def lies_on(gamma: Array, curve: Array) -> bool:
    """Whether γ (3,) is as near to a closed curve (n, 3) as its samples are to each other."""
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    return bool(np.linalg.norm(curve - gamma, axis=1).min() < spacing)


def spread_points(count: int) -> Array:
    """Points (count, 3) spread evenly over the unit sphere, along Fibonacci's spiral."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * (3 - np.sqrt(5)) * i
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
