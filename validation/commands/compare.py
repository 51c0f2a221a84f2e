"""The command `robotball compare`."""

import sys
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import Positional, arg

from validation.commands.arguments import (
    AGREES,
    BAD_INPUT,
    DISAGREES,
    File,
    Names,
    Run,
    RunOptions,
    check_files,
    listed,
    times_of,
)


@dataclass(frozen=True)
class Compare:
    """Run scenes by an engine and by the equations, and say how far apart they are.

    Example: robotball compare fig12 --preset fast,accurate
    """

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="SCENE...", help_behavior_hint="")]]
    """Names from the catalog, or paths to TOML files."""
    preset: Names = ()
    """The engine's settings to run each scene with. Several: naive,fast. There are
    naive, fast, balanced (if not given), accurate, adaptive; other engines have others."""
    run_options: RunOptions = field(default_factory=Run)
    plots: bool = True
    """Draw each scene's paths and momentum into the output folder."""
    json: File = None
    """Also write the results as a list of objects, one a scene and preset."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        from rich.console import Console

        from robotball import InputError, Scene
        from validation.comparison.names import scenes_of
        from validation.comparison.results import write_csv, write_json
        from validation.comparison.runs import compare_all, tell_fault_windows
        from validation.comparison.table import show
        from validation.output import writable_folder

        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        options = self.run_options
        requests = [options.request(name) for name in listed(self.preset) or (None,)]
        self._check_no_preset_is_a_scene(requests[0].engine.presets)
        scenes_by_file = scenes_of(self.scenes)
        scenes = list(scenes_by_file.values())
        check_files(self.json, self.csv)
        out = writable_folder(options.out)
        files = {scene.name: file for file, scene in scenes_by_file.items()}
        refused: list[str] = []

        def refuse(scene: Scene, error: InputError) -> None:
            file = files[scene.name]
            name = scene.name if file == scene.name else f"{scene.name} ({file})"
            refused.append(f"{name}: {error}")

        agreements = compare_all(
            scenes,
            requests,
            times_of(options.duration),
            strict=options.strict,
            fault_windows=out,
            refuse=refuse,
        )
        if not agreements:
            raise InputError("; ".join(refused))
        if self.json:
            write_json(self.json, agreements)
        if self.csv:
            write_csv(self.csv, agreements)
        if self.plots:
            from validation.comparison.plots import draw

            for scene in scenes:
                if drawn := [each for each in agreements if each.scene is scene]:
                    draw(drawn, out)
        show(agreements, Console())
        tell_fault_windows(agreements, out)
        for line in refused:
            print(f"robotball: {line}", file=sys.stderr)
        if refused:
            return BAD_INPUT
        return AGREES if all(agreement.agrees for agreement in agreements) else DISAGREES

    def _check_no_preset_is_a_scene(self, presets: Collection[str]) -> None:
        from robotball import InputError, catalog

        for name in self.scenes:
            if name in presets and name not in catalog():
                several = ",".join([*listed(self.preset), name])
                raise InputError(f"{name!r} is a preset and no scene: write --preset {several}")
