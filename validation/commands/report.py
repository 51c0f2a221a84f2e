"""The command `report`."""

import shlex
import sys
import tempfile
from pathlib import Path

from .. import options

FILM = (360, 640)  # px, height and width: the page stays below six megabytes
_MOST_NAMES = 80  # characters of a file's name that scenes may take


def report(*scenes: str, run: options.RunOptions = options.RUN, film: bool = False) -> int:
    """Write a comparison as one HTML page: verdict, plots, 3-D view, settings, how to repeat it.

    The page is a single file that needs no network. A study's JSON file becomes a page with the
    study's tables, and with the picture that lies beside the file.

    Example: robotball report fig12 --preset fast,accurate

    Parameters
    ----------
    scenes
        Names from the catalog, or paths to TOML, MJCF or URDF files; or the JSON file of a study.
    film
        Add a film of the first scene to the page.
    """
    from robotball import InputError

    from ..output import writable_folder, write_text
    from ..report.study_report import study_report

    if not scenes:
        raise InputError("report needs a scene, or the JSON file of a study")
    studies = [name for name in scenes if name.endswith(".json")]
    if not studies:
        return _compared(scenes, film, run)
    if len(scenes) > 1:
        raise InputError("report takes one study's JSON file at a time, without scenes")
    source = Path(studies[0])
    path = writable_folder(run.out) / f"{source.stem}-report.html"
    write_text(path, study_report(source))
    print(path)
    return options.AGREES


def _compared(names: tuple[str, ...], filmed: bool, run: options.Run) -> int:
    from rich.console import Console

    from ..comparing import film, motions_of
    from ..output import program, write_text
    from ..report.scene_report import report
    from ..results import file_stem, record, scenes_of, show

    scenes = list(scenes_of(names, run.control, run.controller).values())
    agreements = run.agreements(scenes)
    # The first scene's agreements stand first, as many as each scene has.
    first = agreements[: len(agreements) // len(scenes)]
    stem = file_stem(first)
    others = "".join(f"-{scene.name}" for scene in scenes[1:])
    # Cut, as a file system takes no name of a whole catalog.
    path = run.out / f"{(stem + others)[:_MOST_NAMES]}-report.html"
    command = f"{program()} {shlex.join(sys.argv[1:])}"
    with tempfile.TemporaryDirectory() as folder:
        movie = Path(folder) / "film.mp4" if filmed else None
        if movie:
            # Off-screen drawing is prepared at import, which a report else has no need of.
            from robotball.view.render import Film

            film(movie, motions_of(first, "video"), Film(size=FILM, ghost=len(first) > 1))
        write_text(path, report(agreements, command, movie))
    show(list(map(record, agreements)), Console())
    print(path)
    return options.AGREES if all(each.agrees for each in agreements) else options.DISAGREES
