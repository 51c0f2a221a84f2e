"""Mistakes to plant: in a file that is right, and in the scene that an engine is given."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from robotball import Scene, Trajectory
from robotball.equations import Rolling
from robotball.mechanics import momentum_at
from robotball.robot import Frame, Rotor, Shell
from robotball.rotations import Array, conjugate, from_matrix, multiply, rotation_matrix
from robotball.scene import Start
from validation.studies.mistakes import scaled

InFile = Callable[[Trajectory, Scene], Trajectory]
InScene = Callable[[Scene], Scene]


def attitude(change: Callable[[Array, Trajectory, Scene], Array]) -> InFile:
    return lambda file, scene: replace(file, attitude=change(file.attitude, file, scene))


def position(change: Callable[[Array], Array]) -> InFile:
    return lambda file, _: replace(file, position=change(file.position))


def rate(change: Callable[[Array, Trajectory, Scene], Array]) -> InFile:
    def planted(file: Trajectory, scene: Scene) -> Trajectory:
        assert file.angular_velocity is not None
        return replace(file, angular_velocity=change(file.angular_velocity, file, scene))

    return planted


def world(S: Array, frame: bool) -> InFile:
    """The world's axes, and the frame's, are the rows of S."""
    P = from_matrix(S * np.linalg.det(S).round())

    def planted(file: Trajectory, _: Scene) -> Trajectory:
        q = multiply(np.broadcast_to(P, file.attitude.shape), file.attitude)
        w = file.angular_velocity
        if frame:
            q = multiply(q, np.broadcast_to(conjugate(P), q.shape))
            w = None if w is None else w @ rotation_matrix(P).T
        return replace(file, position=file.position @ S.T, attitude=q, angular_velocity=w)

    return planted


def frame_turned(file: Trajectory, scene: Scene) -> Array:
    """(n, 4): the frame's turn in the shell."""
    angles = np.asarray(scene.drives[0].angle(file.times))
    turns = Rotation.from_rotvec(np.outer(angles, scene.ball.shell.axis))
    return np.asarray(turns.as_quat(scalar_first=True))


def in_world(w: Array, file: Trajectory, _: Scene) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", rotation_matrix(file.attitude), w))


def of_the_shell(w: Array, file: Trajectory, scene: Scene) -> Array:
    return w - np.outer(scene.drives[0].rate(file.times), scene.ball.shell.axis)


CYCLED = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
Y_UP_LEFT = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
Z_DOWN = np.diag([1.0, -1.0, -1.0])

IN_FILES: dict[str, InFile] = {
    "the quaternion's order is x, y, z, w": attitude(lambda q, *_: q[:, [1, 2, 3, 0]]),
    "qx, qy, qz, qw hold w, x, y, z": attitude(lambda q, *_: q[:, [3, 0, 1, 2]]),
    "from world to frame": attitude(lambda q, *_: conjugate(q)),
    "the attitude is the shell's": attitude(
        lambda q, file, scene: multiply(q, conjugate(frame_turned(file, scene)))
    ),
    "principal axes": attitude(
        lambda q, _, scene: multiply(q, np.broadcast_to(scene.principal_quaternion, q.shape))
    ),
    "counted from the start, in world axes": attitude(
        lambda q, *_: multiply(q, np.broadcast_to(conjugate(q[0]), q.shape))
    ),
    "frame's axes are others: the file's x, y, z are the scene's y, z, x": attitude(
        lambda q, *_: multiply(q, np.broadcast_to(conjugate(from_matrix(CYCLED)), q.shape))
    ),
    "the positions are in mm": position(lambda p: 1e3 * p),
    "the positions are in cm": position(lambda p: 1e2 * p),
    "the positions are in inches": position(lambda p: p / 0.0254),
    "x and y are exchanged": position(lambda p: p[:, [1, 0, 2]]),
    "y has the other sign": position(lambda p: p * [1, -1, 1]),
    "the path does not start at (0, 0)": position(lambda p: p + np.array([3.0, -1.0, 0.0])),
    "angular velocity is in world axes": rate(in_world),
    "angular velocity is in deg/s": rate(lambda w, *_: np.degrees(w)),
    "angular velocity has the other sign": rate(lambda w, *_: -w),
    "angular velocity is the shell's": rate(of_the_shell),
    "angular velocity is not the attitude's rate": rate(lambda w, *_: 0.9 * w),
    "x, y, z are the scene's x, z, -y (Y is up)": world(Y_UP, frame=False),
    "x, y, z are the scene's x, z, y (Y is up, and the axes are left-handed)": world(
        Y_UP_LEFT, frame=True
    ),
    "x, y, z are the scene's x, -y, -z (Z is down)": world(Z_DOWN, frame=False),
}


def with_rates(factor: float, frame: bool = True, rotor: int | None = None) -> InScene:
    """The frame's rate, and one rotor's, times a factor; None is no rotor's."""

    def planted(scene: Scene) -> Scene:
        rates = list(scene.rotor_rates)
        if rotor is not None:
            rates[rotor] = scaled(rates[rotor], factor)
        first = scaled(scene.frame_rate, factor) if frame else scene.frame_rate
        return replace(scene, frame_rate=first, rotor_rates=tuple(rates))

    return planted


def with_radius(factor: float) -> InScene:
    def planted(scene: Scene) -> Scene:
        shell = replace(scene.ball.shell, radius=factor * scene.ball.radius)
        return replace(scene, ball=replace(scene.ball, shell=shell))

    return planted


def start_at(change: Callable[[Array], Array]) -> InScene:
    """The frame's angular velocity along its own axes stays."""

    def planted(scene: Scene) -> Scene:
        attitude = change(scene.start.attitude)
        rates = np.array([hinge.rate for hinge in scene.hinges])
        omega = scene.angular_velocity_at(scene.start)
        M = momentum_at(scene.ball, scene.rolling, attitude, omega, 0 * rates, rates)
        return replace(scene, start=Start(attitude, M * level(scene)))

    return planted


def other_rolling(scene: Scene) -> Scene:
    """M stays, as far as the other model has it."""
    other: Rolling = "rubber" if scene.rolling == "classical" else "classical"
    start = replace(scene.start, momentum=scene.start.momentum * [1, 1, 0])
    return replace(scene, rolling=other, start=start)


B = TypeVar("B", Shell, Rotor)


def exchanged(body: B) -> B:
    moments = body.axial_inertia, body.transverse_inertia
    return replace(body, axial_inertia=moments[1], transverse_inertia=moments[0])


def of_shell(scene: Scene) -> Scene:
    return replace(scene, ball=replace(scene.ball, shell=exchanged(scene.ball.shell)))


def of_rotor(scene: Scene) -> Scene:
    first, *others = scene.ball.rotors
    return replace(scene, ball=replace(scene.ball, rotors=(exchanged(first), *others)))


def with_frame_inertia(change: Callable[[Frame], Array]) -> InScene:
    def planted(scene: Scene) -> Scene:
        frame = scene.ball.frame
        changed = replace(frame, inertia=change(frame))
        return replace(scene, ball=replace(scene.ball, frame=changed))

    return planted


def from_centre(frame: Frame) -> Array:
    """The inertia that is due to the way of the centre of mass from the sphere's centre."""
    r = frame.centre
    return frame.mass * (r @ r * np.eye(3) - np.outer(r, r))


def level(scene: Scene) -> Array:
    return np.array([1.0, 1.0, 0.0 if scene.rolling == "rubber" else 1.0])


IN_SCENES: dict[str, InScene] = {
    "frame's rate has the other sign": with_rates(-1),
    "rotor1's rate has the other sign": with_rates(-1, frame=False, rotor=0),
    "frame's rate is zero": with_rates(0.0),
    "frame's rate is taken in degrees": with_rates(np.pi / 180),
    "the ball's radius is": with_radius(1.1),
    "the ball may not spin (rubber)": other_rolling,
    "the ball may spin (classical)": other_rolling,
    "the start's attitude is conjugate": start_at(conjugate),
    "the start's attitude is read in the order x, y, z, w": start_at(lambda q: q[[3, 0, 1, 2]]),
}

WRONG_INERTIAS: dict[str, InScene] = {
    "the shell's axial and transverse inertia are exchanged": of_shell,
    "the rotor1's axial and transverse inertia are exchanged": of_rotor,
    "the frame's inertia about the sphere's centre is taken for that about its centre of mass": (
        with_frame_inertia(lambda frame: frame.inertia + from_centre(frame))
    ),
    "the frame's inertia about its centre of mass is taken for that about the sphere's centre": (
        with_frame_inertia(lambda frame: frame.inertia - from_centre(frame))
    ),
}
