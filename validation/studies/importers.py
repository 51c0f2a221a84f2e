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
from robotball.engines.environments import call
from robotball.robot import Solid, composed
from validation.options import AGREES, Names, Sweep, SweepOptions, chosen, listed
from validation.output import writable_folder
from validation.studies.engine_runs import contestants, python_of
from validation.studies.importer_readings import FILES, IMPORTERS, reading
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
    return call(cell["interpreter"], reading, dict(cell))


def cells_of(scenes: Sequence[Scene], engines: Collection[str], folder: Path) -> list[Cell]:
    """Return every reading of the scenes' exports by the engines that are there."""
    cells: list[Cell] = []
    for scene in scenes:
        with tempfile.TemporaryDirectory() as place:
            export_scene(scene, place, _TIMES)
            texts = {form: (Path(place) / name).read_text("utf-8") for form, name in FILES.items()}
        for name, (_, formats) in IMPORTERS.items():
            engine = name.partition(",")[0]
            python = python_of(contestants()[engine], folder) if engine in engines else None
            for form in formats if python else ():
                who = {"importer": name, "engine": engine, "interpreter": str(python)}
                what = {"scene": scene.name, "format": form, "text": texts[form]}
                cells.append({**who, **what})
    return cells


def errors_of(scene: Scene, form: str, found: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the relative errors of a reading in this format against the scene itself.

    That of the centre is over the radius; None where the scene or the format has no such number.
    """
    ball, hinges = scene.ball, scene.hinges
    whole = composed(Solid(each.mass, each.centre, each.inertia) for _, each in ball.named_bodies)
    ours = {
        "mass": whole.mass,
        "centre": whole.centre,
        "inertia": whole.inertia,
        "axes": [hinge.axis for hinge in hinges],
        "gravity": scene.gravity_world,
        "armature": [hinge.motor.armature if hinge.motor else 0.0 for hinge in hinges],
        "freedoms": 6 + len(hinges),
    }
    theirs = {
        **found,
        "axes": [found["axes"].get(hinge.name, [0.0] * 3) for hinge in hinges],
        "armature": [found["armatures"].get(hinge.name, 0.0) for hinge in hinges],
    }
    errors: dict[str, float | None] = {}
    for name, right in ours.items():
        size = ball.radius if name == "centre" else np.abs(right).max()
        off = np.abs(np.subtract(theirs[name], right)).max()
        errors[name] = float(off / size) if size and name not in _UNSAID.get(form, ()) else None
    return errors


def rows_of(scenes: Sequence[Scene], results: Sequence[Result]) -> list[Row]:
    """Return a row for each importer and format, with its largest errors over the scenes.

    `fault` has what is wrong: with the importer, where another reads it right from the same file,
    else with the file or with all who read it.
    """
    found: dict[tuple[str, str], list[Row]] = {}
    of = {scene.name: scene for scene in scenes}
    for cell, record, failure in ((each.cell, each.record, each.failure) for each in results):
        row: Row = {"by": cell["importer"], "failure": failure}
        if record:
            errors = errors_of(of[cell["scene"]], cell["format"], record)
            row = {"by": ", ".join([record["by"], *cell["importer"].split(", ")[1:]]), **errors}
        found.setdefault((cell["format"], cell["importer"]), []).append(row)
    rows = []
    for (form, _), each in sorted(found.items(), key=lambda item: [*FILES].index(item[0][0])):
        known = {name: [row[name] for row in each if row.get(name) is not None] for name in CHECKED}
        worst = {name: max(values) if values else None for name, values in known.items()}
        why = next((row["failure"] for row in each if row.get("failure")), "")
        rows.append({"title": f"{form}, {each[-1]['by']}", "format": form, **worst, "fault": why})
    for row in rows:
        wrong = [name for name in CHECKED if row[name] is not None and not _right(row[name])]
        others = [other for other in rows if other["format"] == row["format"] and other != row]
        right = {name for other in others for name in CHECKED if _right(other[name])}
        mine = [name for name in wrong if name in right]
        parts = {"importer": mine, "file or all": [name for name in wrong if name not in mine]}
        row["fault"] = row["fault"] or "; ".join(
            f"{whose}: {', '.join(names)}" for whose, names in parts.items() if names
        )
    return rows


def _right(error: float | None) -> bool:
    return error is not None and error <= _RIGHT


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
    environments: Path = Path("out/engines")
    """Folder of the engines' environments, which `robotball engines --install` makes."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        known = {engine: engine for engine in (name.partition(",")[0] for name in IMPORTERS)}
        engines = {*chosen("engine", listed(self.only), known), "multibody"}
        names = dict.fromkeys(self.scenes[:1] if self.sweep.quick else self.scenes)
        scenes = [load_scene(name) for name in names]
        writable_folder(self.sweep.out)
        cells = cells_of(scenes, engines, self.environments)
        results = self.sweep.results(read, cells, "importers", _LIMIT)
        rows = rows_of(scenes, results)
        title = " ".join(scene.name for scene in scenes)
        words = ["importers", *listed(self.only)]
        shown = (f"[bold]{escape(title)}[/]", table_of(_COLUMNS, rows, _doubtful), _NOTE)
        self.sweep.present(Study(title, None, words, rows, {"rows": rows}, shown))
        return AGREES


def _doubtful(row: Row) -> bool:
    return bool(row["fault"])
