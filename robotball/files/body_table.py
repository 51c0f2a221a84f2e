"""The tables of bodies: told by numbers, by parts, or by a body of a file."""

from typing import Annotated, Literal

from robotball.described import key
from robotball.files.hinge_table import HingeTable
from robotball.files.tables import Table
from robotball.parts import ORIGIN, UPRIGHT, Part, Quadruple, Triple

File = Annotated[str, key("the file; a relative path is from the scene's own folder")]
Origin = Annotated[Triple, key("where the body's origin is, from the sphere's centre", "m")]
Attitude = Annotated[Quadruple, key("quaternion (w, x, y, z) that turns the body's axes")]
Parts = Annotated[list[Part] | None, key("parts that it is made of, see Parts")]


class MjcfTable(Table, frozen=True):
    """A body of an MJCF file, with all that is fixed to it."""

    file: File
    body: Annotated[str, key("the name of the body")]
    origin: Origin = ORIGIN
    attitude: Attitude = UPRIGHT


class UrdfTable(Table, frozen=True):
    """A link of a URDF file, with all that is fixed to it."""

    file: File
    link: Annotated[str, key("the name of the link")]
    origin: Origin = ORIGIN
    attitude: Attitude = UPRIGHT


Mjcf = Annotated[MjcfTable | None, key("a body of an MJCF file")]
Urdf = Annotated[UrdfTable | None, key("a link of a URDF file")]
Rows = list[float | Triple]


class Axial(Table, frozen=True):
    """Moments of a symmetric body about its axis and across it."""

    axial: Annotated[float, key("about the axis", "kg m²")]
    transverse: Annotated[float, key("across it", "kg m²")]


class ShellInertia(Table, frozen=True):
    """Two moments about the shell's own centre of mass, or a thickness."""

    axial: Annotated[float | None, key("about the axis", "kg m²")] = None
    transverse: Annotated[float | None, key("across it", "kg m²")] = None
    thickness: Annotated[float | None, key("as `thickness` of the shell", "m")] = None


class ShellTable(Table, frozen=True):
    """The sphere that rolls: a wall, and parts fixed to it; symmetric about `axis`."""

    radius: Annotated[float, key("its outer radius", "m")]
    mass: Annotated[float | None, key("of the wall", "kg")] = None
    density: Annotated[float | None, key("of the wall, instead of its mass", "kg/m³")] = None
    thickness: Annotated[float | None, key("of the wall, the same all round", "m")] = None
    inertia: Annotated[
        Literal["thin"] | ShellInertia | None,
        key('of the wall, instead of its thickness: `"thin"` for none, or two moments'),
    ] = None
    offset: Annotated[
        float, key("how far along `axis` the wall's centre of mass is from the sphere's", "m")
    ] = 0.0
    axis: Annotated[
        Triple, key("what the frame turns about in the shell; a direction of any length")
    ] = (0.0, 0.0, 1.0)
    part: Annotated[list[Part] | None, key("parts fixed to the wall, see Parts")] = None
    mjcf: Annotated[MjcfTable | None, key("the whole shell from an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("the whole shell from a URDF file")] = None


Centre = Annotated[
    Triple | None, key("the centre of mass, from the sphere's centre; 0 if not given", "m")
]


class FrameTable(HingeTable, frozen=True):
    """What turns inside the shell, about the shell's axis, and carries the other bodies."""

    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[
        Rows | None,
        key("about its own centre of mass: three moments, or three rows of three", "kg m²"),
    ] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None


class RotorTable(HingeTable, frozen=True, kw_only=True):
    """A symmetric body on the frame that turns about its own axis."""

    axis: Annotated[Triple, key("its axis; a direction of any length")]
    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[Axial | None, key("its moments")] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None


class PendulumTable(HingeTable, frozen=True, kw_only=True):
    """Any body on a hinge of the frame, told as it is at the hinge's angle 0."""

    axis: Annotated[Triple, key("the hinge's axis; a direction of any length")]
    pivot: Annotated[Triple, key("a point of the axis, from the sphere's centre", "m")] = ORIGIN
    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[
        Rows | None,
        key("about its own centre of mass: three moments, or three rows of three", "kg m²"),
    ] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None
