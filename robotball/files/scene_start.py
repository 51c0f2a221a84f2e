"""A scene's [start] table → the attitude and the momentum."""

from dataclasses import replace

import msgspec
import numpy as np

from robotball import start as starts
from robotball.bodies import Ball
from robotball.errors import InputError
from robotball.files.scene_table import StartTable
from robotball.parameters import Parameters, as_vector
from robotball.rotations import Array, rotation_matrix
from robotball.start import Start

START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest"
)


def read_start(table: StartTable, ball: Ball, parameters: Parameters) -> Start:
    """The one start that the table gives; a section's is in principal axes."""
    given = {key for key in table.__struct_fields__ if getattr(table, key)}
    axes = ball.principal[1]
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        start = starts.along_momentum(axes @ gamma, axes @ M)
    elif given == {"gamma", "momentum"}:
        gamma = starts.unit("gamma", np.array(table.gamma))
        start = starts.along_momentum(gamma, np.array(table.momentum))
    elif (
        given - MOMENTUM_KEYS in ({"attitude"}, {"gamma", "alpha"})
        and len(given & MOMENTUM_KEYS) == 1
    ):
        attitude = _attitude(table)
        start = Start(attitude, _momentum(table, rotation_matrix(attitude), axes, parameters))
    else:
        keys = ", ".join(sorted(given)) or "nothing"
        raise InputError(f"start gives {keys}; it takes one form: {START_FORMS}")
    if parameters.rolling == "rubber":
        return replace(start, momentum=starts.horizontal(start.momentum))
    return start


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
