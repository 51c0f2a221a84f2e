"""The MJCF holds what the scene needs, to the last digit, and nothing else."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

import robotball as rb
from robotball.engines.mujoco.mjcf_export import dress
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.settings import Prescribed
from robotball.robot import Ball, Frame, Rotor
from validation.studies.random_runs import rescaled

pytestmark = pytest.mark.core

BALANCED = rb.preset("balanced")
FIG12, REGULAR = rb.load_scene("fig12"), rb.load_scene("classical_regular")


def moved(model: Model, steps: int = 0) -> mujoco.MjData:
    """The data after some steps from the start, evaluated."""
    data = model.start_data()
    for _ in range(steps):
        mujoco.mj_step(model.compiled, data)
    mujoco.mj_forward(model.compiled, data)
    return data


def with_rotors(*rotors: Rotor) -> rb.Scene:
    shell, frame = FIG12.ball.shell, FIG12.ball.frame
    ball = Ball(shell, Frame(frame.mass, frame.inertia), rotors)
    return replace(FIG12, ball=ball, rotor_rates=tuple(10.0 * i for i, _ in enumerate(rotors, 1)))


THREE = with_rotors(*(Rotor(0.01, 2e-3, 1e-3, axis) for axis in np.eye(3)))
TURNED = with_rotors(Rotor(0.02, 0.01, 0.005, np.array([0.6, 0.0, 0.8])))
STILL = replace(
    REGULAR, ball=replace(REGULAR.ball, rotors=()), frame_rate=0.0, rotor_rates=()
)  # fmt: skip


@pytest.mark.parametrize(
    "scene", [FIG12, REGULAR, THREE, TURNED], ids=["fig12", "classical", "three rotors", "turned"]
)
def test_mujoco_has_the_mass_and_inertia_of_the_scene(scene: rb.Scene) -> None:
    """Bodies in any axes survive the text and MuJoCo's own diagonalisation to round-off."""
    model = build(scene, BALANCED)
    compiled, data, ball = model.compiled, moved(model), scene.ball
    inertia = np.zeros((3, 3))  # of all bodies about their common centre, world axes
    for axes, principal in zip(data.ximat[1:], compiled.body_inertia[1:], strict=True):
        inertia += axes.reshape(3, 3) @ np.diag(principal) @ axes.reshape(3, 3).T
    to_world = data.xmat[2].reshape(3, 3)
    assert compiled.body_subtreemass[1] == pytest.approx(ball.mass, rel=1e-15)
    # Measured at most 4.0e-15 kg m² (fig14): rounding of two changes of axes, and of the
    # quaternions between.
    assert np.abs(to_world.T @ inertia @ to_world - ball.inertia).max() < 2e-14
    rotors = range(1, len(ball.rotors) + 1)
    assert [hinge.body for hinge in model.hinges] == ["frame", *(f"rotor{i}" for i in rotors)]
    # Measured 5.6e-16: the rotors' hinges stand along the axes asked for.
    axes = data.xaxis[2:] @ to_world
    assert np.abs(axes - [rotor.axis for rotor in ball.rotors]).max() < 2e-15


@pytest.mark.parametrize(
    ("scene", "bodies", "actuators", "condim"),
    [(FIG12, 4, 2, 4), (REGULAR, 4, 2, 3), (STILL, 3, 0, 3)],
    ids=["rubber", "classical", "still"],
)
def test_a_model_has_what_its_scene_needs_and_nothing_to_look_at(
    scene: rb.Scene, bodies: int, actuators: int, condim: int
) -> None:
    """The world, shell, frame and rotors; a hinge for what turns; rubber's torsional row.

    Two geoms touch; no light, texture or material is in the model.
    """
    compiled = build(scene, BALANCED).compiled
    assert (compiled.nbody, compiled.nu, compiled.njnt) == (bodies, actuators, actuators + 1)
    assert compiled.pair_dim.tolist() == [condim]
    assert (compiled.ngeom, compiled.nlight, compiled.ntex, compiled.nmat) == (2, 0, 0, 0)


HINGED = ("servo_motors", "wobbling_drive", "zero_rotor", "pendulum_robot", "swinging_frame")


@pytest.mark.parametrize("preset", ["naive", "balanced"])
@pytest.mark.parametrize("name", HINGED)
def test_every_hinge_that_turns_has_its_actuator(name: str, preset: str) -> None:
    """A motor told its command, or an ideal one told the acceleration: 0 at a constant rate."""
    scene = rb.load_scene(name)
    model = build(scene, rb.preset(preset))
    driven = [each for each in model.hinges if not isinstance(each.actuation, rb.Free)]
    assert len(model.hinges) == model.compiled.njnt - 1
    assert model.compiled.nu == len(driven)
    for hinge, control in zip(driven, model.compiled.key_ctrl[0], strict=True):
        ideal = isinstance(hinge.actuation, Prescribed)
        constant = 0.0 if scene.steady else float(hinge.drive.acceleration(0.0))
        assert control == (constant if ideal else hinge.drive.rate(0.0))


def test_the_text_of_a_model_is_all_of_it() -> None:
    """Compiled again from its text, a model takes bit-identical steps."""
    first, second = (build(FIG12, BALANCED) for _ in range(2))
    assert first.xml == second.xml
    ends = [moved(model, 200).qpos for model in (first, second)]
    assert np.array_equal(*ends)
    assert ends[0][0] != 0


def test_the_ball_starts_with_the_plane_carrying_its_weight() -> None:
    """In equilibrium the centre stands at the radius and does not accelerate upwards."""
    data = moved(build(FIG12, BALANCED))
    assert data.qpos[2] == FIG12.ball.radius
    # Measured 0, of 9.81 m/s²: the root is found to the last digits of the depth.
    assert abs(data.qacc[2]) < 1e-12


def test_what_settings_leave_open_stays_at_mujocos_default() -> None:
    """The naive preset writes no option and no contact parameter."""
    compiled = build(FIG12, rb.preset("naive")).compiled
    default = mujoco.MjModel.from_xml_string("<mujoco/>")
    for name in ("timestep", "integrator", "cone", "solver", "iterations", "tolerance", "impratio"):
        assert getattr(compiled.opt, name) == getattr(default.opt, name), name
    assert compiled.pair_friction[0].tolist() == [1, 1, 0.005, 0.0001, 0.0001]
    assert compiled.pair_solref[0].tolist() == [0.02, 1]


@pytest.mark.parametrize("name", ["fig12", "classical_regular", "three_rotors", "pendulum_robot"])
def test_a_dressed_model_moves_as_the_bare_one(name: str) -> None:
    """To the last bit: what is to be looked at weighs nothing, and none of it is outside the shell.

    No name has a `/`, which dm_control keeps for itself; it compiles to as many bodies.
    """
    bare = build(rb.load_scene(name), BALANCED)
    dressed, ball = dress(bare), bare.scene.ball
    for model, lights in ((bare, 0), (dressed, 1)):
        again = mujoco.MjModel.from_xml_string(mjcf.from_xml_string(model.xml).to_xml_string())
        assert "/" not in model.xml.replace("/>", "").replace("</", "")
        assert again.nbody == model.compiled.nbody
        assert again.nbody == 3 + len(ball.rotors) + len(ball.pendulums)
        assert (again.ncam, again.nlight) == (lights, lights)
    ends = [moved(model, 100) for model in (bare, dressed)]
    assert np.array_equal(ends[0].qpos, ends[1].qpos)
    assert np.array_equal(ends[0].qvel, ends[1].qvel)
    shapes = ends[1].geom_xpos[dressed.compiled.geom_bodyid > 0]
    assert len(shapes) > 2
    assert np.linalg.norm(shapes - ends[1].body("shell").xpos, axis=1).max() < ball.radius


def test_what_mujoco_refuses_is_one_line() -> None:
    """A ball too light for MuJoCo, and a contact that carries nothing."""
    with pytest.raises(rb.InputError, match="MuJoCo refuses the model: "):
        rb.simulate(rescaled(FIG12, length=1e-9), settings="fast")
    with pytest.raises(rb.InputError, match="the contact cannot carry the ball at any depth"):
        build(FIG12, replace(BALANCED, solref=(0.0, -1e-300)))
