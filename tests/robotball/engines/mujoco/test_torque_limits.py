"""Steps that are split when a motor reaches or leaves its torque limit."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.control import FREE_QPOS, FREE_QVEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.stepping import controlled
from tests.robots import worked

pytestmark = pytest.mark.core

STEP, STEPS = 5e-3, 80  # W4's frame reaches its limit of 0.6 N m at 0.308 s
SCENE = worked("W4")


def test_a_step_is_split_exactly_at_the_torque_limit() -> None:
    """The unlimited torque there exceeds the limit by 1e-7, the target of the search, to 1e-12.

    A looser search is off by 60 times as much. The torque is within the limit before the switch
    and beyond it after; the parts add up to the step.
    """
    model = build(SCENE, rb.preset("balanced"))
    limited, command = SCENE.hinges[0].motor, SCENE.drives[0]
    assert limited is not None
    limit, law = limited.law.limit, limited.law._replace(limit=np.inf)
    met, sides = [], []
    with controlled(model) as control:
        control.span, steps = (0.0, SCENE.duration), control.steps
        assert steps is not None
        data = model.start_data()
        for k in range(STEPS):
            parts = [(part, data.time, torque_of(law, data, command)) for part in steps(data, STEP)]
            assert sum(part for part, *_ in parts) == pytest.approx(STEP, rel=1e-14)
            assert data.time == pytest.approx((k + 1) * STEP, rel=1e-13)
            met += [(t, w / limit) for _, t, w in parts[:-1]]
            sides.append(abs(parts[-1][2]) > limit)
    ((t, part),) = met
    assert abs(abs(part) - 1 - 1e-7) < 1e-12
    assert t == pytest.approx(0.3078706, abs=1e-6)
    assert sides == [k >= int(t / STEP) for k in range(STEPS)]


def torque_of(law: rb.Law, data: mujoco.MjData, command: rb.robot.drives.Drive) -> float:
    angle, rate = float(data.qpos[FREE_QPOS]), float(data.qvel[FREE_QVEL])
    return float(law.torque(command.rate(data.time), angle, rate))


def test_a_run_restores_the_actuators_of_the_model() -> None:
    """Their gains, biases and limits, which change at a switch."""
    compiled = (model := build(SCENE, rb.preset("balanced"))).compiled
    names = ("actuator_gainprm", "actuator_biasprm", "actuator_forcelimited")
    before = [getattr(compiled, name).copy() for name in names]
    with controlled(model) as control:
        control.span, steps = (0.0, SCENE.duration), control.steps
        assert steps is not None
        data = model.start_data()
        for _ in steps(data, STEP):
            inside = [getattr(compiled, name).copy() for name in names]
    assert any(np.any(a != b) for a, b in zip(before, inside, strict=True))
    for name, old in zip(names, before, strict=True):
        assert np.array_equal(getattr(compiled, name), old)


def test_a_servo_that_diverges_at_a_torque_limit_is_a_fault() -> None:
    """In the search for the switch, states that are not finite count as beyond the limit."""
    motors = rb.Servo(0.5, torque_limit=0.6), rb.PositionServo(6e4, 0.3)
    settings = replace(rb.preset("fast"), stop_at_fault=False)
    report = rb.simulate(SCENE.with_hinges(motor=motors), settings=settings).report
    (fault,) = report.faults
    assert (fault.text, fault.fatal) == ("the state diverged", True)
    assert fault.time == pytest.approx(0.02)  # the end of the first step
