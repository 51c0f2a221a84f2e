"""Run scenes with engines of other packages.

An adapter file has the engine's settings and presets, its limitations, and a World, which is the
ball in that engine. The package is imported when a world is made. docs/engines.md has the measured
errors of every preset and the reasons for its values; docs/findings has a small program for each
peculiarity of an engine.

IdealWorld rolls ideally on the other engine's dynamics: its mass matrix and bias, our constraints.
With u = (v of the sphere's centre, ω of the shell, hinge rates), world axes, rolling v = a ω×e_z,
(ω, e_z) = 0 of the rubber model and given rates are linear in u with constant coefficients. So
u = S w + s(t) with w the free part of ω, and the engine's M du/dt + h = 0 is projected on S. There
is no term of dS/dt.
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

_CALLS = 200  # steps or calls without the engine that measure Python's part of a run
_ABREAST = 1024  # the largest number of balls in a world; their samples are held until the end


class World(ABC):
    """A ball in an engine, at its start. Making it is set-up, which the time of a run excludes.

    Attributes
    ----------
    steps : int
        The number of steps so far.
    longest : float, s
        The longest of them.
    clock : callable
        The clock for the steps: of the processor, unless another device takes them.
    friction : float
        The coefficient of the engine's contact; NaN if unknown.
    """

    friction = float("nan")

    def __init__(self, scene: Scene) -> None:
        self.scene, self.now = scene, start_state(scene)
        self.steps, self.longest, self.clock = 0, 0.0, time.process_time

    @abstractmethod
    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        """Take steps of at most `timestep` [s], and yield at each of times (n,) after the first.

        It yields functions that read the state, which the time of a run excludes.
        """

    @abstractmethod
    def python_seconds(self) -> float:
        """Return the processor time of Python in all steps so far [s]."""

    def end(self) -> None:  # noqa: B027
        """Let the engine cache what later runs can reuse, such as compiled kernels."""

    def force(self) -> Array:
        """Return the plane's force (3,) on the shell in the last step [N], world, or NaN."""
        return UNKNOWN_FORCE

    def fall(self, gravity: Array) -> None:
        """Set gravity (3,) [m/s²], world axes, in an engine whose `falls` is true."""
        raise NotImplementedError

    def hinges_at(self, t: float) -> tuple[Array, Array]:
        """Return the hinges' given angles (h,) and rates (h,) at t [s]."""
        drives = self.scene.drives
        angles, rates = np.array([(drive.angle(t), drive.rate(t)) for drive in drives], float).T
        return angles, rates

    def stretches(
        self, times: Array, timestep: float
    ) -> Iterator[tuple[float, float, int, float | None]]:
        """Yield stretches of equal steps that end at sample times (n,) and at breakpoints.

        Each is its begin [s], the length of its steps, at most `timestep` [s], their number, and
        the sample time at which it ends, or None. The steps are counted as taken.
        """
        sampled = set(times.tolist())
        cut = spans(times, self.scene.breakpoints, timestep)
        for (begin, end), length, count in zip(*(column.tolist() for column in cut), strict=True):
            self.steps, self.longest = self.steps + int(count), max(self.longest, length)
            yield begin, length, int(count), end if end in sampled else None


class SteppedWorld(World):
    """An engine that Python steps, one call a step."""

    any_step = False  # whether the steps of one world may differ in length

    @abstractmethod
    def control(self, t: float, step: float) -> None:
        """Set the motors for a step that begins at t [s]. Called only if rates change."""

    @abstractmethod
    def step(self, step: float) -> None:
        """Take one step of the engine [s]."""

    def wait(self) -> None:
        """Wait for the device, so that its work does not count as reading."""

    @abstractmethod
    def state(self) -> State:
        """Return the state that the ball is in now."""

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        lengths = spans(times, self.scene.breakpoints, timestep)[1]
        # The step is set when the world is made. Lengths may differ by rounding.
        if not self.any_step and not np.allclose(lengths, lengths[0], rtol=1e-9, atol=0.0):
            raise InputError(
                f"{self.scene.name}: this engine's steps are equal, so samples and breakpoints of "
                "the rates must fall on multiples of one step: choose another interval"
            )
        for begin, length, count, sample in self.stretches(times, timestep):
            self._loop(self.step, begin, length, count)
            if sample is not None:
                self.wait()
                yield self.state

    def python_seconds(self) -> float:
        # Commands are set as in the run, without any step.
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
            if self.scene.plane_moves:  # the mean over the step, to second order
                self.fall(self.scene.gravity_at(begin + (i + 0.5) * step))
            take(step)


class ServoWorld(SteppedWorld):
    """A stepped engine whose hinges have velocity servos, each with a target rate."""

    @abstractmethod
    def turn(self, rates: Array) -> None:
        """Set the target rates (h,) of the hinges [rad/s]."""

    def control(self, t: float, step: float) -> None:
        # A semi-implicit step uses the velocities at its end.
        self.turn(self.hinges_at(t + step)[1])


def on_device(world: World, device: str, cuda: bool) -> str:
    """Return the device of a world's balls, and set its clock.

    cuda: whether the engine has a CUDA device. Raises InputError if the device is missing.
    """
    if device == "cuda" and not cuda:
        raise InputError("device 'cuda' needs a CUDA device, which was not found: give cpu")
    if device == "cuda":
        world.clock = time.perf_counter
    return device


def seconds_per_call(call: Callable[[], object]) -> float:
    """Return the mean processor time of a call [s]."""
    began = time.process_time()
    for _ in range(_CALLS):
        call()
    return (time.process_time() - began) / _CALLS


@dataclass(frozen=True, kw_only=True)
class StepSettings(EngineSettings):
    """Settings of an engine with equal steps [s]. In an adapter's settings None is the default."""

    timestep: float


def given(**values: Any) -> dict[str, Any]:
    """Return the values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def by_name(*presets: Kind) -> dict[str, Kind]:
    """Return the mapping of names to presets."""
    return {preset.name: preset for preset in presets}


@dataclass(frozen=True, kw_only=True)
class PointSettings(StepSettings):
    """Settings of an engine with a point contact, which does not resist spin.

    Attributes
    ----------
    spin_part : float
        Our damping torque against the spin, as a part of inertia over step; 0 for no torque. An
        explicit torque is stable up to 2.
    ideal : {"RK4", "DOP853"} or None
        The integrator for our constraints on the engine's mass matrix and bias. None uses the
        engine's contact.
    rtol : float
        The relative error allowed in one step of DOP853.
    """

    spin_part: float = 1.5
    ideal: Literal["RK4", "DOP853"] | None = None
    rtol: float = 1e-12


def either(contact: Callable[..., World], ideal: Callable[..., World]) -> Callable[..., World]:
    """Return the constructor of worlds with the engine's contact or with our constraints."""
    return lambda scene, settings, step: (ideal if settings.ideal else contact)(
        scene, settings, step
    )


def spin_damping(scene: Scene, settings: PointSettings, step: float) -> float:
    """Return c [N m s] of our torque -c (ω, e_z) on a rubber shell, from the least inertia."""
    if scene.rolling == "classical":
        return 0.0
    return settings.spin_part * float(np.linalg.eigvalsh(scene.ball.inertia)[0]) / step


def no_torsion(scene: Scene, instead: str = "the shell spins freely") -> str | None:
    """Return the lack of torsional friction and its consequence, if the ball needs friction."""
    if scene.rolling == "classical":
        return None
    return f"its contact has no torsional friction: {instead}"


def spins(scene: Scene, settings: PointSettings) -> str | None:
    """Return that the shell spins freely, or that our torque damps its spin; None if neither."""
    if settings.ideal:
        return None
    damped = ["our torque damps the spin"] if settings.spin_part else []
    return no_torsion(scene, *damped)


def in_single_precision(scene: Scene, settings: Any) -> str:
    """Return that an engine lacks double precision."""
    return "its state is in single precision"


@dataclass(frozen=True, kw_only=True)
class Adapter(Engine):
    """An engine of another package.

    If its presets have a `device`, a world can roll many balls there, each as if it were alone.

    Attributes
    ----------
    packages : tuple of str
        The packages that it imports.
    extra : str
        The extra of robotball that installs them, which is also the name of the engine and of its
        environment in the folder `environments`.
    world : callable
        Takes a scene, settings and the longest step [s], and scenes that differ in their starts if
        there are several; returns the ball at its start.
    lacks : callable
        Takes a scene and settings; returns in one line what the engine lacks, or None.
    falls : bool
        Whether its worlds can change gravity during a run.
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
        """The requirements of its extra, from the metadata of robotball."""
        # Each line is "requirement; marker", for example "pin>=4.1; extra == 'pinocchio'".
        lines = (line.partition("; ") for line in requires("robotball") or ())
        return tuple(needed for needed, _, on in lines if on == f"extra == '{self.extra}'")

    @property
    def installed(self) -> bool:
        """True if its packages are installed. Only parent packages are imported."""
        return all(find_spec(package) is not None for package in self.packages)

    def cannot_express(self, scene: Scene) -> str | None:
        """Return why adapters cannot roll the scene, in one line; None if they can."""
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
        """Return the scene's motion. Loads that the engine does not give are NaN.

        An engine that is not installed runs in its environment, without progress.
        """
        (motion,) = self._motions([scene], times, request)
        return motion

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes, in one world if they differ only in the start."""
        abreast = differ_in_start(scenes) and getattr(settings, "device", None) is not None
        size = _ABREAST if abreast else 1
        for i in range(0, len(scenes), size):
            yield from self._motions(scenes[i : i + size], times, Request(self, settings))

    def _motions(
        self, scenes: Sequence[Scene], times: Array, request: Request
    ) -> Iterable[ContactMotion]:
        """Return the motions of scenes in one world, here or in the engine's environment."""
        if self.installed:
            return self._rolled(scenes, times, request)
        python = interpreter_of(self.environments / self.extra)
        if python is None:
            raise not_installed(self.label.name, self.extra)
        return call(python, _rolled_by, self.extra, scenes, times, request.settings)

    def _rolled(
        self, scenes: Sequence[Scene], times: Array, request: Request
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes in one world of the engine that is installed here."""
        settings = as_own(request.settings, type(self.presets[self.default]), self.label)
        scene = scenes[0]
        # It runs nevertheless: the comparison of engines shows the error.
        if lack := self.lacks(scene, settings):
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        more = (scenes,) if len(scenes) > 1 else ()
        step = float(spans(times, scene.breakpoints, settings.timestep)[1].max())
        missed = scene.sampling_error(float(times[-1]), step)
        if missed > RATE_ERROR and getattr(settings, "ideal", None) != "DOP853":
            lack = f"a drive's error over a step of {step:g} s is {missed:.2g}: take a shorter step"
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        world = self.world(scene, settings, step, *more)
        # The time excludes reading. A state that is not finite ends the run of its ball.
        rows, spent = [np.array([start_state(scene).row for scene in scenes])], 0.0
        forces = [UNKNOWN_FORCE]
        march = world.march(times, settings.timestep)
        while len(rows) < len(times) and np.isfinite(rows[-1]).all(axis=1).any():
            began = world.clock()
            read = next(march)
            spent += world.clock() - began
            rows.append(np.atleast_2d(read().row))
            # The forces of many balls are not read.
            forces.append(world.force() if len(scenes) == 1 else UNKNOWN_FORCE)
            if request.progress is not None:
                request.progress(times[len(rows) - 1] / times[-1])
        share, python = spent / len(scenes), world.python_seconds() / len(scenes)
        world.end()
        cost = {"seconds": share, "python_seconds": python}
        for scene, states in zip(scenes, np.stack(rows, axis=1), strict=True):
            yield motion_of_rows(
                self.label, scene, times, states, settings, np.array(forces), world.friction,
                timestep=world.longest, steps=world.steps, **cost,
            )  # fmt: skip


def _rolled_by(
    name: str, scenes: Sequence[Scene], times: Array, settings: Any
) -> list[ContactMotion]:
    """Return the motions from an adapter, inside its environment."""
    engine = engine_named(name)
    assert isinstance(engine, Adapter)
    return list(engine._rolled(scenes, times, Request(engine, settings)))


def elsewhere(engine: Engine, folder: Path | str) -> Engine:
    """Return the engine with environments in a folder, if it is an adapter."""
    return replace(engine, environments=Path(folder)) if isinstance(engine, Adapter) else engine


def not_installed(engine: str, name: str) -> InputError:
    """Return the error for an engine that is not installed in any environment."""
    return InputError(f"{engine} is not installed: robotball engines --install {name}")


def version_of(distribution: str) -> str:
    """Return the version of a package without importing it."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


class IdealWorld(World):
    """A world that takes the dynamics from an engine and steps them itself.

    Steps have a fixed length, or the length for an error of `rtol`, at most the timestep.
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
        """Return M (n, n) and h (n,) of M du/dt + h = 0, with n = 6 + hinges."""

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
        # ω in world axes is the left factor: dq/dt = (0, ω)∘q/2.
        turn = eq.quaternion_product((0.0, *as_vector(state.turning)), (w, x, y, z))
        return np.array([*state.velocity[:2], *(part / 2 for part in turn), *free_rate])

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
        # It restarts at every breakpoint: a step across one has an error of 1e-5.
        stops = np.union1d([t for t in self.scene.breakpoints if t < times[-1]], times[[0, -1]])
        # With the radius as scale X and Y do not shorten steps when they pass zero.
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
        """Return the processor time of our constraints [s], without the engine's dynamics."""
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
    """Return M and h for u = (v, ω, rates), given both for (ω, v, rates)."""
    order = np.array([3, 4, 5, 0, 1, 2, *range(6, len(h))])
    return M[np.ix_(order, order)], h[order]
