"""Bodies from the tables of a scene's TOML."""

from pathlib import Path

import numpy as np

from robotball.errors import InputError, check_positive
from robotball.files.parts import Part, Z, direction, mass_of, volume_of_wall
from robotball.files.scene_tables import (
    Axial,
    FrameTable,
    MjcfTable,
    PendulumTable,
    RotorTable,
    Rows,
    ShellInertia,
    ShellTable,
    UrdfTable,
    one_of,
)
from robotball.robot import (
    Frame,
    Pendulum,
    Rotor,
    Shell,
    Solid,
    axial_tensor,
    composed,
    thick_shell_inertia,
    thin_shell_inertia,
)
from robotball.rotations import Array, rotation_matrix
from robotball.scene import unit

SYMMETRIC = 1e-9  # relative: as far a composed body may miss its symmetry by rounding


def read_shell(table: ShellTable, folder: Path) -> Shell:
    """The shell; raises InputError where it has no mass, or is not symmetric about its axis."""
    check_positive("the shell's radius", table.radius, "m")
    radius, axis = table.radius, direction("shell.axis", np.array(table.axis))
    wall = table.given("mass", "density", "thickness", "inertia")
    if file := table.mjcf or table.urdf:
        ways = {each: table.given(each) for each in ("part", "mjcf", "urdf")}
        one_of("shell", {"mass and thickness": wall, **ways})
        solids = [_of_file(file, folder)]
    else:
        solids = _solids("shell", table.part or [], axis)
        if wall or not solids:
            mass, axial, transverse = _wall(table)
            if not solids:
                return Shell(radius, mass, axial, transverse, axis, table.offset)
            tensor = axial_tensor(axial, transverse, axis)
            solids.append(Solid(mass, table.offset * axis, tensor))
    solid = composed(solids)
    _check_inside("shell", solid, radius)
    offset = float(solid.centre @ axis)
    off = float(np.linalg.norm(solid.centre - offset * axis))
    if off > SYMMETRIC * radius:
        raise InputError(
            f"shell's centre of mass is {off:.6g} m off its axis; what is not symmetric about "
            "the axis belongs to the frame"
        )
    return Shell(radius, solid.mass, *_symmetric("shell", solid.inertia, axis), axis, offset)


def _wall(table: ShellTable) -> tuple[float, float, float]:
    """Mass [kg] and moments of the shell's wall, about the axis and across it [kg m²]."""
    given, thickness = table.inertia, table.thickness
    if isinstance(given, ShellInertia) and given.thickness is not None:
        if thickness is not None or given.given("axial", "transverse"):
            raise InputError("shell.inertia takes a thickness alone")
        thickness, given = given.thickness, None
    if given is not None and thickness is not None:
        raise InputError("shell takes thickness or inertia, not both")
    if thickness is not None:
        mass = mass_of("shell", table.mass, table.density, volume_of_wall(table.radius, thickness))
        moment = thick_shell_inertia(table.radius, mass, thickness)
        return mass, moment, moment
    if table.density is not None:
        raise InputError("shell: a density needs the wall's thickness [m] as well")
    if table.mass is None:
        raise InputError("shell: key 'mass' is missing")
    if given is None:
        raise InputError("shell: key 'thickness' is missing, or 'inertia' instead of it")
    if given == "thin":
        moment = thin_shell_inertia(table.radius, table.mass)
        return table.mass, moment, moment
    if given.axial is None or given.transverse is None:
        raise InputError('shell.inertia takes "thin", or thickness, or axial and transverse')
    return table.mass, given.axial, given.transverse


def read_frame(table: FrameTable, radius: float, folder: Path) -> Frame:
    """The frame in a shell of this radius [m]."""
    solid = _solid("frame", table, radius, folder)
    return Frame(solid.mass, solid.inertia, solid.centre)


def read_rotor(name: str, table: RotorTable, radius: float, folder: Path) -> Rotor:
    """A rotor in a shell of this radius [m]; InputError unless it is symmetric about its axis."""
    axis = direction(f"{name}'s axis", np.array(table.axis))
    solid = _solid(name, table, radius, folder, axis)
    if isinstance(table.inertia, Axial):
        axial, transverse = table.inertia.axial, table.inertia.transverse
    else:
        axial, transverse = _symmetric(name, solid.inertia, axis)
    return Rotor(solid.mass, axial, transverse, axis, solid.centre)


def read_pendulum(name: str, table: PendulumTable, radius: float, folder: Path) -> Pendulum:
    """A pendulum in a shell of this radius [m]."""
    solid = _solid(name, table, radius, folder)
    axis = direction(f"{name}'s axis", np.array(table.axis))
    return Pendulum(solid.mass, solid.inertia, solid.centre, axis, np.array(table.pivot))


def _solid(
    name: str,
    table: FrameTable | RotorTable | PendulumTable,
    radius: float,
    folder: Path,
    axis: Array = Z,
) -> Solid:
    """Mass, centre and inertia of a body's table; `axis` (3,) is that of its parts."""
    numbers = table.given("mass", "inertia", "centre")
    ways = {each: table.given(each) for each in ("part", "mjcf", "urdf")}
    one_of(name, {"mass and inertia": numbers, **ways})
    if file := table.mjcf or table.urdf:
        solid = _of_file(file, folder)
    elif table.part is not None:
        if not table.part:
            raise InputError(f"{name}.part is empty")
        solid = composed(_solids(name, table.part, axis))
        if not np.linalg.eigvalsh(solid.inertia)[0] > SYMMETRIC * np.abs(solid.inertia).max():
            raise InputError(
                f"{name}'s parts lie on one line, about which nothing resists turning; give a rod "
                "its radius, or a point a sphere's size"
            )
    elif table.mass is None or table.inertia is None:
        missing = "mass" if table.mass is None else "inertia"
        raise InputError(f"{name}: key {missing!r} is missing")
    else:
        tensor = (
            axial_tensor(table.inertia.axial, table.inertia.transverse, axis)
            if isinstance(table.inertia, Axial)
            else _tensor(name, table.inertia)
        )
        solid = Solid(table.mass, np.array(table.centre or (0.0, 0.0, 0.0)), tensor)
    _check_inside(name, solid, radius)
    return solid


def _solids(name: str, parts: list[Part], axis: Array) -> list[Solid]:
    """A body's parts; InputError, with the part's number, for one that cannot be."""
    solids = []
    for number, part in enumerate(parts, start=1):
        try:
            solids.append(part.solid(axis))
        except InputError as error:
            raise InputError(f"{name}.part{number}: {error}") from None
    return solids


def _tensor(name: str, rows: Rows) -> Array:
    """An inertia (3, 3) of three moments or three rows."""
    sizes = {isinstance(row, tuple) for row in rows}
    if len(rows) != 3 or len(sizes) != 1:
        raise InputError(f"{name}.inertia takes three moments, or three rows of three")
    return np.array(rows) if sizes == {True} else np.diag(np.array(rows, dtype=float))


def _of_file(table: MjcfTable | UrdfTable, folder: Path) -> Solid:
    """The body of a file, laid where its table says."""
    from robotball.files.foreign_bodies import solid_of_mjcf, solid_of_urdf

    if isinstance(table, MjcfTable):
        solid = solid_of_mjcf(folder / table.file, table.body)
    else:
        solid = solid_of_urdf(folder / table.file, table.link)
    R = rotation_matrix(unit("attitude", np.array(table.attitude)))
    return Solid(solid.mass, np.array(table.origin) + R @ solid.centre, R @ solid.inertia @ R.T)


def _symmetric(name: str, inertia: Array, axis: Array) -> tuple[float, float]:
    """The moments about an axis (3,) and across it [kg m²]; InputError where it is no symmetry."""
    axial = float(axis @ inertia @ axis)
    transverse = float(np.trace(inertia) - axial) / 2
    off = float(np.abs(inertia - axial_tensor(axial, transverse, axis)).max())
    if off > SYMMETRIC * float(np.abs(inertia).max()):
        other = "part of the frame" if name == "shell" else "pendulum"
        raise InputError(
            f"{name} is not symmetric about its axis: its inertia is off by {off:.6g} of "
            f"{np.abs(inertia).max():.6g} kg m²; such a body is a {other}"
        )
    # A disc's are as 2 to 1, but for the rounding of its turned axes.
    return min(axial, 2 * transverse) if axial < 2 * transverse * (
        1 + SYMMETRIC
    ) else axial, transverse


def _check_inside(name: str, solid: Solid, radius: float) -> None:
    """Raises InputError where parts of known size reach beyond the shell."""
    if solid.reach > radius * (1 + SYMMETRIC):
        raise InputError(
            f"{name} reaches {solid.reach:.6g} m from the sphere's centre, beyond the shell's "
            f"radius {radius:g} m; make it smaller, move it, or make the shell larger"
        )
