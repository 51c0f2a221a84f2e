"""How a robot's hinges are moved and what they start with, or why they cannot be."""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.robotball.files.scene_texts import BOB, FRAME, PENDULUM, START, Load


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
