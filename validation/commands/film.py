"""The commands that show a scene's two balls: `video` in a file, `view` in a window or a page.

Imports stand within the functions, so that `robotball video --help` needs no GL.
"""

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from validation.options import (
    AGREES,
    DISAGREES,
    Controls,
    Names,
    Preset,
    Run,
    RunOptions,
    SceneName,
    Threads,
    listed,
    times_of,
)

if TYPE_CHECKING:
    from robotball import Scene
    from validation.agreement import Agreement


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of an engine, by one preset or more, and the ball of the equations.

    Example: robotball video fig12 --preset naive,balanced --ghost --slow 2
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    preset: Names = ()
    """The engine's settings to run it with, its default if not given. Several: naive,fast."""
    fps: int = 30
    """Frames a second."""
    size: Annotated[str, arg(metavar="WIDTHxHEIGHT")] = "1280x720"
    """The picture's size in pixels."""
    slow: float = 1.0
    """So many times slower than life."""
    camera: Literal["follow", "above", "whole"] = "follow"
    """It follows each ball, looks from above, or stands still and sees all of their paths."""
    ghost: bool = False
    """One picture, with the ball of the equations as a ghost, in place of one a ball."""
    arrows: bool = False
    """Show M, the angular velocity and the contact force."""
    format: Literal["mp4", "webm", "gif"] = "mp4"
    """The file's format."""
    control: Controls = ()
    run_options: RunOptions = field(default_factory=Run)
    threads: Threads = None

    def run(self) -> int:
        from robotball.film.render import Film
        from validation.results import changed, controlled, file_name, file_stem
        from validation.runs import film

        how = Film(self.fps, _size(self.size), self.slow, self.camera, self.ghost, self.arrows)
        scene, presets = controlled(self.scene, self.control), listed(self.preset)
        agreements, out = _agreements_of(scene, presets or (None,), self.run_options)
        words = changed(self, "fps", "size", "slow", "camera", "ghost", "arrows")
        path = out / f"{file_name(file_stem(agreements), None, words)}.{self.format}"
        film(path, agreements, how)
        print(path)
        return AGREES if all(each.agrees for each in agreements) else DISAGREES


@dataclass(frozen=True)
class View:
    """Watch both balls roll in step, that of the equations as a ghost, in a window or a page.

    Example: robotball view fig12 --web
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    preset: Preset = None
    """The engine's settings to run it with, its default if not given."""
    web: bool = False
    """Write a page for any browser, which needs no network, in place of a window."""
    control: Controls = ()
    run_options: RunOptions = field(default_factory=Run)

    def run(self) -> int:
        from robotball.film.viewer import KEYS, check_display, view
        from robotball.film.web import view_page
        from validation.output import write_text
        from validation.results import controlled, file_stem
        from validation.runs import check_moving

        scene = controlled(self.scene, self.control)
        if not self.web:
            check_display()
        (agreement,), out = _agreements_of(scene, (self.preset,), self.run_options)
        check_moving(agreement, "view")
        if self.web:
            path = out / f"{file_stem([agreement])}-view.html"
            write_text(path, view_page([agreement.motion, agreement.theory]))
            print(path)
        else:
            print(KEYS, file=sys.stderr)
            view(agreement.motion, agreement.theory)
        return AGREES if agreement.agrees else DISAGREES


def _agreements_of(
    scene: "Scene", presets: Sequence[str | None], options: Run
) -> "tuple[list[Agreement], Path]":
    """Compare a scene's motions with progress shown; return agreements and the output folder."""
    from validation.output import progress_bar, writable_folder
    from validation.runs import agreements_of, tell_fault_windows, windows

    requests, out = list(map(options.request, presets)), writable_folder(options.out)
    times = times_of(options.duration)
    with progress_bar(len(requests)) as show:
        agreements = agreements_of(
            scene, requests, times, strict=options.strict, fault_windows=out, show=show
        )
    tell_fault_windows(windows(agreements, out))
    return agreements, out


def _size(text: str) -> tuple[int, int]:
    """(height, width) of "WIDTHxHEIGHT"; raises InputError where it is none."""
    from robotball import InputError

    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if found is None:
        raise InputError(f"--size must be WIDTHxHEIGHT in pixels, as 1280x720, not {text!r}")
    return int(found[2]), int(found[1])
