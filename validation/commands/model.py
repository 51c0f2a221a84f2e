"""The command `robotball model`."""

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from validation.commands.arguments import AGREES, PRESET, File, SceneName


@dataclass(frozen=True)
class Model:
    """Print a scene's MJCF: self-contained, at full precision.

    Example: robotball model fig12 --out fig12.xml
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Annotated[str, arg(metavar=PRESET)] = "balanced"
    """The settings to write into it."""
    out: File = None
    """Write it to this file instead."""
    explain: bool = False
    """Say instead what the model leaves out, and why."""

    def run(self) -> int:
        from robotball import load_scene, preset
        from robotball.engines.mujoco.explain import left_out
        from robotball.engines.mujoco.model import build
        from validation.output import writable_file, write_text

        scene, settings = load_scene(self.scene), preset(self.preset)
        if self.explain:
            print(f"{scene.name}, {settings.name}: not in the model:")
            print(*(f"  {line}" for line in left_out(scene, settings)), sep="\n")
            print(f"What it would cost: robotball tradeoff {self.scene} --parts")
            return AGREES
        xml = build(scene, settings).xml
        if self.out is None:
            print(xml)
        else:
            write_text(writable_file(self.out), xml)
        return AGREES
