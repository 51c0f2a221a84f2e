"""Exports as importers read them: our files are right, and a fault is found and has its owner."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.random_robots import random_scene
from validation.studies import importers
from validation.studies.importer_readings import IMPORTERS, read
from validation.studies.importers import CHECKED, Importers, cells_of, errors_of, rows_of
from validation.sweeps import Result

PAGE = (Path(__file__).parents[3] / "docs/importers.md").read_text(encoding="utf-8")
# The latter two are a rubber and a classical robot of three hinges each, off centre.
ROBOTS = [random_scene(np.random.default_rng(seed)) for seed in (15, 17)]
SCENES = [rb.load_scene("steered_pendulum_robot"), *ROBOTS]
PACKAGES = {
    "multibody": "json", "bullet": "pybullet", "dart": "dartpy", "drake": "pydrake",
    "mujoco": "mujoco", "newton": "newton", "pinocchio": "pinocchio",
}  # fmt: skip
# What importers lose of our files, as the page has it.
LOST = {
    "MJCF, bullet": {"inertia", "gravity", "armature"},
    "MJCF, dart": {"mass", "centre", "inertia", "gravity", "armature"},
    "MJCF, drake": {"armature"},
    "MJCF, pinocchio": {"gravity"},
    "MJCF, newton": {"gravity"},
    "URDF, mujoco": {"freedoms"},
    "URDF, bullet": {"inertia"},
    "SDF, bullet": {"inertia", "gravity"},
    "SDF, drake": {"gravity"},
}
LOST["MJCF, bullet, URDF_USE_INERTIA_FROM_FILE"] = LOST["MJCF, bullet"]


def read_by(name: str, scene: rb.Scene) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The cells of one importer, and what it read; Pinocchio's wheel is built without SDF."""
    pytest.importorskip(PACKAGES[name.partition(",")[0]])
    cells = [dict(each) for each in cells_of([scene], [name.partition(",")[0]], Path())]
    return [
        (cell, read(cell))
        for cell in cells
        if cell["importer"] == name and (name, cell["format"]) != ("pinocchio", "SDF")
    ]


@pytest.mark.parametrize("scene", SCENES, ids=range(3))
@pytest.mark.parametrize("name", IMPORTERS)
def test_what_an_importer_reads_is_the_scene_but_for_what_the_page_says(
    name: str, scene: rb.Scene
) -> None:
    """Within 2e-15, by MuJoCo and by Python; single precision within 1e-6."""
    for cell, found in read_by(name, scene):
        errors = errors_of(scene, cell["format"], found)
        lost = LOST.get(f"{cell['format']}, {name}", set())
        bound = 1e-14 if name in ("mujoco", "multibody") else 1e-6
        assert [each for each in errors if each not in lost and (errors[each] or 0) > bound] == []


def test_a_fault_is_the_importers_where_another_reads_the_same_file_right() -> None:
    """Twice the shell's mass in the file is the file's; read by one of two alone, that one's."""
    scene = SCENES[0]
    ((cell, found), _) = read_by("mujoco", scene)
    mass = scene.ball.shell.mass
    wrong = read({**cell, "text": cell["text"].replace(f'mass="{mass!r}"', f'mass="{2 * mass!r}"')})
    assert wrong["mass"] == pytest.approx(scene.ball.mass + mass, rel=1e-15)
    other = {**cell, "importer": "other"}
    for second, owner in ((found, "importer"), (wrong, "file or all")):
        rows = rows_of([scene], [Result(cell, wrong, None), Result(other, second, None)])
        assert rows[0]["fault"] == f"{owner}: mass, centre, inertia"
    (row,) = rows_of([scene], [Result(cell, found, None), Result(cell, None, "it broke")])
    assert (row["fault"], row["mass"]) == ("it broke", 0.0)
    (row,) = rows_of([scene], [Result(cell, None, "it broke")])
    assert (row["fault"], "mass" in row) == ("it broke", False)


def test_the_page_has_the_rows_of_the_command() -> None:
    """Those of MuJoCo and Python, over its own scenes: to two digits, or both are rounding."""
    scenes = [rb.load_scene(name) for name in Importers().scenes]
    cells = [dict(cell) for cell in cells_of(scenes, ("mujoco", "multibody"), Path())]
    for row in rows_of(scenes, [Result(cell, read(cell), None) for cell in cells]):
        (numbers,) = re.findall(rf"^\| {row['title']} ((?:\| \S+ ){{7}})\|", PAGE, re.M)
        for name, theirs in zip(CHECKED, numbers.replace("|", "").split(), strict=True):
            ours = f"{row[name]:.1e}" if name in row else "-"
            assert ours == theirs or max(float(ours), float(theirs)) < 1e-14, row["title"]


def test_an_importer_that_is_nowhere_is_refused(robotball: Robotball) -> None:
    """Where it is named; in one line."""
    status, _, err = robotball("importers", "--only", "mujoco,newton")
    assert status == 2
    assert err.endswith("Newton is not installed: robotball engines --install newton\n")


@pytest.mark.slow
def test_the_command_prints_each_row(robotball: Robotball, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its quick form, of MuJoCo alone."""
    monkeypatch.setattr(importers, "read", read)  # without a process of its own for each
    status, out, _ = robotball("importers", "--only", "mujoco", "--quick", "--workers", "1")
    assert status == 0
    assert re.search(
        r"JSON, Python .*\n *MJCF, MuJoCo .*\n *URDF, MuJoCo .*file or all: freedoms", out
    )
