"""A judgement as lines and a table in the terminal, and as plain data."""

from dataclasses import asdict
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from validation.output import print_whole
from validation.studies.judge.measure import ENOUGH, Beside, FileJudgement, Judgement
from validation.studies.judge.numbers import Errors

ON_THE_PLANE = 0.05  # of the radius: a height so near 0 is the contact point's
OFF_HEIGHT = 0.01  # of the radius, by which a centre may be off without a line
SHOWN = 2  # trials of each family
ROUNDING = 1e-16
EXACT = 1e-9  # of the radius


def show(judgement: Judgement, console: Console, every: bool = False) -> None:
    """Print each file's errors, what is wrong with it and what was tried; then the orders.

    every: all trials, in place of the best of each kind.
    """
    for each in judgement.files:
        console.print(escape(f"{each.name} as a motion of {judgement.scene.name}"), style="bold")
        for line in lines(each):
            console.print(escape(f"  {line}"), soft_wrap=True)
        print_whole(_table(each, every), console)
    for order in judgement.orders:
        if order.order is None:
            what = "the errors fall along no straight line in ln(step)"
        else:
            known = "by two files" if order.stderr is None else f"± {order.stderr:.2g}"
            what = f"order {order.order:.2f} ({known})"
        console.print(f"convergence of the {order.measure}: {what}")
    if len(judgement.files) > 1 and not judgement.orders:
        step = judgement.files[0].timestep
        console.print(f"convergence: all files seem to have the step {step:g} s; give --timestep")


def lines(judged: FileJudgement) -> list[str]:
    """What is to be said of a file, a line each."""
    plain, best = judged.plain, judged.best
    found = [
        *judged.trajectory.notes,
        f"path error {plain.path_error:.1e}, attitude error {plain.attitude_error:.1e} rad, "
        f"momentum error {_momentum(plain)}",
        *_contact(plain),
    ]
    for name in plain.unknown_hinges:
        more = " and slip and spin" if name == "frame" else ""
        found.append(
            f"the {name} has a motor, and the file says nothing of it: the momentum{more} need "
            f"the column {name}_rate or {name}_angle"
        )
    for name, (error, factor) in plain.hinge_rates.items():
        if error > judged.tolerance:
            found.append(
                f"the {name}'s rate is off by {error:.1e} of it, and about {factor:.3g} times what "
                "it should be"
            )
    if judged.other_scene:
        found.append(f"the file's header has another scene than this one: {judged.other_scene}")
    found += _height(judged)
    for mistake in judged.mistakes:
        as_well = f", or {' or '.join(mistake.as_well)}" if mistake.as_well else ""
        found.append(f"WRONG: {mistake.name}{as_well}")
    if judged.corrected is not None:
        found.append(
            f"without that: path error {best.path_error:.1e}, attitude error "
            f"{best.attitude_error:.1e} rad, momentum error {_momentum(best)}"
        )
        found += [f"without that: {line}" for line in _contact(best)]
    if judged.lag.explains:
        way = "late" if judged.lag.shift > 0 else "early"
        found.append(
            f"LAG: it is {abs(judged.lag.shift):.4g} s {way}, which explains "
            f"{1 - judged.lag.after / judged.lag.before:.0%} of the error that is left"
        )
    found.append(_verdict(judged))
    return found


def _momentum(beside: Beside) -> str:
    known = beside.momentum_known_to
    if beside.momentum_error is None:
        return "not known"
    return f"{beside.momentum_error:.1e}" + (f" (known to {known:.0e})" if known else "")


def _contact(beside: Beside) -> list[str]:
    if beside.slip is None or beside.spin is None:
        return []
    (slip, slip_error), (spin, spin_error) = beside.slip, beside.spin
    radius = beside.motion.rolling_radius
    scene = beside.theory.scene
    parts = [f"slip up to {slip:.1e} m/s (known to {slip_error:.0e})"]
    known = f" (known to {spin_error:.0e})" if spin_error else ""
    allowed = ", which it may" if scene.rolling == "classical" else ""
    parts.append(f"spin up to {spin:.1e} rad/s{known}{allowed}")
    if np.isfinite(radius):
        parts.append(f"rolls as at a radius of {radius:.6g} m (the scene's: {scene.ball.radius:g})")
    return ["; ".join(parts)]


def _height(judged: FileJudgement) -> list[str]:
    height, radius = judged.best.motion.height, judged.plain.theory.scene.ball.radius
    if not np.isfinite(height).all():
        return []
    if np.abs(height).max() < ON_THE_PLANE * radius:
        return ["z is the contact point's, and says nothing of the contact"]
    depth = radius - height
    if np.abs(depth).max() < OFF_HEIGHT * radius:
        least, most = -depth.max() / radius, -depth.min() / radius
        if np.abs(depth).max() < EXACT * radius:
            return []
        return [f"z is off the radius by {least:.0e} to {most:.0e} of it"]
    return [
        f"z is {height.min():.4g} to {height.max():.4g} m, and the sphere's centre at {radius:g} m"
    ]


def _verdict(judged: FileJudgement) -> str:
    duration = judged.plain.theory.scene.duration
    part = f"over {judged.covers:.4g} s of the scene's {duration:g} s"
    if judged.mistakes:
        return f"verdict: a convention is wrong, or the scene, {part}"
    limit = f"{judged.tolerance:g}"
    bound = f"within {limit} in path and momentum, and {limit} rad in attitude,"
    if judged.within and judged.too_short:
        return f"verdict: too short to judge, with less than {ENOUGH:.0%}; {bound} {part}"
    return f"verdict: {'agrees' if judged.within else 'off; it is not'} {bound} {part}"


def _table(judged: FileJudgement, every: bool) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("if")
    for heading in ("path", "attitude [rad]", "ω"):
        table.add_column(heading, justify="right")
    trials = judged.explanation.trials
    rows = [("all is as it should be", judged.plain_errors, "bold")]
    rows += [(each.name, each.after, "yellow") for each in judged.mistakes]
    named = {each.name for each in judged.mistakes}
    for family in dict.fromkeys(each.family for each in trials):
        # The best of each name; those that change nothing tell nothing.
        own = [each for each in trials if each.family == family and each.name not in named]
        own = [each for each in own if not _same(each.errors, judged.plain_errors)]
        own.sort(key=lambda each: float(np.log(np.maximum(each.errors.given, ROUNDING)).sum()))
        unique = list({each.name: each for each in reversed(own)}.values())[::-1]
        unique = unique if every else unique[:SHOWN]
        rows += [(each.name, each.errors, "") for each in unique]
    for name, errors, style in rows:
        table.add_row(escape(name), *_cells(errors), style=style)
    return table


def _same(errors: Errors, others: Errors) -> bool:
    return np.allclose(errors.given, others.given, rtol=1e-9, atol=1e-12)


def _cells(errors: Errors) -> tuple[str, ...]:
    rate = "-" if errors.rate is None else f"{errors.rate:.1e}"
    return f"{errors.path:.1e}", f"{errors.attitude:.1e}", rate


def record(judgement: Judgement) -> dict[str, Any]:
    """The judgement as plain data; numbers that are not known are None."""
    return {
        "scene": judgement.scene.name,
        "rolling": judgement.scene.rolling,
        "agrees": judgement.agrees,
        "files": [_file(each) for each in judgement.files],
        "orders": [asdict(each) for each in judgement.orders],
    }


def _file(judged: FileJudgement) -> dict[str, Any]:
    return {
        "file": judged.name,
        "engine": judged.plain.motion.engine.name,
        "samples": len(judged.trajectory.times),
        "duration": float(judged.trajectory.times[-1]),
        "timestep": judged.timestep,
        **_measures(judged.plain),
        "tolerance": judged.tolerance,
        "agrees": judged.agrees,
        "covers": judged.covers,
        "too_short": judged.too_short,
        "mistakes": [asdict(each) for each in judged.mistakes],
        "without_mistakes": None if judged.corrected is None else _measures(judged.corrected),
        "lag": asdict(judged.lag) | {"explains": judged.lag.explains},
        "trials": [asdict(each) for each in judged.explanation.trials],
        "other_scene": judged.other_scene,
        "notes": list(judged.trajectory.notes),
    }


def _measures(beside: Beside) -> dict[str, Any]:
    unknown = (None, None)
    slip, slip_error = beside.slip or unknown
    spin, spin_error = beside.spin or unknown
    numbers: dict[str, float | None] = {
        "path_error": beside.path_error,
        "attitude_error": beside.attitude_error,
        "gamma_error": beside.gamma_error,
        "momentum_error": beside.momentum_error,
        **{f"{name}_rate_error": error for name, (error, _) in beside.hinge_rates.items()},
        "momentum_known_to": beside.momentum_known_to,
        "slip": slip,
        "slip_known_to": slip_error,
        "spin": spin,
        "spin_known_to": spin_error,
        "rolling_radius": beside.motion.rolling_radius,
    }
    return {
        name: None if value is None or not np.isfinite(value) else value
        for name, value in numbers.items()
    }
