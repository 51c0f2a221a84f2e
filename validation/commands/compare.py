"""The command `robotball compare`."""

import sys
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import partial
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
    Threads,
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
    threads: Threads = None
    json: File = None
    """Also write the results as a list of objects, one a scene and preset."""
    csv: File = None
    """Also write the table as CSV."""

    def run(self) -> int:
        from validation.plots import prepare_drawing

        if self.plots:  # before the imports that take longest
            prepare_drawing(len(self.scenes))

        from rich.console import Console

        from robotball import InputError
        from validation.output import writable_folder
        from validation.results import scenes_of, show, write_csv, write_json
        from validation.runs import Comparing, compare_all, tell_fault_windows

        if not self.scenes:
            raise InputError("compare needs a scene; `robotball scenes` lists the catalog")
        options = self.run_options
        requests = [partial(options.request, name) for name in listed(self.preset) or (None,)]
        presets = [make().engine.presets for make in requests]
        self._check_no_preset_is_a_scene(presets[0])
        scenes = scenes_of(self.scenes)
        check_files(self.json, self.csv)
        out = writable_folder(options.out)
        times = times_of(options.duration)
        comparing = Comparing(requests, times, options.strict, out, self.plots)
        found = compare_all(list(scenes.values()), comparing)
        records = [record for each in found for record in each.records]
        refused = [
            f"{scene.name if file == scene.name else f'{scene.name} ({file})'}: {each.refused}"
            for (file, scene), each in zip(scenes.items(), found, strict=True)
            if each.refused is not None
        ]
        if not records:
            raise InputError("; ".join(refused))
        if self.json:
            write_json(self.json, records)
        if self.csv:
            write_csv(self.csv, records)
        show(records, Console())
        tell_fault_windows(window for each in found for window in each.windows)
        pictures = [picture for each in found for picture in each.pictures]
        if pictures:
            print("plots:", pictures[0], f"and {len(pictures) - 1} more beside it")
        for line in refused:
            print(f"robotball: {line}", file=sys.stderr)
        if refused:
            return BAD_INPUT
        return AGREES if all(record["agrees"] for record in records) else DISAGREES

    def _check_no_preset_is_a_scene(self, presets: Collection[str]) -> None:
        from robotball import InputError, catalog

        for name in self.scenes:
            if name in presets and name not in catalog():
                several = ",".join([*listed(self.preset), name])
                raise InputError(f"{name!r} is a preset and no scene: write --preset {several}")
