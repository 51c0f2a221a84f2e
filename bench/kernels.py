"""Compare the compiled stepper with scipy and heyoka at equal errors (extra `bench`).

heyoka is an independent Taylor integrator for the same equations. Each tool runs on one thread at
several tolerances, all in turn. Times are the least of several rounds, compared at one error by
interpolation between tolerances; set-up and compilation are not timed.

heyoka has default settings (wider lanes gain nothing) and batches of 8, which are faster than the
recommended 4. Errors are relative to the compiled stepper at tolerance 1e-15, whose own error is
four orders smaller.
"""

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import heyoka as hy
import numpy as np
from numba.core.codegen import get_host_cpu_features
from scipy.integrate import solve_ivp

from robotball import load_scene
from robotball.dynamics.long_run import ANY_TURN
from robotball.dynamics.sections import section_starts, sections_of
from robotball.processes import at_most
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, rotation_matrix
from robotball.theory.ensembles.orbits import Starts, orbit, orbits
from robotball.theory.ensembles.steppers import (
    BALL,
    DEVIATION,
    LEVEL,
    PATH,
    RETURN,
    Level,
    System,
    ball_of,
)

_Equations = list[tuple[Any, Any]]
_BALL_SIZE = LEVEL - BALL
_FIG11B = load_scene("fig14").parameters
_FEATURES = "NUMBA_CPU_FEATURES"
_DURATION, _OUTPUTS, _POINTS, _MANY, _LANES = 100.0, 1000, 25, 256, 8
_OURS, _HEYOKAS = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11), (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def equations_of(system: System, parameters: Parameters) -> _Equations:
    """Return a system of the compiled stepper as heyoka's equations, with pars from `pars_of`.

    A term keeps quaternions at length 1, because heyoka cannot normalise them at every step.
    """
    symbolic = ball_of(parameters.rolling, [hy.par[i] for i in range(_BALL_SIZE)])
    c = hy.par[_BALL_SIZE + 1] if parameters.rolling == "classical" else hy.expression(0.0)
    state = hy.make_vars(*(f"y{i}" for i in range(system.size)))
    rates = list(system.rate(state, symbolic, Level(hy.par[_BALL_SIZE], c)))
    start = 0
    for size in system.units:
        unit = slice(start, start := start + size)
        excess = 1 - sum(y * y for y in state[unit])
        rates[unit] = [
            rate + 0.5 * excess * y for y, rate in zip(state[unit], rates[unit], strict=True)
        ]
    return list(zip(state, rates, strict=True))


def _level_equations(parameters: Parameters) -> _Equations:
    """Return dγ/dt = γ×ω, dM/dt = M×ω in frame axes, with the ball's parameters inserted."""
    gamma, M = (hy.make_vars(*(f"{name}{i}" for i in "123")) for name in ("gamma", "M"))
    omega = parameters.angular_velocity(M, gamma)
    rates = (*eq.cross(gamma, omega), *eq.cross(M, omega))
    return list(zip((*gamma, *M), rates, strict=True))


def pars_of(starts: Starts) -> Array:
    """Return the values (n, k) of the pars, a row per initial state."""
    used = _BALL_SIZE + (2 if starts.rolling == "classical" else 1)
    return starts.rows[:, :used]


def _batch(
    equations: _Equations, states: Array, pars: Array | None, tolerance: float, **more: Any
) -> Any:
    """Return an integrator of n states (n, size) side by side from time 0."""
    if pars is not None:
        more["pars"] = pars.T.copy()
    return hy.taylor_adaptive_batch(equations, states.T.copy(), tol=tolerance, **more)


_Run = Callable[[], Any]
_Prepare = Callable[[float], _Run]


@dataclass
class _Contender:
    """One tool at one task, with its measurements.

    Attributes
    ----------
    prepare : callable
        tolerance -> the function to be timed.
    error : callable
        Error of that function's result.
    work : float
        Units of work per run.
    seconds, errors : dict
        By tolerance: seconds per unit of work, and the error.
    """

    name: str
    prepare: _Prepare
    error: Callable[[Any], float]
    tolerances: tuple[float, ...]
    work: float = 1.0
    rounds: int = 7
    seconds: dict[float, float] = field(default_factory=dict)
    errors: dict[float, float] = field(default_factory=dict)

    def at(self, error: float) -> float:
        """Return the time at an error [s], from a power law between neighbouring tolerances."""
        measured = sorted((self.errors[t], self.seconds[t]) for t in self.tolerances)
        errors, seconds = np.array(measured).T
        if not errors[0] <= error <= errors[-1]:
            raise ValueError(f"{self.name} was not measured at an error of {error:g}: {errors}")
        return float(np.exp(np.interp(np.log(error), np.log(errors), np.log(seconds))))


def _compare(title: str, error: float, *contenders: _Contender) -> None:
    """Time all contenders in turn and print their table, with ratios to the first at one error."""
    runs = [(c, t, c.prepare(t)) for c in contenders for t in c.tolerances]
    for contender, tolerance, run in runs:
        contender.errors[tolerance] = contender.error(run())
    for i in range(max(c.rounds for c in contenders)):
        for contender, tolerance, run in runs:
            if i < contender.rounds:
                begin = time.process_time()
                run()
                seconds = (time.process_time() - begin) / contender.work
                best = contender.seconds.get(tolerance, np.inf)
                contender.seconds[tolerance] = min(best, seconds)
    print(f"\n{title}\n{'':24}tolerance   error        µs")
    for contender in contenders:
        for t in contender.tolerances:
            micro = contender.seconds[t] * 1e6
            print(f"  {contender.name:22}{t:9.0e}{contender.errors[t]:9.1e}{micro:11.1f}")
    ours = contenders[0].at(error)
    for other in contenders[1:]:
        print(f"  at error {error:.0e} {other.at(error) / ours:.2f} times as fast as {other.name}")


def _ours(system: System, starts: Starts, begin: Array, ends: tuple[float, ...]) -> _Prepare:
    """Return our `prepare` for all initial states, like `_in_batches`; begin (n, k)."""
    times = np.array(ends)
    return lambda tolerance: lambda: starts.march(system, begin, times, tolerance)[0][:_LANES, 0]


def _in_batches(
    form: _Equations, begin: Array, pars: Array | None, ends: tuple[float, ...]
) -> _Prepare:
    """Return heyoka's `prepare`, which runs all initial states in batches.

    begin (n, size), pars (n, k); ends: times to stop at [s]. The run returns the first batch's
    states at the first of them.
    """

    def prepare(tolerance: float) -> _Run:
        ta = _batch(form, begin[:_LANES], None if pars is None else pars[:_LANES], tolerance)

        def run() -> Array:
            for i in range(0, len(begin), _LANES):
                if pars is not None:
                    ta.pars[:] = pars[i : i + _LANES].T
                ta.set_time(0.0)
                ta.state[:] = begin[i : i + _LANES].T
                for end in ends:
                    ta.propagate_until(end)
                    if i == 0 and end == ends[0]:
                        first = ta.state.T.copy()
            return first

        return run

    return prepare


def _median_error(reference: Array) -> Callable[[Array], float]:
    """Return the median over rows (n, k) of the largest error; chaos spoils some rows."""
    return lambda rows: float(np.median(np.abs(rows - reference).max(axis=1)))


def _one_orbit(attitude: Array, momentum: Array) -> None:
    times = np.linspace(0.0, _DURATION, _OUTPUTS + 1)
    reference = orbit(_FIG11B, attitude, momentum, times, 1e-15)[:, 4:]
    starts = Starts(_FIG11B, attitude, momentum)
    begin = np.array([*starts.attitudes[0], 0.0, 0.0])
    level = Level(float(starts.rows[0, _BALL_SIZE]), 0.0)

    def ours(tolerance: float) -> _Run:
        return lambda: orbit(_FIG11B, attitude, momentum, times, tolerance)[:, 4:]

    def rate(_: float, state: Array) -> Array:
        q = state[:4] / np.linalg.norm(state[:4])
        return np.array(PATH.rate((*q.tolist(), 0.0, 0.0), _FIG11B, level))

    def scipys(tolerance: float) -> _Run:
        def run() -> Array:
            keep: dict[str, Any] = {"rtol": tolerance, "atol": tolerance}
            solved = solve_ivp(rate, (0.0, _DURATION), begin, "DOP853", times, **keep)
            return starts.turned_back(solved.y.T[None, :, 4:])[0]

        return run

    def heyokas(tolerance: float) -> _Run:
        form, pars = equations_of(PATH, _FIG11B), pars_of(starts)[0]
        ta = hy.taylor_adaptive(form, np.zeros(6), pars=pars, tol=tolerance)

        def run() -> Array:
            ta.time, ta.state[:] = 0.0, begin
            return starts.turned_back(ta.propagate_grid(times)[5][None, :, 4:])[0]

        return run

    def error(path: Array) -> float:
        return float(np.abs(path - reference).max())

    _compare(
        f"one orbit with path, {_DURATION:g} s, {_OUTPUTS} outputs",
        1e-4,
        _Contender("this", ours, error, _OURS),
        _Contender("scipy DOP853, Python", scipys, error, (1e-9, 1e-10), rounds=2),
        _Contender("heyoka", heyokas, error, _HEYOKAS),
    )


def _ensembles(attitudes: Array, momenta: Array) -> None:
    starts, first = Starts(_FIG11B, attitudes, momenta), (attitudes[:_LANES], momenta[:_LANES])
    best = orbits(_FIG11B, *first, np.array([0.0, _DURATION]), 1e-15)
    begin, ends = np.zeros((_MANY, 2)), (_DURATION,)
    turned = np.concatenate([starts.attitudes, begin], axis=1)
    with_paths = _in_batches(equations_of(PATH, _FIG11B), turned, pars_of(starts), ends)

    def path_error(end: Array) -> float:
        points = Starts(_FIG11B, *first).turned_back(end[:, None, 4:])
        return _median_error(best.contact_points[:, 1])(points[:, 0])

    _compare(
        f"{_MANY} orbits with paths, {_DURATION:g} s, each",
        2e-5,
        _Contender("this, q X Y", _ours(PATH, starts, begin, ends), path_error, _OURS, _MANY),
        _Contender("heyoka, q X Y", with_paths, path_error, _HEYOKAS, _MANY),
    )

    gamma_error = _median_error(rotation_matrix(best.attitudes[:, 1])[:, 2])

    _compare(
        f"{_MANY} orbits without paths, {_DURATION:g} s, each",
        2e-5,
        _Contender(
            "this, q",
            _ours(RETURN, starts, begin[:, :0], ends),
            lambda end: gamma_error(rotation_matrix(end)[:, 2]),
            _OURS,
            _MANY,
        ),
        _Contender(
            "heyoka, γ M",
            _in_batches(_level_equations(_FIG11B), _level_states(attitudes, momenta), None, ends),
            lambda end: gamma_error(end[:, :3]),
            _HEYOKAS,
            _MANY,
        ),
    )


def _level_states(attitudes: Array, momenta: Array) -> Array:
    axes = rotation_matrix(attitudes)
    return np.concatenate([axes[:, 2], np.einsum("nij,ni->nj", axes, momenta)], axis=1)


def _section_points(attitudes: Array, momenta: Array) -> None:
    first = attitudes[:_LANES], momenta[:_LANES]
    best = sections_of(_FIG11B, *first, _POINTS, tolerance=1e-15).times
    horizon = float(best.max()) + 1.0
    form, begin = _level_equations(_FIG11B), _level_states(*first)

    def ours(tolerance: float) -> _Run:
        return lambda: sections_of(_FIG11B, attitudes, momenta, _POINTS, tolerance=tolerance).times[
            :_LANES
        ]

    def heyokas(tolerance: float) -> _Run:
        gamma, M = [pair[0] for pair in form[:3]], [pair[0] for pair in form[3:]]
        points: list[list[tuple[float, Array]]] = [[] for _ in range(_LANES)]

        def crossed(ta: Any, when: float, _: int, lane: int) -> None:
            ta.update_d_output(np.full(_LANES, when))
            state = ta.d_output[:, lane]
            if state[2] < 0 and when > 1e-9:
                points[lane].append((when, state.copy()))

        event = hy.nt_event_batch(M[1] * gamma[0] - M[0] * gamma[1], crossed)
        ta = _batch(form, begin, None, tolerance, nt_events=[event])

        def run() -> list[list[float]]:
            for lane in points:
                lane.clear()
            ta.set_time(0.0)
            ta.state[:] = begin.T
            ta.propagate_until(horizon)
            return [[when for when, _ in lane] for lane in points]

        return run

    def error(times: Any) -> float:
        last = [lane[_POINTS - 1] for lane in times]
        return float(np.median(np.abs(last - best[:, -1])))

    # heyoka's lanes all run to the same time, so they find more points.
    points_found = sum(len(lane) for lane in heyokas(1e-10)())
    _compare(
        "section points, each",
        1e-5,
        _Contender("this", ours, error, _OURS, _MANY * _POINTS),
        _Contender("heyoka, events", heyokas, error, _HEYOKAS[1:], points_found),
    )


def _exponents(attitudes: Array, momenta: Array) -> None:
    starts, ends = Starts(_FIG11B, attitudes, momenta), (50.0, 400.0)
    rest = np.tile([*ANY_TURN, 0.0, 0.0], (_MANY, 1))
    best = starts.march(DEVIATION, rest, np.array(ends[:1]), 1e-15)[0][:_LANES, 0]
    logs = _median_error(best[:, 7:])

    def error(states: Array) -> float:
        return logs(states[:, 7:])

    form, begin = equations_of(DEVIATION, _FIG11B), np.concatenate([starts.attitudes, rest], axis=1)
    work = _MANY * ends[-1] / 1e4
    heyokas = _in_batches(form, begin, pars_of(starts), ends)
    _compare(
        "exponents, per 1e4 time units",
        3e-7,
        _Contender("this", _ours(DEVIATION, starts, rest, ends), error, _OURS[:3], work),
        _Contender("heyoka, the same form", heyokas, error, _HEYOKAS[:3], work, rounds=3),
    )


def _main() -> None:
    """Print all tables on one thread, and again without 512-bit lanes if the machine has them."""
    print(platform.processor() or platform.machine(), platform.platform())
    print(", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy", "heyoka")))
    rng = np.random.default_rng(1)
    starts = section_starts(rng.uniform(-4, 4, _MANY), rng.uniform(0, 6, _MANY), 25.0)
    with at_most(1):
        _one_orbit(starts[0][0], starts[1][0])
        _ensembles(*starts)
        _section_points(*starts)
        _exponents(*starts)
    features = get_host_cpu_features()
    if "+avx512f" in features and _FEATURES not in os.environ:
        print("\nThe same without 512-bit lanes", flush=True)
        narrow = {**os.environ, _FEATURES: f"{features},+prefer-256-bit"}
        command = [sys.executable, "-P", "-m", "bench.kernels"]
        subprocess.run(command, env=narrow, check=True)


if __name__ == "__main__":
    _main()
