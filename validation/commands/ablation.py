"""The command `robotball ablation`."""

from dataclasses import dataclass
from pathlib import Path

from validation.commands.arguments import (
    AGREES,
    OUT,
    QUICK,
    Duration,
    File,
    SceneName,
    check_files,
)


@dataclass(frozen=True)
class Ablation:
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
    """Also write every variant with its settings and faults."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        from rich.console import Console

        from robotball import load_scene, sample_times
        from validation.output import writable_folder, write_picture, write_record, write_rows
        from validation.progress import progress_bar
        from validation.studies.ablation.measure import ROUNDS, measure_ablation
        from validation.studies.ablation.report import ablation_picture, show_ablation

        scene = load_scene(self.scene)
        times = sample_times(self.duration or (QUICK if self.quick else scene.duration))
        path = writable_folder(self.out) / f"{scene.name}-ablation.png"
        check_files(self.json, self.csv)
        with progress_bar(1) as show:
            study = measure_ablation(scene, times, 2 if self.quick else ROUNDS, show)
        write_picture(path, ablation_picture(study))
        write_record(self.json, study.record())
        if self.csv:
            write_rows(self.csv, study.rows())
        show_ablation(study, Console())
        print(path)
        return AGREES
