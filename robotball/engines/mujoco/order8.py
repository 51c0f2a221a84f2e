"""Fixed steps of order 8 over MuJoCo's forward dynamics.

A step has the twelve stages of DOP853 (Hairer, Nørsett and Wanner, Solving Ordinary Differential
Equations I, II.5), without DOP853's control of the step's length. On fig12, steps of 50 ms have a
path error of 2.8e-11. RK4 with steps of 5 ms has 1.6e-9, and takes 1.5 times as long.
"""

from collections.abc import Sequence
from math import sqrt

import mujoco
import numpy as np

from robotball.engines.mujoco.control import FREE_QPOS, FREE_QVEL, Control, put, read_row
from robotball.robot import formulas as eq
from robotball.robot.drives import Rule
from robotball.rotations import Array
from robotball.theory.dop853 import INTERPOLANT, MORE, MORE_NODES, NODES, STAGES, WEIGHTS

_SLOPES = INTERPOLANT.shape[1]
# The weights of the slopes before a stage. The stage after the stages of the step is at the end of
# the step; the last three stages are only for the interpolant.
_WEIGHTS, _NODES = [WEIGHTS[0, :0], *WEIGHTS, *MORE], [0.0, *NODES.tolist(), *MORE_NODES.tolist()]
# The interpolant's weights: of the slopes, for x, x (1 - x), x² (1 - x), … with x from 0 to 1.
_CHANGE = np.append(WEIGHTS[-1], [0.0] * (_SLOPES - STAGES))
_FIRST, _LAST = np.eye(_SLOPES)[[0, STAGES]]
_CURVE = np.vstack([_CHANGE, _FIRST - _CHANGE, 2 * _CHANGE - _FIRST - _LAST, INTERPOLANT])
RULE: Rule = tuple(_NODES[:STAGES]), tuple(WEIGHTS[-1].tolist())  # the quadrature of a step
_AT_SAMPLE = 1e-9  # of a step; a sample time that is nearer to a step's begin is taken to be there


class RungeKutta:
    """Steps of an explicit Runge–Kutta method.

    weights: of the slopes before each stage, then of the step, then before the stages for an
    interpolant, if there is one. nodes: the times of these states, as fractions of the step.
    """

    def __init__(
        self, control: Control, stages: int, weights: Sequence[Array], nodes: Sequence[float]
    ) -> None:
        self.control, self._stages, self._weights, self._nodes = control, stages, weights, nodes
        self._data: mujoco.MjData | None = None
        self._length = 0.0

    def _bind(self, data: mujoco.MjData) -> None:
        """Make views of the state of `data`; memoryviews copy few numbers faster than NumPy."""
        nq, qpos, qvel, slopes = len(data.qpos), data.qpos, data.qvel, len(self._weights)
        self._data = data
        # The state at the step's begin, then the slopes of its stages.
        self._known, self._state = np.zeros((1 + slopes, nq + len(qvel))), np.zeros(nq + len(qvel))
        self._before = [self._known[: 1 + stage] for stage in range(slopes)]
        states = self._known[0], self._state
        self._begin, self._stage = ((state[:nq].data, state[nq:].data) for state in states)
        self._slopes = [
            (row[:3].data, row[3:7], row[FREE_QPOS:nq].data, row[nq:].data)
            for row in self._known[1:]
        ]
        self._qpos, self._qvel, self._quaternion = qpos.data, qvel.data, qpos[3:7]
        self._turning, self._rates = qvel[3:FREE_QVEL], qvel[FREE_QVEL:].data
        self._linear, self._accelerations = qvel[:3].data, data.qacc.data

    @np.errstate(all="ignore")  # a diverging state overflows before the monitor ends the run
    def step(self, data: mujoco.MjData, length: float) -> None:
        """Take one step of a length [s]. Leaves the sensors of the state before the step."""
        if data is not self._data:
            self._bind(data)
        if length != self._length:
            self._length = length
            self._rows = [np.append(1.0, length * row[:s]) for s, row in enumerate(self._weights)]
        self._began = data.time
        self._begin[0][:], self._begin[1][:] = self._qpos, self._qvel
        self._evaluate(data, 0, self._stages)
        self._move(data, self._stages)
        self._quaternion /= sqrt(np.dot(self._quaternion, self._quaternion))

    def _move(self, data: mujoco.MjData, stage: int) -> None:
        """Set the state and time of a stage."""
        np.dot(self._rows[stage], self._before[stage], out=self._state)
        self._qpos[:], self._qvel[:] = self._stage
        data.time = self._began + self._nodes[stage] * self._length

    def _evaluate(self, data: mujoco.MjData, first: int, end: int) -> None:
        """Evaluate the slopes of the stages from `first` to `end` - 1."""
        forward = self.control.forward
        for stage in range(first, end):
            if stage:
                self._move(data, stage)
            forward(data, stage == 0)
            linear, quaternion, rates, accelerations = self._slopes[stage]
            linear[:], rates[:], accelerations[:] = self._linear, self._rates, self._accelerations
            quaternion[:] = eq.attitude_rate(
                tuple(self._quaternion.tolist()), tuple(self._turning.tolist())
            )


class Order8(RungeKutta):
    """Steps of a run, and the states inside the last step.

    Attributes
    ----------
    pending : (k,), s
        The sample times that are still to come.
    """

    def __init__(self, control: Control) -> None:
        super().__init__(control, STAGES, _WEIGHTS, _NODES)
        self.pending, self._complete = np.empty(0), False

    def step(self, data: mujoco.MjData, length: float) -> None:
        """Take one step of a length [s]. Leaves the sensors of the state before the step."""
        self._complete = False
        super().step(data, length)

    def within(self, data: mujoco.MjData, times: Array) -> Array:
        """Return the states (m, n) at times (m,) [s] inside the last step, by its interpolant.

        The method may leave another state in `data`.
        """
        if not self._complete:
            self._evaluate(data, STAGES, _SLOPES)
            self._complete = True
        powers = np.empty((len(_CURVE), len(times)))
        powers[::2] = part = (times - self._began) / self._length
        powers[1::2] = 1 - part
        np.multiply.accumulate(powers, out=powers)
        weights = self._length * np.dot(powers.T, _CURVE)
        return np.asarray(self._known[0] + np.dot(weights, self._known[1:]))

    def rows(self, data: mujoco.MjData) -> tuple[bool, list[Array]]:
        """Return whether the last step began on a sample time, and the rows inside the step."""
        apart, t = _AT_SAMPLE * self._length, data.time
        at_begin = bool(len(self.pending) and self.pending[0] <= self._began + apart)
        first, end = int(at_begin), int(self.pending.searchsorted(t - apart))
        inside, self.pending = self.pending[first:end], self.pending[end:]
        if not len(inside):
            return at_begin, []
        after, rows, nq = np.concatenate([data.qpos, data.qvel]), [], len(data.qpos)
        for time, state in zip(inside.tolist(), self.within(data, inside), strict=True):
            data.time, self._qpos[:], self._qvel[:] = time, state[:nq].data, state[nq:].data
            self.control.forward(data, True)
            rows.append(read_row(data))
        put(data, t, after)
        return at_begin, rows
