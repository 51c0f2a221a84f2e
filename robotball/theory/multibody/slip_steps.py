"""Implicit steps of a shell that slips slowly, for which the equations are stiff.

The direction of friction then settles much faster than anything else changes. In these steps of
Radau IIA, the directions at the stages are separate unknowns. For given directions of friction the
equations are not stiff, and fixed-point iteration solves them. Newton's method turns the directions
until the shell slips along them. This also works at the begin of slip, where v = 0.
"""

import numpy as np
from numpy.polynomial import legendre

from robotball.rotations import Array
from robotball.theory.multibody.system import System

_COUNT = 7  # stages; the order is 13
_RTOL = 1e-10  # of the last term of a step's series; the error of the step's end is far smaller
_SOLVED = 1e-14  # the last change of a state by an iteration, relative to its size and scale
_SWEEPS, _USUAL, _FEW = 20, 14, 3  # iterations: most, wanted, and too few to judge convergence
_SAFETY, _LEAST = 0.9, 0.2  # factors of the next step
_FIRST, _TOWARD = 0.01, 0.9  # longest first step [s], and part of the time until slip would end
_TINY = 1e-300  # m/s, which keeps a matrix from being singular
NUDGE, _TURN = 1e-6, 1e-3  # s, and of a direction: differences for derivatives


def _integrals(parts: Array) -> Array:
    """Return the integrals (n, m) of Legendre's polynomials from 0 to parts (n,) of a step."""
    P = legendre.legvander(2 * parts - 1, _COUNT)
    return np.column_stack([parts, (P[:, 2:] - P[:, :-2]) / np.arange(6, 4 * _COUNT, 4)])


# The roots of Legendre's P_6 - P_7, the last of which is 1.
# NumPy 2.5 returns the roots, which are real, as complex numbers.
_NODES = (1 + np.sort(legendre.legroots([*np.zeros(_COUNT - 1), 1.0, -1.0]).real)) / 2
# From slopes at the nodes to coefficients of Legendre's polynomials, and to the states there.
_SERIES = np.linalg.inv(legendre.legvander(2 * _NODES - 1, _COUNT - 1))
_WEIGHTS = _integrals(_NODES) @ _SERIES
# A stage reads the old slopes from its own on, and the new ones of the stages before.
_IN_TURN = np.hstack([np.triu(_WEIGHTS), np.tril(_WEIGHTS, -1)])


class SlipSteps:
    """Steps of k robots from a state (n,) at t to `end` [s], with the members of `Compensated`.

    After a step the modes of the system have no direction ahead. left: the time [s] until the slip
    of the first robot would end; inf if the slip speed increases.
    """

    def __init__(self, system: System, t: float, end: float, state: Array) -> None:
        self.system, self.t, self.end, self.state = system, t, end, state
        self.next_step, begins = _FIRST, np.any(system.modes.ahead)
        system.rate(t, state)
        slips = (system.all_weights * system.slips_at_stages())[:, -1]
        # The directions of Wv (k, 3). Where slip begins, v and its rate are only rounding.
        ahead = np.zeros_like(slips) + system.modes.ahead[:, 0] if begins else slips
        self._ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        self._linearize()
        if begins:
            self.left = np.inf
        constant = np.eye(_COUNT, 1)
        self._last = t, 1.0, state, constant * self.derivative, constant * self._ahead[:, None]

    def step(self) -> str | None:
        """Take a step. Returns None, or the reason why this was impossible."""
        length = min(self.next_step, self.end - self.t, _TOWARD * self.left)
        while True:
            error, sweeps, directions, slopes = self._solve(length)
            factor = _SAFETY * max(error, _RTOL) ** (-1 / _COUNT)
            if error < 1:
                self._last = self.t, length, self.state, _SERIES @ slopes, _SERIES @ directions
                self.t = self.end if length == self.end - self.t else self.t + length
                self.state = self.state + length * (_WEIGHTS[-1] @ slopes)
                self._ahead, modes = directions[:, -1], self.system.modes
                self.system.modes = modes._replace(ahead=np.zeros((1, 1, 3)))
                self._linearize()
                self.next_step = length * min(_USUAL / sweeps, factor)
                return None
            length *= min(max(_LEAST, factor), _SAFETY)
            if length < 10 * np.spacing(self.end):
                return "the tolerance needs steps below the spacing of floating-point numbers"

    def _linearize(self) -> None:
        """Compute the derivative (n,) of the state, and how turns of the directions change it.

        The changes are of derivatives (k, 3, size) and of W dv/dt (k, 3, 3), whose components are
        last.
        """
        system, turns = self.system, np.vstack([np.zeros(3), _TURN * np.eye(3)])
        modes = system.modes
        # Four stages at the state, and four stages a moment later.
        weights, slopes = np.eye(8, k=-4), np.empty((8, len(self.state)))
        system.modes = modes._replace(ahead=np.tile(self._ahead[:, None] + turns, (1, 2, 1)))
        times, begin = np.repeat([self.t, self.t + NUDGE], 4), np.zeros_like(self.state)
        times = np.minimum(times, system.end)  # a rate may jump there
        system.stages(times, NUDGE, weights, self.state, begin, slopes)
        system.modes = modes
        slips = system.all_weights * system.slips_at_stages()
        self._turned = (slips[:, 5:] - slips[:, 4:5]) / (NUDGE * _TURN)
        rates = slopes[:4].reshape(4, len(slips), -1).transpose(1, 0, 2)
        self._by_turn = (rates[:, 1:] - rates[:, :1]) / _TURN
        self.derivative = slopes[0]
        speed, later = (float(self._ahead[0] @ slip) for slip in (slips[0, 0], slips[0, 4]))
        self.left = NUDGE * speed / (speed - later) if later < speed else np.inf

    def _solve(self, length: float) -> tuple[float, int, Array, Array]:
        """Solve the stages of a step.

        Returns its error over the tolerance, inf if this failed, the number of iterations, and the
        directions (k, m, 3) and slopes (m, n) at the stages.
        """
        system, unit = self.system, self.system.scale + np.abs(self.state)
        modes = system.modes
        times, begin = self.t + _NODES * length, np.zeros_like(self.state)
        # Start the iteration from the extrapolated last step, or from constants.
        began, before, _, series, turning = self._last
        P = legendre.legvander(2 * (times - began) / before - 1, _COUNT - 1)
        slopes, directions, change = np.tile(P @ series, (2, 1)), P @ turning, np.inf
        for sweep in range(_SWEEPS):
            directions /= np.sqrt((directions**2).sum(axis=2, keepdims=True))
            system.modes = modes._replace(ahead=directions)
            system.stages(times, length, _IN_TURN, self.state, begin, slopes)
            system.modes = modes
            slips = system.all_weights * system.slips_at_stages()
            speeds = (slips * directions).sum(axis=2, keepdims=True)
            if sweep == 0:
                inverse = self._inverse(length, directions, np.maximum(speeds, _TINY))
            off = slips - speeds * directions
            turn = (inverse @ off.reshape(len(off), -1, 1)).reshape(off.shape)
            directions = directions + turn
            new = slopes[_COUNT:] + np.hstack([*(turn @ self._by_turn)])
            last, change = change, length * float((np.abs(new - slopes[:_COUNT]) / unit).max())
            slopes[:_COUNT] = new
            # Judge convergence by a geometric decrease of the changes in the remaining sweeps.
            converges = change * min(change / last, 1.0) ** (_SWEEPS - sweep) < _SOLVED
            fails = sweep > _FEW and not converges
            if change < _SOLVED or fails:
                break
        error = length / _RTOL * float(np.sqrt(np.mean((_SERIES[-1] @ new / unit) ** 2)))
        solved = change < _SOLVED and (speeds[0] > 0).all()
        return error if solved else np.inf, sweep + 1, directions, new

    def _inverse(self, length: float, directions: Array, speeds: Array) -> Array:
        """Return the matrix (k, 3m, 3m) that gives turns for the parts of Wv across directions."""
        columns, rows = directions[..., None], directions[..., None, :]
        changes = -length * np.einsum("ij,kfe->kiejf", _WEIGHTS, self._turned)
        changes = changes.reshape(*directions.shape, -1)
        matrix = (changes - columns @ (rows @ changes)).reshape(*directions.shape, _COUNT, 3)
        own = columns @ rows + speeds[..., None] * np.eye(3) + np.diag(self.system.weights == 0)
        stage = np.arange(_COUNT)
        matrix[:, stage, :, stage] += own.transpose(1, 0, 2, 3)
        matrix = matrix.reshape(-1, 3 * _COUNT, 3 * _COUNT)
        try:
            return np.linalg.inv(matrix)
        except np.linalg.LinAlgError:  # with a tiny friction; the step fails
            return np.full_like(matrix, np.nan)

    def within(self, times: Array) -> Array:
        """Return states (m, n) at times (m,) in the last step."""
        began, length, state, series, _ = self._last
        return np.asarray(state + length * (_integrals((times - began) / length) @ series))
