"""Compare a contact engine with the equations for many starts or many parameter values."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotball import (
    Engine,
    EngineSettings,
    Request,
    Scene,
    Start,
    integrate,
    sample_times,
    simulate_many,
)
from robotball.engines.engine import DEFAULT, request_of
from robotball.engines.equations import scene_of
from robotball.engines.many_motions import FromStarts, of_each
from robotball.errors import InputError, check_count, unknown
from robotball.motion import Motion, Progress, extended
from robotball.processes import in_processes
from robotball.robot.scene import Times, times_of
from robotball.rotations import Array, normalised
from robotball.theory.reduced import motion_of

from .agreement import Agreement, compare
from .output import as_text, known, plain_table, print_whole, progress_bar, scientific
from .study import Row

ERRORS = ("path_error", "gamma_error", "momentum_error")
PERCENTILES = {"p5": 5, "p50": 50, "p95": 95, "worst": 100}
_ABREAST = 256  # starts integrated at once with the compiled step


def random_start(scene: Scene, random: np.random.Generator) -> Start:
    """Return the start with a random attitude, and with M times a random factor of 0.3 to 1.5."""
    attitude = normalised(np.roll(random.normal(size=4), 1))
    # The direction of M in the world is kept, because a rubber ball's M is horizontal.
    momentum = scene.start.momentum * random.uniform(0.3, 1.5)
    return replace(scene.start, attitude=attitude, momentum=momentum)


@dataclass(frozen=True)
class ManyRuns:
    """Hold the errors of a scene's runs from n starts.

    Attributes
    ----------
    rows : tuple of n mappings
        A mapping for each start, in order. `path_error`, `gamma_error` and `momentum_error` are
        defined as in Agreement, and are None if the run failed before its end. `fault` is the kind
        of the first fault, or None. `agrees` is True if the motion agrees. `seconds` is the time
        that the engine's steps took.

    Examples
    --------
    >>> from validation import ManyRuns
    >>> sound = {"path_error": 1e-8, "fault": None, "seconds": 0.1}
    >>> broken = {"path_error": None, "fault": "SLIPPED", "seconds": 0.1}
    >>> ManyRuns((sound, broken))
    <ManyRuns: 2 runs, 1 faulty; path error up to 1.0e-08>
    >>> ManyRuns((sound, broken)).summary("path_error")["runs_per_second"]
    10.0
    """

    rows: tuple[Row, ...]

    def __repr__(self) -> str:
        summary = self.summary("path_error")
        counts = f"{summary['runs']} runs, {summary['faulty']} faulty"
        return f"<ManyRuns: {counts}; path error up to {scientific(summary['worst'])}>"

    def summary(self, error: str) -> Row:
        """Return percentiles of one error, and the numbers of runs and of faulty runs.

        Percentiles ignore runs that failed before their end, and are None if all runs failed.
        `runs_per_second` counts only the time of the engine's steps.
        """
        values = [row[error] for row in self.rows if row[error] is not None] or [np.nan]
        levels = zip(PERCENTILES, np.percentile(values, [*PERCENTILES.values()]), strict=True)
        faulty = sum(row["fault"] is not None for row in self.rows)
        rate = len(self.rows) / sum(row["seconds"] for row in self.rows)
        counts = {"runs": len(self.rows), "faulty": faulty, "runs_per_second": rate}
        return counts | {name: known(value) for name, value in levels}


def compare_many(
    scene: Scene | str | Path,
    starts: Sequence[Start],
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    device: str | None = None,
    progress: Progress | None = None,
) -> ManyRuns:
    """Compare a contact engine's runs of a scene from many starts with the equations.

    For a balanced ball, many reference motions are integrated at once, with a compiled step. Other
    reference motions are integrated in several processes. Motions are not kept.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    starts : sequence of Start
        The starts.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    device : str, optional
        "cpu" or "cuda". It replaces the device in the settings. Only some engines have a choice.
    progress : callable, optional
        Called with the fraction of the runs that are done, from 0 to 1.

    Returns
    -------
    ManyRuns
        The errors of each run.

    Raises
    ------
    InputError
        If `starts` is empty or has another type, or if `simulate_many` or `integrate`
        raises it.

    Warns
    -----
    SceneWarning
        If `simulate_many` warns.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import robotball as rb
    >>> from validation import compare_many
    >>> scene = rb.load_scene("fig12")
    >>> starts = [replace(scene.start, momentum=f * scene.start.momentum) for f in (0.5, 1.5)]
    >>> runs = compare_many("fig12", starts, 0.5, settings="fast")
    >>> [row["agrees"] for row in runs.rows]
    [True, True]
    """
    scenes = FromStarts(scene_of(scene), starts)
    check_count("the number of starts", len(scenes), 1)
    times = times_of(times, scenes.scene)
    more: Any = {"engine": engine, "device": device, "progress": progress}
    motions = simulate_many(scenes, None, times, settings=settings, **more)
    return ManyRuns(tuple(map(_start_row, map(Agreement, _references(scenes, times), motions))))


def _start_row(agreement: Agreement) -> Row:
    fault = agreement.faults[0].kind.name if agreement.faults else None
    more = {"agrees": agreement.agrees, "fault": fault, "seconds": agreement.report.seconds}
    return {name: known(getattr(agreement, name)) for name in ERRORS} | more


def _references(scenes: Sequence[Scene], times: Array) -> Iterator[Motion]:
    """Yield the reference motions of scenes that differ only in their start."""
    if not (scenes[0].steady and scenes[0].not_reduced is None):
        yield from of_each(partial(_reference, times), scenes)
        return
    from robotball.theory.ensembles.orbits import kernel_start, orbits

    # Batches limit the memory.
    for i in range(0, len(scenes), _ABREAST):
        batch = scenes[i : i + _ABREAST]
        _, attitudes, momenta = map(list, zip(*map(kernel_start, batch), strict=True))
        parameters = scenes[0].parameters
        motions = orbits(parameters, np.concatenate(attitudes), np.concatenate(momenta), times)
        if failed := np.count_nonzero(motions.status):
            raise InputError(f"the equations need too many steps for {failed} of the starts")
        for scene, *states in zip(batch, motions.attitudes, motions.contact_points, strict=True):
            yield motion_of(scene, times, np.concatenate(states, axis=1))


def _reference(times: Array, scene: Scene) -> Motion:
    return extended(integrate(scene, times), Motion)  # a ReferenceMotion cannot be pickled


def random_runs(
    scene: Scene,
    count: int,
    duration: float,
    request: Request,
    *,
    seed: int = 0,
    device: str | None = None,
) -> ManyRuns:
    """Compare runs of a scene from `count` random starts over a duration [s], with a progress bar.

    A start depends only on the seed and on the start's number.
    """
    seeds = ([seed, i] for i in range(count))
    starts = [random_start(scene, np.random.default_rng(seed)) for seed in seeds]
    settings: Any = {"settings": request.settings, "engine": request.engine, "device": device}
    with progress_bar(1) as show:
        settings["progress"] = lambda part: show(part, scene.name)
        return compare_many(scene, starts, sample_times(duration), **settings)


_MANY = 8  # values; to run fewer takes less time than to start processes


@dataclass(frozen=True, repr=False)
class Sweep:
    """Hold the comparisons of one scene over the values of a parameter.

    Attributes
    ----------
    parameter : str
        The name of the parameter.
    rows : tuple of mappings
        A mapping for each value, in order. It has the `value`; `path_error`, `gamma_error` and
        `momentum_error`, which are NaN if the run failed before its end; `agrees`; the `verdict`;
        and `seconds`, the time that the engine's steps took. If a value cannot be run, the verdict
        is the reason.

    Examples
    --------
    >>> import robotball as rb
    >>> sweep = rb.sweep("fig12", "timestep", [0.02, 0.01], 0.5, settings="fast")
    >>> sweep["path_error"].shape, sweep.rows[0]["agrees"]
    ((2,), True)
    """

    parameter: str
    rows: tuple[dict[str, Any], ...]

    def __getitem__(self, name: str) -> Array:
        """Return one column (n,) of the rows."""
        return np.array([row[name] for row in self.rows])

    def __repr__(self) -> str:
        table = plain_table((self.parameter, "path error", "γ error", "M error", "verdict"), (4,))
        for row in self.rows:
            value = row["value"]
            text = value if isinstance(value, str) else f"{value:g}"
            table.add_row(text, *(scientific(row[name]) for name in ERRORS), row["verdict"])
        return as_text(partial(print_whole, table)).rstrip()


def sweep(
    scene: Scene | str | Path,
    parameter: str,
    values: Sequence[Any] | Array,
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    progress: Progress | None = None,
) -> Sweep:
    """Compare a contact engine with the equations over the values of one parameter.

    If there are many values, several processes run them, on all cores.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    parameter : str
        A field of the engine's settings, such as "timestep" or "sliding_friction", or a number of
        the scene, given by its path in the scene file, such as "frame.mass" or "gravity". The last
        words of a path are enough.
    values : sequence
        The values, in the unit of the parameter.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    progress : callable, optional
        Called with the fraction of the values that are done, from 0 to 1.

    Returns
    -------
    Sweep
        The table of the comparisons, a row for each value.

    Raises
    ------
    InputError
        If there is no such parameter, if a value is invalid, or if `load_scene` raises
        it.

    Warns
    -----
    SceneWarning
        If `simulate` warns of a value.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.sweep("fig12", "sliding_friction", [0.5, 5.0], 0.5, settings="fast")["agrees"].tolist()
    [False, True]
    """
    loaded, request = scene_of(scene), request_of(engine, settings)
    sampled, chosen = times_of(times, loaded), request.settings
    assert chosen is not None  # no accuracy is requested
    names = [option.name for option in fields(chosen)]
    jobs: list[tuple[Any, Scene, EngineSettings]]
    if parameter in names:
        jobs = [(value, loaded, replace(chosen, **{parameter: value})) for value in values]
    else:
        from robotball.fit.scene_numbers import numbers_of  # settings need no scene file

        numbers = numbers_of(scene)
        if parameter.rpartition(".")[2] not in {path.rpartition(".")[2] for path in numbers.known}:
            raise unknown("parameter", parameter, [*names, *numbers.known])
        parameter = numbers.path_of(parameter)
        jobs = [(value, numbers.scene({parameter: value}), chosen) for value in values]
    work, rows = partial(_row, sampled, request.engine), []
    for row in in_processes(work, jobs, _MANY, or_here=True):
        rows.append(row)
        if progress is not None:
            progress(len(rows) / len(jobs))
    return Sweep(parameter, tuple(rows))


def _row(times: Array, engine: Engine, job: tuple[Any, Scene, EngineSettings]) -> dict[str, Any]:
    value, scene, settings = job
    try:
        found = compare(scene, times, settings=settings, engine=engine)
    except InputError as error:
        row = {"value": value, "agrees": False, "verdict": str(error), "seconds": 0.0}
        return row | dict.fromkeys(ERRORS, np.nan)
    errors = {name: getattr(found, name) for name in ERRORS}
    more = {"agrees": found.agrees, "verdict": found.verdict, "seconds": found.report.seconds}
    return {"value": value, **errors, **more}
