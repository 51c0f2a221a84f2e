"""The command `robotball engines`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from validation.commands.arguments import (
    AGREES,
    Duration,
    Names,
    Sweep,
    SweepOptions,
    listed,
    seconds_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from validation.studies.engine_runs import Contestant

LIMIT = 300.0  # s that a run may take
ROUNDS = 3  # of timing


@dataclass(frozen=True)
class Engines:
    """List the engines and their presets; of scenes, each engine's error against its cost.

    Example: robotball engines fig12 --only mujoco --quick
    """

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="[SCENE…]")]] = ()
    """Names from the catalog, or paths to TOML files; without any the engines are listed."""
    only: Names = ()
    """Engines to run; all that are there if not given. Several: drake,bullet."""
    install: Names = ()
    """Make environments of their own for these engines first, by pip. Several: drake,bullet."""
    environments: Path = Path("out/engines")
    """Folder for the environments."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        from validation.output import writable_folder
        from validation.studies.engine_runs import contestants, install

        known = contestants()
        for each in _chosen(known, listed(self.install)) if self.install else ():
            print(install(each, writable_folder(self.environments)))
        chosen = _chosen(known, listed(self.only) or tuple(known))
        if not self.scenes:
            if not self.install:
                _list(chosen, self.environments)
            return AGREES
        writable_folder(self.sweep.out)
        for name in self.scenes:
            self._study(name, chosen)
        return AGREES

    def _study(self, name: str, chosen: Sequence[Contestant]) -> None:
        from robotball import load_scene
        from validation.results import changed
        from validation.studies.engine_study import cells_of, engines_study, measure

        scene, quick = load_scene(name), self.sweep.quick
        seconds = seconds_of(self.duration, quick, scene)
        cells = cells_of(name, chosen, self.environments, seconds, 1 if quick else ROUNDS)
        results = self.sweep.results(measure, cells, "engines", scene, LIMIT)
        study = engines_study(scene, results, listed(self.only))
        self.sweep.present(study, *changed(self, "duration"))


def _chosen(known: dict[str, Contestant], names: tuple[str, ...]) -> list[Contestant]:
    from robotball.errors import unknown

    for name in names:
        if name not in known:
            raise unknown("engine", name, known)
    return [known[name] for name in names]


def _list(chosen: Sequence[Contestant], environments: Path) -> None:
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from robotball import InputError, engine_named, engine_names
    from validation.output import print_whole
    from validation.studies.engine_runs import python_of

    table = Table("engine", "name", "version", "presets", "runs in", box=box.SIMPLE_HEAD)
    there = {each.engine for each in chosen}
    for each in chosen:
        engine, python = engine_named(each.engine), python_of(each, environments)
        place = "nowhere: not installed" if python is None else str(python.parents[1])
        here = each.name == each.engine and python == Path(sys.executable)
        version = engine.label.version if here else "-"
        presets = ", ".join(engine.presets)
        table.add_row(*map(escape, (each.name, engine.label.name, version, presets, place)))
    for key in engine_names():
        if key not in there:
            try:
                engine_named(key)
            except InputError as error:
                table.add_row(escape(key), "-", "-", escape(str(error)), "-")
    print_whole(table, Console())
