"""Line styles: each engine and preset has one colour, dash and marker in all pictures.

The colours are from Okabe and Ito and from Tol, and distinguishable for colour-blind readers. An
engine's default colour and marker are in its `Label`. Nothing heavy is imported here, because
drawing processes need this module.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

# Colour, dash and marker of each preset. Default settings have the engine's colour and marker.
_SPARE = (("#882255", (6, 2), "d"), ("#332288", (2, 2), "^"), ("#999933", (7, 2, 2, 2), ">"))
PRESET_LOOKS: Mapping[str, tuple[str, Sequence[float], str]] = {
    "fast": ("#B08900", (7, 2, 2, 2), "D"),
    "balanced": ("#009E73", (6, 2), "s"),
    "accurate": ("#CC79A7", (2, 2), "^"),
    "adaptive": ("#56B4E9", (1, 3), "v"),
    **dict.fromkeys(("best", "mended"), _SPARE[0]),
    **dict.fromkeys(("ideal", "contact", "kept"), _SPARE[1]),
    **dict.fromkeys(("discrete", "RK4"), _SPARE[2]),
}


class LineStyle(NamedTuple):
    """Label, colour, dash (in line widths) and marker of a line."""

    label: str
    colour: str
    dash: Sequence[float] = ()
    marker: str = ""


def label_of(motion: Any) -> str:
    """Return the names of engine and settings: "MuJoCo, fast", "MuJoCo as it comes"."""
    report = getattr(motion, "report", None)
    if report is None:
        return str(motion.engine.name)
    if report.settings.name in ("naive", "as-it-comes"):
        return f"{motion.engine.name} as it comes"
    return f"{motion.engine.name}, {report.settings.name}"


def line_looks(motions: Sequence[Any]) -> list[LineStyle]:
    """Return the line style of each motion: of its preset, otherwise of its engine.

    If a colour is already taken, for example by unnamed settings of the same engine, the next free
    one is used. The equations have no marker.
    """
    looks = list[LineStyle]()
    looks = list[LineStyle]()
    for motion in motions:
        settings, engine = getattr(motion, "report", None), motion.engine
        default = (engine.colour, (), engine.marker if settings else "")
        preset = PRESET_LOOKS.get(settings.settings.name, default) if settings else default
        taken = {look.colour for look in looks}
        free = [row for row in (preset, *_SPARE, *PRESET_LOOKS.values()) if row[0] not in taken]
        looks.append(LineStyle(label_of(motion), *(free or [preset])[0]))
    return looks


def colours_of(motions: Sequence[Any]) -> list[str]:
    """Return the colour of each motion's line style."""
    return [look.colour for look in line_looks(motions)]
