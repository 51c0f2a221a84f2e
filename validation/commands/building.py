"""The commands for builders of robots: bodies for requested numbers, drives for a wanted path."""

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from .. import options

if TYPE_CHECKING:
    from robotball.design.steering import WantedPath

_NEAR_PATH = 1e-3  # of the path's length: how near to it a robot that is steered must come
_Metres = Annotated[float, Parameter(metavar="M")]
_Rate = Annotated[float, Parameter(metavar="RAD/S")]


def design(
    scene: options.SceneName,
    /,
    *,
    mass: Annotated[float | None, Parameter(metavar="KG")] = None,
    rotor_speed: _Rate = math.inf,
    frame_radius: _Metres | None = None,
    shell_thickness: _Metres = 0.0,
    out: options.Out = options.OUT,
) -> int:
    """Find bodies that give the A, Ω and K of a scene; print them, and write a scene with them.

    Example: robotball design fig12 --rotor-speed 20

    Parameters
    ----------
    mass
        Mass of the ball. Default: the best one.
    rotor_speed
        Largest speed of a rotor.
    frame_radius
        Radius within which the frame must lie. Default: the shell's radius.
    shell_thickness
        Thickness of a homogeneous shell; 0 for a thin one.
    """
    from robotball import Limits, load_scene, scene_toml
    from robotball.design.designing import describe, redesign

    from ..output import writable_folder, write_text
    from ..results import changed, file_name

    limits: dict[str, Any] = {
        "rotor_speed": rotor_speed,
        "frame_radius": frame_radius,
        "shell_thickness": shell_thickness,
    }
    found, designed = redesign(load_scene(scene), mass, Limits(**limits))
    name = file_name(designed.name, None, changed(design, mass=mass, **limits))
    path = writable_folder(out) / f"{name}.toml"
    write_text(path, scene_toml(replace(designed, name=name)))
    print(describe(found), path, sep="\n")
    return options.AGREES


def steer(
    scene: options.SceneName,
    /,
    *,
    path: Literal["line", "circle", "eight"] = "line",
    size: _Metres = 1.0,
    turns: float = 1.0,
    through: Annotated[str, Parameter(metavar="X,Y …")] = "",
    duration: options.Seconds = 10.0,
    rate_limit: _Rate = math.inf,
    preset: options.PresetName | None = None,
    out: options.Out = options.OUT,
) -> int:
    """Find the drives that roll a robot along a path, and check them in both engines.

    The robot has two driven hinges. The path begins at the origin, along X. Writes the scene with
    the drives, and pictures.

    Example: robotball steer three_rotors --path circle --size 0.5

    Parameters
    ----------
    path
        Shape of the path.
    size
        Length of the line, radius of the circle, or half the length of the eight.
    turns
        Number of turns round the circle; a negative number turns right.
    through
        Points in m, in place of a shape: "1,0 1,1 0,1".
    duration
        Time of the motion, from rest to rest.
    rate_limit
        Largest speed of a hinge.
    preset
        Settings of the engine to check the drives with. Default: the engine's default.
    """
    import numpy as np

    from robotball import load_scene, scene_toml
    from robotball.design import steering

    from ..agreement import compare
    from ..output import writable_folder, write_text
    from ..plots import draw
    from ..results import changed, file_name

    robot, wanted = load_scene(scene), _path_of(path, size, turns, through)
    steered = steering.steer(robot, wanted, duration)
    writable_folder(out)
    words = changed(steer, size=size, turns=turns, through=through, duration=duration)
    # The scene carries the name of its file, by which both pictures are called too.
    driven = replace(steered.scene, name=file_name(steered.scene.name, None, words))
    file = out / f"{driven.name}.toml"
    write_text(file, scene_toml(driven))
    agreement = compare(driven, steered.times, settings=preset)
    theory = agreement.theory
    off = float(np.linalg.norm(theory.contact_point - steered.wanted, axis=1).max())
    print(f"{wanted.name} of {wanted.length:.4g} m in {duration:g} s")
    print(f"{theory.engine.name}: at most {off:.2g} m off the path")
    print(f"{agreement.motion.engine.name}: {agreement.verdict}")
    most = (np.abs(each).max(axis=0) for each in (theory.hinge_rates, theory.loads.motor_torques))
    for hinge, rate, torque in zip(robot.hinges, *most, strict=True):
        print(f"{hinge.name}: up to {rate:.3g} rad/s and {torque:.3g} N m")
    friction, torsion = theory.loads.sliding_friction, theory.loads.torsional_friction
    print(f"friction: up to {friction.max():.3g}, torsional {torsion.max():.3g} m")
    # What a path needs is known only from its motion: loads follow from accelerations.
    missing = steering.shortfalls(robot, theory, rate_limit)
    if off > _NEAR_PATH * wanted.length:
        missing.append(f"it leaves the path by {off:.2g} m")
    for line in missing:
        print(f"cannot: {line}")
    print(file, *draw([agreement], out), sep="\n")
    return options.AGREES if agreement.agrees and not missing else options.DISAGREES


def _path_of(shape: str, size: float, turns: float, through: str) -> "WantedPath":
    from robotball.design import steering

    if through:
        return steering.through(_points_of(through))
    if shape == "circle":
        return steering.circle(size, turns)
    return steering.eight(size) if shape == "eight" else steering.straight(size)


def _points_of(text: str) -> list[tuple[float, float]]:
    """Return the pairs X,Y of a text. Raises InputError where it holds anything else."""
    from robotball import InputError

    try:
        points = [(float(x), float(y)) for x, y in (pair.split(",") for pair in text.split())]
    except ValueError:
        points = []
    if not points:
        raise InputError(f'points are pairs like "1,0 1,1", not {text!r}')
    return points
