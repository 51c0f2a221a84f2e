"""Motors specified by a data sheet, compared with exact solutions."""

import re

import numpy as np
import pytest

import robotball as rb
from tests.imports import PROJECT
from tests.messages import naming
from tests.robotball.scene_files.scene_texts import BOB, HEAD, PENDULUM, robot, scene_of

SHEET = 'drive = "dc_motor"\nstall_torque = 0.04\nno_load_speed = 500.0\ngear = 20.0\n'
WHEEL = "[[rotor]]\naxis = [0, 0, 1]\nmass = 0.3\ninertia = { axial = 4e-4, transverse = 2e-4 }\n"
UPRIGHT_RUBBER = HEAD.replace("classical", "rubber")


@pytest.mark.parametrize(("preset", "most"), [("balanced", 3e-6), ("accurate", 4e-9)])
def test_a_dc_motor_approaches_its_no_load_speed_exponentially(preset: str, most: float) -> None:
    """A wheel with a vertical axis in a ball that cannot spin: (j + B) dΩ/dt = T - (T/Ω₀) Ω.

    At the gear output T = 0.8 N m · 0.6, Ω₀ = 25 rad/s · 0.6 and B = 20² · 2e-6 kg m².
    """
    wheel = WHEEL + SHEET + "supply = 0.6\nrotor_inertia = 2e-6\n"
    scene = scene_of(robot(rest=wheel).replace(HEAD, UPRIGHT_RUBBER))
    tau = (4e-4 + 8e-4) / (0.8 / 25.0)  # 37.5 ms
    times = rb.sample_times(0.5)
    exact = 15.0 * (1 - np.exp(-times / tau))
    runs = {
        "reference": rb.integrate(scene, times),
        preset: rb.simulate(scene, times, settings=preset),
    }
    off = {name: np.abs(run.hinge_rates[:, 1] - exact).max() / 15.0 for name, run in runs.items()}
    # Measured 2e-14, rounding; 1.1e-6 at 5 ms and 1.6e-9 at 1 ms: (dt/τ)⁴/120 of RK4.
    assert off["reference"] < 1e-13, off
    assert off[preset] < most, off


def test_a_dc_motor_starts_at_rest_and_survives_a_round_trip() -> None:
    """Even if both factors of its law are equal, as in a velocity servo."""
    sheet = SHEET.replace("500.0", "20.0") + "supply = 0.5\n"
    scene = scene_of(robot(rest=PENDULUM + BOB + sheet))
    (motor,) = [hinge.motor for hinge in scene.hinges if hinge.motor]
    assert motor == rb.DCMotor(0.04, 20.0, 20.0)
    assert motor.law.per_command == motor.law.per_rate
    assert scene.hinges[1].rate == 0.0
    assert scene_of(rb.scene_toml(scene)).ball == scene.ball


LOSSES = "efficiency = 0.8\nno_load_current = 0.1\nstall_current = 2.1\n"


def test_motor_friction_and_gear_losses_reduce_the_final_rate() -> None:
    """An efficiency of 0.8 and a friction of 1/20 of the torque: the final rate is 0.58 · 25 rad/s.

    Measured 2.6e-6 and 4.3e-7 of it, as friction is smoothed below 1e-3 rad/s; without friction
    3e-2.
    """
    wheel = WHEEL + SHEET + LOSSES + "supply = 0.6\nrotor_inertia = 2e-6\n"
    scene = scene_of(robot(rest=wheel).replace(HEAD, UPRIGHT_RUBBER))
    tau, final = (4e-4 + 8e-4) / (0.8 * 0.8 / 25.0), 25.0 * (0.6 - 0.4 / 20)
    times = rb.sample_times(0.3)
    exact = final * (1 - np.exp(-times / tau))
    for motion in (rb.integrate(scene, times), rb.simulate(scene, times, settings="balanced")):
        assert np.abs(motion.hinge_rates[:, 1] - exact).max() < 8e-6 * final
    (motor,) = [hinge.motor for hinge in scene.hinges if hinge.motor]
    assert motor.law.torque(1.0, 0.0, 0.0) == pytest.approx(0.8 * 0.8 * 1.05)
    assert scene_of(rb.scene_toml(scene)).ball == scene.ball


@pytest.mark.parametrize(
    ("keys", "facts"),
    [
        ("efficiency = 1.2\n", "efficiency 1.2"),
        ("no_load_current = 3\nstall_current = 2\n", "2~A 3~A"),
        ("no_load_current = 1\n", "stall current torque"),
        (LOSSES + "torque_limit = 3\n", "stall current torque"),
    ],
)
def test_impossible_motor_losses_are_refused(keys: str, facts: str) -> None:
    """The error names the value and its limit."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        scene_of(robot(rest=WHEEL + SHEET + keys + "supply = 0.6\n"))


def test_the_documented_gains_of_a_dynamixel_follow_from_its_registers() -> None:
    """An error of one encoder step gives P/128 of 1/885 of the stall torque.

    kp = 18.88 N m/rad and kd = 0.851 N m s/rad, rounded in the docs.
    """
    page = (PROJECT / "docs" / "tutorials" / "data_sheet.md").read_text(encoding="utf-8")
    kp, kd = (float(re.findall(rf"`{key} = (\S+)`", page)[0]) for key in ("kp", "kd"))
    step = 2 * np.pi / 4096
    assert kp * step == pytest.approx(4.1 * 800 / 128 / 885, rel=2e-3)
    assert kd * (46 * np.pi / 30) == pytest.approx(4.1, rel=2e-3)
