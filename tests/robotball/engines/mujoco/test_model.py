"""The MJCF holds what the scene needs, to the last digit, and nothing else."""

from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

import robotball as rb
from robotball.engines.mujoco.mjcf_export import dress
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.settings import Prescribed, for_load
from robotball.robot import Ball, Frame, Rotor
from tests.scenes import FOUR

pytestmark = pytest.mark.core

BALANCED = rb.preset("balanced")


def model_of(scene: rb.Scene | str, settings: rb.Settings = BALANCED) -> Model:
    return build(rb.load_scene(scene) if isinstance(scene, str) else scene, settings)


def whole_ball_inertia(compiled: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """The inertia (3, 3) of all bodies about their common centre, world axes."""
    total = np.zeros((3, 3))
    for body in range(1, compiled.nbody):
        axes = data.ximat[body].reshape(3, 3)
        total += axes @ np.diag(compiled.body_inertia[body]) @ axes.T
    return total


@pytest.mark.parametrize("name", FOUR)
def test_mujoco_has_the_mass_and_inertia_of_the_scene(name: str) -> None:
    """Bodies survive the text and MuJoCo's own diagonalisation to round-off."""
    model = model_of(name)
    data = model.start_data()
    mujoco.mj_forward(model.compiled, data)
    ball, to_world = model.scene.ball, data.xmat[2].reshape(3, 3)
    in_frame = to_world.T @ whole_ball_inertia(model.compiled, data) @ to_world
    assert model.compiled.body_subtreemass[1] == pytest.approx(ball.mass, rel=1e-15)
    # Measured at most 4.0e-15 kg m² (fig14): rounding of two changes of axes, and of the
    # quaternions between.
    assert np.abs(in_frame - ball.inertia).max() < 2e-14


def test_the_text_of_a_model_is_all_of_it() -> None:
    """Compiled again from its text, a model takes bit-identical steps."""
    first, second = model_of("fig12"), model_of("fig12")
    assert first.xml == second.xml
    data = [first.start_data(), second.start_data()]
    for _ in range(200):
        for model, datum in zip((first, second), data, strict=True):
            mujoco.mj_step(model.compiled, datum)
    assert np.array_equal(data[0].qpos, data[1].qpos)
    assert data[0].qpos[0] != 0


@pytest.mark.parametrize(("name", "condim"), [("fig12", 4), ("classical_regular", 3)])
def test_only_the_rubber_model_has_a_torsional_row(name: str, condim: int) -> None:
    """condim 4 makes the rubber model, condim 3 the classical one."""
    assert model_of(name).compiled.pair_dim.tolist() == [condim]


def test_a_scene_without_motors_has_no_hinges() -> None:
    """No rotor means no rotor body, and a frame that does not turn has no hinge."""
    scene = rb.load_scene("classical_regular")
    ball = Ball(scene.ball.shell, scene.ball.frame, rotors=())
    still = replace(scene, ball=ball, frame_rate=0.0, rotor_rates=())
    compiled = model_of(still).compiled
    assert compiled.nbody == 3  # the world, the shell, the frame
    assert compiled.njnt == 1
    assert compiled.nv == 6


def test_a_run_has_nothing_to_look_at() -> None:
    """Two geoms touch; no light, texture or material is in the model."""
    compiled = model_of("fig12").compiled
    assert (compiled.ngeom, compiled.nlight, compiled.ntex, compiled.nmat) == (2, 0, 0, 0)
    assert (compiled.nu, compiled.nbody, compiled.njnt) == (2, 4, 3)


@pytest.mark.slow
@pytest.mark.parametrize("preset", rb.PRESETS)
def test_every_hinge_that_turns_has_its_actuator(preset: str) -> None:
    """A motor told its command, or an ideal one whose control is the acceleration: 0 at a constant
    rate.
    """
    for name in rb.catalog():
        scene = rb.load_scene(name)
        model = build(scene, rb.preset(preset))
        driven = [each for each in model.hinges if not isinstance(each.actuation, rb.Free)]
        assert len(model.hinges) == model.compiled.njnt - 1
        assert model.compiled.nu == len(driven)
        controls = model.compiled.key_ctrl[0]
        for hinge, control in zip(driven, controls, strict=True):
            ideal = isinstance(hinge.actuation, Prescribed)
            constant = 0.0 if scene.steady else float(hinge.drive.acceleration(0.0))
            assert control == (constant if ideal else hinge.drive.rate(0.0))


def test_a_model_has_as_many_rotors_as_its_scene() -> None:
    """Three rotors are three bodies, each turning about its own axis."""
    scene = rb.load_scene("fig12")
    rotor = replace(scene.ball.rotors[0], mass=0.01, axial_inertia=2e-3, transverse_inertia=1e-3)
    rotors = tuple(replace(rotor, axis=axis) for axis in np.eye(3))
    ball = Ball(scene.ball.shell, scene.ball.frame, rotors)
    model = model_of(replace(scene, ball=ball, rotor_rates=(10.0, -20.0, 30.0)))
    data = model.start_data()
    mujoco.mj_forward(model.compiled, data)
    assert [hinge.body for hinge in model.hinges] == ["frame", "rotor1", "rotor2", "rotor3"]
    in_frame = data.xmat[2].reshape(3, 3).T @ data.xaxis[2:].T
    # Measured 5.6e-16: the rotors' hinges stand along the axes asked for.
    assert np.abs(in_frame.T - np.eye(3)).max() < 2e-15


def test_the_ball_starts_with_the_plane_carrying_its_weight() -> None:
    """In equilibrium the centre stands at the radius and does not accelerate upwards."""
    model = model_of("fig12")
    data = model.start_data()
    mujoco.mj_forward(model.compiled, data)
    assert data.qpos[2] == model.scene.ball.radius
    # Measured 0, of 9.81 m/s²: the root is found to the last digits of the depth.
    assert abs(data.qacc[2]) < 1e-12


def test_what_settings_leave_open_stays_at_mujocos_default() -> None:
    """The naive preset writes no option and no contact parameter."""
    compiled = model_of("fig12", rb.preset("naive")).compiled
    default = mujoco.MjModel.from_xml_string("<mujoco/>")
    for name in ("timestep", "integrator", "cone", "solver", "iterations", "tolerance", "impratio"):
        assert getattr(compiled.opt, name) == getattr(default.opt, name), name
    assert compiled.pair_friction[0].tolist() == [1, 1, 0.005, 0.0001, 0.0001]
    assert compiled.pair_solref[0].tolist() == [0.02, 1]


def test_no_timestep_of_a_preset_changes_the_contact() -> None:
    """MuJoCo raises a time constant below two steps in silence; the recipe's never is."""
    for name, preset in product(("fig12", "pendulum_robot"), rb.PRESETS.values()):
        settings = for_load(preset, rb.load_scene(name))
        if settings.solref is not None and settings.timestep is not None:
            assert settings.solref[0] >= 2 * settings.timestep


def test_an_unknown_preset_is_refused_with_the_near_one() -> None:
    """A misspelt preset names the one that was meant."""
    with pytest.raises(rb.InputError, match="no preset is called 'balancd'; did you mean balanced"):
        rb.preset("balancd")


def test_an_inertia_in_any_axes_reaches_mujoco() -> None:
    """A rotor off the principal axes leaves the whole as the tensors add up."""
    scene = rb.load_scene("fig12")
    turned = np.array([0.6, 0.0, 0.8])
    rotor = Rotor(mass=0.02, axial_inertia=0.01, transverse_inertia=0.005, axis=turned)
    frame = Frame(mass=scene.ball.frame.mass, inertia=scene.ball.frame.inertia)
    model = model_of(replace(scene, ball=Ball(scene.ball.shell, frame, (rotor,))))
    data = model.start_data()
    mujoco.mj_forward(model.compiled, data)
    to_world = data.xmat[2].reshape(3, 3)
    in_frame = to_world.T @ whole_ball_inertia(model.compiled, data) @ to_world
    # Measured 2.6e-15 kg m².
    assert np.abs(in_frame - model.scene.ball.inertia).max() < 2e-14


@pytest.mark.parametrize("dressed", [False, True])
@pytest.mark.parametrize("name", [*FOUR, "three_rotors"])
def test_a_model_s_names_are_single_words_that_dm_control_reads(name: str, dressed: bool) -> None:
    """No name has a `/`, which dm_control keeps for itself; it compiles to as many bodies."""
    model = build(rb.load_scene(name), BALANCED)
    model = dress(model) if dressed else model
    again = mujoco.MjModel.from_xml_string(mjcf.from_xml_string(model.xml).to_xml_string())
    assert "/" not in model.xml.replace("/>", "").replace("</", "")
    assert again.nbody == model.compiled.nbody == 3 + len(model.scene.ball.rotors)
    assert (again.ncam, again.nlight) == ((1, 1) if dressed else (0, 0))


@pytest.mark.parametrize("name", [*FOUR, "three_rotors"])
def test_a_dressed_model_moves_as_the_bare_one(name: str) -> None:
    """To the last bit, over 100 steps: what is to be looked at weighs nothing."""
    ends = []
    for dressed in (False, True):
        model = build(rb.load_scene(name), BALANCED)
        model = dress(model) if dressed else model
        data = model.start_data()
        for _ in range(100):
            mujoco.mj_step(model.compiled, data)
        ends.append(np.concatenate([data.qpos, data.qvel]))
    assert np.array_equal(ends[0], ends[1])
