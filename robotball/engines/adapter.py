"""Adapters: run a scene in an engine of another package.

An adapter is one file with the engine's settings, its presets, the scenes it cannot express, and a
World: the ball built in that engine, ready to step. The package is imported when a World is made.
docs/engines.md explains every preset; docs/findings has a small program for each peculiarity of an
engine.

IdealWorld imposes ideal rolling on the engine's mass matrix M and bias h. In world axes
u = (v of the sphere's centre, ω of the shell, hinge rates). Rolling v = a ω×e_z, the rubber model's
(ω, e_z) = 0 and prescribed hinge rates are linear in u with constant coefficients: u = S w + s(t),
where w is the free part of ω. Projecting M du/dt + h = 0 on S therefore needs no dS/dt. On a
turning plane, s(t) has the velocity of the plane under the ball.
"""

import ctypes
import os
import shutil
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from cProfile import Profile
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from tempfile import NamedTemporaryFile, gettempdir
from typing import Any, Literal

import numpy as np

from robotball.engines.engine import Engine, Kind, Request, as_own, engine_named
from robotball.engines.environments import ENVIRONMENTS, call, interpreter_of
from robotball.engines.many_motions import differ_in_start
from robotball.engines.observe import spans
from robotball.engines.states import UNKNOWN_FORCE, State, motions_of, start_state, start_states
from robotball.errors import InputError, warn
from robotball.motion import RATE_ERROR, ContactMotion, EngineSettings, Label, versions
from robotball.robot.formulas import as_vector
from robotball.robot.scene import DOWN, Scene
from robotball.rotations import Array, quaternion_product
from robotball.theory.dop853 import Compensated, Rate, one_by_one

_CALLS = 200  # calls or steps without the engine, to time Python's share of a run
_LAUNCH = 10e-6  # s; a compiled function that takes less is counted as a launch, or as Python
_BALL = 1e5  # bytes of a ball in a world; MuJoCo Warp and Newton take 4.3e4 and 4.7e4
_SHARE = 0.25  # fraction of the memory and of the disk, for one world


class World(ABC):
    """A ball in an engine, at its initial state. To make a World is not part of a run's time.

    steps, longest: number of steps so far, and the longest step [s]. clock: measures the time of
    the steps, in processor time unless another device takes them. friction: the contact's
    coefficient, NaN if unknown.
    """

    friction = float("nan")

    def __init__(self, scene: Scene) -> None:
        self.scene, self.now = scene, start_state(scene)
        self.steps, self.longest, self.clock = 0, 0.0, time.process_time

    @abstractmethod
    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        """Step to each of times (n,) after the first, and yield a function that reads the state.

        No step exceeds `timestep` [s]. Reading a state is not part of a run's time.
        """

    @abstractmethod
    def python_seconds(self) -> float:
        """Return the processor time that Python took in all steps [s]."""

    def end(self) -> None:  # noqa: B027
        """Let the engine cache what later runs can reuse, such as compiled kernels."""

    def force(self) -> Array:
        """Return the plane's force (3,) [N] on the shell in the last step, world axes, or NaN."""
        return UNKNOWN_FORCE

    def set_gravity(self, gravity: Array) -> None:
        """Set gravity (3,) [m/s²], world axes, if the adapter's `moves_plane` is true."""
        raise NotImplementedError

    def set_turn(self, rate: float) -> None:
        """Set the rate of the plane's rotation [rad/s], if `moves_plane` is true."""
        raise NotImplementedError

    def hinges_at(self, t: float) -> tuple[Array, Array]:
        """Return the prescribed hinge angles (h,) and rates (h,) at t [s]."""
        drives = self.scene.drives
        both = [(float(drive.angle(t)), float(drive.rate(t))) for drive in drives]
        angles, rates = np.reshape(both, (-1, 2)).T
        return angles, rates

    def with_turns(self, angles: Array, t: float) -> Array:
        """Return measured hinge angles (h,) with the whole turns of the drives at t [s]."""
        turn = 2 * np.pi
        return angles + turn * np.round((self.hinges_at(t)[0] - angles) / turn)

    def stretches(
        self, times: Array, timestep: float
    ) -> Iterator[tuple[float, float, int, float | None]]:
        """Yield intervals of equal steps that end on sample times (n,) and on breakpoints.

        An interval is (start time [s], step length <= `timestep` [s], number of steps, sample time
        at its end or None). The steps are counted as taken.
        """
        sampled = set(times.tolist())
        cut = spans(times, self.scene.breakpoints, timestep)
        for (begin, end), length, count in zip(*(part.tolist() for part in cut), strict=True):
            self.steps, self.longest = self.steps + int(count), max(self.longest, length)
            yield begin, length, int(count), end if end in sampled else None


class SteppedWorld(World):
    """An engine that Python steps, one call per step."""

    any_step = False  # True if the steps of one world may differ in length
    sampled = 0.0  # s, the time of the sample that is read

    @abstractmethod
    def control(self, t: float, step: float) -> None:
        """Set the hinge motors for a step that begins at t [s]. Called only if rates change."""

    @abstractmethod
    def step(self, step: float) -> None:
        """Take one step of the engine [s]."""

    def wait(self) -> None:
        """Wait until the device has finished its steps, so that they are not timed as reading."""

    @abstractmethod
    def state(self) -> State:
        """Return the current state of the ball."""

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        lengths = spans(times, self.scene.breakpoints, timestep)[1]
        # The step length is fixed at set-up. Lengths that differ by rounding count as equal.
        if not self.any_step and not np.allclose(lengths, lengths[0], rtol=1e-9, atol=0.0):
            raise InputError(
                f"{self.scene.name}: this engine uses one step length, so samples and rate "
                "breakpoints must fall on its multiples: choose another sampling interval"
            )
        for begin, length, count, sample in self.stretches(times, timestep):
            self._loop(self.step, begin, length, count)
            if sample is not None:
                self.wait()
                self.sampled = sample
                yield self.state

    def python_seconds(self) -> float:
        # The calls that set the motors are included; only the engine's steps are left out.
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
            middle = begin + (i + 0.5) * step  # means over the step to second order
            if self.scene.plane_moves:
                self.set_gravity(self.scene.gravity_at(middle))
            if self.scene.plane_turns:
                self.set_turn(float(self.scene.plane_turn.rate(middle)))
            take(step)


class ServoWorld(SteppedWorld):
    """A stepped engine whose hinges have velocity servos, each with a target rate."""

    @abstractmethod
    def set_rates(self, rates: Array) -> None:
        """Set the servos' target rates (h,) [rad/s]."""

    def control(self, t: float, step: float) -> None:
        # Semi-implicit steps: the velocities of a step are those at its end.
        self.set_rates(self.hinges_at(t + step)[1])


class CapturedWorld(SteppedWorld):
    """An engine of Warp's kernels. A step is captured as a graph, and Python launches the graph.

    captures: False if a step includes work outside kernels, so Python takes every step.
    """

    captures = True

    def __init__(self, scene: Scene, device: str) -> None:
        super().__init__(scene)
        import warp

        warp.config.log_level = warp.LOG_WARNING
        warp.init()
        self.warp, self.launches = warp, dict[float, Callable[[], None]]()
        self.device = on_device(self, device, warp.is_cuda_available())

    @abstractmethod
    def take(self, step: float) -> None:
        """Take one step of the engine [s] by launching each of its kernels from Python."""

    def launch_of(self, step: float) -> Callable[[], None]:
        """Return the launch of a step [s], captured once for a length in single precision."""
        length = float(np.float32(step))
        if length not in self.launches:
            self.launches[length] = self._captured(partial(self.take, length))
        return self.launches[length]

    def _captured(self, work: Callable[[], object]) -> Callable[[], None]:
        with self.warp.ScopedDevice(self.device), self.warp.ScopedCapture() as captured:
            work()
        return partial(self.warp.capture_launch, captured.graph)

    def step(self, step: float) -> None:
        if self.captures:
            self.launch_of(step)()
            return
        with self.warp.ScopedDevice(self.device):
            self.take(step)

    def wait(self) -> None:
        self.warp.synchronize_device(self.device)

    def python_seconds(self) -> float:
        if not self.captures:
            return python_part(self)
        launch = seconds_per_call(self._captured(lambda: self.warp.zeros(1)))
        return super().python_seconds() + launch * self.steps


def on_device(world: World, device: str, cuda: bool, install: str = "") -> str:
    """Return the device that runs a world's balls, and choose the clock for it.

    cuda: whether the engine finds a CUDA device. Raises InputError if CUDA is requested and
    missing. `install`: the package that the engine needs for CUDA.
    """
    if device == "cuda" and not cuda:
        line = f"uv pip install --python {sys.executable} '{install}', or " if install else ""
        raise InputError(f"no CUDA device found: {line}give device 'cpu' instead of 'cuda'")
    if device == "cuda":
        world.clock = time.perf_counter
    return device


def seconds_per_call(call: Callable[[], object]) -> float:
    """Return the mean processor time of a call [s]."""
    began = time.process_time()
    for _ in range(_CALLS):
        call()
    return (time.process_time() - began) / _CALLS


def python_part(world: SteppedWorld) -> float:
    """Return the processor time of Python and of launching in all steps [s].

    For engines that are written in Python. The time is measured in a few more steps, as the time
    outside compiled functions that take more than 10 µs.
    """
    take = partial(world._loop, world.step, 0.0, world.longest, 1)
    profile, whole = Profile(time.process_time), seconds_per_call(take)
    for _ in range(_CALLS):
        profile.runcall(take)
    builtin = (call for call in profile.getstats() if isinstance(call.code, str))
    compiled = sum(c.inlinetime for c in builtin if c.inlinetime > _LAUNCH * c.callcount)
    return max(0.0, whole - compiled / _CALLS) * world.steps


@dataclass(frozen=True, kw_only=True)
class StepSettings(EngineSettings):
    """Settings of an engine with equal steps [s]. A field of an adapter that is None is default."""

    timestep: float


def without_none(**values: Any) -> dict[str, Any]:
    """Return the values that are not None, which leaves an option at the engine's default."""
    return {name: value for name, value in values.items() if value is not None}


def by_name(*presets: Kind) -> dict[str, Kind]:
    return {preset.name: preset for preset in presets}


@dataclass(frozen=True, kw_only=True)
class SpinSettings(StepSettings):
    """Settings of an engine whose point contact resists no spin.

    spin_part: gain of our torque against spin, relative to inertia over step. Explicit integration
    is stable up to 2; 0 applies no torque.
    """

    spin_part: float = 1.5


@dataclass(frozen=True, kw_only=True)
class PointSettings(SpinSettings):
    """Settings of an engine with point contact, or of its dynamics without its contact."""

    ideal: Literal["RK4", "DOP853"] | None = None  # our constraints on the engine's dynamics
    rtol: float = 1e-12  # of DOP853


def either(real: Callable[..., World], ideal: Callable[..., World]) -> Callable[..., World]:
    """Return a factory: worlds with the engine's contact, or ideal worlds if settings.ideal."""
    return lambda scene, settings, step: (ideal if settings.ideal else real)(scene, settings, step)


def spin_damping(scene: Scene, settings: SpinSettings, step: float) -> float:
    """Return c of our torque -c (ω, e_z) on a rubber shell [N m s]; 0 for the classical model.

    c = spin_part · (the ball's smallest principal moment) / step.
    """
    if scene.rolling == "classical":
        return 0.0
    return settings.spin_part * float(np.linalg.eigvalsh(scene.ball.inertia)[0]) / step


def under_friction(scene: Scene, settings: Any) -> Any:
    """Return settings with the scene's limits of friction, if the settings have friction."""
    limits = without_none(friction=scene.friction.sliding, torsional=scene.friction.torsional)
    return replace(settings, **{name: limits[name] for name in limits if hasattr(settings, name)})


def no_torsion(scene: Scene, instead: str = "the shell spins freely") -> str | None:
    """Return a line if the contact lacks torsional friction that the ball needs, else None."""
    if scene.rolling == "classical":
        return None
    return f"its contact has no torsional friction: {instead}"


def spins(scene: Scene, settings: SpinSettings) -> str | None:
    """Return a line if the shell spins freely or with our damping, else None."""
    if getattr(settings, "ideal", None):
        return "robotball's constraints never let its ball slip" if scene.may_slip else None
    damped = ["a torque from robotball damps the spin"] if settings.spin_part else []
    return no_torsion(scene, *damped)


def in_single_precision(scene: Scene, settings: Any) -> str:
    return "its state is in single precision"


def _beyond_given_rates(scene: Scene) -> str | None:
    """Return a line on a scene's features beyond given rates and friction of sliding and spin."""
    if scene.ball.links:
        return "its adapter supports a shell, a frame, rotors and pendulums, but no other links"
    if any(hinge.motor for hinge in scene.hinges):
        return "its adapter needs prescribed hinge rates, but a hinge has a motor"
    if any(hinge.angle for hinge in scene.hinges):
        return "its adapter needs all hinges at angle 0 at the start"
    if scene.friction.rolling:
        return "its adapter does not support rolling friction"
    return None


@dataclass(frozen=True, kw_only=True)
class Adapter(Engine):
    """An engine of another package.

    Attributes
    ----------
    packages : tuple of str
        The names of the packages that are imported.
    extra : str
        The extra of robotball that installs the packages; also the name of engine and environment.
    world : callable
        (scene, settings, longest step [s]) -> World. If the presets have a `device`, the callable
        also takes scenes that differ only in their initial states, and rolls their balls side by
        side.
    lacks : callable
        (scene, settings) -> one line on physics that the engine lacks for the scene, or None.
    moves_plane : bool
        Whether its worlds can change gravity and turn the plane during a run.
    rolls_unbalanced : bool
        Whether its worlds also roll balls that are not balanced, and on tilted planes.
    resists_spin : bool
        Whether its contact has torsional friction.
    environments : Path
        The folder of engine environments.
    """

    label: Label
    packages: tuple[str, ...]
    extra: str
    presets: Mapping[str, StepSettings]
    world: Callable[..., World]
    lacks: Callable[[Scene, Any], str | None] = lambda *_: None
    default: str = "best"
    moves_plane: bool = False
    rolls_unbalanced: bool = False
    resists_spin: bool = False
    environments: Path = ENVIRONMENTS

    @property
    def requirements(self) -> tuple[str, ...]:
        """The requirements of the engine's extra, from robotball's own metadata."""
        # Each line is "requirement; marker", for example "pin>=4.1; extra == 'pinocchio'".
        lines = (line.partition("; ") for line in requires("robotball") or ())
        return tuple(line for line, _, marker in lines if marker == f"extra == '{self.extra}'")

    @property
    def installed(self) -> bool:
        """True if the packages are found; importing them takes too long."""
        return all(find_spec(name) is not None for name in self.packages)

    def cannot_express(self, scene: Scene) -> str | None:
        """Return the reason why the adapter cannot run the scene, in one line, or None."""
        if not (scene.plane_is_still or self.moves_plane):
            return "its adapter keeps the plane still, but this plane moves or turns"
        if scene.slip_limits[2] < np.inf and not self.resists_spin:
            return "its contact has no torsional friction, for which this scene gives a limit"
        if self.rolls_unbalanced:
            return _beyond_given_rates(scene)
        if why := replace(scene, gravity_direction=DOWN).not_reduced:
            return f"its adapter needs prescribed hinge rates in a balanced ball: {why}"
        if scene.ball.shell.offset:
            return "its adapter needs the shell's centre of mass at the sphere's centre"
        return None

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """Return the motion. Loads that the engine does not report are NaN.

        If the engine is not installed here, the engine's environment runs it, without progress
        reports.
        """
        (motion,) = self._motions([scene], times, request)
        return motion

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes, in one world if only their initial states differ."""
        device = getattr(settings, "device", None) if differ_in_start(scenes) else None
        samples = len(times) * start_states(scenes[:1]).row.nbytes
        size = 1 if device is None else _most_balls(samples, device)
        for i in range(0, len(scenes), size):
            yield from self._motions(scenes[i : i + size], times, Request(self, settings))

    def _motions(
        self, scenes: Sequence[Scene], times: Array, request: Request
    ) -> Iterator[ContactMotion]:
        """Yield the motions from one world, here or in the engine's environment."""
        with NamedTemporaryFile(prefix="robotball-") as file:
            samples = Path(file.name)
            if self.installed:
                shared = self._stepped(scenes, times, request, samples)
            elif python := interpreter_of(self.environments / self.extra, self.requirements):
                job = (self.extra, scenes, times, request.settings, samples)
                shared = call(python, stepped_by, *job)
            else:
                raise not_installed(self.label.name, self.extra)
            rows = rows_in(samples, len(scenes), len(shared["forces"]))
            yield from motions_of(scenes, times, rows, **shared)

    def _stepped(
        self, scenes: Sequence[Scene], times: Array, request: Request, samples: Path
    ) -> dict[str, Any]:
        """Step the balls of scenes in one world of the engine that is installed here.

        Writes the states to the file `samples` during the run. Returns the other arguments of
        `motions_of`.
        """
        scene, kind = scenes[0], type(self.presets[self.default])
        settings = under_friction(scene, as_own(request.settings, kind, self.label))
        # Do not refuse the scene: the comparison of engines measures the effect of what the engine
        # lacks.
        if lack := self.lacks(scene, settings):
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        more = (scenes,) if len(scenes) > 1 else ()
        step = float(spans(times, scene.breakpoints, settings.timestep)[1].max())
        missed = scene.sampling_error(float(times[-1]), step)
        if missed > RATE_ERROR and getattr(settings, "ideal", None) != "DOP853":
            limit = f"more than {RATE_ERROR:g}: use shorter steps"
            lack = f"the sampling error of a drive is {missed:.2g} at steps of {step:g} s, {limit}"
            warn(f"{scene.name}, {settings.name}: {self.label.name}: {lack}")
        world = self.world(scene, settings, step, *more)
        # Time the engine's steps only, not the reading of states. A ball's run ends at a state that
        # is not finite.
        row, spent = start_states(scenes).row, 0.0
        forces, k = np.full((len(times), 3), UNKNOWN_FORCE), 1
        march = world.march(times, settings.timestep)
        with samples.open("wb") as file:
            file.write(row.tobytes())
            while k < len(times) and np.isfinite(row).all(axis=1).any():
                began = world.clock()
                read = next(march)
                spent += world.clock() - began
                row = np.atleast_2d(read().row)
                file.write(row.astype(float).tobytes())
                if not more:  # contact forces are read for a single ball only
                    forces[k] = world.force()
                k += 1
                if request.progress is not None:
                    request.progress(times[k - 1] / times[-1])
        # An engine may raise an error in a further step from a state that is not finite.
        sound = np.isfinite(row).all()
        shared = {
            "engine": self.label, "settings": settings, "forces": forces[:k],
            "friction": world.friction, "timestep": world.longest, "steps": world.steps,
            "seconds": spent / len(scenes), "versions": versions(),
            "python_seconds": world.python_seconds() / len(scenes) if sound else None,
        }  # fmt: skip
        world.end()
        return shared


def rows_in(samples: Path, balls: int, k: int) -> Array:
    """Return the State rows (balls, k, 13 + 2h) of a file, which are read on use."""
    rows = np.asarray(np.memmap(samples, dtype=float, mode="r"))
    return rows.reshape(k, balls, -1).swapaxes(0, 1)


def _most_balls(samples: int, device: str) -> int:
    """Return how many balls fit into one world on a device, for `samples` bytes per ball."""
    disk = shutil.disk_usage(gettempdir()).free
    return max(1, int(_SHARE * min(_memory_of(device) / _BALL, disk / samples)))


def _memory_of(device: str) -> int:
    """Return the memory of the first CUDA device, or of this machine [bytes]."""
    # The engine's package may be in its environment only, so ask the driver. The world refuses a
    # device that is missing.
    if device == "cuda":
        with suppress(OSError):
            cuda, size = ctypes.CDLL("libcuda.so.1"), ctypes.c_size_t()
            if cuda.cuInit(0) == 0 == cuda.cuDeviceTotalMem_v2(ctypes.byref(size), 0):
                return size.value
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def stepped_by(
    name: str, scenes: Sequence[Scene], times: Array, settings: Any, samples: Path
) -> dict[str, Any]:
    """Return the result of an adapter's steps, called in the process of its environment."""
    engine = engine_named(name)
    assert isinstance(engine, Adapter)
    return engine._stepped(scenes, times, Request(engine, settings), samples)


def elsewhere(engine: Engine, folder: Path | str) -> Engine:
    """Return an adapter with its environments in another folder, or another engine unchanged."""
    return replace(engine, environments=Path(folder)) if isinstance(engine, Adapter) else engine


def not_installed(engine: str, name: str) -> InputError:
    """Return the error for an engine that is installed neither here nor in its environment."""
    return InputError(f"{engine} is not installed: robotball engines --install {name}")


def version_of(distribution: str) -> str:
    """Return the version of a package without importing it, or "not installed"."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


class IdealWorld(World):
    """Ideal rolling on an engine's dynamics, integrated here with RK4 or DOP853.

    RK4 takes equal steps. DOP853 chooses steps up to `timestep`, with local error `rtol`.
    """

    def __init__(self, scene: Scene, settings: PointSettings) -> None:
        super().__init__(scene)
        self.stepper, self.rtol, self.evaluations = settings.ideal, settings.rtol, 0
        a, h = scene.ball.radius, len(scene.drives)
        rolling = np.array([[0.0, a, 0.0], [-a, 0.0, 0.0], [0.0, 0.0, 0.0]])
        whole = np.concatenate([rolling, np.eye(3), np.zeros((h, 3))])
        self.S = whole[:, :2] if scene.rolling == "rubber" else whole
        self.carried = [0, 1, 5] if scene.rolling == "rubber" else [0, 1]  # carried in u

    @abstractmethod
    def dynamics(self, state: State) -> tuple[Array, Array]:
        """Return M (n, n) and h (n,) of M du/dt + h = 0, with u as above and n = 6 + h."""

    def rate(self, t: float, y: Array) -> Array:
        """Return the derivative of (X, Y, q, w)."""
        self.evaluations += 1
        state = self.state_at(t, y)
        hinges = [drive.acceleration(t) for drive in self.scene.drives]
        pushed = np.array([*np.zeros(6), *hinges])
        if self.scene.plane_moves:
            self.set_gravity(self.scene.gravity_at(t))
        if self.scene.plane_turns:
            faster = self.scene.plane_acceleration(t, *y[:2], *state.velocity[:2])
            pushed[self.carried] = faster[: len(self.carried)]
        M, h = self.dynamics(state)
        S, (w, x, y, z) = self.S, state.attitude
        free_rate = np.linalg.solve(S.T @ M @ S, -S.T @ (M @ pushed + h))
        # ω is in world axes, so it multiplies from the left: dq/dt = (0, ω)∘q/2.
        q_rate = quaternion_product((0.0, *as_vector(state.omega)), (w, x, y, z))
        return np.array([*state.velocity[:2], *(part / 2 for part in q_rate), *free_rate])

    def state_at(self, t: float, y: Array) -> State:
        u = self.S @ y[6:]
        if self.scene.plane_turns:
            u[self.carried] += self.scene.plane_velocity(t, y[:2])[: len(self.carried)]
        q = y[2:6] / np.linalg.norm(y[2:6])
        angles, rates = self.hinges_at(t)
        centre = np.array([y[0], y[1], self.scene.ball.radius])
        return State(centre, u[:3], q, u[3:6], angles, rates)

    @property
    def _start(self) -> Array:
        """The initial (X, Y, q, w)."""
        now = self.now
        return np.concatenate([now.centre[:2], now.attitude, now.omega[: self.S.shape[1]]])

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
        # Restart at every breakpoint: a step across one has an error of 1e-5.
        stops = np.union1d([t for t in self.scene.breakpoints if t < times[-1]], times[[0, -1]])
        # The scale of X and Y is the radius, so that passing zero does not shorten the step.
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
        """Return the processor time of our constraints, without the engine's dynamics [s]."""
        y, evaluations = self._start, self.evaluations
        whole = seconds_per_call(lambda: self.rate(0.0, y))
        return (whole - seconds_per_call(lambda: self.dynamics(self.now))) * evaluations


def _rk4(rate: Rate, t: float, y: Array, h: float) -> Array:
    k1 = rate(t, y)
    k2 = rate(t + h / 2, y + h / 2 * k1)
    k3 = rate(t + h / 2, y + h / 2 * k2)
    k4 = rate(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def velocity_first(M: Array, h: Array) -> tuple[Array, Array]:
    """Reorder M and h of an engine with u = (ω, v, rates) to u = (v, ω, rates)."""
    order = np.array([3, 4, 5, 0, 1, 2, *range(6, len(h))])
    return M[np.ix_(order, order)], h[order]
