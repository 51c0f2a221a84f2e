"""The MJCF model: its bodies, initial state, defaults and appearance."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.mjcf_export import dress
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.settings import PRESETS
from robotball.robot.variations import scaled
from tests.messages import naming

pytestmark = pytest.mark.core

BALANCED = rb.preset("balanced")
FIG12, REGULAR = rb.load_scene("fig12"), rb.load_scene("classical_regular")


def moved(model: Model, steps: int = 0) -> mujoco.MjData:
    """Return the data after some steps from the initial state."""
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
def test_a_model_has_only_bodies_hinges_and_two_geoms(
    scene: rb.Scene, bodies: int, actuators: int, condim: int
) -> None:
    """A body without rotation gets no hinge; rubber rolling adds the torsional row (condim 4).

    Lights, textures and materials are added only for display.
    """
    compiled = build(scene, BALANCED).compiled
    assert (compiled.nbody, compiled.nu, compiled.njnt) == (bodies, actuators, actuators + 1)
    assert compiled.pair_dim.tolist() == [condim]
    assert (compiled.ngeom, compiled.nlight, compiled.ntex, compiled.nmat) == (2, 0, 0, 0)


def test_a_model_starts_in_contact_equilibrium_and_is_built_reproducibly() -> None:
    """The centre is one radius above the plane, without vertical acceleration."""
    first, second = (build(FIG12, BALANCED) for _ in range(2))
    assert first.xml == second.xml
    assert moved(first, 200).qpos.tolist() == moved(second, 200).qpos.tolist()
    data = moved(first)
    assert data.qpos[2] == FIG12.ball.radius
    # Measured 0 m/s²: the depth is solved to rounding.
    assert abs(data.qacc[2]) < 1e-12


def test_a_model_for_engines_that_read_no_sensors_has_none_and_moves_alike() -> None:
    """Some engines refuse the sensors of a contact."""
    scene, settings = rb.load_scene("three_rotors"), PRESETS["balanced"]
    states = []
    for sensed in (True, False):
        model = build(scene, settings, sensed)
        assert bool(model.compiled.nsensor) == sensed
        data = model.start_data()
        mujoco.mj_step(model.compiled, data, 20)
        states.append([*data.qpos, *data.qvel])
    assert states[0] == states[1]


def test_open_fields_keep_mujocos_defaults() -> None:
    """The naive preset writes no option and no contact parameter."""
    compiled = build(FIG12, rb.preset("naive")).compiled
    default = mujoco.MjModel.from_xml_string("<mujoco/>")
    for name in ("timestep", "integrator", "cone", "solver", "iterations", "tolerance", "impratio"):
        assert getattr(compiled.opt, name) == getattr(default.opt, name), name
    assert compiled.pair_friction[0].tolist() == [1, 1, 0.005, 0.0001, 0.0001]
    assert compiled.pair_solref[0].tolist() == [0.02, 1]


@pytest.mark.parametrize("name", ["classical_regular", "three_rotors", "pendulum_robot"])
def test_a_dressed_model_moves_exactly_like_the_bare_one(name: str) -> None:
    """Visual geoms have no mass and lie inside the shell.

    Names contain no `/`, which dm_control reserves.
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


def test_models_that_mujoco_refuses_raise_an_input_error() -> None:
    """A ball too light for MuJoCo, and a contact too soft to carry its weight."""
    with pytest.raises(rb.InputError, match=naming("MuJoCo")):
        rb.simulate(scaled(FIG12, length=1e-9, gravity=1.0), settings="fast")
    with pytest.raises(rb.InputError, match=naming("contact depth")):
        build(FIG12, replace(BALANCED, solref=(0.0, -1e-300)))
