"""The commands that run scenes: scenes, compare, video, model, demo."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from robotball import InputError, Settings, catalog, load_scene, preset, sample_times
from robotball.contact.explain import left_out
from robotball.contact.model import build
from validation.agreement import Agreement
from validation.commands.arguments import AGREES, DISAGREES, OUT, Duration, File, SceneName
from validation.results import replacing, writable_file, writable_folder, write_csv, write_json
from validation.runs import compare_all, dump_path, film
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
    """Folder for the plots, and for the states around a fault."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""
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
        settings = [_preset(name, self.keep_going) for name in self.preset]
        times = None if self.duration is None else sample_times(self.duration)
        for path in filter(None, (self.json, self.csv)):
            writable_file(path)
        writable_folder(self.out)
        agreements = compare_all(scenes, settings, times, strict=self.strict, dumps=self.out)
        if self.json:
            write_json(self.json, agreements)
        if self.csv:
            write_csv(self.csv, agreements)
        if self.plots:
            from validation.plots import draw  # matplotlib takes a while to come

            for scene in scenes:
                draw([each for each in agreements if each.scene is scene], self.out)
        show(agreements, Console())
        _tell_dumps(agreements, self.out)
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
    """Folder for the video, and for the states around a fault."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""

    def run(self) -> int:
        scene, settings = load_scene(self.scene), _preset(self.preset, self.keep_going)
        times = None if self.duration is None else sample_times(self.duration)
        path = writable_folder(self.out) / f"{scene.name}.mp4"
        agreements = compare_all([scene], [settings], times, strict=self.strict, dumps=self.out)
        (agreement,) = agreements
        _tell_dumps(agreements, self.out)
        film(path, agreement)
        print(path)
        return AGREES if agreement.agrees else DISAGREES


def _preset(name: str, keep_going: bool) -> Settings:
    settings = preset(name)
    return replace(settings, stop_at_fault=False) if keep_going else settings


def _tell_dumps(agreements: Sequence[Agreement], folder: Path) -> None:
    for each in agreements:
        if each.faults:
            path = dump_path(folder, each.scene, each.settings)
            print(f"robotball replay {path}", "steps through its first fault")


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
class Demo:
    """Compare fig12 and classical_regular at every preset, with table, plots and video."""

    out: Path = OUT
    """Folder for everything."""

    def run(self) -> int:
        from validation.demo import demo

        demo(writable_folder(self.out))
        return AGREES
