"""Read a scene file that names a user's robot, with what the robot's own file leaves open."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec

from robotball.drives import Rate, key
from robotball.equations import Rolling
from robotball.errors import InputError, unknown
from robotball.files.robot_file import robot_scene
from robotball.files.scene_tables import Command, Table, rate_of
from robotball.scene import Scene


class RobotTable(Table, frozen=True, kw_only=True):
    """The table of a scene file whose robot is in a file of its own."""

    robot: Annotated[
        str, key("the robot's MJCF or URDF file; a relative path is from the scene's own folder")
    ]
    title: Annotated[str | None, key("one line, for tables and plots")] = None
    rolling: Annotated[
        Rolling | None, key("`rubber` or `classical`, in place of what the contact's condim says")
    ] = None
    shell: Annotated[str | None, key("the body or geom that rolls, where several could")] = None
    keyframe: Annotated[str | None, key("where it starts, in place of the first keyframe")] = None
    duration: Annotated[
        float | None, key("of the motion; 10 if not given, or as long as the samples", "s")
    ] = None
    controls: Annotated[
        dict[str, Command] | None,
        key("`[controls]`, commands by the names of actuators, in place of the keyframe's"),
    ] = None


def scene_of_robot(path: Path, table: dict[str, Any], controls: Mapping[str, Rate]) -> Scene:
    """Return the scene of a TOML file's table; controls: in place of those that it gives.

    Raises InputError for a key that says what the robot's file says, and as `robot_scene`.
    """
    if "robot" not in table:
        raise InputError("controls are those of a robot's own file, and the scene names none")
    for each in table:
        if each not in RobotTable.__struct_fields__:
            raise unknown("key beside robot", each, RobotTable.__struct_fields__)
    given = msgspec.convert(table, RobotTable)
    own = {name: rate_of(each, path.parent) for name, each in (given.controls or {}).items()}
    scene = robot_scene(
        path.parent / given.robot, {**own, **controls}, given.shell, given.rolling, given.keyframe,
        given.duration,
    )  # fmt: skip
    return replace(scene, name=path.stem, title=given.title or scene.title)
