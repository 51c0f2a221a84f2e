"""The command `robotball equilibria`."""

from dataclasses import dataclass

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from robotball import load_scene
from robotball.rotations import Array, rotation_matrix
from validation.commands.arguments import AGREES, File, SceneName
from validation.output import write_record
from validation.progress import progress_bar
from validation.studies.attractors.level import level_starts

BATCH = 16  # starts followed at once, between two moves of the progress bar


@dataclass(frozen=True)
class Equilibria:
    """List what stands still: fixed points from rest, straight-line motions, limit cycles."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    longest: float = 100.0
    """Period of the longest limit cycle to look for [s]; 0 for none."""
    json: File = None
    """Also write them."""

    def run(self) -> int:
        from robotball.qualitative.equilibria import contact_path, fixed_points
        from robotball.qualitative.limit_cycles import limit_cycles
        from robotball.qualitative.straight_motions import straight_motion, straight_motions

        scene = load_scene(self.scene)
        ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
        with progress_bar(2) as show:
            show(0, f"{scene.name}: fixed points")
            rubber = ball.rolling == "rubber"
            points = fixed_points(ball) if rubber else []
            lines = straight_motions(ball, f) if rubber and f > 0 else []
            show(1, f"{scene.name}: limit cycles")
            cycles = limit_cycles(ball, self.longest) if rubber and self.longest > 0 else []
            if not rubber:
                gamma = level_starts(scene, 1, 0)[0]
                lines = [straight_motion(ball, rotation_matrix(gamma)[0, 2])]
        table = Table("", "γ", "eigenvalues [1/s] or multiplier", "", box=box.SIMPLE_HEAD)
        circles = [contact_path(ball, point.gamma) for point in points]
        for point, circle in zip(points, circles, strict=True):
            # Beyond that, what bends the line is rounding.
            straight = circle.radius > 1e9 * scene.ball.radius
            path = "straight line" if straight else f"circle of {circle.radius:.4g} m"
            kind = f"{point.kind},\n{path}"
            table.add_row("fixed", row(point.gamma), row(point.eigenvalues), kind)
        for cycle in cycles:
            kind = f"period {cycle.period:.7f} s"
            table.add_row("cycle", row(cycle.gamma), row(cycle.multipliers), kind)
        for line in lines:
            kind = "stable" if line.is_stable else "unstable"
            table.add_row("straight", row(line.gamma), row(line.eigenvalues), kind)
        console = Console()
        if rubber:
            console.print("Fixed points and cycles of the motion from rest (M = 0), straight-line")
            console.print(f"motions with the scene's M² = {f:g} (kg m²/s)²; γ in principal axes:")
        else:
            console.print(
                "A classical ball can roll straight on at any γ; at the scene's own, with"
            )
            console.print(f"M = ({row(lines[0].momentum)}) kg m²/s; γ in principal axes:")
        console.print(table)
        write_record(
            self.json,
            {
                "scene": scene.name,
                "fixed_points": [
                    {
                        "gamma": p.gamma.tolist(),
                        "eigenvalues": pairs(p.eigenvalues),
                        "kind": p.kind,
                        "contact_speed": c.speed,
                        "contact_turning": c.turning,
                    }
                    for p, c in zip(points, circles, strict=True)
                ],
                "limit_cycles": [
                    {
                        "gamma": c.gamma.tolist(),
                        "period": c.period,
                        "multipliers": pairs(c.multipliers),
                    }
                    for c in cycles
                ],
                "straight_motions": [
                    {
                        "gamma": s.gamma.tolist(),
                        "eigenvalues": pairs(s.eigenvalues),
                        "speed": s.speed,
                    }
                    for s in lines
                ],
            },
        )
        return AGREES


def row(values: Array) -> str:
    """Numbers side by side, rounding left out; conjugate ones as a ± bi."""
    values = np.round(values, 12) + 0.0
    if np.isrealobj(values) or not np.any(values.imag):
        return ", ".join(f"{x:.5g}" for x in values.real)
    above = [z for z in values if z.imag >= 0]
    return ", ".join(f"{z.real:.4g} ± {z.imag:.4g}i" if z.imag else f"{z.real:.4g}" for z in above)


def pairs(values: Array) -> list[list[float]]:
    """Complex numbers as [real, imaginary]."""
    return [[float(z.real), float(z.imag)] for z in values]
