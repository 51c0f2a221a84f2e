"""The command `robotball ablation`."""

from dataclasses import dataclass, field

from validation.commands.arguments import SceneName, Study, StudyOptions


@dataclass(frozen=True)
class Ablation:
    """The error budget: from the naive model to the recipe choice by choice, and each undone.

    Example: robotball ablation fig12 --quick
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    study: StudyOptions = field(default_factory=Study)

    def run(self) -> int:
        from robotball import load_scene
        from validation.output import progress_bar
        from validation.studies.ablation import ROUNDS, measure_ablation

        scene = load_scene(self.scene)
        times = self.study.times(scene)
        with progress_bar(1) as show:
            study = measure_ablation(scene, times, 2 if self.study.quick else ROUNDS, show)
        return self.study.present(study)
