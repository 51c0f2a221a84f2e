"""The MJCF holds what the scene needs, to the last digit, and nothing else."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.mjcf_export import dress
from robotball.engines.mujoco.model import Model, build
from robotball.robot.variations import scaled
from tests.messages import naming

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


STILL = replace(REGULAR, ball=rb.Ball(REGULAR.ball.shell, (rb.Hinge(REGULAR.ball.frame),)))


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


def test_a_model_starts_with_the_plane_carrying_its_weight_and_is_built_alike_twice() -> None:
    """In equilibrium the centre stands at the radius and does not accelerate upwards."""
    first, second = (build(FIG12, BALANCED) for _ in range(2))
    assert first.xml == second.xml
    assert moved(first, 200).qpos.tolist() == moved(second, 200).qpos.tolist()
    data = moved(first)
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


@pytest.mark.parametrize("name", ["classical_regular", "three_rotors", "pendulum_robot"])
def test_a_dressed_model_moves_as_the_bare_one(name: str) -> None:
    """To the last bit: what is to be looked at weighs nothing, and none of it is outside the shell.

    No name has a `/`, which dm_control keeps for itself.
    """
    bare = build(rb.load_scene(name), BALANCED)
    dressed, ball = dress(bare), bare.scene.ball
    for model, lights in ((bare, 0), (dressed, 1)):
        assert "/" not in model.xml.replace("/>", "").replace("</", "")
        assert model.compiled.nbody == 3 + len(ball.rotors) + len(ball.pendulums)
        assert (model.compiled.ncam, model.compiled.nlight) == (lights, lights)
    ends = [moved(model, 100) for model in (bare, dressed)]
    assert np.array_equal(ends[0].qvel, ends[1].qvel)
    shapes = ends[1].geom_xpos[dressed.compiled.geom_bodyid > 0]
    assert len(shapes) > 2
    assert np.linalg.norm(shapes - ends[1].body("shell").xpos, axis=1).max() < ball.radius


def test_what_mujoco_refuses_is_one_line() -> None:
    """A ball too light for MuJoCo, and a contact that carries nothing."""
    with pytest.raises(rb.InputError, match=naming("MuJoCo")):
        rb.simulate(scaled(FIG12, length=1e-9, gravity=1.0), settings="fast")
    with pytest.raises(rb.InputError, match=naming("contact depth")):
        build(FIG12, replace(BALANCED, solref=(0.0, -1e-300)))
