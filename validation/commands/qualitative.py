"""The commands about what a ball does in the long run: lyapunov, basins, equilibria.

They load what they need when they run: compiled code and plots take a while to come.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from robotball import load_scene, preset
from robotball.errors import check_count
from robotball.rotations import Array, rotation_matrix
from validation.attractors.level import level_starts
from validation.commands.arguments import AGREES, File, Preset, SceneName
from validation.results import write_record
from validation.runs import progress_bar

BATCH = 16  # starts followed at once, between two moves of the progress bar


@dataclass(frozen=True)
class Lyapunov:
    """Measure a scene's Lyapunov exponents, by the equations and, if asked, by MuJoCo."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    starts: int = 16
    """Random starts with the scene's M² and (M, γ); for 1 the scene's own."""
    duration: float = 10_000.0
    """Time over which each is measured [s]."""
    transient: float = 1000.0
    """Time before that [s]."""
    preset: Preset = None
    """Also measure the largest one by MuJoCo with these settings, of a tenth of the duration."""
    seed: int = 0
    """Of the random starts."""
    json: File = None
    """Also write the results, start by start."""

    def run(self) -> int:
        from robotball.contact.model import build
        from robotball.qualitative.lyapunov import Exponents, exponents
        from validation.attractors.contact_exponent import contact_exponent

        scene = load_scene(self.scene)
        settings = None if self.preset is None else preset(self.preset)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        record: dict[str, Any] = {"scene": scene.name, "starts": self.starts, "seed": self.seed}
        with progress_bar(self.starts * (1 if settings is None else 2)) as show:
            parts = []
            for i in range(0, self.starts, BATCH):
                show(i, f"{scene.name}: equations")
                batch = slice(i, i + BATCH)
                parts.append(
                    exponents(
                        scene.parameters,
                        attitudes[batch],
                        momenta[batch],
                        self.duration,
                        self.transient,
                    )
                )
            found = Exponents(
                np.concatenate([part.largest for part in parts]),
                np.concatenate([part.divergence for part in parts]),
                self.duration,
            )
            rows = {
                "λ₁ [1/s]": (found.mean[0], found.error[0]),
                "λ₆ [1/s]": (found.mean[1], found.error[1]),
                "sum [1/s]": (float(found.divergence.mean()), None),
                "dimension of the section": (found.dimension, found.dimension_error),
            }
            record |= {
                "duration": self.duration,
                "largest": found.largest.tolist(),
                "smallest": found.smallest.tolist(),
                "dimension": found.dimension,
            }
            if settings is not None:
                contact = contact_exponent(
                    build(scene, settings),
                    attitudes,
                    momenta,
                    self.duration / 10,
                    min(100.0, self.transient),
                    interval=10.0,
                    progress=lambda part: show(self.starts * (1 + part), f"{scene.name}: MuJoCo"),
                )
                rows[f"λ₁ by MuJoCo, {settings.name} [1/s]"] = (contact.mean, contact.error)
                record |= {
                    "mujoco_duration": self.duration / 10,
                    "mujoco_largest": (contact.growth.mean(axis=1) / contact.interval).tolist(),
                }
        table = Table("", "mean", "standard error", box=box.SIMPLE_HEAD)
        for name, (value, error) in rows.items():
            known = error is not None and np.isfinite(error)
            table.add_row(name, f"{value:.6g}", f"{error:.1g}" if known else "-")
        Console().print(table)
        write_record(self.json, record)
        return AGREES


@dataclass(frozen=True)
class Basins:
    """Tell which attractor each of many random starts of a scene's ball reaches."""

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    starts: int = 1000
    """Random starts with the scene's M² and (M, γ)."""
    transient: float = 3000.0
    """Time that each is given to reach it [s]."""
    seed: int = 0
    """Of the random starts."""
    json: File = None
    """Also write the starts and what they reach."""

    def run(self) -> int:
        from robotball.qualitative.basins import CHAOS, LOST, TORUS, basins

        scene = load_scene(self.scene)
        check_count("starts", self.starts, 2)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        with progress_bar(1) as show:
            show(0, f"{scene.name}: {self.starts} starts")
            found = basins(scene.parameters, attitudes, momenta, self.transient)
        names = {TORUS: "torus", CHAOS: "chaos", LOST: "not followed"}
        for i, cycle in enumerate(found.cycles):
            names[i] = f"cycle of period {cycle.period:.6f} s"
        table = Table("attractor", "share of the starts", box=box.SIMPLE_HEAD)
        for label, name in sorted(names.items(), reverse=True):
            if found.share(label) > 0:
                table.add_row(name, f"{found.share(label):.3f}")
        Console().print(table)
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
