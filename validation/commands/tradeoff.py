"""The command tradeoff: error against time over many configurations, parts and friction.

It loads what it needs when it runs: plots take a while to come.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from robotball import InputError, Scene, integrate, load_scene
from validation.commands.arguments import AGREES, Duration, SceneName, Sweep, SweepOptions
from validation.output import replacing, writable_folder, write_record, write_rows
from validation.progress import progress_bar
from validation.sweeps import Cell, Result, Work, sweep, write_table

LIMIT = 60.0  # s that a run may take
QUICK = 1.0  # s of motion in a quick study
ROUNDS = 3  # of timing, after one that warms up


@dataclass(frozen=True)
class Tradeoff:
    """What accuracy costs: error against processor time, and the front of what is best."""

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
        if self.parts and self.friction:
            raise InputError("tradeoff does one study at a time: give one of parts and friction")
        scene = load_scene(self.scene)
        writable_folder(self.sweep.out)
        study = self._parts if self.parts else self._friction if self.friction else self._front
        print(*study(scene), sep="\n")
        return AGREES

    def _front(self, scene: Scene) -> Sequence[Path]:
        from validation.studies.tradeoff.configurations import configurations
        from validation.studies.tradeoff.front import tradeoff_of
        from validation.studies.tradeoff.front_picture import tradeoff_picture
        from validation.studies.tradeoff.front_runs import cells_of, measure
        from validation.studies.tradeoff.front_table import show_tradeoff

        rounds = 2 if self.sweep.quick else ROUNDS
        settings = configurations(self.sweep.quick)
        cells = cells_of(self.scene, settings, self._seconds(scene), rounds)
        results = self._sweep(measure, cells, "tradeoff", scene)
        study = tradeoff_of(scene, results)
        picture, data = self._path(scene, "tradeoff.png"), self._path(scene, "tradeoff.json")
        with replacing(picture) as temporary:
            tradeoff_picture(study).savefig(temporary, dpi=120)
        write_record(data, study.record())
        show_tradeoff(study, Console())
        return picture, data, self._table(scene, "tradeoff", results)

    def _friction(self, scene: Scene) -> Sequence[Path]:
        from validation.studies.friction.friction import friction_cells, friction_run
        from validation.studies.friction.friction_picture import friction_picture

        cells = friction_cells(self.scene, self._seconds(scene), self.sweep.quick)
        results = self._sweep(friction_run, cells, "friction", scene)
        needed = float(integrate(scene).loads.torsional_friction.max())
        picture, data = self._path(scene, "friction.png"), self._path(scene, "friction.json")
        with replacing(picture) as temporary:
            friction_picture(scene, results, needed).savefig(temporary, dpi=120)
        runs = [asdict(result) for result in results]
        write_record(data, {"scene": scene.name, "torsional_friction_needed": needed, "runs": runs})
        return picture, data, self._table(scene, "friction", results)

    def _parts(self, scene: Scene) -> Sequence[Path]:
        from validation.studies.parts import measure_parts, parts_of

        parts, rounds = parts_of(scene), 3 if self.sweep.quick else 15
        with progress_bar((rounds + 1) * len(parts)) as show:
            costs = measure_parts(parts, rounds, lambda done: show(done, f"{scene.name}: parts"))
        table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
        table.add_column("the minimal model with", no_wrap=True)
        table.add_column("a step costs", justify="right", no_wrap=True)
        for name in ("bodies", "dofs", "sensors", "geoms"):
            table.add_column(name, justify="right")
        rows = []
        for part, cost in zip(parts, costs, strict=True):
            least, most = cost.spread
            model = part.compiled
            sizes = (model.nbody, model.nv, model.nsensor, model.ngeom)
            ratio = f"{cost.ratio:.2f} ({least:.2f}-{most:.2f})"
            table.add_row(part.name, ratio, *map(str, sizes))
            rows.append(
                {"part": part.name, "ratio": cost.ratio, "least": least, "most": most}
                | dict(zip(("bodies", "dofs", "sensors", "geoms"), sizes, strict=True))
            )
        Console().print(table)
        data, listed = self._path(scene, "parts.json"), self._path(scene, "parts.csv")
        write_record(data, {"scene": scene.name, "rounds": rounds, "parts": rows})
        write_rows(listed, rows)
        return data, listed

    def _seconds(self, scene: Scene) -> float:
        return self.duration or (QUICK if self.sweep.quick else scene.duration)

    def _path(self, scene: Scene, name: str) -> Path:
        return self.sweep.out / f"{scene.name}-{name}"

    def _sweep(self, work: Work, cells: Sequence[Cell], name: str, scene: Scene) -> list[Result]:
        with progress_bar(len(cells)) as show:
            return sweep(
                work,
                cells,
                self._path(scene, f"{name}.jsonl"),
                workers=self.sweep.workers,
                cluster=self.sweep.cluster,
                limit=LIMIT,
                show=show,
            )

    def _table(self, scene: Scene, name: str, results: Sequence[Result]) -> Path:
        path = self._path(scene, f"{name}.csv")
        write_table(path, results)
        return path
