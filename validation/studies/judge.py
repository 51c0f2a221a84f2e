"""A trajectory held against the equations.

The errors of a file are those of `Agreement`, with slip and spin where its rates are known. The
search in `judge_search.py` finds mistakes that explain them; the file is then judged without these.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball import (
    InputError,
    Motion,
    RecordedMotion,
    Scene,
    Trajectory,
    read_trajectory,
    recorded,
    scene_toml,
)
from robotball.engines import recorded as derivative
from robotball.engines.equations import scene_of
from robotball.errors import LARGEST, check_positive
from robotball.fit.sensing import ON_THE_PLANE
from robotball.motion import attitude_error, gamma_error, momentum_error, path_error
from robotball.rotations import Array

from ..options import AGREES, DISAGREES, TOLERANCE
from ..output import (
    known,
    plain_table,
    print_whole,
    progress_bar,
    scientific,
    write_record,
)
from .judge_search import Lag, Mistake, Search, lag_of, reference_of
from .mistakes import rows_of
from .orders import LEAST, fit_order

_ENOUGH = 0.1  # of the scene's duration; a file that covers less says too little to agree
_ROWS = 20_000  # that are judged, at most, where the frame turns little between them
_TURN = 0.1  # rad
_LONGEST = 100  # times the scene's duration; a longer file is in another unit


@dataclass(frozen=True)
class _Beside:
    """A trajectory's motion beside the reference's, and the measures of their difference."""

    motion: RecordedMotion
    theory: Motion

    @cached_property
    def path_error(self) -> float:
        """Return the largest contact-point error over the path's length or the radius."""
        return path_error(self.motion, self.theory)

    @cached_property
    def attitude_error(self) -> float:
        """Return the largest angle between the two attitudes [rad]."""
        return attitude_error(self.motion, self.theory)

    @cached_property
    def gamma_error(self) -> float:
        """Return the largest angle between the two verticals, seen from the frame [rad]."""
        return gamma_error(self.motion, self.theory)

    @cached_property
    def momentum_error(self) -> float | None:
        """Return the error of M, relative; None where M is not known.

        M is from the file's attitude and ω, or the file's own.
        """
        return known(momentum_error(self.motion, self.theory))

    @property
    def level(self) -> float:
        """Return where the file's z should stay [m]: 0 where it is the contact point's."""
        radius = self.theory.scene.ball.radius
        return 0.0 if np.abs(self.motion.height).max() < ON_THE_PLANE * radius else radius

    @property
    def height_error(self) -> float | None:
        """Return the largest error of z, over the radius; None where the file has none."""
        apart = np.abs(self.motion.height - self.level).max()
        return known(float(apart) / self.theory.scene.ball.radius)

    @property
    def momentum_known_to(self) -> float:
        """Return how much of the momentum error numerical rates may have made."""
        return float(self.motion.momentum_error.max() / self.theory.scene.momentum_scale)

    @property
    def slip(self) -> tuple[float, float] | None:
        """Return the largest slip [m/s], and its error by numerical rates; None if not known."""
        return _largest(self.motion.slip, self.motion.slip_error)

    @property
    def spin(self) -> tuple[float, float] | None:
        """Return the largest spin, either way round [rad/s], and its error; None if not known."""
        return _largest(np.abs(self.motion.spin), self.motion.spin_error)

    @cached_property
    def hinge_rates(self) -> dict[str, tuple[float, float]]:
        """Return for each hinge whose rate is known (relative RMS error, factor).

        factor · reference fits the file in least squares.
        """
        found = {}
        ours, theirs = self.motion.hinge_rates, self.theory.hinge_rates[-len(self.motion.times) :]
        fastest = float(np.linalg.norm(self.theory.angular_velocity, axis=1).max()) or 1.0
        for hinge, a, b in zip(self.motion.scene.hinges, ours.T, theirs.T, strict=True):
            if np.isfinite(a).all():
                size = float(b @ b) or len(b) * fastest**2
                found[hinge.name] = float(np.sqrt((a - b) @ (a - b) / size)), float(a @ b / size)
        return found


def _largest(values: Array, errors: Array) -> tuple[float, float] | None:
    i = int(values.argmax())
    return (float(values[i]), float(errors[i])) if np.isfinite(values).all() else None


@dataclass(frozen=True)
class FileJudgement:
    """A trajectory as it stands, what is wrong with it, and how it is without these mistakes.

    corrected: beside the motion of the scene that was simulated, where that is another one; None
    where no mistake was found. lag: of what is left.
    """

    trajectory: Trajectory
    plain: _Beside
    search: Search
    corrected: _Beside | None
    lag: Lag
    timestep: float
    tolerance: float

    @property
    def name(self) -> str:
        return self.trajectory.name

    @property
    def other_scene(self) -> str | None:
        """Return the scene's name in the file's header, where that is another scene."""
        header = self.trajectory.header or {}
        given = header.get("scene_toml")
        with contextlib.suppress(InputError):  # of a rate by a function, which no header can hold
            if given and given.strip() != scene_toml(self.plain.theory.scene).strip():
                return header.get("scene", "?")
        return None

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        return self.search.mistakes

    @property
    def best(self) -> _Beside:
        """Return the trajectory without its mistakes."""
        return self.corrected or self.plain

    @property
    def covers(self) -> float:
        """Return the time from the file's first row to its last [s]."""
        return float(self.trajectory.times[-1] - self.trajectory.times[0])

    @property
    def too_short(self) -> bool:
        return self.covers < _ENOUGH * (1 - 1e-9) * self.plain.theory.scene.duration

    @property
    def within(self) -> bool:
        """Return whether all that is known is within the tolerance, and no mistake was found."""
        of_momentum = (self.plain.momentum_error or 0.0) - self.plain.momentum_known_to
        of_hinges = (error for error, _ in self.plain.hinge_rates.values())
        errors = (
            self.plain.path_error, self.plain.attitude_error, self.plain.height_error or 0.0,
            of_momentum, *of_hinges,
        )  # fmt: skip
        return not self.mistakes and max(errors) <= self.tolerance

    @property
    def agrees(self) -> bool:
        return self.within and not self.too_short


@dataclass(frozen=True)
class Order:
    """The order of a measure over several files; None where the errors lie on no straight line."""

    measure: str
    order: float | None
    stderr: float | None = None


@dataclass(frozen=True)
class Judgement:
    """Hold the judgement of trajectories of one scene.

    Attributes
    ----------
    scene : Scene
        The scene that the trajectories were judged by.
    files : tuple of FileJudgement
        The judgement of each trajectory, the one with the longest step first.
    orders : tuple of Order
        The orders of convergence of path and attitude. Empty unless the files differ in their step.

    Examples
    --------
    >>> import robotball as rb
    >>> from validation import judge
    >>> scene = rb.load_scene("fig12")
    >>> rb.integrate(scene, 1.0).save("run.csv")
    >>> judgement = judge(scene, "run.csv")
    >>> [file.name for file in judgement.files], judgement.orders
    (['run.csv'], ())
    """

    scene: Scene
    files: tuple[FileJudgement, ...]
    orders: tuple[Order, ...]

    @property
    def agrees(self) -> bool:
        return all(each.agrees for each in self.files)


def judge(
    scene: Scene | str | Path,
    files: Sequence[Path | str | Trajectory] | Path | str | Trajectory,
    *,
    timesteps: Sequence[float] = (),
    tolerance: float = TOLERANCE,
    progress: Callable[[float], None] | None = None,
) -> Judgement:
    """Find what is wrong with trajectories of a scene.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene that the trajectories are motions of, its name or its file.
    files : str, Path, Trajectory, or sequence of them
        The files, or trajectories as `read_trajectory` returns them.
    timesteps : sequence of float, s, optional
        The step of the engine in each file. The default is the step in the file's header, or the
        interval of its samples.
    tolerance : float, default 0.01
        The largest error of path, height over the radius, momentum and hinge rates, relative, and
        of the attitude in rad.
    progress : callable, optional
        Called with the fraction that is done, from 0 to 1.

    Returns
    -------
    Judgement
        The errors and the mistakes of each trajectory, and the orders of convergence.

    Raises
    ------
    InputError
        If `read_trajectory`, `recorded` or `integrate` raises it, or if a file is many times longer
        than the scene.

    Examples
    --------
    >>> import robotball as rb
    >>> from validation import judge
    >>> scene = rb.load_scene("fig12")
    >>> rb.integrate(scene, 1.0).save("run.csv")
    >>> judgement = judge(scene, "run.csv")
    >>> judgement.agrees, judgement.files[0].mistakes
    (True, ())
    """
    scene = scene_of(scene)
    given = [files] if isinstance(files, Path | str | Trajectory) else list(files)
    if timesteps and len(timesteps) != len(given):
        raise InputError(f"each file needs its timestep: {len(given)}, not {len(timesteps)}")
    trajectories = [
        each if isinstance(each, Trajectory) else read_trajectory(each) for each in given
    ]
    for each in trajectories:
        if (end := float(each.times[-1])) > _LONGEST * scene.duration:
            raise InputError(
                f"{each.name}: t goes to {end:g} s, and {scene.name} lasts {scene.duration:g} s; "
                "if t is in another unit, call the column t [ms], t [us] or t [ns]"
            )
    steps = timesteps or [_timestep_of(each) for each in trajectories]
    judged = []
    for i, (trajectory, timestep) in enumerate(zip(trajectories, steps, strict=True), start=1):
        judged.append(_judged(scene, _thinned(trajectory), timestep, tolerance))
        if progress is not None:
            progress(i / len(trajectories))
    judged.sort(key=lambda each: -each.timestep)
    return Judgement(scene, tuple(judged), tuple(_orders(judged)))


def _thinned(trajectory: Trajectory) -> Trajectory:
    """Return some of the rows of a long trajectory, the first and the last among them."""
    count, rows = len(trajectory.times), _ROWS
    while rows < count:
        at = np.linspace(0, count - 1, rows).round().astype(int)
        if derivative.turned_between(trajectory.attitude[at]).max() <= _TURN:
            note = f"judged by {rows} of its {count} rows"
            return replace(rows_of(trajectory, at), notes=(*trajectory.notes, note))
        rows *= 2
    return trajectory


def _timestep_of(trajectory: Trajectory) -> float:
    """Return the engine's step of the file's header, or else the interval of its samples [s]."""
    given = (trajectory.header or {}).get("timestep", "")
    with contextlib.suppress(ValueError):
        if 0 < (step := float(given)) <= LARGEST:
            return step
    return float(np.median(np.diff(trajectory.times)))


def _judged(
    scene: Scene, trajectory: Trajectory, timestep: float, tolerance: float
) -> FileJudgement:
    plain = _Beside(recorded(scene, trajectory), reference_of(scene, trajectory.times))
    found = Search(trajectory, plain.theory)
    corrected = None
    if found.mistakes:
        corrected = _Beside(recorded(found.scene, found.corrected), found.theory)
    lag = lag_of(rows_of(found.corrected, found.at), (corrected or plain).theory)
    return FileJudgement(trajectory, plain, found, corrected, lag, timestep, tolerance)


def _orders(judged: Sequence[FileJudgement]) -> Iterator[Order]:
    """Yield those of path and attitude, where the files have at least two different steps."""
    steps = [each.timestep for each in judged]
    if len(set(steps)) < 2:
        return
    for measure in ("path_error", "attitude_error"):
        name, errors = measure.replace("_", " "), [getattr(each.best, measure) for each in judged]
        if len(set(steps)) < LEAST and all(errors):
            fall = np.log(errors[0] / errors[-1]) / np.log(steps[0] / steps[-1])
            yield Order(name, float(fall))
        else:
            found = fit_order(steps, errors)
            yield Order(name, *((found.order, found.stderr) if found else (None, None)))


_EXACT = 1e-9  # of the radius


def _show(judgement: Judgement, console: Console) -> None:
    """Print each file's errors and what is wrong with it; then the orders."""
    for each in judgement.files:
        console.print(escape(f"{each.name} as a motion of {judgement.scene.name}"), style="bold")
        for line in lines(each):
            console.print(escape(f"  {line}"), soft_wrap=True)
        print_whole(_table(each), console)
    for order in judgement.orders:
        if order.order is None:
            what = "the errors fall along no straight line in ln(step)"
        else:
            how = "by two files" if order.stderr is None else f"± {order.stderr:.2g}"
            what = f"order {order.order:.2f} ({how})"
        console.print(f"convergence of the {order.measure}: {what}")
    if len(judgement.files) > 1 and not judgement.orders:
        step = judgement.files[0].timestep
        console.print(f"convergence: all files seem to have the step {step:g} s; give --timestep")


def lines(judged: FileJudgement) -> list[str]:
    """Return what there is to report of a file, a line each."""
    plain, best = judged.plain, judged.best
    found = [
        *judged.trajectory.notes,
        f"path error {plain.path_error:.1e}, attitude error {plain.attitude_error:.1e} rad, "
        f"momentum error {_momentum(plain)}",
        *_contact(plain),
    ]
    hinges = [hinge.name for hinge in plain.motion.scene.hinges]
    for name in (each for each in hinges if each not in plain.hinge_rates):
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
        rest = "" if mistake.sure else f", which leaves {mistake.left:.0%} of the error"
        found.append(f"{'WRONG' if mistake.sure else 'PERHAPS'}: {mistake.name}{as_well}{rest}")
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


def _momentum(beside: _Beside) -> str:
    to = beside.momentum_known_to
    if beside.momentum_error is None:
        return "not known"
    return f"{beside.momentum_error:.1e}" + (f" (known to {to:.0e})" if to else "")


def _contact(beside: _Beside) -> list[str]:
    if beside.slip is None or beside.spin is None:
        return []
    (slip, slip_error), (spin, spin_error) = beside.slip, beside.spin
    radius = beside.motion.rolling_radius
    scene = beside.theory.scene
    sure = f" (known to {spin_error:.0e})" if spin_error else ""
    allowed = ", which it may" if scene.rolling == "classical" else ""
    parts = [
        f"slip up to {slip:.1e} m/s (known to {slip_error:.0e})",
        f"spin up to {spin:.1e} rad/s{sure}{allowed}",
    ]
    if np.isfinite(radius):
        parts.append(
            f"rolls like a ball of radius {radius:.6g} m (the scene's: {scene.ball.radius:g})"
        )
    return ["; ".join(parts)]


def _height(judged: FileJudgement) -> list[str]:
    best, error = judged.best, judged.best.height_error
    if error is None:
        return []
    if error > judged.tolerance:
        z, what = best.motion.height, "contact point" if best.level == 0 else "sphere's centre"
        of = " to ".join(dict.fromkeys(f"{each:.4g} m" for each in (z.min(), z.max())))
        return [
            f"z is {of}, where the {what} is at {best.level:g} m: off by up to {error:.1e} of the "
            "radius"
        ]
    if best.level == 0:
        return ["z is the contact point's, and says nothing of the contact"]
    return [] if error < _EXACT else [f"z is off by up to {error:.0e} of the radius"]


def _verdict(judged: FileJudgement) -> str:
    duration = judged.plain.theory.scene.duration
    part = f"over {judged.covers:.4g} s of the scene's {duration:g} s"
    if judged.mistakes:
        sure = all(each.sure for each in judged.mistakes)
        return f"verdict: a convention is {'' if sure else 'perhaps '}wrong, or the scene, {part}"
    limit = f"{judged.tolerance:g}"
    height = "" if judged.plain.height_error is None else ", height"
    bound = f"within {limit} in path{height} and momentum, and {limit} rad in attitude,"
    if judged.within and judged.too_short:
        return f"verdict: too short to judge, with less than {_ENOUGH:.0%}; {bound} {part}"
    return f"verdict: {'agrees' if judged.within else 'off; it is not'} {bound} {part}"


def _table(judged: FileJudgement) -> Table:
    table = plain_table(("if", "path", "attitude [rad]", "ω"))
    rows = [("all is as it should be", judged.search.plain, "bold")]
    rows += [(each.name, each.after, "yellow") for each in judged.mistakes]
    for name, errors, style in rows:
        cells = map(scientific, (errors.path, errors.attitude, errors.rate))
        table.add_row(escape(name), *cells, style=style)
    return table


def _record(judgement: Judgement) -> dict[str, Any]:
    """Return the judgement as plain data; numbers that are not known are None."""
    return {
        "scene": judgement.scene.name,
        "rolling": judgement.scene.rolling,
        "agrees": judgement.agrees,
        "files": [_file(each) for each in judgement.files],
        "orders": [asdict(each) for each in judgement.orders],
    }


def _file(judged: FileJudgement) -> dict[str, Any]:
    own = ("timestep", "tolerance", "agrees", "covers", "too_short", "other_scene")
    return {
        "file": judged.name,
        "engine": judged.plain.motion.engine.name,
        "samples": len(judged.trajectory.times),
        "duration": float(judged.trajectory.times[-1]),
        **{name: getattr(judged, name) for name in own},
        **_measures(judged.plain),
        "mistakes": [asdict(each) for each in judged.mistakes],
        "without_mistakes": None if judged.corrected is None else _measures(judged.corrected),
        "lag": asdict(judged.lag) | {"explains": judged.lag.explains},
        "notes": list(judged.trajectory.notes),
    }


_ERRORS = ("path_error", "attitude_error", "gamma_error", "momentum_error", "height_error")


def _measures(beside: _Beside) -> dict[str, Any]:
    slip, spin = beside.slip or (None, None), beside.spin or (None, None)
    numbers: dict[str, float | None] = {
        **{name: getattr(beside, name) for name in _ERRORS},
        **{f"{name}_rate_error": error for name, (error, _) in beside.hinge_rates.items()},
        "momentum_known_to": beside.momentum_known_to,
        **dict(zip(("slip", "slip_known_to"), slip, strict=True)),
        **dict(zip(("spin", "spin_known_to"), spin, strict=True)),
        "rolling_radius": beside.motion.rolling_radius,
    }
    return {name: known(value) for name, value in numbers.items()}


def judge_files(
    scene: Scene,
    files: Sequence[Path],
    timesteps: Sequence[float],
    tolerance: float,
    json: Path | None,
) -> int:
    """Judge trajectory files of a scene, show and write the judgement; return the exit status."""
    if not files:
        raise InputError("judge needs a file with a trajectory: t,x,y,qw,qx,qy,qz")
    check_positive("tolerance", tolerance, "")
    for step in timesteps:
        check_positive("timestep", step, "s")
    with progress_bar(1) as bar:
        judgement = judge(
            scene,
            files,
            timesteps=timesteps,
            tolerance=tolerance,
            progress=lambda part: bar(part, f"{scene.name}: judging"),
        )
    write_record(json, _record(judgement))
    _show(judgement, Console())
    return AGREES if judgement.agrees else DISAGREES
