"""The commands that list the catalog and write a scene for other programs."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from validation.options import AGREES, OUT, PRESET, Controls, Duration, File, SceneName, times_of


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

        from robotball.files.scene_file import heads
        from validation.output import print_whole

        table = Table("scene", "rolling", "duration", "title", box=box.SIMPLE_HEAD)
        for name, head in heads().items():
            table.add_row(name, head["rolling"], f"{head['duration']:g} s", escape(head["title"]))
        print_whole(table, Console())
        return AGREES


@dataclass(frozen=True)
class Model:
    """Print a scene's MJCF: self-contained, at full precision, dressed to be looked at.

    Example: robotball model fig12 --out fig12.xml
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    control: Controls = ()
    preset: Annotated[str, arg(metavar=PRESET)] = "balanced"
    """The settings to write into it."""
    out: File = None
    """Write it to this file, and beside it a player and its controls where it needs them."""
    bare: bool = False
    """Leave out what only a picture needs."""
    explain: bool = False
    """Say instead what a run's model leaves out, and why."""

    def run(self) -> int:
        from robotball import InputError, preset
        from robotball.engines.mujoco.mjcf_export import left_out, write_model
        from robotball.files.replacing import STANDARD_OUTPUT
        from validation.output import write_text
        from validation.results import controlled

        scene, settings = controlled(self.scene, self.control), preset(self.preset)
        if self.explain:
            print(f"{scene.name}, {settings.name}: not in the model:")
            print(*(f"  {line}" for line in left_out(scene, settings)), sep="\n")
            return AGREES
        out = self.out
        if out and out != STANDARD_OUTPUT and out.suffix.lower() not in (".xml", ".mjcf"):
            raise InputError(
                f"{out}: a model is MJCF, in a file whose name ends in .xml or .mjcf; "
                "`robotball export` writes URDF, SDF and JSON"
            )
        file = None if out == STANDARD_OUTPUT else out
        stem = file.stem if file else scene.name
        files = write_model(scene, settings, dressed=not self.bare, stem=stem)
        if out:
            write_text(out, files.xml)
        else:
            # As it is, for a pipe: no line of ours may stand in the XML.
            print(files.xml, end="")
        # MJCF has neither controls that change nor the hard contact, so a script has them.
        if files.needs is not None:
            print(f"robotball: {files.needs}", file=sys.stderr)
            if file:
                write_text(file.with_name(f"{stem}-play.py"), files.player)
                write_text(file.with_name(f"{stem}-controls.csv"), files.controls)
            else:
                print("robotball: --out FILE writes it beside the model", file=sys.stderr)
        return AGREES


@dataclass(frozen=True)
class Export:
    """Write what another simulator needs of a scene: JSON, MJCF, URDF, SDF, conventions.

    Its trajectory is then held against the equations by `robotball judge`.

    Example: robotball export fig12 --to fig12-export
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    control: Controls = ()
    to: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None
    """The folder for the files; out/SCENE-export if not given."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""

    def run(self) -> int:
        from robotball import export_scene
        from validation.output import writable_folder
        from validation.results import changed, controlled, file_name

        scene = controlled(self.scene, self.control)
        times = times_of(self.duration)
        name = file_name(scene.name, None, ["export", *changed(self, "duration")])
        folder = writable_folder(self.to or OUT / name)
        for path in export_scene(scene, folder, times):
            print(path)
        return AGREES
