"""Invalid input is refused in one line, with the value, the limit and the remedy.

Scenes, bodies, parts, starts, drives, motors, design requests, settings and counts, as given in
Python; files are tested in tests/robotball/files.
"""

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball import errors, processes
from robotball.design import designing
from robotball.engines.mujoco.mjcf_export import write_model
from robotball.engines.mujoco.settings import Prescribed
from robotball.errors import _LONGEST_LINE
from robotball.files.scene_writer import toml_of
from robotball.robot import ball, drives, motors, scene
from robotball.robot.ball import Ball, Frame, Hinge, Link, Rotor, Shell
from robotball.rotations import Array
from tests import random_robots
from tests.messages import unnamed
from tests.robotball.design import designs
from tests.robotball.robot.own_drive import OwnDrive, of_sine

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
NAN, INF = math.nan, math.inf
UP = np.array([0.0, 0.0, 1.0])


class Jumping(OwnDrive):
    """A drive with an undeclared breakpoint."""

    def rate(self, t: float) -> float:
        return of_sine(t) + 2.0 * (t > 4)


def run(rate: Any, end: float = 10.0) -> rb.Motion:
    """Return the motion from the equations for a frame rate."""
    return rb.integrate(FIG12.with_hinges(command={"frame": rate}), np.array([0.0, end]))


def body(name: str, **changes: Any) -> Ball:
    """Return a ball with one body changed."""
    bodies: dict[str, Any] = {
        "shell": Shell(0.5, 2.0, axial_inertia=0.3, transverse_inertia=0.2, axis=UP),
        "frame": Frame(1.0, np.diag([0.1, 0.2, 0.25])),
        "rotor": Rotor(0.5, 0.02, 0.01, axis=np.array([0.6, 0.0, 0.8])),
    }
    bodies[name] = replace(bodies[name], **changes)
    return Ball(bodies["shell"], (Hinge(bodies["frame"]), Hinge(bodies["rotor"])))


def bob(pivot: Array) -> Hinge:
    """Return a pendulum with this pivot."""
    return Hinge(rb.Pendulum(1.0, np.eye(3), UP, UP, pivot))


def hung(link: Link) -> Ball:
    two = body("frame")
    return replace(two, hinges=(*two.hinges, Hinge(link)))


def start(**changes: Any) -> rb.Scene:
    return replace(FIG12, start=replace(FIG12.start, **changes))


def shaken(amplitude: float) -> rb.Scene:
    """Return a balanced ball on a plane with this vertical acceleration [m/s²]."""
    return replace(FIG12, plane_motion=(0.0, 0.0, rb.Sine(amplitude=amplitude, frequency=6.466)))


def tilted(tilt: float) -> Array:
    return np.array([np.cos(tilt), 0.0, np.sin(tilt)])


BODIES = {
    "body('shell', mass=0.0)": "shell mass 0~kg",
    "body('frame', mass=NAN)": "frame mass nan~kg",
    "body('rotor', mass=-1.0)": "rotor1 mass -1~kg",
    "body('shell', radius=INF)": "shell radius inf~m",
    "body('shell', radius=1e51)": "radius 1e-50 1e+50~m 1e+51",
    "body('frame', centre=NAN * UP)": "frame centre 1e+50 nan~m",
    "body('frame', inertia=np.diag([0.1, 0.2, 0.5]))": "frame inertia 0.5 0.1 0.2~kg~m²",
    "body('frame', inertia=np.diag([0.1, 0.1, 0.0]))":
        "frame moment 0~kg~m²",
    "body('frame', inertia=1e-151 * np.eye(3))": "frame moment 1e-150 1e-151~kg",
    "body('frame', inertia=np.eye(3) + 1e-9 * np.eye(3, k=1))": "frame inertia symmetric",
    "body('frame', inertia=np.diag([0.1, NAN, 0.1]))": "frame inertia nan",
    "body('shell', axial_inertia=0.5)": "shell inertia 0.5 0.2 0.1~kg~m²",
    "body('rotor', axial_inertia=0.5, transverse_inertia=0.2)":
        "rotor1 0.2 0.1~kg~m²",
    "body('rotor', axis=0 * UP)": "rotor1 axis 0",
    "replace(FIG12.ball, hinges=(*FIG12.ball.hinges, bob(NAN * UP)))":
        "pendulum1 pivot 1e+50 nan~m",
    "body('frame', centre=(0.01, 0.0))":
        "frame centre (3,) (0.01,~0.0)",
    "body('rotor', axis='up')": "rotor axis numbers 'up'",
    "body('frame', inertia=(0.1, 0.2))": "frame inertia (3,~3)",
    "start(attitude=(1.0, 0.0))": "start attitude (4,)",
    "body('shell', axis=NAN * UP)": "shell axis nan",
}  # fmt: skip

SCENES = {
    "rb.sample_times(NAN)": "duration nan~s",
    "rb.sample_times(1e6)": "1e+06~s 1e+07 0.1~s",
    "replace(FIG12, rolling='sliding')": "rolling 'sliding'",
    "replace(FIG12, start=42)": "scene start 42",
    "replace(FIG12, duration=0.0)": "duration 0~s",
    "replace(FIG12, gravity=-9.81)": "gravity -9.81~m/s²",
    "replace(FIG12, gravity_direction=(0.0, 0.6, 0.8))": "Z 0.8",
    "replace(FIG12, plane_motion=(0.0, 1.0))": "X Y Z (0.0,~1.0)",
    # Exceeds g by a relative 1e-9, for a moment in each period.
    "rb.integrate(shaken(9.81 * (1 + 1e-9)), np.array([0.0, 1.0]))":
        "plane 0.270645…~s",
    "rb.dm_environment(shaken(1.0))": "environment plane",
    "write_model(shaken(1.0), FAST)": "MJCF plane",
    "FIG12.with_hinges(command=(1.0,))": "hinges 2 commands 1",
    "FIG12.with_hinges(command={'rotor2': 1.0})":
        "'rotor2' rotor1",
    "FIG12.with_hinges(command={'rotor1': NAN})":
        "rotor1 t~=~0~s nan",
    "rb.integrate(replace(FIG12, ball=body('rotor', centre=0.1 * UP)), equations='reduced')":
        "fig12 ball centre 0.0142857~m",
    "Actuator('pull', (('arm', 1.0), ('arm', 2.0)), Law(1.0, 0.0, 0.0))":
        "pull gear (('arm',~1.0),~('arm',~2.0))",
    "replace(FIG12, actuators=(Actuator('a', (('frame', 1.0),), Law(1.0, 0.0, 0.0)),))":
        "a 'frame'",
    "hung(Link('arm', 'leg', 1.0, np.eye(3), UP, UP))":
        "arm 'leg' shell frame",
    "hung(Link('frame', 'shell', 1.0, np.eye(3), UP, UP))": "'frame' two",
    "toml_of(random_tree(np.random.default_rng(0), framed=True))":
        "shell links actuators",
    "rb.simulate(random_tree(np.random.default_rng(0), framed=False), "
    "settings=replace(rb.preset('fast'), root='frame'))":
        "root frame shell",
    "replace(FIG12, ball=body('shell', asymmetry=np.diag([0.01, -0.01, 0.0]))).check_reduced()":
        "fig12 links shell",
    "replace(FIG12.ball, hinges=FIG12.ball.hinges[::-1])":
        "frame rotor1",
    "replace(FIG12.ball, hinges=FIG12.ball.hinges[1:])":
        "rotors frame",
    "Friction(sliding=0.0)": "sliding friction 0",
    "Friction(torsional=-1.0)": "torsional friction -1~m",
    "Friction(rolling=-1.0)": "rolling friction -1~m",
}  # fmt: skip

STARTS = {
    "start(attitude=np.array([1.0, 0.0, 0.0, NAN]))":
        "|attitude|~=~nan",
    "start(momentum=NAN * UP)": "start momentum 1e+150 nan~kg~m²/s",
    "FIG12.with_hinges(angle=np.zeros(3))": "hinges 2 angles 3",
    "FIG12.with_hinges(angle={'frame': INF})": "angle 1e+50 inf~rad",
    "FIG12.with_hinges(rate=(NAN, 0.0))": "rate 1e+50 nan~rad/s",
    "start(momentum=np.array([3.0, 4.0, 0.005]))":
        "(3.1) gamma 0.005 5~kg",
    "horizontal(NAN * UP, scale=5.0)": "M (3.1) gamma nan",
    "section_state(1.0, 0.6, 0.0, 0.0)": "M² 0",
    "section_state(1.0, 0.6, 0.0, NAN)": "M² nan",
    "section_state(5.1, 0.6, 0.0, 25.0)": "|L|~=~5.1 sqrt(f)~=~5",
    "section_state(NAN, 0.6, 0.0, 25.0)": "|L|~=~nan",
    "section_state(1.0, 0.6, 0.0, 25.0, c=-5.0)": "|c|~=~5 sqrt(f)~=~5",
    "section_state(1.0, 0.6, 0.0, 25.0, c=NAN)": "|c|~=~nan",
    "along_momentum(UP, 3 * UP)": "alpha quaternion",
    "attitude_of_axes(UP, tilted(1e-3))": "(gamma,~alpha)~=~0.001",
    "unit('gamma', 1.001 * UP)": "|gamma|~=~1.001",
    "unit('alpha', np.array([INF, 0.0, 0.0]))": "|alpha|~=~inf",
    "check_no_spin(np.array([1.0, 2.0, 0.1]), UP)": "angular_velocity rubber (2.2) 0.1~rad/s",
}  # fmt: skip

DRIVES = {
    "run(Custom(lambda t: float(t > 1), breakpoints=(1.0,)))":
        "1~rad/s t~=~1~s ramp",
    "run(lambda t: 2.0 if t < 3.3 else 2.5)":
        "0.5~rad/s t~=~3.3~s ramp",
    "run(Jumping())": "2~rad/s t~=~4~s ramp",
    "run('fast')": "rate 'fast'",
    "run(of_sine, 1e6)":
        "function 100000~s 1e+06~s",
    "as_drive(lambda t: NAN, 1.0)": "function nan 0~s 1e+50~rad/s",
    "run(lambda t: NAN if t > 2 else 2.0)":
        "function nan 2.…~s 1e+50~rad/s",
    "Ramp(final=1.0, start=2.0, end=1.0)":
        "ramp 2 1~s",
    "run(Samples(times=(0.0, 8.0), values=(0.0, 1.0)))":
        "samples 8~s 10~s",
    "Samples(times=(1.0,), values=(0.0,))": "1 times values",
    "Samples(times=(0.0, 1.0, 1.0), values=(0.0, 1.0, 2.0))":
        "times 3 1~s",
    "Samples(times=(0.0, 1.0), values=(0.0, NAN))": "2 samples 1e+50 nan",
    "Sum(())": "sum rate",
    "run(lambda t: 1 / (t - 4))": "function t~=~4~s line~1: ZeroDivisionError:",
    "run(Sum((1.0, lambda t: math.sqrt(4.5 - t))))":
        "function 4.5…~s line~1: ValueError:",
    "run(lambda t: exit())": "function 0~s line~1: SystemExit",
    "run(lambda t: None)": "function 0~s TypeError: NoneType",
    "Sine(amplitude=1.0, frequency=0.0)":
        "sine frequency 0~Hz",
    "FIG12.with_hinges(command={'frame': Sine(amplitude=1, frequency=1)}).parameters":
        "parameters_at",
}  # fmt: skip

MOTORS = {
    "FIG12.with_hinges(motor=(None,))": "hinges 2 motors 1",
    "Servo(gain=0.0)": "servo gain 0~N~m~s/rad",
    "PositionServo(gain=1.0, damping=-1.0)": "servo damping -1~N~m~s/rad",
    "Torque(armature=-1.0)": "armature -1~kg~m²",
    "Free(rest=INF)": "rest angle inf~rad",
    **{
        f"{motor}({value})": f"{facts} {told}"
        for motor, facts in {
            "Prescribed": "armature",
            "Servo": "servo gain",
            "(lambda limit: Servo(1.0, limit))": "servo torque limit",
        }.items()
        for value, told in {"'x'": "'x'", "np.array([1.0, 2.0])": "2.]", "-INF": "-inf"}.items()
    },
}

COUNTS = {
    "check_count('starts', 10**12, 1)": "starts 10000000 1000000000000",
    "at_most(0).__enter__()": "threads 1 0",
    "check_seed(-1)": "seed 0 -1",
    "check_positive('mass', 'x', 'kg')": "mass 'x'",
    "check_size('angle', 10**400)": "angle 1e+50",
}

DESIGNS = {
    "fig12(A=[NAN, 1.0, 1.0])": "A 3 [nan,~1.0,~1.0]",
    "fig12(A=[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])": "A symmetric 0.1",
    "fig12(A=(0.7, 0.6, 0.0))": "A eigenvalue 0~1/(kg~m²)",
    "fig12(Omega=[1.0, INF, 0.0])": "Omega 1e+50 inf",
    "fig12(K=[1.0])": "K 3 [1.0]",
    "fig12(radius=-1.0)": "radius -1~m",
    "fig12(mass=0.0)": "mass 0~kg",
    "fig12(limits=Limits(rotor_speed=NAN))": "rotor_speed nan~rad/s",
    "fig12(limits=Limits(shell_mass=-1))":
        "shell_mass -1~kg",
    "fig12(mass=0.8, limits=Limits(shell_mass=0.2, frame_mass=0.3, rotor_mass=0.4))":
        "shell frame rotor 0.9~kg 0.8~kg 0.1~kg",
    "fig12(limits=Limits(shell_mass=0.3, frame_mass=0.2, rotor_mass=0.4))":
        "shell frame rotor 0.9~kg J_s/a² 1.1~kg",
    "fig12(limits=Limits(shell_thickness=1.0))":
        "shell_thickness 0 1~m",
    "fig12(limits=Limits(shell_thickness=0.1, frame_radius=0.95))":
        "frame_radius 0.9~m 0.95~m",
    "fig12(limits=Limits(frame_radius=0.5, rotor_radius=0.6))":
        "rotor_radius 0.5~m 0.6~m",
}  # fmt: skip


MODULES = (ball, designing, designs, drives, errors, motors, processes, random_robots, scene)
OTHERS = {"Prescribed": Prescribed, "toml_of": toml_of, "write_model": write_model}
NAMES = (
    {name: value for module in MODULES for name, value in vars(module).items()} | OTHERS | globals()
)
# Not numbers, times, names or paths.
PUBLIC = {
    **{
        f"rb.{function}(FIG12, times={value})": facts
        for function in ("integrate", "simulate", "compare")
        for value, facts in {
            "'abc'": "times 'abc'",
            "[]": "times two (0,)",
            "[0.0, NAN]": "times finite",
            "[0.0, 2.0, 1.0]": "times increase 1 2",
            "[-1.0, 1.0]": "times 0 -1",
        }.items()
    },
    "rb.integrate(FIG12, rtol='abc')": "rtol 'abc'",
    "rb.integrate(FIG12, max_steps=0)": "max_steps 1 0",
    "rb.integrate(FIG12, equations=['reduced'])": "equations ['reduced']",
    "rb.simulate(FIG12, engine=None)": "engine 'None'",
    "rb.simulate(FIG12, settings=['fast'])": "preset ['fast']",
    "rb.sample_times(1.0, 'abc')": "interval 'abc'",
    "rb.sample_times(1.0, 0.0)": "interval 0~s",
    "rb.Ramp(final=1.0, end='abc')": "ramp end 'abc'",
    "rb.load_scene(None)": "scene None",
    "rb.read_log(None, FIG12)": "log None",
    "rb.read_trajectory('abc')": "abc",
    "rb.design('abc', [0, 0, 1], [0, 0, 0], 0.1)": "A 'abc'",
}


ALL = PUBLIC | BODIES | SCENES | STARTS | DRIVES | MOTORS | COUNTS | DESIGNS


def refusal(snippet: str) -> str:
    """Return the message with which a snippet is refused."""
    with pytest.raises(rb.InputError) as refused:
        eval(snippet, NAMES)
    return str(refused.value)


@pytest.mark.parametrize(("snippet", "facts"), ALL.items())
def test_invalid_input_is_refused_in_one_line(snippet: str, facts: str) -> None:
    """With the value and its limit."""
    message = refusal(snippet)
    assert unnamed(facts, message) == []
    assert len(message) <= _LONGEST_LINE
    assert "\n" not in message


REQUIRED = {field.name for field in fields(rb.Settings) if field.default is not None}
ODD = [
    -np.inf, np.nan, -1e30, 1e300, 10**400, "x" * 4000, b"x", {}, object(), (1e300, 1e300),
    (np.nan,), np.array([]), np.array([1.0, 2.0, 3.0]), np.array(0.02),
]  # fmt: skip


def changed(**values: Any) -> rb.Settings:
    return replace(FAST, **values)


@pytest.mark.parametrize("name", [field.name for field in fields(rb.Settings)])
def test_any_setting_is_accepted_or_refused_in_one_short_line(name: str) -> None:
    """Including None; no other error is raised, neither now nor in the run."""
    for value in [*ODD, *([None] if name in REQUIRED else [])]:
        if name == "name" and isinstance(value, str):
            continue
        with pytest.raises(rb.InputError, match=f"{name}|a Servo") as refusal:
            changed(**{name: value})
        assert len(str(refusal.value)) <= _LONGEST_LINE


def test_numbers_of_numpy_are_accepted_as_settings() -> None:
    """They are stored as Python numbers, which JSON accepts."""
    values: dict[str, Any] = {
        "timestep": np.float64(0.01), "solref": np.array([0.04, 1.0]), "iterations": np.int64(3),
        "condim": 3.0, "sliding_friction": 10**30,
    }  # fmt: skip
    plain = changed(**values).plain()
    assert [plain[name] for name in values] == [0.01, [0.04, 1.0], 3, 3, 1e30]
    assert [type(plain[name]) for name in values] == [float, list, int, int, float]


def test_a_message_is_short_for_any_length_of_its_parts() -> None:
    """Its start and its end, with the remedy, are kept."""
    key = "k" * 4000
    message = str(rb.InputError(f"{key}: unknown key; " + "name " * 1000 + "did you mean mass?"))
    assert len(message) <= _LONGEST_LINE
    assert message.startswith("kkk")
    assert message.endswith("did you mean mass?")
