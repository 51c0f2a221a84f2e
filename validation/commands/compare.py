"""The command `robotball compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from robotball import InputError, load_scene
from validation.commands.arguments import (
    AGREES,
    DISAGREES,
    OUT,
    Accuracy,
    Duration,
    File,
    times_of,
)
from validation.commands.runs import tell_dumps, wanted_run
from validation.comparison.results import write_csv, write_json
from validation.comparison.runs import compare_all
from validation.comparison.table import show
from validation.output import writable_file, writable_folder


@dataclass(frozen=True)
class Compare:
    """Run scenes in both engines, side by side, and say how far apart they are."""

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="SCENE...")]]
    """Names from the catalog, or paths to TOML files."""
    preset: tuple[str, ...] = ()
    """MuJoCo settings to run each scene with: naive, fast, balanced, accurate, adaptive; balanced
    if not given."""
    accuracy: Accuracy = None
    """Instead of a preset, the path error to reach: settings are chosen for it."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    out: Path = OUT
    """Folder for the plots, and for the states around a fault."""
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
        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        scenes = [load_scene(name) for name in self.scenes]
        wanted = [
            wanted_run(name, self.accuracy, self.keep_going) for name in self.preset or (None,)
        ]
        for path in filter(None, (self.json, self.csv)):
            writable_file(path)
        writable_folder(self.out)
        times = times_of(self.duration)
        agreements = compare_all(scenes, wanted, times, strict=self.strict, dumps=self.out)
        if self.json:
            write_json(self.json, agreements)
        if self.csv:
            write_csv(self.csv, agreements)
        if self.plots:
            from validation.comparison.plots import draw  # matplotlib takes a while to come

            for scene in scenes:
                draw([each for each in agreements if each.scene is scene], self.out)
        show(agreements, Console())
        tell_dumps(agreements, self.out)
        return AGREES if all(agreement.agrees for agreement in agreements) else DISAGREES
