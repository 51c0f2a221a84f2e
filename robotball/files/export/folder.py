"""A folder with all that another simulator needs of a scene."""

import contextlib
import json
from importlib.resources import files
from pathlib import Path

import numpy as np

from robotball.engines.integrate import integrate
from robotball.errors import InputError
from robotball.files.export.mjcf_text import mjcf
from robotball.files.export.plain import plain
from robotball.files.export.robot_text import sdf, urdf
from robotball.files.replacing import replacing
from robotball.files.scene_writer import scene_toml
from robotball.files.table_file import Table, write_table
from robotball.motion import Motion
from robotball.rotations import Array
from robotball.scene import Scene

README = "README.md"


def export_scene(scene: Scene, folder: Path | str, times: Array | None = None) -> list[Path]:
    """Write a scene for other simulators into a folder; returns the files.

    scene.json, scene.toml where the scene has one, drives.csv and reference.csv at the sample
    times (n,) [s], the scene's own if None, model.xml (MJCF), model.urdf, model.sdf, README.md.
    Raises InputError for a scene that the equations cannot integrate, and where nothing can be
    written.
    """
    folder = Path(folder)
    motion = integrate(scene, times)
    conventions = files("robotball.files.export").joinpath("conventions.md")
    texts = {
        "scene.json": json.dumps(plain(motion), indent=1, ensure_ascii=False, allow_nan=False),
        "model.xml": mjcf(motion),
        "model.urdf": urdf(scene),
        "model.sdf": sdf(motion),
        README: conventions.read_text(encoding="utf-8").replace("SCENE", scene.name),
    }
    with contextlib.suppress(InputError):  # of a rate by a function: drives.csv has it
        texts["scene.toml"] = scene_toml(scene)
    for name, text in texts.items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    write_table(folder / "drives.csv", _drives(motion))
    motion.save(folder / "reference.csv")
    return sorted(folder / name for name in (*texts, "drives.csv", "reference.csv"))


def _drives(motion: Motion) -> Table:
    """What each hinge is told: its command, and the command's slope and integral from 0."""
    times = motion.times
    columns: dict[str, Array] = {"t": times}
    for hinge in motion.scene.hinges:
        command = hinge.command
        columns[f"{hinge.name}_command"] = np.asarray(command.rate(times), dtype=float)
        columns[f"{hinge.name}_slope"] = np.asarray(command.acceleration(times), dtype=float)
        columns[f"{hinge.name}_integral"] = np.asarray(command.angle(times), dtype=float)
    return Table(columns, {"t": "s"}, {"scene": motion.scene.name})
