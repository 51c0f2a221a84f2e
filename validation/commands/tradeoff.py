"""The command `robotball tradeoff`: error against time, what parts cost, what friction does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from validation.commands.arguments import (
    Duration,
    SceneName,
    Sweep,
    SweepOptions,
    seconds_of,
)

if TYPE_CHECKING:
    from robotball import Scene
    from validation.study import Study

LIMIT = 60.0  # s that a run may take
ROUNDS = 3  # of timing, after one that warms up


@dataclass(frozen=True)
class Tradeoff:
    """What accuracy costs: error against processor time, and the Pareto front.

    Example: robotball tradeoff fig12 --quick
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    parts: bool = False
    """Measure instead what a step costs with each thing that the model leaves out."""
    friction: bool = False
    """Study instead what rolling and torsional friction do to the ball."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        from robotball import InputError, load_scene
        from validation.output import writable_folder
        from validation.results import changed

        if self.parts and self.friction:
            raise InputError("tradeoff does one study at a time: give one of parts and friction")
        scene = load_scene(self.scene)
        seconds = seconds_of(self.duration, self.sweep.quick, scene)
        writable_folder(self.sweep.out)
        measure = self._parts if self.parts else self._friction if self.friction else self._front
        return self.sweep.present(measure(scene, seconds), *changed(self, "duration"))

    def _front(self, scene: Scene, seconds: float) -> Study:
        from validation.studies.tradeoff import cells_of, configurations, measure, tradeoff_study

        quick = self.sweep.quick
        cells = cells_of(self.scene, configurations(quick), seconds, 2 if quick else ROUNDS)
        return tradeoff_study(scene, self.sweep.results(measure, cells, "tradeoff", scene, LIMIT))

    def _friction(self, scene: Scene, seconds: float) -> Study:
        from validation.studies.friction import friction_cells, friction_run, friction_study

        cells = friction_cells(self.scene, seconds, self.sweep.quick)
        results = self.sweep.results(friction_run, cells, "friction", scene, LIMIT)
        return friction_study(scene, results)

    def _parts(self, scene: Scene, _seconds: float) -> Study:
        from validation.output import progress_bar
        from validation.studies.parts_cost import measure_parts

        with progress_bar(1) as show:
            return measure_parts(scene, 3 if self.sweep.quick else 15, show)
