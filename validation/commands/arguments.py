"""What the commands share: exit statuses, and arguments of the same kind and name."""

from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, Positional, arg

from robotball import sample_times
from robotball.rotations import Array

AGREES, DISAGREES, BAD_INPUT = 0, 1, 2
OUT = Path("out")

SceneName = Positional[Annotated[str, arg(metavar="SCENE")]]
Duration = DisallowNone[Annotated[float | None, arg(metavar="SECONDS")]]
Accuracy = DisallowNone[Annotated[float | None, arg(metavar="ERROR")]]
File = DisallowNone[Annotated[Path | None, arg(metavar="FILE")]]
Preset = DisallowNone[Annotated[str | None, arg(metavar="PRESET")]]


def times_of(duration: float | None) -> Array | None:
    """Sample times of a duration [s]; None, each scene's own, where none is given."""
    return None if duration is None else sample_times(duration)
