"""Basins of attraction: the share of random starts that reach each attractor of a scene."""

from dataclasses import dataclass

from robotball.dynamics.long_run import CHAOS, LINE, LOST, TORUS, basins
from robotball.errors import check_count

from ..options import AGREES, File, SceneName, Threads
from ..output import progress_bar, write_record
from ..study import Column, show, table_of
from .contact_sections import attracted_scene, level_starts


@dataclass(frozen=True)
class Basins:
    """Tell which attractor each of many random starts of a scene's ball reaches.

    Example: robotball basins fig12 --starts 100
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    starts: int = 1000
    """Random starts with the scene's M² and (M, γ)."""
    transient: float = 3000.0
    """Time that each is given to reach it [s]."""
    seed: int = 0
    """The seed of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the starts and what they reach."""

    def run(self) -> int:
        scene = attracted_scene(self.scene, "a basin")
        check_count("starts", self.starts, 2)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(1) as progress:
            progress(0, f"{scene.name}: {self.starts} starts")
            found = basins(scene.parameters, attitudes, momenta, self.transient)
        names = {TORUS: "torus", CHAOS: "chaos", LINE: "straight line"}
        names |= {LOST: "stops crossing g = 0"}
        names |= {i: f"cycle of period {of.period:.6f} s" for i, of in enumerate(found.cycles)}
        rows = [
            {"name": name, "share": share}
            for label, name in sorted(names.items(), reverse=True)
            if (share := found.share(label)) > 0
        ]
        columns = (
            Column("attractor", "name", words=True),
            Column("share of the starts", "share", form=".3f"),
        )
        show([table_of(columns, rows)])
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
