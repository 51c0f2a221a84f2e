"""The command `robotball design`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, arg

from validation.commands.arguments import AGREES, OUT, SceneName


@dataclass(frozen=True)
class Design:
    """Find bodies for a scene's A, Ω and K: print them, and write a scene that has them.

    Example: robotball design fig12 --rotor-speed 20
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    mass: DisallowNone[Annotated[float | None, arg(metavar="KG", help_behavior_hint="")]] = None
    """Mass of the ball; the best one if not given."""
    rotor_speed: Annotated[float, arg(metavar="RAD/S")] = math.inf
    """The fastest that a rotor may turn."""
    frame_radius: DisallowNone[Annotated[float | None, arg(metavar="M", help_behavior_hint="")]] = (
        None
    )
    """Within which the frame must lie; the shell's if not given."""
    shell_thickness: Annotated[float, arg(metavar="M")] = 0.0
    """Of a homogeneous shell; 0 for a thin one."""
    out: Path = OUT
    """Folder for the scene."""

    def run(self) -> int:
        from dataclasses import replace

        from robotball import Limits, load_scene, scene_toml
        from robotball.designing import describe, redesign
        from validation.output import writable_folder, write_text
        from validation.results import changed, file_name

        scene = load_scene(self.scene)
        limits = Limits(
            rotor_speed=self.rotor_speed,
            frame_radius=self.frame_radius,
            shell_thickness=self.shell_thickness,
        )
        found, designed = redesign(scene, self.mass, limits)
        words = changed(self, "mass", "rotor_speed", "frame_radius", "shell_thickness")
        name = file_name(designed.name, None, words)
        path = writable_folder(self.out) / f"{name}.toml"
        write_text(path, scene_toml(replace(designed, name=name)))
        print(describe(found), path, sep="\n")
        return AGREES
