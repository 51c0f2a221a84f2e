"""A motor by its data sheet, against exact solutions."""

import numpy as np
import pytest

import robotball as rb
from tests.robotball.files.scene_texts import BOB, HEAD, PENDULUM, robot, scene_of

SHEET = 'drive = "dc_motor"\nstall_torque = 0.04\nno_load_speed = 500.0\ngear = 20.0\n'
WHEEL = "[[rotor]]\naxis = [0, 0, 1]\nmass = 0.3\ninertia = { axial = 4e-4, transverse = 2e-4 }\n"
UPRIGHT_RUBBER = HEAD.replace("classical", "rubber")


@pytest.mark.parametrize(("preset", "most"), [("balanced", 3e-6), ("accurate", 4e-9)])
def test_a_dc_motor_runs_up_exponentially_to_its_no_load_speed(preset: str, most: float) -> None:
    """A wheel about the vertical in a ball that cannot spin: (j + B) dΩ/dt = T - (T/Ω₀) Ω.

    Behind the gear T = 0.8 N m · 0.6, Ω₀ = 25 rad/s · 0.6 and B = 20² · 2e-6 kg m².
    """
    wheel = WHEEL + SHEET + "supply = 0.6\nrotor_inertia = 2e-6\n"
    scene = scene_of(robot(rest=wheel).replace(HEAD, UPRIGHT_RUBBER))
    tau = (4e-4 + 8e-4) / (0.8 / 25.0)  # 37.5 ms
    times = rb.sample_times(0.5)
    exact = 15.0 * (1 - np.exp(-times / tau))
    runs = {"reference": rb.integrate(scene, times), preset: rb.simulate(scene, times, preset)}
    off = {name: np.abs(run.hinge_rates[:, 1] - exact).max() / 15.0 for name, run in runs.items()}
    # Measured 2e-14, rounding; 1.1e-6 at 5 ms and 1.6e-9 at 1 ms, RK4's (dt/τ)⁴/120.
    assert off["reference"] < 1e-13, off
    assert off[preset] < most, off


def test_a_dc_motor_starts_at_rest_and_is_written_as_it_is_read() -> None:
    """Also where the law's two factors are equal, as those of a velocity servo."""
    sheet = SHEET.replace("500.0", "20.0") + "supply = 0.5\n"
    scene = scene_of(robot(rest=PENDULUM + BOB + sheet))
    (motor,) = [each.motor for each in scene.hinges if each.motor]
    assert motor == rb.DCMotor(0.04, 20.0, 20.0)
    assert motor.law.per_command == motor.law.per_rate
    assert scene.hinges[1].rate == 0.0
    assert scene_of(rb.scene_toml(scene)).ball == scene.ball
