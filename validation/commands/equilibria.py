"""The command `robotball equilibria`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from validation.commands.arguments import AGREES, OUT, File, SceneName, Threads

if TYPE_CHECKING:
    from robotball import Scene


@dataclass(frozen=True)
class Equilibria:
    """List and draw fixed points and limit cycles of the motion from rest, and straight lines.

    Example: robotball equilibria fig06
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    longest: float = 100.0
    """Period of the longest limit cycle to look for [s]; 0 for none."""
    out: Path = OUT
    """Folder for the picture of the motion from rest."""
    threads: Threads = None
    json: File = None
    """Also write them."""

    def run(self) -> int:
        import numpy as np

        from robotball import InputError
        from validation.commands.suited import steady_scene

        scene = steady_scene(self.scene, "an equilibrium")
        if scene.rolling == "classical":
            return self._classical(scene)
        if not np.any([scene.parameters.Omega, scene.parameters.K]):
            raise InputError(
                f"{scene.name}: nothing turns inside (Ω = 0, K = 0), so from rest the ball rests "
                f"at every γ; 'robotball section {self.scene}' shows how it rolls"
            )
        return self._rubber(scene)

    def _classical(self, scene: Scene) -> int:
        """A classical ball has an equilibrium at every γ, and no motion from rest of its own."""
        from rich import box
        from rich.console import Console
        from rich.table import Table

        from robotball.qualitative.straight_motions import straight_motion
        from robotball.rotations import rotation_matrix
        from validation.output import print_whole, write_record
        from validation.studies.contact_sections import level_starts
        from validation.studies.equilibria import record, row, straight_row

        gamma = rotation_matrix(level_starts(scene, 1, 0)[0])[0, 2]
        line = straight_motion(scene.parameters, gamma)
        table = Table("", "γ", "eigenvalues [1/s]", "", box=box.SIMPLE_HEAD)
        table.add_row(*straight_row(line))
        console = Console()
        console.print("A classical ball can roll straight on at any γ; at the scene's own, with")
        console.print(f"M = ({row(line.momentum)}) kg m²/s; γ in principal axes:")
        print_whole(table, console)
        write_record(self.json, {"scene": scene.name, **record((), (), None, (), (line,), {})})
        return AGREES

    def _rubber(self, scene: Scene) -> int:
        import numpy as np
        from rich import box
        from rich.console import Console
        from rich.table import Table

        from robotball.qualitative.equilibria import (
            contact_path,
            fixed_circle,
            fixed_points,
            index_sum,
            name_of,
        )
        from robotball.qualitative.portraits import limit_cycles
        from robotball.qualitative.straight_motions import stability_limit, straight_motions
        from validation.figures.sphere import portrait
        from validation.output import (
            print_whole,
            progress_bar,
            writable_folder,
            write_picture,
            write_record,
        )
        from validation.results import changed, file_name
        from validation.studies.equilibria import circle_rows, path_words, record, row, straight_row

        ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
        name = file_name(scene.name, None, ["equilibria", *changed(self, "longest")])
        picture = writable_folder(self.out) / f"{name}.png"
        with progress_bar(3) as show:
            show(0, f"{scene.name}: fixed points")
            points, circle = fixed_points(ball), fixed_circle(ball)
            points.sort(key=lambda point: name_of(ball, point.gamma))
            lines = straight_motions(ball, f) if f > 0 and np.any(ball.Omega) else []
            show(1, f"{scene.name}: limit cycles")
            cycles = limit_cycles(ball, self.longest) if self.longest > 0 else []
            show(2, f"{scene.name}: picture")
            write_picture(picture, portrait(scene.title, ball, points, circle, cycles))
        paths = [contact_path(ball, point.gamma) for point in points]
        names = [name_of(ball, point.gamma) for point in points]
        table = Table("", "γ", "eigenvalues [1/s] or multiplier", "", box=box.SIMPLE_HEAD)
        for name, point, path in zip(names, points, paths, strict=True):
            words = f"{point.kind},\n{path_words(path, ball.a)}"
            table.add_row(name or "fixed", row(point.gamma), row(point.eigenvalues), words)
        if circle is not None:
            for cells in circle_rows(circle):
                table.add_row(*cells)
        for cycle in cycles:
            words = f"period {cycle.period:.7f} s"
            table.add_row("cycle", row(cycle.gamma), row(cycle.multipliers), words)
        for line in lines:
            table.add_row(*straight_row(line))
        console = Console()
        console.print(
            "Fixed points and cycles of the motion from rest (M = 0); γ in principal axes."
        )
        if lines:
            console.print(
                f"Straight-line motions are those with the scene's M² = {f:g} (kg m²/s)²."
            )
        print_whole(table, console)
        indices = f"The indices of the points add up to {index_sum(points)}"
        if circle is not None:
            indices += f", with the {circle.index} of the circle (Ω, γ) = 0 to 2"
        console.print(f"{indices}, as they must on a sphere.")
        if limit := stability_limit(ball):
            console.print(
                f"Two straight-line motions are stable where M² < {limit:.6g} (kg m²/s)²."
            )
        if not np.any(ball.Omega):
            console.print("Ω = 0: every motion from rest is closed, and none attracts.")
        print(picture)
        kept = {"picture": str(picture)}
        write_record(
            self.json,
            {"scene": scene.name, **record(points, paths, circle, cycles, lines, kept, names)},
        )
        return AGREES
