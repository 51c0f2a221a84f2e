"""The command `robotball export`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from validation.commands.arguments import AGREES, OUT, Duration, SceneName, times_of


@dataclass(frozen=True)
class Export:
    """Write what another simulator needs of a scene: JSON, MJCF, URDF, SDF, conventions.

    Its trajectory is then held against the equations by `robotball judge`.

    Example: robotball export fig12 --to fig12-export
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    to: Annotated[Path | None, arg(metavar="DIR")] = None
    """The folder for the files; out/SCENE-export if not given."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""

    def run(self) -> int:
        from robotball import export_scene, load_scene
        from validation.output import writable_folder
        from validation.results import changed, file_name

        scene = load_scene(self.scene)
        times = times_of(self.duration)
        name = file_name(scene.name, None, ["export", *changed(self, "duration")])
        folder = writable_folder(self.to or OUT / name)
        for path in export_scene(scene, folder, times):
            print(path)
        return AGREES
