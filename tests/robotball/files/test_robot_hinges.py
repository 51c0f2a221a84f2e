"""How a robot's hinges are moved and what they start with, or why they cannot be."""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.robotball.files.robot_tables import BOB, FRAME, PENDULUM, START, Load, refused


def test_hinges_are_moved_as_told(load: Load) -> None:
    """Motors, commands, and what the hinges start with."""
    scene = load(
        frame=FRAME + 'drive = "servo"\nkv = 2.0\nrate = 3.0\narmature = 0.01\n',
        rest=PENDULUM + BOB + 'drive = "position"\nkp = 6.0\nkd = 0.3\nangle = 0.5\n'
        "torque_limit = 0.7\ninitial_angle = 0.2\n"
        + PENDULUM + BOB + 'drive = "torque"\ntorque = [0.1, { kind = "sine", amplitude = 0.2, '
        "frequency = 1.0 }]\ninitial_rate = -1.0\n"
        + PENDULUM + BOB + 'drive = "free"\ndamping = 0.01\nstiffness = 0.3\nrest = 0.5\n'
        + PENDULUM + BOB + "rate = 4.0\n",
    )  # fmt: skip
    frame, position, torque, free, given = scene.hinges
    assert frame.motor == rb.Servo(2.0, None, 0.01)
    assert position.motor == rb.PositionServo(6.0, 0.3, 0.7)
    assert torque.motor == rb.Torque()
    assert free.motor == rb.Free(0.01, 0.3, 0.5)
    assert given.motor is None
    assert position.command.rate(1.0) == 0.5
    assert torque.command.rate(0.25) == pytest.approx(0.3)
    assert [hinge.angle for hinge in scene.hinges] == [0.0, 0.2, 0.0, 0.0, 0.0]
    assert [hinge.rate for hinge in scene.hinges] == [3.0, 0.0, -1.0, 0.0, 4.0]


def test_samples_are_read_from_a_table_of_numbers(load: Load, tmp_path: Path) -> None:
    """With a line of names, comments, and commas, semicolons or spaces between them."""
    csv = "time,rate\n0,1\n2.5,2\n5,0.5\n"
    for text in (csv, csv.replace(",", "; "), csv.replace(",", " "), "# note\n" + csv):
        (tmp_path / "rate.csv").write_text(text)
        scene = load(frame=FRAME + 'rate = { kind = "samples", file = "rate.csv" }\n')
        assert scene.frame_rate == rb.Samples(times=(0.0, 2.5, 5.0), values=(1.0, 2.0, 0.5))


def test_an_angular_velocity_starts_any_robot(load: Load) -> None:
    """It is the one that the start's momentum gives back, whatever turns at the start."""
    start = START.replace("[0, 0, 0]", "[1.0, -2.0, 0.5]")
    turning = "initial_angle = 0.4\ninitial_rate = 3.0\ndrive = 'free'\n"
    scene = load(rest=PENDULUM + BOB + turning, start=start)
    # Measured 1e-15: rounding.
    omega = scene.angular_velocity_at(scene.start)
    np.testing.assert_allclose(omega, [1.0, -2.0, 0.5], atol=1e-14)


HINGES: dict[str, tuple[str, str]] = {
    "no gain": ('drive = "servo"\n', "drive = \"servo\" needs the key 'kv' [N m s/rad]"),
    "no position gain": (
        'drive = "position"\nangle = 0\n',
        "drive = \"position\" needs the key 'kp' [N m/rad]",
    ),
    "no angle": (
        'drive = "position"\nkp = 1\n',
        "drive = \"position\" needs the key 'angle' [rad]",
    ),
    "no torque": ('drive = "torque"\n', "drive = \"torque\" needs the key 'torque' [N m]"),
    "a gain of nothing": (
        'drive = "servo"\nkv = 0\n',
        "a servo's gain must be positive and finite, not 0 N m s/rad",
    ),
    "a negative gain": (
        'drive = "position"\nkp = -6\nangle = 1\n',
        "a position servo's gain must be positive and finite, not -6 N m/rad",
    ),
    "a negative damping": (
        'drive = "free"\ndamping = -1\n',
        "a free hinge's damping, where it is not 0, must be positive and finite, not -1",
    ),
    "another motor's gain": (
        'drive = "servo"\nkv = 1\nkp = 1\n',
        'kp belongs to drive = "position", not to "servo"',
    ),
    "a gain of no motor": ("kv = 1\n", 'kv belongs to drive = "servo", not to "prescribed"'),
    "a limit of no motor": (
        "torque_limit = 1\n",
        'torque_limit belongs to drive = "servo" or "position", not to "prescribed"',
    ),
    "a rate of a position servo": (
        'drive = "position"\nkp = 1\nangle = 1\nrate = 2\n',
        'rate belongs to drive = "prescribed" or "servo", not to "position"',
    ),
    "a start beside the rate": (
        "rate = 1\ninitial_rate = 2\n",
        'initial_rate belongs to drive = "servo" or "position" or "torque" or "free", not to',
    ),
    "an unknown drive": (
        'drive = "servoo"\n',
        "drive: unknown value 'servoo'; it takes free, position, prescribed, servo, torque",
    ),
    "an unknown rate": (
        'rate = { kind = "rmap", final = 1, end = 1 }\n',
        "rate.kind: unknown value 'rmap'; it takes ramp, sine, samples",
    ),
    "a rate without a kind": (
        "rate = { final = 1, end = 1 }\n",
        "rate: key 'kind' is missing; it takes ramp, sine, samples",
    ),
    "words": ('rate = "fast"\n', "rate: it must be a number or a table or a list, not text"),
    "a sum of nothing": ("rate = []\n", "a sum needs at least one rate"),
    "samples too short": (
        'rate = { kind = "samples", times = [0, 3], values = [1, 2] }\n',
        "samples from t = 0 to 3 s do not reach over the run, from 0 to 5 s",
    ),
    "half the samples": (
        'rate = { kind = "samples", times = [0, 5] }\n',
        "samples: key 'values' is missing, or 'file' instead",
    ),
    "samples twice": (
        'rate = { kind = "samples", times = [0, 5], values = [1, 2], file = "x.csv" }\n',
        "samples take a file, or times and values, not both",
    ),
    "samples of no file": (
        'rate = { kind = "samples", file = "x.csv" }\n',
        "x.csv: No such file or directory",
    ),
    "samples in other units": (
        'rate = { kind = "samples", file = "rpm.csv" }\n',
        "rpm.csv: rate is in rpm; samples take rad/s, rad, N m",
    ),
    "samples of two hinges": (
        'rate = { kind = "samples", file = "many.csv" }\n',
        "many.csv: samples take two columns, time and value, not t, a, b",
    ),
    "samples without numbers": (
        'rate = { kind = "samples", file = "bad.csv" }\n',
        "bad.csv: line 3: rate is 'x', and must be a number",
    ),
}


@pytest.mark.parametrize("body", ["frame", "pendulum1"])
@pytest.mark.parametrize("name", HINGES)
def test_hinges_that_cannot_be_are_refused(
    load: Load, tmp_path: Path, name: str, body: str
) -> None:
    """With the body whose hinge it is."""
    (tmp_path / "bad.csv").write_text("t,rate\n0,1\n1,x\n")
    (tmp_path / "rpm.csv").write_text("t,rate\ns,rpm\n0,1\n5,2\n")
    (tmp_path / "many.csv").write_text("t,a,b\n0,1,2\n5,2,3\n")
    keys, words = HINGES[name]
    tables = {"frame": FRAME + keys} if body == "frame" else {"rest": PENDULUM + BOB + keys}
    message = refused(load, tables)
    assert words in message
    assert message.startswith(body)
