"""The commands that show a scene's two balls: `video` in a file, `view` in a window or a page.

Imports stand within the functions, so that `robotball video --help` needs no GL.
"""

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from ..options import (
    AGREES,
    DISAGREES,
    ControllerName,
    Controls,
    Names,
    Run,
    RunOptions,
    SceneName,
    Threads,
    listed,
)

if TYPE_CHECKING:
    from ..agreement import Agreement


@dataclass(frozen=True)
class _Shown:
    """A scene, the presets to run it with, and the options of the runs."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    preset: Names = ()
    """The engine's settings to run it with, its default if not given. Several: naive,balanced."""
    control: Controls = ()
    controller: ControllerName = None
    run_options: RunOptions = field(default_factory=Run)

    def _agreements(self) -> "list[Agreement]":
        """Compare the scene's motions with progress shown."""
        from ..output import writable_folder
        from ..results import controlled

        options, scene = self.run_options, controlled(self.scene, self.control, self.controller)
        writable_folder(options.out)
        return options.agreements([scene], listed(self.preset))


@dataclass(frozen=True)
class Video(_Shown):
    """Film a scene: the ball of an engine, by one preset or more, and the ball of the equations.

    Example: robotball video fig12 --preset naive,balanced --ghost --slow 2
    """

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
    as_is: bool = False
    """Film a robot's own file as it is, by its own contact, beside the file that `check` mends."""
    threads: Threads = None

    def run(self) -> int:
        from robotball.view.render import Film

        from ..comparing import film, motions_of
        from ..results import changed, file_name, file_stem

        how = Film(self.fps, _size(self.size), self.slow, self.camera, self.ghost, self.arrows)
        words = changed(self, "fps", "size", "slow", "camera", "ghost", "arrows", "as_is")
        if self.as_is:
            from ..check.ablate import motions_of as motions_of_check
            from .checking import Check

            duration = self.run_options.duration
            check = Check(Path(self.scene), control=self.control, duration=duration)
            checked, _ = check.checked()
            stem, motions, agrees = check.file.stem, motions_of_check(checked), checked.agrees
        else:
            agreements = self._agreements()
            stem, motions = file_stem(agreements), motions_of(agreements, "video")
            agrees = all(each.agrees for each in agreements)
        path = self.run_options.out / f"{file_name(stem, None, words)}.{self.format}"
        film(path, motions, how)
        print(path)
        return AGREES if agrees else DISAGREES


@dataclass(frozen=True)
class View(_Shown):
    """Watch the engine's ball roll, and the equations' as a ghost, in a window or a page.

    Example: robotball view fig12 --web
    """

    web: bool = False
    """Write a page for any browser, which needs no network, in place of a window."""

    def run(self) -> int:
        from robotball.view.viewer import KEYS, check_display, view
        from robotball.view.web import view_page

        from ..comparing import motions_of
        from ..output import write_text
        from ..results import file_stem

        if not self.web:
            # Before the runs, which take longest: without a display nothing could be shown of them.
            check_display()
        agreements = self._agreements()
        motions = motions_of(agreements, "view")
        if self.web:
            path = self.run_options.out / f"{file_stem(agreements)}-view.html"
            write_text(path, view_page(motions))
            print(path)
        else:
            print(KEYS, file=sys.stderr)
            view(motions)
        return AGREES if all(each.agrees for each in agreements) else DISAGREES


def _size(text: str) -> tuple[int, int]:
    """(height, width) of "WIDTHxHEIGHT"; raises InputError where it is none."""
    from robotball import InputError

    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if found is None:
        raise InputError(f"--size must be WIDTHxHEIGHT in pixels, as 1280x720, not {text!r}")
    return int(found[2]), int(found[1])
