"""The commands `compare`, `demo` and `report`."""

import shlex
import sys
import tempfile
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .. import options

_DEMO_SCENES = ("fig12", "classical_regular")
_FILM = (360, 640)  # px, height and width: the page stays below six megabytes
_MOST_NAMES = 80  # characters of a file name that scenes may take
_SHOWN = ("naive", "balanced")  # on the page and in the film, to show a wrong setting


def compare(
    *scenes: str,
    run: options.RunOptions = options.RUN,
    plots: Annotated[bool, Parameter(negative="no-plots")] = True,
    threads: options.Threads = None,
    json: options.JsonFile = None,
    csv: options.CsvFile = None,
    starts: options.Count | None = None,
    seed: options.Seed = 0,
    device: Annotated[str | None, Parameter(metavar="cpu|cuda")] = None,
) -> int:
    """Run scenes with an engine and with the equations, and print how far the motions differ.

    Example: robotball compare fig12 --preset fast,accurate

    Parameters
    ----------
    scenes
        Names from the catalog, or paths to TOML, MJCF or URDF files.
    plots
        Draw the paths and the momentum of each scene into the output folder.
    starts
        Number of random starts, in place of the scene's own start. Shows the spread of errors.
    device
        cpu or cuda, for engines that step many balls at once (newton, mjx, mujoco-warp).
    """
    if starts is not None:
        return _many(scenes, run, starts, device, seed, json, csv)
    from rich.console import Console

    from robotball import InputError, catalog

    from ..comparing import Comparing, compare_all
    from ..output import writable_folder
    from ..results import OWN_FILE, scenes_of, show, write_csv, write_json

    # An option without an effect is refused, lest its user rely on it.
    if seed or device:
        raise InputError("--seed and --device need random starts: give --starts too")
    if not scenes:
        raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
    requests = [partial(run.request, name) for name in run.presets]
    # All are made once here, so that a wrong name is refused before the first run.
    presets, *_ = [make().engine.presets for make in requests]
    for name in scenes:
        if name in presets and name not in catalog():
            several = ",".join([*run.preset, name])
            raise InputError(f"{name!r} is a preset, not a scene: write --preset {several}")
    loaded = scenes_of(scenes, run.scene)
    out = writable_folder(run.out)
    comparing = Comparing(requests, options.times_of(run.duration), out, plots)
    found = compare_all(list(loaded.values()), comparing)
    records = [record for comparison in found for record in comparison.records]
    refused = [
        f"{scene.name if file == scene.name else f'{scene.name} ({file})'}: "
        + comparison.refused.removeprefix(f"{scene.name}: ").removeprefix(f"{scene.name}, ")
        for (file, scene), comparison in zip(loaded.items(), found, strict=True)
        if comparison.refused is not None
    ]
    # Refused scenes are reported after the results of the others.
    if not records:
        raise InputError("; ".join(refused))
    for path, write in ((json, write_json), (csv, write_csv)):
        if path:
            write(path, records)
    show(records, Console())
    for scene in loaded.values():
        if scene.ball.general:
            print(f"{scene.name}: {OWN_FILE.format(scene.source)}")
    pictures = [picture for comparison in found for picture in comparison.pictures]
    if pictures:
        print("plots:", pictures[0], f"and {len(pictures) - 1} more")
    for line in refused:
        print(f"robotball: {line}", file=sys.stderr)
    if refused:
        return options.BAD_INPUT
    return options.AGREES if all(record["agrees"] for record in records) else options.DISAGREES


def _many(
    names: tuple[str, ...],
    run: options.Run,
    starts: int,
    device: str | None,
    seed: int,
    json: Path | None,
    csv: Path | None,
) -> int:
    from robotball import InputError
    from robotball.errors import check_count

    from ..many_runs import ERRORS, PERCENTILES, random_runs
    from ..study import Column, Study, present, table_of

    rows, runs = [], {}
    check_count("starts", starts, 1)
    check_count("seed", seed, 0)
    if run.accuracy is not None or run.strict:
        raise InputError("--starts works only with presets: leave out --accuracy and --strict")
    requests = [run.request(name) for name in run.presets]
    for name, request in product(names, requests):
        scene = run.scene(name)
        seconds = options.seconds_of(run.duration, quick=False, scene=scene)
        found = random_runs(scene, starts, seconds, request, seed=seed, device=device)
        runs[f"{name}, {request.name}"] = found.rows
        for error in ERRORS:
            of = {"scene": name, "preset": request.name, "error": error.replace("_", " ")}
            rows.append({**of, **found.summary(error)})
    columns = [
        *(Column(name, name, words=True) for name in ("scene", "preset", "error")),
        *(Column(name, name, form="d") for name in ("runs", "faulty")),
        *(Column(name, name) for name in PERCENTILES),
        Column("runs", "runs_per_second", "1/s", form=".0f"),
    ]
    table = table_of(columns, rows, lambda row: row["faulty"], "preset")
    record = {"seed": seed, "spread": rows, "runs": runs}
    present(Study("", None, (), rows, record, [table]), run.out, json, csv)
    agree = all(run["agrees"] for preset_runs in runs.values() for run in preset_runs)
    return options.AGREES if agree else options.DISAGREES


def demo(*, out: options.Out = options.OUT) -> int:
    """Compare fig12 and classical_regular with every preset: a table, a page and a film.

    Example: robotball demo --out demo
    """
    import warnings

    from rich.console import Console
    from rich.markup import escape

    from robotball import PRESETS, InputError, load_scene
    from robotball.view.tracks import label_of

    from .. import results
    from ..comparing import film, motions_of, note_of
    from ..output import program, write_text
    from ..report.scene_report import report

    console = Console(soft_wrap=True)
    # naive fails on purpose; its predicted faults are printed below the table.
    with warnings.catch_warnings(record=True) as said:
        scenes = [*map(load_scene, _DEMO_SCENES)]
        agreements = options.Run(tuple(PRESETS), out=out).agreements(scenes)
        records = [*map(results.record, agreements)]
    shown = [agreement for agreement in agreements if agreement.settings.name in _SHOWN]
    results.show(records, console)
    warned = (str(warning.message) for warning in said)
    predicted = "\n  ".join(["Predicted before the runs:", *warned])
    console.print(predicted, markup=False, highlight=False)
    names, presets = " ".join(_DEMO_SCENES), ",".join(_SHOWN)
    command = f"{program()} report {names} --preset {presets} --film"
    page, filmed = out / "demo.html", shown[: len(_SHOWN)]
    write_text(page, report(shown, command))
    path = out / f"{results.file_stem(filmed)}.mp4"
    console.print(f"{page} can be opened now; a film is added to it, which takes a minute.")
    try:
        motions = motions_of(filmed, "video")
        film(path, motions, size=_FILM, fps=24, ghost=True, note=note_of(filmed))
        write_text(page, report(shown, command, path))
    # A film needs a GL and an encoder, without which the rest of the demo is as good.
    except InputError as error:
        console.print(escape(f"no video: {error}"), style="yellow")
    naive, balanced = (float(agreement.path_errors.max()) for agreement in filmed)
    split = f" ({filmed[0].slip.split})" if filmed[0].slip else ""
    console.print(
        f"{label_of(filmed[0].motion)}: {naive:.2g} m off after {filmed[0].end:g} s{split}; "
        f"robotball's settings: {balanced:.0e} m.  open {page}", style="bold", markup=False,
    )  # fmt: skip
    return options.AGREES


def report(*scenes: str, run: options.RunOptions = options.RUN, film: bool = False) -> int:
    """Write a comparison as one HTML page: verdict, plots, 3-D view, settings and commands.

    The page is a single file that needs no network.

    Example: robotball report fig12 --preset fast,accurate

    Parameters
    ----------
    scenes
        Names from the catalog, or paths to TOML, MJCF or URDF files.
    film
        Add a film of the first scene to the page.
    """
    from rich.console import Console

    from robotball import InputError

    from ..comparing import film as write_film
    from ..comparing import motions_of, note_of, shifted
    from ..margins import margins_of
    from ..output import program, progress_bar, write_text
    from ..report.scene_report import report as page_of
    from ..results import file_stem, record, scenes_of, show

    if not scenes:
        raise InputError("report needs a scene; `robotball scenes` lists the catalog")
    loaded = list(scenes_of(scenes, run.scene).values())
    agreements = run.agreements(loaded)
    loops = {run.scene.name: run.theory for run in agreements if run.scene.controller}
    with progress_bar(2 * len(loops)) as bar:
        margins = {n: margins_of(loops[n], shifted(bar, 2 * i)) for i, n in enumerate(loops)}
    # The agreements of the first scene stand first, as many as each scene has.
    first = agreements[: len(agreements) // len(loaded)]
    stem = file_stem(first)
    others = "".join(f"-{scene.name}" for scene in loaded[1:])
    # Cut, because a file system takes no name of a whole catalog.
    path = run.out / f"{(stem + others)[:_MOST_NAMES]}-report.html"
    command = f"{program()} {shlex.join(sys.argv[1:])}"
    with tempfile.TemporaryDirectory() as folder:
        movie = Path(folder) / "film.mp4" if film else None
        if movie:
            motions, ghost = motions_of(first, "video"), len(first) > 1
            write_film(movie, motions, size=_FILM, ghost=ghost, note=note_of(first))
        write_text(path, page_of(agreements, command, movie, margins))
    show(list(map(record, agreements)), Console())
    for name, found in margins.items():
        print(*(f"{name}: {margin}" for margin in found), sep="\n")
    print(path)
    return options.AGREES if all(run.agrees for run in agreements) else options.DISAGREES
