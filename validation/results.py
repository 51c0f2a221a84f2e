"""Load scenes with controls, name result files, and write agreements as JSON, CSV or tables.

The file name of a result has the scene, the engine, the preset, and all options that differ from
their defaults, so that different runs have different files.
"""

import re
import runpy
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from inspect import signature
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from robotball import (
    Controller,
    Engine,
    EngineSettings,
    Friction,
    InputError,
    Motion,
    Scene,
    catalog,
    load_scene,
)
from robotball.engines.engine import DEFAULT
from robotball.errors import call_users
from robotball.files import json_text
from robotball.files.columns import read_samples
from robotball.motion import Label, versions
from robotball.robot.drives import Rate
from robotball.robot.scene import Times

from .agreement import Agreement, compare
from .output import (
    as_text,
    known,
    pairs_of,
    plain_table,
    print_whole,
    scientific,
    write_rows,
    write_text,
)
from .sensitivity import Sensitivity

if TYPE_CHECKING:
    from .slip import Slip

ALL = "all"  # name for all presets of an engine
_TABLE_COLUMNS = (
    "scene",
    "rolling",
    "engine",
    "preset",
    "timestep",
    "path_error",
    "gamma_error",
    "momentum_error",
    "realtime_factor",
    "agrees",
    "verdict",
)
_SYMBOLS = "γ: the vertical seen from the frame; M: momentum"
NAIVE = "naive: default settings, servos of gain 1"
OWN_FILE = (
    "Here the contact has robotball's settings. `robotball check {0}` runs the file with its own "
    "settings, and shows that on a page."
)
Record = dict[str, Any]


def controls_of(texts: Sequence[str]) -> dict[str, Rate]:
    """Parse controls `NAME=VALUE` or `NAME=FILE`, where the file is a table of two columns.

    Raises InputError if a text is malformed or a name is repeated.
    """
    controls: dict[str, Rate] = {}
    for name, value in pairs_of("--control takes NAME=VALUE or NAME=FILE", texts).items():
        try:
            controls[name] = float(value)
        except ValueError:
            controls[name] = read_samples(Path(value))
    return controls


def _controller_of(text: str) -> Controller:
    """Run a file and return its controller, given as `FILE.py:NAME`.

    The controller can be pickled; a process that unpickles it runs the file again. Raises
    InputError if the file cannot be run or has no such controller.
    """
    file, _, name = text.rpartition(":")
    if not file.endswith(".py") or not name:
        raise InputError(f"--controller takes FILE.py:NAME, not {text!r}")
    controller = call_users(f"{file} cannot be run", runpy.run_path, file).get(name)
    if not isinstance(controller, Controller):
        raise InputError(f"{file} has no rb.Controller with the name {name!r}")
    values = {field.name: getattr(controller, field.name) for field in fields(controller)}
    return _FromFile(**values, text=text)


@dataclass(frozen=True)
class _FromFile(Controller):
    """A controller that is pickled as the argument of `_controller_of`."""

    text: str = ""

    def __reduce__(self) -> Any:
        return _controller_of, (self.text,)


def _friction_of(words: Sequence[str], scene: Scene) -> Friction:
    """Return a scene's friction with other limits, given as the texts `sliding, torsional`."""
    try:
        sliding, *others = map(float, words)
        (torsional,) = others or (None,)
    except ValueError:  # also for more than two numbers
        raise InputError(
            "--friction takes SLIDING, or SLIDING,TORSIONAL with the torsional coefficient in "
            f"metres, not {','.join(words)!r}"
        ) from None
    return replace(scene.friction, sliding=sliding, torsional=torsional)


def controlled(
    name: str,
    texts: Sequence[str] = (),
    controller: str | None = None,
    friction: Sequence[str] = (),
) -> Scene:
    """Load a scene with other controls, controller and friction.

    The functions `controls_of`, `_controller_of` and `_friction_of` read the texts. The texts are
    appended to the name of the scene.
    """
    scene = load_scene(name, controls_of(texts))
    parts = [re.sub("=.*/", "=", text) for text in texts]  # without the folders of tables
    if controller is not None:
        scene = replace(scene, controller=_controller_of(controller))
        parts.append(re.sub(".*/", "", controller))
    if friction:
        scene = replace(scene, friction=_friction_of(friction, scene))
        parts.append(f"friction-{'-'.join(friction)}")
    return replace(scene, name=file_name(scene.name, None, parts)) if parts else scene


def scenes_of(names: Sequence[str], load: Callable[[str], Scene] = controlled) -> dict[str, Scene]:
    """Load distinct scenes, given by catalog name or path, with distinct names.

    Files with the same name in different folders are named after the folder too, because their
    results would overwrite each other. Raises InputError if a scene cannot be loaded.
    """
    # Two texts may name the same file.
    distinct = {name if name in catalog() else Path(name).absolute(): name for name in names}
    scenes = [*map(load, distinct.values())]
    often = Counter(scene.name for scene in scenes)
    named: dict[str, Scene] = {}
    taken: set[str] = set()
    for (path, text), scene in zip(distinct.items(), scenes, strict=True):
        name = scene.name
        if often[name] > 1 and isinstance(path, Path):
            name = f"{path.parent.name}-{name}"
        numbered = (f"{name}-{number}" for number in count(2))
        free = next(name for name in chain((name,), numbered) if name not in taken)
        taken.add(free)
        named[text] = replace(scene, name=free)
    return named


def file_stem(agreements: Sequence[Agreement]) -> str:
    """Return the file name for the agreements of a scene and an engine.

    It has scene, engine, settings, and the duration if it differs from the scene's duration.
    """
    first, names = agreements[0], [agreement.settings.name for agreement in agreements]
    if first.engine is not None and len(names) > 1 and names == list(first.engine.presets):
        names = [ALL]
    end = float(first.theory.times[-1])
    time = [] if end == first.scene.duration else [f"{end:g}s"]
    return file_name(first.scene.name, first.motion.engine, [*names, *time])


def file_name(scene: str, engine: Label | None, words: Sequence[str]) -> str:
    """Return a file name of the scene, the engine if given, and the other words."""
    parts = words if engine is None else [engine.name.lower(), *words]
    plain = [re.sub(r" - |[^\w.+-]+", "-", part).strip("-") for part in parts]
    return "-".join([scene.replace(" ", "-").replace("/", "-"), *plain])


def changed(command: Callable[..., object], **options: Any) -> list[str]:
    """Return a word for each option that differs from its default in a command's signature."""
    defaults = signature(command).parameters
    words = []
    for name, value in options.items():
        if value != defaults[name].default:
            words += _option_words(name.replace("_", "-"), value)
    return words


def _option_words(name: str, value: Any) -> list[str]:
    if value is True:
        return [name]
    if isinstance(value, int | float):
        return [f"{value:g}s" if name == "duration" else f"{name}-{value:g}"]
    return [*value] if isinstance(value, tuple) else [str(value)]


def record(agreement: Agreement) -> Record:
    """Return an agreement as plain data; errors are None if the run broke off."""
    report, sensitivity, slip = agreement.report, agreement.sensitivity, agreement.slip
    engine = agreement.motion.engine
    return {
        "scene": agreement.scene.name,
        "rolling": agreement.scene.rolling,
        "engine": engine.name,
        "preset": agreement.settings.name,
        "settings": agreement.settings.plain(),
        "timestep": report.timestep,
        "duration": float(agreement.theory.times[-1]),
        "samples": len(agreement.theory.times),
        "path_length": agreement.theory.path_length,
        "path_error": known(agreement.path_error),
        "reference_error": agreement.reference_error,
        "estimated_error": report.estimated_error,
        "gamma_error": known(agreement.gamma_error),
        "attitude_error": known(agreement.attitude_error),
        "momentum_error": known(agreement.momentum_error),
        "momentum_drift": known(agreement.momentum_error),  # its name in version 0.1
        "friction_used": known(report.friction_used.max(initial=0.0)),
        "needs": needs(agreement.theory),
        "slip": None if slip is None else _plain_slip(slip),
        "steps": report.steps,
        "realtime_factor": agreement.realtime_factor,
        "agrees": agreement.agrees,
        "tolerance": agreement.tolerance,
        "ended": agreement.ended,
        "faults": [
            {"kind": fault.kind.name, "time": fault.time, "cause": fault.text, "fatal": fault.fatal}
            for fault in agreement.faults
        ],
        "verdict": agreement.verdict,
        "sensitivity": None if sensitivity is None else _plain(sensitivity),
        "loop_growth": agreement.loop_growth,
        "seed": None,  # a comparison is not random
        # The engine may run in another environment than the equations.
        "versions": {**report.versions, engine.name: engine.version},
        "reference_versions": versions(),
    }


def _plain_slip(slip: "Slip") -> dict[str, Any]:
    """Return a slip as plain data, without the other motion."""
    names = [field.name for field in fields(slip) if field.name != "other"]
    return {**{name: getattr(slip, name) for name in names}, "text": str(slip)}


def _plain(sensitivity: Sensitivity) -> dict[str, Any]:
    """Return a sensitivity as plain data."""
    plain = {name: known(value) for name, value in asdict(sensitivity).items()}
    return {**plain, "explains": sensitivity.explains}


def needs(motion: Motion) -> dict[str, Any]:
    """Return the largest friction (torsional in m), torques [N m] and powers [W] of a motion."""
    loads = motion.loads
    return {
        "sliding_friction": float(loads.sliding_friction.max()),
        "torsional_friction": float(loads.torsional_friction.max()),
        "motor_torques": np.abs(loads.motor_torques).max(axis=0).tolist(),
        "motor_powers": np.abs(motion.motor_powers).max(axis=0).tolist(),
    }


def write_json(path: Path, records: Sequence[Record]) -> None:
    """Write the records of agreements as JSON."""
    write_text(path, json_text(records, indent=2) + "\n")


def write_csv(path: Path, records: Sequence[Record]) -> None:
    """Write the table of agreements as CSV."""
    write_rows(path, records, _TABLE_COLUMNS)


def show(records: Sequence[Record], console: Console) -> None:
    """Print the table of agreements, then the verdicts of motions that disagree."""
    # The table fits into 80 columns.
    numbers = ("step\n\\[ms]", "path\nerror", "γ error\n\\[rad]", "M error", "× real\ntime")
    headings = ("scene", "rolling", "preset", *numbers, "verdict")
    table, below = plain_table(headings, left=(0, 1, 2, 8)), []
    for row in records:
        style = "" if row["agrees"] else "yellow"
        names = (escape(row["scene"]), row["rolling"], escape(row["preset"]))
        table.add_row(*names, *_row_numbers(row), _word(row), style=style)
        if row["verdict"] != "agrees":
            below.append((f"{row['scene']}, {row['preset']}: {row['verdict']}", style))
        if row["slip"] is not None:
            whose = f", {row['preset']}" if row["slip"]["of_settings"] else ""
            below.append((f"{row['scene']}{whose}: {row['slip']['text']}", "dim"))
        if row["loop_growth"] is not None:
            below.append((f"{row['scene']}: {growth_of(row['loop_growth'])}", "dim"))
    print_whole(table, console)
    within = {row["preset"]: f"{row['tolerance']:g} ({row['preset']})" for row in records}
    console.print(_SYMBOLS + f"; {NAIVE}" * ("naive" in within), style="dim", highlight=False)
    for line, style in ((f"tolerance: {', '.join(within.values())}", "dim"), *dict.fromkeys(below)):
        console.print(escape(line), style=style, soft_wrap=not console.is_terminal)


def assert_agrees(
    scene: Scene | str | Path,
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    accuracy: float | None = None,
    theory: Motion | None = None,
) -> Agreement:
    """Assert in a test that an engine's motion of a scene agrees with the equations.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    accuracy : float, optional
        The path error to reach, relative to the path's length. Give either `accuracy` or
        `settings`.
    theory : Motion, optional
        The reference motion at these times, if it is known.

    Returns
    -------
    Agreement
        Both motions and their errors, for further assertions.

    Raises
    ------
    AssertionError
        If the motions do not agree. The message has the table of the comparison and the first
        fault.
    InputError
        If `compare` raises it.

    Warns
    -----
    SceneWarning
        If `compare` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.assert_agrees("fig12", 0.5, settings="fast").path_error < 1e-6
    True
    """
    how: Any = {"settings": settings, "engine": engine, "accuracy": accuracy, "theory": theory}
    agreement = compare(scene, times, **how)
    if not agreement.agrees:
        table = as_text(partial(show, [record(agreement)]))
        why = agreement.faults[0] if agreement.faults else agreement.verdict
        raise AssertionError(f"{agreement.scene.name}: {why}\n{table.rstrip()}")
    return agreement


def growth_of(growth: float) -> str:
    """Describe the growth of a small rotation of the start in a closed loop."""
    return f"rotating the start by a small angle δ [rad] gives a path error of {growth:.3g} δ"


def _row_numbers(record: Record) -> list[str]:
    """Return the timestep [ms], the three errors and the speed as texts."""
    errors = (record[name] for name in ("path_error", "gamma_error", "momentum_error"))
    step, speed = f"{record['timestep'] * 1e3:.3g}", f"{record['realtime_factor']:.0f}"
    return [step, *map(scientific, errors), speed]


def _word(record: Record) -> str:
    if record["agrees"]:
        return "agrees"
    if record["faults"]:
        return "faulty"
    if record["ended"]:
        return "ended"
    sensitivity = record["sensitivity"]
    return "sensitive" if sensitivity and sensitivity["explains"] else "off"
