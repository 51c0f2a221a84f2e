"""What stands still, as rows of a table and as plain data."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import ContactPath, FixedCircle, FixedPoint
from robotball.qualitative.straight_motions import StraightMotion
from robotball.rotations import Array

NEARLY_STRAIGHT = 1e9  # radii of the ball: beyond, what bends a path is rounding


def circle_rows(circle: FixedCircle) -> list[tuple[str, str, str, str]]:
    """The two halves of the circle of fixed points as rows of the table."""
    rows = []
    for name, angles, word in (
        ("Σ_s", (0.0, np.pi / 2), "attracts"),
        ("Σ_u", (np.pi / 2, np.pi), "repels"),
    ):
        ends = circle.at(np.array(angles))
        rates = circle.rate(circle.at(np.linspace(*angles, 400)))
        fastest = rates[np.argmax(np.abs(rates))]
        span = f"± from {row(ends[0])}\nto {row(ends[1])}"
        rows.append((name, span, f"0, and 0 to {fastest:.4g}", f"{word},\nstraight line"))
    return rows


def straight_row(line: StraightMotion) -> tuple[str, str, str, str]:
    """A straight-line motion as a row of the table."""
    kind = "stable" if line.is_stable else "unstable"
    return "straight", row(line.gamma), row(line.eigenvalues), kind


def path_words(path: ContactPath, a: float) -> str:
    """What the contact point runs on, at a fixed point of a ball of radius a [m]."""
    if path.speed < a * max(abs(path.turning), 1.0) / NEARLY_STRAIGHT:
        return "spins on the spot" if path.turning else "at rest"
    straight = path.radius > NEARLY_STRAIGHT * a
    return "straight line" if straight else f"circle of {path.radius:.4g} m"


def record(
    points: Sequence[FixedPoint],
    paths: Sequence[ContactPath],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
    lines: Sequence[StraightMotion],
    more: dict[str, Any],
    names: Sequence[str] = (),
) -> dict[str, Any]:
    """All of it as plain data."""
    return {
        "fixed_points": [
            {
                "name": name,
                "gamma": p.gamma.tolist(),
                "eigenvalues": pairs(p.eigenvalues),
                "kind": p.kind,
                "contact_speed": c.speed,
                "contact_turning": c.turning,
            }
            for name, p, c in zip(names, points, paths, strict=True)
        ],
        "fixed_circle": circle and {"axes": circle.axes.tolist(), "index": circle.index},
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
        **more,
    }


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
