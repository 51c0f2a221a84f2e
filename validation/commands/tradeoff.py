"""The command `robotball tradeoff`: error against time, what parts cost, what friction does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from validation.commands.arguments import (
    AGREES,
    Duration,
    SceneName,
    Sweep,
    SweepOptions,
    seconds_of,
)

if TYPE_CHECKING:
    from robotball import Scene
    from validation.sweeps import Cell, Result, Work

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

        if self.parts and self.friction:
            raise InputError("tradeoff does one study at a time: give one of parts and friction")
        scene = load_scene(self.scene)
        seconds = seconds_of(self.duration, self.sweep.quick, scene)
        writable_folder(self.sweep.out)
        study = self._parts if self.parts else self._friction if self.friction else self._front
        print(*study(scene, seconds), sep="\n")
        return AGREES

    def _front(self, scene: Scene, seconds: float) -> Sequence[Path]:
        from rich.console import Console

        from validation.output import write_picture, write_record
        from validation.studies.tradeoff import (
            cells_of,
            configurations,
            measure,
            record,
            show_tradeoff,
            tradeoff_of,
            tradeoff_picture,
        )
        from validation.sweeps import write_table

        rounds = 2 if self.sweep.quick else ROUNDS
        settings = configurations(self.sweep.quick)
        cells = cells_of(self.scene, settings, seconds, rounds)
        results = self._sweep(measure, cells, "tradeoff", scene)
        study = tradeoff_of(scene, results)
        picture, data, table = self._paths(scene, "tradeoff")
        write_picture(picture, tradeoff_picture(study))
        write_record(data, record(study))
        show_tradeoff(study, Console())
        write_table(table, results)
        return picture, data, table

    def _friction(self, scene: Scene, seconds: float) -> Sequence[Path]:
        from robotball import integrate
        from validation.output import write_picture, write_record
        from validation.studies.friction import friction_cells, friction_picture, friction_run
        from validation.sweeps import write_table

        cells = friction_cells(self.scene, seconds, self.sweep.quick)
        results = self._sweep(friction_run, cells, "friction", scene)
        needed = float(integrate(scene).loads.torsional_friction.max())
        picture, data, table = self._paths(scene, "friction")
        write_picture(picture, friction_picture(scene, results, needed))
        runs = [asdict(result) for result in results]
        write_record(data, {"scene": scene.name, "torsional_friction_needed": needed, "runs": runs})
        write_table(table, results)
        return picture, data, table

    def _parts(self, scene: Scene, _seconds: float) -> Sequence[Path]:
        from rich.console import Console

        from validation.output import progress_bar, write_record, write_rows
        from validation.studies.parts_cost import measure_parts, parts_of, rows, show_parts

        parts, rounds = parts_of(scene), 3 if self.sweep.quick else 15
        with progress_bar((rounds + 1) * len(parts)) as show:
            costs = measure_parts(parts, rounds, lambda done: show(done, f"{scene.name}: parts"))
        show_parts(parts, costs, Console())
        _, data, listed = self._paths(scene, "parts")
        write_record(data, {"scene": scene.name, "rounds": rounds, "parts": rows(parts, costs)})
        write_rows(listed, rows(parts, costs))
        return data, listed

    def _paths(self, scene: Scene, study: str) -> Sequence[Path]:
        """Of a study's picture, its data and its table."""
        from robotball.engines.mujoco import LABEL
        from validation.results import changed, file_name

        words = [study, *changed(self, "duration"), *changed(self.sweep, "quick")]
        stem = file_name(scene.name, LABEL, words)
        return [self.sweep.out / f"{stem}.{end}" for end in ("png", "json", "csv")]

    def _sweep(self, work: Work, cells: Sequence[Cell], name: str, scene: Scene) -> list[Result]:
        from validation.output import progress_bar
        from validation.sweeps import sweep

        with progress_bar(len(cells)) as show:
            return sweep(
                work,
                cells,
                self.sweep.out / f"{scene.name}-{name}.jsonl",
                workers=self.sweep.workers,
                cluster=self.sweep.cluster,
                limit=LIMIT,
                show=show,
            )
