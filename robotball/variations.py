"""Variations: make a scene from another one, with other bodies, other rates or another start."""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, TypeVar

import msgspec
import numpy as np

from robotball.drives import Custom, Drive, Ramp, Rate, Samples, Sine, Sum, as_custom
from robotball.mechanics import momentum_at
from robotball.robot import Ball, Frame, Pendulum, Rotor, Shell
from robotball.rotations import Array
from robotball.scene import Scene, Start

_OneBody = TypeVar("_OneBody", bound=Shell | Frame | Rotor | Pendulum)


def with_bodies(ball: Ball, change: Callable[[Any], Any]) -> Ball:
    """Return the ball with another body in the place of each."""
    bodies = {each.name: getattr(ball, each.name) for each in fields(ball)}
    changed: dict[str, Any] = {
        name: tuple(map(change, own)) if isinstance(own, tuple) else change(own)
        for name, own in bodies.items()
    }
    return replace(ball, **changed)


def scaled_body(body: _OneBody, mass: float, length: float = 1.0) -> _OneBody:
    """Return a body with its mass and its lengths multiplied by two factors."""
    factors = {
        "mass": mass,
        "axial_inertia": mass * length**2,
        "transverse_inertia": mass * length**2,
        "inertia": mass * length**2,
        "radius": length,
        "centre": length,
    }
    names = {each.name for each in fields(body)} & factors.keys()
    return replace(body, **{name: getattr(body, name) * factors[name] for name in names})


def scaled(
    scene: Scene, *, mass: float = 1.0, length: float = 1.0, gravity: float | None = None
) -> Scene:
    """Return the scene with its masses and lengths multiplied by two factors, and M with them.

    Rates and times stay, so that momenta go with mass·length². gravity: its factor; that of lengths
    if None, by which the motion stays the same but for its size.
    """
    return replace(
        scene,
        ball=with_bodies(scene.ball, lambda body: scaled_body(body, mass, length)),
        start=Start(scene.start.attitude, scene.start.momentum * mass * length**2),
        gravity=scene.gravity * (length if gravity is None else gravity),
    )


def redistributed(scene: Scene, *, frame_to_shell: float, rotor_to_frame: float) -> Scene:
    """Return the scene with its mass shared out anew; bodies keep their shapes and rates."""
    ball = scene.ball
    shares = np.array([1.0, frame_to_shell, frame_to_shell * rotor_to_frame])
    shell, frame, rotor = (ball.mass * shares / shares.sum()).tolist()
    (old_rotor,) = ball.rotors
    return replace(
        scene,
        ball=Ball(
            scaled_body(ball.shell, shell / ball.shell.mass),
            scaled_body(ball.frame, frame / ball.frame.mass),
            (scaled_body(old_rotor, rotor / old_rotor.mass),),
        ),
    )


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

    What is None stays; rates are in rad/s. By (A.3) the rotor has to carry K + (J_s + d)Ω: its axis
    and its rate become what that takes, or, where its rate is given, its axis and its inertia. The
    frame takes the rest of the inertia. Raises InputError where nothing is left for it.
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
    return replace(
        scene,
        ball=Ball(ball.shell, frame, (new,)),
        frame_rate=frame_rate,
        rotor_rates=(size / inertia,),
    )


def scaled_rate(rate: Rate, factor: float) -> Rate:
    """Return a rate times a factor, whatever kind of rate it is."""
    if isinstance(rate, Ramp | Sine):
        names = ("initial", "final") if isinstance(rate, Ramp) else ("amplitude", "mean")
        changes = {name: factor * getattr(rate, name) for name in names}
        return msgspec.structs.replace(rate, **changes)
    if isinstance(rate, Samples):
        return msgspec.structs.replace(rate, values=tuple(factor * v for v in rate.values))
    if isinstance(rate, Sum):
        return Sum(tuple(scaled_rate(part, factor) for part in rate.parts))
    if isinstance(rate, Custom | Drive) or callable(rate):
        given = replace(as_custom(rate), derivative=None, integral=None)
        return replace(given, function=lambda t: factor * float(given.function(t)))
    return factor * float(rate)


def with_angular_velocity(scene: Scene, omega: Array) -> Scene:
    """Return the scene whose frame starts with an angular velocity (3,), frame axes [rad/s].

    Hinges turn at the start, so that M follows from ω only with their rates. A rubber ball's shell
    may not spin, so that its M has no vertical part.
    """
    start = scene.start
    angles = np.array([hinge.angle for hinge in scene.hinges])
    rates = np.array([hinge.rate for hinge in scene.hinges])
    M = momentum_at(scene.ball, scene.rolling, start.attitude, omega, angles, rates)
    M = M * [1.0, 1.0, 0.0] if scene.rolling == "rubber" else M
    return replace(scene, start=replace(start, momentum=M))
