"""Run a scene in an engine of another package: steps, readings and the report.

An adapter is a file: its settings, its presets, what it cannot express, and a World, which is the
ball made ready in that engine. The package is imported when a world is made, not before.

IdealWorld rolls ideally on the other engine's dynamics: its mass matrix and bias, our constraints.
With u = (v of the sphere's centre, ω of the shell, hinge rates), world axes, rolling v = a ω×e_z,
(ω, e_z) = 0 of the rubber model and given rates are linear in u with constant coefficients. So
u = S w + s(t) with w the free part of ω, and the engine's M du/dt + h = 0 is projected on S: no
term of dS/dt is left to be dropped.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from itertools import pairwise
from typing import Literal

import numpy as np

from robotball.engine import Engine, Request, as_own
from robotball.engines import Compensated
from robotball.engines.links import Readings, State, readings_of, start_state, state_of_rows
from robotball.errors import InputError, warn
from robotball.motion import (
    DIVERGED,
    RATE_ERROR,
    SHORTEST_PATH,
    ContactMotion,
    ContactReport,
    EngineSettings,
    Fault,
    FaultKind,
    Label,
    Loads,
)
from robotball.rotations import Array, Mask
from robotball.scene import Scene, spans

IDLE_STEPS = 200  # of Python's part that are timed


class World(ABC):
    """A ball in an engine, at its start; what it takes to make one is set-up.

    steps, longest [s]: taken so far.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.now = scene, start_state(scene)
        self.steps, self.longest = 0, 0.0

    @abstractmethod
    def march(self, times: Array, timestep: float) -> Iterator[State]:
        """The states at sample times (n,) after the first, in steps of `timestep` at most [s]."""

    @abstractmethod
    def python_seconds(self) -> float:
        """Processor time of what Python did in all steps so far [s]."""

    def stretches(
        self, times: Array, timestep: float
    ) -> Iterator[tuple[float, float, int, float | None]]:
        """The steps that lead over sample times (n,) and breakpoints, `timestep` long at most [s].

        Of each stretch of equal ones its begin [s], their length [s] and number, and the sample
        time that it ends at, if it does. Counts them as taken.
        """
        sampled = set(times.tolist())
        cut = spans(times, self.scene.breakpoints, timestep)
        for (begin, end), length, count in zip(*(each.tolist() for each in cut), strict=True):
            self.steps, self.longest = self.steps + int(count), max(self.longest, length)
            yield begin, length, int(count), end if end in sampled else None


class SteppedWorld(World):
    """An engine that Python steps, one call a step."""

    any_step = False  # whether the steps of one world may differ in length

    @abstractmethod
    def control(self, t: float, step: float) -> None:
        """Sets the hinges' motors for a step that begins at t [s]; called where rates change."""

    @abstractmethod
    def step(self, step: float) -> None:
        """One step of the engine [s]."""

    @abstractmethod
    def state(self) -> State:
        """Where the ball is now."""

    def march(self, times: Array, timestep: float) -> Iterator[State]:
        lengths = spans(times, self.scene.breakpoints, timestep)[1]
        if not self.any_step and not np.allclose(lengths, lengths[0], rtol=1e-9, atol=0.0):
            raise InputError(
                f"{self.scene.name}: this engine's steps are all equal, and they have to end on "
                "every sample and wherever a rate breaks: sample it at equal intervals that do"
            )
        for begin, length, count, sample in self.stretches(times, timestep):
            self._loop(self.step, begin, length, count)
            if sample is not None:
                yield self.state()

    def python_seconds(self) -> float:
        count = min(IDLE_STEPS, self.steps)
        began = time.process_time()
        self._loop(_no_step, 0.0, self.longest, count)
        return (time.process_time() - began) / count * self.steps

    def _loop(self, take: Callable[[float], None], begin: float, step: float, count: int) -> None:
        if self.scene.steady:
            for _ in range(count):
                take(step)
            return
        for i in range(count):
            self.control(begin + i * step, step)
            take(step)


def _no_step(_: float) -> None:
    return


LIFTED = 0.01  # of the radius: a shell this far above the plane has left it


@dataclass(frozen=True, kw_only=True)
class StepSettings(EngineSettings):
    """Settings of an engine that takes equal steps [s]; each adapter adds its own."""

    timestep: float


class Adapter(Engine, ABC):
    """An engine of another package.

    package: what is imported; extra: the extra of ours that brings it; requirements: what that
    extra asks for; settings_type: of its settings.
    """

    package: str
    extra: str
    requirements: tuple[str, ...]
    settings_type: type[StepSettings]
    default = "best"
    least_accuracy: float | None = None
    presets: Mapping[str, StepSettings]

    @abstractmethod
    def world(self, scene: Scene, settings: StepSettings, step: float) -> World:
        """The ball at its start, for steps of this length [s]."""

    def limits(self, scene: Scene) -> str | None:
        """Why this engine in particular cannot roll the scene; None where it can."""
        return None

    def lacks(self, scene: Scene, settings: StepSettings) -> str | None:
        """What of the scene the engine has not under these settings, in a line, for a warning."""
        return None

    @property
    def installed(self) -> bool:
        """Whether its package is there; nothing is imported, but what a part's package is in."""
        return find_spec(self.package) is not None

    def cannot_express(self, scene: Scene) -> str | None:
        """What no adapter can, and then what this one cannot."""
        if scene.not_reduced:
            return (
                f"its adapter turns hinges at given rates in a balanced ball: {scene.not_reduced}"
            )
        if scene.ball.shell.offset:
            return "its adapter has the shell's centre of mass at the shell's centre"
        return self.limits(scene)

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """The motion; of its loads nothing is known, and no fault window is kept."""
        settings = as_own(request.settings, self.settings_type, self.label)
        if not self.installed:
            raise InputError(
                f"{self.label.name} is not installed: pip install 'robotball[{self.extra}]', or "
                f"robotball engines --install {self.extra} for an environment of its own"
            )
        if lack := self.lacks(scene, settings):
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        world = self.world(scene, settings, longest_step(scene, times, settings.timestep))
        rows, spent = [world.now.row], 0.0
        march = world.march(times, settings.timestep)
        while len(rows) < len(times) and np.isfinite(rows[-1]).all():
            began = time.process_time()
            state = next(march)
            spent += time.process_time() - began
            rows.append(state.row)
            if request.progress is not None:
                request.progress(times[len(rows) - 1] / times[-1])
        return motion_of(
            self.label, scene, times, np.array(rows), settings, timestep=world.longest,
            steps=world.steps, seconds=spent, python_seconds=world.python_seconds(),
        )  # fmt: skip


def longest_step(scene: Scene, times: Array, timestep: float) -> float:
    """The longest step that such a run takes [s]."""
    return float(spans(times, scene.breakpoints, timestep)[1].max())


def motion_of(
    label: Label,
    scene: Scene,
    times: Array,
    rows: Array,
    settings: EngineSettings,
    *,
    timestep: float,
    steps: int,
    seconds: float,
    python_seconds: float,
) -> ContactMotion:
    """The motion of rows (n, 13 + 2h) of State at times (n,), up to its first fault if it ends."""
    rows = rows if np.isfinite(rows[-1]).all() else rows[:-1]
    state = state_of_rows(rows)
    with np.errstate(all="ignore"):
        readings = readings_of(scene, state)
        rate_error = _rate_error(scene, times[: len(rows)], state)
        faults, kept = _faults(scene, times, state, readings, rate_error, settings)
    n, unknown = slice(kept), np.full(len(rows), np.nan)
    hinges = np.full((len(rows), len(scene.drives)), np.nan)
    return ContactMotion(
        scene=scene,
        engine=label,
        times=times[n],
        contact_point=state.centre[n, :2],
        attitude=readings.attitude[n],
        momentum=readings.momentum[n],
        angular_velocity=readings.angular_velocity[n],
        hinge_angles=state.angles[n],
        hinge_rates=state.rates[n],
        loads=Loads(np.stack([unknown] * 3, axis=1)[n], unknown[n], hinges[n]),
        report=ContactReport(
            settings=settings,
            slip=readings.slip[n],
            spin=readings.spin[n],
            depth=scene.ball.radius - state.centre[n, 2],
            friction_used=unknown[n],
            hinge_rate_error=rate_error[n],
            faults=faults,
            timestep=timestep,
            steps=steps,
            seconds=seconds,
            total_seconds=seconds,
            python_seconds=python_seconds,
        ),
    )


def _rate_error(scene: Scene, times: Array, state: State) -> Array:
    """(n,): the largest of all hinges, relative to the largest rate that each has to reach."""
    right = np.stack([drive.rate(times) for drive in scene.drives], axis=1)
    largest = np.abs(right).max(axis=0)
    return np.asarray((np.abs(state.rates - right) / np.where(largest > 0, largest, 1.0)).max(1))


def _faults(
    scene: Scene,
    times: Array,
    state: State,
    readings: Readings,
    rate_error: Array,
    settings: EngineSettings,
) -> tuple[tuple[Fault, ...], int]:
    """What went wrong, by the samples alone, and how many of them stand."""
    count, tolerance = len(state.centre), settings.error_tolerance
    slip = readings.slip
    if scene.rolling == "rubber":
        slip = slip + scene.ball.radius * np.abs(readings.spin)
    elapsed = np.diff(times[:count], prepend=0.0)
    rolled = np.cumsum(np.linalg.norm(np.diff(state.centre[:, :2], axis=0, prepend=0.0), axis=1))
    allowed = tolerance * (rolled + SHORTEST_PATH * scene.ball.radius)
    off = np.linalg.norm(readings.momentum - readings.momentum[0], axis=1)
    size = np.abs(np.concatenate([state.centre, state.velocity, state.turning], axis=1)).max(1)
    kinds: list[tuple[Mask, Fault]] = [
        (size > DIVERGED, Fault(FaultKind.DIVERGED, np.nan, fatal=True)),
        (
            state.centre[:, 2] > (1 + LIFTED) * scene.ball.radius,
            Fault(FaultKind.CONTACT_LOST, np.nan),
        ),
        (rate_error > RATE_ERROR, Fault(FaultKind.RATE_OFF, np.nan, limit=RATE_ERROR)),
        (np.cumsum(slip * elapsed) > allowed, Fault(FaultKind.SLIPPED, np.nan, limit=tolerance)),
        (
            scene.keeps_momentum & (off > tolerance * scene.momentum_scale),
            Fault(FaultKind.MOMENTUM_OFF, np.nan, limit=tolerance),
        ),
    ]
    found = [(int(np.argmax(mask)), fault) for mask, fault in kinds if mask.any()]
    if count < len(times):
        found.append((count, Fault(FaultKind.DIVERGED, np.nan, fatal=True)))
    found.sort(key=lambda each: each[0])
    ends = [row for row, fault in found if fault.fatal or settings.stop_at_fault]
    kept = min([*ends, count])
    dated = [
        Fault(f.kind, float(times[min(row, len(times) - 1)]), f.subject, f.limit, f.fatal)
        for row, f in found
        if row <= kept
    ]
    return tuple(dated), max(kept, 1)


def version_of(distribution: str) -> str:
    """Of a package that may be there; nothing is imported."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


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
