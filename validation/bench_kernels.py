"""The compiled stepper against scipy and heyoka at matched error (extra `bench`).

Every contender runs at several tolerances, all in turn, several rounds, set-up outside the clock.
The least time of each is drawn against its error, and times are read off at the same error.
heyoka runs as its manual advises for speed: no compact mode, batches of 8; of its
forms the fastest counts. All run on one thread.
"""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import heyoka as hy
import numpy as np
from scipy.integrate import solve_ivp

from robotball.kernels import Starts, orbit, orbits
from robotball.parameters import Parameters
from robotball.rotations import Array, rotation_matrix
from robotball.sections import section, section_starts
from robotball.systems import DEVIATION, PATH, RETURN
from validation.heyoka_forms import batch, equations_of, level_equations, pars_of

A, D = (0.8, 0.6, 0.7), 0.9  # Fig. 11b: the strange attractor
BALL = Parameters(
    "rubber", (1 / A[0] - D, 1 / A[1] - D, 1 / A[2] - D), D, 1.0, (0.0, 0.0, 2.0), (2.0, 3.0, 0.0)
)
DURATION, OUTPUTS, MANY, POINTS = 100.0, 1000, 256, 25
ROUNDS = 7


@dataclass
class Curve:
    """One contender's times and errors, by tolerance."""

    run: Callable[[float], Callable[[], Any]]
    tolerances: tuple[float, ...]
    error: Callable[[Any], float]
    rounds: int = ROUNDS
    seconds: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def at(self, error: float) -> float:
        """The time at an error, between the tolerances by powers [s]."""
        order = np.argsort(self.errors)
        return float(
            np.exp(
                np.interp(
                    np.log(error),
                    np.log(np.array(self.errors)[order]),
                    np.log(np.array(self.seconds)[order]),
                )
            )
        )


def measure(curves: dict[str, Curve]) -> None:
    """Fill in the curves, all contenders in turn in every round."""
    prepared = {
        (name, tolerance): curve.run(tolerance)
        for name, curve in curves.items()
        for tolerance in curve.tolerances
    }
    best: dict[tuple[str, float], float] = {}
    for i in range(max(curve.rounds for curve in curves.values())):
        for (name, tolerance), run in prepared.items():
            if i >= curves[name].rounds:
                continue
            begin = time.perf_counter()
            result = run()
            seconds = time.perf_counter() - begin
            best[name, tolerance] = min(best.get((name, tolerance), np.inf), seconds)
            if i == 0:
                curves[name].errors.append(curves[name].error(result))
    for (name, _), seconds in best.items():
        curves[name].seconds.append(seconds)


def report(title: str, unit: float, curves: dict[str, Curve], error: float) -> None:
    """One table: every measured time, and the ratios at the same error."""
    print(f"\n{title}")
    for name, curve in curves.items():
        cells = (
            f"{tolerance:.0e}: {seconds / unit * 1e6:9.1f} µs, error {e:.0e}"
            for tolerance, seconds, e in zip(
                curve.tolerances, curve.seconds, curve.errors, strict=True
            )
        )
        print(f"  {name:24}", " | ".join(cells))
    ours = next(iter(curves.values())).at(error)
    for name, curve in list(curves.items())[1:]:
        print(f"  at error {error:.0e}: {curve.at(error) / ours:.2f} times as fast as {name}")


def numpy_rate(_: float, state: Array, M_world: Array) -> Array:
    """What one writes first: (3.2) with NumPy's vectors, for (q, X, Y)."""
    q = state[:4] / np.linalg.norm(state[:4])
    alpha, beta, gamma = rotation_matrix(q)
    M = M_world[0] * alpha + M_world[1] * beta
    A_, Omega, K = np.array(A), np.array(BALL.Omega), np.array(BALL.K)
    weight = np.dot(A_ * gamma, gamma)
    Z = np.dot(Omega + A_ * K, gamma) / weight
    omega = A_ * (np.cross(M, A_ * gamma) / weight - K + Z * gamma)
    shell = omega - Omega
    return np.array(
        [
            -0.5 * np.dot(q[1:], omega),
            *(0.5 * (q[0] * omega + np.cross(q[1:], omega))),
            np.dot(beta, shell),
            -np.dot(alpha, shell),
        ]
    )


def dense(starts: Starts, attitude: Array, momentum: Array) -> None:
    """One orbit, closely sampled."""
    times = np.linspace(0.0, DURATION, OUTPUTS + 1)
    reference = orbit(BALL, attitude, momentum, times, 1e-15)[1]
    begin = np.array([*attitude, 0.0, 0.0])

    def ours(tolerance: float) -> Callable[[], Array]:
        return lambda: orbit(BALL, attitude, momentum, times, tolerance)[1]

    def scipy(tolerance: float) -> Callable[[], Array]:
        return lambda: (
            solve_ivp(
                numpy_rate,
                (0.0, DURATION),
                begin,
                "DOP853",
                times,
                args=(momentum,),
                rtol=tolerance,
                atol=tolerance,
            )
            .y[4:]
            .T
        )

    def heyoka(tolerance: float) -> Callable[[], Array]:
        ta = hy.taylor_adaptive(
            equations_of(PATH, BALL), np.zeros(6), pars=pars_of(starts)[0], tol=tolerance
        )

        def run() -> Array:
            ta.time, ta.state[:] = 0.0, [*starts.attitudes[0], 0.0, 0.0]
            return starts.turned_back(ta.propagate_grid(times)[5][None, :, 4:])[0]

        return run

    def error(path: Array) -> float:
        return float(np.abs(path - reference).max())

    curves = {
        "this": Curve(ours, (1e-8, 1e-9, 1e-10, 1e-11), error),
        "heyoka": Curve(heyoka, (1e-8, 1e-9, 1e-10, 1e-11), error),
        "scipy, NumPy": Curve(scipy, (1e-9, 1e-10), error, rounds=1),
    }
    measure(curves)
    report(f"one orbit, t = {DURATION:g}, {OUTPUTS} outputs", 1.0, curves, 1e-4)
    report("the same", 1.0, curves, 2e-5)


def ensemble(starts: Starts, attitudes: Array, momenta: Array) -> None:
    """Many orbits; the error is that of γ and the path at the end, or of γ alone."""
    times = np.array([0.0, DURATION])
    best = orbits(BALL, attitudes[:8], momenta[:8], times, 1e-15)
    gamma, path = rotation_matrix(best.attitudes[:, 1])[:, 2], best.contact_points[:, 1]

    def ours(tolerance: float) -> Callable[[], Array]:
        return lambda: orbits(BALL, attitudes, momenta, times, tolerance).contact_points[:8, 1]

    def batches(form: Any, begin: Array, pars: Array | None) -> Callable[..., Any]:
        def prepare(tolerance: float) -> Callable[[], Array]:
            ta = batch(form, begin[:8], None if pars is None else pars[:8], tolerance)

            def run() -> Array:
                for i in range(0, MANY, 8):
                    if pars is not None:
                        ta.pars[:] = pars[i : i + 8].T
                    ta.set_time(0.0)
                    ta.state[:] = begin[i : i + 8].T
                    ta.propagate_until(DURATION)
                    if i == 0:
                        first = ta.state.T.copy()
                return first

            return prepare_result(run)

        return prepare

    def prepare_result(run: Callable[[], Array]) -> Callable[[], Array]:
        return run

    axes = rotation_matrix(attitudes)
    level = np.concatenate([axes[:, 2], np.einsum("nij,ni->nj", axes, momenta)], axis=1)
    turned = np.concatenate([starts.attitudes, np.zeros((MANY, 2))], axis=1)

    def path_error(points: Array) -> float:
        return float(np.median(np.abs(points - path).max(axis=1)))

    curves = {
        "this, with paths": Curve(ours, (1e-8, 1e-9, 1e-10, 1e-11), path_error),
        "heyoka, q and path": Curve(
            batches(equations_of(PATH, BALL), turned, pars_of(starts)),
            (1e-8, 1e-9, 1e-10, 1e-11),
            lambda end: path_error(starts_back(starts, end[:, 4:])),
        ),
    }
    measure(curves)
    report(f"{MANY} orbits with paths, t = {DURATION:g}, each", MANY, curves, 2e-5)

    def attitudes_only(tolerance: float) -> Callable[[], Array]:
        def run() -> Array:
            states = starts.march(RETURN, np.zeros((MANY, 0)), times[1:], tolerance)[0]
            return rotation_matrix(states[:8, 0])[:, 2]

        return run

    def gamma_error(end: Array) -> float:
        return float(np.median(np.abs(end[:, :3] - gamma).max(axis=1)))

    curves = {
        "this, q": Curve(attitudes_only, (1e-8, 1e-9, 1e-10, 1e-11), gamma_error),
        "heyoka, gamma and M": Curve(
            batches(level_equations(BALL), level, None), (1e-8, 1e-9, 1e-10, 1e-11), gamma_error
        ),
    }
    measure(curves)
    report(f"{MANY} orbits without paths, t = {DURATION:g}, each", MANY, curves, 2e-5)


def starts_back(starts: Starts, points: Array) -> Array:
    """Points (8, 2) of the first eight starts, in world axes."""
    cos, sin = np.cos(starts.turns[:8]), np.sin(starts.turns[:8])
    X, Y = points.T
    return np.stack([cos * X - sin * Y, sin * X + cos * Y], axis=1)


def crossings(attitudes: Array, momenta: Array) -> None:
    """Section points; the error is that of the last point's time, in the median."""
    n = len(attitudes)
    best = section(BALL, attitudes[:8], momenta[:8], POINTS, tolerance=1e-15)

    def ours(tolerance: float) -> Callable[[], Array]:
        return lambda: section(BALL, attitudes, momenta, POINTS, tolerance=tolerance).times[:8]

    axes = rotation_matrix(attitudes)
    level = np.concatenate([axes[:, 2], np.einsum("nij,ni->nj", axes, momenta)], axis=1)
    horizon = float(best.times[:, -1].max()) + 1.0

    def heyoka(tolerance: float) -> Callable[[], list[list[float]]]:
        form = level_equations(BALL)
        gamma, M = [pair[0] for pair in form[:3]], [pair[0] for pair in form[3:]]
        points: list[list[float]] = [[] for _ in range(8)]
        states: list[Array] = []

        def seen(ta: Any, when: float, _: int, lane: int) -> None:
            ta.update_d_output(np.full(8, when))
            if ta.d_output[2, lane] < 0 and when > 1e-9:
                points[lane].append(when)
                states.append(ta.d_output[:, lane].copy())

        event = hy.nt_event_batch(M[1] * gamma[0] - M[0] * gamma[1], seen)
        ta = batch(form, level[:8], None, tolerance, nt_events=[event])

        def run() -> list[list[float]]:
            for lane in range(8):
                points[lane] = []
            ta.set_time(0.0)
            ta.state[:] = level[:8].T
            ta.propagate_until(horizon)
            return points

        return run

    def error(found: Any) -> float:
        return float(
            np.median(
                [abs(row[POINTS - 1] - t[-1]) for row, t in zip(found, best.times, strict=True)]
            )
        )

    ours_curve = Curve(ours, (1e-8, 1e-9, 1e-10, 1e-11), error)
    peer = Curve(heyoka, (1e-8, 1e-9, 1e-10, 1e-11), error)
    measure({"this": ours_curve, "heyoka": peer})
    found = sum(len(row) for row in heyoka(1e-9)())
    ours_curve.seconds = [s / (n * POINTS) for s in ours_curve.seconds]
    peer.seconds = [s / found for s in peer.seconds]
    report("section points, each", 1.0, {"this": ours_curve, "heyoka, events": peer}, 1e-5)


def exponents_(starts: Starts) -> None:
    """The equations of the exponents, without and with renormalisation alike, at one tolerance."""
    duration = 200.0
    rest = np.tile([0.6, 0.48, 0.64, 0.0, 0.0], (MANY, 1))
    begin = np.concatenate([starts.attitudes, rest], axis=1)
    best = starts.march(DEVIATION, rest, np.array([50.0]), 1e-15)[0][:8, 0]
    horizons = (50.0, duration)

    def error(states: Array) -> float:
        return float(np.median(np.abs(states - best)[:, 7:].max(axis=1)))

    def ours(tolerance: float) -> Callable[[], Array]:
        def run() -> Array:
            return starts.march(DEVIATION, rest, np.array(horizons), tolerance)[0][:8, 0]

        return run

    def heyoka(tolerance: float) -> Callable[[], Array]:
        pars = pars_of(starts)
        ta = batch(equations_of(DEVIATION, BALL), begin[:8], pars[:8], tolerance)

        def run() -> Array:
            for i in range(0, MANY, 8):
                ta.pars[:] = pars[i : i + 8].T
                ta.set_time(0.0)
                ta.state[:] = begin[i : i + 8].T
                ta.propagate_until(horizons[0])
                if i == 0:
                    early = ta.state.T.copy()
                ta.propagate_until(horizons[1])
            return early

        return run

    curves = {
        "this": Curve(ours, (1e-8, 1e-9, 1e-10), error),
        "heyoka": Curve(heyoka, (1e-7, 1e-8, 1e-9, 1e-10), error, rounds=4),
    }
    measure(curves)
    report("exponents, per 1e4 time units", MANY * duration / 1e4, curves, 1e-6)


def main() -> None:
    """All tables."""
    print(platform.processor() or platform.machine(), "·", platform.platform())
    print(", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "scipy", "heyoka")))
    rng = np.random.default_rng(1)
    attitudes, momenta = section_starts(rng.uniform(-4, 4, MANY), rng.uniform(0, 6, MANY), 25.0)
    starts = Starts(BALL, attitudes, momenta)
    dense(Starts(BALL, attitudes[:1], momenta[:1]), attitudes[0], momenta[0])
    ensemble(starts, attitudes, momenta)
    crossings(attitudes, momenta)
    exponents_(starts)


if __name__ == "__main__":
    main()
