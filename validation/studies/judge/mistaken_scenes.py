"""Scenes that somebody may have simulated instead of the one that was meant."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from robotball import Custom, InputError, Ramp, Samples, Scene, Sine, Sum
from robotball.bodies import Ball, Body, Rotor, Shell
from robotball.drives import Drive, Rate
from robotball.mechanics.robot import momentum_at
from robotball.motors import Servo
from robotball.parameters import Rolling
from robotball.rotations import Array, conjugate, rotation_matrix
from robotball.start import Start

DEGREES = np.pi / 180
CLEAR = 1e-3  # relative: a rolling radius nearer to the scene's may be an engine's error
LIKELY = 5.0  # times the radius, or less: any other is told from numbers that mean something else


@dataclass(frozen=True)
class MistakenScene:
    """A mistake in setting up the scene, and the scenes that it may have led to."""

    name: str
    scenes: tuple[Scene, ...]


def mistaken_scenes(scene: Scene, rolling_radius: float) -> Iterator[MistakenScene]:
    """All that are tried; rolling_radius: as a file tells it [m], nan where it does not."""
    names = [hinge.name for hinge in scene.hinges]
    moving = [i for i, hinge in enumerate(scene.hinges) if _has_rate(scene, i)]
    groups = [([i], f"the {names[i]}'s rate") for i in moving]
    if len(moving) > 1:
        groups.append((moving, "all rates"))
    for which, what in groups:
        signs = "have" if what == "all rates" else "has"
        yield MistakenScene(f"{what} {signs} the other sign", _with_rates(scene, which, -1.0))
    for which, what in groups:
        missing = "are" if what == "all rates" else "is"
        yield MistakenScene(f"{what} {missing} zero", _with_rates(scene, which, 0.0))
        yield MistakenScene(
            f"{what} {missing} taken in degrees", _with_rates(scene, which, DEGREES)
        )
    yield from _radii(scene, rolling_radius)
    other: Rolling = "classical" if scene.rolling == "rubber" else "rubber"
    flat = replace(scene.start, momentum=scene.start.momentum * [1.0, 1.0, 0.0])
    level = replace(scene, rolling=other, start=flat)
    spin = "may spin (classical)" if other == "classical" else "may not spin (rubber)"
    # The start's spin, where it may not be, is left out, or stopped by the plane.
    up, omega = rotation_matrix(scene.start.attitude)[2], _omega(scene)
    shell = omega - scene.hinges[0].rate * scene.ball.shell.axis
    still = _kept(level, scene, omega - up * (up @ shell)) if other == "rubber" else ()
    yield MistakenScene(f"the ball {spin}", (*_kept(level, scene), *still, level))
    yield from _inertias(scene)
    yield from _starts(scene)


def _has_rate(scene: Scene, hinge: int) -> bool:
    motor = scene.hinges[hinge].motor
    at = np.linspace(0, scene.duration, 50)
    return (motor is None or isinstance(motor, Servo)) and bool(
        np.any(scene.hinges[hinge].command.rate(at))
    )


def _with_rates(scene: Scene, which: list[int], factor: float) -> tuple[Scene, ...]:
    """The rates of some hinges times a factor; with the same M, frame's ω, or shell's ω."""
    given = [scene.frame_rate, *scene.rotor_rates, *scene.pendulum_rates]
    rates = [scaled(rate, factor) if i in which else rate for i, rate in enumerate(given)]
    rotors = 1 + len(scene.ball.rotors)
    changed = replace(
        scene,
        frame_rate=rates[0],
        rotor_rates=tuple(rates[1:rotors]),
        pendulum_rates=tuple(rates[rotors:]),
    )
    found = [changed, *_kept(changed, scene)]
    if 0 in which:
        more = (factor - 1) * float(scene.drives[0].rate(0.0)) * scene.ball.shell.axis
        found += _kept(changed, scene, _omega(scene) + more)
    return tuple(found)


def scaled(rate: Rate, factor: float) -> Rate:
    """A rate times a factor, whatever kind of rate it is."""
    if isinstance(rate, Ramp):
        return msgspec.structs.replace(
            rate, initial=factor * rate.initial, final=factor * rate.final
        )
    if isinstance(rate, Sine):
        return msgspec.structs.replace(
            rate, amplitude=factor * rate.amplitude, mean=factor * rate.mean
        )
    if isinstance(rate, Samples):
        return msgspec.structs.replace(rate, values=tuple(factor * v for v in rate.values))
    if isinstance(rate, Sum):
        return Sum(tuple(scaled(part, factor) for part in rate.parts))
    if isinstance(rate, Custom):
        function = rate.function
        return Custom(lambda t: factor * function(t), rate.breakpoints)
    if isinstance(rate, Drive):
        drive = rate
        return Custom(lambda t: factor * float(drive.rate(t)), tuple(drive.breakpoints))
    if callable(rate):
        call: Callable[[float], float] = rate
        return lambda t: factor * call(t)
    return factor * float(rate)


def _radii(scene: Scene, rolling_radius: float) -> Iterator[MistakenScene]:
    radius = scene.ball.radius
    ratio = rolling_radius / radius
    if not (abs(ratio - 1) > CLEAR and 1 / LIKELY < ratio < LIKELY):
        return
    shell = scene.ball.shell
    larger = replace(shell, radius=rolling_radius)
    heavier = replace(
        larger,
        axial_inertia=ratio**2 * shell.axial_inertia,
        transverse_inertia=ratio**2 * shell.transverse_inertia,
    )
    scenes = [replace(scene, ball=replace(scene.ball, shell=each)) for each in (larger, heavier)]
    yield MistakenScene(
        f"the ball's radius is {rolling_radius:.4g} m, not {radius:g} m",
        tuple(each for changed in scenes for each in (*_kept(changed, scene), changed)),
    )


def _inertias(scene: Scene) -> Iterator[MistakenScene]:
    """Moments that are exchanged, or about another point than the body's centre of mass."""
    for name, body in scene.ball.named_bodies:
        others: dict[str, Body] = {}
        if isinstance(body, Shell | Rotor):
            others[f"the {name}'s axial and transverse inertia are exchanged"] = replace(
                body,
                axial_inertia=body.transverse_inertia,
                transverse_inertia=body.axial_inertia,
            )
        else:
            points, r = ("the sphere's centre", "its centre of mass"), body.centre
            more = body.mass * (r @ r * np.eye(3) - np.outer(r, r))
            for (given, taken), sign in ((points, 1), (points[::-1], -1)):
                others[f"the {name}'s inertia about {given} is taken for that about {taken}"] = (
                    replace(body, inertia=body.inertia + sign * more)
                )
        for what, other in others.items():
            if np.abs(other.inertia - body.inertia).max() > CLEAR * np.abs(body.inertia).max():
                yield MistakenScene(what, _with_body(scene, body, other))


def _with_body(scene: Scene, body: Body, other: Body) -> tuple[Scene, ...]:
    """The scene with another body in one's place, with the same ω of the frame, or the same M."""
    ball = scene.ball

    def chosen(each: Any) -> Any:
        return other if each is body else each

    rotors, pendulums = tuple(map(chosen, ball.rotors)), tuple(map(chosen, ball.pendulums))
    try:
        changed = Ball(chosen(ball.shell), chosen(ball.frame), rotors, pendulums)
    except InputError:  # no body has such moments
        return ()
    heavier = replace(scene, ball=changed)
    return (*_kept(heavier, scene), heavier)


def _starts(scene: Scene) -> Iterator[MistakenScene]:
    start, R = scene.start, rotation_matrix(scene.start.attitude)
    omega, q = _omega(scene), start.attitude
    yield MistakenScene(
        "the start's angular velocity is set in world axes", _kept(scene, scene, R.T @ omega)
    )
    yield MistakenScene(
        "the start's angular velocity is set in frame axes where world axes are meant",
        _kept(scene, scene, R @ omega),
    )
    yield MistakenScene(
        "the start's angular velocity has the other sign", _kept(scene, scene, -omega)
    )
    yield MistakenScene(
        "the start's momentum is taken in frame axes",
        (replace(scene, start=replace(start, momentum=_level(scene, R @ start.momentum))),),
    )
    attitudes = {
        "conjugate (world to frame)": conjugate(q),
        "read in the order x, y, z, w": q[[3, 0, 1, 2]],
        "given in the order x, y, z, w where w, x, y, z is read": q[[1, 2, 3, 0]],
        "left out": np.array([1.0, 0.0, 0.0, 0.0]),
    }
    for how, attitude in attitudes.items():
        turned = replace(scene, start=replace(start, attitude=attitude))
        scenes = (*_kept(turned, scene, omega), turned)
        in_world = rotation_matrix(attitude).T @ R @ omega
        yield MistakenScene(
            f"the start's attitude is {how}", (*scenes, *_kept(turned, scene, in_world))
        )


def _omega(scene: Scene) -> Array:
    return scene.angular_velocity_at(scene.start)


def _kept(changed: Scene, scene: Scene, omega: Array | None = None) -> tuple[Scene, ...]:
    """A changed scene that starts with the frame's ω of the other, or with another one."""
    hinges = changed.hinges
    start = changed.start
    M = momentum_at(
        changed.ball,
        changed.rolling,
        start.attitude,
        _omega(scene) if omega is None else omega,
        np.array([hinge.angle for hinge in hinges]),
        np.array([hinge.rate for hinge in hinges]),
    )
    return (replace(changed, start=_start(changed, M)),)


def _start(scene: Scene, M: Array) -> Start:
    return replace(scene.start, momentum=_level(scene, M))


def _level(scene: Scene, M: Array) -> Array:
    """M as the rolling model has it: a rubber ball's is horizontal."""
    return M * [1.0, 1.0, 0.0] if scene.rolling == "rubber" else M
