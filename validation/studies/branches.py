"""Bifurcation diagrams: branches of a ball's motions as one number changes."""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from robotball import InputError, Scene, load_scene
from robotball.dynamics import motion_branches as motions
from robotball.dynamics.continuation import (
    BRANCH,
    DOUBLING,
    DRIFT,
    FOLD,
    HOPF,
    Branch,
    Point,
    Watch,
)
from robotball.dynamics.cycles import Cycle, limit_cycles
from robotball.dynamics.equilibria import name_of
from robotball.dynamics.long_run import basins
from robotball.dynamics.motion_branches import NUMBERS
from robotball.dynamics.strobed_branches import Driven, swinging
from robotball.errors import check_positive, unknown
from robotball.robot.formulas import Parameters
from robotball.robot.looks import ACCENT, INK

from ..options import span_of
from ..output import Show, halo, panels, progress_bar
from ..plots import note
from ..study import Column, Row, Study, show, table_of
from .contact_sections import level_starts, steady_scene

_NO_BOUND = "period without bound"
_MARKERS = {FOLD: "^", BRANCH: "s", HOPF: "o", DOUBLING: "D", DRIFT: "P", _NO_BOUND: "*"}
_LINES: Any = {"c": INK, "lw": 1.6, "ls": "--"}, {"c": INK, "lw": 2.2}  # unstable, stable
_PLACE = ("value", "gamma1", "gamma2", "gamma3")
_SENSES = ("supercritical", "subcritical")
_ROUNDING = 1e-9  # 1/s; a smaller l₁ is rounding
_LONGEST = 300.0  # s, longest period
_SEARCHED, _STARTS = 100.0, 16  # s, longest period of the search; random starts if M ≠ 0
_INSIDE = 3  # values inside the range at which to search for cycles, a few seconds each
_ZERO = 1e-9  # fraction of the range; a smaller number is 0
_WRITE_EVERY = 5.0  # s between writes of partial results
_OF_THE_REST = 0.02  # fraction of the remaining progress that each point of a branch takes


# Writes a partial study, and returns the path of its picture.
_Save = Callable[[Study], Path]


def _row_of(family: motions.Range, branch: int, point: Point) -> dict[str, Any]:
    """Return a point of a branch as plain data in SI units and principal axes."""
    u, s = point.x[:-1], float(point.x[-1])
    ball, size, *_ = family.at(s)
    gamma, *mu = motions.vectors_of(u)
    M = size * mu[0] if mu else np.zeros(3)
    period = float(np.exp(u[-1])) if len(u) % 3 else None
    exponents = point.exponents[np.argsort(-point.exponents.real)] / (period or 1.0)
    vectors = {"gamma": gamma, "M": M, "real": exponents.real, "imaginary": exponents.imag}
    return {
        "branch": branch,
        # Points with three unknowns (γ of a motion from rest) have names in the paper.
        "name": name_of(ball, gamma) if len(u) == 3 else str(branch),
        "value": family.value(s),
        "kind": point.kind,
        "stable": point.is_stable,
        "period": period,
        **{f"{name}{i}": float(x) for name, v in vectors.items() for i, x in enumerate(v, 1)},
    }


def _special(family: motions.Range, number: int, branch: Branch) -> Iterator[Row]:
    """Yield the special points of a branch with explanations, and the ends of unbounded period."""
    for point in branch.special():
        row, explanation = _row_of(family, number, point), ""
        if point.kind == DRIFT:
            explanation = "drifting motions begin"
        elif point.kind == HOPF and row["period"]:
            explanation = "a torus begins"
        elif point.kind == HOPF and isinstance(family, motions.Family):
            explanation = _hopf(family, point)
        yield {**row, "what": explanation}
    for end, points in zip(branch.ends, (branch.points[::-1], branch.points), strict=True):
        if end.startswith(motions.ENDLESS) and len(points) > 1:
            s, power = motions.growth(points)
            law = f"distance^-{power:.3f}: saddle-node" if power else "logarithm: homoclinic"
            row = _row_of(family, number, points[-1])
            source = f"extrapolated from {row['period']:.4g} s at {row['value']:.7g}"
            outside = "" if 0 <= s <= 1 else ", to outside the range"
            explanation = f"{law}; {source}{outside}"
            yield {**row, "kind": _NO_BOUND, "value": family.value(s), "what": explanation}


def _hopf(family: motions.Family, point: Point) -> str:
    """Return the direction of a Hopf bifurcation, and the stability and side of its cycles."""
    value, born = motions.born_cycles(family, point, _SEARCHED)
    if abs(value) < _ROUNDING:
        return f"degenerate, l₁ = {value:.3g} 1/s"
    explanation = f"{_SENSES[value > 0]}, l₁ = {value:.3g} 1/s"
    for first in born.points[1:2]:
        side = "above" if first.x[-1] > point.x[-1] else "below"
        explanation += f", {'' if first.is_stable else 'un'}stable cycles {side}"
        if value < 0 and not first.is_stable:
            explanation += ": another exponent is positive"
    return explanation


def _branch_picture(
    scene: Scene, label: tuple[str, str], rows: Sequence[Row], special: Sequence[Row]
) -> Figure:
    """Draw the branches over the number: the period of cycles, or the γᵢ that varies most."""
    branches = [[*points] for _, points in groupby(rows, lambda row: row["branch"])]
    # For a driven cycle, γ at the start of the period is drawn; other cycles have no single γ.
    key = max(
        ("gamma3", "gamma2", "gamma1"),
        key=lambda name: sum(np.ptp([row[name] for row in points]) for points in branches),
    )
    along = "γ" + "₁₂₃"[int(key[-1]) - 1]
    if rows[0]["period"] is not None and scene.steady:
        key, along = "period", "period [s]"
    kinds = "; ".join(
        f"{kind} at {', '.join(map('{:g}'.format, sorted(values)))}"
        for kind in _MARKERS
        if (values := {float(f"{row['value']:.4g}") for row in special if row["kind"] == kind})
    )
    heading = f"{scene.name}, over {label[0]}: {kinds or 'no special point'}"
    figure, axes = panels(heading, (9.0, 6.0))
    axes.set(xlabel="{} [{}]".format(*label), ylabel=along)
    axes.set_yscale("log" if key == "period" else "linear")
    for stable, word in (True, "stable"), (False, "unstable"):
        if any(row["stable"] == stable for row in rows):
            axes.plot([], [], label=word, **_LINES[stable])
    for points in branches:
        _draw_branch(axes, points, key, named=len(branches) > 1)
    for kind in dict.fromkeys(row["kind"] for row in special):
        places = [(row["value"], row[key]) for row in special if row["kind"] == kind]
        mark: Any = {"marker": _MARKERS[kind], "mfc": ACCENT, "mec": INK, "ms": 8, "ls": ""}
        axes.plot(*zip(*places, strict=True), label=kind, zorder=4, **mark)
    figure.legend(loc="outside lower center", ncols=6, frameon=False)
    return figure


def _draw_branch(axes: Axes, rows: Sequence[Row], key: str, named: bool) -> None:
    """Draw one branch, solid if stable and else dashed, with names of points if `named`."""
    x, y = (np.array([row[name] for row in rows]) for name in ("value", key))
    # Stability changes only at special points. Next to them rounding may suggest otherwise.
    for i, k in pairwise([0, *(i for i, row in enumerate(rows) if row["kind"]), len(rows) - 1]):
        inside = [row["stable"] for row in rows[i : k + 1] if not row["kind"]]
        style = _LINES[2 * sum(inside) >= len(inside)] | {"marker": "." * (len(rows) == 1)}
        axes.plot(x[i : k + 1], y[i : k + 1], **style)
    places = (3 * len(rows) // 4, len(rows) // 4) if named else ()
    for i in {rows[i]["name"]: i for i in places}.values():
        # Write above positive values and below negative ones, on the side away from the line.
        before, after, up = max(i - 1, 0), min(i + 1, len(rows) - 1), y[i] >= 0
        left = ((x[after] - x[before]) * (y[after] - y[before]) > 0) == up
        style = {"color": INK, "ha": "right" if left else "left", "path_effects": halo()}
        note(axes, rows[i]["name"], (x[i], y[i]), (-4 if left else 4, 5 if up else -13), **style)


def follow_branches(name: str, of: str, over: str, longest: float | None, save: _Save) -> Path:
    """Follow and print the branches of a scene's motions; return the picture's path.

    of: equilibrium, line or cycle; over: NAME=FROM:TO; save: writes a partial study.
    """
    scene = load_scene(name)
    number, low, high = span_of(over)
    if not low < high:
        raise InputError(f"--over takes NAME=FROM:TO with FROM below TO, not {over!r}")
    if longest is not None:
        check_positive("longest", longest, "s")
    family = _family(scene, name, of, number, low, high, longest)
    with progress_bar(1) as bar:
        found = _Findings(of, scene, family, bar, save)
        try:
            for branch in _branches(of, scene, family, longest, found):
                found.ends(branch)
        finally:  # also if the search is interrupted
            written = found.write()
    if written is None:
        raise InputError(
            f"{scene.name}: no {of} found for {over}, at the ends of the range, at the scene's own "
            "value and at some values between" + "".join(f"; {words}" for words in found.losses())
        )
    study, picture = written
    show(study.shown)
    return picture


def _family(
    scene: Scene, name: str, of: str, over: str, low: float, high: float, longest: float | None
) -> motions.Range:
    """Return the motions to follow."""
    if of == "cycle" and (scene.not_reduced or not scene.steady):
        driven = Driven(scene, over, low, high, longest)
        driven.at(0.0)  # raises InputError before the search
        return driven
    steady_scene(name, "a branch")
    if over not in NUMBERS:
        raise unknown("number", over, NUMBERS)
    if of == "equilibrium" and over in ("f", "c"):
        raise InputError("--of equilibrium means motion from rest, M = 0, where f and c stay 0")
    # Fixed points belong to the motion from rest, for any momentum of the scene.
    momentum = scene.start.momentum * (of != "equilibrium")
    if of == "line" and not momentum.any():
        raise InputError(f"{scene.name} starts from rest: for its lines give --of equilibrium")
    return motions.Family(scene.parameters, momentum, over, low, high)


def _branches(
    of: str, scene: Scene, family: motions.Range, longest: float | None, watch: Watch
) -> Iterator[Branch]:
    """Return the branches, each when it is found."""
    if isinstance(family, Driven):
        return swinging(family, watch)
    assert isinstance(family, motions.Family)
    if of != "cycle":
        return motions.resting(family, watch)
    # No start leads to an unstable cycle, but it may be born at a Hopf point.
    still = family.momentum.any() and not np.any(scene.parameters.Omega)
    lines = () if still else motions.resting(family)
    hopf = (point for branch in lines for point in branch.special(HOPF))
    starts = _cycles(scene, family, watch)
    return motions.cycling(family, starts, longest or _LONGEST, hopf, watch)


class _Findings(Watch):
    """Collect branches, write them during the search, and show its progress."""

    def __init__(self, of: str, scene: Scene, family: motions.Range, bar: Show, save: _Save):
        self.of, self.scene, self.family, self.bar, self.save = of, scene, family, bar, save
        self.branches: list[Branch] = []
        self.growing: list[Branch] = []  # the branch being followed
        self.special: dict[tuple[Any, ...], Row] = {}
        self.lost_at: dict[str, list[str]] = {}  # reasons, grouped without their numbers
        # Progress: the current place, and the fractions done before and after it.
        self.place, self.done, self.goal = "", 0.0, 1.0
        self.due = time.monotonic() + _WRITE_EVERY

    def at(self, s: float) -> str:
        """Return the number at s as text."""
        return f"{self.family.label[0]} = {self.family.value(s):.4g}"

    def seeks(self, s: float, place: int, places: int) -> None:
        """Show the value at which solutions are searched for next."""
        self.place = f"{self.scene.name}, place {place} of {places}"
        self.done, self.goal = (place - 1) / places, place / places
        self.bar(self.done, f"{self.place}: search at {self.at(s)}")

    def grows(self, branch: Branch) -> None:
        """Show the progress of a branch, and write it from time to time."""
        self.growing, x = [branch], branch.points[0].x
        # A cycle has (u, s), and its u ends with ln T.
        period = f", period {np.exp(x[-2]):.4g} s" if len(x) % 3 == 2 else ""
        size = f"branch {len(self.branches) + 1}, {len(branch.points)} points"
        # The number of points is unknown in advance.
        self.done += _OF_THE_REST * (self.goal - self.done)
        self.bar(self.done, f"{self.place}: {size}, to {self.at(x[-1])}{period}")
        if time.monotonic() > self.due:
            self.write()
            self.due = time.monotonic() + _WRITE_EVERY

    def lost(self, s: float, reason: str) -> None:
        """Record a motion that was given up."""
        alike = self.lost_at.setdefault("".join(filter(str.isalpha, reason)), [])
        alike.append(f"first at {self.at(s)}: {reason.partition(';')[0]}")

    def losses(self) -> list[str]:
        """Return for each reason the number of motions given up and the first of them."""
        return [f"{len(events)} × given up, {events[0]}" for events in self.lost_at.values()]

    def ends(self, branch: Branch) -> None:
        """Record a finished branch."""
        self.branches.append(branch)
        self.growing = []
        self._note(branch, len(self.branches))

    def _note(self, branch: Branch, number: int) -> None:
        # A branch point lies on several branches and is recorded once.
        self.special.update(
            ((row["kind"], *(round(row[key], 5) for key in _PLACE)), row)
            for row in _special(self.family, number, branch)
        )

    def write(self) -> tuple[Study, Path] | None:
        """Write the branches, and return the study and the path of its picture; None if empty."""
        branches = [*self.branches, *self.growing]
        for branch in self.growing:
            self._note(branch, len(branches))
        if not branches:
            return None
        study = self._study(branches)
        return study, self.save(study)

    def _study(self, branches: Sequence[Branch]) -> Study:
        """Return the study of branches with its tables and its picture."""
        scene, family, special = self.scene, self.family, [*self.special.values()]
        of, over, (symbol, unit) = self.of, family.name, family.label
        rows = [
            _row_of(family, n, point)
            for n, branch in enumerate(branches, 1)
            for point in branch.points
        ]
        columns = (
            Column("", "kind", words=True),
            Column(symbol, "value", unit, form=".7g"),
            *(Column(f"γ{'₁₂₃'[i]}", f"gamma{i + 1}", form=".4f") for i in range(3)),
            Column("period", "period", "s", form=".6g"),
            Column("", "what", words=True),
        )

        def place(point: Point) -> float:
            # Branches end within a tolerance, so 1e-13 of the range is zero.
            value = family.value(float(point.x[-1]))
            return value if abs(value) > _ZERO * abs(family.high - family.low) else 0.0

        ends = [
            {"branch": n, "points": len(branch.points), "end": reason, "at": place(end)}
            for n, branch in enumerate(branches, 1)
            for reason, end in zip(branch.ends, (branch.points[0], branch.points[-1]), strict=True)
        ]
        reasons = (
            Column("branch", "branch", form="d"),
            Column("points", "points", form="d"),
            Column(symbol, "at", unit, form=".7g"),
            Column("end of the branch", "end", words=True),
        )
        counts = f"branches: {len(branches)}, points: {len(rows)}; γ in principal axes"
        record = {"scene": scene.name, "of": of, "over": over, "special": special}
        record |= {"ends": [branch.ends for branch in branches]}
        shown: list[Table | str] = [table_of(columns, special)] if special else []
        shown += [table_of(reasons, ends, section="branch"), counts, *map(escape, self.losses())]
        picture = _branch_picture(scene, family.label, rows, special)
        return Study(scene.name, None, ("branches", of, over), rows, record, shown, picture)


def _cycles(scene: Scene, family: motions.Family, watch: Watch) -> Iterator[tuple[Cycle, float]]:
    """Yield cycles at values of s: all cycles from rest, or attracting ones if M ≠ 0."""

    def cycles(ball: Parameters, size: float, c: float) -> Sequence[Cycle]:
        if not size:
            return limit_cycles(ball, _SEARCHED)
        attitudes, _ = level_starts(scene, _STARTS, 0)
        M = size * np.array([np.sqrt(1 - c * c), 0.0, c])
        # If M ≠ 0, the level of the integrals has three dimensions, which is too many to search.
        # Motions from random starts find attracting cycles.
        return basins(ball, attitudes, np.tile(M, (_STARTS, 1))).cycles

    places = motions.sought(family, _INSIDE, cycles, watch)
    return ((cycle, s) for group, s in places for cycle in group)
