"""The command `robotball convergence`."""

from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import arg

from validation.commands.arguments import (
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
        from robotball import load_scene, preset
        from validation.output import progress_bar
        from validation.studies.ablation import without
        from validation.studies.convergence import HALVINGS, convergence_study, measure_convergence

        scene = load_scene(self.scene)
        settings = without(preset(self.preset), listed(self.without))
        times, halvings = self.study.times(scene), HALVINGS - 2 * self.study.quick
        with progress_bar(1) as show:
            measured = measure_convergence(scene, settings, times, halvings, show)
        return self.study.present(convergence_study(measured))
