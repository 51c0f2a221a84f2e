"""Options and exit statuses that commands share.

Imports stand within the functions, so that `robotball --help` loads none of what a study needs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from tyro.conf import DisallowNone, OmitArgPrefixes, Positional, UseAppendAction, arg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from robotball import Request, Scene
    from robotball.rotations import Array

    from .agreement import Agreement
    from .study import Study
    from .sweeps import Cell, Result, Work

_T = TypeVar("_T")
AGREES, DISAGREES, BAD_INPUT = 0, 1, 2
OUT = Path("out")
_QUICK = 1.0  # s, simulated by a quick form of a study

SceneName = Positional[Annotated[str, arg(metavar="SCENE")]]
# An option that is None says in its own words what is done then, as names do of which there are
# none.
Given = DisallowNone[Annotated[_T | None, arg(help_behavior_hint="")]]
Several = Positional[Annotated[tuple[str, ...], arg(help_behavior_hint="")]]
Duration = Annotated[Given[float], arg(metavar="SECONDS")]
File = Annotated[Given[Path], arg(metavar="FILE|-")]
PRESET = "naive|fast|balanced|accurate|adaptive"
Preset = Annotated[Given[str], arg(metavar=PRESET)]
# One value an option, so that it never takes the scenes that follow.
_Repeated = UseAppendAction[Annotated[tuple[str, ...], arg(help_behavior_hint="")]]
Names = Annotated[_Repeated, arg(metavar="NAME,…")]  # `listed` reads them
_CONTROL_HELP = (
    "A control of an actuator of a robot's own file, in place of the file's: a number, or a table "
    "(.csv, .npz) of time and value, by smooth curves between; once for each actuator."
)
Controls = Annotated[_Repeated, arg(name="control", metavar="NAME=VALUE|FILE", help=_CONTROL_HELP)]

_LOOP_HELP = (
    "A controller (rb.Controller) of a Python file, which is run: it commands the scene's motors "
    "by what the robot's sensors read, in place of the scene's own commands."
)
ControllerName = Annotated[Given[str], arg(metavar="FILE.py:NAME", help=_LOOP_HELP)]

_THREADS_HELP = (
    "How many cores to work on; all that this process may use if not given. The numbers are the "
    "same with any."
)
Threads = Annotated[Given[int], arg(metavar="N", help=_THREADS_HELP)]
Cluster = Annotated[Given[str], arg(metavar="tcp://HOST:PORT")]


@dataclass(frozen=True)
class Sweep:
    """Options of a study that sweeps over many runs."""

    workers: Annotated[Given[int], arg(metavar="N")] = None
    """Processes on this machine; as many as it has cores if not given."""
    cluster: Cluster = None
    """The scheduler of a dask cluster to run on instead."""
    quick: bool = False
    """A coarse form of the study, under a minute."""
    out: Path = OUT
    """Folder for everything; started again after a break, the study goes on with what is there."""
    json: File = None
    """Also write what was found."""

    def results(
        self, work: Work, cells: Sequence[Cell], journal: str, limit: float
    ) -> list[Result]:
        """Sweep a study's runs, none of which may take longer than `limit` [s].

        journal: the name, without its end, of the file that keeps the results for another time.
        Raises InputError, before the first run, if the folder cannot be written.
        """
        from .output import progress_bar, writable_folder
        from .sweeps import sweep

        writable_folder(self.out)
        place: Any = {"workers": self.workers, "cluster": self.cluster}
        with progress_bar(len(cells)) as show:
            return sweep(
                work, cells, self.out / f"{journal}.jsonl", limit=limit, show=show, **place
            )

    def present(self, study: Study, *words: str) -> int:
        """Write a study's picture, data and table, and print it; return the exit status.

        words: what the command's own options add to the files' names.
        """
        from .output import write_record
        from .results import changed
        from .study import present

        # A quick form's files must not take the place of the whole study's.
        stem = study.stem(*words, *changed(self, "quick"))
        picture, json, csv = (self.out / f"{stem}.{end}" for end in ("png", "json", "csv"))
        print(*present(study, picture, json, csv), sep="\n")
        if study.record is not None:
            write_record(self.json, study.record)
        return AGREES


SweepOptions = OmitArgPrefixes[Sweep]


@dataclass(frozen=True)
class Run:
    """Options of a run by an engine."""

    engine: Annotated[str, arg(metavar="ENGINE")] = "mujoco"
    """The engine; `robotball engines` lists them."""
    accuracy: Annotated[Given[float], arg(metavar="ERROR")] = None
    """Instead of a preset, the path error to reach: settings are chosen for it."""
    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    out: Path = OUT
    """Folder for pictures."""
    strict: bool = False
    """Refuse settings that are predicted to fail, in place of a warning."""
    keep_going: bool = False
    """Go on after a fault, as long as there is a state."""
    environments: Annotated[Given[Path], arg(metavar="FOLDER")] = None
    """Folder of the engines' environments; if not given, where `engines --install` makes them."""

    def request(self, preset: str | None) -> Request:
        """Return the request to the engine."""
        from robotball.engines.engine import request_of

        request = request_of(self.engine, preset, self.accuracy, keep_going=self.keep_going)
        if self.environments is None:
            return request
        # Only where an environment is asked for, as most commands need no adapter.
        from robotball.engines.adapter import elsewhere

        return replace(request, engine=elsewhere(request.engine, self.environments))

    def agreements(self, scenes: Sequence[Scene], presets: Sequence[str]) -> list[Agreement]:
        """Run each scene by each preset, the engine's default if none is given, with progress."""
        from .comparing import agreements_of, shifted
        from .output import progress_bar

        requests = [self.request(name) for name in presets or (None,)]
        times, strict = times_of(self.duration), self.strict
        found: list[Agreement] = []
        with progress_bar(len(scenes) * len(requests)) as show:
            for scene in scenes:
                part = shifted(show, len(found))
                found += agreements_of(scene, requests, times, strict=strict, show=part)
        return found


RunOptions = OmitArgPrefixes[Annotated[Run, arg(name="run")]]


@dataclass(frozen=True)
class Once:
    """Options of a study of one scene in one go."""

    duration: Duration = None
    """Simulated time; the scene's own if not given."""
    quick: bool = False
    """One simulated second, and less of everything: in a few seconds."""
    out: Path = OUT
    """Folder for the picture."""
    json: File = None
    """Also write every run with its settings."""
    csv: File = None
    """Also write the table as CSV."""

    def times(self, scene: Scene) -> Array:
        """Return the sample times (n,) [s]. Raises InputError if no picture can be written."""
        from robotball import sample_times

        from .output import writable_folder

        times = sample_times(seconds_of(self.duration, self.quick, scene))
        writable_folder(self.out)
        return times

    def present(self, study: Study) -> int:
        """Write a study's picture and the data asked for, and print it; return the status."""
        from .results import changed
        from .study import present

        stem = study.stem(*changed(self, "duration", "quick"))
        print(present(study, self.out / f"{stem}.png", self.json, self.csv)[0])
        return AGREES


OnceOptions = OmitArgPrefixes[Once]


def chosen(kind: str, names: Sequence[str], known: Mapping[str, _T]) -> list[_T]:
    """Return the named ones of what is known, each once, or all where no name is given.

    Raises InputError for a name that is not known; kind: what the message calls it.
    """
    from robotball.errors import unknown

    for name in names:
        if name not in known:
            raise unknown(kind, name, known)
    return [known[name] for name in dict.fromkeys(names or known)]


def listed(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of an option of `Names`: lists with commas, given any number of times."""
    return tuple(name.strip() for each in names for name in each.split(",") if name.strip())


def seconds_of(duration: float | None, quick: bool, scene: Scene) -> float:
    """Return the simulated time [s] of a study. Raises InputError unless it is positive."""
    from robotball.errors import check_positive

    if duration is None:
        # A duration that is given stands in the quick form, too.
        return _QUICK if quick else scene.duration
    check_positive("duration", duration, "s")
    return duration


def times_of(duration: float | None) -> Array | None:
    """Return sample times of a duration [s]; None, each scene's own, where none is given."""
    from robotball import sample_times

    return None if duration is None else sample_times(duration)
