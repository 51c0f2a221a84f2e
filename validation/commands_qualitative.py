"""The commands about what a ball does: figures, section, lyapunov, basins, equilibria.

They load what they need when they run: compiled code and plots take a while to come.
"""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from tyro.conf import DisallowNone, Positional, arg

from robotball import InputError, Scene, load_scene, preset
from robotball.rotations import Array, multiply
from validation.arguments import AGREES, OUT, File, SceneName
from validation.results import replacing, versions, writable_file, writable_folder
from validation.runs import progress_bar

Preset = DisallowNone[Annotated[str | None, arg(metavar="PRESET")]]
BATCH = 16  # starts followed at once, between two moves of the progress bar


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
        from validation.figures import chosen, draw_figures

        pictures, out = chosen(self.numbers), writable_folder(self.out)
        with progress_bar(len(pictures)) as show:
            written = draw_figures(self.numbers, out, show)
        print(*written, sep="\n")
        save(self.json, {"figures": [str(path) for path in written]})
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
        from validation.section_study import draw_section, section_by_contact, section_by_equations

        scene = load_scene(self.scene)
        settings = None if self.preset is None else preset(self.preset)
        path = writable_folder(self.out) / f"{scene.name}-section.png"
        attitudes, momenta = level_starts(scene, self.starts, self.seed, self.g)
        kept = slice(check_count("skip", self.skip, 0), None)
        total = self.skip + check_count("count", self.count, 1)
        with progress_bar(1 if settings is None else 2) as show:
            show(0, f"{scene.name}: equations")
            points = section_by_equations(scene, attitudes, momenta, total, self.g)[:, kept]
            engine = None
            if settings is not None:
                show(1, f"{scene.name}: MuJoCo, {settings.name}")
                duration = float(points["time"][0, -1])
                engine = section_by_contact(scene, settings, duration, self.g)[kept]
            with replacing(path) as temporary:
                draw_section(scene, points.ravel(), engine, self.g).savefig(temporary, dpi=120)
        drawn = {"equations": points.ravel(), **({} if engine is None else {"mujoco": engine})}
        for name, each in drawn.items():
            both = Counter(each["direction"].tolist())
            print(f"{name}: {len(each)} crossings, {both[1]} with g growing, {both[-1]} falling")
        print(path)
        save(
            self.json,
            {"scene": scene.name, "g": self.g, "starts": self.starts, "seed": self.seed}
            | {
                name: {field: each[field].tolist() for field in each.dtype.names or ()}
                for name, each in drawn.items()
            },
        )
        return AGREES


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
        from robotball.lyapunov import Exponents, exponents
        from robotball.model import build
        from validation.contact_exponent import contact_exponent

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
        save(self.json, record)
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
        from robotball.basins import CHAOS, LOST, TORUS, basins

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
        save(
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
        from robotball.equilibria import fixed_points
        from robotball.limit_cycles import limit_cycles
        from robotball.straight_motions import straight_motions

        scene = load_scene(self.scene)
        ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
        with progress_bar(2) as show:
            show(0, f"{scene.name}: fixed points")
            points = fixed_points(ball)
            lines = straight_motions(ball, f) if f > 0 else []
            show(1, f"{scene.name}: limit cycles")
            cycles = limit_cycles(ball, self.longest) if self.longest > 0 else []
        table = Table("", "γ", "eigenvalues [1/s] or multiplier", "", box=box.SIMPLE_HEAD)
        for point in points:
            table.add_row("fixed", row(point.gamma), row(point.eigenvalues), point.kind)
        for cycle in cycles:
            kind = f"period {cycle.period:.7f} s"
            table.add_row("cycle", row(cycle.gamma), row(cycle.multipliers), kind)
        for line in lines:
            kind = "stable" if line.is_stable else "unstable"
            table.add_row("straight", row(line.gamma), row(line.eigenvalues), kind)
        console = Console()
        console.print("Fixed points and cycles of the motion from rest (M = 0), and straight-line")
        console.print(
            f"motions with the scene's M² = {f:g} (kg m²/s)²; γ in principal axes:", table
        )
        save(
            self.json,
            {
                "scene": scene.name,
                "fixed_points": [
                    {"gamma": p.gamma.tolist(), "eigenvalues": pairs(p.eigenvalues), "kind": p.kind}
                    for p in points
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


def level_starts(scene: Scene, count: int, seed: int, g: float = 0.0) -> tuple[Array, Array]:
    """Attitudes (n, 4), principal axes, and world momenta (n, 3) on the scene's level of M.

    The scene's own start for a count of 1, else random points of its section g = `g`.
    """
    from robotball.sections import section_starts

    check_count("starts", count, 1)
    M = scene.start.momentum
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    if count == 1:
        return attitude[None], M[None]
    random, f = np.random.default_rng(seed), float(M @ M)
    L = random.uniform(-1.0, 1.0, count) * np.sqrt(f)
    # The rubber model's M is horizontal by (3.1).
    c = float(M[2]) if scene.rolling == "classical" else 0.0
    return section_starts(L, random.uniform(-np.pi, np.pi, count), f, g, c)


def check_count(name: str, value: int, least: int) -> int:
    """`value`; raises InputError where it is below `least`."""
    if value < least:
        raise InputError(f"{name} must be at least {least}, not {value}")
    return value


def row(values: Array) -> str:
    """Numbers side by side; complex ones that are real, as real ones."""
    if np.isrealobj(values) or not np.any(values.imag):
        return ", ".join(f"{x:.5g}" for x in values.real)
    return ", ".join(f"{z.real:.4g}{z.imag:+.4g}i" for z in values)


def pairs(values: Array) -> list[list[float]]:
    """Complex numbers as [real, imaginary]."""
    return [[float(z.real), float(z.imag)] for z in values]


def save(path: Path | None, record: Mapping[str, Any]) -> None:
    """The record with the versions it depends on as JSON, if a path is given."""
    if path is None:
        return
    text = json.dumps({**record, "versions": versions()}, indent=1, allow_nan=False)
    with replacing(writable_file(path)) as temporary:
        temporary.write_text(text + "\n")
