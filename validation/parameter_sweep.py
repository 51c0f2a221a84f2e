"""Compare an engine with the equations over values of one number of the scene or the settings."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotball import Engine, EngineSettings, Scene
from robotball.engines.engine import DEFAULT, request_of
from robotball.engines.equations import scene_of
from robotball.errors import InputError, unknown
from robotball.motion import Progress
from robotball.processes import in_processes
from robotball.robot.scene import Times, times_of
from robotball.rotations import Array

from .agreement import compare
from .output import as_text, plain_table, print_whole, scientific
from .random_starts import ERRORS

_MANY = 8  # values; fewer are run before as many processes have started


@dataclass(frozen=True, repr=False)
class Sweep:
    """Hold the comparisons of one scene over the values of a parameter.

    Attributes
    ----------
    parameter : str
        The name of the parameter.
    rows : tuple of mappings
        For each value, in their order: the `value`, the `path_error`, `gamma_error` and
        `momentum_error`, which are NaN if the run broke off, `agrees`, the `verdict`, and the
        `seconds` of stepping the engine. A value that cannot be run has the reason as its verdict.

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

    Many values are run in processes, on all cores.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    parameter : str
        A field of the engine's settings, such as "timestep" or "sliding_friction", or a number of
        the scene by its path in the scene file, such as "frame.mass" or "gravity". The last words
        of a path are enough.
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
    names = [each.name for each in fields(chosen)]
    jobs: list[tuple[Any, Scene, EngineSettings]]
    if parameter in names:
        jobs = [(each, loaded, replace(chosen, **{parameter: each})) for each in values]
    else:
        from robotball.fit.scene_numbers import numbers_of  # settings need no scene file

        numbers = numbers_of(scene)
        if parameter.rpartition(".")[2] not in {path.rpartition(".")[2] for path in numbers.known}:
            raise unknown("parameter", parameter, [*names, *numbers.known])
        parameter = numbers.path_of(parameter)
        jobs = [(each, numbers.scene({parameter: each}), chosen) for each in values]
    work, rows = partial(_row, sampled, request.engine), []
    for row in in_processes(work, jobs, _MANY, or_here=True):
        rows.append(row)
        if progress is not None:
            progress(len(rows) / len(jobs))
    return Sweep(parameter, tuple(rows))


def _row(times: Array, engine: Engine, job: tuple[Any, Scene, EngineSettings]) -> dict[str, Any]:
    value, scene, settings = job
    errors: dict[str, float] = dict.fromkeys(ERRORS, np.nan)
    try:
        found = compare(scene, times, settings=settings, engine=engine)
    except InputError as error:
        return {"value": value, **errors, "agrees": False, "verdict": str(error), "seconds": 0.0}
    errors = {name: getattr(found, name) for name in ERRORS}
    more = {"agrees": found.agrees, "verdict": found.verdict, "seconds": found.report.seconds}
    return {"value": value, **errors, **more}
