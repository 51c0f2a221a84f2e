"""Steps of DOP853 along a motion that is smooth only between its breakpoints and its events.

A step over an event is taken back: one that ends there takes its place, and the motion begins anew.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from robotball.engines.dop853 import Compensated
from robotball.engines.multibody import events
from robotball.engines.multibody.system import System
from robotball.errors import InputError, too_many_steps
from robotball.rotations import Array

LOOKS = 4  # within a step, for an event that comes and goes
PRESSED = 0.5  # of the weight: a ball that is pressed so hard at both ends of a step stays down
ROOT = 1e-15  # s, and relative: how near to its time an event is found


@dataclass
class March:
    """A system along a motion up to `end` [s], which may have so many steps in all.

    switches: the times of the events that it met.
    """

    system: System
    rtol: float
    end: float
    max_steps: int
    steps: int = 0
    switches: list[float] = field(default_factory=list)

    def run(self, times: Array) -> tuple[Array, Array]:
        """States (n, size) at times (n,), increasing from 0, and what is told of them (n, told).

        Raises InputError where the ball lifts off, the limit is met or a step shrinks to nothing.
        """
        system = self.system
        samples = Samples(system, times)
        state, t = events.begin(system, 0.0, system.start()), 0.0
        samples.add(0.0, state[None])
        for end in (*(t for t in system.scene.breakpoints if t < times[-1]), float(times[-1])):
            system.end = float(np.nextafter(end, t))
            state = events.begin(system, t, state)
            while t < end:
                t, state = self._piece(t, end, state, samples)
        return samples.states, samples.told

    def _piece(self, t: float, end: float, state: Array, samples: "Samples") -> tuple[float, Array]:
        """To the next event or to the end of the smooth span: the time and the state there."""
        system = self.system
        solver = self._solver(t, end, state)
        margins = events.margins(system, system.told(t, state))
        while solver.running:
            before = (solver.t, solver.state)
            self._step(solver)
            event, margins = self._event(solver, before[0], margins)
            samples.add(solver.t if event is None else event[0], solver)
            if event is not None:
                t, which = event
                self.switches.append(t)
                return t, events.switch(system, t, self._at(before, t), which)
            if system.resistance and not system.modes.standing:
                told = system.told(solver.t, solver.state)
                state = events.stand(system, solver.t, solver.state, told)
                if system.modes.standing:
                    return solver.t, state
        return solver.t, solver.state

    def _event(
        self, solver: Compensated, before: float, margins: Array
    ) -> tuple[tuple[float, int] | None, Array]:
        """The first event of the last step, as its time and margin, if any; the margins after."""
        system = self.system
        after = events.margins(system, system.told(solver.t, solver.state))
        if len(after) == 1 and min(margins[0], after[0]) > PRESSED:
            return None, after
        looks = np.linspace(before, solver.t, LOOKS + 2)

        def margin(t: float, which: int) -> float:
            state = solver.within(np.array([t]))[0]
            return float(events.margins(system, system.told(t, state))[which])

        seen = [margins]
        seen += [
            events.margins(system, system.told(t, state))
            for t, state in zip(looks[1:-1], solver.within(looks[1:-1]), strict=True)
        ]
        seen.append(after)
        found: list[tuple[float, int]] = []
        for which in range(len(after)):
            for i in range(1, len(looks)):
                if seen[i][which] >= 0:
                    continue
                begin, end = float(looks[i - 1]), float(looks[i])
                # A margin that has just begun is 0 but for rounding, of either sign.
                if margin(begin, which) > 0:
                    begin = brentq(margin, begin, end, args=(which,), xtol=ROOT, rtol=4 * ROOT)
                found.append((begin, which))
                break
        return (min(found) if found else None), after

    def _solver(self, begin: float, end: float, state: Array) -> Compensated:
        return Compensated(self.system.rate, (begin, end), state, self.rtol, self.system.scale)

    def _step(self, solver: Compensated) -> None:
        if self.steps >= self.max_steps:
            speed = 2 * float(np.linalg.norm(solver.derivative[:4]))  # dq/dt = q∘ω/2
            raise too_many_steps(self.max_steps, solver.t, self.end, speed)
        message = solver.step()
        self.steps += 1
        if message is not None:
            raise InputError(
                f"the equations could not be integrated past t = {solver.t:g} s: {message}"
            )

    def _at(self, before: tuple[float, Array], t: float) -> Array:
        """The state at t in the last step, by steps that end there."""
        if t <= before[0]:
            return before[1]
        solver = self._solver(before[0], t, before[1])
        while solver.running:
            self._step(solver)
        return solver.state


class Samples:
    """The states at the times of a motion, and what is told of them, as a march comes by."""

    def __init__(self, system: System, times: Array) -> None:
        self.system, self.times, self.done = system, times, 0
        self.states = np.empty((len(times), system.size))
        self.told = np.empty((len(times), system.told_size))

    def add(self, reached: float, solver: Compensated | Array) -> None:
        """Those up to the time reached [s], in the solver's last step or the one state there."""
        new = slice(self.done, int(np.searchsorted(self.times, reached, side="right")))
        if new.start < new.stop:
            times = self.times[new]
            self.states[new] = solver.within(times) if isinstance(solver, Compensated) else solver
            for i, t in enumerate(times.tolist(), start=new.start):
                self.told[i] = self.system.told(t, self.states[i]).numbers
            self.done = new.stop
