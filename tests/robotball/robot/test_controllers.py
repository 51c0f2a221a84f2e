"""Closed loops: both engines call the controller at the same times and give the same motion."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.stepping import controlled
from robotball.motion import path_error
from robotball.processes import at_most
from robotball.robot.loop import Loop, TrueReading
from robotball.robot.motors import Activation
from robotball.theory.multibody.march import March
from robotball.theory.multibody.system import System
from tests.messages import naming
from tests.off_engine import OFF
from tests.robotball.scene_files.scene_texts import PLATE

PENDULUM, STEERED = (rb.load_scene(n) for n in ("pendulum_robot", "steered_pendulum_robot"))
TIMES = rb.sample_times(1.0)
Commands = Mapping[str, float]


def damped(reading: rb.Reading) -> Commands:
    """Damp the swing and steer with the pendulum."""
    return {
        "frame": -2.0 - 0.5 * reading.gyro[1],
        "pendulum1": 0.2 * reading.gyro[0] + 0.1 * math.sin(3 * reading.time),
    }


def timed(reading: rb.Reading) -> Commands:
    """Open-loop commands from the time."""
    return {"frame": -math.sin(5 * reading.time)}


@dataclass
class Log:
    """A controller that counts its calls and passes its readings to a function."""

    commands: Callable[[rb.Reading], Commands]
    record: Callable[[rb.Reading], Any]
    calls: int = 0
    parts: dict[str, int] = field(default_factory=dict)

    def __call__(self, reading: rb.Reading) -> Commands:
        self.calls += 1
        self.parts["call"] = self.calls
        self.record(reading)
        return self.commands(reading)


def readings_of(
    controller: rb.Controller, run: Callable[[rb.Scene], rb.Motion], scene: rb.Scene = STEERED
) -> tuple[list[rb.Reading], rb.Motion]:
    """Return the readings of a controller in a run, and the motion."""
    kept: list[rb.Reading] = []
    # A function is not copied for a run, so it keeps its reference to the list.
    log = replace(controller, function=Log(controller.function, lambda r: kept.append(r)))
    motion = run(scene.with_controller(log))
    # The readings of a second run, with other steps, may follow; it starts at t = 0 again.
    return kept[: 1 + [reading.time for reading in kept[1:] + kept[:1]].index(0.0)], motion


def integrated(scene: rb.Scene) -> rb.Motion:
    return rb.integrate(scene, TIMES)


def balanced(scene: rb.Scene) -> rb.Motion:
    return rb.simulate(scene, TIMES)


# Agreement -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("preset", "most"), [("balanced", 5e-7), ("accurate", 1e-9)])
def test_both_engines_agree_on_a_closed_loop(preset: str, most: float) -> None:
    """Measured 1.8e-7 and 2.5e-10 of the path, and 8.1e-5 if one has commands larger by 1e-4."""
    scene = STEERED.with_controller(rb.Controller(damped, 0.01))
    theory = integrated(scene)
    assert path_error(rb.simulate(scene, TIMES, settings=preset), theory) < most
    near = lambda reading: {n: 1.0001 * v for n, v in damped(reading).items()}  # noqa: E731
    other = rb.simulate(scene.with_controller(rb.Controller(near, 0.01)), TIMES, settings=preset)
    assert path_error(other, theory) > 100 * most


def test_a_closed_loop_keeps_the_order_of_rk4() -> None:
    """Order 4.2 (measured) between 10 and 5 ms, since no step crosses a controller call."""
    scene = STEERED.with_controller(rb.Controller(damped, 0.02))
    theory = integrated(scene)
    coarse, fine = (
        replace(rb.preset("balanced"), timestep=step, error_tolerance=1e-3)
        for step in (0.01, 0.005)
    )
    errors = [
        path_error(rb.simulate(scene, TIMES, settings=preset), theory) for preset in (coarse, fine)
    ]
    assert 3.5 < math.log2(errors[0] / errors[1]) < 4.6


@pytest.mark.parametrize("settings", ["exact", None])
def test_steps_of_order_8_end_on_controller_calls(settings: str | None) -> None:
    """With the preset "exact" and with a requested accuracy; measured 2.5e-10, from a
    servo of 60 1/s after each command, and 1e-8.
    """
    scene, accuracy = STEERED.with_controller(rb.Controller(damped, 0.02)), None
    if settings is None:
        accuracy = 1e-7
    motion = rb.simulate(scene, TIMES, settings=settings, accuracy=accuracy)
    assert path_error(motion, integrated(scene)) < (accuracy or 8e-10)


def test_an_accuracy_is_reached_with_steps_shorter_than_the_period() -> None:
    """The first two runs both have the period as their step, which says nothing of their error.

    Measured 1.8e-7.
    """
    scene = STEERED.with_controller(rb.Controller(damped, 0.01))
    motion = rb.simulate(scene, TIMES, accuracy=1e-4)
    assert path_error(motion, integrated(scene)) < 1e-4


@pytest.mark.parametrize("run", [integrated, balanced])
def test_a_constant_command_gives_the_open_loop_motion(
    run: Callable[[rb.Scene], rb.Motion],
) -> None:
    """Measured 8e-16 with the equations and 0 with MuJoCo."""
    scene = PENDULUM.with_hinges(command={"frame": -3.0}, rate={"frame": 0.0})
    other = scene.with_hinges(command={"frame": 1.0})
    loop = other.with_controller(rb.Controller(lambda _: {"frame": -3.0}, 0.01))
    assert path_error(run(loop), run(scene)) < 1e-13
    assert path_error(run(other), run(scene)) > 0.1


def test_both_engines_record_the_readings_and_commands_of_every_call() -> None:
    """A command that is left out keeps its value. Readings differ by 2.8e-8 (measured)."""

    def sparing(reading: rb.Reading) -> Commands:
        return {"frame": -2.0} if reading.time == 0 else {"pendulum1": 0.2 * reading.gyro[0]}

    scene = STEERED.with_controller(rb.Controller(sparing, 0.01))
    theory, motion = integrated(scene), rb.simulate(scene, TIMES, settings="accurate")
    assert len(theory.calls) == len(motion.calls) == 100
    assert "command[pendulum1]" not in theory.calls[0]
    for ours, theirs in zip(theory.calls[1:], motion.calls[1:], strict=True):
        assert ours.keys() == theirs.keys() >= {"time", "gyro[2]", "attitude[3]", "rates[frame]"}
        assert ours["command[frame]"] == theirs["command[frame]"] == -2.0
        assert ours["command[pendulum1]"] == 0.2 * ours["gyro[0]"]
        assert [*ours.values()] == pytest.approx([*theirs.values()], abs=3e-7)
    assert integrated(STEERED).calls == ()


# Times of calls --------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [integrated, balanced])
@pytest.mark.parametrize("period", [0.01, 1 / 30, 0.007])
def test_calls_are_at_multiples_of_the_period(
    run: Callable[[rb.Scene], rb.Motion], period: float
) -> None:
    """From 0 to just before the end, exactly, once each."""
    kept, _ = readings_of(rb.Controller(damped, period), run)
    assert [reading.time for reading in kept] == [
        i * period for i in range(math.ceil(1.0 / period))
    ]


def test_readings_match_the_motion_in_both_engines() -> None:
    """All sensors at all calls; measured 1e-15, and 3.6e-6 rad/s between the engines."""
    controller = rb.Controller(damped, 0.02, sensors=rb.Sensors(contact_point=True))
    runs = [readings_of(controller, run) for run in (integrated, balanced)]
    for kept, motion in runs:
        for i, reading in enumerate(kept):
            names = [hinge.name for hinge in STEERED.hinges]
            assert reading.contact_point is not None
            assert [*reading.angles] == [*reading.rates] == names
            read: list[Any] = [
                reading.gyro,
                reading.attitude,
                [*reading.angles.values()],
                [*reading.rates.values()],
                reading.contact_point,
            ]
            true = [
                motion.angular_velocity[i],
                motion.attitude[i],
                motion.hinge_angles[i],
                motion.hinge_rates[i],
                motion.contact_point[i],
            ]
            assert np.abs(np.concatenate(read) - np.concatenate(true)).max() < 1e-13
    gyros = [np.array([reading.gyro for reading in kept]) for kept, _ in runs]
    assert np.abs(gyros[0] - gyros[1]).max() < 1e-5
    assert np.abs(gyros[0]).max() > 0.1


@pytest.mark.parametrize("run", [integrated, balanced])
def test_a_delay_is_equivalent_to_commands_from_a_late_clock(
    run: Callable[[rb.Scene], rb.Motion],
) -> None:
    """Until the first command takes effect, the drive of the scene acts.

    Measured 2e-16; without a delay the path is 6e-2 off.
    """
    open_ = PENDULUM.with_hinges(command={"frame": 0.5}, rate={"frame": 0.0})

    def late(reading: rb.Reading) -> Commands:
        return {"frame": -math.sin(5 * (reading.time - 0.04)) if reading.time > 0.03 else 0.5}

    paths = [
        run(open_.with_controller(controller))
        for controller in (
            rb.Controller(late, 0.02),
            rb.Controller(timed, 0.02, delay=0.04),
            rb.Controller(timed, 0.02),
        )
    ]
    assert path_error(paths[1], paths[0]) < 1e-13
    assert path_error(paths[2], paths[0]) > 1e-2


def test_the_drive_of_the_scene_acts_until_the_first_command_takes_effect() -> None:
    """A ramp for 0.5 s, then the loop; measured 2.3e-10, open loop 2e-11."""
    ramp = rb.Ramp(final=-3.0, end=0.4, shape="quintic")
    scene = PENDULUM.with_hinges(command={"frame": ramp})
    loop = scene.with_controller(rb.Controller(timed, 0.01, delay=0.5))
    theory = integrated(loop)
    assert path_error(rb.simulate(loop, TIMES, settings="accurate"), theory) < 2e-9
    half = TIMES <= 0.5
    before = integrated(scene).contact_point[half]
    assert np.abs(theory.contact_point[half] - before).max() < 1e-13
    assert path_error(integrated(scene), theory) > 0.1


def test_a_hinge_that_is_not_commanded_keeps_its_previous_command() -> None:
    """A hinge that is never commanded keeps the drive of the scene."""
    once = rb.Controller(lambda r: {"frame": -1.0} if r.time == 0 else {}, 0.01)
    always = rb.Controller(lambda r: {"frame": -1.0}, 0.01)
    ends = [integrated(STEERED.with_controller(c)).contact_point[-1] for c in (once, always)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-13


# Sensors ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [integrated, balanced])
def test_readings_are_older_by_the_latency(run: Callable[[rb.Scene], rb.Motion]) -> None:
    """0.014 s is not a multiple of the period; the first reading is the initial state.

    Measured 5e-15, with MuJoCo 2e-8.
    """
    plain = rb.Controller(timed, 0.02)
    late = replace(plain, sensors=rb.Sensors(latency=0.014))
    kept, _ = readings_of(late, run, PENDULUM)
    times = np.array([0.0, *(0.02 * np.arange(1, 50) - 0.014), 1.0])
    scene = PENDULUM.with_controller(plain)
    exact = rb.integrate(scene, times).hinge_angles[:-1, 0]
    off = np.abs(np.array([reading.angles["frame"] for reading in kept]) - exact)
    assert off.max() < 1e-6
    assert np.ptp(exact) > 0.2


def test_noise_depends_on_the_seed_and_not_on_the_engine() -> None:
    """Every sensor has the requested noise; resolution rounds the noisy values."""
    noise = {"gyro": 0.02, "attitude": 0.01, "angles": 0.003, "contact_point": 0.005}
    sensors = rb.Sensors(noise, {"rates": 0.5}, contact_point=True, seed=3)
    noisy = rb.Controller(timed, 0.01, sensors=sensors)
    other = replace(noisy, sensors=replace(sensors, seed=4))
    plain = replace(noisy, sensors=rb.Sensors(contact_point=True))

    def numbers(controller: rb.Controller, run: Callable[[rb.Scene], rb.Motion]) -> Any:
        kept, _ = readings_of(controller, run)
        assert all(abs(reading.attitude @ reading.attitude - 1) < 1e-14 for reading in kept)
        return {
            "gyro": np.array([reading.gyro for reading in kept]),
            "attitude": 2 * np.array([reading.attitude for reading in kept]),
            "angles": np.array([[*reading.angles.values()] for reading in kept]),
            "contact_point": np.array([reading.contact_point for reading in kept]),
            "rates": np.array([[*reading.rates.values()] for reading in kept]),
        }

    one, engine = numbers(noisy, integrated), numbers(noisy, balanced)
    seeded, true = numbers(other, integrated), numbers(plain, integrated)
    for name, sigma in noise.items():
        assert np.abs(one[name] - engine[name]).max() < 1e-4 * sigma + 1e-5
        assert np.abs(one[name] - seeded[name]).max() > sigma
        # From 100 readings; noise has three components in the four of a quaternion.
        spread = np.std(one[name] - true[name]) / math.sqrt(0.75 if name == "attitude" else 1.0)
        assert spread == pytest.approx(sigma, rel=0.15), name
    assert np.abs(one["rates"] / 0.5 - np.round(one["rates"] / 0.5)).max() < 1e-12
    assert np.abs(one["rates"] - true["rates"]).max() == pytest.approx(0.25, abs=0.02)


# State -----------------------------------------------------------------------------------------


class Integrating:
    """An integral controller."""

    def __init__(self) -> None:
        self.sum = 0.0

    def __call__(self, reading: rb.Reading) -> Commands:
        self.sum += 0.01 * (3.0 + reading.rates["frame"])
        return {"frame": -3.0 - 2.0 * self.sum}

    def command(self, reading: rb.Reading) -> Commands:
        return self(reading)


@pytest.mark.parametrize("method", [False, True])
def test_every_run_starts_with_a_fresh_controller_state(method: bool) -> None:
    """For objects and bound methods; the given object is not changed."""
    memory = Integrating()
    controller = rb.Controller(memory.command if method else memory, 0.01)
    scene = PENDULUM.with_controller(controller)
    motions = [balanced(scene), balanced(scene)]
    assert np.array_equal(motions[0].contact_point, motions[1].contact_point)
    assert memory.sum == 0.0
    # The error estimate runs the loop a second time, from the initial state.
    assert rb.integrate(scene, TIMES).reference_error < 1e-12


def test_many_closed_loop_runs_equal_single_runs() -> None:
    """To the last bit; each has a separate controller state."""
    scene = PENDULUM.with_controller(rb.Controller(Integrating(), 0.01))
    tilts = [np.array([1.0, 0.05 * i, 0.0, 0.0]) for i in range(3)]
    starts = [rb.Start(q / np.linalg.norm(q), np.zeros(3)) for q in tilts]
    with at_most(1):  # in this process: starting another takes seconds
        many = [*rb.simulate_many(scene, starts, rb.sample_times(0.5), settings="fast")]
    for start, motion in zip(starts, many, strict=True):
        alone = rb.simulate(replace(scene, start=start), rb.sample_times(0.5), settings="fast")
        assert np.array_equal(alone.contact_point, motion.contact_point)
    assert not np.array_equal(many[0].contact_point, many[1].contact_point)


# Cost ------------------------------------------------------------------------------------------


def test_a_controller_adds_no_steps_and_no_callback_in_mujoco() -> None:
    """Commands are constant between calls, so MuJoCo needs no Python callback."""
    scene = PENDULUM.with_controller(rb.Controller(timed, 0.01))
    assert rb.simulate(scene, TIMES).report.steps == rb.simulate(PENDULUM, TIMES).report.steps
    with controlled(build(scene, rb.preset("balanced"))) as control:
        assert not control.steady  # the ramp of the scene
        control.begin(control.model.start_data(), (0.0, 0.005))
        assert control.steady


def test_a_run_sets_its_callback_only_while_needed_and_restores_the_users() -> None:
    """`set` is called during the ramp of the scene, and not under constant commands."""
    scene = PENDULUM.with_controller(rb.Controller(timed, 0.01))
    model = build(scene, rb.preset("balanced"))
    users = lambda model, data: None  # noqa: E731
    mujoco.set_mjcb_control(users)
    try:
        with controlled(model) as control:
            assert mujoco.get_mjcb_control() == control.set
            control.begin(control.model.start_data(), (0.0, 0.005))
            assert mujoco.get_mjcb_control() is None
        assert mujoco.get_mjcb_control() is users
    finally:
        mujoco.set_mjcb_control(None)


def test_controller_calls_cost_the_equations_few_extra_steps() -> None:
    """Measured 1.34 times the steps of the open loop; the step length carries over a call."""
    steps, open_ = [], PENDULUM.with_hinges(command={"frame": -3.0})
    hold = rb.Controller(lambda _: {"frame": -3.0}, 0.01)
    for scene in (open_, open_.with_controller(hold)):
        loop = Loop(scene, scene.controller) if scene.controller else None
        march = March(System(loop.scene if loop else scene), 1e-15, 1.0, 10_000, loop=loop)
        march.run(TIMES)
        steps.append(march.steps)
    assert steps[1] < 1.6 * steps[0]


def test_a_copy_of_the_scene_of_a_loop_keeps_its_commands() -> None:
    """Commands are fields of the scene, not cached values."""
    scene = PENDULUM.with_controller(rb.Controller(lambda _: {"frame": -3.0}, 0.01))
    assert scene.controller is not None
    loop = Loop(scene, scene.controller)
    loop.reach(0.0, lambda: TrueReading(np.zeros(3), np.eye(4)[0], [0.0], [0.0], np.zeros(2)))
    again = replace(loop.scene, title="again")
    assert again.drives[0].rate(0.5) == loop.scene.drives[0].rate(0.5) == -3.0


# Refused ---------------------------------------------------------------------------------------


def failing(reading: rb.Reading) -> Commands:
    if reading.time > 0.04:
        raise KeyError("battery")
    return {"frame": 1.0}


@pytest.mark.parametrize("run", [integrated, balanced])
def test_an_exception_in_a_controller_is_reported_with_time_and_line(
    run: Callable[[rb.Scene], rb.Motion],
) -> None:
    """The line is in the file of the user, even if a library raised the exception."""
    line = failing.__code__.co_firstlineno + 2
    here = str(Path(__file__))
    facts = f"pendulum_robot controller 0.05~s {here} line~{line} KeyError"
    with pytest.raises(rb.InputError, match=naming(facts)):
        run(PENDULUM.with_controller(rb.Controller(failing, 0.01)))
    deep = rb.Controller(lambda _: {"frame": np.linalg.inv(np.zeros((2, 2)))[0, 0]}, 0.01)
    with pytest.raises(rb.InputError, match=naming(f"{here} LinAlgError Singular")):
        run(PENDULUM.with_controller(deep))


@pytest.mark.parametrize("raised", [SystemExit, GeneratorExit, BaseException])
def test_a_controller_cannot_end_the_program(raised: type[BaseException]) -> None:
    def leaving(reading: rb.Reading) -> Commands:
        raise raised

    with pytest.raises(
        rb.InputError, match=rf"fails at t = 0 s, in .* line \d+: {raised.__name__}"
    ):
        integrated(PENDULUM.with_controller(rb.Controller(leaving, 0.01)))


def test_an_interrupt_in_a_controller_is_passed_on() -> None:
    def interrupted(reading: rb.Reading) -> Commands:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrated(PENDULUM.with_controller(rb.Controller(interrupted, 0.01)))


class Uncopied:
    def __call__(self, reading: rb.Reading) -> Commands:
        return {}

    def __deepcopy__(self, memo: Any) -> Any:
        raise TypeError("there is one battery")


def answering(commands: Any, scene: rb.Scene = PENDULUM) -> rb.Scene:
    """Return the scene with a controller that always returns these commands."""
    return scene.with_controller(rb.Controller(lambda _: commands, 0.1))


SERVOS = rb.load_scene("servo_motors").with_hinges(motor={"rotor1": rb.Free()})
KEPT = rb.load_scene("servo_motors").with_hinges(motor={"rotor1": None})
FILTERED = replace(
    PENDULUM,
    actuators=(
        rb.Actuator(
            "pull", (("frame", 1.0),), rb.Torque().law, activation=Activation(0.0, settling=0.1)
        ),
    ),
)
RUNS = {
    "None": (answering(None), "{'frame':~1.0} None t~=~0"),
    "list": (answering([1.0]), "[1.0]"),
    "unknown": (answering({"fram": 1.0}), "pendulum_robot controller 'fram' frame"),
    "NaN": (answering({"frame": math.nan}), "nan frame 0~s"),
    "word": (answering({"frame": "fast"}), "'fast' frame 0~s"),
    "kept": (answering({"rotor1": 1.0}, scene=KEPT), "rotor1 prescribed"),
    "free": (answering({"rotor1": 1.0}, scene=SERVOS), "rotor1 freely"),
    "lag": (answering({"pull": 1.0}, scene=FILTERED), "pull activation"),
    "copy": (
        PENDULUM.with_controller(rb.Controller(Uncopied(), 0.1)),
        "copied line TypeError battery",
    ),
    "arguments": (
        PENDULUM.with_controller(rb.Controller(lambda: {}, 0.1)),  # type: ignore[arg-type,misc]
        "0~s TypeError arguments",
    ),
    "often": (PENDULUM.with_controller(rb.Controller(timed, 1e-9)), "1e+09 1~s 1e+06 period"),
}


@pytest.mark.parametrize("run", [integrated, balanced])
@pytest.mark.parametrize("name", RUNS)
def test_invalid_commands_are_refused(name: str, run: Callable[[rb.Scene], rb.Motion]) -> None:
    """By both engines; the error names the invalid command."""
    scene, facts = RUNS[name]
    with pytest.raises(rb.InputError, match=naming(facts)):
        run(scene)


@pytest.mark.parametrize(
    ("make", "facts"),
    [
        (lambda: rb.Controller("stop", 0.1), "function 'stop'"),  # type: ignore
        (lambda: rb.Controller(timed, 0.0), "period 0~s"),
        (lambda: rb.Controller(timed, 0.1, delay=-1.0), "delay -1~s"),
        (lambda: rb.Sensors({"gyros": 1.0}), "noise 'gyros'"),
        (lambda: rb.Sensors({"contact_point": 1.0}), "noise 'contact_point'"),
        (lambda: rb.Sensors({}, {"attitude": 1.0}), "resolution 'attitude'"),
        (lambda: rb.Sensors({"gyro": -1.0}), "noise gyro"),
        (lambda: rb.Sensors(latency=math.inf), "latency inf"),
        (lambda: rb.Sensors(seed=-1), "seed 0"),
        (lambda: rb.load_scene("fig12").with_controller(rb.Controller(timed, 0.1)), "fig12 motor"),
    ],
)
def test_an_invalid_controller_is_refused(make: Callable[[], object], facts: str) -> None:
    """When it is created, or when it is given to a scene without a motor."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        make()


def test_formats_and_engines_without_controllers_refuse_them(tmp_path: Path) -> None:
    """Scene files, exports, and an engine that does not support controllers."""
    scene = PENDULUM.with_controller(rb.Controller(timed, 0.1))
    with pytest.raises(rb.InputError, match=naming("scene~file controller")):
        rb.scene_toml(scene)
    with pytest.raises(rb.InputError, match=naming("export controller")):
        rb.export_scene(scene, tmp_path)
    with pytest.raises(rb.InputError, match=naming("Off pendulum_robot controllers")):
        rb.simulate(scene, TIMES, engine=OFF)
    motion = rb.integrate(scene, rb.sample_times(0.1))
    assert motion.scene is scene
    motion.save(tmp_path / "run.csv")
    assert "controller" in (tmp_path / "run.csv").read_text(encoding="utf-8")
    again = rb.load_motion(tmp_path / "run.csv", PENDULUM)
    assert np.array_equal(again.contact_point, motion.contact_point)


# Actuators of a robot's own file ---------------------------------------------------------------


def test_commands_to_an_actuator_are_clipped_to_its_range(tmp_path: Path) -> None:
    """In both engines, for an actuator of a robot file."""
    file = tmp_path / "mybot.xml"
    file.write_text(PLATE, encoding="utf-8")
    scene = replace(rb.load_scene(file), duration=1.0)
    (drive, *_) = scene.actuators
    limited = replace(scene, actuators=(replace(drive, within=(-0.03, 0.03)), *scene.actuators[1:]))

    def ends(scene: rb.Scene, command: float) -> Any:
        loop = scene.with_controller(rb.Controller(lambda _: {drive.name: command}, 0.02))
        times = rb.sample_times(0.5)
        theory, motion = rb.integrate(loop, times), rb.simulate(loop, times)
        assert path_error(motion, theory) < 1e-6
        return theory.contact_point[-1]

    assert np.array_equal(ends(limited, 5.0), ends(scene, 0.03))
    assert not np.allclose(ends(scene, 0.03), ends(scene, 0.02), atol=1e-6)
