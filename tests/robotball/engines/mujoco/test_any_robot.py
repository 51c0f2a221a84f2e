"""MuJoCo rolls any robot as ideal rolling does, where the plane's load varies as well."""

from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.motion import ContactMotion
from tests.robots import ENDINGS, worked

# Bounds are about three times what was measured, beside them: of the path error at t = 10 s.
PATH_BOUNDS = {
    ("W1", "fast"): 7e-6,  # 2.4e-6
    ("W1", "balanced"): 3e-8,  # 9.3e-9
    ("W1", "accurate"): 4e-11,  # 1.3e-11
    ("W2", "fast"): 3e-7,  # 8.6e-8
    ("W2", "balanced"): 6e-10,  # 2.1e-10
    ("W2", "accurate"): 6e-12,  # 2.1e-12
    ("W4", "fast"): 3e-5,  # 8.4e-6
    ("W4", "balanced"): 9e-8,  # 2.8e-8
    ("W4", "accurate"): 1.4e-10,  # 4.6e-11
    ("W5", "fast"): 5e-5,  # 1.5e-5
    ("W5", "balanced"): 6e-7,  # 1.8e-7
    ("W5", "accurate"): 8e-10,  # 2.7e-10
}


@cache
def motion_of(name: str, settings: str) -> ContactMotion:
    scene = worked(name)
    return run(build(scene, rb.preset(settings)), scene.times)


@pytest.mark.parametrize(("name", "settings"), PATH_BOUNDS)
def test_a_robot_ends_where_ideal_rolling_does(name: str, settings: str) -> None:
    """Two programs' end points of four robots; RK4's error dominates."""
    motion, ending = motion_of(name, settings), ENDINGS[name]
    off = np.linalg.norm(motion.contact_point[-1] - ending.contact_point)
    assert off < PATH_BOUNDS[name, settings] * motion.path_scale
