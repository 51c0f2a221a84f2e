"""Engines' importers read our exports correctly, apart from their known losses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.robot.ball import Solid
from tests.random_robots import random_scene
from tests.robotball.view.importers import IMPORTERS, plain

# The last two are a rubber and a classical robot with three off-centre hinges each.
ROBOTS = [random_scene(np.random.default_rng(seed)) for seed in (15, 17)]
SCENES = [*map(rb.load_scene, ("inclined_plane", "steered_pendulum_robot")), *ROBOTS]
FILES = {"MJCF": "model.xml", "URDF": "model.urdf"}
# Quantities that a format cannot express; importers then use a default.
UNSAID = {"URDF": {"gravity", "armature"}}
# Quantities that importers lose; see the README of an export.
LOST = {
    "MJCF, pybullet": {"inertia", "gravity", "armature"},
    "MJCF, pybullet, URDF_USE_INERTIA_FROM_FILE": {"inertia", "gravity", "armature"},
    "MJCF, dartpy": {"mass", "centre", "inertia", "gravity", "armature"},
    "MJCF, pydrake": {"armature"},
    "MJCF, pinocchio": {"gravity"},
    "MJCF, newton": {"gravity"},
    "URDF, mujoco": {"freedoms"},
    "URDF, pybullet": {"inertia"},
}


def errors_of(scene: rb.Scene, form: str, found: dict[str, Any]) -> dict[str, float]:
    """Return the relative errors of a reading in this format compared with the scene.

    The error of the centre is relative to the radius. Quantities that the scene or the format does
    not have are left out.
    """
    bodies = [Solid(body.mass, body.centre, body.inertia) for _, body in scene.ball.named_bodies]
    hinges = {
        hinge.name: (hinge.body.axis, hinge.motor.armature if hinge.motor else 0.0)
        for hinge in scene.hinges
    }
    own = plain(np.eye(3), np.zeros(3), bodies, hinges, scene.gravity_world, 6 + len(hinges))
    errors = {}
    for name in own.keys() - UNSAID.get(form, set()):
        ours, theirs = own[name], found[name]
        if isinstance(ours, dict):
            theirs = [theirs.get(hinge, np.zeros_like(value)) for hinge, value in ours.items()]
            ours = [*ours.values()]
        size = scene.ball.radius if name == "centre" else np.abs(ours).max()
        if size:
            errors[name] = float(np.abs(np.subtract(theirs, ours)).max() / size)
    return errors


@pytest.mark.parametrize("scene", SCENES, ids=range(len(SCENES)))
@pytest.mark.parametrize("name", IMPORTERS)
def test_importers_read_the_scene_apart_from_known_losses(
    name: str, scene: rb.Scene, tmp_path: Path
) -> None:
    """Within 4e-15 with MuJoCo; importers in single precision within 1e-6."""
    pytest.importorskip(name.partition(",")[0])
    rb.export_scene(scene, tmp_path, np.linspace(0.0, 0.1, 3))
    importer, forms = IMPORTERS[name]
    bound = 1e-14 if name == "mujoco" else 1e-6
    for form in forms:
        errors = errors_of(scene, form, importer(str(tmp_path / FILES[form]), form))
        wrong = {name for name, error in errors.items() if error > bound}
        assert wrong <= LOST.get(f"{form}, {name}", set())


def test_a_wrong_number_in_a_file_is_detected(tmp_path: Path) -> None:
    """Doubling the shell's mass in the MJCF changes mass, centre and inertia, and nothing else."""
    scene = SCENES[1]
    rb.export_scene(scene, tmp_path, np.linspace(0.0, 0.1, 3))
    path, mass = tmp_path / FILES["MJCF"], scene.ball.shell.mass
    path.write_text(path.read_text().replace(f'mass="{mass!r}"', f'mass="{2 * mass!r}"'))
    found = IMPORTERS["mujoco"][0](str(path), "MJCF")
    errors = errors_of(scene, "MJCF", found)
    assert found["mass"] == pytest.approx(scene.ball.mass + mass, rel=1e-15)
    assert {name for name, error in errors.items() if error > 1e-6} == {"mass", "centre", "inertia"}
