"""The commands that show a scene's two balls: `video` in a file, `view` in a window or a page."""

import re
import sys
from dataclasses import replace
from typing import Annotated, Literal

from cyclopts import Parameter

from .. import options


def video(
    scene: options.SceneName,
    /,
    *,
    run: options.RunOptions = options.RUN,
    fps: options.Count = 30,
    resolution: Annotated[str, Parameter(metavar="WIDTHxHEIGHT")] = "1280x720",
    slow: float = 1.0,
    camera: Literal["follow", "above", "whole"] = "follow",
    ghost: bool = False,
    format: Literal["mp4", "webm", "gif"] = "mp4",
    threads: options.Threads = None,
) -> int:
    """Write a video of a scene: the engine's ball with each preset, and the equations' ball.

    If the ball slips, a single preset is filmed beside the ball that rolls.

    Example: robotball video fig12 --preset naive,balanced --ghost --slow 2

    Parameters
    ----------
    fps
        Frames per second.
    resolution
        Size of the picture in pixels.
    slow
        Slow motion: the factor by which the video is slower than real time.
    camera
        The camera follows each ball, looks from above, or stands still and sees the whole path.
    ghost
        Draw one picture with the equations' ball as a ghost, instead of one picture for each ball.
    format
        Format of the file.
    """
    from robotball.view.render import Film

    from ..comparing import film, motions_of, note_of
    from ..results import changed, file_name, file_stem
    from ..slip import others

    how = Film(fps, _size(resolution), slow, camera, ghost)
    words = changed(video, fps=fps, resolution=resolution, slow=slow, camera=camera, ghost=ghost)
    agreements = run.agreements([run.scene(scene)])
    path = run.out / f"{file_name(file_stem(agreements), None, words)}.{format}"
    how = replace(how, note=note_of(agreements))
    film(path, [*others(agreements), *motions_of(agreements, "video")], **vars(how))
    print(path)
    agree = all(agreement.agrees for agreement in agreements)
    return options.AGREES if agree else options.DISAGREES


def view(
    scene: options.SceneName, /, *, run: options.RunOptions = options.RUN, web: bool = False
) -> int:
    """Watch the engine's ball roll, with the equations' ball as a ghost, in a window or a page.

    Example: robotball view fig12 --web

    Parameters
    ----------
    web
        Write a page for any browser instead of opening a window. The page needs no network.
    """
    from robotball.view.viewer import KEYS, check_display
    from robotball.view.viewer import view as watch
    from robotball.view.web import view_page

    from ..comparing import motions_of
    from ..output import write_text
    from ..results import file_stem

    if not web:
        # Before the runs, which take longest: without a display nothing could be shown of them.
        check_display()
    agreements = run.agreements([run.scene(scene)])
    motions = motions_of(agreements, "view")
    if web:
        path = run.out / f"{file_stem(agreements)}-view.html"
        write_text(path, view_page(motions))
        print(path)
    else:
        print(KEYS, file=sys.stderr)
        watch(motions)
    return (
        options.AGREES if all(agreement.agrees for agreement in agreements) else options.DISAGREES
    )


def _size(text: str) -> tuple[int, int]:
    """Return (height, width) of "WIDTHxHEIGHT". Raises InputError for any other text."""
    from robotball import InputError

    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if found is None:
        raise InputError(f"--resolution takes WIDTHxHEIGHT, such as 1280x720, not {text!r}")
    return int(found[2]), int(found[1])
