"""The commands that compare an engine's motion with the equations': `compare`, `demo`.

Imports stand within the functions: drawing begins in other processes before the slow ones.
"""

import sys
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from ..options import (
    AGREES,
    BAD_INPUT,
    DISAGREES,
    OUT,
    Cluster,
    ControllerName,
    Controls,
    File,
    Given,
    Names,
    Run,
    RunOptions,
    Several,
    Threads,
    listed,
    seconds_of,
    times_of,
)

_DEMO_SCENES = ("fig12", "classical_regular")
_SHOWN = ("naive", "balanced")  # on the page and in the film: what a wrong setting looks like


@dataclass(frozen=True)
class Compare:
    """Run scenes by an engine and by the equations, and say how far apart they are.

    Example: robotball compare fig12 --preset fast,accurate
    """

    scenes: Annotated[Several, arg(metavar="SCENE...")]
    """Names from the catalog, or paths to TOML, MJCF or URDF files."""
    preset: Names = ()
    """The engine's settings to run each scene with. Several: naive,fast. There are
    naive, fast, balanced (if not given), accurate, adaptive; other engines have others."""
    control: Controls = ()
    controller: ControllerName = None
    run_options: RunOptions = field(default_factory=Run)
    plots: bool = True
    """Draw each scene's paths and momentum into the output folder."""
    threads: Threads = None
    json: File = None
    """Also write the results as a list of objects, one a scene and preset."""
    csv: File = None
    """Also write the table as CSV."""
    starts: Annotated[Given[int], arg(metavar="N")] = None
    """Run from so many random starts in place of the scene's own, and say how the errors spread."""
    seed: int = 0
    """The seed of the random starts."""
    cluster: Cluster = None
    """The scheduler of a dask cluster to run the random starts on."""
    device: Annotated[Given[str], arg(metavar="cpu|cuda")] = None
    """Where an engine that rolls many balls abreast (newton, mjx, mujoco-warp) runs them."""

    def run(self) -> int:
        if self.starts is not None:
            return self._many(self.starts)
        from ..plots import prepare_drawing

        if self.plots:  # before the imports that take longest
            prepare_drawing(len(self.scenes))

        from rich.console import Console

        from robotball import InputError, catalog

        from ..comparing import Comparing, compare_all
        from ..output import writable_folder
        from ..results import OWN_FILE, scenes_of, show, write_csv, write_json

        # An option without an effect is refused, lest its user rely on it.
        if self.seed or self.cluster or self.device:
            raise InputError("--seed, --cluster and --device are of random starts: give --starts")
        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        options = self.run_options
        requests = [partial(options.request, name) for name in listed(self.preset) or (None,)]
        # All are made once here, so that a wrong name is refused before the first run.
        presets, *_ = [make().engine.presets for make in requests]
        for name in self.scenes:
            if name in presets and name not in catalog():
                several = ",".join([*listed(self.preset), name])
                raise InputError(f"{name!r} is a preset and no scene: write --preset {several}")
        scenes = scenes_of(self.scenes, self.control, self.controller)
        out = writable_folder(options.out)
        times = times_of(options.duration)
        comparing = Comparing(requests, times, options.strict, out, self.plots)
        found = compare_all(list(scenes.values()), comparing)
        records = [record for each in found for record in each.records]
        refused = [
            f"{scene.name if file == scene.name else f'{scene.name} ({file})'}: "
            + each.refused.removeprefix(f"{scene.name}: ").removeprefix(f"{scene.name}, ")
            for (file, scene), each in zip(scenes.items(), found, strict=True)
            if each.refused is not None
        ]
        # With some results the refused scenes are told after them, and the status says so.
        if not records:
            raise InputError("; ".join(refused))
        for path, write in ((self.json, write_json), (self.csv, write_csv)):
            if path:
                write(path, records)
        show(records, Console())
        for scene in scenes.values():
            if scene.ball.general:
                print(f"{scene.name}: {OWN_FILE.format(scene.source)}")
        pictures = [picture for each in found for picture in each.pictures]
        if pictures:
            print("plots:", pictures[0], f"and {len(pictures) - 1} more")
        for line in refused:
            print(f"robotball: {line}", file=sys.stderr)
        if refused:
            return BAD_INPUT
        return AGREES if all(record["agrees"] for record in records) else DISAGREES

    def _many(self, starts: int) -> int:
        from robotball import InputError
        from robotball.errors import check_count

        from ..random_starts import ERRORS, PERCENTILES, many_runs
        from ..results import controlled
        from ..study import Column, Study, present, scene_cell, table_of

        options, rows, runs = self.run_options, [], {}
        check_count("starts", starts, 1)
        check_count("seed", self.seed, 0)
        if options.accuracy is not None or options.strict:
            raise InputError("random starts run by presets: leave out --accuracy and --strict")
        same = {"engine": options.engine, "keep_going": options.keep_going, "device": self.device}
        same |= {"seed": self.seed, "environments": None}
        if self.controller is not None:
            same["controller"] = str(Path(self.controller).absolute())
        if options.environments is not None:
            same["environments"] = str(options.environments.absolute())
        presets = [options.request(name).name for name in listed(self.preset) or (None,)]
        for name, preset in product(self.scenes, presets):
            scene = controlled(name, self.control, self.controller)
            seconds = seconds_of(options.duration, quick=False, scene=scene)
            cell = scene_cell(name, seconds, self.control) | same | {"preset": preset}
            found = many_runs(cell, starts, self.cluster, options.out)
            runs[f"{name}, {preset}"] = found.rows
            for error in ERRORS:
                of = {"scene": name, "preset": preset, "error": error.replace("_", " ")}
                rows.append({**of, **found.summary(error)})
        columns = [
            *(Column(name, name, words=True) for name in ("scene", "preset", "error")),
            *(Column(name, name, form="d") for name in ("runs", "faulty")),
            *(Column(name, name) for name in PERCENTILES),
            Column("runs", "runs_per_second", "1/s", form=".0f"),
        ]
        table = table_of(columns, rows, lambda row: row["faulty"], "preset")
        record = {"seed": self.seed, "spread": rows, "runs": runs}
        present(Study("", None, (), rows, record, [table]), options.out, self.json, self.csv)
        agree = all(each["agrees"] for some in runs.values() for each in some)
        return AGREES if agree else DISAGREES


@dataclass(frozen=True)
class Demo:
    """Compare fig12 and classical_regular at every preset: a table, a page and a film.

    Example: robotball demo --out demo
    """

    out: Path = OUT
    """Folder for everything."""

    def run(self) -> int:
        import warnings

        from rich.console import Console
        from rich.markup import escape

        from robotball import PRESETS, InputError, load_scene
        from robotball.view.lines import label_of
        from robotball.view.render import Film

        from .. import results
        from ..comparing import film, motions_of
        from ..output import program, writable_folder, write_text
        from ..report.scene_report import report
        from .report import FILM

        out, console = writable_folder(self.out), Console(soft_wrap=True)
        # naive is there to fail: what is predicted of it stands behind the table.
        with warnings.catch_warnings(record=True) as said:
            agreements = Run().agreements([*map(load_scene, _DEMO_SCENES)], [*PRESETS])
            records = [*map(results.record, agreements)]
        shown = [each for each in agreements if each.settings.name in _SHOWN]
        results.show(records, console)
        console.print("Predicted before the runs:", *(f"  {each.message}" for each in said),
                      sep="\n", markup=False, highlight=False)  # fmt: skip
        results.write_markdown(out / "demo.md", records)
        scenes, presets = " ".join(_DEMO_SCENES), ",".join(_SHOWN)
        command = f"{program()} report {scenes} --preset {presets} --film"
        page, filmed = out / "demo.html", shown[: len(_SHOWN)]
        write_text(page, report(shown, command))
        path = out / f"{results.file_stem(filmed)}.mp4"
        console.print(f"{page} can be opened; a film of a minute's work is added to it.")
        try:
            film(path, motions_of(filmed, "video"), Film(size=FILM, fps=24, ghost=True))
            write_text(page, report(shown, command, path))
        # A film needs a GL and an encoder, without which the rest of the demo is as good.
        except InputError as error:
            console.print(escape(f"no video: {error}"), style="yellow")
        naive, balanced = (float(each.path_errors.max()) for each in filmed)
        as_it_comes, end = label_of(filmed[0].motion), filmed[0].end
        console.print(
            f"{as_it_comes} leaves the path: {naive:.2g} m off after {end:g} s; "
            f"robotball's settings: {balanced:.0e} m.  open {page}", style="bold", markup=False,
        )  # fmt: skip
        return AGREES
