"""The demonstration that `make demo` runs: both rolling models at every preset."""

from pathlib import Path

from rich.console import Console

from robotball import PRESETS, InputError, load_scene
from robotball.engines.simulate import request_of
from validation.comparison.plots import draw
from validation.comparison.results import write_csv, write_json, write_markdown
from validation.comparison.runs import compare_all, film
from validation.comparison.table import show

SCENES = ("fig12", "classical_regular")
FILMED = ("fig12", "balanced")


def demo(out: Path) -> None:
    """Compare SCENES at all presets; the table in three forms, plots and a film go to `out`."""
    console = Console()
    agreements = compare_all(
        [load_scene(name) for name in SCENES], [request_of(settings=name) for name in PRESETS]
    )
    show(agreements, console)
    written = []
    for suffix, write in (("json", write_json), ("csv", write_csv), ("md", write_markdown)):
        written.append(out / f"demo.{suffix}")
        write(written[-1], agreements)
    for name in SCENES:
        written += draw([each for each in agreements if each.scene.name == name], out)
    for agreement in agreements:
        if (agreement.scene.name, agreement.settings.name) == FILMED:
            try:
                film(out / f"{agreement.scene.name}.mp4", agreement)
                written.append(out / f"{agreement.scene.name}.mp4")
            except InputError as error:
                console.print(f"no video: {error}", style="yellow")
    console.print("Written:", *(f"  {path}" for path in written), sep="\n")
