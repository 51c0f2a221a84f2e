"""Encode the frames of a film into a file one by one, so memory does not grow with its length."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg
import mediapy

from robotball.errors import InputError
from robotball.files.replacing import replacing
from robotball.film.render import Film, Progress, frames
from robotball.motion import Motion

# By the file's suffix: the codec, its rate factor, and ffmpeg's own options.
_FORMATS: dict[str, tuple[str, int | None, str]] = {
    ".mp4": ("h264", 20, "-preset veryfast"),
    ".webm": ("vp9", 32, "-deadline realtime -cpu-used 7 -row-mt 1"),
    # A palette for each frame: a common one would make ffmpeg hold all frames until the last.
    ".gif": (
        "gif",
        None,
        "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=bayer"
        " -loop 0",
    ),
}


def write_video(
    path: Path | str,
    motion: Motion,
    theory: Motion,
    film: Film | None = None,
    *,
    progress: Progress | None = None,
) -> None:
    """Write `frames` as mp4, webm or gif, by the suffix of the path.

    An existing file is replaced once the new one is complete. progress is called with the
    fraction that is done. Raises InputError as `frames` does, and for a path that has no such
    suffix or folder.
    """
    path, film = Path(path), film or Film()
    if path.suffix not in _FORMATS or not path.parent.is_dir():
        kinds = ", ".join(_FORMATS)
        raise InputError(f"a video must be a file ({kinds}) in a folder that exists, not {path}")
    codec, rate, options = _FORMATS[path.suffix]
    # Before the file is opened: what cannot be drawn must not leave one.
    pictures, number = frames(motion, theory, film), len(film.times(motion, theory))
    # mediapy looks for an ffmpeg on the PATH; imageio-ffmpeg brings one.
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with (
        replacing(path) as unfinished,
        _refused_by_the_encoder(path),
        mediapy.VideoWriter(
            unfinished, film.size, codec=codec, fps=film.fps, crf=rate, ffmpeg_args=options
        ) as video,
    ):
        for i, picture in enumerate(pictures, start=1):
            video.add_image(picture)
            if progress is not None:
                progress(i / number)


@contextmanager
def _refused_by_the_encoder(path: Path) -> Iterator[None]:
    """Turn mediapy's error, where the encoder ends before the film, into an InputError."""
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("Error writing"):
            raise
        why = (str(error).splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder says {why!r}") from None
