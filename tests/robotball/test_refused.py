"""Input that cannot be used is refused in one line, with the value, the limit and what to do.

Scenes, bodies, parts, starts, drives, motors, requests for a design, settings and counts, as they
are given in Python; files are refused in tests/robotball/files.
"""

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball import ball, designing, drives, errors, motors, processes, scene
from robotball.ball import Ball, Frame, Hinge, Link, Rotor, Shell
from robotball.engines.mujoco.mjcf_export import write_model
from robotball.engines.mujoco.settings import Prescribed
from robotball.errors import LONGEST_LINE
from robotball.files import scene_tables
from robotball.files.parts import solid_of
from robotball.files.scene_writer import scene_toml
from robotball.rotations import Array
from tests import random_robots
from tests.robotball import designs
from tests.robotball.own_drive import OwnDrive, of_sine

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
NAN, INF = math.nan, math.inf
UP = np.array([0.0, 0.0, 1.0])


class Jumping(OwnDrive):
    """A drive that forgot a breakpoint."""

    def rate(self, t: float) -> float:
        return of_sine(t) + 2.0 * (t > 4)


def run(rate: Any, end: float = 10.0) -> rb.Motion:
    """Return the motion by the equations at a frame's rate."""
    return rb.integrate(FIG12.with_hinges(command={"frame": rate}), np.array([0.0, end]))


def body(name: str, **changes: Any) -> Ball:
    """A ball with one body changed."""
    bodies: dict[str, Any] = {
        "shell": Shell(0.5, 2.0, axial_inertia=0.3, transverse_inertia=0.2, axis=UP),
        "frame": Frame(1.0, np.diag([0.1, 0.2, 0.25])),
        "rotor": Rotor(0.5, 0.02, 0.01, axis=np.array([0.6, 0.0, 0.8])),
    }
    bodies[name] = replace(bodies[name], **changes)
    return Ball(bodies["shell"], (Hinge(bodies["frame"]), Hinge(bodies["rotor"])))


def bob(pivot: Array) -> Hinge:
    """A pendulum with this pivot."""
    return Hinge(rb.Pendulum(1.0, np.eye(3), UP, UP, pivot))


def part(kind: str, **sizes: Any) -> None:
    """A part of this kind; by a mass of 1 kg where nothing else is given."""
    solid_of(getattr(scene_tables, kind)(**({} if "density" in sizes else {"mass": 1.0}) | sizes))


def hung(link: Link) -> Ball:
    two = body("frame")
    return replace(two, hinges=(*two.hinges, Hinge(link)))


def start(**changes: Any) -> rb.Scene:
    return replace(FIG12, start=replace(FIG12.start, **changes))


def shaken(amplitude: float) -> rb.Scene:
    """A balanced ball on a plane that moves up and down, by this acceleration [m/s²]."""
    return replace(FIG12, plane_motion=(0.0, 0.0, rb.Sine(amplitude=amplitude, frequency=6.466)))


def tilted(tilt: float) -> Array:
    return np.array([np.cos(tilt), 0.0, np.sin(tilt)])


BODIES = {
    "body('shell', mass=0.0)": r"shell's mass must be positive and finite, not 0 kg",
    "body('frame', mass=NAN)": r"frame's mass must be positive and finite, not nan kg",
    "body('rotor', mass=-1.0)": r"rotor1's mass must be positive and finite, not -1 kg",
    "body('shell', radius=INF)": r"the shell's radius must be positive and finite, not inf m",
    "body('shell', radius=1e51)": r"radius must lie between 1e-50 and 1e\+50 m, not at 1e\+51",
    "body('frame', centre=NAN * UP)": r"frame's centre must be finite and at most 1e\+50",
    "body('frame', inertia=np.diag([0.1, 0.2, 0.5]))": r"0\.5 > 0\.1 \+ 0\.2 by 0\.2 kg m²",
    "body('frame', inertia=np.diag([0.1, 0.1, 0.0]))":
        r"not positive: its smallest principal moment is 0 kg m²",
    "body('frame', inertia=1e-151 * np.eye(3))": r"moment must be at least 1e-150, not 1e-151 kg",
    "body('frame', inertia=np.eye(3) + 1e-9 * np.eye(3, k=1))": r"inertia is not symmetric",
    "body('frame', inertia=np.diag([0.1, NAN, 0.1]))": r"inertia has an entry that is not finite",
    "body('shell', axial_inertia=0.5)": r"shell's inertia .*: 0\.5 > 0\.2 \+ 0\.2 by 0\.1",
    "body('rotor', axial_inertia=0.5, transverse_inertia=0.2)":
        r"rotor1 is flatter than a disk: .* exceeds twice the transverse 0\.2 by 0\.1 kg m²",
    "body('rotor', axis=0 * UP)": r"rotor1's axis must be a unit vector; its length is 0",
    "replace(FIG12.ball, hinges=(*FIG12.ball.hinges, bob(NAN * UP)))":
        r"pendulum1's pivot must be finite and at most 1e\+50 in size, not nan m",
    "body('frame', centre=(0.01, 0.0))":
        r"a frame's centre must be numbers of shape \(3,\), not \(0\.01, 0\.0\)",
    "body('rotor', axis='up')": r"a rotor's axis must be numbers of shape \(3,\), not 'up'",
    "body('frame', inertia=(0.1, 0.2))": r"a frame's inertia must be numbers of shape \(3, 3\)",
    "start(attitude=(1.0, 0.0))": r"a start's attitude must be numbers of shape \(4,\), not \(1\.",
    "body('shell', axis=NAN * UP)": r"shell's axis must be a unit vector; its length is nan",
}  # fmt: skip

PARTS = {
    "part('Sphere', density=1.0, mass=1.0, radius=1.0)":
        r"a sphere takes a mass, a density or a material, not mass and density",
    "part('Sphere', density=None, radius=1.0)":
        r"a sphere needs a mass \[kg\], a density \[kg/m³\] or a material",
    "part('Sphere', density=-1.0, radius=1.0)": r"a sphere's density must be positive",
    "part('Box', size=(1.0, 0.0, 1.0))": r"a box's size must be positive and finite, not 0",
    "part('Box', size=(1.0, 1.0, 1.0), attitude=(2.0, 0.0, 0.0, 0.0))":
        r"attitude is not of unit length: \|attitude\| = 2",
    "part('Sphere', radius=0.1, thickness=0.2)":
        r"thickness must be positive and at most its radius 0\.1, not 0\.2 m",
    "part('Disc', radius=0.1, inner_radius=0.1)":
        r"a disc's inner_radius must be at least 0 and less than its radius 0\.1, not 0\.1 m",
    "part('Rod', begin=(0.0, 0.0, 1.0), end=(0.0, 0.0, 1.0))":
        r"a rod must have a length and a direction, unlike \[0\.0, 0\.0, 0\.0\]",
    "part('Ring', radius=0.1, axis=(0.0, 0.0, 0.0))":
        r"a ring's axis must have a length and a direction",
}  # fmt: skip

SCENES = {
    "rb.sample_times(NAN)": r"duration must be positive and finite, not nan s",
    "rb.sample_times(1e6)": r"1e\+06 s would be 1e\+07 samples 0\.1 s apart, of at most 1e\+07",
    "replace(FIG12, rolling='sliding')": r"rolling must be one of .* not 'sliding'",
    "replace(FIG12, start=42)": r"start must be Start\(attitude, momentum\), not 42",
    "replace(FIG12, duration=0.0)": r"duration must be positive and finite, not 0 s",
    "replace(FIG12, gravity=-9.81)": r"gravity must be positive and finite, not -9\.81 m/s²",
    "replace(FIG12, gravity_direction=(0.0, 0.6, 0.8))": r"its Z is 0\.8, and must be negative",
    "replace(FIG12, plane_motion=(0.0, 1.0))": r"must be 3 rates, X, Y and Z: not \(0\.0, 1\.0\)",
    # Over g by 1e-9 of it, for a moment in each period.
    "rb.integrate(shaken(9.81 * (1 + 1e-9)), np.array([0.0, 1.0]))":
        r"the ball lifts off the plane at t = 0\.270645\d+ s, where its rolling ends",
    "rb.dm_environment(shaken(1.0))": r"an environment cannot hold a plane that moves",
    "write_model(shaken(1.0), FAST, dressed=False, stem='')": r"MJCF cannot hold a plane that",
    "FIG12.with_hinges(command=(1.0,))": r"2 hinges need as many commands, not 1",
    "FIG12.with_hinges(command={'rotor2': 1.0})":
        r"no hinge is called 'rotor2'; did you mean rotor1\?",
    "FIG12.with_hinges(command={'rotor1': NAN})":
        r"rotor1: a drive's rate at t = 0 s must be finite and .*not nan",
    "rb.integrate(replace(FIG12, ball=body('rotor', centre=0.1 * UP)), equations='reduced')":
        r"fig12: the ball is not balanced: its centre of mass is 0\.0142857 m off",
    "Actuator('pull', (('arm', 1.0), ('arm', 2.0)), Law(1.0, 0.0, 0.0))":
        r"pull must have one gear a hinge, not \(\('arm', 1\.0\), \('arm', 2\.0\)\)",
    "replace(FIG12, actuators=(Actuator('a', (('frame', 1.0),), Law(1.0, 0.0, 0.0)),))":
        r"a moves the hinge of 'frame', which must be one whose rate is not given; those are none",
    "hung(Link('arm', 'leg', 1.0, np.eye(3), UP, UP))":
        r"arm hangs on 'leg', which is no body before it; the bodies before it are shell, frame, r",
    "hung(Link('frame', 'shell', 1.0, np.eye(3), UP, UP))": r"two bodies are called 'frame'",
    "scene_toml(random_tree(np.random.default_rng(0), framed=True))":
        r"a scene file holds a symmetric shell, .* but no links or actuators",
    "rb.simulate(random_tree(np.random.default_rng(0), framed=False), "
    "settings=replace(rb.preset('fast'), root='frame'))":
        r"root = .frame. needs a ball with a frame; take root = .shell.",
    "replace(FIG12, ball=body('shell', asymmetry=np.diag([0.01, -0.01, 0.0]))).check_reduced()":
        r"fig12: its bodies are a tree of links, or its shell is not symmetric; this needs a scene",
    "replace(FIG12.ball, hinges=FIG12.ball.hinges[::-1])":
        r"the frame carries the others: put it before rotor1",
    "replace(FIG12.ball, hinges=FIG12.ball.hinges[1:])":
        r"rotors and pendulums turn on a frame; a ball without",
    "Friction(sliding=0.0)": r"the sliding friction must be positive",
    "Friction(torsional=-1.0)": r"the torsional friction must be positive",
    "Friction(rolling=-1.0)": r"the rolling friction, where it is not 0, must",
}  # fmt: skip

STARTS = {
    "start(attitude=np.array([1.0, 0.0, 0.0, NAN]))":
        r"attitude is not of unit length: .attitude. = nan",
    "start(momentum=NAN * UP)": r"the start's momentum must be finite",
    "FIG12.with_hinges(angle=np.zeros(3))": r"2 hinges need as many angles, not 3",
    "FIG12.with_hinges(angle={'frame': INF})": r"a hinge's angle at the start must be finite",
    "FIG12.with_hinges(rate=(NAN, 0.0))": r"a hinge's rate at the start must be finite",
    "start(momentum=np.array([3.0, 4.0, 0.005]))":
        r"\(3\.1\): \(M, gamma\) = 0\.005 of \|M\| = 5 kg",
    "horizontal(NAN * UP, scale=5.0)": r"M is not horizontal",
    "section_state(1.0, 0.6, 0.0, 0.0)": r"f = M² must be positive, not 0",
    "section_state(1.0, 0.6, 0.0, NAN)": r"f = M² must be positive, not nan",
    "section_state(5.1, 0.6, 0.0, 25.0)": r"\|L\| = 5\.1 must not exceed sqrt\(f\) = 5",
    "section_state(NAN, 0.6, 0.0, 25.0)": r"\|L\| = nan must not exceed",
    "section_state(1.0, 0.6, 0.0, 25.0, c=-5.0)": r"\|c\| = 5 must be smaller than sqrt\(f\) = 5",
    "section_state(1.0, 0.6, 0.0, 25.0, c=NAN)": r"\|c\| = nan must be smaller",
    "along_momentum(UP, 3 * UP)": r"no horizontal part .* give alpha or a quaternion",
    "attitude_of_axes(UP, tilted(1e-3))": r"not orthogonal: \(gamma, alpha\) = 0\.001",
    "unit('gamma', 1.001 * UP)": r"gamma is not of unit length: \|gamma\| = 1\.001",
    "unit('alpha', np.array([INF, 0.0, 0.0]))": r"alpha is not of unit length.*inf",
    "check_no_spin(np.array([1.0, 2.0, 0.1]), UP)": r"forbids \(2\.2\): \(ω - Ω, γ\) = 0\.1 rad/s",
}  # fmt: skip

DRIVES = {
    "run(Custom(lambda t: float(t > 1), breakpoints=(1.0,)))":
        r"a drive's rate jumps by 1 rad/s at t = 1 s; ramp it",
    "run(lambda t: 2.0 if t < 3.3 else 2.5)":
        r"a drive's rate jumps by 0\.5 rad/s at t = 3\.3 s; ramp it",
    "run(Jumping())": r"a drive's rate jumps by 2 rad/s at t = 4 s; ramp it",
    "run(Custom(of_sine, derivative=lambda t: -6 * math.cos(6 * t)))":
        r"the derivative given for a drive is -\S+ rad/s² at t = \S+ s, where that of its function",
    "run(Custom(of_sine, integral=lambda t: 2 * t))":
        r"the integral given for a drive is \S+ rad at t = \S+ s, where that of its function is",
    "run('fast')": r"a rate is a number, a function of time, or a drive .*, not 'fast'",
    "run(of_sine, 1e6)":
        r"a drive's function can be followed to t = 100000 s at most, not to 1e\+06 s",
    "as_drive(lambda t: NAN, 1.0)": r"function gives nan at t = 0 s",
    "run(lambda t: NAN if t > 2 else 2.0)":
        r"function gives nan at t = 2\.\d+ s; it must be finite",
    "Ramp(final=1.0, start=2.0, end=1.0)":
        r"a ramp must start at 0 or later and end after that, not from 2 to 1 s",
    "run(Samples(times=(0.0, 8.0), values=(0.0, 1.0)))":
        r"samples from t = 0 to 8 s do not reach over the run, from 0 to 10 s; give more",
    "Samples(times=(1.0,), values=(0.0,))": r"two or more: not 1 times and 1 values",
    "Samples(times=(0.0, 1.0, 1.0), values=(0.0, 1.0, 2.0))":
        r"the times of samples must increase: time 3 is 1 s, after 1 s",
    "Samples(times=(0.0, 1.0), values=(0.0, NAN))": r"value 2 of the samples must be finite",
    "Sum(())": r"a sum needs at least one rate",
    "run(lambda t: 1 / (t - 4))": r"a drive's function fails at t = 4 s: ZeroDivisionError: ",
    "run(Sum((1.0, lambda t: math.sqrt(4.5 - t))))":
        r"a drive's function fails at t = \S+ s: ValueError: ",
    "Sine(amplitude=1.0, frequency=0.0)":
        r"a sine's frequency must be positive and finite, not 0 Hz",
    "FIG12.with_hinges(command={'frame': Sine(amplitude=1, frequency=1)}).parameters":
        r"drives or plane change in time; use parameters_at",
}  # fmt: skip

MOTORS = {
    "FIG12.with_hinges(motor=(None,))": r"2 hinges need as many motors, not 1",
    "Servo(gain=0.0)": r"a servo's gain must be positive and finite, not 0 N m s/rad",
    "PositionServo(gain=1.0, damping=-1.0)": r"a position servo's damping, where it is not 0,",
    "Torque(armature=-1.0)": r"a motor's armature, where it is not 0, must be positive",
    "Free(rest=INF)": r"a free hinge's rest angle must be finite",
    **{
        f"{motor}({value})": r"must be"
        for motor in ("Prescribed", "Servo", "(lambda limit: Servo(1.0, limit))")
        for value in ("'x'", "np.array([1.0, 2.0])", "-INF")
    },
}

COUNTS = {
    "check_count('starts', 10**12, 1)": r"starts must be at most 10000000, not 10000",
    "at_most(0).__enter__()": r"threads must be at least 1, not 0",
    "check_seed(-1)": r"seed must be at least 0, not -1",
    "check_positive('mass', 'x', 'kg')": r"mass must be a number, not 'x'",
}

DESIGNS = {
    "fig12(A=[NAN, 1.0, 1.0])": r"A must be 3 or 3 x 3 finite numbers, not \[nan, 1\.0, 1\.0\]",
    "fig12(A=[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])": r"A is not symmetric",
    "fig12(A=(0.7, 0.6, 0.0))": r"A is not positive: its least eigenvalue is 0 1/\(kg m²\)",
    "fig12(Omega=[1.0, INF, 0.0])": r"Omega must be 3 finite numbers, not \[1\.0, inf, 0\.0\]",
    "fig12(K=[1.0])": r"K must be 3 finite numbers, not \[1\.0\]",
    "fig12(radius=-1.0)": r"radius must be positive and finite, not -1 m",
    "fig12(mass=0.0)": r"mass must be positive and finite, not 0 kg",
    "fig12(limits=Limits(rotor_speed=NAN))": r"rotor_speed must be positive, not nan rad/s",
    "fig12(limits=Limits(shell_mass=-1))":
        r"shell_mass, where it is not 0, must be positive and finite, not -1 kg",
    "fig12(mass=0.8, limits=Limits(shell_mass=0.2, frame_mass=0.3, rotor_mass=0.4))":
        r"masses: the least of shell, frame and rotor are 0\.9 kg together, and the ball is to "
        r"have 0\.8 kg: 0\.1 kg too much",
    "fig12(limits=Limits(shell_mass=0.3, frame_mass=0.2, rotor_mass=0.4))":
        r"masses: with the least of shell, frame and rotor, 0\.9 kg, m \+ J_s/a² is 1\.1 kg at "
        r"least; ",
    "fig12(limits=Limits(shell_thickness=1.0))":
        r"shell_thickness must be at least 0 and less than the radius 1 m, not 1 m",
    "fig12(limits=Limits(shell_thickness=0.1, frame_radius=0.95))":
        r"frame_radius must be positive and at most 0\.9 m, not 0\.95 m",
    "fig12(limits=Limits(frame_radius=0.5, rotor_radius=0.6))":
        r"rotor_radius must be positive and at most 0\.5 m, not 0\.6 m",
}  # fmt: skip


MODULES = (ball, designing, designs, drives, errors, motors, processes, random_robots, scene)
OTHERS = {"Prescribed": Prescribed, "scene_toml": scene_toml, "write_model": write_model}
NAMES = {name: value for each in MODULES for name, value in vars(each).items()} | OTHERS | globals()
ALL = BODIES | PARTS | SCENES | STARTS | DRIVES | MOTORS | COUNTS | DESIGNS


@pytest.mark.parametrize(("snippet", "message"), ALL.items())
def test_what_cannot_be_used_is_refused_in_one_line(snippet: str, message: str) -> None:
    """With the value, the limit and what to do."""
    with pytest.raises(rb.InputError, match=message) as refusal:
        eval(snippet, NAMES)
    assert len(str(refusal.value)) <= LONGEST_LINE
    assert "\n" not in str(refusal.value)


REQUIRED = {each.name for each in fields(rb.Settings) if each.default is not None}
ODD = [
    -np.inf, np.nan, -1e30, 1e300, 10**400, "x" * 4000, b"x", {}, object(), (1e300, 1e300),
    (np.nan,), np.array([]), np.array([1.0, 2.0, 3.0]), np.array(0.02),
]  # fmt: skip


def changed(**values: Any) -> rb.Settings:
    return replace(FAST, **values)


@pytest.mark.parametrize("name", [each.name for each in fields(rb.Settings)])
def test_a_setting_of_any_kind_fits_or_is_one_short_line(name: str) -> None:
    """None too, where nothing is left open; no other error, now or in the run."""
    for value in [*ODD, *([None] if name in REQUIRED else [])]:
        if name == "name" and isinstance(value, str):
            continue
        with pytest.raises(rb.InputError, match=f"{name}|a Servo") as refusal:
            changed(**{name: value})
        assert len(str(refusal.value)) <= LONGEST_LINE


def test_numbers_of_numpy_are_settings() -> None:
    """They are kept as Python's own, which JSON takes."""
    given: dict[str, Any] = {
        "timestep": np.float64(0.01), "solref": np.array([0.04, 1.0]), "iterations": np.int64(3),
        "condim": 3.0, "sliding_friction": 10**30,
    }  # fmt: skip
    plain = changed(**given).plain()
    assert [plain[name] for name in given] == [0.01, [0.04, 1.0], 3, 3, 1e30]
    assert [type(plain[name]) for name in given] == [float, list, int, int, float]


def test_a_message_is_short_however_long_its_parts_are() -> None:
    """Its beginning and its end, which says what to do, stay."""
    key = "k" * 4000
    message = str(rb.InputError(f"{key}: unknown key; " + "name " * 1000 + "did you mean mass?"))
    assert len(message) <= LONGEST_LINE
    assert message.startswith("kkk")
    assert message.endswith("did you mean mass?")
