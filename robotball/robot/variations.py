"""Variations of a scene: other bodies, masses, sizes or rates."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from robotball.robot.ball import Ball, Frame, Pendulum, Rotor, Shell
from robotball.robot.drives import Constant, Custom, Drive, Rate
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array

_OneBody = TypeVar("_OneBody", bound=Shell | Frame | Rotor | Pendulum)


def with_bodies(ball: Ball, change: Callable[[Any], Any]) -> Ball:
    """Return the ball with every body changed, the shell first."""
    shell = change(ball.shell)
    hinges = tuple(replace(hinge, body=change(hinge.body)) for hinge in ball.hinges)
    return replace(ball, shell=shell, hinges=hinges)


def scaled_body(body: _OneBody, mass: float, length: float = 1.0) -> _OneBody:
    """Return a body with its mass and its lengths multiplied by two factors."""
    factors = {"mass": mass, "radius": length, "centre": length}
    moments = ("axial_inertia", "transverse_inertia", "inertia")
    factors |= dict.fromkeys(moments, mass * length**2)
    names = {field.name for field in fields(body)} & factors.keys()
    return replace(body, **{name: getattr(body, name) * factors[name] for name in names})


def scaled(
    scene: Scene, *, mass: float = 1.0, length: float = 1.0, gravity: float | None = None
) -> Scene:
    """Return the scene with its masses and lengths multiplied by two factors.

    Rates and times stay the same, so M is multiplied by mass·length². gravity: the factor of
    gravity; None means the factor of lengths, with which only the size of the motion changes.
    """
    return replace(
        scene,
        ball=with_bodies(scene.ball, lambda body: scaled_body(body, mass, length)),
        start=Start(scene.start.attitude, scene.start.momentum * mass * length**2),
        gravity=scene.gravity * (length if gravity is None else gravity),
    )


def redistributed(scene: Scene, *, frame_to_shell: float, rotor_to_frame: float) -> Scene:
    """Return the scene with its mass redistributed; bodies keep their shapes and rates."""
    ball = scene.ball
    shares = np.array([1.0, frame_to_shell, frame_to_shell * rotor_to_frame])
    masses = iter((ball.mass * shares / shares.sum()).tolist())
    bodies = with_bodies(ball, lambda body: scaled_body(body, next(masses) / body.mass))
    return replace(scene, ball=bodies)


def momentum_of(scene: Scene) -> Array:
    """Return K (3,) of (A.3), frame axes [kg m²/s]."""
    return scene.principal_axes @ np.array(scene.parameters.K)


def gyrostat(
    scene: Scene,
    *,
    frame_rate: float | None = None,
    K: Array | None = None,
    rotor_rate: float | None = None,
) -> Scene:
    """Return the scene with other Ω and K (3,), frame axes, and the same A and mass.

    None keeps a value; rates are in rad/s. By (A.3) the rotor carries K + (J_s + d)Ω. This
    determines the rotor's axis and rate, or its axis and inertia if `rotor_rate` is given. The
    frame gets the rest of the inertia. Raises InputError if no inertia remains for the frame.
    """
    ball = scene.ball
    (rotor,) = ball.rotors
    K = momentum_of(scene) if K is None else K
    frame_rate = float(scene.drives[0].rate(0.0)) if frame_rate is None else frame_rate
    carried = K + (ball.shell.axial_inertia + ball.d) * frame_rate * ball.shell.axis
    size = float(np.linalg.norm(carried))
    inertia = rotor.axial_inertia if rotor_rate is None else size / rotor_rate
    new = replace(rotor, axial_inertia=inertia, transverse_inertia=inertia / 2, axis=carried / size)
    frame = replace(ball.frame, inertia=ball.frame.inertia + rotor.inertia - new.inertia)
    return scene.with_hinges(body=(frame, new), command=(frame_rate, size / inertia))


def scaled_rate(drive: Drive, factor: float) -> Rate:
    """Return the rate of a drive times a factor."""
    if isinstance(drive, Constant):
        return factor * drive.value
    return Custom(partial(_times, factor, drive), tuple(drive.breakpoints))


def _times(factor: float, drive: Drive, t: float) -> float:
    return factor * float(drive.rate(t))
