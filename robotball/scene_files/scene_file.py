"""Read scenes from TOML: the catalog in scenes/ and users' files.

msgspec decodes a file into the records of `scene_tables`, which check the keys. This module makes a
Scene of the records: bodies and hinges, then the start. `scene_keys` explains errors, and is loaded
only if there is an error.
"""

import itertools
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from inspect import cleandoc
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from robotball.errors import InputError, check_size, named, unknown, warn
from robotball.files import MODEL_FILES, as_path, contents, readable
from robotball.files import scene_tables as tables
from robotball.files.scene_tables import DRIVES, numbers_in, rate_of
from robotball.robot import scene as starts
from robotball.robot.ball import (
    SYMMETRIC,
    Ball,
    Frame,
    Hinge,
    Pendulum,
    Rotor,
    Shell,
    Solid,
    axial_tensor,
    beyond_the_shell,
    composed,
    shell_inertia,
    wall_volume,
)
from robotball.robot.drives import Rate
from robotball.robot.scene import Friction, Scene, Start, unit
from robotball.rotations import Array, Z, direction, rotation_matrix, z_along

CATALOG = Path(__file__).parent.parent / "scenes"
_HungTable = tables.FrameTable | tables.RotorTable | tables.PendulumTable
_THIN = 1e-9  # times m a²: added to the moments of a body whose mass lies on a line
_SIGNS = [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]
_START_FORMS = (
    "(1) section; (2) gamma and momentum; (3) attitude, or gamma and alpha, with one of momentum, "
    "momentum_world, angular_velocity and rest (rest means M = 0; a ball that does not move has "
    "angular_velocity = [0, 0, 0])"
)
_MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def catalog() -> list[str]:
    """List the names of the scenes that come with robotball.

    Returns
    -------
    list of str
        The names, sorted, for `load_scene`.

    Examples
    --------
    >>> import robotball as rb
    >>> "fig12" in rb.catalog()
    True
    """
    return sorted(path.stem for path in CATALOG.glob("*.toml"))


def heads() -> dict[str, dict[str, Any]]:
    """Return the decoded TOML of every catalog scene by name."""
    return {n: msgspec.toml.decode(contents(CATALOG / f"{n}.toml")) for n in catalog()}


def load_scene(name: str | Path, controls: Mapping[str, Rate] | None = None) -> Scene:
    """Load a scene from the catalog or a file.

    Parameters
    ----------
    name : str or Path
        A catalog name, or the path of a TOML, MJCF or URDF file.
    controls : mapping of str to rate, optional
        Controls for the actuators of a model file, by actuator name. They replace the controls in
        the file. A control is a number, a drive or a function of time.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If there is no such scene or file, or if the file is invalid. The message names the file
        and the invalid key.

    Warns
    -----
    SceneWarning
        If a body needs mass outside the shell, so that it cannot be built, or if a number seems to
        be in another unit.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> scene.rolling, scene.ball.radius
    ('rubber', 1.0)
    """
    # Catalog names have priority: to load a file of such a name, give its suffix or folder.
    path = as_path("a scene", name)
    if str(name) in catalog():
        path = CATALOG / f"{name}.toml"
    if path.suffix in MODEL_FILES:
        from robotball.user_model.robot_scene import scene_of_robot

        scene = scene_of_robot(path, {"robot": path.name}, controls or {})
    elif path.suffix == ".toml":
        scene = read_scene(path, contents(path), controls)
    else:
        with suppress(OSError):  # raised for a name that no file can have
            if path.exists():
                from robotball.user_model.sandbox import check_format

                check_format(path)
        raise unknown("scene", name, catalog())
    for message in beyond_the_shell(scene.ball):
        warn(f"{scene.name}: {message}")
    if path.parent != CATALOG:
        from robotball.scene_files.scene_keys import ask

        ask(path, scene)
    return scene


def scene_schema() -> dict[str, Any]:
    """Return the JSON schema with which editors complete and check scene files.

    The schema describes scenes that give bodies, or A, Omega and K. It does not describe scene
    files that name an MJCF or URDF file of a whole robot.

    Returns
    -------
    dict
        The schema. docs/scene.schema.json holds it.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.scene_schema()["$ref"]
    '#/$defs/SceneTable'
    """
    draft = "https://json-schema.org/draft/2020-12/schema"
    schema = msgspec.json.schema(tables.SceneTable)
    for record in schema["$defs"].values():
        # The descriptions are docstrings, which Python indents differently before 3.13.
        record["description"] = cleandoc(record.get("description", ""))
    return {"$schema": draft, **_plain_lists(schema)}


def _plain_lists(schema: Any) -> Any:
    """Return the schema with `items` in place of `prefixItems`, because all items are alike here.

    TOML editors support only draft 7. In draft 7, the `items: false` that accompanies `prefixItems`
    would refuse every list.
    """
    if isinstance(schema, list):
        return [*map(_plain_lists, schema)]
    if not isinstance(schema, dict):
        return schema
    first = {"items": schema["prefixItems"][0]} if "prefixItems" in schema else {}
    kept = {name: value for name, value in schema.items() if name != "prefixItems"}
    return {name: _plain_lists(value) for name, value in (kept | first).items()}


def read_scene(path: Path, text: bytes | str, controls: Mapping[str, Rate] | None = None) -> Scene:
    """Return the scene of a TOML file's text. Raises InputError. path: of the file."""
    # Errors are raised for invalid UTF-8, huge integers, or too many nested brackets.
    with readable(f"{path}: not TOML"):
        keys = msgspec.toml.decode(text)
    return read_keys(path, keys, controls)


def read_keys(
    path: Path, keys: Mapping[str, Any], controls: Mapping[str, Rate] | None = None
) -> Scene:
    """Return the scene of a decoded file. Raises InputError. path: of the file."""
    try:
        if "robot" in keys or controls:
            from robotball.user_model.robot_scene import scene_of_robot

            return scene_of_robot(path, keys, controls or {})
        return _scene(path, keys)
    except (msgspec.ValidationError, InputError) as error:
        from robotball.scene_files.scene_keys import counted, explained

        message = str(error) if isinstance(error, InputError) else explained(str(error), keys)
        raise InputError(f"{path}: {counted(message)}") from None


def _scene(path: Path, keys: Mapping[str, Any]) -> Scene:
    table = msgspec.convert(keys, tables.SceneTable)
    # Check for nan and inf, which are valid numbers in TOML.
    for key, value in numbers_in(msgspec.to_builtins(table)):
        check_size(key, value)
    ball = _ball(table, path.parent)
    down = direction("gravity_direction", np.array(table.gravity_direction))
    with named("plane.motion"):
        X, Y, Z = (rate_of(command, path.parent) for command in table.plane.motion)
    with named("plane.rotation"):
        rotation = rate_of(table.plane.rotation, path.parent)
    scene = Scene(
        name=path.stem.encode(errors="replace").decode(),  # undecodable bytes become ?
        ball=ball,
        start=_start(table.start, ball),
        **{name: getattr(table, name) for name in tables.SAME},
        gravity_direction=tuple(down.tolist()),
        friction=Friction(*msgspec.structs.astuple(table.friction)),
        plane_motion=(X, Y, Z),
        plane_rotation=rotation,
    )
    omega = table.start.angular_velocity
    return scene if omega is None else _turning(scene, np.array(omega))


def _ball(table: tables.SceneTable, folder: Path) -> Ball:
    """Return the ball with a scene's bodies, or a ball designed for the scene's numbers."""
    if (numbers := table.numbers) is not None:
        if table.shell or table.frame or table.rotor or table.pendulum:
            raise InputError("a scene needs bodies or [numbers], not both")
        from robotball.design.designing import design  # few scenes have no bodies

        A = _tensor("numbers.A must be a diagonal of three, or three rows of three", numbers.A)
        return design(A, numbers.Omega, numbers.K, numbers.radius, numbers.mass).ball
    if table.shell is None or table.frame is None:
        missing = "frame" if table.shell else "shell"
        raise InputError(f"key {missing!r} is missing; a scene needs shell and frame, or numbers")
    bodies: list[tuple[str, _HungTable]] = [("frame", table.frame)]
    bodies += [(f"rotor{i}", rotor) for i, rotor in enumerate(table.rotor, start=1)]
    bodies += [(f"pendulum{i}", pendulum) for i, pendulum in enumerate(table.pendulum, start=1)]
    shell = _shell(table.shell, _file_solids(table.shell, folder))
    return Ball(shell, tuple(_hinge(name, body, shell.radius, folder) for name, body in bodies))


def _shell(table: tables.ShellTable, solids: list[Solid]) -> Shell:
    """Return the shell; solids: from its model file, if it has one."""
    radius, axis = table.outer, direction("shell.axis", np.array(table.axis))
    solids = solids or _part_solids("shell", table.part, axis)
    # Parts or a file alone may make a shell.
    if not solids or table.wall_keys:
        shell = Shell(radius, *table.wall(), axis, table.offset)
        if not solids:  # take the moments as given; those of a tensor would be rounded
            return shell
        solids.append(Solid(shell.mass, shell.centre, shell.inertia))
    solid = composed(solids)
    solid.check_within("shell", radius)
    offset = float(solid.centre @ axis)
    off = float(np.linalg.norm(solid.centre - offset * axis))
    if off > SYMMETRIC * radius:
        line = f"shell's centre of mass is {off:.6g} m off its axis"
        raise InputError(f"{line}; move parts that are not symmetric about the axis to the frame")
    moments = solid.moments_about("shell", axis, "part of the frame")
    return Shell(radius, solid.mass, *moments, axis, offset, shapes=solid.shapes)


def _hinge(name: str, table: _HungTable, radius: float, folder: Path) -> Hinge:
    """Return the hinge of a body in a shell of this radius [m]."""
    body = _body(name, table, radius, _file_solids(table, folder))
    drive = DRIVES[table.drive]
    command = getattr(table, drive.command) if drive.command else None
    with named(name):
        # A missing command means 0, so a hinge without keys does not turn.
        rate = rate_of(0.0 if command is None else command, folder)
        motor = _motor(drive.motor, drive.keys, table) if drive.motor else None
    return Hinge(body, rate, motor, table.initial_angle, table.initial_rate)


def _motor(name: str, keys: tuple[str, ...], table: tables.HingeTable) -> Any:
    """Return a motor of a class in `motors`, with the default values of the class."""
    from robotball.robot import motors

    motor = getattr(motors, name)
    pairs = zip(fields(motor), keys, strict=True)
    values = {field.name: getattr(table, key) for field, key in pairs}
    return motor(**{name: value for name, value in values.items() if value is not None})


def _body(
    name: str, table: _HungTable, radius: float, solids: list[Solid]
) -> Frame | Rotor | Pendulum:
    """Return a body in a shell of this radius [m]; solids: from its model file, if it has one."""
    if isinstance(table, tables.FrameTable):
        solid = _solid(name, table, Z, radius, solids)
        return Frame(solid.mass, solid.inertia, solid.centre, shapes=solid.shapes)
    axis = direction(f"{name}'s axis", np.array(table.axis))
    if isinstance(table, tables.PendulumTable):
        solid, pivot = _solid(name, table, Z, radius, solids), np.array(table.pivot)
        return Pendulum(solid.mass, solid.inertia, solid.centre, axis, pivot, shapes=solid.shapes)
    solid = _solid(name, table, axis, radius, solids)
    if (given := table.inertia) is not None:  # as given; moments of a tensor would be rounded
        moments = given.axial, given.transverse
    else:
        moments = solid.moments_about(name, axis, "pendulum")
    return Rotor(solid.mass, *moments, axis, solid.centre, shapes=solid.shapes)


def _solid(name: str, table: _HungTable, axis: Array, radius: float, solids: list[Solid]) -> Solid:
    """Return the solid of a body; axis: the axis of a rotor, and the default axis of parts."""
    if table.mass is not None:
        if isinstance(table.inertia, tables.Axial):
            tensor = axial_tensor(table.inertia.axial, table.inertia.transverse, axis)
        else:
            expected = f"{name}.inertia must be three moments, or three rows of three"
            tensor = _tensor(expected, table.inertia or [])
        return Solid(table.mass, np.array(table.centre or (0.0, 0.0, 0.0)), tensor)
    solid = composed(solids or _part_solids(name, table.part, axis))
    least, largest = np.linalg.eigvalsh(solid.inertia)[0], np.abs(solid.inertia).max()
    if table.part and not least > SYMMETRIC * largest:
        if isinstance(table, tables.RotorTable):
            raise InputError(f"{name}'s parts lie on its axis, so {name} has no axial moment")
        # A point or a thin rod has moments of 0. MuJoCo needs positive moments, and with these RK4
        # still has order 4.
        solid = replace(solid, inertia=solid.inertia + _THIN * solid.mass * radius**2 * np.eye(3))
    solid.check_within(name, radius)
    return solid


def _part_solids(name: str, parts: list[tables.Part] | None, axis: Array) -> list[Solid]:
    """Return the solids of a body's parts; axis: the default axis of a part."""
    if not parts:
        return []
    solids = []
    for number, part in enumerate(parts, start=1):
        with named(f"{name}.part{number}"):
            solids.append(solid_of(part, axis))
    return solids


def solid_of(part: tables.Part, axis: Array = Z) -> Solid:
    """Return the mass, centre, inertia and reach of a part.

    axis: direction (3,) of a part without an axis. Raises InputError for impossible sizes or
    masses.
    """
    from robotball.robot.shapes import Shape  # most scenes have no parts

    match part:
        case tables.Point():
            # The inertia of a point comes from its position, when parts are composed.
            centre = np.array(part.centre)
            dot = Shape("sphere", np.zeros(3), centre)
            return Solid(part.mass, centre, np.zeros((3, 3)), math.hypot(*part.centre), (dot,))
        case tables.Sphere():
            a, centre = part.outer, np.array(part.centre)
            wall = a if part.thickness is None else part.thickness
            moment = shell_inertia(a, 1.0, wall)  # for unit mass; also checks the wall
            mass = part.mass_in(wall_volume(a, wall))
            ball = Shape("sphere", np.array([a, 0.0, 0.0]), centre)
            reach = math.hypot(*part.centre) + a
            return Solid(mass, centre, mass * moment * np.eye(3), reach, (ball,))
        case tables.Box():
            (x, y, z), centre = part.size, np.array(part.centre)
            mass = part.mass_in(x * y * z)
            moments = mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
            R = rotation_matrix(unit("attitude", np.array(part.attitude)))
            corners = [centre + R @ (signs * part.size) / 2 for signs in _SIGNS]
            reach = max(float(np.linalg.norm(corner)) for corner in corners)
            box = Shape("box", np.array(part.size) / 2, centre, np.array(part.attitude))
            return Solid(mass, centre, R @ np.diag(moments) @ R.T, reach, (box,))
        case tables.Rod():
            begin, end, a = np.array(part.begin), np.array(part.end), part.outer
            axis, length = direction("rod", end - begin), float(np.linalg.norm(end - begin))
            mass = part.mass_in(math.pi * a**2 * length)
            return _tube(mass, a, 0.0, length, (begin + end) / 2, axis)
        case tables.Ring():
            mass, a, b, h = part.mass, part.radius, part.radius, 0.0
        case tables.Cylinder() | tables.Disc():
            a, b = part.outer, part.inner_radius
            h = part.length if isinstance(part, tables.Cylinder) else part.thickness
            # Use (a - b)(a + b), because a² - b² would lose digits for a thin wall.
            mass = part.mass_in(math.pi * (a - b) * (a + b) * h)
    if part.axis is not None:
        axis = direction("axis", np.array(part.axis))
    return _tube(mass, a, b, h, np.array(part.centre), axis)


def _tube(mass: float, a: float, b: float, h: float, centre: Array, axis: Array) -> Solid:
    """Return a tube with outer radius a, inner radius b and length h about a unit vector (3,)."""
    from robotball.robot.shapes import Shape, tube

    # The transverse moment m(a² + b²)/4 + m h²/12 also holds for discs (h = 0) and hoops (a = b).
    across = mass * (a * a + b * b) / 4
    reach = max(_reach_of_circle(centre + end * axis, axis, a) for end in (-h / 2, h / 2))
    shape = tube(a, b, h) if b else Shape("cylinder", np.array([a, h / 2, 0.0]))
    inertia = axial_tensor(2 * across, across + mass * h * h / 12, axis)
    return Solid(mass, centre, inertia, reach, (shape.moved(z_along(axis), centre),))


def _reach_of_circle(centre: Array, axis: Array, radius: float) -> float:
    """Return the largest distance from the origin to a circle about `axis`."""
    along = float(centre @ axis)
    return math.hypot(along, float(np.linalg.norm(centre - along * axis)) + radius)


def _file_solids(table: tables.ShellTable | _HungTable, folder: Path) -> list[Solid]:
    """Return the solid of a body's model file in a list, or an empty list without a file."""
    if not (file := table.mjcf or table.urdf):
        return []
    # Import late, because few scenes have such a body, and its reader starts a process.
    from robotball.user_model.robot_file import solid_of_file

    name = ("link", file.link) if isinstance(file, tables.UrdfTable) else ("body", file.body)
    solid = solid_of_file(folder / file.file, *name)
    R = rotation_matrix(unit("attitude", np.array(file.attitude)))
    return [Solid(solid.mass, np.array(file.origin) + R @ solid.centre, R @ solid.inertia @ R.T)]


def _tensor(expected: str, rows: tables.Rows) -> Array:
    """Return a tensor (3, 3) from its diagonal or its rows; expected: the error message."""
    kinds = {isinstance(row, tuple) for row in rows}
    if len(rows) != 3 or len(kinds) != 1:
        raise InputError(expected)
    return np.array(rows) if kinds == {True} else np.diag(np.array(rows, dtype=float))


def _start(table: tables.StartTable, ball: Ball) -> Start:
    """Return the start of a table, which may slip."""
    return replace(_rolling_start(table, ball), slip=np.array([*table.slip, table.spin]))


def _rolling_start(table: tables.StartTable, ball: Ball) -> Start:
    """Return the start without slip. If an angular velocity is given, M is 0, see `_turning`."""
    # `rest = false` means the same as no key `rest`.
    keys_of_rolling = set(table.__struct_fields__) - {"slip", "spin"}
    given = {key for key in keys_of_rolling if getattr(table, key)}
    axes = ball.principal[1]  # the section (5.5) is in principal axes
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        return starts.along_momentum(axes @ gamma, axes @ M)
    if given == {"gamma", "momentum"}:
        gamma = unit("gamma", np.array(table.gamma))
        return starts.along_momentum(gamma, np.array(table.momentum))
    attitudes = ({"attitude"}, {"gamma", "alpha"})
    if given - _MOMENTUM_KEYS in attitudes and len(given & _MOMENTUM_KEYS) == 1:
        if table.attitude:
            attitude = unit("attitude", np.array(table.attitude))
        else:
            gamma = unit("gamma", np.array(table.gamma))
            alpha = unit("alpha", np.array(table.alpha))
            attitude = starts.attitude_of_axes(gamma, alpha)
        if table.momentum:
            return Start(attitude, rotation_matrix(attitude) @ np.array(table.momentum))
        return Start(attitude, np.array(table.momentum_world or (0.0, 0.0, 0.0)))
    keys = ", ".join(sorted(given)) or "nothing"
    raise InputError(f"start gives {keys}; choose one form: {_START_FORMS}")


def _turning(scene: Scene, omega: Array) -> Scene:
    """Return the scene with ω (3,) of the frame at its start, frame axes [rad/s].

    Raises InputError if the shell of a rubber ball would spin.
    """
    if scene.rolling == "rubber":
        gamma = scene.start.to_world[2]
        starts.check_no_spin(omega - scene.hinges[0].rate * scene.ball.shell.axis, gamma)
    # M follows from ω and the hinge rates, which are known only in the scene.
    return replace(scene, start=replace(scene.start, momentum=scene.momentum_of(omega)))
