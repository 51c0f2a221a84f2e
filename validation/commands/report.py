"""The command `robotball report`."""

import shlex
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import arg

from robotball import InputError

from ..comparing import film, motions_of
from ..options import (
    AGREES,
    DISAGREES,
    ControllerName,
    Controls,
    Names,
    Run,
    RunOptions,
    Several,
    listed,
)
from ..output import program, writable_folder, write_text
from ..report.scene_report import report
from ..report.study_report import study_report
from ..results import file_stem, record, scenes_of
from ..results import show as show_table

FILM = (360, 640)  # px, height and width: the page stays below six megabytes
_MOST_NAMES = 80  # characters of a file's name that scenes may take


@dataclass(frozen=True)
class Report:
    """Write one HTML page: agreement in words, plots, a 3-D view, settings, how to repeat it.

    The page needs no network, and can be sent as it is. Of a study's JSON file it shows the tables,
    and the picture that is beside the file.

    Example: robotball report fig12 --preset fast,accurate
    """

    scenes: Annotated[Several, arg(metavar="SCENE...")]
    """Names from the catalog, or paths to TOML, MJCF or URDF files; or a study's JSON file."""
    preset: Names = ()
    """The engine's settings to run each scene with, its default if none. Several: naive,fast."""
    control: Controls = ()
    controller: ControllerName = None
    film: bool = False
    """Have a film of the first scene in the page, above its 3-D views."""
    run_options: RunOptions = field(default_factory=Run)

    def run(self) -> int:
        if not self.scenes:
            raise InputError("report needs a scene, or the JSON file of a study")
        studies = [name for name in self.scenes if name.endswith(".json")]
        if studies and len(self.scenes) > 1:
            raise InputError("report takes one study's JSON file at a time, without scenes")
        if not studies:
            return self._compared()
        source = Path(studies[0])
        path = writable_folder(self.run_options.out) / f"{source.stem}-report.html"
        write_text(path, study_report(source))
        print(path)
        return AGREES

    def _compared(self) -> int:
        scenes = list(scenes_of(self.scenes, self.control, self.controller).values())
        out = writable_folder(self.run_options.out)
        agreements = self.run_options.agreements(scenes, listed(self.preset))
        # The first scene's agreements stand first, as many as each scene has.
        first = agreements[: len(agreements) // len(scenes)]
        stem = file_stem(first)
        others = "".join(f"-{scene.name}" for scene in scenes[1:])
        # Cut, as a file system takes no name of a whole catalog.
        path = out / f"{(stem + others)[:_MOST_NAMES]}-report.html"
        command = f"{program()} {shlex.join(sys.argv[1:])}"
        with tempfile.TemporaryDirectory() as folder:
            filmed = Path(folder) / "film.mp4" if self.film else None
            if filmed:
                # Off-screen drawing is prepared at import, which a report else has no need of.
                from robotball.view.render import Film

                film(filmed, motions_of(first, "video"), Film(size=FILM, ghost=len(first) > 1))
            write_text(path, report(agreements, command, filmed))
        show_table(list(map(record, agreements)), Console())
        print(path)
        return AGREES if all(each.agrees for each in agreements) else DISAGREES
