"""The command `robotball model`."""

import sys
from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from validation.commands.arguments import AGREES, PRESET, File, SceneName


@dataclass(frozen=True)
class Model:
    """Print a scene's MJCF: self-contained, at full precision, dressed to be looked at.

    Example: robotball model fig12 --out fig12.xml
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Annotated[str, arg(metavar=PRESET)] = "balanced"
    """The settings to write into it."""
    out: File = None
    """Write it to this file instead. Beside it go the controls, where they change in time, and a
    player."""
    bare: bool = False
    """Leave out what only a picture needs."""
    explain: bool = False
    """Say instead what a run's model leaves out, and why."""

    def run(self) -> int:
        from robotball import load_scene, preset
        from robotball.engines.mujoco.export import left_out, write_model
        from robotball.files.replacing import STANDARD_OUTPUT
        from validation.output import writable_file, write_text

        scene, settings = load_scene(self.scene), preset(self.preset)
        if self.explain:
            print(f"{scene.name}, {settings.name}: not in the model:")
            print(*(f"  {line}" for line in left_out(scene, settings)), sep="\n")
            print(f"What it would cost: robotball tradeoff {self.scene} --parts")
            return AGREES
        out = None if self.out is None else writable_file(self.out)
        in_file = out is not None and out != STANDARD_OUTPUT
        stem = out.stem if out is not None and in_file else scene.name
        files = write_model(scene, settings, dressed=not self.bare, stem=stem)
        if out is None:
            print(files.xml, end="")
        else:
            write_text(out, files.xml)
        if files.needs is not None:
            print(f"robotball: {files.needs}", file=sys.stderr)
            if out is not None and in_file:
                write_text(out.with_name(f"{stem}-play.py"), files.player)
                write_text(out.with_name(f"{stem}-controls.csv"), files.controls)
            else:
                print("robotball: --out FILE writes it beside the model", file=sys.stderr)
        return AGREES
