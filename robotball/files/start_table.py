"""The table of a start: an attitude and a momentum, in one of several forms."""

from dataclasses import replace
from typing import Annotated

import msgspec
import numpy as np

from robotball import start as starts
from robotball.bodies import Ball
from robotball.described import key
from robotball.errors import InputError
from robotball.files.tables import Table
from robotball.mechanics.robot import momentum_at
from robotball.parts import Quadruple, Triple
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene
from robotball.start import Start


class SectionTable(Table, frozen=True):
    """The section's coordinates (5.5), in the principal axes of the ball's inertia."""

    L: Annotated[float, key("M along the third axis", "kg m²/s")]
    l: Annotated[float, key("angle of M about it", "rad")]
    g: Annotated[float, key("angle of γ about M", "rad")]
    f: Annotated[float, key("M²", "(kg m²/s)²")]
    c: Annotated[float, key("(M, γ); 0 in the rubber model", "kg m²/s")] = 0.0


class StartTable(Table, frozen=True):
    """An attitude and what turns the ball, in one of three forms."""

    attitude: Annotated[
        Quadruple | None, key("quaternion (w, x, y, z) of the frame, frame to world")
    ] = None
    gamma: Annotated[Triple | None, key("the upward vertical, in frame axes; of length 1")] = None
    alpha: Annotated[Triple | None, key("the world's X, in frame axes; of length 1")] = None
    angular_velocity: Annotated[
        Triple | None, key("ω of the frame, in frame axes; 0 is a frame that stands still", "rad/s")
    ] = None
    momentum: Annotated[Triple | None, key("M in frame axes", "kg m²/s")] = None
    momentum_world: Annotated[Triple | None, key("M in world axes", "kg m²/s")] = None
    rest: Annotated[
        bool, key("`true` is M = 0, the paper's rest; what turns at the start turns the ball then")
    ] = False
    section: Annotated[SectionTable | None, key("the paper's section coordinates")] = None


START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest (M = 0; a ball that stands still has "
    "angular_velocity = [0, 0, 0])"
)
MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def read_start(table: StartTable, ball: Ball) -> Start:
    """The one start that the table gives; a section's is in principal axes.

    The momentum of an angular velocity is left at 0, for `turning`.
    """
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
        return Start(attitude, _momentum(table, rotation_matrix(attitude)))
    keys = ", ".join(sorted(given)) or "nothing"
    raise InputError(f"start gives {keys}; it takes one form: {START_FORMS}")


def turning(scene: Scene, omega: Triple) -> Scene:
    """The scene that starts with the frame's angular velocity (3,), in frame axes [rad/s].

    Raises InputError where the shell would spin on the spot and the rolling model is rubber.
    """
    start, turned = scene.start, np.array(omega)
    angles = np.array([hinge.angle for hinge in scene.hinges])
    rates = np.array([hinge.rate for hinge in scene.hinges])
    if scene.rolling == "rubber":
        gamma = rotation_matrix(start.attitude)[2]
        starts.check_no_spin(turned - rates[0] * scene.ball.shell.axis, gamma)
    M = momentum_at(scene.ball, scene.rolling, start.attitude, turned, angles, rates)
    return replace(scene, start=replace(start, momentum=M))


def _attitude(table: StartTable) -> Array:
    if table.attitude:
        return starts.unit("attitude", np.array(table.attitude))
    gamma, alpha = np.array(table.gamma), np.array(table.alpha)
    return starts.attitude_of_axes(starts.unit("gamma", gamma), starts.unit("alpha", alpha))


def _momentum(table: StartTable, to_world: Array) -> Array:
    """M (3,) in world axes of a table with one of MOMENTUM_KEYS."""
    if table.momentum:
        return to_world @ np.array(table.momentum)
    if table.momentum_world:
        return np.array(table.momentum_world)
    return np.zeros(3)
