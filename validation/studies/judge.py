"""Compare trajectory files with the equations, and find mistakes in their conventions.

The errors of a file are computed as in `Agreement`, with slip and spin if the file's rates are
known. `mistakes.py` finds the mistakes that explain these errors. The file is judged again with
these mistakes corrected.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
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
from robotball.errors import check_positive
from robotball.files.trajectories import from_first
from robotball.fit.sensing import ON_THE_PLANE
from robotball.motion import attitude_error, gamma_error, momentum_error, path_error
from robotball.rotations import Array

from ..options import AGREES, DISAGREES, TOLERANCE
from ..output import known, plain_table, print_whole, progress_bar, scientific, write_record
from .left_out import PHYSICS, left_out
from .mistakes import Errors, Mistake, Search, reference_of, rows_of

_ENOUGH = 0.1  # of the scene's duration; a file that covers less is too short to agree
_ROWS = 20_000  # most rows that are judged, if the frame turns little between them
_TURN = 0.1  # rad
_CLOCKS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
_SHORTEST = 0.01  # of the scene's duration; shortest file in another unit of time
_LONGEST = 100  # scene durations; the times of a longer file are in another unit
_EXACT = 1e-9  # radii; a smaller error of height is rounding and is not reported
_ERRORS = ("path_error", "attitude_error", "gamma_error", "momentum_error", "height_error")


@dataclass(frozen=True)
class _Comparison:
    """Compare a recorded motion with the reference; None if the file lacks a column.

    Attributes
    ----------
    momentum_known_to : float
        The part of `momentum_error` that may come from rates computed from samples.
    level : float, m
        The height at which z should stay: the radius, or 0 if z is the height of the contact point.
    slip, spin : (float, float) or None
        The largest slip [m/s] and spin [rad/s], each with its error due to rates computed from
        samples.
    hinge_rates : dict of str to (float, float)
        For each hinge with a known rate: the rate's relative RMS error, and the factor that fits
        the reference's rate to the file's rate by least squares.
    """

    motion: RecordedMotion
    theory: Motion
    path_error: float
    attitude_error: float
    gamma_error: float
    momentum_error: float | None
    momentum_known_to: float
    level: float
    height_error: float | None
    slip: tuple[float, float] | None
    spin: tuple[float, float] | None
    hinge_rates: dict[str, tuple[float, float]]

    def within(self, tolerance: float) -> bool:
        """Return whether all known errors are within the tolerance."""
        errors = [self.path_error, known(self.attitude_error) or 0.0, self.height_error or 0.0]
        errors += [(self.momentum_error or 0.0) - self.momentum_known_to]
        errors += [error for error, _ in self.hinge_rates.values()]
        return max(errors) <= tolerance


def _compare(motion: RecordedMotion, theory: Motion) -> _Comparison:
    radius = theory.scene.ball.radius
    level = 0.0 if np.abs(motion.height).max() < ON_THE_PLANE * radius else radius
    return _Comparison(
        motion,
        theory,
        path_error=path_error(motion, theory),
        attitude_error=attitude_error(motion, theory),
        gamma_error=gamma_error(motion, theory),
        momentum_error=known(momentum_error(motion, theory)),
        momentum_known_to=known(motion.momentum_error.max() / theory.scene.momentum_scale) or 0.0,
        level=level,
        height_error=known(float(np.abs(motion.height - level).max()) / radius),
        slip=_largest(motion.slip, motion.slip_error),
        spin=_largest(np.abs(motion.spin), motion.spin_error),
        hinge_rates=dict(_hinge_rates(motion, theory)),
    )


def _hinge_rates(motion: Motion, theory: Motion) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the name, relative RMS error and factor of each hinge with a known rate."""
    expected = theory.hinge_rates[-len(motion.times) :]
    fastest = float(np.linalg.norm(theory.angular_velocity, axis=1).max()) or 1.0
    for hinge, a, b in zip(motion.scene.hinges, motion.hinge_rates.T, expected.T, strict=True):
        if np.isfinite(a).all():
            size = float(b @ b) or len(b) * fastest**2
            yield hinge.name, (float(np.sqrt((a - b) @ (a - b) / size)), float(a @ b / size))


def _largest(values: Array, errors: Array) -> tuple[float, float] | None:
    i = int(values.argmax())
    return (float(values[i]), float(errors[i])) if np.isfinite(values).all() else None


@dataclass(frozen=True)
class FileJudgement:
    """Hold the judgement of a trajectory, as written and with its mistakes corrected.

    Attributes
    ----------
    trajectory : Trajectory
        The trajectory as written.
    plain : Comparison
        The comparison of the trajectory as written with the equations.
    search : Search
        The search for mistakes in conventions and in the scene.
    mistakes : tuple of Mistake
        The mistakes that explain the errors, the largest first, and the physical effect that the
        simulation left out.
    corrected : Comparison or None
        The comparison with the mistakes corrected, also mistakes in the scene. None if no mistake
        was found.
    tolerance : float
        The largest error with which a file agrees.
    """

    trajectory: Trajectory
    plain: _Comparison
    search: Search
    mistakes: tuple[Mistake, ...]
    corrected: _Comparison | None
    tolerance: float

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.trajectory.name

    @property
    def other_scene(self) -> str | None:
        """The name of the scene in the file's header, if it differs from the given scene."""
        header = self.trajectory.header or {}
        written = header.get("scene_toml", "").strip()
        with contextlib.suppress(InputError):  # a rate given by a function cannot be written
            if written and written != scene_toml(self.plain.theory.scene).strip():
                return header.get("scene", "?")
        return None

    @property
    def best(self) -> _Comparison:
        """The comparison with all mistakes corrected."""
        return self.corrected or self.plain

    @property
    def covers(self) -> float:
        """The time from the file's first row to its last [s]."""
        return float(self.trajectory.times[-1] - self.trajectory.times[0])

    @property
    def too_short(self) -> bool:
        """Whether the file covers too little of the scene to agree."""
        return self.covers < _ENOUGH * (1 - 1e-9) * self.plain.theory.scene.duration

    @property
    def sure(self) -> bool:
        """Whether all mistakes are certain."""
        return all(mistake.sure for mistake in self.mistakes)

    @property
    def within(self) -> bool:
        """Whether all known errors are within the tolerance and no mistake was found."""
        return not self.mistakes and self.plain.within(self.tolerance)

    @property
    def agrees(self) -> bool:
        """Whether the file agrees with the equations."""
        return self.within and not self.too_short


@dataclass(frozen=True)
class Judgement:
    """Hold the judgement of trajectories of one scene.

    Attributes
    ----------
    scene : Scene
        The scene with which the trajectories were compared.
    files : tuple of FileJudgement
        The judgement of each trajectory.

    Examples
    --------
    >>> import robotball as rb
    >>> from validation import judge
    >>> scene = rb.load_scene("fig12")
    >>> rb.integrate(scene, 1.0).save("run.csv")
    >>> judgement = judge(scene, "run.csv")
    >>> [file.name for file in judgement.files]
    ['run.csv']
    """

    scene: Scene
    files: tuple[FileJudgement, ...]

    @property
    def agrees(self) -> bool:
        """Whether all files agree."""
        return all(file.agrees for file in self.files)


def judge(
    scene: Scene | str | Path,
    files: Sequence[Path | str | Trajectory] | Path | str | Trajectory,
    *,
    tolerance: float = TOLERANCE,
    progress: Callable[[float], None] | None = None,
) -> Judgement:
    """Find mistakes in trajectories of a scene.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene of the trajectories, its name or its file.
    files : str, Path, Trajectory, or sequence of them
        The files, or trajectories as `read_trajectory` returns them.
    tolerance : float, default 0.01
        The largest relative error of the path, the momentum and the hinge rates, and the largest
        error of the height [radii] and of the attitude [rad].
    progress : callable, optional
        Called with the fraction that is done, from 0 to 1.

    Returns
    -------
    Judgement
        The errors and the mistakes of each trajectory.

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
    several = [files] if isinstance(files, Path | str | Trajectory) else list(files)
    trajectories = [f if isinstance(f, Trajectory) else read_trajectory(f) for f in several]
    judged = []
    for trajectory in trajectories:
        judged.append(_on_its_clock(scene, _thinned(trajectory), tolerance))
        if progress is not None:
            progress(len(judged) / len(trajectories))
    return Judgement(scene, tuple(judged))


def _thinned(trajectory: Trajectory) -> Trajectory:
    """Return a long trajectory with fewer rows, including the first and the last."""
    count, rows = len(trajectory.times), _ROWS
    while rows < count:
        at = np.linspace(0, count - 1, rows).round().astype(int)
        if derivative.turned_between(trajectory.attitude[at]).max() <= _TURN:
            note = f"judged by {rows} of its {count} rows"
            return replace(rows_of(trajectory, at), notes=(*trajectory.notes, note))
        rows *= 2
    return trajectory


def _on_its_clock(scene: Scene, trajectory: Trajectory, tolerance: float) -> FileJudgement:
    """Judge a trajectory, in another unit of time if it is longer than the scene."""
    times, duration = trajectory.times, scene.duration
    for (unit, size), begin in product(_CLOCKS.items(), (0.0, float(times[0]))):
        moved = (times - begin) * size
        if times[-1] > duration and _SHORTEST * duration < moved[-1] <= duration * (1 + 1e-9):
            judged = _judged(scene, replace(trajectory, times=moved), tolerance)
            if judged.plain.within(tolerance) or (judged.mistakes and judged.sure):
                name = f"the times are in {unit}" + f" and start at {begin:.10g}" * bool(begin)
                several = Mistake("time", name, Errors(), Errors(), ()), *judged.mistakes
                return replace(judged, mistakes=several, corrected=judged.best)
    if times[0] > duration:
        times, note = from_first(times)
        trajectory = replace(trajectory, times=times, notes=(*trajectory.notes, note))
    if times[-1] > _LONGEST * duration:
        raise InputError(
            f"{trajectory.name}: t goes to {times[-1]:g} s, but {scene.name} lasts {duration:g} s; "
            "if t is in another unit, rename the column to t [ms], t [us] or t [ns]"
        )
    return _judged(scene, trajectory, tolerance)


def _judged(scene: Scene, trajectory: Trajectory, tolerance: float) -> FileJudgement:
    plain = _compare(recorded(scene, trajectory), reference_of(scene, trajectory.times))
    search = Search(trajectory, plain.theory)
    mistakes, corrected = search.mistakes, None
    if mistakes:
        corrected = _compare(recorded(search.scene, search.corrected), search.theory)
    if not (corrected or plain).within(tolerance):
        omission = left_out(plain.motion)
        if omission and omission.left < min((mistake.left for mistake in mistakes), default=1):
            mistakes, corrected = (omission,), None
        elif corrected and (omission := left_out(corrected.motion)):
            mistakes = (*mistakes, omission)
    return FileJudgement(trajectory, plain, search, mistakes, corrected, tolerance)


def _show(judgement: Judgement, asked: Sequence[str], console: Console) -> None:
    for file, texts in zip(judgement.files, asked, strict=True):
        console.print(escape(f"{file.name} as a motion of {judgement.scene.name}"), style="bold")
        for line in lines(file, texts):
            console.print(escape(f"  {line}"), soft_wrap=True)
        print_whole(_table(file), console)


def lines(judged: FileJudgement, asked: str = "") -> list[str]:
    """Return the report on a file, one line per fact; asked: the scene and file as given."""
    plain, best = judged.plain, judged.best
    report = [*judged.trajectory.notes, _errors(plain), *_contact(plain)]
    if np.isnan(plain.attitude_error):
        unknown = "attitude, momentum, slip and spin are unknown, and mistakes that only they show"
        report.append(f"the file has no attitude qw,qx,qy,qz: {unknown}")
    for hinge, angles in zip(plain.motion.scene.hinges, plain.motion.hinge_angles.T, strict=True):
        if (name := hinge.name) not in plain.hinge_rates:
            unknown = "momentum, slip and spin" if name == "frame" else "momentum"
            report.append(
                f"the {name} has a motor, but the file has no column {name}_rate or "
                f"{name}_angle: {unknown} stay unknown"
            )
        if np.isnan(angles).any() and not judged.within:
            report.append(f"no column {name}_angle: no missing physics can be named")
    report += [
        f"the {name}'s rate has a relative error of {error:.1e}: about {factor:.3g} times the "
        "expected rate"
        for name, (error, factor) in plain.hinge_rates.items()
        if error > judged.tolerance
    ]
    if judged.other_scene:
        report.append(f"the file's header names another scene: {judged.other_scene}")
    report += _height(judged)
    for mistake in judged.mistakes:
        names = " or ".join((mistake.name, *mistake.as_well))
        left = "" if mistake.sure else f", which leaves {mistake.left:.0%} of the error"
        report.append(f"{'WRONG' if mistake.sure else 'PERHAPS'}: {names}{left}")
        if (before := mistake.before.momentum) and (after := mistake.after.momentum):
            balance = f"unexplained part {before:.1e}, with this change {after:.1e}"
            report.append(f"the momentum shows the mistake: {balance}")
    if judged.corrected is not None:
        report += [f"without the mistake: {line}" for line in (_errors(best), *_contact(best))]
    if not (judged.within or judged.mistakes):
        fit = f"robotball fit {asked or f'{plain.theory.scene.name} {judged.name}'} --free NUMBER"
        report.append(f"to see whether other numbers of the scene explain the file: {fit}")
    return [*report, _verdict(judged)]


def _errors(comparison: _Comparison) -> str:
    error, known_to = comparison.momentum_error, comparison.momentum_known_to
    momentum = "unknown" if error is None else f"{error:.1e}"
    if error is not None and known_to:
        momentum += f" (known to {known_to:.0e})"
    path, attitude = f"path error {comparison.path_error:.1e}", comparison.attitude_error
    return f"{path}, attitude error {attitude:.1e} rad, momentum error {momentum}"


def _contact(comparison: _Comparison) -> list[str]:
    if comparison.slip is None or comparison.spin is None:
        return []
    (slip, slip_error), (spin, spin_error) = comparison.slip, comparison.spin
    scene, radius = comparison.theory.scene, comparison.motion.rolling_radius
    line = f"slip up to {slip:.1e} m/s (known to {slip_error:.0e}); spin up to {spin:.1e} rad/s"
    if spin_error:
        line += f" (known to {spin_error:.0e})"
    if scene.rolling == "classical":
        line += ", which this rolling model allows"
    if np.isfinite(radius):
        line += f"; rolls like a ball of radius {radius:.6g} m (the scene's: {scene.ball.radius:g})"
    return [line]


def _height(judged: FileJudgement) -> list[str]:
    level, error = judged.best.level, judged.best.height_error
    if error is None:
        return []
    if error > judged.tolerance:
        z, point = judged.best.motion.height, "sphere's centre" if level else "contact point"
        ends = " to ".join(dict.fromkeys(f"{end:.4g} m" for end in (z.min(), z.max())))
        return [f"z is {ends}, but the {point} is at {level:g} m: off by {error:.1e} of the radius"]
    if level == 0:
        return ["z is the height of the contact point, and does not show the depth of the contact"]
    return [] if error < _EXACT else [f"z is off by up to {error:.0e} of the radius"]


def _verdict(judged: FileJudgement) -> str:
    duration = judged.plain.theory.scene.duration
    part = f"over {judged.covers:.4g} s of the scene's {duration:g} s"
    if judged.mistakes:
        perhaps = "" if judged.sure else "perhaps "
        families = {mistake.family for mistake in judged.mistakes}
        cause = "other physics than the scene's" * (PHYSICS in families)
        return f"verdict: {perhaps}{cause or 'a wrong convention or scene'}, {part}"
    height = "" if judged.plain.height_error is None else ", height"
    limit = f"{judged.tolerance:g}"
    rest = f" and momentum, and {limit} rad in attitude"
    rest *= not np.isnan(judged.plain.attitude_error)
    bound = f"within {limit} in path{height}{rest}, {part}"
    if judged.within and judged.too_short:
        return f"verdict: too short to judge, below {_ENOUGH:.0%} of the scene; {bound}"
    return f"verdict: agrees {bound}" if judged.within else f"verdict: off; not {bound}"


def _table(judged: FileJudgement) -> Table:
    table = plain_table(("without", "path", "attitude [rad]", "ω"))
    rows = [("any change", judged.search.plain, "bold")]
    rows += [(m.name, m.after, "yellow") for m in judged.mistakes if m.after.path is not None]
    for name, errors, style in rows:
        attitude = None if np.isnan(judged.plain.attitude_error) else errors.attitude
        cells = map(scientific, (errors.path, attitude, errors.rate))
        table.add_row(escape(name), *cells, style=style)
    return table


def _record(judgement: Judgement) -> dict[str, Any]:
    """Return the judgement as plain data; unknown numbers are None."""
    return {
        "scene": judgement.scene.name,
        "rolling": judgement.scene.rolling,
        "agrees": judgement.agrees,
        "files": [_file(file) for file in judgement.files],
    }


def _file(judged: FileJudgement) -> dict[str, Any]:
    names = ("tolerance", "agrees", "covers", "too_short", "other_scene")
    return {
        "file": judged.name,
        "engine": judged.plain.motion.engine.name,
        "samples": len(judged.trajectory.times),
        "duration": float(judged.trajectory.times[-1]),
        **{name: getattr(judged, name) for name in names},
        **_measures(judged.plain),
        "mistakes": [asdict(mistake) for mistake in judged.mistakes],
        "without_mistakes": None if judged.corrected is None else _measures(judged.corrected),
        "notes": list(judged.trajectory.notes),
    }


def _measures(comparison: _Comparison) -> dict[str, Any]:
    slip, spin = comparison.slip or (None, None), comparison.spin or (None, None)
    numbers: dict[str, float | None] = {
        **{name: getattr(comparison, name) for name in (*_ERRORS, "momentum_known_to")},
        **{f"{name}_rate_error": error for name, (error, _) in comparison.hinge_rates.items()},
        **dict(zip(("slip", "slip_known_to", "spin", "spin_known_to"), slip + spin, strict=True)),
        "rolling_radius": comparison.motion.rolling_radius,
    }
    return {name: known(value) for name, value in numbers.items()}


def judge_files(
    scene: Scene,
    scene_text: str,
    files: Sequence[Path],
    names: Mapping[str, str],
    tolerance: float,
    json: Path | None,
) -> int:
    """Judge trajectory files of a scene, show and write the judgement; return the exit status.

    scene_text: the scene as given; names: as in `read_trajectory`.
    """
    if not files:
        raise InputError("judge needs a file with a trajectory: t,x,y,qw,qx,qy,qz")
    check_positive("tolerance", tolerance, "")
    with progress_bar(1) as bar:
        judgement = judge(
            scene,
            [read_trajectory(file, names) for file in files],
            tolerance=tolerance,
            progress=lambda part: bar(part, f"{scene.name}: judging"),
        )
    write_record(json, _record(judgement))
    _show(judgement, [f"{scene_text} {file}" for file in files], Console())
    return AGREES if judgement.agrees else DISAGREES
