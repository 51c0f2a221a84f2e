"""The command `robotball compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from validation.commands.arguments import (
    AGREES,
    DISAGREES,
    OUT,
    Accuracy,
    Duration,
    EngineName,
    File,
    check_files,
    times_of,
)


@dataclass(frozen=True)
class Compare:
    """Run scenes by an engine and by the equations, and say how far apart they are."""

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="SCENE...")]]
    """Names from the catalog, or paths to TOML files."""
    preset: tuple[str, ...] = ()
    """The engine's settings to run each scene with, such as naive, fast, balanced, accurate or
    adaptive; balanced if not given."""
    engine: EngineName = "mujoco"
    """The engine; `robotball engines` lists them."""
    accuracy: Accuracy = None
    """Instead of a preset, the path error to reach: settings are chosen for it."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    out: Path = OUT
    """Folder for the plots, and for the fault windows of faulty runs."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""
    plots: bool = True
    """Draw each scene's paths and momentum into the output folder."""
    json: File = None
    """Also write the results as a list of objects, one a scene and preset."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        from rich.console import Console

        from robotball import InputError, load_scene
        from robotball.engines.simulate import request_of
        from validation.commands.runs import tell_fault_windows
        from validation.comparison.results import write_csv, write_json
        from validation.comparison.runs import compare_all
        from validation.comparison.table import show
        from validation.output import writable_folder

        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        scenes = [load_scene(name) for name in self.scenes]
        requests = [
            request_of(self.engine, name, self.accuracy, keep_going=self.keep_going)
            for name in self.preset or (None,)
        ]
        check_files(self.json, self.csv)
        writable_folder(self.out)
        agreements = compare_all(
            scenes,
            requests,
            times_of(self.duration),
            strict=self.strict,
            fault_windows=self.out,
        )
        if self.json:
            write_json(self.json, agreements)
        if self.csv:
            write_csv(self.csv, agreements)
        if self.plots:
            from validation.comparison.plots import draw

            for scene in scenes:
                draw([each for each in agreements if each.scene is scene], self.out)
        show(agreements, Console())
        tell_fault_windows(agreements, self.out)
        return AGREES if all(agreement.agrees for agreement in agreements) else DISAGREES
