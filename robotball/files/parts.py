"""The hand-written parts in mjcf/, of which models and pictures are composed."""

import warnings
from pathlib import Path
from typing import Any

with warnings.catch_warnings(action="ignore"):
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    from dm_control import mjcf

PARTS = Path(__file__).parents[2] / "mjcf"


def part(name: str) -> Any:
    """The hand-written part mjcf/`name`.xml as it is, in units of the ball's radius."""
    return mjcf.from_path(str(PARTS / f"{name}.xml"))
