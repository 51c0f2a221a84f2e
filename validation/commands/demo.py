"""The command `robotball demo`, which `make demo` runs."""

from dataclasses import dataclass
from pathlib import Path

from validation.commands.arguments import AGREES, OUT

SCENES = ("fig12", "classical_regular")
FILMED = ("fig12", "balanced")


@dataclass(frozen=True)
class Demo:
    """Compare fig12 and classical_regular at every preset, with table, plots and a film.

    Example: robotball demo --out demo
    """

    out: Path = OUT
    """Folder for everything."""

    def run(self) -> int:
        from rich.console import Console
        from rich.markup import escape

        from robotball import PRESETS, InputError, load_scene
        from robotball.engine import request_of
        from validation.output import progress_bar, writable_folder
        from validation.plots import draw
        from validation.results import (
            file_stem,
            record,
            show,
            write_csv,
            write_json,
            write_markdown,
        )
        from validation.runs import agreements_of, film

        out, console = writable_folder(self.out), Console()
        requests = [request_of(settings=name) for name in PRESETS]
        written, records, filmed = [], [], []
        with progress_bar(len(SCENES)) as progress:
            for i, name in enumerate(SCENES):
                progress(i, name)
                agreements = agreements_of(load_scene(name), requests)
                written += draw(agreements, out)
                records += [record(each) for each in agreements]
                filmed += [each for each in agreements if (name, each.settings.name) == FILMED]
        show(records, console)
        for suffix, write in (("json", write_json), ("csv", write_csv), ("md", write_markdown)):
            written.append(out / f"demo.{suffix}")
            write(written[-1], records)
        for agreement in filmed:
            path = out / f"{file_stem([agreement])}.mp4"
            try:
                film(path, agreement)
                written.append(path)
            except InputError as error:
                console.print(escape(f"no video: {error}"), style="yellow")
        console.print("Written:", *(escape(f"  {path}") for path in written), sep="\n")
        return AGREES
