"""The command `robotball convergence`."""

from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import arg

from validation.commands.arguments import (
    AGREES,
    PRESET,
    Names,
    SceneName,
    Study,
    StudyOptions,
    listed,
)

MODEL = "accurate"


@dataclass(frozen=True)
class Convergence:
    """Orders of convergence of every integrator, against the contact model's limit and theory.

    Example: robotball convergence fig12 --quick --without softness,noslip
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Annotated[str, arg(metavar=PRESET)] = MODEL
    """The settings whose contact model it is; integrator and step are swept."""
    without: Names = ()
    """Choices of the ablation to undo in it. Several: softness,noslip. There are
    drive, friction, cone, root, integrator, start, softness, noslip, solver, timestep."""
    study: StudyOptions = field(default_factory=Study)

    def run(self) -> int:
        from rich.console import Console

        from robotball import load_scene, preset
        from robotball.engines.mujoco import LABEL
        from validation.output import (
            progress_bar,
            writable_folder,
            write_picture,
            write_record,
            write_rows,
        )
        from validation.results import changed, file_name
        from validation.studies import convergence as report
        from validation.studies.ablation import without
        from validation.studies.convergence import HALVINGS, measure_convergence

        options, scene = self.study, load_scene(self.scene)
        settings = without(preset(self.preset), listed(self.without))
        times, out = options.times(scene), writable_folder(options.out)
        with progress_bar(1) as show:
            halvings = HALVINGS - 2 * options.quick
            study = measure_convergence(scene, settings, times, halvings, show)
        words = [settings.name, "convergence", *changed(options, "duration", "quick")]
        picture = report.convergence_picture(study)
        path = write_picture(out / f"{file_name(scene.name, LABEL, words)}.png", picture)
        write_record(options.json, report.record(study))
        if options.csv:
            write_rows(options.csv, report.rows(study))
        report.show_convergence(study, Console())
        print(path)
        return AGREES
