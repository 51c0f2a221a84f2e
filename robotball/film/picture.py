"""The picture's world: two balls side by side on one floor, posed by two motions.

Nothing is simulated. The unit of length is the ball's radius, so the hand-written parts are used
as they are. Every body is centred on its ball, so each is posed by itself: a mocap body, at the
ball's centre and in its own attitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball import palette
from robotball.bodies import Ball
from robotball.files.mjcf import part
from robotball.motion import Motion
from robotball.rotations import Array, z_along

SMALLER = 0.85  # each further rotor than the one before, so that all are seen
HALF_WIDTH = 0.035  # of a path on the floor


@dataclass(frozen=True)
class Track:
    """Where one ball is in each of m frames, in radii of the ball.

    point     (m, 2)     the contact point
    attitudes (m, b, 4)  of the b parts (shell, frame, rotors), whose z is their axis, to world
    """

    point: Array
    attitudes: Array


@dataclass(frozen=True)
class Strip:
    """A line on the floor as n flat boxes: half sizes (n, 3), pos (n, 3), turn (n, 3, 3)."""

    size: Array
    pos: Array
    turn: Array


def track(ball: Ball, motion: Motion, times: Array) -> Track:
    """`motion` at other times (m,) [s] within its own: attitude by slerp, the rest by splines."""
    frame = Slerp(motion.times, Rotation.from_quat(motion.attitude, scalar_first=True))(times)
    angles = CubicSpline(motion.times, motion.hinge_angles)(times)
    axes = [ball.shell.axis, *(rotor.axis for rotor in ball.rotors)]
    upright = [Rotation.from_quat(z_along(axis), scalar_first=True) for axis in axes]
    turned = [Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0])) for angle in angles.T]
    parts = [
        # The frame turns on the shell, so the shell is behind it by the hinge angle.
        frame * upright[0] * turned[0].inv(),
        frame * upright[0],
        *(frame * up * turn for up, turn in zip(upright[1:], turned[1:], strict=True)),
    ]
    return Track(
        point=CubicSpline(motion.times, motion.contact_point)(times) / ball.radius,
        attitudes=np.stack([body.as_quat(scalar_first=True) for body in parts], axis=1),
    )


def strip(points: Array) -> Strip:
    """The line through points (m, 2) in radii."""
    steps, middles = np.diff(points, axis=0), (points[:-1] + points[1:]) / 2
    lengths = np.linalg.norm(steps, axis=1)
    angle = np.arctan2(steps[:, 1], steps[:, 0])
    flat = np.ones(len(steps))
    return Strip(
        # A little longer than the step, to close the corners.
        size=np.stack([(lengths + HALF_WIDTH) / 2, HALF_WIDTH * flat, 1e-3 * flat], axis=1),
        pos=np.column_stack([middles, 6e-3 * flat]),
        turn=Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0])).as_matrix(),
    )


def build_stage(rotors: int, colours: Sequence[str]) -> mujoco.MjModel:
    """The floor and a ball of so many rotors in each of the colours.

    Its mocap bodies are shell, frame, rotors of the first ball, then of the next.
    """
    root = part("floor")
    for number, colour in enumerate(colours):
        shell = part("shell")
        for material in shell.find_all("material"):
            material.rgba = [*palette.rgb(colour), material.rgba[3]]
        bodies = [shell, part("frame"), *(_rotor(SMALLER**i) for i in range(rotors))]
        for i, body in enumerate(bodies):
            body.model = f"ball{number}part{i}"
            root.attach(body).mocap = "true"
    return mujoco.MjModel.from_xml_string(root.to_xml_string())


def pose(model: mujoco.MjModel, data: mujoco.MjData, centres: Array, attitudes: Array) -> None:
    """Places the balls: centres (2, 3) in radii, attitudes (2, b, 4)."""
    data.mocap_pos[:] = np.repeat(centres, attitudes.shape[1], axis=0)
    data.mocap_quat[:] = attitudes.reshape(-1, 4)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def _rotor(size: float) -> Any:
    tree = part("rotor")
    for mesh in tree.find_all("mesh"):
        mesh.scale = mesh.scale * size
    for geom in tree.find_all("geom"):
        for attribute in ("size", "pos", "fromto"):
            value = getattr(geom, attribute)
            if value is not None:
                setattr(geom, attribute, value * size)
    return tree
