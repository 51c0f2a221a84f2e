"""Every export as every engine's importer reads it, and where the fault of a wrong number lies."""

import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.markup import escape
from tyro.conf import Positional, arg

from robotball import Scene, export_scene, load_scene
from robotball.engines.environments import ENVIRONMENTS, call
from robotball.robot import Solid
from validation.options import Names, Sweep, SweepOptions, chosen, listed
from validation.output import writable_folder
from validation.studies import importer_readings
from validation.studies.engine_runs import check_installed, contestants, python_of
from validation.studies.importer_readings import FILES, IMPORTERS, plain
from validation.study import Column, Row, Study, table_of
from validation.sweeps import Cell, Result

# Between them they have inertia about skew axes, a plane that is inclined, armatures, and bodies
# off centre.
_SCENES = ("fig12", "inclined_plane", "steered_pendulum_robot")
_TIMES = np.linspace(0.0, 0.1, 3)  # s, of a motion that no importer reads
_RIGHT = 1e-6  # relative: single precision is right, and nothing else that was seen is so near
_LIMIT = 120.0  # s that a reading may take
CHECKED = ("mass", "centre", "inertia", "axes", "gravity", "armature", "freedoms")
# What a format has no word for; importers then have a value of their own.
_UNSAID = {"URDF": {"gravity", "armature"}, "SDF": {"armature"}}


def read(cell: Cell) -> dict[str, Any]:
    """Read a cell's text in a process of its own."""
    return call(cell["interpreter"], importer_readings.read, dict(cell))


def cells_of(scenes: Sequence[Scene], engines: Collection[str], folder: Path) -> list[Cell]:
    """Return every reading of the scenes' exports by the engines that are there."""
    cells: list[Cell] = []
    known = contestants()
    pythons = {each: python_of(known[each], folder) for each in engines}
    for scene in scenes:
        with tempfile.TemporaryDirectory() as place:
            export_scene(scene, place, _TIMES)
            texts = {form: (Path(place) / name).read_text("utf-8") for form, name in FILES.items()}
        cells += [
            {"importer": name, "engine": engine, "interpreter": str(python),
             "scene": scene.name, "format": form, "text": texts[form]}
            for name, (_, formats) in IMPORTERS.items()
            if (python := pythons.get(engine := name.partition(",")[0]))
            for form in formats
        ]  # fmt: skip
    return cells


def errors_of(scene: Scene, form: str, found: Mapping[str, Any]) -> dict[str, float]:
    """Return the relative errors of a reading in this format against the scene itself.

    That of the centre is over the radius. What the scene or the format does not have is left out.
    """
    bodies = [Solid(each.mass, each.centre, each.inertia) for _, each in scene.ball.named_bodies]
    hinges = {
        hinge.name: (hinge.axis, hinge.motor.armature if hinge.motor else 0.0)
        for hinge in scene.hinges
    }
    own = plain(np.eye(3), np.zeros(3), bodies, hinges, scene.gravity_world, 6 + len(hinges))
    errors = {}
    for name in (name for name in CHECKED if name not in _UNSAID.get(form, ())):
        ours, theirs = own[name], found[name]
        if isinstance(ours, dict):
            theirs = [theirs.get(hinge, np.zeros_like(each)) for hinge, each in ours.items()]
            ours = [*ours.values()]
        size = scene.ball.radius if name == "centre" else np.abs(ours).max()
        if size:
            errors[name] = float(np.abs(np.subtract(theirs, ours)).max() / size)
    return errors


def rows_of(scenes: Sequence[Scene], results: Sequence[Result]) -> list[Row]:
    """Return a row for each importer and format, with its largest errors over the scenes.

    `fault` has what is wrong: with the importer, where another reads it right from the same file,
    else with the file or with all who read it.
    """
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    of = {scene.name: scene for scene in scenes}
    for cell, record, failure in ((each.cell, each.record, each.failure) for each in results):
        form, name = cell["format"], cell["importer"]
        row = rows.setdefault((form, name), {"title": f"{form}, {name}", "fault": ""})
        row["fault"] = row["fault"] or failure or ""
        if record:
            row["title"] = ", ".join([form, record["by"], *name.split(", ")[1:]])
            for what, error in errors_of(of[cell["scene"]], form, record).items():
                row[what] = max(error, row.get(what, 0.0))
    for (form, importer), row in rows.items():
        whose: dict[str, list[str]] = {"importer": [], "file or all": []}
        for name in CHECKED:
            if row.get(name, 0.0) > _RIGHT:
                others = (rows[key] for key in rows if key[0] == form and key[1] != importer)
                right = any(each.get(name, np.inf) <= _RIGHT for each in others)
                whose["importer" if right else "file or all"].append(name)
        found = (f"{part}: {', '.join(names)}" for part, names in whose.items() if names)
        row["fault"] = row["fault"] or "; ".join(found)
    return [rows[key] for key in sorted(rows, key=lambda key: [*FILES].index(key[0]))]


_COLUMNS = (
    Column("format, importer", "title", words=True),
    *(Column(name, name) for name in CHECKED),
    Column("fault", "fault", words=True),
)
_NOTE = (
    "Relative errors, the largest over the scenes. - the format has no word for it, or no scene\n"
    "has it. A fault is the importer's where another one reads that number right in the same file."
)


@dataclass(frozen=True)
class Importers:
    """Hold each export, as each engine's importer reads it, against the scene.

    Example: robotball importers fig12 --only mujoco
    """

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="[SCENE…]")]] = _SCENES
    """Names from the catalog, or paths to TOML, MJCF or URDF files."""
    only: Names = ()
    """Engines whose importers to try; all that are there if not given. Several: drake,bullet."""
    environments: Path = ENVIRONMENTS
    """Folder of the engines' environments, which `robotball engines --install` makes."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        known, only = contestants(), listed(self.only)
        importing = dict.fromkeys(name.partition(",")[0] for name in IMPORTERS)
        some = chosen("engine", only, {name: known[name] for name in importing})
        if only:
            check_installed(some, self.environments)
        names = dict.fromkeys(self.scenes[:1] if self.sweep.quick else self.scenes)
        scenes = [load_scene(name) for name in names]
        writable_folder(self.sweep.out)
        cells = cells_of(scenes, {"multibody", *(each.name for each in some)}, self.environments)
        rows = rows_of(scenes, self.sweep.results(read, cells, "importers", _LIMIT))
        title = " ".join(scene.name for scene in scenes)
        table = table_of(_COLUMNS, rows, lambda row: row["fault"])
        words = ["importers", *only]
        study = Study(title, None, words, rows, {"rows": rows}, (escape(title), table, _NOTE))
        return self.sweep.present(study)
