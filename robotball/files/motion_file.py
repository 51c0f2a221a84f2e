"""A motion's arrays as named columns, and the header that says whose they are."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from robotball.errors import InputError
from robotball.files.scene_writer import scene_toml
from robotball.files.table_file import Table, write_table
from robotball.rotations import Array
from robotball.scene import Scene

FORMAT = "robotball motion 1"
Place = tuple[str, ...]


def layout(scene: Scene) -> Iterator[tuple[Place, tuple[str, ...], str]]:
    """Where each array of a motion stands, the names of its columns, and their unit."""
    hinges = [hinge.name for hinge in scene.hinges]
    yield ("times",), ("t",), "s"
    yield ("contact_point",), ("x", "y"), "m"
    yield ("attitude",), ("qw", "qx", "qy", "qz"), "1"
    yield ("angular_velocity",), ("wx", "wy", "wz"), "rad/s"
    yield ("momentum",), ("Mx", "My", "Mz"), "kg m²/s"
    yield ("hinge_angles",), tuple(f"{name}_angle" for name in hinges), "rad"
    yield ("hinge_rates",), tuple(f"{name}_rate" for name in hinges), "rad/s"
    yield ("loads", "contact_force"), ("force_x", "force_y", "force_z"), "N"
    yield ("loads", "spin_torque"), ("spin_torque",), "N m"
    yield ("loads", "motor_torques"), tuple(f"{name}_torque" for name in hinges), "N m"


def write_motion(
    path: Path,
    scene: Scene,
    engine: Mapping[str, str],
    arrays: Mapping[Place, Array],
    timestep: float | None = None,
) -> None:
    """A motion of a scene, by the places of its arrays, with the label of its engine.

    timestep: of a contact engine [s]. Raises InputError where the file cannot be written.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for place, names, unit in layout(scene):
        array = arrays[place]
        columns.update(zip(names, array.reshape(len(array), -1).T, strict=True))
        units.update(dict.fromkeys(names, unit))
    header = {"format": FORMAT, "engine": json.dumps(dict(engine), ensure_ascii=False)}
    if timestep is not None:
        header["timestep"] = repr(float(timestep))
    header["scene"] = scene.name
    try:
        header["scene_toml"] = scene_toml(scene)
    except InputError as error:
        header["scene_toml_missing"] = str(error)
    write_table(path, Table(columns, units, header))


def arrays_of(table: Table, scene: Scene) -> dict[Place, Array]:
    """A motion's arrays by their places; raises InputError where columns of the scene are missing.

    The shapes are those that a motion of the scene has.
    """
    arrays: dict[Place, Array] = {}
    for place, names, _ in layout(scene):
        missing = [name for name in names if name not in table.columns]
        if missing:
            raise InputError(f"{', '.join(missing)} are missing: it is no motion of {scene.name}")
        columns = [table.columns[name] for name in names]
        single = place in (("times",), ("loads", "spin_torque"))
        arrays[place] = columns[0] if single else np.stack(columns, axis=1)
    return arrays
