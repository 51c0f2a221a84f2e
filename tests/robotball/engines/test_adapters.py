"""Adapters of engines.

The shared code is tested here with states from the equations and MuJoCo's mass matrix; an engine is
run if it is installed.
"""

import sys
import time
import tomllib
import tracemalloc
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball import FaultKind
from robotball.engines import adapter
from robotball.engines.adapter import (
    Adapter,
    CapturedWorld,
    IdealWorld,
    PointSettings,
    ServoWorld,
    StepSettings,
    by_name,
    on_device,
    python_part,
    spin_damping,
)
from robotball.engines.engine import OURS, Request
from robotball.engines.environments import ENVIRONMENTS, call, interpreter_of
from robotball.engines.physx import _PhysxWorld
from robotball.engines.pinocchio import PINOCCHIO
from robotball.engines.states import (
    State,
    force_on_ball,
    links_of,
    motions_of,
    principal_inertia,
)
from robotball.motion import Label, momentum_error, path_error, slip_with_spin
from robotball.robot.scene import Friction, Scene
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from tests.messages import naming, unnamed
from tests.robotball.theory.multibody.second_form import SecondForm
from tests.robots import worked
from tests.uncaptured import rows_without_capture

pytestmark = pytest.mark.core

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
ADAPTERS = {name: engine for name in OURS if isinstance(engine := rb.engine_named(name), Adapter)}
FIG12 = rb.load_scene("fig12")


def states_of(motion: rb.Motion) -> State:
    """Return the states of shell and hinges in a motion from the equations."""
    shell, a = motion.scene.ball.shell, motion.scene.ball.radius
    half = motion.hinge_angles[:, :1] / 2
    back = conjugate(np.concatenate([np.cos(half), np.sin(half) * shell.axis], axis=1))
    shell_omega = motion.angular_velocity - motion.hinge_rates[:, :1] * shell.axis
    omega = np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), shell_omega)
    centre = np.column_stack([motion.contact_point, np.full(len(motion.times), a)])
    return State(
        centre,
        np.cross(omega, [0.0, 0.0, a]),
        multiply(motion.attitude, back),
        omega,
        motion.hinge_angles,
        motion.hinge_rates,
    )


def test_masses_and_inertias_of_the_links_add_up_to_the_balls() -> None:
    """Inertia about the centre, from principal moments, with all hinges at zero."""
    scene, inertia = rb.load_scene("three_rotors"), np.zeros((3, 3))
    links = links_of(scene)
    for link in links:
        r, (moments, axes) = link.centre + link.pivot, principal_inertia(link)
        R = rotation_matrix(axes)
        inertia += R @ np.diag(moments) @ R.T + link.mass * (r @ r * np.eye(3) - np.outer(r, r))
    assert sum(link.mass for link in links) == pytest.approx(scene.ball.mass, rel=1e-15)
    assert inertia == pytest.approx(scene.ball.inertia, abs=1e-15)


@pytest.mark.parametrize("name", [name for name in ADAPTERS if name not in ("mjx", "mujoco-warp")])
def test_an_adapter_takes_the_friction_of_the_scene(name: str) -> None:
    """Without a limit it keeps its own. The two others take it with MuJoCo's model."""
    engine, times, seen = ADAPTERS[name], rb.sample_times(0.1), list[Any]()

    def world(scene: Scene, settings: Any, step: float) -> None:
        seen.append(settings)
        raise rb.InputError("seen")

    watched: Any = replace(engine, packages=(), lacks=lambda *_: None)
    watched = replace(watched, world=world)
    settings: Any = replace(engine.presets[engine.default], friction=7.0)  # type: ignore[call-arg]
    for limits in (Friction(), Friction(sliding=0.3, torsional=0.02)):
        with pytest.raises(rb.InputError, match="seen"):
            watched.run(replace(FIG12, friction=limits), times, Request(watched, settings))
    assert [settings.friction for settings in seen] == [7.0, 0.3]
    assert getattr(seen[1], "torsional", None) == (0.02 if engine.resists_spin else None)


def test_a_contact_that_resists_no_spin_is_refused_for_limited_torsional_friction() -> None:
    scene = replace(FIG12, friction=Friction(torsional=0.02))
    refused = {name for name in ADAPTERS if ADAPTERS[name].cannot_express(scene)}
    assert refused == {"dart", "drake", "exudyn", "pinocchio", "rapier"}
    assert "torsional friction" in (ADAPTERS["dart"].cannot_express(scene) or "")


Spoil = dict[str, tuple[float, Any]]


class Repeated(ServoWorld):
    """States from the equations after steps of 0.1 s, falsified from 1 s on.

    spoil: a factor and an offset for some fields of State.
    """

    any_step = True

    def __init__(self, scene: Scene, spoil: Spoil) -> None:
        super().__init__(scene)
        self.motion = rb.integrate(scene, rb.sample_times(2.0, 0.1))
        self.spoil, self.t, self.commands, self.turns = spoil, 0.0, list[Array](), list[float]()

    def set_rates(self, rates: Array) -> None:
        self.commands.append(rates)

    def set_turn(self, rate: float) -> None:
        self.turns.append(rate)

    def step(self, step: float) -> None:
        self.t += step

    def state(self) -> State:
        i = int(np.abs(self.motion.times - self.t).argmin())
        parts = {name: part[i] for name, part in vars(states_of(self.motion)).items()}
        if self.t > 0.95:
            parts |= {name: scale * parts[name] + add for name, (scale, add) in self.spoil.items()}
        return State(**parts)


class AnyBall(Adapter):
    def cannot_express(self, scene: Scene) -> str | None:
        return None


def spoilt(spoil: Spoil) -> Adapter:
    """Return an engine with one mistake."""
    return AnyBall(
        label=Label("Spoilt", "1", "#000000"),
        packages=("robotball",),
        extra="",
        presets=by_name(StepSettings(name="best", error_tolerance=1e-3, timestep=0.1)),
        world=lambda scene, settings, step: Repeated(scene, spoil),
    )


class Abreast(Repeated):
    """Balls side by side, shifted in x by 0, 1, 2, …; the second diverges after 1 s."""

    def __init__(self, scene: Scene, scenes: Sequence[Scene] = ()) -> None:
        super().__init__(scene, {})
        self.scenes = scenes or [scene]

    def state(self) -> State:
        parts = vars(super().state()).items()
        now = State(**{name: np.array([part] * len(self.scenes)) for name, part in parts})
        now.centre[:, 0] += np.arange(len(self.scenes))
        now.centre[1:2] *= np.nan if self.t > 0.95 else 1.0
        return now


@dataclass(frozen=True, kw_only=True)
class Device(StepSettings):
    """Settings of an engine that rolls balls side by side on a device, one by one if None."""

    device: str | None


@pytest.mark.parametrize(("device", "worlds"), [("cpu", [2, 0]), (None, [0, 0, 0])])
def test_balls_side_by_side_do_not_affect_each_other(
    device: str | None, worlds: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Batches of two; a ball that diverges does not end the others' runs."""
    times, made = rb.sample_times(2.0, 0.1), list[int]()
    monkeypatch.setattr(adapter, "_most_balls", lambda size, device: 1 + size // (21 * 17 * 8))
    settings = Device(name="best", error_tolerance=1e-3, timestep=0.1, device=device)

    def world(scene: Scene, settings: Any, step: float, scenes: Sequence[Scene] = ()) -> Abreast:
        made.append(len(scenes))
        return Abreast(scene, scenes)

    engine = replace(spoilt({}), world=world)
    motions = [*rb.simulate_many([FIG12] * 3, None, times, settings=settings, engine=engine)]
    second = device is not None
    assert made == worlds
    assert [len(motion.times) for motion in motions] == [21, 10 if second else 21, 21]
    assert second == (FaultKind.DIVERGED in {fault.kind for fault in motions[1].report.faults})
    aside = [motion.contact_point[9, 0] - motions[0].contact_point[9, 0] for motion in motions]
    assert aside == pytest.approx([0.0, float(second), 0.0], abs=1e-15)


def test_a_world_has_as_many_balls_as_fit_into_a_quarter_of_memory_and_disk(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A ball takes 0.1 MB of the processor's or the card's memory; the disk has its samples."""
    failed = 0

    def card(size: Any, device: int) -> int:
        size._obj.value = 141 * 10**9
        return failed

    driver = SimpleNamespace(cuInit=lambda flags: 0, cuDeviceTotalMem_v2=card)
    monkeypatch.setattr("os.sysconf", lambda name: {"SC_PAGE_SIZE": 4096}.get(name, 10**7))
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=10**11))
    monkeypatch.setattr("ctypes.CDLL", lambda name: driver)
    assert adapter._most_balls(1, "cpu") == 102400
    assert adapter._most_balls(1, "cuda") == 352500
    assert adapter._most_balls(10**6, "cuda") == 25000
    assert adapter._most_balls(10**12, "cpu") == 1
    failed = 100
    assert adapter._most_balls(1, "cuda") == 102400
    monkeypatch.undo()  # a machine without a driver: the world will refuse the device
    assert adapter._most_balls(1, "cuda") >= 1


def test_the_samples_of_many_balls_are_not_kept_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured 4 MB at most, for 64 balls with their readings; samples take 11 MB."""
    monkeypatch.setattr(adapter, "_most_balls", lambda size, device: 10**6)
    settings = Device(name="best", error_tolerance=1e-3, timestep=0.1, device="cpu")
    engine = replace(spoilt({}), world=lambda scene, _, step, scenes=(): Abreast(scene, scenes))
    times, starts = rb.sample_times(2.0, 0.1), [FIG12.start] * 4000
    tracemalloc.start()
    motion = next(rb.simulate_many(FIG12, starts, times, settings=settings, engine=engine))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(motion.times) == 21
    assert peak < 21 * 17 * 8 * len(starts) * 0.7


def test_a_cuda_run_uses_the_wall_clock_and_is_refused_without_a_cuda_device() -> None:
    """Processor time does not measure the work of another device."""
    world = Repeated(FIG12, {})
    with pytest.raises(rb.InputError, match=naming("'cuda' cpu CUDA")):
        on_device(world, "cuda", cuda=False)
    with pytest.raises(rb.InputError, match=naming("'cuda' --python jax[cuda13] cpu")):
        on_device(world, "cuda", cuda=False, install="jax[cuda13]")
    assert on_device(world, "cpu", cuda=True) == "cpu"
    assert world.clock is time.process_time
    assert on_device(world, "cuda", cuda=True) == "cuda"
    assert world.clock is time.perf_counter


@pytest.mark.parametrize(("frequency", "warns"), [(10.0, True), (9.9, True), (0.3, False)])
def test_a_drive_that_changes_within_a_step_causes_a_warning(frequency: float, warns: bool) -> None:
    """For steps of 0.1 s. DOP853 chooses its own steps and follows the drive."""
    sine = rb.Sine(mean=2.0, amplitude=0.05, frequency=frequency, phase=np.pi / 2)
    scene, times = FIG12.with_hinges(command={"frame": sine}), rb.sample_times(2.0, 0.1)
    engine = spoilt({})
    facts = "fig12 best Spoilt drive 0.1~s"
    for chosen in (StepSettings, PointSettings):
        settings: Any = chosen(name="best", error_tolerance=1e-3, timestep=0.1)
        if chosen is PointSettings:
            settings = replace(settings, ideal="DOP853")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            rb.simulate(
                scene, times, settings=settings, engine=replace(engine, presets=by_name(settings))
            )
        lines = [str(warning.message) for warning in caught]
        assert [not unnamed(facts, line) for line in lines] == [True] * (
            warns and chosen is StepSettings
        )


X, _, Z = np.eye(3)
DIVERGED, LOST, RATE = FaultKind.DIVERGED, FaultKind.CONTACT_LOST, FaultKind.RATE_OFF
SLIPPED, OFF = FaultKind.SLIPPED, FaultKind.MOMENTUM_OFF
FASTER: Spoil = {"omega": (1.01, 0), "velocity": (1.01, 0)}  # still rolls without slip
# The tolerance is 1e-3: of the path, 2.7 m after 1 s, and of M.
MISTAKES: list[tuple[str, Spoil, dict[FaultKind, float]]] = [
    ("fig12", {"velocity": (1, 1e-5 * X)}, {}),
    ("fig12", {"velocity": (1, 0.025 * X)}, {OFF: 1.0, SLIPPED: 1.1}),
    ("fig12", {"omega": (1, 0.015 * Z)}, {SLIPPED: 1.1}),
    ("classical_regular", {"omega": (1, 1e-3 * Z)}, {}),
    ("fig12", FASTER, {OFF: 1.0}),
    ("beaver_ball", FASTER, {}),
    ("fig12", {"centre": (1, 0.0099 * Z)}, {OFF: 1.0}),
    ("fig12", {"centre": (1, 0.0101 * Z)}, {LOST: 1.0, OFF: 1.0}),
    ("fig12", {"rates": (1.0009, 0)}, {}),
    ("fig12", {"rates": (1.0011, 0)}, {RATE: 1.0}),
    ("fig12", {"velocity": (1, 1e11)}, {DIVERGED: 1.0, SLIPPED: 1.0, OFF: 1.0}),
    ("fig12", {"velocity": (np.nan, 0)}, {DIVERGED: 1.0}),
]


@pytest.mark.parametrize(("scene", "spoil", "faults"), MISTAKES)
def test_a_wrong_state_is_a_fault_of_the_run(
    scene: str, spoil: Spoil, faults: dict[FaultKind, float]
) -> None:
    """The fault has its time. The run ends there, or continues while the state is finite."""
    engine, times = spoilt(spoil), rb.sample_times(2.0, 0.1)
    for stop in (True, False):
        settings = replace(engine.presets["best"], stop_at_fault=stop)
        motion = rb.simulate(rb.load_scene(scene), times, settings=settings, engine=engine)
        end = min((t for kind, t in faults.items() if stop or kind is DIVERGED), default=2.1)
        expected = {kind: t for kind, t in faults.items() if t <= end}
        reported = motion.report.faults
        assert {fault.kind: round(fault.time, 9) for fault in reported} == expected
        ends = {kind for kind, t in expected.items() if t == end and (stop or kind is DIVERGED)}
        assert {fault.kind for fault in reported if fault.fatal} == ends
        assert len(motion.times) == round(10 * end)
        assert motion.report.timestep == pytest.approx(0.1)


def test_pythons_time_is_not_measured_from_a_state_that_is_not_finite() -> None:
    """It takes more steps, which an engine may refuse."""
    for speed, measured in ((1.0, True), (np.nan, False)):
        engine, times = spoilt({"velocity": (speed, 0)}), rb.sample_times(2.0, 0.1)
        report = rb.simulate(FIG12, times, engine=engine).report
        assert (report.python_seconds is not None) == measured


class Clocked(Repeated):
    """Steps and readings that advance a clock, with an oblique contact force."""

    shown = 0.0
    friction = 2.0

    def step(self, step: float) -> None:
        super().step(step)
        Clocked.shown += 1.0

    def state(self) -> State:
        Clocked.shown += 100.0
        return super().state()

    def force(self) -> Array:
        Clocked.shown += 100.0
        return np.array([3.0, 4.0, 10.0])


def test_reading_states_and_forces_does_not_count_as_engine_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Twenty steps take twenty seconds. The contact force is recorded; other loads are NaN."""
    monkeypatch.setattr("robotball.engines.adapter.time.process_time", lambda: Clocked.shown)
    engine = replace(spoilt({}), world=lambda scene, settings, step: Clocked(scene, {}))
    motion = rb.simulate(FIG12, rb.sample_times(2.0, 0.1), engine=engine)
    assert motion.report.seconds == 20.0
    assert motion.loads.contact_force[1:].tolist() == [[3.0, 4.0, 10.0]] * 20
    assert motion.report.friction_used[1:] == pytest.approx(0.25, rel=1e-15)
    assert np.isnan(motion.loads.contact_force[0]).all()
    assert np.isnan(motion.loads.spin_torque).all()


def test_a_contact_force_on_either_body_is_returned_as_the_force_on_the_ball() -> None:
    parts = [np.array([1.0, 0.0, -2.0]), np.array([0.0, 1.0, -1.0])]
    assert force_on_ball(parts).tolist() == [-1.0, -1.0, 3.0]
    assert force_on_ball([-part for part in parts]).tolist() == [-1.0, -1.0, 3.0]
    assert force_on_ball([]).tolist() == [0.0, 0.0, 0.0]


def test_equal_steps_end_on_every_sample_with_the_rates_of_that_time() -> None:
    """Three steps are accepted; two and a half are refused."""
    sine = rb.Sine(amplitude=1.0, frequency=0.3)
    world = Repeated(FIG12.with_hinges(command={"frame": sine}), {})
    world.any_step = False
    assert len(list(world.march(np.array([0.0, 0.1, 0.2, 0.3]), 0.1))) == 3
    rates = [(sine.rate(t), FIG12.hinges[1].rate) for t in (0.1, 0.2, 0.3)]
    assert np.array(world.commands) == pytest.approx(np.array(rates))
    with pytest.raises(rb.InputError, match=naming("step multiples")):
        list(world.march(np.array([0.0, 0.1, 0.2, 0.25]), 0.1))


def test_a_plane_turns_in_a_step_at_the_rate_of_its_middle() -> None:
    turning = replace(rb.load_scene("turntable"), plane_rotation=rb.Ramp(final=2.0, end=0.4))
    world = Repeated(turning, {})
    assert len(list(world.march(np.array([0.0, 0.1, 0.2]), 0.1))) == 2
    assert world.turns == pytest.approx([0.25, 0.75])  # as rapidly as a ramp of 5 rad/s²


class Captured(CapturedWorld):
    """A world whose ball stands still, and that records its steps."""

    any_step = True

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, "cpu")
        self.taken: list[float] = []

    def control(self, t: float, step: float) -> None:
        raise AssertionError("the rates of this scene are constant")

    def take(self, step: float) -> None:
        self.taken.append(step)

    def state(self) -> State:
        return self.now


def test_a_step_is_captured_once_for_each_length_and_launched_for_every_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Lengths that are equal in single precision share a graph. Python's time has the launches."""
    launched: list[int] = []
    world: Captured
    warp = ModuleType("warp")
    vars(warp).update(
        config=SimpleNamespace(), LOG_WARNING=0, init=lambda: None, zeros=lambda _: None,
        is_cuda_available=lambda: False, ScopedDevice=nullcontext,
        ScopedCapture=lambda: nullcontext(SimpleNamespace(graph=len(world.launches))),
        synchronize_device=lambda _: None, capture_launch=launched.append,
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "warp", warp)
    world = Captured(FIG12)
    world.launch_of(0.1)
    assert (len(world.taken), launched) == (1, [])
    assert len(list(world.march(np.array([0.0, 0.1, 0.2, 0.3, 0.35]), 0.1))) == 4
    assert world.taken == [np.float32(0.1), np.float32(0.05)]
    assert launched == [0, 0, 0, 1]
    assert world.python_seconds() > 0
    assert len(launched) > 4


def test_pythons_time_has_the_calls_of_physxs_package() -> None:
    """They are steps of 0 s, which simulate nothing."""
    calls: list[float] = []
    world = object.__new__(_PhysxWorld)
    vars(world).update(scene=FIG12, steps=10, longest=0.1)
    world.physx = SimpleNamespace(step_sync=calls.append)
    assert world.python_seconds() > 0
    assert {*calls} == {0.0}


class Timed(Repeated):
    """Steps of 1 ms in one compiled call, or in calls of 1 µs each, by a clock of ticks."""

    def __init__(self, compiled: bool, ticks: list[None]) -> None:
        super().__init__(FIG12, {})
        self.compiled, self.ticks, self.steps, self.longest = compiled, ticks, 20, 0.1

    def step(self, step: float) -> None:
        if self.compiled:
            self.ticks.extend([None] * 1000)
            return
        for _ in range(1000):
            self.ticks.append(None)


@pytest.mark.parametrize(("compiled", "seconds"), [(True, 0.0), (False, 20e-3)])
def test_the_python_of_an_engine_is_the_time_outside_its_compiled_calls(
    compiled: bool, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks: list[None] = []
    monkeypatch.setattr("robotball.engines.adapter.time.process_time", lambda: len(ticks) * 1e-6)
    assert python_part(Timed(compiled, ticks)) == pytest.approx(seconds, abs=1e-12)


class Dynamics(IdealWorld):
    """Pinocchio's world with MuJoCo's mass matrix and bias."""

    def __init__(self, scene: Scene, settings: Any, step: float) -> None:
        super().__init__(scene, settings)
        self.form = SecondForm(scene)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        R = rotation_matrix(state.attitude)
        q = np.concatenate([state.centre, state.attitude, state.angles])
        M, h = self.form.dynamics(
            q, np.concatenate([state.velocity, R.T @ state.omega, state.rates])
        )
        # MuJoCo's ω is in the shell's axes; its rate there is Rᵀ dω/dt.
        T = np.eye(len(h))
        T[3:6, 3:6] = R.T
        return T.T @ M @ T, T.T @ h


@pytest.mark.parametrize(
    ("preset", "scene", "measured", "of_momentum"),
    [
        ("best", "fig12", 1.0e-12, 4.3e-12),
        ("best", "classical_chaotic", 6.7e-13, 3.4e-12),
        ("best", "wobbling_drive", 5.7e-13, 2.1e-12),
        ("best", "beaver_ball", 4.4e-13, 2.4e-12),
        ("RK4", "wobbling_drive", 1.1e-7, 1.4e-7),
        ("RK4", "offset_routh_sphere", 3.6e-8, 5.4e-8),
        ("RK4", "inclined_plane", 7.9e-7, 1.1e-9),
        ("best", "W4", 2.8e-13, 1.7e-12),
    ],
)
def test_ideal_rolling_on_another_engines_dynamics_is_the_motion_of_the_equations(
    preset: str, scene: str, measured: float, of_momentum: float
) -> None:
    """Balanced or not, with RK4 at 20 ms or DOP853 at 1e-12. M is computed from the bodies.

    It does not slip, and a rubber ball's spin is a rounding error: measured 4.4e-16 rad/s.
    """
    base = worked(scene) if scene == "W4" else rb.load_scene(scene)
    theory = rb.integrate(
        base.with_hinges(motor=[None] * len(base.hinges)), rb.sample_times(2.0, 0.04)
    )
    parts: list[float] = []
    engine = replace(PINOCCHIO, packages=("mujoco",), world=Dynamics)
    motion = rb.simulate(
        theory.scene, theory.times, settings=preset, engine=engine, progress=parts.append
    )
    error = path_error(motion, theory)
    assert error < 3 * measured
    assert momentum_error(motion, theory) < 3 * of_momentum
    assert motion.report.slip.max() < 1e-14
    assert theory.scene.rolling == "classical" or np.abs(motion.report.spin).max() < 2e-15
    assert parts == pytest.approx(theory.times[1:] / 2.0)
    assert preset == "best" or (error > measured / 1.5 and motion.report.steps == 100)


WOBBLING = rb.Sum((2.0, rb.Sine(amplitude=1.5, frequency=0.7, phase=0.3)))


@pytest.mark.parametrize(
    ("preset", "scene", "rotation", "measured"),
    [
        ("best", "turntable", 2.0, 2.7e-15),
        ("best", "fig12", WOBBLING, 1.9e-12),
        ("RK4", "turntable", WOBBLING, 6.5e-8),  # at 20 ms
    ],
)
def test_ideal_rolling_on_a_turntable_is_the_motion_of_the_equations(
    preset: str, scene: str, rotation: Any, measured: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rubber or not. Without the acceleration of the plane's surface it is off by over a half."""
    base = replace(rb.load_scene(scene), plane_rotation=rotation)
    theory = rb.integrate(base, rb.sample_times(1.0, 0.04))
    engine = replace(PINOCCHIO, packages=("mujoco",), world=Dynamics)

    def run() -> rb.ContactMotion:
        return rb.simulate(base, theory.times, settings=preset, engine=engine)

    motion = run()
    assert path_error(motion, theory) < 3 * measured
    report = motion.report
    assert slip_with_spin(base, report.slip, report.spin).max() < 1e-14  # 9.5e-16
    monkeypatch.setattr(Scene, "plane_acceleration", lambda *_: [0.0] * 3)
    assert path_error(run(), theory) > 0.2


@pytest.mark.parametrize("name", ADAPTERS)
def test_an_adapter_is_listed_without_its_package(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It has presets and requirements; a run is refused with the command that installs it."""
    engine = replace(ADAPTERS[name], environments=tmp_path)
    assert sorted(PROJECT["optional-dependencies"][name]) == sorted(engine.requirements) != []
    assert engine.default in engine.presets
    monkeypatch.setattr("robotball.engines.adapter.find_spec", lambda _: None)
    with pytest.raises(rb.InputError, match=naming(f"engines --install {name}")):
        rb.simulate(FIG12, engine=engine)


def test_the_torque_against_spin_is_proportional_to_inertia_over_step() -> None:
    """The least moment of Fig. 12's ball is 0.35 kg m². A classical ball may spin."""
    settings = PointSettings(name="", error_tolerance=1.0, timestep=1e-3, spin_part=2.0)
    for step in (4e-3, 1e-4):
        assert spin_damping(FIG12, settings, step) == pytest.approx(2 * 0.35 / step, rel=1e-12)
    assert spin_damping(rb.load_scene("classical_regular"), settings, 1e-3) == 0.0
    assert spin_damping(FIG12, replace(settings, spin_part=0.0), 1e-3) == 0.0


LACKS = [
    ("bullet", "", "servo_motors", "hinge motor"),
    ("pinocchio", "", "servo_motors", "hinge motor"),
    ("pinocchio", "", "beaver_ball", "None"),
    # Drake's point contact has no torsional friction.
    ("drake", "as-it-comes", "fig12", "spins"),
    ("drake", "best", "fig12", "torque"),
    ("drake", "best", "classical_regular", "None"),
    ("drake", "ideal", "fig12", "None"),
    ("dart", "as-it-comes", "fig12", "spins"),
    ("dart", "best", "fig12", "torque"),
    ("pinocchio", "as-it-comes", "fig12", "spins"),
    ("pinocchio", "contact", "fig12", "torque"),
    ("pinocchio", "best", "fig12", "None"),
    ("exudyn", "contact", "fig12", "constraint"),
    ("genesis", "as-it-comes", "fig12", "single~precision contact"),
    ("newton", "best", "fig12", "single~precision"),
    ("physx", "best", "fig12", "single~precision"),
    ("physx", "", "shaken_ball", "plane moves"),
    ("physx", "", "turntable", "plane turns"),
    ("physx", "", "beaver_ball", "None"),
    ("mujoco-warp", "best", "fig12", "single~precision"),
    ("mujoco-warp", "best", "turntable", "single~precision acceleration turning~plane"),
    ("rapier", "", "servo_motors", "hinge motor"),
    ("rapier", "", "turntable", "None"),
    ("rapier", "", "beaver_ball", "None"),
    ("rapier", "as-it-comes", "fig12", "single~precision spins"),
    ("rapier", "best", "fig12", "single~precision torque"),
]


def test_mjx_has_the_version_that_it_runs_on() -> None:
    """Its label names both versions."""
    assert ADAPTERS["mjx"].label.version.endswith(f" on MuJoCo {version('mujoco')}")


@pytest.mark.parametrize(("name", "preset", "scene", "facts"), LACKS)
def test_a_missing_ability_of_an_engine_is_named_before_the_run(
    name: str, preset: str, scene: str, facts: str
) -> None:
    """In one line: scenes the adapter cannot roll, or physics missing with some settings."""
    engine, ball = ADAPTERS[name], rb.load_scene(scene)
    line = engine.lacks(ball, engine.presets[preset]) if preset else engine.cannot_express(ball)
    assert unnamed(facts, str(line)) == []


def skip_unless_there(name: str) -> None:
    """Skip if an engine is neither installed here nor in its environment."""
    if not (ADAPTERS[name].installed or interpreter_of(ENVIRONMENTS / name)):
        pytest.skip(f"{name} is not installed; ENGINES_OF=~/.local/share uses your environments")


# engine, preset, field, value, scene, duration [s]: measured path error. First-order engines have
# the error of MuJoCo's Euler and implicitfast at 1 ms, 3.68e-3 for fig12 and 3.75e-2 for
# classical_regular: the integrator causes it, not the contact.
MEASURED = [
    ("pinocchio", "best", "rtol", 1e-12, "fig12", 2.0, 9.9e-13),
    ("pinocchio", "RK4", "timestep", 20e-3, "fig12", 2.0, 5.2e-8),
    ("drake", "ideal", "rtol", 1e-12, "fig12", 2.0, 9.9e-13),
    ("drake", "discrete", "timestep", 1e-3, "fig12", 10.0, 4.42e-3),
    ("pinocchio", "contact", "timestep", 1e-3, "fig12", 10.0, 4.41e-3),
    ("drake", "best", "timestep", 1e-3, "classical_regular", 2.0, 5.6e-6),
    ("mujoco-warp", "best", "timestep", 20e-3, "fig12", 2.0, 2.1e-6),
    ("exudyn", "best", "timestep", 5e-3, "fig12", 2.0, 2.85e-5),
    ("exudyn", "contact", "timestep", 1e-3, "fig12", 2.0, 1.5e-6),
    ("exudyn", "contact", "timestep", 1e-3, "classical_regular", 2.0, 1.4e-6),
    ("dart", "ideal", "rtol", 1e-12, "fig12", 2.0, 9.8e-13),
    ("dart", "best", "timestep", 1e-3, "classical_regular", 2.0, 8.8e-3),
    ("dart", "best", "timestep", 1e-3, "fig12", 10.0, 4.41e-3),
    ("physx", "best", "timestep", 1e-3, "classical_regular", 2.0, 5.9e-3),
    ("physx", "best", "timestep", 1e-3, "three_rotors", 2.0, 1.66e-2),
    ("newton", "best", "timestep", 20e-3, "fig12", 2.0, 1.61e-4),
    ("newton", "kept", "timestep", 5e-3, "fig12", 2.0, 9.67e-6),
    ("mjx", "best", "timestep", 20e-3, "fig12", 2.0, 1.61e-4),
    ("bullet", "best", "timestep", 1e-3, "fig12", 10.0, 3.68e-3),
    ("bullet", "best", "timestep", 1e-3, "classical_regular", 10.0, 3.75e-2),
    ("genesis", "best", "timestep", 1e-3, "fig12", 10.0, 3.68e-3),
    ("genesis", "best", "timestep", 1e-3, "classical_regular", 10.0, 3.75e-2),
    # Of first order in the substep until rounding takes over, below 50 µs.
    ("rapier", "best", "substeps", 4, "fig12", 2.0, 3.51e-2),
    ("rapier", "best", "substeps", 16, "fig12", 2.0, 8.5e-3),
    ("rapier", "best", "timestep", 1e-3, "fig12", 10.0, 1.15e-2),
    ("rapier", "best", "timestep", 1e-3, "classical_regular", 10.0, 1.75e-2),
    # Not balanced: with a pendulum, and with a shell whose centre of mass is off its centre.
    ("rapier", "best", "timestep", 1e-3, "beaver_ball", 2.0, 5.9e-3),
    ("physx", "best", "timestep", 1e-3, "beaver_ball", 2.0, 2.6e-3),
    ("rapier", "best", "timestep", 1e-3, "offset_routh_sphere", 2.0, 8.2e-4),
    # Off balance, with an offset of the shell. The error halves with the step.
    ("bullet", "best", "timestep", 1e-3, "offset_routh_sphere", 1.0, 3.1e-4),
    ("dart", "best", "timestep", 1e-3, "offset_routh_sphere", 1.0, 4.0e-4),
    ("drake", "discrete", "timestep", 1e-3, "offset_routh_sphere", 1.0, 4.2e-4),
    ("bullet", "best", "timestep", 1e-3, "beaver_ball", 1.0, 1.06e-3),
    ("dart", "best", "timestep", 1e-3, "inclined_plane", 1.0, 2.1e-4),
    ("drake", "discrete", "timestep", 1e-3, "inclined_plane", 1.0, 2.2e-4),
]


@pytest.mark.slow
@pytest.mark.parametrize("case", MEASURED, ids=lambda case: "-".join(map(str, case[:5])))
def test_an_engine_has_its_measured_error(case: tuple[Any, ...]) -> None:
    """Within a factor of 1.5 either way, so that an improvement of an engine is noticed, too."""
    name, preset, field, value, scene, duration, measured = case
    engine = ADAPTERS[name]
    skip_unless_there(name)
    theory = rb.integrate(rb.load_scene(scene), rb.sample_times(duration))
    changes: dict[str, Any] = {field: value, "stop_at_fault": False}
    settings = replace(engine.presets[preset], **changes)
    motion = rb.simulate(theory.scene, theory.times, settings=settings, engine=engine)
    assert measured / 1.5 < path_error(motion, theory) < measured * 1.5


# engine, preset, friction: path error at 1 ms, and whether it is of first order. A ball that sticks
# lags behind the surface by a step. Rapier is at its single precision; Bullet turns the friction on
# a shell around a frame (docs/coulomb.md).
TURNING = [
    ("bullet", "best", None, 2.90e-4, True),
    ("dart", "slip", None, 2.86e-4, True),
    ("pinocchio", "contact", None, 2.86e-4, True),
    ("rapier", "best", None, 8.0e-5, False),
    ("mujoco-warp", "slip", None, 2.60e-4, True),
    ("bullet", "best", 0.005, 2.70e-3, False),
    ("dart", "slip", 0.005, 1.23e-4, True),
    ("pinocchio", "contact", 0.005, 1.23e-4, True),
    ("rapier", "best", 0.005, 2.2e-4, False),
    ("mujoco-warp", "slip", 0.005, 4.1e-5, True),
]


@pytest.mark.slow
@pytest.mark.parametrize("case", TURNING, ids=lambda case: "-".join(map(str, case[:3])))
def test_an_engine_has_its_measured_error_on_a_turntable(case: tuple[Any, ...]) -> None:
    """With a friction of 0.005 the ball slides. On a plane at rest it would be off by over 0.1."""
    name, preset, friction, measured, first_order = case
    engine = ADAPTERS[name]
    skip_unless_there(name)
    scene = replace(rb.load_scene("turntable"), friction=Friction(friction), duration=1.0)
    theory = rb.integrate(scene, rb.sample_times(1.0))
    fine, coarse = (
        rb.simulate(scene, theory.times, settings=settings, engine=engine)
        for step in (1e-3, 2e-3)
        for settings in [replace(engine.presets[preset], timestep=step, stop_at_fault=False)]
    )
    error = path_error(fine, theory)
    assert measured / 1.5 < error < measured * 1.5
    assert not first_order or 1.7 < path_error(coarse, theory) / error < 2.3
    assert path_error(fine, rb.integrate(replace(scene, plane_rotation=0.0), theory.times)) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco-warp", "newton"])
@pytest.mark.parametrize("scene", ["fig12", "wobbling_drive"])
def test_captured_steps_have_the_bits_of_steps_from_python(name: str, scene: str) -> None:
    """Two balls side by side, with constant commands and with commands that change every step."""
    skip_unless_there(name)
    engine, times, ball = ADAPTERS[name], rb.sample_times(0.4), rb.load_scene(scene)
    settings: Any = replace(engine.presets["best"], device="cpu")  # type: ignore[call-arg]
    scenes = [ball.until(0.4), replace(ball, start=FIG12.start).until(0.4)]
    captured = [*rb.simulate_many(scenes, None, times, settings=settings, engine=engine)]
    python = interpreter_of(ENVIRONMENTS / name)
    rows = call(python or sys.executable, rows_without_capture, name, scenes, times, settings)
    cost: Any = {"timestep": 0.0, "steps": 0, "seconds": 0.0}
    stepped = motions_of(scenes, times, rows, engine.label, settings, **cost)
    for motion, steps in zip(captured, stepped, strict=True):
        assert motion.path_length > 0.1
        for part in ("contact_point", "attitude", "angular_velocity", "hinge_rates"):
            assert np.array_equal(getattr(motion, part), getattr(steps, part))


# Largest distance of contact points from a run alone [m]. Measured 0 with MuJoCo, and with Warp and
# Newton (each of 256 balls), whose worlds do the same arithmetic, and 2.3e-11 with MJX (12 of
# them), whose compiler reorders it.
ABREAST = {"mujoco": 0.0, "mujoco-warp": 0.0, "mjx": 1e-10, "newton": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", ABREAST)
def test_256_balls_side_by_side_move_as_in_runs_alone(name: str) -> None:
    """On the processor. An unknown device is refused; MuJoCo has no other."""
    attitudes = np.random.default_rng(3).normal(size=(256, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    starts, times = [replace(FIG12.start, attitude=q) for q in attitudes], rb.sample_times(0.4)
    device: dict[str, Any] = {}
    if name != "mujoco":
        skip_unless_there(name)
        device = {"device": "cpu"}
        with pytest.raises(rb.InputError, match=naming("'tpu' cpu")):
            next(rb.simulate_many(FIG12, starts, times, engine=name, device="tpu"))
    motions = [*rb.simulate_many(FIG12, starts, times, engine=name, **device)]
    errors = [path_error(motion, rb.integrate(motion.scene, times)) for motion in motions]
    assert max(errors) < 3e-4  # measured 1.7e-6 with Warp, 7.4e-6 with MJX, 1.0e-4 with Newton
    for i in (0, 255):
        alone = rb.simulate(
            motions[i].scene, times, settings=motions[i].report.settings, engine=name
        )
        assert np.abs(motions[i].contact_point - alone.contact_point).max() <= ABREAST[name]
