"""What the pictures of a scene's agreements show, in plain numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from robotball.motion import Motion
    from validation.comparison.agreement import Agreement

# As in robotball.rotations, which would bring scipy to who draws.
Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST = 50_000  # points of a line: a dozen for each column of pixels


@dataclass(frozen=True)
class Line:
    """A motion in a picture: times (n,) s, contact_point (n, 2) m and momentum (n, 3) kg m²/s."""

    label: str
    colour: str
    times: Array
    contact_point: Array
    momentum: Array


@dataclass(frozen=True)
class Errors:
    """Of a motion: values (n,) at times (n,) s, without the zero that they start from."""

    times: Array
    values: Array
    largest: float


@dataclass(frozen=True)
class Run:
    """A motion by an engine, with its path's errors [m] and its momentum's, relative.

    settings: their name; finished: whether the motion is as long as it should be.
    """

    line: Line
    settings: str
    finished: bool
    path_errors: Errors
    momentum_errors: Errors


@dataclass(frozen=True)
class Sheet:
    """What a scene's pictures show.

    momentum_labels: the names of M's components by their heights; scale: kg m²/s, of M.
    """

    title: str
    theory: Line
    runs: Sequence[Run]
    keeps_momentum: bool
    momentum_labels: dict[float, str]
    scale: float


def sheet_of(agreements: Sequence["Agreement"]) -> Sheet:
    """The sheet of one scene's agreements, by one engine."""
    from robotball.shown import by_value

    theory = agreements[0].theory
    scene = theory.scene
    return Sheet(
        title=f"{scene.name}: {scene.title}",
        theory=_line(theory, theory.engine.name),
        runs=[
            Run(
                _line(each.motion, f"{each.motion.engine.name}, {each.settings.name}"),
                each.settings.name,
                each.finished,
                _errors(each.motion, each.path_errors),
                _errors(each.motion, each.momentum_errors),
            )
            for each in agreements
        ],
        keeps_momentum=scene.keeps_momentum,
        momentum_labels=by_value(theory.momentum[0 if scene.keeps_momentum else -1]),
        scale=scene.momentum_scale,
    )


def _line(motion: "Motion", label: str) -> Line:
    shown = slice(None, None, 1 + len(motion.times) // MOST)
    paths = motion.contact_point[shown], motion.momentum[shown]
    return Line(label, motion.engine.colour, motion.times[shown], *paths)


def _errors(motion: "Motion", values: Array) -> Errors:
    which = 1 + extremes(values[1:])
    return Errors(motion.times[which], values[which], float(values.max(initial=0.0)))


def extremes(values: Array) -> Integers:
    """The places of the values (n,), or of the largest and the smallest of each bin of many."""
    if len(values) <= MOST:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST // 2 + 1).astype(int)
    ends = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    found = [sorted((i + values[i:j].argmin(), i + values[i:j].argmax())) for i, j in ends]
    return np.array(found).ravel()
