"""The `robotball` command: arguments in, exit status out.

Exit status: 0 agreement within the stated bound, 1 not, 2 bad input.
"""

import contextlib
import io
import logging
import math
import re
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import DisallowNone, Positional, arg

from robotball import (
    InputError,
    Limits,
    SceneWarning,
    catalog,
    load_scene,
    preset,
    sample_times,
    scene_toml,
)
from robotball.contact.explain import left_out
from robotball.contact.model import build
from robotball.designing.design import describe
from robotball.designing.redesign import redesign
from validation.arguments import AGREES, BAD_INPUT, DISAGREES, OUT, Duration, File, SceneName
from validation.commands_paper import Paper
from validation.commands_pictures import Figures, Section
from validation.commands_qualitative import Basins, Equilibria, Lyapunov
from validation.results import replacing, writable_file, writable_folder, write_csv, write_json
from validation.runs import compare_all, film
from validation.table import show


@dataclass(frozen=True)
class Scenes:
    """The catalog: every scene that comes with robotball."""

    def run(self) -> int:
        table = Table("scene", "rolling", "duration", "title")
        for name in catalog():
            scene = load_scene(name)
            table.add_row(name, scene.rolling, f"{scene.duration:g} s", scene.title)
        Console().print(table)
        return AGREES


@dataclass(frozen=True)
class Compare:
    """Run scenes in both engines, side by side, and say how far apart they are."""

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="SCENE...")]]
    """Names from the catalog, or paths to TOML files."""
    preset: tuple[str, ...] = ("balanced",)
    """MuJoCo settings to run each scene with: naive, fast, balanced, accurate."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    out: Path = OUT
    """Folder for the plots."""
    plots: bool = True
    """Draw each scene's paths and momentum into the output folder."""
    json: File = None
    """Also write the results as a list of objects, one a scene and preset."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        scenes = [load_scene(name) for name in self.scenes]
        settings = [preset(name) for name in self.preset]
        times = None if self.duration is None else sample_times(self.duration)
        for path in filter(None, (self.json, self.csv)):
            writable_file(path)
        if self.plots:
            writable_folder(self.out)
        agreements = compare_all(scenes, settings, times)
        if self.json:
            write_json(self.json, agreements)
        if self.csv:
            write_csv(self.csv, agreements)
        if self.plots:
            from validation.plots import draw  # matplotlib takes a while to come

            for scene in scenes:
                draw([each for each in agreements if each.scene is scene], self.out)
        show(agreements, Console())
        return AGREES if all(agreement.agrees for agreement in agreements) else DISAGREES


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of MuJoCo beside the ball of the equations, as an mp4."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: str = "balanced"
    """MuJoCo settings to run it with."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    out: Path = OUT
    """Folder for the video."""

    def run(self) -> int:
        scene, settings = load_scene(self.scene), preset(self.preset)
        times = None if self.duration is None else sample_times(self.duration)
        path = writable_folder(self.out) / f"{scene.name}.mp4"
        (agreement,) = compare_all([scene], [settings], times)
        film(path, agreement)
        print(path)
        return AGREES if agreement.agrees else DISAGREES


@dataclass(frozen=True)
class Model:
    """Print a scene's MJCF: self-contained, at full precision."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: str = "balanced"
    """MuJoCo settings to write into it."""
    out: File = None
    """Write it to this file instead."""
    explain: bool = False
    """Say instead what the model leaves out, and why."""

    def run(self) -> int:
        scene, settings = load_scene(self.scene), preset(self.preset)
        if self.explain:
            print(f"{scene.name}, {settings.name}: not in the model:")
            print(*(f"  {line}" for line in left_out(scene, settings)), sep="\n")
            return AGREES
        xml = build(scene, settings).xml
        if self.out is None:
            print(xml)
        else:
            with replacing(writable_file(self.out)) as temporary:
                temporary.write_text(xml)
        return AGREES


@dataclass(frozen=True)
class Design:
    """Find bodies for a scene's A, Ω and K: print them, and write a scene that has them."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    mass: DisallowNone[Annotated[float | None, arg(metavar="KG")]] = None
    """Mass of the ball; the best one if not given."""
    rotor_speed: Annotated[float, arg(metavar="RAD/S")] = math.inf
    """The fastest that a rotor may turn."""
    frame_radius: DisallowNone[Annotated[float | None, arg(metavar="M")]] = None
    """Within which the frame must lie; the shell's if not given."""
    shell_thickness: Annotated[float, arg(metavar="M")] = 0.0
    """Of a homogeneous shell; 0 for a thin one."""
    out: Path = OUT
    """Folder for the scene."""

    def run(self) -> int:
        scene = load_scene(self.scene)
        limits = Limits(
            rotor_speed=self.rotor_speed,
            frame_radius=self.frame_radius,
            shell_thickness=self.shell_thickness,
        )
        found, designed = redesign(scene, self.mass, limits)
        path = writable_folder(self.out) / f"{designed.name}.toml"
        with replacing(path) as temporary:
            temporary.write_text(scene_toml(designed))
        print(describe(found), path, sep="\n")
        return AGREES


@dataclass(frozen=True)
class Demo:
    """Compare fig12 and classical_regular at every preset, with table, plots and video."""

    out: Path = OUT
    """Folder for everything."""

    def run(self) -> int:
        from validation.demo import demo

        demo(writable_folder(self.out))
        return AGREES


Command = (
    Scenes | Compare | Video | Model | Design | Demo
    | Figures | Section | Lyapunov | Basins | Equilibria | Paper
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    # The watch on every run reports what MuJoCo would only log.
    logging.getLogger("absl").setLevel(logging.ERROR)
    warnings.simplefilter("once", SceneWarning)
    warnings.showwarning = _show_warning
    try:
        status = parse(arguments).run()
    except InputError as error:
        print(f"robotball: {error}", file=sys.stderr)
        status = BAD_INPUT
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"robotball: warning: {message}", file=sys.stderr)


def parse(arguments: Sequence[str] | None) -> Command:
    """The command of the arguments; raises InputError, in one line, where they make none."""
    refusal = io.StringIO()
    try:
        with contextlib.redirect_stderr(refusal):
            return tyro.cli(Command, args=arguments, prog="robotball")
    except SystemExit as leaving:
        if not leaving.code:
            raise
        # tyro draws a box of several lines; its words up to the first rule are the error.
        words = re.split(r"─{4,}\s*│?\n", re.sub(r"^╭.*\n", "", refusal.getvalue()))[0]
        raise InputError(" ".join(re.sub(r"[│╰╯]", " ", words).split())) from None
