"""The command `robotball ablation`."""

from dataclasses import dataclass, field

from validation.commands.arguments import AGREES, SceneName, Study, StudyOptions


@dataclass(frozen=True)
class Ablation:
    """The error budget: from the naive model to the recipe choice by choice, and each undone.

    Example: robotball ablation fig12 --quick
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    study: StudyOptions = field(default_factory=Study)

    def run(self) -> int:
        from rich.console import Console

        from robotball import load_scene
        from robotball.engines.mujoco import LABEL
        from validation.output import (
            progress_bar,
            writable_folder,
            write_picture,
            write_record,
            write_rows,
        )
        from validation.results import changed, file_name
        from validation.studies.ablation import (
            ROUNDS,
            ablation_picture,
            measure_ablation,
            show_ablation,
        )

        options, scene = self.study, load_scene(self.scene)
        times, out = options.times(scene), writable_folder(options.out)
        with progress_bar(1) as show:
            study = measure_ablation(scene, times, 2 if options.quick else ROUNDS, show)
        name = file_name(scene.name, LABEL, ["ablation", *changed(options, "duration", "quick")])
        path = write_picture(out / f"{name}.png", ablation_picture(study))
        write_record(options.json, study.record())
        if options.csv:
            write_rows(options.csv, study.rows())
        show_ablation(study, Console())
        print(path)
        return AGREES
