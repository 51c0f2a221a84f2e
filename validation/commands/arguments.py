"""What the commands share: exit statuses, and arguments of the same kind and name."""

from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, Positional, arg

AGREES, DISAGREES, BAD_INPUT = 0, 1, 2
OUT = Path("out")

SceneName = Positional[Annotated[str, arg(metavar="SCENE")]]
Duration = DisallowNone[Annotated[float | None, arg(metavar="SECONDS")]]
File = DisallowNone[Annotated[Path | None, arg(metavar="FILE")]]
Preset = DisallowNone[Annotated[str | None, arg(metavar="PRESET")]]
