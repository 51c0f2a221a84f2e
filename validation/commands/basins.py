"""The command `robotball basins`."""

from dataclasses import dataclass

from validation.commands.arguments import AGREES, File, SceneName, Threads


@dataclass(frozen=True)
class Basins:
    """Tell which attractor each of many random starts of a scene's ball reaches.

    Example: robotball basins fig12 --starts 100
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    starts: int = 1000
    """Random starts with the scene's M² and (M, γ)."""
    transient: float = 3000.0
    """Time that each is given to reach it [s]."""
    seed: int = 0
    """Of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the starts and what they reach."""

    def run(self) -> int:
        from rich import box
        from rich.console import Console
        from rich.table import Table

        from robotball.errors import check_count
        from robotball.qualitative.basins import CHAOS, LINE, LOST, TORUS, basins
        from validation.commands.suited import attracted_scene
        from validation.output import print_whole, progress_bar, write_record
        from validation.studies.contact_sections import level_starts

        scene = attracted_scene(self.scene, "a basin")
        check_count("starts", self.starts, 2)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(1) as show:
            show(0, f"{scene.name}: {self.starts} starts")
            found = basins(scene.parameters, attitudes, momenta, self.transient)
        names = {
            TORUS: "torus",
            CHAOS: "chaos",
            LINE: "straight line",
            LOST: "stops crossing g = 0",
        }
        for i, cycle in enumerate(found.cycles):
            names[i] = f"cycle of period {cycle.period:.6f} s"
        table = Table("attractor", "share of the starts", box=box.SIMPLE_HEAD)
        for label, name in sorted(names.items(), reverse=True):
            if found.share(label) > 0:
                table.add_row(name, f"{found.share(label):.3f}")
        print_whole(table, Console())
        write_record(
            self.json,
            {
                "scene": scene.name,
                "seed": self.seed,
                "transient": self.transient,
                "attitudes": attitudes.tolist(),
                "reached": [names[label] for label in found.labels.tolist()],
            },
        )
        return AGREES
