"""Steps with resistance to rolling: divergence, the number of parts per step, and deceleration."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import control
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.stepping import controlled
from robotball.robot.ball import Ball, Shell, shell_inertia
from robotball.robot.motors import Motor
from robotball.robot.scene import Friction
from tests.robots import Y, low_weight, robot, worked

pytestmark = pytest.mark.core

ON = replace(rb.preset("fast"), stop_at_fault=False)
FREE = rb.Free(damping=0.01)


def resisting(*motors: Motor) -> rb.Scene:
    """W4 with other motors, on a plane that resists rolling."""
    return replace(worked("W4").with_hinges(motor=motors), friction=Friction(rolling=0.005))


def test_a_robot_that_diverges_with_rolling_resistance_ends_with_that_fault() -> None:
    """The callback only sets controls: a warning raised inside a callback would hang MuJoCo."""
    scene = resisting(rb.Servo(5e3), FREE)
    with controlled(build(scene, ON)) as running:
        assert mujoco.get_mjcb_control() == running.set
    last = rb.simulate(scene, settings=ON).report.faults[-1]
    assert (last.text, last.fatal) == ("the state diverged", True)
    assert last.time < 0.02  # measured 0.01087: within the first step


@pytest.mark.parametrize("gain", [5.0, 5e7])
def test_a_diverging_robot_ends_after_few_parts(gain: float) -> None:
    """The monitor checks after 64 parts; otherwise the step would have a million."""
    motors = rb.Servo(gain), rb.PositionServo(12 * gain, 0.3)
    report = rb.simulate(resisting(*motors), settings=ON).report
    assert "the state diverged" in [fault.text for fault in report.faults]
    assert report.steps <= 128  # measured 64


def test_a_run_of_too_many_parts_ends_with_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """Starting from a standstill takes hundreds of parts for a frame rate of 0.1 rad/s."""
    lean = low_weight(3.0, 0.08).with_hinges(command=(0.1,))
    start = rb.Start(np.array([1.0, 0.0, 0.0, 0.0]), lean.start.momentum)
    lean = replace(lean, start=start, friction=Friction(rolling=0.005), duration=3.0)
    assert rb.simulate(lean, settings="fast").report.faults == ()
    monkeypatch.setattr(control, "_MOST_PARTS", 100)
    monkeypatch.setattr(control, "_PARTS", 2)
    (fault,) = rb.simulate(lean, settings="fast").report.faults
    assert fault.kind is rb.FaultKind.STEP_TOO_SHORT
    assert fault.fatal
    assert 0 < fault.time < lean.duration
    for fact in ("parts", "timestep", "gain", "friction.rolling"):
        assert fact in fault.text


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "discrete", "RK4"])
def test_every_integrator_decelerates_a_ball_at_the_exact_rate(integrator: str) -> None:
    """A hollow sphere slows by 3 μ g t / (5 a²): the torque over its inertia, 5/3 m a²."""
    inertia = shell_inertia(0.2, 1.5)
    ball = Ball(Shell(0.2, 1.5, inertia, inertia, Y), ())
    scene = robot("sphere", ball, "classical", [], (1.0, 0.0, 0.0, 0.0), (0.0, 9.0, 0.0))
    scene = replace(scene, friction=Friction(rolling=0.004), gravity=9.81)
    settings = replace(rb.preset("balanced"), integrator=integrator, stop_at_fault=False)
    motion = rb.simulate(scene, np.array([0.0, 1.0]), settings=settings)
    slower = 0.6 * 0.004 * 9.81 / 0.2**2
    rate = motion.angular_velocity[-1, 1]
    # Measured 3.3e-14 rad/s: rounding.
    assert rate == pytest.approx(9.0 - slower, abs=1e-12)
