"""Run a scene in an engine of another package: steps, readings and the report.

An adapter is a file: its settings, its presets, what it cannot express, and a World, which is the
ball made ready in that engine. The package is imported when a world is made, not before.
docs/engines.md has what every preset was measured to do, and why it is as it is; docs/findings has
a small program for each peculiarity of an engine.

IdealWorld rolls ideally on the other engine's dynamics: its mass matrix and bias, our constraints.
With u = (v of the sphere's centre, ω of the shell, hinge rates), world axes, rolling v = a ω×e_z,
(ω, e_z) = 0 of the rubber model and given rates are linear in u with constant coefficients. So
u = S w + s(t) with w the free part of ω, and the engine's M du/dt + h = 0 is projected on S: no
term of dS/dt is left to be dropped.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robotball.engines.engine import Engine, Kind, Request, as_own, engine_named
from robotball.engines.environments import ENVIRONMENTS, call, interpreter_of
from robotball.engines.many_motions import differ_in_start
from robotball.engines.observe import spans
from robotball.engines.states import UNKNOWN_FORCE, State, motion_of_rows, start_state
from robotball.errors import InputError, warn
from robotball.motion import RATE_ERROR, ContactMotion, EngineSettings, Label
from robotball.robot import formulas as eq
from robotball.robot.formulas import as_vector
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.theory.dop853 import Compensated, Rate, one_by_one

# Python's part of a run is measured afterwards, on so many steps or calls without the engine.
_CALLS = 200
_ABREAST = 1024  # balls of a world at most; their samples are held until the end


class World(ABC):
    """A ball in an engine, at its start. To make one is set-up, which no run's time includes.

    steps: the number taken so far; longest: the longest of them [s]; clock: by which they are
    timed, the processor's unless another device takes them; friction: the coefficient of the
    engine's contact, where it is known.
    """

    friction = float("nan")

    def __init__(self, scene: Scene) -> None:
        self.scene, self.now = scene, start_state(scene)
        self.steps, self.longest, self.clock = 0, 0.0, time.process_time

    @abstractmethod
    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        """Take steps of `timestep` at most [s], and yield at each of times (n,) after the first.

        What is yielded reads the state, which is no part of a run's time.
        """

    @abstractmethod
    def python_seconds(self) -> float:
        """Return the processor time of Python's part in all steps so far [s]."""

    def end(self) -> None:  # noqa: B027
        """Have the engine keep for other runs what it keeps, as what it compiled."""

    def force(self) -> Array:
        """Return the plane's force on the shell in the last step (3,) [N], world, if it is known.

        The normal force is last.
        """
        return UNKNOWN_FORCE

    def fall(self, gravity: Array) -> None:
        """Set gravity (3,) [m/s²], world axes; an engine's that says so by `falls`."""
        raise NotImplementedError

    def hinges_at(self, t: float) -> tuple[Array, Array]:
        """Return the hinges' given angles (h,) and rates (h,) at t [s]."""
        drives = self.scene.drives
        angles, rates = np.array([(drive.angle(t), drive.rate(t)) for drive in drives], float).T
        return angles, rates

    def stretches(
        self, times: Array, timestep: float
    ) -> Iterator[tuple[float, float, int, float | None]]:
        """Yield stretches of equal steps that end on sample times (n,) and on breakpoints.

        Each is the time at which it begins [s], the steps' length, `timestep` at most [s], their
        number, and the sample time at which it ends, or None. The steps are counted as taken.
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
        """Set the hinges' motors for a step that begins at t [s]; called only if rates change."""

    @abstractmethod
    def step(self, step: float) -> None:
        """Take one step of the engine [s]."""

    def wait(self) -> None:
        """Wait for the steps taken: a device's own work would else count as our reading."""

    @abstractmethod
    def state(self) -> State:
        """Return the state that the ball is in now."""

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        lengths = spans(times, self.scene.breakpoints, timestep)[1]
        # The engine has its step from set-up. Lengths that differ by rounding alone count as equal.
        if not self.any_step and not np.allclose(lengths, lengths[0], rtol=1e-9, atol=0.0):
            raise InputError(
                f"{self.scene.name}: this engine's steps are all equal, and they have to end on "
                "every sample and wherever a rate breaks: sample it at equal intervals that do"
            )
        for begin, length, count, sample in self.stretches(times, timestep):
            self._loop(self.step, begin, length, count)
            if sample is not None:
                self.wait()
                yield self.state

    def python_seconds(self) -> float:
        # Commands are given to the engine as in the run, so that these calls count; no step is
        # taken.
        count = min(_CALLS, self.steps)
        began = time.process_time()
        self._loop(lambda _: None, 0.0, self.longest, count)
        return (time.process_time() - began) / count * self.steps

    def _loop(self, take: Callable[[float], None], begin: float, step: float, count: int) -> None:
        if self.scene.steady:
            for _ in range(count):
                take(step)
            return
        for i in range(count):
            self.control(begin + i * step, step)
            if self.scene.plane_moves:  # its mean over the step, but for the second order
                self.fall(self.scene.gravity_at(begin + (i + 0.5) * step))
            take(step)


class ServoWorld(SteppedWorld):
    """A stepped engine whose hinges have velocity servos, each with a target rate."""

    @abstractmethod
    def turn(self, rates: Array) -> None:
        """Set the target rates (h,) of the hinges [rad/s]."""

    def control(self, t: float, step: float) -> None:
        # These engines take semi-implicit steps, whose velocities are those at the end of a step.
        self.turn(self.hinges_at(t + step)[1])


def on_device(world: World, device: str, cuda: bool) -> str:
    """Return the device of a world's balls, and time its steps. Raises InputError for no device.

    cuda: whether the engine finds one.
    """
    if device == "cuda" and not cuda:
        raise InputError("there is no device 'cuda': give cpu, as no CUDA device is found")
    if device == "cuda":
        world.clock = time.perf_counter
    return device


def seconds_per_call(call: Callable[[], object]) -> float:
    """Return the processor time that a function takes [s], the mean of many calls."""
    began = time.process_time()
    for _ in range(_CALLS):
        call()
    return (time.process_time() - began) / _CALLS


@dataclass(frozen=True, kw_only=True)
class StepSettings(EngineSettings):
    """Settings of an engine that takes equal steps [s]; each adapter adds its own.

    In these None leaves a choice at the engine's own default.
    """

    timestep: float


def given(**values: Any) -> dict[str, Any]:
    """Return the values that are not left to the engine, which None does."""
    return {name: value for name, value in values.items() if value is not None}


def by_name(*presets: Kind) -> dict[str, Kind]:
    """Return presets by their names."""
    return {each.name: each for each in presets}


@dataclass(frozen=True, kw_only=True)
class PointSettings(StepSettings):
    """Settings of an engine whose point contact resists no spin, or that needs none.

    spin_part: of inertia over step, for a torque of ours against the spin; 0 for no torque. One
    that is explicit in time is stable up to 2.
    ideal: the steps of our own constraints on the engine's mass matrix and bias, None for its own
    contact; rtol: of DOP853.
    """

    spin_part: float = 1.5
    ideal: Literal["RK4", "DOP853"] | None = None
    rtol: float = 1e-12


def either(own: Callable[..., World], ideal: Callable[..., World]) -> Callable[..., World]:
    """Return what makes a world of the engine's own contact, or one by our constraints."""
    return lambda scene, settings, step: (ideal if settings.ideal else own)(scene, settings, step)


def spin_damping(scene: Scene, settings: PointSettings, step: float) -> float:
    """Return the c of our torque -c (ω, e_z) on a rubber shell [N m s], and 0 where there is none.

    The inertia is the ball's least moment.
    """
    if scene.rolling == "classical":
        return 0.0
    return settings.spin_part * float(np.linalg.eigvalsh(scene.ball.inertia)[0]) / step


def no_torsion(scene: Scene, instead: str = "the shell spins freely") -> str | None:
    """Return that a contact has no torsional friction, where a ball needs it, and what follows."""
    if scene.rolling == "classical":
        return None
    return f"its contact has no torsional friction: {instead}"


def spins(scene: Scene, settings: PointSettings) -> str | None:
    """Return that the shell spins freely, or that a torque of ours damps that; None if neither."""
    if settings.ideal:
        return None
    damped = ["a torque of ours damps the spin"] if settings.spin_part else []
    return no_torsion(scene, *damped)


def in_single_precision(scene: Scene, settings: Any) -> str:
    """Return that an engine lacks double precision."""
    return "its state is in single precision"


@dataclass(frozen=True, kw_only=True)
class Adapter(Engine):
    """An engine of another package.

    packages: the names that are imported; extra: the extra of robotball that brings them, the
    engine's own name and that of its environment, in the folder `environments`; world: what makes
    the ball at its start of a scene, settings and its longest step [s]; lacks: what says in a line
    what the engine lacks for a scene under settings, if anything. Both get its own kind of
    settings, that of its presets. falls: whether its worlds set gravity as they go. Where presets
    have a `device`, a world can roll many balls there, each as if it were alone; `world` then takes
    the scenes too, which differ in their starts.
    """

    label: Label
    packages: tuple[str, ...]
    extra: str
    presets: Mapping[str, StepSettings]
    world: Callable[..., World]
    lacks: Callable[[Scene, Any], str | None] = lambda *_: None
    default: str = "best"
    falls: bool = False
    environments: Path = ENVIRONMENTS

    @property
    def requirements(self) -> tuple[str, ...]:
        """The requirements of its extra, by robotball's own metadata."""
        # Each line is "requirement; marker", as in "pin>=4.1; extra == 'pinocchio'".
        lines = (line.partition("; ") for line in requires("robotball") or ())
        return tuple(needed for needed, _, on in lines if on == f"extra == '{self.extra}'")

    @property
    def installed(self) -> bool:
        """True if its packages are there. None is imported but for that of which one is a part."""
        return all(find_spec(each) is not None for each in self.packages)

    def cannot_express(self, scene: Scene) -> str | None:
        """Return why adapters cannot roll the scene, in a line, or None."""
        if scene.not_reduced:
            return (
                f"its adapter turns hinges at given rates in a balanced ball: {scene.not_reduced}"
            )
        if scene.ball.shell.offset:
            return "its adapter has the shell's centre of mass at the shell's centre"
        if scene.plane_moves and not self.falls:
            return "its adapter sets gravity once, and the plane moves"
        return None

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """Return the motion. Loads that the engine does not give are NaN.

        Where the engine is not installed it is run in its environment, without progress.
        """
        (motion,) = self._motions([scene], times, request)
        return motion

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes, in one world where they differ in the start alone."""
        abreast = differ_in_start(scenes) and getattr(settings, "device", None) is not None
        size = _ABREAST if abreast else 1
        for i in range(0, len(scenes), size):
            yield from self._motions(scenes[i : i + size], times, Request(self, settings))

    def _motions(
        self, scenes: Sequence[Scene], times: Array, request: Request
    ) -> Iterable[ContactMotion]:
        """Return the motions of scenes by one world, here or in the engine's environment."""
        if self.installed:
            return self._rolled(scenes, times, request)
        python = interpreter_of(self.environments / self.extra)
        if python is None:
            raise not_installed(self.label.name, self.extra)
        return call(python, _rolled_by, self.extra, scenes, times, request.settings)

    def _rolled(
        self, scenes: Sequence[Scene], times: Array, request: Request
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes by one world of the engine as it is installed here."""
        settings = as_own(request.settings, type(self.presets[self.default]), self.label)
        scene = scenes[0]
        # It runs all the same: how far off it then is belongs to the comparison of engines.
        if lack := self.lacks(scene, settings):
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        more = (scenes,) if len(scenes) > 1 else ()
        step = float(spans(times, scene.breakpoints, settings.timestep)[1].max())
        missed = scene.sampling_error(float(times[-1]), step)
        if missed > RATE_ERROR and getattr(settings, "ideal", None) != "DOP853":
            lack = f"a drive's error over a step of {step:g} s is {missed:.2g}; take a shorter one"
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        world = self.world(scene, settings, step, *more)
        # Only the engine's steps are timed, not the reading of its states. A state that is no
        # number ends the run of its ball.
        rows, spent = [np.array([start_state(each).row for each in scenes])], 0.0
        forces = [UNKNOWN_FORCE]
        march = world.march(times, settings.timestep)
        while len(rows) < len(times) and np.isfinite(rows[-1]).all(axis=1).any():
            began = world.clock()
            read = next(march)
            spent += world.clock() - began
            rows.append(np.atleast_2d(read().row))
            # Of balls abreast the forces are not read.
            forces.append(world.force() if len(scenes) == 1 else UNKNOWN_FORCE)
            if request.progress is not None:
                request.progress(times[len(rows) - 1] / times[-1])
        share, python = spent / len(scenes), world.python_seconds() / len(scenes)
        world.end()
        cost = {"seconds": share, "python_seconds": python}
        for each, own in zip(scenes, np.stack(rows, axis=1), strict=True):
            yield motion_of_rows(
                self.label, each, times, own, settings, np.array(forces), world.friction,
                timestep=world.longest, steps=world.steps, **cost,
            )  # fmt: skip


def _rolled_by(
    name: str, scenes: Sequence[Scene], times: Array, settings: Any
) -> list[ContactMotion]:
    """Return the motions by an adapter, as its environment has it."""
    engine = engine_named(name)
    assert isinstance(engine, Adapter)
    return list(engine._rolled(scenes, times, Request(engine, settings)))


def elsewhere(engine: Engine, folder: Path | str) -> Engine:
    """Return the engine with environments in a folder, where it is one that may need them."""
    return replace(engine, environments=Path(folder)) if isinstance(engine, Adapter) else engine


def not_installed(engine: str, name: str) -> InputError:
    """Return the error for an engine, called by a name, that is neither here nor elsewhere."""
    return InputError(f"{engine} is not installed: robotball engines --install {name}")


def version_of(distribution: str) -> str:
    """Return the version of a package that may be installed, without an import."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


class IdealWorld(World):
    """A world that asks an engine for its dynamics, and takes the steps itself.

    They are of fixed length, or DOP853's, which chooses its own, none longer than the timestep, by
    an error of `rtol` in one step.
    """

    def __init__(self, scene: Scene, settings: PointSettings) -> None:
        super().__init__(scene)
        self.stepper, self.rtol, self.evaluations = settings.ideal, settings.rtol, 0
        a, h = scene.ball.radius, len(scene.drives)
        rolling = np.array([[0.0, a, 0.0], [-a, 0.0, 0.0], [0.0, 0.0, 0.0]])
        whole = np.concatenate([rolling, np.eye(3), np.zeros((h, 3))])
        self.S = whole[:, :2] if scene.rolling == "rubber" else whole

    @abstractmethod
    def dynamics(self, state: State) -> tuple[Array, Array]:
        """Return M (n, n) and h (n,) of M du/dt + h = 0, with u as above and n = 6 + hinges."""

    def rate(self, t: float, y: Array) -> Array:
        """Return the derivative of (X, Y, q, w)."""
        self.evaluations += 1
        state = self.state_at(t, y)
        hinges = [drive.acceleration(t) for drive in self.scene.drives]
        pushed = np.array([*np.zeros(6), *hinges])
        if self.scene.plane_moves:
            self.fall(self.scene.gravity_at(t))
        M, h = self.dynamics(state)
        S, (w, x, y, z) = self.S, state.attitude
        free_rate = np.linalg.solve(S.T @ M @ S, -S.T @ (M @ pushed + h))
        # The turning is in world axes, and so stands on the left: dq/dt = (0, ω)∘q/2.
        turn = eq.quaternion_product((0.0, *as_vector(state.turning)), (w, x, y, z))
        return np.array([*state.velocity[:2], *(each / 2 for each in turn), *free_rate])

    def state_at(self, t: float, y: Array) -> State:
        """Return the state of (X, Y, q, w) at t [s]."""
        u = self.S @ y[6:]
        q = y[2:6] / np.linalg.norm(y[2:6])
        angles, rates = self.hinges_at(t)
        centre = np.array([y[0], y[1], self.scene.ball.radius])
        return State(centre, u[:3], q, u[3:6], angles, rates)

    @property
    def _start(self) -> Array:
        """The numbers (X, Y, q, w) of the start."""
        now = self.now
        return np.concatenate([now.centre[:2], now.attitude, now.turning[: self.S.shape[1]]])

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        steps = self._rk4 if self.stepper == "RK4" else self._dop853
        for t, state in steps(times, timestep, self._start):
            yield partial(self.state_at, t, state)

    def _rk4(self, times: Array, timestep: float, y: Array) -> Iterator[tuple[float, Array]]:
        for begin, length, count, sample in self.stretches(times, timestep):
            for i in range(count):
                y = _rk4(self.rate, begin + i * length, y, length)
            if sample is not None:
                yield sample, y

    def _dop853(self, times: Array, timestep: float, y: Array) -> Iterator[tuple[float, Array]]:
        # It begins anew at every breakpoint: a step across one is wrong by 1e-5.
        stops = np.union1d([t for t in self.scene.breakpoints if t < times[-1]], times[[0, -1]])
        # X and Y do not set the step where they pass zero: their scale is the radius.
        scale = np.array([*[self.scene.ball.radius] * 2, *[1.0] * 4, *[1.0] * (len(y) - 6)])
        for begin, end in pairwise(stops.tolist()):
            stages = partial(one_by_one, self.rate)
            solver = Compensated(stages, begin, end, y, self.rtol, scale, timestep)
            while solver.t < end:
                before = solver.t
                if (why := solver.step()) is not None:
                    raise FloatingPointError(why)
                self.steps, self.longest = self.steps + 1, max(self.longest, solver.t - before)
                inside = times[(times > before) & (times <= solver.t)]
                yield from zip(inside.tolist(), solver.within(inside), strict=True)
            y = solver.state

    def python_seconds(self) -> float:
        """Return that of our constraints, without the calls for the engine's dynamics."""
        y, evaluations = self._start, self.evaluations
        whole = seconds_per_call(lambda: self.rate(0.0, y))
        return (whole - seconds_per_call(lambda: self.dynamics(self.now))) * evaluations


def _rk4(rate: Rate, t: float, y: Array, h: float) -> Array:
    """Return the state after a step of the classical Runge-Kutta method from y at t, h long [s]."""
    k1 = rate(t, y)
    k2 = rate(t + h / 2, y + h / 2 * k1)
    k3 = rate(t + h / 2, y + h / 2 * k2)
    k4 = rate(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def velocity_first(M: Array, h: Array) -> tuple[Array, Array]:
    """Return M and h for u = (v, ω, rates) from those of an engine that has (ω, v, rates)."""
    order = np.array([3, 4, 5, 0, 1, 2, *range(6, len(h))])
    return M[np.ix_(order, order)], h[order]
