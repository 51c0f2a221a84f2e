"""Name the files of results, and write agreements as JSON, CSV, Markdown and a terminal's table.

No two files of different runs share a name. It has the scene, the engine, the preset, and every
option that is not at its default.
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
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from robotball import (
    Controller,
    Engine,
    EngineSettings,
    InputError,
    Motion,
    Scene,
    catalog,
    load_scene,
)
from robotball.engines.engine import DEFAULT
from robotball.errors import call_users
from robotball.files.columns import read_samples
from robotball.files.json_text import json_text
from robotball.motion import Label, versions
from robotball.robot.drives import Rate
from robotball.robot.scene import Times

from .agreement import Agreement, compare
from .output import (
    as_text,
    known,
    plain_table,
    print_whole,
    scientific,
    write_rows,
    write_text,
)
from .sensitivity import Sensitivity

ALL = "all"  # of an engine's presets


def controls_of(texts: Sequence[str]) -> dict[str, Rate]:
    """Return the controls of texts `NAME=VALUE` or `NAME=FILE`, a table of two columns.

    Raises InputError for a text of another form, and for a name that is given twice.
    """
    controls: dict[str, Rate] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if not name or not value or name in controls:
            raise InputError(f"--control takes NAME=VALUE or NAME=FILE, once a name, not {text!r}")
        try:
            controls[name] = float(value)
        except ValueError:
            controls[name] = read_samples(Path(value))
    return controls


def controller_of(text: str) -> Controller:
    """Return the controller of a text `FILE.py:NAME`, whose file is run.

    It can be sent to another process, which runs the file again. Raises InputError where the file
    cannot be run, or has no controller of that name.
    """
    file, _, name = text.rpartition(":")
    if not file.endswith(".py") or not name:
        raise InputError(f"--controller takes FILE.py:NAME, not {text!r}")
    found = call_users(f"{file} cannot be run", runpy.run_path, file).get(name)
    if not isinstance(found, Controller):
        raise InputError(f"{file} has no rb.Controller that is called {name!r}")
    return _FromFile(**{each.name: getattr(found, each.name) for each in fields(found)}, text=text)


@dataclass(frozen=True)
class _FromFile(Controller):
    """A controller of a text that `controller_of` takes."""

    text: str = ""

    def __reduce__(self) -> Any:
        return controller_of, (self.text,)


def controlled(name: str, texts: Sequence[str], controller: str | None = None) -> Scene:
    """Return a scene with the controls of `controls_of`, after which it is named as well.

    controller: as `controller_of` takes it.
    """
    scene = load_scene(name, controls_of(texts))
    words = [re.sub("=.*/", "=", text) for text in texts]  # without the folders of tables
    if controller is not None:
        scene = replace(scene, controller=controller_of(controller))
        words.append(re.sub(".*/", "", controller))
    return replace(scene, name=file_name(scene.name, None, words)) if words else scene


def scenes_of(
    names: Sequence[str], controls: Sequence[str] = (), controller: str | None = None
) -> dict[str, Scene]:
    """Return the scenes of catalog names and paths, by these; each once, and none named alike.

    controls, controller: as `controlled` takes them. Scenes of files with the same name in two
    folders are named after the folder as well. Raises InputError where one cannot be loaded.
    """
    # A path by its absolute form, as two texts may name one file.
    distinct = {name if name in catalog() else Path(name).absolute(): name for name in names}
    scenes = [controlled(name, controls, controller) for name in distinct.values()]
    often = Counter(scene.name for scene in scenes)
    named: dict[str, Scene] = {}
    taken: set[str] = set()
    for (path, given), scene in zip(distinct.items(), scenes, strict=True):
        name = scene.name
        # Their files would overwrite each other; the catalog's scene keeps its name.
        if often[name] > 1 and isinstance(path, Path):
            name = f"{path.parent.name}-{name}"
        others = (f"{name}-{number}" for number in count(2))
        free = next(each for each in chain((name,), others) if each not in taken)
        taken.add(free)
        named[given] = replace(scene, name=free)
    return named


def file_stem(agreements: Sequence[Agreement]) -> str:
    """Return the file name of one scene's agreements by one engine: scene, engine and settings.

    All of the engine's presets are `all`. Simulated time is named where it is not the scene's own.
    """
    first, names = agreements[0], [each.settings.name for each in agreements]
    if first.engine is not None and len(names) > 1 and names == list(first.engine.presets):
        names = [ALL]
    # Another duration is another run, whose files are not the same.
    end = float(first.theory.times[-1])
    time = [] if end == first.scene.duration else [f"{end:g}s"]
    return file_name(first.scene.name, first.motion.engine, [*names, *time])


def file_name(scene: str, engine: Label | None, words: Sequence[str]) -> str:
    """Return a file's name: the scene, the engine if there is one, and the other words."""
    by = [] if engine is None else [engine.name.lower()]
    plain = [re.sub(r" - |[^\w.+-]+", "-", word).strip("-") for word in (*by, *words)]
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


_TABLE_COLUMNS = (
    "scene", "rolling", "engine", "preset", "timestep", "path_error", "gamma_error",
    "momentum_error", "realtime_factor", "agrees", "verdict",
)  # fmt: skip
Record = dict[str, Any]
_SYMBOLS = "γ: the vertical seen from the frame; M: momentum"
_NAIVE = "; naive: an engine as it comes"
OWN_FILE = (
    "The engine has the contact of robotball's settings here. How the file rolls by its own is "
    "said by robotball check {0}, and filmed by robotball video {0} --as-is."
)


def record(agreement: Agreement) -> Record:
    """Return a comparison as plain data; numbers of a run that broke off are None."""
    report, sensitivity = agreement.report, agreement.sensitivity
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
        "steps": report.steps,
        "realtime_factor": agreement.realtime_factor,
        "agrees": agreement.agrees,
        "tolerance": agreement.tolerance,
        "ended": agreement.ended,
        "faults": [
            {"kind": each.kind.name, "time": each.time, "cause": each.text, "fatal": each.fatal}
            for each in agreement.faults
        ],
        "verdict": agreement.verdict,
        # What the motion makes of small errors; None unless that explains something.
        "sensitivity": None if sensitivity is None else _json_settings(sensitivity),
        "loop_growth": agreement.loop_growth,
        "seed": None,  # nothing in a comparison is random
        # An engine may run in an environment of its own, and the equations run here.
        "versions": {**report.versions, engine.name: engine.version},
        "reference_versions": versions(),
    }


def _json_settings(sensitivity: Sensitivity) -> dict[str, Any]:
    """Return its numbers, None for those that are not finite, and whether it explains the error."""
    plain = {name: known(value) for name, value in asdict(sensitivity).items()}
    return {**plain, "explains": sensitivity.explains}


def needs(motion: Motion) -> dict[str, Any]:
    """Return the largest loads of a motion: friction (torsional in m), torques N m, powers W."""
    loads = motion.loads
    return {
        "sliding_friction": float(loads.sliding_friction.max()),
        "torsional_friction": float(loads.torsional_friction.max()),
        "motor_torques": np.abs(loads.motor_torques).max(axis=0).tolist(),
        "motor_powers": np.abs(motion.motor_powers).max(axis=0).tolist(),
    }


def write_json(path: Path, records: Sequence[Record]) -> None:
    """Write a list of records, one an agreement."""
    write_text(path, json_text(records, indent=2) + "\n")


def write_csv(path: Path, records: Sequence[Record]) -> None:
    """Write the table of the agreements, a row each."""
    write_rows(path, records, _TABLE_COLUMNS)


def write_markdown(path: Path, records: Sequence[Record]) -> None:
    """Write the table of the agreements as the README shows it."""
    lines = [
        "| scene | preset | step | path error | γ error | momentum error | × real time | verdict |",
        "|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for each in records:
        step, *numbers = _row_numbers(each)
        cells = (each["scene"], each["preset"], f"{step} ms", *numbers, each["verdict"])
        lines.append(f"| {' | '.join(cells)} |")
    write_text(path, "\n".join(lines) + "\n")


def show(records: Sequence[Record], console: Console) -> None:
    """Print one row an agreement's record, and below the table what went wrong where it did."""
    # Eighty columns hold it.
    numbers = ("step\n\\[ms]", "path\nerror", "γ error\n\\[rad]", "M error", "× real\ntime")
    headings = ("scene", "rolling", "preset", *numbers, "verdict")
    table, below = plain_table(headings, left=(0, 1, 2, 8)), []
    for each in records:
        style = "" if each["agrees"] else "yellow"
        names = (escape(each["scene"]), each["rolling"], escape(each["preset"]))
        table.add_row(*names, *_row_numbers(each), _word(each), style=style)
        if each["verdict"] != "agrees":
            below.append((f"{each['scene']}, {each['preset']}: {each['verdict']}", style))
        if each["loop_growth"] is not None:
            below.append((f"{each['scene']}: {growth_of(each['loop_growth'])}", "dim"))
    print_whole(table, console)
    within = {each["preset"]: f"{each['tolerance']:g} ({each['preset']})" for each in records}
    console.print(_SYMBOLS + _NAIVE * ("naive" in within), style="dim", highlight=False)
    for line, style in ((f"tolerance: {', '.join(within.values())}", "dim"), *below):
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
    """Assert in a test that an engine rolls a scene as the equations do.

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
        The path error to reach, in place of settings.
    theory : Motion, optional
        The motion by the equations at these times, if it is known.

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
    """Return in words what a closed loop makes of a small turn of the start."""
    return f"a start that is turned by a small δ rad makes a path error of {growth:.3g} δ"


def _row_numbers(record: Record) -> list[str]:
    """Return the timestep [ms], the three errors and the speed as both tables show them."""
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
