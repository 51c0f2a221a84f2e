"""The command `robotball ladder`."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from robotball import load_scene, sample_times
from validation.commands.arguments import AGREES, OUT, Duration, File, SceneName, check_files
from validation.output import replacing, writable_folder, write_record, write_rows
from validation.progress import progress_bar

QUICK = 1.0  # s, simulated by a quick form


@dataclass(frozen=True)
class Ladder:
    """The error budget: from the naive model to the recipe choice by choice, and each undone."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    quick: bool = False
    """One simulated second, timed twice: in a few seconds."""
    out: Path = OUT
    """Folder for the picture."""
    json: File = None
    """Also write every rung with its settings and faults."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        from validation.studies.ablation.ladder import ROUNDS, measure_ladder
        from validation.studies.ablation.ladder_picture import ladder_picture
        from validation.studies.ablation.ladder_table import show_ladder

        scene = load_scene(self.scene)
        times = sample_times(self.duration or (QUICK if self.quick else scene.duration))
        path = writable_folder(self.out) / f"{scene.name}-ladder.png"
        check_files(self.json, self.csv)
        with progress_bar(1) as show:
            ladder = measure_ladder(scene, times, 2 if self.quick else ROUNDS, show)
        with replacing(path) as temporary:
            ladder_picture(ladder).savefig(temporary, dpi=120)
        write_record(self.json, ladder.record())
        if self.csv:
            write_rows(self.csv, ladder.rows())
        show_ladder(ladder, Console())
        print(path)
        return AGREES
