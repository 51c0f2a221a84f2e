"""The tables of a scene's TOML: every key that there is, with its type."""

from typing import Literal

import msgspec

from robotball.drives import Ramp, Sine
from robotball.parameters import Rolling
from robotball.scene import GRAVITY

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Rate = float | Ramp | Sine


class Table(msgspec.Struct, forbid_unknown_fields=True):
    """A TOML table in which every key must be known."""


class Axial(Table):
    """Moments of a symmetric body about its axis and across it [kg m²]."""

    axial: float
    transverse: float


class ShellInertia(Table):
    """Two moments, or the thickness [m] of a homogeneous shell."""

    axial: float | None = None
    transverse: float | None = None
    thickness: float | None = None


class ShellTable(Table):
    radius: float
    mass: float
    inertia: Literal["thin"] | ShellInertia
    axis: Triple = (0.0, 0.0, 1.0)


class HingeTable(Table, kw_only=True):
    """How a hinge turns: at a rate [rad/s] kept exactly, or by a servo that follows it."""

    rate: Rate = 0.0
    drive: Literal["prescribed", "servo"] = "prescribed"
    kv: float | None = None
    torque_limit: float | None = None


class BodyOf(Table):
    """A body of an MJCF file, with all that is fixed to it; a relative path is from the scene's."""

    file: str
    body: str


class FrameTable(HingeTable, kw_only=True):
    mass: float | None = None
    inertia: tuple[Triple, Triple, Triple] | None = None
    centre: Triple = (0.0, 0.0, 0.0)
    mjcf: BodyOf | None = None


class RotorTable(HingeTable, kw_only=True):
    mass: float
    inertia: Axial
    axis: Triple
    centre: Triple = (0.0, 0.0, 0.0)


class SectionTable(Table):
    L: float
    l: float
    g: float
    f: float
    c: float = 0.0


class StartTable(Table):
    section: SectionTable | None = None
    attitude: Quadruple | None = None
    gamma: Triple | None = None
    alpha: Triple | None = None
    momentum: Triple | None = None
    momentum_world: Triple | None = None
    angular_velocity: Triple | None = None
    rest: bool = False


class NumbersTable(Table):
    """The numbers of the equations, for which bodies are designed."""

    radius: float
    A: list[float | Triple]  # a diagonal, or three rows
    K: Triple
    Omega: Triple
    mass: float | None = None


class SceneTable(Table, kw_only=True):
    title: str
    rolling: Rolling
    duration: float
    start: StartTable
    source: str = ""
    gravity: float = GRAVITY
    shell: ShellTable | None = None
    frame: FrameTable | None = None
    rotor: list[RotorTable] = []
    numbers: NumbersTable | None = None


TABLES: dict[str, type[Table]] = {
    "": SceneTable,
    "shell": ShellTable,
    "frame": FrameTable,
    "frame.mjcf": BodyOf,
    "shell.inertia": ShellInertia,
    "rotor": RotorTable,
    "rotor.inertia": Axial,
    "start": StartTable,
    "start.section": SectionTable,
    "numbers": NumbersTable,
}


def known_keys(table: str) -> list[str]:
    """The keys of a table by its path, without indices."""
    return list(TABLES[table].__struct_fields__) if table in TABLES else []
