"""The command `robotball section`."""

from dataclasses import dataclass
from pathlib import Path

from validation.commands.arguments import AGREES, OUT, File, Preset, SceneName, Threads


@dataclass(frozen=True)
class Section:
    """Draw a scene's Poincaré section g = g₀ on the annulus (l, L).

    Example: robotball section fig12 --starts 4 --count 500
    """

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
    """Draw the engine's crossings as well, of the scene's own start, with these settings."""
    seed: int = 0
    """Of the random starts."""
    out: Path = OUT
    """Folder for the picture."""
    threads: Threads = None
    json: File = None
    """Also write the points."""

    def run(self) -> int:
        import numpy as np

        from robotball import preset
        from robotball.engines.mujoco import LABEL
        from robotball.engines.reduced import LABEL as EQUATIONS
        from robotball.errors import check_count
        from validation.commands.suited import may_come_to_rest, moving_scene
        from validation.output import progress_bar, writable_folder, write_picture, write_record
        from validation.results import changed, file_name
        from validation.studies.contact_sections import (
            draw_section,
            level_starts,
            section_by_contact,
            section_by_equations,
        )

        scene = moving_scene(self.scene, "a section")
        settings = None if self.preset is None else preset(self.preset)
        words = ["section", *changed(self, "starts", "count", "skip", "g", "seed")]
        if settings is None:
            name = file_name(scene.name, None, words)
        else:
            name = file_name(scene.name, LABEL, [settings.name, *words])
        path = writable_folder(self.out) / f"{name}.png"
        attitudes, momenta = level_starts(scene, self.starts, self.seed, self.g)
        total = check_count("skip", self.skip, 0) + check_count("count", self.count, 1)
        with progress_bar(1 if settings is None else 2) as show:
            show(0, f"{scene.name}: equations")
            points = section_by_equations(scene, attitudes, momenta, total, self.g)
            engine = None
            if settings is not None:
                show(1, f"{scene.name}: {LABEL.name}, {settings.name}")
                duration = float(points.times[0, -1])
                engine = section_by_contact(scene, settings, duration, self.g).late(self.skip)
            points = points.late(self.skip)
            write_picture(path, draw_section(scene, points, engine, self.g))
        drawn = {EQUATIONS.name: points} | ({} if engine is None else {LABEL.name: engine})
        for name, each in drawn.items():
            growing = int(np.count_nonzero(each.directions == 1))
            total = len(each.directions)
            print(f"{name}: {total} crossings, {growing} with g growing, {total - growing} falling")
        if may_come_to_rest(scene):
            print("a straight-line motion with this M² attracts: what ends there crosses only by")
            print(f"rounding; 'robotball equilibria {self.scene}' lists it")
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
