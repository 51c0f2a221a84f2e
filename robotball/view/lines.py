"""The looks of lines: an engine and a preset have one colour, dash and marker in all pictures.

The colours are Okabe and Ito's and Tol's, which colour-blind readers distinguish. An engine's own
and its marker are in its label. Nothing heavy is imported, as processes that only draw need this.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Look(NamedTuple):
    """The label, colour, dash (in widths of the line) and marker by which a line is known."""

    label: str
    colour: str
    dash: Sequence[float] = ()
    marker: str = ""


# The looks of presets: colour, dash and marker. An engine as it comes has the engine's own.
_MORE = (("#882255", (6, 2), "d"), ("#332288", (2, 2), "^"), ("#999933", (7, 2, 2, 2), ">"))
PRESET_LOOKS: Mapping[str, tuple[str, Sequence[float], str]] = {
    "fast": ("#B08900", (7, 2, 2, 2), "D"),
    "balanced": ("#009E73", (6, 2), "s"),
    "accurate": ("#CC79A7", (2, 2), "^"),
    "adaptive": ("#56B4E9", (1, 3), "v"),
    **dict.fromkeys(("best", "mended"), _MORE[0]),
    **dict.fromkeys(("ideal", "contact", "kept"), _MORE[1]),
    **dict.fromkeys(("discrete", "RK4"), _MORE[2]),
}


def label_of(motion: Any) -> str:
    """Return the engine's name with that of its settings: "MuJoCo, fast", "MuJoCo as it comes"."""
    report = getattr(motion, "report", None)
    if report is None:
        return str(motion.engine.name)
    if report.settings.name in ("naive", "as-it-comes"):
        return f"{motion.engine.name} as it comes"
    return f"{motion.engine.name}, {report.settings.name}"


def line_looks(motions: Sequence[Any]) -> list[Look]:
    """Return the look of each `Motion`: its preset's, else its engine's.

    A motion whose colour is taken, as of settings that have no name, has a further one. The
    equations' have no marker.
    """
    looks = list[Look]()
    for motion in motions:
        settings, engine = getattr(motion, "report", None), motion.engine
        own = (engine.colour, (), engine.marker if settings else "")
        named = PRESET_LOOKS.get(settings.settings.name, own) if settings else own
        taken = {look.colour for look in looks}
        free = [row for row in (named, *_MORE, *PRESET_LOOKS.values()) if row[0] not in taken]
        looks.append(Look(label_of(motion), *(free or [named])[0]))
    return looks


def colours_of(motions: Sequence[Any]) -> list[str]:
    """Return the colour of each `Motion`, as `line_looks` has it."""
    return [look.colour for look in line_looks(motions)]
