"""The command `robotball convergence`."""

from dataclasses import dataclass, field

from validation.commands.arguments import AGREES, Names, SceneName, Study, StudyOptions, listed


@dataclass(frozen=True)
class Convergence:
    """Orders of convergence of every integrator, against the contact model's limit and theory."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: str = "accurate"
    """The settings whose contact model it is; integrator and step are swept."""
    without: Names = ()
    """Choices to undo in it, as the ablation names them: softness, noslip, start, drive, …
    Several: softness,noslip."""
    study: StudyOptions = field(default_factory=Study)

    def run(self) -> int:
        from rich.console import Console

        from robotball import load_scene, preset
        from validation.output import writable_folder, write_picture, write_record, write_rows
        from validation.progress import progress_bar
        from validation.studies import convergence_report as report
        from validation.studies.ablation import without
        from validation.studies.convergence import HALVINGS, measure_convergence

        options, scene = self.study, load_scene(self.scene)
        settings = without(preset(self.preset), listed(self.without))
        times, out = options.times(scene), writable_folder(options.out)
        with progress_bar(1) as show:
            halvings = HALVINGS - 2 * options.quick
            study = measure_convergence(scene, settings, times, halvings, show)
        picture = report.convergence_picture(study)
        path = write_picture(out / f"{scene.name}-convergence.png", picture)
        write_record(options.json, report.record(study))
        if options.csv:
            write_rows(options.csv, report.rows(study))
        report.show_convergence(study, Console())
        print(path)
        return AGREES
