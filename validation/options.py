"""Options and exit statuses that commands share.

The work is imported inside the functions, so that `--help` does not load it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from cyclopts import Parameter, Token
from cyclopts.exceptions import CoercionError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from robotball import Request, Scene
    from robotball.rotations import Array

    from .agreement import Agreement
    from .study import Study
    from .sweeps import Cell, Result, Work

_T = TypeVar("_T")
AGREES, DISAGREES, BAD_INPUT = 0, 1, 2
OUT = Path("out")
# Largest errors of a trajectory that agrees: relative for path, height, momentum and hinge rates,
# in rad for the attitude.
TOLERANCE = 1e-2
CHECKED = 1e-3  # largest path error of a robot file that agrees
CHECK_TIME = 10.0  # s, simulated time of a check
_QUICK = 1.0  # s, simulated by a quick form of a study


def _whole(_: type, tokens: Sequence[Token]) -> int:
    # cyclopts would round 1.5 to 2.
    try:
        return int(tokens[0].value)
    except ValueError:
        raise CoercionError(token=tokens[0], target_type=int) from None


def _listed(_: type, tokens: Sequence[Token]) -> tuple[str, ...]:
    names = (name.strip() for token in tokens for name in token.value.split(","))
    return tuple(filter(None, names))


def _check_file(_: type, path: Path | None) -> None:
    # A file may be called -, but "--json --csv" lacks the name of the first file.
    if str(path).startswith("--"):
        raise ValueError("Give a file, or - for standard output.")


def _file(help: str) -> Parameter:
    help += "; - means standard output."
    return Parameter(help=help, metavar="FILE", allow_leading_hyphen=True, validator=_check_file)


_COUNT = Parameter(converter=_whole, metavar="N")
_SCENE = "A name from the catalog, or a path to a TOML, MJCF or URDF file."
_DURATION = "Simulated time. Default: the scene's own duration."
_CONTROL = (
    "Control of an actuator in a robot file: a number, or a table (.csv, .npz) of time and value. "
    "It replaces the control in the robot file. Repeat the option for each actuator."
)
_FRICTION = (
    "Friction of the plane: the sliding coefficient, and after a comma the torsional one in "
    "metres. The ball slips if rolling needs more. Default: the scene's own, mostly no limit."
)
_MAP = (
    "Meaning of a column, for its title in the file or the end of that title, such as "
    'roll_joint.position=frame_angle or "px=x [mm]". Repeat the option for each column.'
)
_THREADS = "Number of cores. Default: all. The results do not depend on this number."
_PLACE = "Folder of the engines' environments. Default: that of 'robotball engines --install'."

SceneName = Annotated[str, Parameter(help=_SCENE)]
Count = Annotated[int, _COUNT]
Seconds = Annotated[float, Parameter(metavar="SECONDS")]
Duration = Annotated[float | None, Parameter(help=_DURATION, metavar="SECONDS")]
Out = Annotated[Path, Parameter(help="Folder for the results.", metavar="DIR")]
JsonFile = Annotated[Path | None, _file("Also write the results as JSON")]
CsvFile = Annotated[Path | None, _file("Also write the table as CSV")]
PresetName = Literal["naive", "fast", "balanced", "accurate", "efficient", "exact"]
# An option takes one value, a list with commas, so that it never takes the scenes that follow.
Names = Annotated[tuple[str, ...], Parameter(converter=_listed, metavar="NAME,…")]
Controls = Annotated[tuple[str, ...], Parameter(help=_CONTROL, metavar="NAME=VALUE|FILE")]
ColumnNames = Annotated[tuple[str, ...], Parameter(help=_MAP, metavar="TITLE=COLUMN")]
_Sliding = Parameter(help=_FRICTION, converter=_listed, metavar="SLIDING,…")
Frictions = Annotated[tuple[str, ...], _Sliding]
Threads = Annotated[int | None, Parameter(help=_THREADS), _COUNT]
Seed = Annotated[int, Parameter(help="Seed of the random starts."), _COUNT]
Environments = Annotated[Path | None, Parameter(help=_PLACE, metavar="DIR")]
_FLAT = Parameter(name="*")


@dataclass(frozen=True)
class Sweep:
    """Options of a study that sweeps over many runs."""

    workers: Annotated[int | None, _COUNT] = None
    """Number of processes. Default: one for each core."""
    quick: bool = False
    """Run a coarse form of the study, in under a minute."""
    out: Annotated[Path, Parameter(metavar="DIR")] = OUT
    """Folder for the results. An interrupted study continues with the results in this folder."""
    json: JsonFile = None

    def results(
        self, work: Work, cells: Sequence[Cell], journal: str, limit: float
    ) -> list[Result]:
        """Sweep the runs of a study, each within a time limit [s].

        `journal` is the name, without extension, of the file from which a later sweep continues.
        Raises InputError before the first run if the folder cannot be written.
        """
        from .output import progress_bar, writable_folder
        from .sweeps import sweep

        writable_folder(self.out)
        file = self.out / f"{journal}.jsonl"
        with progress_bar(len(cells)) as show:
            return sweep(work, cells, file, workers=self.workers, limit=limit, show=show)

    def present(self, study: Study, *words: str) -> int:
        """Write and print a study; return the exit status. `words` are added to the file names."""
        from .output import write_record
        from .study import present

        # The quick form must not overwrite the files of the whole study.
        stem = study.stem(*words, *["quick"] * self.quick)
        picture, json, csv = (self.out / f"{stem}.{end}" for end in ("png", "json", "csv"))
        print(*present(study, picture, json, csv), sep="\n")
        if study.record is not None:
            write_record(self.json, study.record)
        return AGREES


SWEEP = Sweep()
SweepOptions = Annotated[Sweep, _FLAT]


@dataclass(frozen=True)
class Run:
    """Options of a run with an engine."""

    preset: Names = ()
    """Settings of the engine: naive, fast, balanced (the default), accurate, efficient or exact.
    Several, as naive,fast, give a run each. Other engines have other presets."""
    control: Controls = ()
    controller: Annotated[str | None, Parameter(metavar="FILE.py:NAME")] = None
    """A controller (rb.Controller) in a Python file. The file is run, and the controller commands
    the scene's motors from the sensor readings."""
    friction: Frictions = ()
    engine: Annotated[str, Parameter(metavar="ENGINE")] = "mujoco"
    """The engine; 'robotball engines' lists them."""
    accuracy: Annotated[float | None, Parameter(metavar="ERROR")] = None
    """Largest path error, relative to the path length. Replaces the preset with settings that reach
    this error."""
    duration: Duration = None
    out: Out = OUT
    strict: bool = False
    """Refuse settings that are predicted to fail, instead of warning of them."""
    keep_going: bool = False
    """Continue the run after a fault, as long as the state is finite."""
    environments: Environments = None

    @property
    def presets(self) -> Sequence[str | None]:
        """The names of the presets, None for the engine's default."""
        return self.preset or (None,)

    def request(self, preset: str | None) -> Request:
        """Return the request to the engine."""
        from robotball.engines.engine import request_of

        request = request_of(self.engine, preset, self.accuracy, keep_going=self.keep_going)
        request = replace(request, strict=self.strict)
        if self.environments is None:
            return request
        # Most commands need no adapter, so import it late.
        from robotball.engines.adapter import elsewhere

        return replace(request, engine=elsewhere(request.engine, self.environments))

    def scene(self, name: str) -> Scene:
        """Load a scene with the controls, the controller and the friction."""
        from .results import controlled

        return controlled(name, self.control, self.controller, self.friction)

    def agreements(self, scenes: Sequence[Scene]) -> list[Agreement]:
        """Run each scene by each preset, with progress shown."""
        from .comparing import agreements_of, shifted
        from .output import progress_bar, writable_folder

        writable_folder(self.out)
        requests = [self.request(name) for name in self.presets]
        times = times_of(self.duration)
        found: list[Agreement] = []
        with progress_bar(len(scenes) * len(requests)) as show:
            for scene in scenes:
                found += agreements_of(scene, requests, times, shifted(show, len(found)))
        return found


RUN = Run()
RunOptions = Annotated[Run, _FLAT]


@dataclass(frozen=True)
class Once:
    """Options of a study of one scene in one go."""

    duration: Duration = None
    quick: bool = False
    """Run a coarse form of the study: one simulated second, and fewer variants."""
    out: Out = OUT
    json: JsonFile = None
    csv: CsvFile = None

    def run(
        self, study: Callable[[Scene, Array, bool], Study], name: str, controls: Sequence[str]
    ) -> int:
        """Run a study of a scene, write its picture and data, and print it; return the status.

        study: takes the scene, the sample times (n,) [s], and whether it is the quick form. Raises
        InputError before the first run if the folder cannot be written.
        """
        from robotball import sample_times

        from .output import writable_folder
        from .results import changed, controlled

        scene = controlled(name, controls)
        times = sample_times(seconds_of(self.duration, self.quick, scene))
        writable_folder(self.out)
        words = changed(Once, duration=self.duration, quick=self.quick)
        made = study(scene, times, self.quick)
        return present_once(made, self.out, self.json, words, self.csv)


ONCE = Once()
OnceOptions = Annotated[Once, _FLAT]


def present_once(
    study: Study, out: Path, json: Path | None, words: Sequence[str] = (), csv: Path | None = None
) -> int:
    """Write and print a study; return the exit status. `words` are added to the picture's name."""
    from .study import present

    written = present(study, out / f"{study.stem(*words)}.png", json, csv)
    if study.picture is not None:
        print(written[0])
    return AGREES


def chosen(kind: str, names: Sequence[str], known: Mapping[str, _T]) -> list[_T]:
    """Return the values of distinct names, or all values without names.

    Raises InputError for an unknown name; `kind` describes it in the message.
    """
    from robotball.errors import unknown

    for name in names:
        if name not in known:
            raise unknown(kind, name, known)
    return [known[name] for name in dict.fromkeys(names or known)]


def span_of(text: str) -> tuple[str, float, float]:
    """Return the name and the two numbers of `NAME=FROM:TO`. Raises InputError for other texts."""
    from robotball import InputError

    name, _, span = text.strip().partition("=")
    try:
        low, high = map(float, span.split(":"))
    except ValueError:
        low = high = math.nan
    if not 0 < abs(high - low) < math.inf:
        raise InputError(f"--over takes NAME=FROM:TO with FROM ≠ TO, as Omega=0:1, not {text!r}")
    return name, low, high


def seconds_of(duration: float | None, quick: bool, scene: Scene) -> float:
    """Return the simulated time [s] of a study. Raises InputError unless it is positive."""
    from robotball.errors import check_positive

    if duration is None:
        # The quick form does not shorten a given duration.
        return _QUICK if quick else scene.duration
    check_positive("duration", duration, "s")
    return duration


def times_of(duration: float | None) -> Array | None:
    """Return the sample times of a duration [s]; None for the duration of each scene."""
    from robotball import sample_times

    return None if duration is None else sample_times(duration)
