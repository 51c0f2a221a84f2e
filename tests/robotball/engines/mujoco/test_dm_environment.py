"""The dm_env environment: its motion, specifications, rewards and errors."""

import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.robot.scene import Friction
from robotball.rotations import Array
from tests.messages import naming, unnamed

FIG12, WOBBLING = rb.load_scene("fig12"), rb.load_scene("wobbling_drive")
STRAIGHT = np.linspace([0.0, 0.0], [1.0, 0.0], 11)

needed = pytest.mark.skipif(find_spec("dm_control") is None, reason="dm-control is not installed")


def driven(scene: rb.Scene, settings: str, interval: float) -> tuple[Array, Array, list[float]]:
    """Return contact points (n, 2), attitudes (n, 4) and rewards with the drives of the scene."""
    environment = rb.dm_environment(scene, settings=settings, control_timestep=interval)
    steps, task = [environment.reset()], environment.task
    while not steps[-1].last():
        end = len(steps) * interval
        # A prescribed rate is reached at the end of the step; a motor command is held over it,
        # and is most accurate at its middle.
        at = np.where(task.prescribed, end, end - interval / 2)
        commands = [float(drive.rate(t)) for drive, t in zip(task.commands, at, strict=True)]
        steps.append(environment.step(np.array(commands)))
    observations = [step.observation for step in steps]
    points = np.array([step["centre"][:2] for step in observations])
    return (
        points,
        np.array([step["attitude"] for step in observations]),
        [s.reward for s in steps[1:]],
    )


@needed
@pytest.mark.parametrize(
    ("name", "settings"),
    [("fig12", "balanced"), ("fig12", "naive"), ("servo_motors", "balanced")],
)
def test_constant_commands_give_exactly_the_motion_of_a_run(name: str, settings: str) -> None:
    """With prescribed rates, motors, and the warm start of MuJoCo that "naive" uses."""
    scene = replace(rb.load_scene(name), duration=1.0)
    motion = rb.simulate(scene, settings=replace(rb.preset(settings), stop_at_fault=False))
    points, attitudes, rewards = driven(scene, settings, 0.02)
    assert points.tolist() == motion.contact_point.tolist()
    assert attitudes.tolist() == motion.attitude.tolist()
    # Measured 1 - 1e-17 on the path of the equations, and 0 with "naive", which is a radius off.
    assert (min(rewards) > 1 - 1e-9) == (settings == "balanced")


@needed
def test_the_error_of_held_commands_is_quadratic_in_the_control_timestep() -> None:
    """Measured 6.5e-5 of the path at 20 ms, 4.00 times the error at 10 ms."""
    scene = replace(WOBBLING, duration=1.0)
    off = []
    for interval in (0.02, 0.01):
        motion = rb.simulate(scene, rb.sample_times(1.0, interval))
        points, _, _ = driven(scene, "balanced", interval)
        off.append(np.abs(points - motion.contact_point).max() / motion.path_length)
    assert off[0] < 1e-4
    assert off[0] / off[1] == pytest.approx(4, rel=0.1)


@needed
@pytest.mark.parametrize("scene", [FIG12, rb.load_scene("steered_pendulum_robot")], ids=str)
def test_observations_under_random_actions_match_the_specifications(scene: rb.Scene) -> None:
    """Until the path ends; the next step starts a new episode from the start of the scene."""
    environment = rb.dm_environment(scene, STRAIGHT)
    actions, observed = environment.action_spec(), environment.observation_spec()
    rng, first = np.random.default_rng(1), environment.reset()
    for number in range(1, len(STRAIGHT)):
        step = environment.step(actions.validate(rng.uniform(actions.minimum, actions.maximum)))
        assert 0 <= step.reward <= 1
        assert step.last() == (number == len(STRAIGHT) - 1)
        assert step.observation.keys() == observed.keys()
        for name, value in step.observation.items():
            assert np.isfinite(observed[name].validate(value)).all(), name
    again = environment.step(actions.minimum)
    assert again.first()
    assert str(again.observation) == str(first.observation)


@needed
def test_the_reward_falls_with_the_distance_from_the_path() -> None:
    """From 1 on the path to 0.1 at one radius; the target is the vector to the next point."""
    along = rb.integrate(FIG12, rb.sample_times(0.04)).contact_point
    for away, reward in ((np.zeros(2), 1.0), (np.array([FIG12.ball.radius, 0.0]), 0.1)):
        environment = rb.dm_environment(FIG12, along + away)
        first = environment.reset().observation
        assert first["target"] == pytest.approx(along[1] + away - along[0])
        step = environment.step([2.0, 148.0])
        # Measured 2e-7: the rotor rate of the scene is 147.98 rad/s.
        assert step.reward == pytest.approx(reward, abs=1e-4)


@needed
def test_actions_that_break_the_simulation_raise_a_physics_error() -> None:
    """MuJoCo alone would replace each of these controls with 0."""
    from dm_control.rl.control import PhysicsError

    environment = rb.dm_environment("fig12", STRAIGHT)
    for rate in (np.nan, 1e10):
        environment.reset()
        with pytest.raises(PhysicsError, match=naming("0.02~s")):
            environment.step([rate, 0.0])


@needed
@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"scene": "fig2"}, "scene 'fig2'"),
        ({"path": STRAIGHT[:, 0]}, "path (n,~2)"),
        ({"path": STRAIGHT[:1]}, "(1,~2)"),
        ({"path": STRAIGHT + np.inf}, "finite numbers"),
        ({"control_timestep": 0.0}, "control_timestep 0~s"),
        ({"settings": "exact"}, "fig12 exact MuJoCo"),
        ({"scene": replace(FIG12, friction=Friction(rolling=0.01))}, "rolling friction"),
        ({"largest_action": [1.0, 2.0, 3.0]}, "largest_action 2"),
    ],
)
def test_invalid_environments_are_refused(changes: dict[str, Any], facts: str) -> None:
    """The error names the argument and the allowed values."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        rb.dm_environment(**{"scene": "fig12", **changes})


def test_a_missing_dm_control_is_reported_with_the_package_to_install() -> None:
    """Everything else runs without it."""
    code = """
import sys
sys.modules["dm_control"] = None
import robotball as rb
print(len(rb.simulate("fig12", rb.sample_times(0.1)).times))
rb.dm_environment("fig12")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "6\n"
    assert unnamed("InputError dm_environment dm-control", done.stderr.split("\n")[-2]) == []
