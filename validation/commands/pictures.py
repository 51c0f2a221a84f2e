"""The commands that draw what a ball does: figures, section.

They load what they need when they run: compiled code and plots take a while to come.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import Positional, arg

from robotball import load_scene, preset
from robotball.errors import check_count
from validation.attractors.level import level_starts
from validation.commands.arguments import AGREES, OUT, File, Preset, SceneName
from validation.results import replacing, writable_folder, write_record
from validation.runs import progress_bar


@dataclass(frozen=True)
class Figures:
    """Draw the paper's Figs 5 to 14, each with its facts and with MuJoCo's motion over it."""

    numbers: Positional[Annotated[tuple[int, ...], arg(metavar="N...")]] = ()
    """Which figures; all of them if none is given."""
    out: Path = OUT
    """Folder for the pictures."""
    json: File = None
    """Also write which files were drawn."""

    def run(self) -> int:
        from validation.figures.figures import chosen, draw_figures

        pictures, out = chosen(self.numbers), writable_folder(self.out)
        with progress_bar(len(pictures)) as show:
            written = draw_figures(self.numbers, out, show)
        print(*written, sep="\n")
        write_record(self.json, {"figures": [str(path) for path in written]})
        return AGREES


@dataclass(frozen=True)
class Section:
    """Draw a scene's Poincaré section g = g₀ on the annulus (l, L)."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    starts: int = 1
    """Motions to follow: the scene's own alone, or as many random ones with its M² and (M, γ)."""
    count: int = 2000
    """Crossings of each."""
    skip: int = 0
    """Crossings of each to leave out first."""
    g: float = 0.0
    """The section's g₀ [rad]."""
    preset: Preset = None
    """Draw MuJoCo's crossings as well, of the scene's own start, with these settings."""
    seed: int = 0
    """Of the random starts."""
    out: Path = OUT
    """Folder for the picture."""
    json: File = None
    """Also write the points."""

    def run(self) -> int:
        from validation.attractors.section_study import (
            draw_section,
            section_by_contact,
            section_by_equations,
        )

        scene = load_scene(self.scene)
        settings = None if self.preset is None else preset(self.preset)
        path = writable_folder(self.out) / f"{scene.name}-section.png"
        attitudes, momenta = level_starts(scene, self.starts, self.seed, self.g)
        total = check_count("skip", self.skip, 0) + check_count("count", self.count, 1)
        with progress_bar(1 if settings is None else 2) as show:
            show(0, f"{scene.name}: equations")
            points = section_by_equations(scene, attitudes, momenta, total, self.g)
            engine = None
            if settings is not None:
                show(1, f"{scene.name}: MuJoCo, {settings.name}")
                duration = float(points.times[0, -1])
                engine = section_by_contact(scene, settings, duration, self.g).late(self.skip)
            points = points.late(self.skip)
            with replacing(path) as temporary:
                draw_section(scene, points, engine, self.g).savefig(temporary, dpi=120)
        drawn = {"equations": points} | ({} if engine is None else {"mujoco": engine})
        for name, each in drawn.items():
            growing = int(np.count_nonzero(each.directions == 1))
            total = len(each.directions)
            print(f"{name}: {total} crossings, {growing} with g growing, {total - growing} falling")
        print(path)
        write_record(
            self.json,
            {"scene": scene.name, "g": self.g, "starts": self.starts, "seed": self.seed}
            | {
                name: {field: values.tolist() for field, values in vars(each).items()}
                for name, each in drawn.items()
            },
        )
        return AGREES
