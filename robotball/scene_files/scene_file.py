"""Read scenes from TOML: the catalog in scenes/, and files of the user's own.

msgspec decodes a file into the records of `scene_tables`. Here they become a Scene: bodies with
their masses and inertias, hinges with commands and motors, a start. `scene_keys` puts errors into
the author's words, and is loaded when there is one. In order: the catalog, the whole scene, hinges,
starts, bodies.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from robotball.errors import InputError, check_positive, check_size, named, unknown, warn
from robotball.files import MODEL_FILES, as_path, contents, readable
from robotball.files import scene_tables as tables
from robotball.files.scene_tables import DRIVES, numbers_in, rate_of
from robotball.robot import scene as starts
from robotball.robot.ball import (
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
)
from robotball.robot.drives import Rate
from robotball.robot.scene import Friction, Scene, Start
from robotball.rotations import Array, Z, direction, rotation_matrix

CATALOG = Path(__file__).parent.parent / "scenes"
_Body = tables.FrameTable | tables.RotorTable | tables.PendulumTable
# Relative: as far as a composed body may miss its symmetry by the rounding of its parts' sums.
_SYMMETRIC = 1e-9
_THIN = 1e-9  # of m a²: moments of a body whose matter lies on a line


def catalog() -> list[str]:
    """List the names of the scenes that come with robotball.

    Returns
    -------
    list of str
        The names, sorted. `load_scene` takes each.

    Examples
    --------
    >>> import robotball as rb
    >>> "fig12" in rb.catalog()
    True
    """
    return sorted(path.stem for path in CATALOG.glob("*.toml"))


def heads() -> dict[str, dict[str, Any]]:
    """Return the tables of all these scenes by their names. Their balls are not made."""
    return {n: msgspec.toml.decode(contents(CATALOG / f"{n}.toml")) for n in catalog()}


def load_scene(name: str | Path, controls: Mapping[str, Rate] | None = None) -> Scene:
    """Load a scene of the catalog, or from a file.

    Parameters
    ----------
    name : str or Path
        A name of the catalog, or the path of a TOML, MJCF or URDF file.
    controls : mapping of str to rate, optional
        Rates for the actuators of a robot's own file, by their names, in place of the file's. A
        rate is a number, a drive or a function of time.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If there is no such scene or file, or if the file cannot be used. The message names the file
        and the key.

    Warns
    -----
    SceneWarning
        If no workshop could build a body, or if a number seems to have another unit.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> scene.rolling, scene.ball.radius
    ('rubber', 1.0)
    """
    # A catalog name first: a file of that name has a suffix, or a folder before it.
    path = as_path("a scene", name)
    if str(name) in catalog():
        path = CATALOG / f"{name}.toml"
    if path.suffix in MODEL_FILES:
        from robotball.user_model.robot_scene import scene_of_robot

        scene = scene_of_robot(path, {"robot": path.name}, controls or {})
    elif path.suffix == ".toml":
        scene = read_scene(path, contents(path), controls)
    else:
        with suppress(OSError):  # of a name that no file can have
            if path.exists():
                from robotball.user_model.sandbox import check_format

                check_format(path)
        raise unknown("scene", name, catalog())
    for line in beyond_the_shell(scene.ball):
        warn(f"{scene.name}: {line}")
    if path.parent != CATALOG:
        from robotball.scene_files.scene_keys import ask

        ask(path, scene)
    return scene


def read_scene(path: Path, text: bytes | str, controls: Mapping[str, Rate] | None = None) -> Scene:
    """Return the scene of a TOML file's text; the path names it. Raises InputError."""
    # Bytes that are no text, an integer of thousands of digits, as many brackets.
    with readable(f"{path}: not TOML"):
        given = msgspec.toml.decode(text)
    try:
        if "robot" in given or controls:
            from robotball.user_model.robot_scene import scene_of_robot

            return scene_of_robot(path, given, controls or {})
        table = msgspec.convert(given, tables.SceneTable)
        # TOML has `nan` and `inf`, and no check of a range refuses NaN.
        for key, value in numbers_in(msgspec.to_builtins(table)):
            check_size(key, value)
        return scene_of_table(path, table)
    except (msgspec.ValidationError, InputError) as error:
        from robotball.scene_files.scene_keys import counted, explained

        line = str(error) if isinstance(error, InputError) else explained(str(error))
        raise InputError(f"{path}: {counted(line)}") from None


def scene_of_table(path: Path, table: tables.SceneTable) -> Scene:
    """Return the scene of a file's table; the path names it. Raises InputError."""
    ball = _robot(table, path.parent)
    down = direction("gravity_direction", np.array(table.gravity_direction))
    with named("plane.motion"):
        X, Y, Z = (rate_of(each, path.parent) for each in table.plane.motion)
    scene = Scene(
        name=path.stem.encode(errors="replace").decode(),  # bytes that are no text are shown as ?
        title=table.title,
        source=table.source,
        ball=ball,
        rolling=table.rolling,
        start=_start(table.start, ball),
        duration=table.duration,
        gravity=table.gravity,
        gravity_direction=tuple(down.tolist()),
        friction=Friction(*msgspec.structs.astuple(table.friction)),
        plane_motion=(X, Y, Z),
    )
    turning = table.start.angular_velocity
    return scene if turning is None else _turning(scene, turning)


def _robot(table: tables.SceneTable, folder: Path) -> Ball:
    """Return the ball as given, or designed for given numbers."""
    if table.numbers is not None:
        if table.shell or table.frame or table.rotor or table.pendulum:
            raise InputError("a scene takes bodies or numbers, not both")
        from robotball.design.designing import design  # few scenes have no bodies of their own

        given = table.numbers
        A = _tensor("numbers.A takes a diagonal of three, or three rows of three", given.A)
        return design(A, given.Omega, given.K, given.radius, given.mass).ball
    if table.shell is None or table.frame is None:
        missing = "frame" if table.shell else "shell"
        raise InputError(f"key {missing!r} is missing; a scene takes shell and frame, or numbers")
    shell = _shell(table.shell, folder)
    bodies: list[tuple[str, _Body]] = [("frame", table.frame)]
    bodies += [(f"rotor{i}", each) for i, each in enumerate(table.rotor, start=1)]
    bodies += [(f"pendulum{i}", each) for i, each in enumerate(table.pendulum, start=1)]
    return Ball(shell, tuple(_hinge(name, each, shell.radius, folder) for name, each in bodies))


def _tensor(what: str, rows: tables.Rows) -> Array:
    """Return a tensor (3, 3) of its diagonal or its rows. Raises InputError, with `what`."""
    kinds = {isinstance(row, tuple) for row in rows}
    if len(rows) != 3 or len(kinds) != 1:
        raise InputError(what)
    return np.array(rows) if kinds == {True} else np.diag(np.array(rows, dtype=float))


def _hinge(name: str, table: _Body, radius: float, folder: Path) -> Hinge:
    """Return the hinge of a body in a shell of this radius [m].

    Raises InputError for keys of its table that do not combine.
    """
    body = _body(name, table, radius, folder)
    _check_keys(name, table)
    kind = DRIVES[table.drive]
    command = None if kind.command is None else getattr(table, kind.command)
    # A command that is not given is 0: a hinge without any keys stands still.
    with named(name):
        rate = rate_of(0.0 if command is None else command, folder)
        motor = None if kind.motor is None else _motor(kind.motor, kind.keys, table)
    return Hinge(body, rate, motor, table.initial_angle, table.initial_rate)


def _check_keys(name: str, table: tables.HingeTable) -> None:
    drive = table.drive
    for each in DRIVES[drive].needed:
        if getattr(table, each) is None:
            from robotball.scene_files.scene_keys import unit_at

            unit = unit_at(f"frame.{each}")  # which all hinges have
            raise InputError(f'{name}: drive = "{drive}" needs the key {each!r} [{unit}]')
    # A key of another drive would do nothing, and its author thinks that it does.
    for each in table.given(*(key for kind in DRIVES.values() for key in kind.allowed)):
        if each not in DRIVES[drive].allowed:
            owners = (f'"{owner}"' for owner, kind in DRIVES.items() if each in kind.allowed)
            listed = " or ".join(owners)
            raise InputError(f'{name}: {each} belongs to drive = {listed}, not to "{drive}"')


def _motor(name: str, keys: tuple[str, ...], table: tables.HingeTable) -> Any:
    """Return the motor with the keys that are given, and its own defaults for the others."""
    from robotball.robot import motors

    motor = getattr(motors, name)
    names = (field.name for field in fields(motor))
    values = {name: getattr(table, key) for name, key in zip(names, keys, strict=True)}
    return motor(**{name: value for name, value in values.items() if value is not None})


_START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest (M = 0; a ball that stands still has "
    "angular_velocity = [0, 0, 0])"
)
_MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def _start(table: tables.StartTable, ball: Ball) -> Start:
    """Return the one start that the table gives; a section's is in principal axes.

    An angular velocity leaves M at 0, which `_turning` sets when the hinges are known.
    """
    # All that are neither None nor False; `rest = false` is as without it.
    given = {key for key in table.__struct_fields__ if getattr(table, key)}
    axes = ball.principal[1]  # (5.5) is in these, and a Start in the frame's
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        return starts.along_momentum(axes @ gamma, axes @ M)
    if given == {"gamma", "momentum"}:
        gamma = starts.unit("gamma", np.array(table.gamma))
        return starts.along_momentum(gamma, np.array(table.momentum))
    if (
        given - _MOMENTUM_KEYS in ({"attitude"}, {"gamma", "alpha"})
        and len(given & _MOMENTUM_KEYS) == 1
    ):
        attitude = _attitude(table)
        if table.momentum:
            return Start(attitude, rotation_matrix(attitude) @ np.array(table.momentum))
        return Start(attitude, np.array(table.momentum_world or (0.0, 0.0, 0.0)))
    keys = ", ".join(sorted(given)) or "nothing"
    raise InputError(f"start gives {keys}; it takes one form: {_START_FORMS}")


def _turning(scene: Scene, omega: tables.Triple) -> Scene:
    """Return the scene with the frame's angular velocity (3,) at its start, frame axes [rad/s].

    Raises InputError where the shell would spin on the spot and the rolling model is rubber.
    """
    turned = np.array(omega)
    if scene.rolling == "rubber":
        gamma = scene.start.to_world[2]
        starts.check_no_spin(turned - scene.hinges[0].rate * scene.ball.shell.axis, gamma)
    # Hinges turn at the start, so that M follows from ω only when their rates are known.
    return replace(scene, start=replace(scene.start, momentum=scene.momentum_of(turned)))


def _attitude(table: tables.StartTable) -> Array:
    if table.attitude:
        return starts.unit("attitude", np.array(table.attitude))
    gamma, alpha = np.array(table.gamma), np.array(table.alpha)
    return starts.attitude_of_axes(starts.unit("gamma", gamma), starts.unit("alpha", alpha))


def _check_one_way(name: str, what: str, keys: list[str], table: tables.ShellTable | _Body) -> None:
    """Raise InputError unless a body is given by its numbers, by parts or by a file alone."""
    ways = {what: keys, **{each: table.given(each) for each in ("part", "mjcf", "urdf")}}
    if len(used := list(filter(None, ways.values()))) != 1:
        given = " and ".join(map(", ".join, used)) or "nothing"
        raise InputError(f"{name} gives {given}; it takes {', or '.join(ways)}")


def _shell(table: tables.ShellTable, folder: Path) -> Shell:
    """Return the shell. Raises InputError for no mass, or no symmetry about its axis."""
    check_positive("the shell's radius", table.outer, "m")
    radius, axis = table.outer, direction("shell.axis", np.array(table.axis))
    wall = table.given("mass", "density", "material", "thickness", "inertia")
    if file := table.mjcf or table.urdf:
        _check_one_way("shell", "mass and thickness", wall, table)
        solids = [_of_file(file, folder)]
    else:
        solids = _solids("shell", table.part or [], axis)
        # Parts alone may make a shell; without parts a wall is missing, and `_wall` says of what.
        if wall or not solids:
            mass, axial, transverse = _wall(table)
            # As given, to the last bit: a tensor and its moments again would round.
            if not solids:
                return Shell(radius, mass, axial, transverse, axis, table.offset)
            tensor = axial_tensor(axial, transverse, axis)
            solids.append(Solid(mass, table.offset * axis, tensor))
    solid = composed(solids)
    _check_inside("shell", solid, radius)
    offset = float(solid.centre @ axis)
    off = float(np.linalg.norm(solid.centre - offset * axis))
    if off > _SYMMETRIC * radius:
        raise InputError(
            f"shell's centre of mass is {off:.6g} m off its axis; what is not symmetric about "
            "the axis belongs to the frame"
        )
    moments = _symmetric("shell", solid.inertia, axis)
    return Shell(radius, solid.mass, *moments, axis, offset, shapes=solid.shapes)


def _wall(table: tables.ShellTable) -> tuple[float, float, float]:
    """Return mass [kg] and moments [kg m²] of the shell's wall, about the axis and across it."""
    given, thickness = table.inertia, table.thickness
    if isinstance(given, tables.ShellInertia) and given.thickness is not None:
        if thickness is not None or given.given("axial", "transverse"):
            raise InputError("shell.inertia takes a thickness alone")
        thickness, given = given.thickness, None
    if given is not None and thickness is not None:
        raise InputError("shell takes thickness or inertia, not both")
    if thickness is not None:
        from robotball.scene_files.parts import mass_of, volume_of_wall

        mass = mass_of("shell", table, volume_of_wall(table.outer, thickness))
        moment = shell_inertia(table.outer, mass, thickness)
        return mass, moment, moment
    if table.given("density", "material"):
        raise InputError("shell: a density needs the wall's thickness [m] as well")
    if table.mass is None:
        raise InputError("shell: key 'mass' is missing")
    if given is None:
        raise InputError("shell: key 'thickness' is missing, or 'inertia' instead of it")
    if given == "thin":
        moment = shell_inertia(table.outer, table.mass)
        return table.mass, moment, moment
    if given.axial is None or given.transverse is None:
        raise InputError('shell.inertia takes "thin", or thickness, or axial and transverse')
    return table.mass, given.axial, given.transverse


def _body(name: str, table: _Body, radius: float, folder: Path) -> Frame | Rotor | Pendulum:
    """Return the body of a table. Raises InputError for a rotor of no symmetry."""
    if isinstance(table, tables.FrameTable):
        solid = _solid(name, table, radius, folder)
        return Frame(solid.mass, solid.inertia, solid.centre, shapes=solid.shapes)
    axis = direction(f"{name}'s axis", np.array(table.axis))
    if isinstance(table, tables.PendulumTable):
        solid, pivot = _solid(name, table, radius, folder), np.array(table.pivot)
        return Pendulum(solid.mass, solid.inertia, solid.centre, axis, pivot, shapes=solid.shapes)
    solid = _solid(name, table, radius, folder, axis)
    # As given, where they are: those of the tensor would be rounded.
    if isinstance(table.inertia, tables.Axial):
        axial, transverse = table.inertia.axial, table.inertia.transverse
    else:
        axial, transverse = _symmetric(name, solid.inertia, axis)
    return Rotor(solid.mass, axial, transverse, axis, solid.centre, shapes=solid.shapes)


def _solid(name: str, table: _Body, radius: float, folder: Path, axis: Array = Z) -> Solid:
    """Return a body's mass, centre and inertia; `axis` (3,) is that of its parts."""
    numbers = table.given("mass", "inertia", "centre")
    _check_one_way(name, "mass and inertia", numbers, table)
    if file := table.mjcf or table.urdf:
        solid = _of_file(file, folder)
    elif table.part is not None:
        if not table.part:
            raise InputError(f"{name}.part is empty")
        solid = composed(_solids(name, table.part, axis))
        if not np.linalg.eigvalsh(solid.inertia)[0] > _SYMMETRIC * np.abs(solid.inertia).max():
            if isinstance(table, tables.RotorTable):
                raise InputError(f"{name}'s parts lie on its axis, and so do not resist turning")
            # A point or a thin rod: MuJoCo's bodies need moments, and its order is kept with these.
            solid = replace(
                solid, inertia=solid.inertia + _THIN * solid.mass * radius**2 * np.eye(3)
            )
    elif table.mass is None or table.inertia is None:
        missing = "mass" if table.mass is None else "inertia"
        raise InputError(f"{name}: key {missing!r} is missing")
    else:
        tensor = (
            axial_tensor(table.inertia.axial, table.inertia.transverse, axis)
            if isinstance(table.inertia, tables.Axial)
            else _tensor(
                f"{name}.inertia takes three moments, or three rows of three", table.inertia
            )
        )
        solid = Solid(table.mass, np.array(table.centre or (0.0, 0.0, 0.0)), tensor)
    _check_inside(name, solid, radius)
    return solid


def _solids(name: str, parts: list[tables.Part], axis: Array) -> list[Solid]:
    """Return a body's parts. Raises InputError, with the part's number, for one that cannot be."""
    if not parts:
        return []
    # Most bodies are given by numbers and need no shapes.
    from robotball.scene_files.parts import solid_of

    solids = []
    for number, part in enumerate(parts, start=1):
        with named(f"{name}.part{number}"):
            solids.append(solid_of(part, axis))
    return solids


def _of_file(table: tables.MjcfTable | tables.UrdfTable, folder: Path) -> Solid:
    """Return the body of a file, laid where its table says."""
    # Loaded late: few scenes have such a body, and its reader starts a process.
    from robotball.user_model.robot_file import solid_of_file

    wanted = ("link", table.link) if isinstance(table, tables.UrdfTable) else ("body", table.body)
    solid = solid_of_file(folder / table.file, *wanted)
    R = rotation_matrix(starts.unit("attitude", np.array(table.attitude)))
    return Solid(solid.mass, np.array(table.origin) + R @ solid.centre, R @ solid.inertia @ R.T)


def _symmetric(name: str, inertia: Array, axis: Array) -> tuple[float, float]:
    """Return the moments about an axis (3,) and across it [kg m²]. Raises InputError."""
    axial = float(axis @ inertia @ axis)
    transverse = float(np.trace(inertia) - axial) / 2
    off = float(np.abs(inertia - axial_tensor(axial, transverse, axis)).max())
    if off > _SYMMETRIC * float(np.abs(inertia).max()):
        other = "part of the frame" if name == "shell" else "pendulum"
        raise InputError(
            f"{name} is not symmetric about its axis: its inertia is off by {off:.6g} of "
            f"{np.abs(inertia).max():.6g} kg m²; such a body is a {other}"
        )
    # A disc's are as 2 to 1, but for the rounding of its turned axes, and a Rotor takes no more.
    if axial < 2 * transverse * (1 + _SYMMETRIC):
        axial = min(axial, 2 * transverse)
    return axial, transverse


def _check_inside(name: str, solid: Solid, radius: float) -> None:
    """Raise InputError where parts of known size reach beyond the shell."""
    if solid.reach > radius * (1 + _SYMMETRIC):
        raise InputError(
            f"{name} reaches {solid.reach:.6g} m from the sphere's centre, beyond the shell's "
            f"radius {radius:g} m; make it smaller, move it, or make the shell larger"
        )
