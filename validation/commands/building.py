"""The commands for builders of robots: bodies for requested numbers, drives for a wanted path."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from tyro.conf import arg

from robotball import InputError, Limits, load_scene, scene_toml
from robotball.design import steering as paths
from robotball.design.designing import describe, redesign
from robotball.design.steering import WantedPath, shortfalls, steer

from ..agreement import compare
from ..options import AGREES, DISAGREES, OUT, Given, Preset, SceneName
from ..output import writable_folder, write_text
from ..plots import draw
from ..results import changed, file_name

_NEAR_PATH = 1e-3  # of the path's length: how near to it a robot that is steered must come


@dataclass(frozen=True)
class Design:
    """Find bodies for a scene's A, Ω and K: print them, and write a scene that has them.

    Example: robotball design fig12 --rotor-speed 20
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    mass: Annotated[Given[float], arg(metavar="KG")] = None
    """Mass of the ball; the best one if not given."""
    rotor_speed: Annotated[float, arg(metavar="RAD/S")] = math.inf
    """The fastest that a rotor may turn."""
    frame_radius: Annotated[Given[float], arg(metavar="M")] = None
    """Within which the frame must lie; the shell's if not given."""
    shell_thickness: Annotated[float, arg(metavar="M")] = 0.0
    """The thickness of a homogeneous shell; 0 for a thin one."""
    out: Path = OUT
    """Folder for the scene."""

    def run(self) -> int:
        scene = load_scene(self.scene)
        limited = ("rotor_speed", "frame_radius", "shell_thickness")
        limits = Limits(**{name: getattr(self, name) for name in limited})
        found, designed = redesign(scene, self.mass, limits)
        words = changed(self, "mass", *limited)
        name = file_name(designed.name, None, words)
        path = writable_folder(self.out) / f"{name}.toml"
        write_text(path, scene_toml(replace(designed, name=name)))
        print(describe(found), path, sep="\n")
        return AGREES


@dataclass(frozen=True)
class Steer:
    """Find the drives that roll a robot along a path, and check them in both engines.

    The path begins along X, at the origin. The scene with the drives is written into the folder.

    Example: robotball steer three_rotors --path circle --size 0.5
    """

    scene: SceneName
    """A catalog name, or a path to a TOML, MJCF or URDF file: a robot with two driven hinges."""
    path: Literal["line", "circle", "eight"] = "line"
    """The path's shape."""
    size: Annotated[float, arg(metavar="M")] = 1.0
    """The line's length, the circle's radius or the eight's half length."""
    turns: float = 1.0
    """How often round the circle; to the right below 0."""
    through: Annotated[str, arg(metavar="X,Y …", help_behavior_hint="")] = ""
    """Instead of a shape, points in m: "1,0 1,1 0,1"."""
    duration: Annotated[float, arg(metavar="S")] = 10.0
    """From rest to rest."""
    rate_limit: Annotated[float, arg(metavar="RAD/S")] = math.inf
    """The fastest that a hinge may turn."""
    preset: Preset = None
    """The engine's settings to check it with, its default if not given."""
    out: Path = OUT
    """Folder for the scene and the pictures."""

    def run(self) -> int:
        robot, path = load_scene(self.scene), self._path()
        steered = steer(robot, path, self.duration)
        out = writable_folder(self.out)
        words = changed(self, "size", "turns", "through", "duration")
        # The scene carries the name of its file, by which both pictures are called too.
        scene = replace(steered.scene, name=file_name(steered.scene.name, None, words))
        file = out / f"{scene.name}.toml"
        write_text(file, scene_toml(scene))
        agreement = compare(scene, steered.times, settings=self.preset)
        theory = agreement.theory
        off = float(np.linalg.norm(theory.contact_point - steered.wanted, axis=1).max())
        print(f"{path.name} of {path.length:.4g} m in {self.duration:g} s")
        print(f"{theory.engine.name}: at most {off:.2g} m off the path")
        print(f"{agreement.motion.engine.name}: {agreement.verdict}")
        most = (
            np.abs(each).max(axis=0) for each in (theory.hinge_rates, theory.loads.motor_torques)
        )
        for hinge, rate, torque in zip(robot.hinges, *most, strict=True):
            print(f"{hinge.name}: up to {rate:.3g} rad/s and {torque:.3g} N m")
        friction, torsion = theory.loads.sliding_friction, theory.loads.torsional_friction
        print(f"friction: up to {friction.max():.3g}, torsional {torsion.max():.3g} m")
        # What a path needs is known only from its motion: loads follow from accelerations.
        missing = shortfalls(robot, theory, self.rate_limit)
        if off > _NEAR_PATH * path.length:
            missing.append(f"it leaves the path by {off:.2g} m")
        for line in missing:
            print(f"cannot: {line}")
        print(file, *draw([agreement], out), sep="\n")
        return AGREES if agreement.agrees and not missing else DISAGREES

    def _path(self) -> WantedPath:
        if self.through:
            return paths.through(_points_of(self.through))
        if self.path == "circle":
            return paths.circle(self.size, self.turns)
        return paths.eight(self.size) if self.path == "eight" else paths.straight(self.size)


def _points_of(text: str) -> list[tuple[float, float]]:
    """Return the pairs X,Y of a text. Raises InputError where it holds anything else."""
    try:
        points = [(float(x), float(y)) for x, y in (pair.split(",") for pair in text.split())]
    except ValueError:
        points = []
    if not points:
        raise InputError(f'points are pairs like "1,0 1,1", not {text!r}')
    return points
