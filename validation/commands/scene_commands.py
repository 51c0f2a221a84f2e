"""The commands that list the catalog and write a scene for other programs."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from ..options import AGREES, PRESET, Controls, Duration, SceneName, seconds_of


@dataclass(frozen=True)
class Scenes:
    """List the scenes that come with robotball.

    Example: robotball scenes
    """

    def run(self) -> int:
        from rich import box
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from robotball.scene_files.scene_file import heads

        from ..output import print_whole

        table = Table("scene", "rolling", "duration", "title", box=box.SIMPLE_HEAD)
        for name, head in heads().items():
            table.add_row(name, head["rolling"], f"{head['duration']:g} s", escape(head["title"]))
        print_whole(table, Console())
        return AGREES


@dataclass(frozen=True)
class Export:
    """Print a scene as MJCF, or write it for other simulators: MJCF, URDF, SDF and JSON.

    Hold a trajectory of another simulator against the equations with `robotball judge`.

    Example: robotball export fig12 --to fig12-export
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    control: Controls = ()
    to: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None
    """Write all formats into this folder."""
    preset: Annotated[str, arg(metavar=PRESET)] = "balanced"
    """The settings to write into the MJCF."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""

    def run(self) -> int:
        from robotball import export_scene, preset
        from robotball.engines.mujoco.mjcf_export import write_model

        from ..output import writable_folder, write_text
        from ..results import controlled

        scene, settings = controlled(self.scene, self.control), preset(self.preset)
        scene = replace(scene, duration=seconds_of(self.duration, False, scene))
        if self.to is None:
            model = write_model(scene, settings)
            print(model.xml, end="")
            if model.needs is not None:
                print(f"robotball: {model.needs}; --to DIR writes it", file=sys.stderr)
            return AGREES
        folder = writable_folder(self.to)
        written = export_scene(scene, folder)
        if not scene.plane_moves:  # MJCF cannot say how a plane moves
            for name, text in write_model(scene, settings).files.items():
                write_text(folder / name, text)
                written.append(folder / name)
        print(*sorted(written), sep="\n")
        return AGREES
