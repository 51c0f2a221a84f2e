"""Exports as engines' own importers read them: our files are right, and theirs are the losses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.robot.ball import Solid
from tests.random_robots import random_scene
from tests.robotball.view.importers import IMPORTERS, plain

# The latter two are a rubber and a classical robot of three hinges each, off centre.
ROBOTS = [random_scene(np.random.default_rng(seed)) for seed in (15, 17)]
SCENES = [*map(rb.load_scene, ("inclined_plane", "steered_pendulum_robot")), *ROBOTS]
FILES = {"JSON": "scene.json", "MJCF": "model.xml", "URDF": "model.urdf", "SDF": "model.sdf"}
# What a format has no word for; importers then have a value of their own.
UNSAID = {"URDF": {"gravity", "armature"}, "SDF": {"armature"}}
# What importers lose of our files, as docs/findings.md and the README of an export say.
LOST = {
    "MJCF, pybullet": {"inertia", "gravity", "armature"},
    "MJCF, pybullet, URDF_USE_INERTIA_FROM_FILE": {"inertia", "gravity", "armature"},
    "MJCF, dartpy": {"mass", "centre", "inertia", "gravity", "armature"},
    "MJCF, pydrake": {"armature"},
    "MJCF, pinocchio": {"gravity"},
    "MJCF, newton": {"gravity"},
    "URDF, mujoco": {"freedoms"},
    "URDF, pybullet": {"inertia"},
    "SDF, pybullet": {"inertia", "gravity"},
    "SDF, pydrake": {"gravity"},
}


def errors_of(scene: rb.Scene, form: str, found: dict[str, Any]) -> dict[str, float]:
    """The relative errors of a reading in this format against the scene itself.

    That of the centre is over the radius. What the scene or the format does not have is left out.
    """
    bodies = [Solid(each.mass, each.centre, each.inertia) for _, each in scene.ball.named_bodies]
    hinges = {
        hinge.name: (hinge.body.axis, hinge.motor.armature if hinge.motor else 0.0)
        for hinge in scene.hinges
    }
    own = plain(np.eye(3), np.zeros(3), bodies, hinges, scene.gravity_world, 6 + len(hinges))
    errors = {}
    for name in own.keys() - UNSAID.get(form, set()):
        ours, theirs = own[name], found[name]
        if isinstance(ours, dict):
            theirs = [theirs.get(hinge, np.zeros_like(each)) for hinge, each in ours.items()]
            ours = [*ours.values()]
        size = scene.ball.radius if name == "centre" else np.abs(ours).max()
        if size:
            errors[name] = float(np.abs(np.subtract(theirs, ours)).max() / size)
    return errors


@pytest.mark.parametrize("scene", SCENES, ids=range(len(SCENES)))
@pytest.mark.parametrize("name", IMPORTERS)
def test_an_importer_reads_the_scene_but_for_what_it_is_known_to_lose(
    name: str, scene: rb.Scene, tmp_path: Path
) -> None:
    """Within 4e-15, by MuJoCo and by Python; single precision within 1e-6."""
    pytest.importorskip(name.partition(",")[0])
    rb.export_scene(scene, tmp_path, np.linspace(0.0, 0.1, 3))
    importer, forms = IMPORTERS[name]
    bound = 1e-14 if name in ("mujoco", "json") else 1e-6
    for form in forms:
        errors = errors_of(scene, form, importer(str(tmp_path / FILES[form]), form))
        wrong = {each for each, error in errors.items() if error > bound}
        assert wrong <= LOST.get(f"{form}, {name}", set())


def test_a_wrong_number_in_a_file_is_found(tmp_path: Path) -> None:
    """Twice the shell's mass in the MJCF: mass, centre and inertia differ, and nothing else."""
    scene = SCENES[1]
    rb.export_scene(scene, tmp_path, np.linspace(0.0, 0.1, 3))
    path, mass = tmp_path / FILES["MJCF"], scene.ball.shell.mass
    path.write_text(path.read_text().replace(f'mass="{mass!r}"', f'mass="{2 * mass!r}"'))
    found = IMPORTERS["mujoco"][0](str(path), "MJCF")
    errors = errors_of(scene, "MJCF", found)
    assert found["mass"] == pytest.approx(scene.ball.mass + mass, rel=1e-15)
    assert {each for each, error in errors.items() if error > 1e-6} == {"mass", "centre", "inertia"}
