"""The commands about what accuracy costs: ladder, convergence.

They load what they need when they run: plots take a while to come.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import arg

from robotball import Scene, load_scene, preset, sample_times
from validation.commands.arguments import AGREES, OUT, Duration, File, SceneName
from validation.results import (
    replacing,
    writable_file,
    writable_folder,
    write_record,
    write_rows,
)
from validation.runs import progress_bar

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
        from validation.tradeoffs.ladder import ROUNDS, measure_ladder
        from validation.tradeoffs.ladder_picture import ladder_picture
        from validation.tradeoffs.ladder_table import show_ladder

        scene = load_scene(self.scene)
        times = sample_times(duration_of(self, scene))
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


@dataclass(frozen=True)
class Convergence:
    """Orders of convergence of every integrator, against the contact model's limit and theory."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: str = "accurate"
    """The MuJoCo settings whose contact model it is; integrator and step are swept."""
    without: Annotated[tuple[str, ...], arg(metavar="CHOICE...")] = ()
    """Choices to undo in it, as the ladder names them: softness, noslip, start, drive and more."""
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
        from validation.tradeoffs.choices import without
        from validation.tradeoffs.convergence_picture import convergence_picture
        from validation.tradeoffs.convergence_runs import HALVINGS, measure_convergence
        from validation.tradeoffs.convergence_table import show_convergence

        scene, settings = load_scene(self.scene), without(preset(self.preset), self.without)
        times = sample_times(duration_of(self, scene))
        path = writable_folder(self.out) / f"{scene.name}-convergence.png"
        check_files(self.json, self.csv)
        with progress_bar(1) as show:
            halvings = HALVINGS - 2 * self.quick
            study = measure_convergence(scene, settings, times, halvings, show)
        with replacing(path) as temporary:
            convergence_picture(study).savefig(temporary, dpi=120)
        write_record(self.json, study.record())
        if self.csv:
            write_rows(self.csv, study.rows())
        show_convergence(study, Console())
        print(path)
        return AGREES


def duration_of(command: Ladder | Convergence, scene: Scene) -> float:
    """The duration that is asked for [s], or what the command takes by itself."""
    if command.duration is not None:
        return command.duration
    return QUICK if command.quick else scene.duration


def check_files(*paths: Path | None) -> None:
    """Raise InputError, before any work, for a path that cannot be written."""
    for path in filter(None, paths):
        writable_file(path)
