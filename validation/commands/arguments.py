"""What the commands share: exit statuses, and arguments of the same kind and name.

Commands load what they need when they run, so that `--help` loads none of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import DisallowNone, OmitArgPrefixes, Positional, arg

if TYPE_CHECKING:
    from robotball.rotations import Array

AGREES, DISAGREES, BAD_INPUT = 0, 1, 2
OUT = Path("out")
QUICK = 1.0  # s, simulated by a quick form of a study

SceneName = Positional[Annotated[str, arg(metavar="SCENE")]]
EngineName = Annotated[str, arg(metavar="ENGINE")]
Duration = DisallowNone[Annotated[float | None, arg(metavar="SECONDS")]]
Accuracy = DisallowNone[Annotated[float | None, arg(metavar="ERROR")]]
File = DisallowNone[Annotated[Path | None, arg(metavar="FILE")]]
Preset = DisallowNone[Annotated[str | None, arg(metavar="PRESET")]]


@dataclass(frozen=True)
class Sweep:
    """Options of a study that sweeps over many runs."""

    workers: DisallowNone[Annotated[int | None, arg(metavar="N")]] = None
    """Processes on this machine; as many as it has cores if not given."""
    cluster: DisallowNone[Annotated[str | None, arg(metavar="tcp://HOST:PORT")]] = None
    """The scheduler of a dask cluster to run on instead."""
    quick: bool = False
    """A coarse form of the study, under a minute."""
    out: Path = OUT
    """Folder for everything; started again after a break, the study goes on with what is there."""


SweepOptions = OmitArgPrefixes[Sweep]


def times_of(duration: float | None) -> Array | None:
    """Sample times of a duration [s]; None, each scene's own, where none is given."""
    from robotball import sample_times

    return None if duration is None else sample_times(duration)


def check_files(*paths: Path | None) -> None:
    """Raise InputError, before any work, for a path that cannot be written."""
    from validation.output import writable_file

    for path in filter(None, paths):
        writable_file(path)
