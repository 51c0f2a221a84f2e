"""Many random starts of a scene by a contact engine and by the equations: how the errors spread."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from robotball import Engine, EngineSettings, Scene, Start, integrate, sample_times, simulate_many
from robotball.engines.engine import DEFAULT
from robotball.engines.equations import scene_of
from robotball.engines.many_motions import FromStarts, of_each
from robotball.errors import InputError, check_count
from robotball.motion import Motion, Progress, extended
from robotball.robot.scene import Times, times_of
from robotball.rotations import Array
from robotball.theory.reduced import motion_of

from .agreement import Agreement
from .options import Run
from .output import known, progress_bar, scientific
from .results import controlled
from .study import Row
from .sweeps import Cell, sweep

ERRORS = ("path_error", "gamma_error", "momentum_error")
PERCENTILES = {"p5": 5, "p50": 50, "p95": 95, "worst": 100}
_ABREAST = 256  # starts that the compiled steps take at once
_CELL = 64  # starts that a process of a cluster takes


def random_start(scene: Scene, random: np.random.Generator) -> Start:
    """Return the scene's start with any attitude, and M times a factor of 0.3 to 1.5."""
    attitude = Rotation.random(random_state=random).as_quat(scalar_first=True)
    # Its direction stays: with any attitude all directions in the frame come up, and a rubber
    # ball's M has to be horizontal.
    momentum = scene.start.momentum * random.uniform(0.3, 1.5)
    return replace(scene.start, attitude=attitude, momentum=momentum)


@dataclass(frozen=True)
class ManyRuns:
    """Hold the errors of a scene's runs from n starts.

    Attributes
    ----------
    rows : tuple of n mappings
        For each start, in their order, the `path_error`, `gamma_error` and `momentum_error` as an
        Agreement has them, None if the run broke off. `fault` is the kind of the first fault, or
        None. `agrees` is the verdict. `seconds` is the time of stepping the engine.

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
        found = self.summary("path_error")
        counts = f"{found['runs']} runs, {found['faulty']} faulty"
        return f"<ManyRuns: {counts}; path error up to {scientific(found['worst'])}>"

    def summary(self, error: str) -> Row:
        """Summarize the percentiles of one error over the runs that have it. None if no run has it.

        The summary has also the number of runs, the number of runs with a fault, and the runs per
        second of stepping.
        """
        # A run that broke off has no error, and is counted as faulty instead of being a percentile.
        values = [each[error] for each in self.rows if each[error] is not None] or [np.nan]
        found = zip(PERCENTILES, np.percentile(values, [*PERCENTILES.values()]), strict=True)
        faulty = sum(each["fault"] is not None for each in self.rows)
        rate = len(self.rows) / sum(each["seconds"] for each in self.rows)
        counts = {"runs": len(self.rows), "faulty": faulty, "runs_per_second": rate}
        return counts | {name: known(value) for name, value in found}


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
    """Compare a contact engine's runs of a scene from many starts with the equations' motions.

    The references of a balanced ball are integrated by compiled steps, many at once. Other
    references are integrated in processes. No motion is kept.

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
        "cpu" or "cuda", in place of the device in the settings. Only some engines have a choice.
    progress : callable, optional
        Called with the fraction of the runs that are done, from 0 to 1.

    Returns
    -------
    ManyRuns
        The errors of each run.

    Raises
    ------
    InputError
        If there is no start, if one is no Start, and wherever `simulate_many` or `integrate` raises
        it.

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
    row = {name: known(getattr(agreement, name)) for name in ERRORS}
    more = {"agrees": agreement.agrees, "fault": fault, "seconds": agreement.report.seconds}
    return row | more


def _references(scenes: Sequence[Scene], times: Array) -> Iterator[Motion]:
    """Yield the equations' motions of scenes that differ in their start, at times (n,) [s]."""
    # The first stands for all, as they differ in their start only.
    if not all(each.steady and each.not_reduced is None for each in scenes[:1]):
        yield from of_each(partial(_reference, times), scenes)
        return
    from robotball.theory.ensembles.orbits import kernel_start, orbits

    # So many at once, so that memory does not grow with the number of starts.
    for i in range(0, len(scenes), _ABREAST):
        some = scenes[i : i + _ABREAST]
        _, attitudes, momenta = map(list, zip(*map(kernel_start, some), strict=True))
        parameters = scenes[0].parameters
        found = orbits(parameters, np.concatenate(attitudes), np.concatenate(momenta), times)
        if gave_up := np.count_nonzero(found.status):
            raise InputError(f"the equations' motions from {gave_up} starts need too many steps")
        for scene, *states in zip(some, found.attitudes, found.contact_points, strict=True):
            yield motion_of(scene, times, np.concatenate(states, axis=1))


def _reference(times: Array, scene: Scene) -> Motion:
    return extended(integrate(scene, times), Motion)  # without what cannot be pickled


def of_cell(cell: Cell, progress: Progress | None = None) -> Mapping[str, Any]:
    """Return the rows of a cell of `many_runs`."""
    scene = controlled(cell["scene"], cell.get("control", ()), cell.get("controller"))
    first = cell["first"]
    # A seed for each start by its own number: the same starts, however they are shared among cells.
    seeds = ([cell["seed"], i] for i in range(first, first + cell["count"]))
    starts = [random_start(scene, np.random.default_rng(each)) for each in seeds]
    options = Run(**{name: cell[name] for name in ("engine", "keep_going", "environments")})
    of = options.request(cell["preset"])
    more: Any = {"engine": of.engine, "device": cell["device"], "progress": progress}
    found = compare_many(
        scene, starts, sample_times(cell["duration"]), settings=of.settings, **more
    )
    return {"rows": found.rows}


def many_runs(whole: Cell, count: int, cluster: str | None, out: Path) -> ManyRuns:
    """Compare from `count` random starts, here or on the dask cluster at an address.

    whole: a cell of `of_cell` without `first` and `count`, which are its part of the starts; out:
    the folder for the journal of a cluster's cells, with which they go on after a break.
    """
    # Here the engine itself has a start on every core, and one call takes them all.
    size = _CELL if cluster else count
    cells = [{**whole, "first": i, "count": min(size, count - i)} for i in range(0, count, size)]
    with progress_bar(len(cells)) as show:
        if not cluster:
            return ManyRuns(of_cell(cells[0], lambda part: show(part, whole["scene"]))["rows"])
        results = sweep(of_cell, cells, out / "starts.jsonl", cluster=cluster, show=show)
    if failures := [each.failure for each in results if each.failure]:
        raise InputError(failures[0])
    return ManyRuns(tuple(row for each in results for row in (each.record or {})["rows"]))
