"""The command `robotball video`."""

from dataclasses import dataclass
from pathlib import Path

from robotball import load_scene
from validation.commands.arguments import (
    AGREES,
    DISAGREES,
    OUT,
    Accuracy,
    Duration,
    Preset,
    SceneName,
    times_of,
)
from validation.commands.runs import tell_dumps, wanted_run
from validation.comparison.runs import compare_all, film
from validation.output import writable_folder


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of MuJoCo beside the ball of the equations, as an mp4."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Preset = None
    """MuJoCo settings to run it with; balanced if not given."""
    accuracy: Accuracy = None
    """Instead of a preset, the path error to reach: settings are chosen for it."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    out: Path = OUT
    """Folder for the video, and for the states around a fault."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""

    def run(self) -> int:
        scene = load_scene(self.scene)
        wanted = wanted_run(self.preset, self.accuracy, self.keep_going)
        times = times_of(self.duration)
        path = writable_folder(self.out) / f"{scene.name}.mp4"
        agreements = compare_all([scene], [wanted], times, strict=self.strict, dumps=self.out)
        (agreement,) = agreements
        tell_dumps(agreements, self.out)
        film(path, agreement)
        print(path)
        return AGREES if agreement.agrees else DISAGREES
