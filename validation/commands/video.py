"""The command `robotball video`."""

from dataclasses import dataclass
from pathlib import Path

from validation.commands.arguments import (
    AGREES,
    DISAGREES,
    OUT,
    Accuracy,
    Duration,
    EngineName,
    Preset,
    SceneName,
    times_of,
)


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of an engine beside the ball of the equations, as an mp4."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Preset = None
    """The engine's settings to run it with; balanced if not given."""
    engine: EngineName = "mujoco"
    """The engine; `robotball engines` lists them."""
    accuracy: Accuracy = None
    """Instead of a preset, the path error to reach: settings are chosen for it."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    out: Path = OUT
    """Folder for the video, and for the fault window of a faulty run."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""

    def run(self) -> int:
        from robotball import load_scene
        from robotball.engines.simulate import request_of
        from validation.commands.runs import tell_fault_windows
        from validation.comparison.runs import compare_all, film
        from validation.output import writable_folder

        scene = load_scene(self.scene)
        request = request_of(self.engine, self.preset, self.accuracy, keep_going=self.keep_going)
        path = writable_folder(self.out) / f"{scene.name}.mp4"
        agreements = compare_all(
            [scene], [request], times_of(self.duration), strict=self.strict, fault_windows=self.out
        )
        (agreement,) = agreements
        tell_fault_windows(agreements, self.out)
        film(path, agreement)
        print(path)
        return AGREES if agreement.agrees else DISAGREES
