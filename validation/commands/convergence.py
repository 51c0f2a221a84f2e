"""The command `robotball convergence`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

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
class Convergence:
    """Orders of convergence of every integrator, against the contact model's limit and theory."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: str = "accurate"
    """The settings whose contact model it is; integrator and step are swept."""
    without: Annotated[tuple[str, ...], arg(metavar="CHOICE...")] = ()
    """Choices to undo in it, as the ablation names them: softness, noslip, start, drive, …"""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    quick: bool = False
    """One simulated second and fewer steps: in a few seconds."""
    out: Path = OUT
    """Folder for the picture."""
    json: File = None
    """Also write every run, the orders and the settings."""
    csv: File = None
    """Also write the runs as CSV."""

    def run(self) -> int:
        from rich.console import Console

        from robotball import load_scene, preset, sample_times
        from validation.output import writable_folder, write_picture, write_record, write_rows
        from validation.progress import progress_bar
        from validation.studies.ablation.measure import without
        from validation.studies.convergence.measure import HALVINGS, measure_convergence
        from validation.studies.convergence.report import (
            convergence_picture,
            record,
            rows,
            show_convergence,
        )

        scene, settings = load_scene(self.scene), without(preset(self.preset), self.without)
        times = sample_times(self.duration or (QUICK if self.quick else scene.duration))
        path = writable_folder(self.out) / f"{scene.name}-convergence.png"
        check_files(self.json, self.csv)
        with progress_bar(1) as show:
            halvings = HALVINGS - 2 * self.quick
            study = measure_convergence(scene, settings, times, halvings, show)
        write_picture(path, convergence_picture(study))
        write_record(self.json, record(study))
        if self.csv:
            write_rows(self.csv, rows(study))
        show_convergence(study, Console())
        print(path)
        return AGREES
