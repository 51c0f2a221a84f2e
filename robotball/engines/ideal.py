"""Ideal rolling on another engine's dynamics: its mass matrix and bias, our constraints.

With u = (v of the sphere's centre, ω of the shell, hinge rates), world axes, rolling v = a ω×e_z,
(ω, e_z) = 0 of the rubber model and given rates are linear in u with constant coefficients. So
u = S w + s(t) with w the free part of ω, and the engine's M du/dt + h = 0 is projected on S: no
term of dS/dt is left to be dropped.
"""

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Literal

import numpy as np

from robotball.engines.dop853 import Compensated
from robotball.engines.links import State
from robotball.engines.worlds import World
from robotball.rotations import Array
from robotball.scene import Scene

CALLS = 200  # that are timed
Stepper = Literal["RK4", "DOP853"]


class IdealWorld(World):
    """A world that asks an engine for its dynamics and takes its steps itself.

    rtol: of DOP853, which chooses its own steps, none longer than the timestep.
    """

    def __init__(self, scene: Scene, stepper: Stepper, rtol: float) -> None:
        super().__init__(scene)
        self.stepper, self.rtol, self.evaluations = stepper, rtol, 0
        a, h = scene.ball.radius, len(scene.drives)
        rolling = np.array([[0.0, a, 0.0], [-a, 0.0, 0.0], [0.0, 0.0, 0.0]])
        whole = np.concatenate([rolling, np.eye(3), np.zeros((h, 3))])
        self.S = whole[:, :2] if scene.rolling == "rubber" else whole

    @abstractmethod
    def dynamics(self, state: State) -> tuple[Array, Array]:
        """M (n, n) and h (n,) of M du/dt + h = 0, with u as above and n = 6 + hinges."""

    def rate(self, t: float, y: Array) -> Array:
        """d/dt of (X, Y, q, w)."""
        self.evaluations += 1
        state = self.state_at(t, y)
        hinges = [drive.acceleration(t) for drive in self.scene.drives]
        pushed = np.array([*np.zeros(6), *hinges])
        M, h = self.dynamics(state)
        S, (x, y_, z), (q0, q1, q2, q3) = self.S, state.turning, state.attitude
        w_rate = np.linalg.solve(S.T @ M @ S, -S.T @ (M @ pushed + h))
        turn = (
            -x * q1 - y_ * q2 - z * q3,
            x * q0 + y_ * q3 - z * q2,
            y_ * q0 + z * q1 - x * q3,
            z * q0 + x * q2 - y_ * q1,
        )
        return np.array([*state.velocity[:2], *(each / 2 for each in turn), *w_rate])

    def state_at(self, t: float, y: Array) -> State:
        """The state of (X, Y, q, w)."""
        drives = self.scene.drives
        u = self.S @ y[6:]
        q = y[2:6] / np.linalg.norm(y[2:6])
        angles, rates = np.array([(drive.angle(t), drive.rate(t)) for drive in drives], float).T
        centre = np.array([y[0], y[1], self.scene.ball.radius])
        return State(centre, u[:3], q, u[3:6], angles, rates)

    def march(self, times: Array, timestep: float) -> Iterator[State]:
        now = self.now
        y = np.concatenate([now.centre[:2], now.attitude, now.turning[: self.S.shape[1]]])
        took = self._rk4 if self.stepper == "RK4" else self._dop853
        for t, state in took(times, timestep, y):
            yield self.state_at(t, state)

    def _rk4(self, times: Array, timestep: float, y: Array) -> Iterator[tuple[float, Array]]:
        for begin, length, count, sample in self.stretches(times, timestep):
            for i in range(count):
                y = _rk4(self.rate, begin + i * length, y, length)
            if sample is not None:
                yield sample, y

    def _dop853(self, times: Array, timestep: float, y: Array) -> Iterator[tuple[float, Array]]:
        stops = np.union1d([t for t in self.scene.breakpoints if t < times[-1]], times[[0, -1]])
        scale = np.array([*[self.scene.ball.radius] * 2, *[1.0] * 4, *[1.0] * (len(y) - 6)])
        for begin, end in pairwise(stops):
            solver = Compensated(self.rate, (begin, end), y, self.rtol, scale, timestep)
            while solver.running:
                before = solver.t
                if (why := solver.step()) is not None:
                    raise FloatingPointError(why)
                self.steps, self.longest = self.steps + 1, max(self.longest, solver.t - before)
                inside = times[(times > before) & (times <= solver.t)]
                yield from zip(inside.tolist(), solver.within(inside), strict=True)
            y = solver.state

    def python_seconds(self) -> float:
        """Of our constraints and our steps, without the calls for the engine's dynamics."""
        w, calls = self.now.turning[: self.S.shape[1]], range(CALLS)
        y = np.concatenate([self.now.centre[:2], self.now.attitude, w])
        began = time.process_time()
        for _ in calls:
            self.rate(0.0, y)
        half = time.process_time()
        for _ in calls:
            self.dynamics(self.now)
        ended = time.process_time()
        return (2 * half - began - ended) / CALLS * self.evaluations


def _rk4(rate: Callable[[float, Array], Array], t: float, y: Array, h: float) -> Array:
    k1 = rate(t, y)
    k2 = rate(t + h / 2, y + h / 2 * k1)
    k3 = rate(t + h / 2, y + h / 2 * k2)
    k4 = rate(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
