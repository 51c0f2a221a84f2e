"""The command `robotball video`."""

import re
from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import arg

from validation.options import (
    AGREES,
    DISAGREES,
    Preset,
    Run,
    RunOptions,
    SceneName,
    Threads,
    times_of,
)


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of an engine beside the ball of the equations.

    Example: robotball video fig12 --duration 4 --slow 2 --arrows
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Preset = None
    """The engine's settings to run it with, its default if not given."""
    fps: int = 30
    """Frames a second."""
    size: Annotated[str, arg(metavar="WIDTHxHEIGHT")] = "1280x720"
    """Of the picture, in pixels."""
    slow: float = 1.0
    """So many times slower than life."""
    camera: Literal["follow", "above", "whole"] = "follow"
    """It follows each ball, looks from above, or stands still and sees the whole path."""
    ghost: bool = False
    """One picture, with the ball of the equations as a ghost, in place of two side by side."""
    arrows: bool = False
    """Show M, the angular velocity and the contact force."""
    format: Literal["mp4", "webm", "gif"] = "mp4"
    """Of the file."""
    run_options: RunOptions = field(default_factory=Run)
    threads: Threads = None

    def run(self) -> int:
        from robotball import load_scene
        from robotball.film.render import Film
        from validation.output import progress_bar, writable_folder
        from validation.results import changed, file_name, file_stem
        from validation.runs import agreements_of, film, tell_fault_windows, windows

        how = Film(self.fps, _size(self.size), self.slow, self.camera, self.ghost, self.arrows)
        options, scene = self.run_options, load_scene(self.scene)
        request, out = options.request(self.preset), writable_folder(options.out)
        times = times_of(options.duration)
        with progress_bar(1) as show:
            agreements = agreements_of(
                scene, [request], times, strict=options.strict, fault_windows=out, show=show
            )
        (agreement,) = agreements
        tell_fault_windows(windows(agreements, out))
        words = changed(self, "fps", "size", "slow", "camera", "ghost", "arrows")
        path = out / f"{file_name(file_stem(agreements), None, words)}.{self.format}"
        film(path, agreement, how)
        print(path)
        return AGREES if agreement.agrees else DISAGREES


def _size(text: str) -> tuple[int, int]:
    """(height, width) of "WIDTHxHEIGHT"; raises InputError where it is none."""
    from robotball import InputError

    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if found is None:
        raise InputError(f"--size must be WIDTHxHEIGHT in pixels, as 1280x720, not {text!r}")
    return int(found[2]), int(found[1])
