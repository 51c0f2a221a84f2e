"""The tables of a scene's TOML: every key that there is, with its type."""

from typing import Literal

import msgspec
import numpy as np

from robotball import start as starts
from robotball.bodies import Ball
from robotball.drives import Ramp, Sine
from robotball.errors import InputError
from robotball.parameters import Parameters, Rolling, as_vector
from robotball.rotations import Array, rotation_matrix
from robotball.scene import GRAVITY
from robotball.start import Start

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
    """An attitude and a momentum, in one of the forms of START_FORMS.

    rest: M = 0, which is the paper's rest. It is not ω = 0: a frame or rotor that turns at the
    start turns the ball. A ball that stands still has angular_velocity = [0, 0, 0].
    """

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


START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest (M = 0; a ball that stands still has "
    "angular_velocity = [0, 0, 0])"
)


def read_start(table: StartTable, ball: Ball, parameters: Parameters) -> Start:
    """The one start that the table gives; a section's is in principal axes."""
    given = {key for key in table.__struct_fields__ if getattr(table, key)}
    axes = ball.principal[1]
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        return starts.along_momentum(axes @ gamma, axes @ M)
    if given == {"gamma", "momentum"}:
        gamma = starts.unit("gamma", np.array(table.gamma))
        return starts.along_momentum(gamma, np.array(table.momentum))
    if (
        given - MOMENTUM_KEYS in ({"attitude"}, {"gamma", "alpha"})
        and len(given & MOMENTUM_KEYS) == 1
    ):
        attitude = _attitude(table)
        return Start(attitude, _momentum(table, rotation_matrix(attitude), axes, parameters))
    keys = ", ".join(sorted(given)) or "nothing"
    raise InputError(f"start gives {keys}; it takes one form: {START_FORMS}")


MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def _attitude(table: StartTable) -> Array:
    if table.attitude:
        return starts.unit("attitude", np.array(table.attitude))
    gamma, alpha = np.array(table.gamma), np.array(table.alpha)
    return starts.attitude_of_axes(starts.unit("gamma", gamma), starts.unit("alpha", alpha))


def _momentum(table: StartTable, to_world: Array, axes: Array, parameters: Parameters) -> Array:
    """M (3,) in world axes of a table with one of MOMENTUM_KEYS."""
    if table.momentum:
        return to_world @ np.array(table.momentum)
    if table.momentum_world:
        return np.array(table.momentum_world)
    if table.rest:
        return np.zeros(3)
    omega, gamma = axes.T @ np.array(table.angular_velocity), axes.T @ to_world[2]
    if parameters.rolling == "rubber":
        starts.check_no_spin(omega - parameters.Omega, gamma)
    return to_world @ axes @ parameters.momentum(as_vector(omega), as_vector(gamma))
