"""Any ball: random physical ones, bodies off centre, in any axes, from a user's own MJCF."""

import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.motion import path_error
from robotball.robot import beyond_the_shell
from robotball.rotations import Array
from validation import Agreement, compare
from validation.studies.random_runs import random_scene

BALLS = 50


@cache
def agreement_of(number: int, settings: str) -> Agreement:
    return compare(random_scene(number), settings)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(BALLS))
def test_mujoco_follows_the_equations_for_any_ball(number: int) -> None:
    """Shells with I_s ≠ J_s, rates of both signs, both models; measured 1.5e-8 at most."""
    agreement = agreement_of(number, "balanced")
    assert agreement.faults == ()
    assert agreement.path_error is not None
    assert agreement.path_error < 5e-8


@pytest.mark.slow
def test_the_median_order_is_four_over_all_balls() -> None:
    """Measured 3.996; single balls 3.91 to 4.35."""
    orders = []
    for number in range(BALLS):
        coarse, fine = (agreement_of(number, each).path_error for each in ("fast", "balanced"))
        assert coarse is not None
        assert fine is not None
        orders.append(np.log(coarse / fine) / np.log(4))
    assert np.median(orders) == pytest.approx(4.0, abs=0.02)


def with_pair_of_rotors(offset: Array, second: Array) -> rb.Scene:
    """fig12 with two rotors off the centre, at `offset` and `second`."""
    scene = rb.load_scene("fig12")
    rotor = replace(scene.ball.rotors[0], mass=0.02, axial_inertia=2e-3, transverse_inertia=1e-3)
    rotors = (replace(rotor, centre=offset), replace(rotor, centre=second))
    return replace(scene, ball=replace(scene.ball, rotors=rotors), rotor_rates=(150.0, -90.0))


@pytest.mark.slow
def test_rotors_off_centre_count_by_steiners_theorem() -> None:
    """A balanced pair off the centre: both engines agree, with the moments that the offset adds."""
    offset = np.array([0.4, -0.3, 0.2])
    scene = with_pair_of_rotors(offset, -offset)
    centred = with_pair_of_rotors(np.zeros(3), np.zeros(3))
    added = scene.ball.inertia - centred.ball.inertia
    expected = 2 * 0.02 * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    assert np.abs(added - expected).max() < 1e-15  # measured 9.5e-17: rounding
    agreement = compare(scene, "balanced")
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-10  # measured 2.5e-11, RK4's
    at_centre = rb.integrate(centred).contact_point - agreement.theory.contact_point
    assert np.abs(at_centre).max() > 1e-2


def test_an_unbalanced_ball_has_a_reference() -> None:
    """(3.2) and (3.3) refuse it with the offset; the larger equations roll it, and M changes."""
    scene = with_pair_of_rotors(np.array([0.4, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]))
    words = r"the ball is not balanced: its centre of mass is 0\.0131637 m off"
    with pytest.raises(rb.InputError, match=words):
        rb.integrate(scene, equations="reduced")
    theory = rb.integrate(scene)
    assert theory.engine.name == "multibody equations"
    assert np.linalg.norm(theory.momentum - theory.momentum[0], axis=1).max() > 1e-3
    motion = rb.simulate(scene, settings="accurate")
    assert path_error(motion, theory) < 1e-5


def test_mass_beyond_the_shell_is_told() -> None:
    """Figs 5 to 10 need it, Figs 11 to 14 do not."""
    with pytest.warns(
        rb.SceneWarning, match=r"frame has mass outside the shell: at 1\.613 m, of 1"
    ):
        rb.load_scene("fig06")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert beyond_the_shell(rb.load_scene("fig12").ball) == []


def test_friction_short_of_the_demand_is_told_with_both_numbers() -> None:
    """The naive settings give less than fig12 needs, of both kinds."""
    with pytest.warns(rb.SceneWarning) as told:
        compare(rb.load_scene("fig12"), "naive")
    lines = [str(each.message) for each in told]
    assert any(
        "fig12, naive: sliding friction is 1 and must be at least 1.321" in line for line in lines
    )
    assert any(
        "fig12, naive: torsional friction is 0.005 m and must be at least 1.873 m" in line
        for line in lines
    )


USERS_MJCF = """
<mujoco>
  <worldbody>
    <body name="chassis" pos="3 0 0" euler="0 0 90">
      <geom type="box" size=".3 .2 .1" mass=".5"/>
      <body pos=".1 0 .2"><geom type="sphere" size=".1" mass=".2"/></body>
      <body pos="-.1 0 -.2"><geom type="sphere" size=".1" mass=".2"/></body>
      <body name="arm"><joint/><geom type="sphere" size=".1" mass=".2"/></body>
    </body>
  </worldbody>
</mujoco>
"""
SCENE = """
title = "a user's frame"
rolling = "rubber"
duration = 2.0
[shell]
radius = 0.8
mass = 0.4
inertia = { thickness = 0.01 }
[frame]
mjcf = { file = "mine.xml", body = "chassis" }
rate = 1.5
[start]
gamma = [0.0, 0.6, 0.8]
alpha = [1.0, 0.0, 0.0]
momentum = [2.0, 0.0, 0.0]
"""


@pytest.mark.slow
def test_a_frame_may_be_a_body_of_the_users_own_mjcf(tmp_path: Path) -> None:
    """Mass, centre and inertia of a body with all that is fixed to it, in the body's axes."""
    without_arm = USERS_MJCF.replace('<body name="arm"><joint/>', "<body>").replace(
        'size=".1" mass=".2"/></body>\n    </body>', 'size=".001" mass="1e-9"/></body>\n    </body>'
    )
    (tmp_path / "mine.xml").write_text(without_arm)
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = rb.load_scene(tmp_path / "scene.toml")
    frame = scene.ball.frame
    assert frame.mass == pytest.approx(0.9, rel=1e-8)
    assert np.abs(frame.centre).max() < 1e-9
    box = 0.5 / 3 * np.array([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2])
    spheres = 2 * (0.4 * 0.2 * 0.1**2 + 0.2 * np.array([0.04, 0.05, 0.01]))
    np.testing.assert_allclose(np.diag(frame.inertia), box + spheres, rtol=1e-7)
    assert frame.inertia[0, 2] == pytest.approx(-2 * 0.2 * 0.1 * 0.2, rel=1e-7)
    (tmp_path / "mine.xml").write_text(USERS_MJCF)
    with pytest.raises(rb.InputError, match=r"body 'chassis' carries '.*', which moves on it"):
        rb.load_scene(tmp_path / "scene.toml")


def test_a_model_keeps_its_rotors_where_they_are() -> None:
    """MuJoCo's centre of mass is the ball's own, to rounding."""
    scene = with_pair_of_rotors(np.array([0.4, 0.0, 0.1]), np.array([0.2, -0.3, 0.0]))
    import mujoco

    model = build(scene, rb.preset("balanced"))
    data = model.start_data()
    mujoco.mj_forward(model.compiled, data)
    in_frame = data.xmat[2].reshape(3, 3).T @ (data.subtree_com[1] - data.xpos[1])
    assert np.abs(in_frame - scene.ball.centre_of_mass).max() < 1e-15
