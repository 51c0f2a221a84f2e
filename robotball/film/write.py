"""Frames → a film's file, one by one: memory does not grow with its length."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg

from robotball.errors import InputError
from robotball.files.replacing import replacing
from robotball.film.render import Film, Progress, frames
from robotball.motion import Motion

# By the file's suffix: the codec, how pixels are kept, and ffmpeg's own options.
FORMATS = {
    ".mp4": ("libx264", "yuv420p", ["-crf", "20", "-preset", "veryfast"]),
    ".webm": (
        "libvpx-vp9",
        "yuv420p",
        ["-crf", "32", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "7", "-row-mt", "1"],
    ),
    # A palette a frame, so that ffmpeg need not wait for the last one.
    ".gif": (
        "gif",
        "rgb8",
        [
            "-filter_complex",
            "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=bayer",
            "-pix_fmt",
            "pal8",
            "-loop",
            "0",
        ],
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
    """Writes `frames` as mp4, webm or gif, by the suffix; a file that is there is replaced once the
    new one is complete.

    progress is called with the fraction that is done. Raises InputError as `frames` does, and
    where `path` can be no such file.
    """
    path, film = Path(path), film or Film()
    if path.suffix not in FORMATS or not path.parent.is_dir():
        kinds = ", ".join(FORMATS)
        raise InputError(f"a video must be a file ({kinds}) in a folder that exists, not {path}")
    codec, pixels, options = FORMATS[path.suffix]
    pictures, number = frames(motion, theory, film), len(film.times(motion, theory))
    height, width = film.size
    with replacing(path) as unfinished, _refused_by_the_encoder(path):
        encoder = imageio_ffmpeg.write_frames(
            str(unfinished),
            (width, height),
            fps=film.fps,
            codec=codec,
            pix_fmt_out=pixels,
            output_params=options,
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
        )
        encoder.send(None)
        try:
            for i, picture in enumerate(pictures, start=1):
                encoder.send(picture.tobytes())
                if progress is not None:
                    progress(i / number)
        finally:
            encoder.close()


@contextmanager
def _refused_by_the_encoder(path: Path) -> Iterator[None]:
    """Makes an InputError of what is raised where the encoder ends before the film does."""
    try:
        yield
    except OSError as error:
        why = (str(error).strip().splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder says {why!r}") from None
