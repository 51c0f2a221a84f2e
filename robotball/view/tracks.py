"""Name, line style and interpolated path of a motion, for pictures.

Each engine and preset has one colour, dash and marker in all pictures. The colours are from Okabe
and Ito and from Tol. Colour-blind readers can distinguish them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from robotball.robot.mechanics import Robot
from robotball.rotations import Array, rotation_matrix, turn_between, turned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colour, dash and marker of each preset. Default settings have the engine's colour and marker.
_SPARE = (("#882255", (6, 2), "d"), ("#332288", (2, 2), "^"), ("#999933", (7, 2, 2, 2), ">"))
PRESET_LOOKS: Mapping[str, tuple[str, Sequence[float], str]] = {
    **dict.fromkeys(("fast", "slip"), ("#B08900", (7, 2, 2, 2), "D")),
    "balanced": ("#009E73", (6, 2), "s"),
    "accurate": ("#CC79A7", (2, 2), "^"),
    "efficient": ("#661100", (4, 2), "*"),
    "exact": ("#56B4E9", (1, 3), "v"),
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


# Slip is a band under a path, BAND points wide, and a shade behind times.
SLIPS, BAND, SHADE = LineStyle("slips", "#F0E442"), 11.0, 0.4


def slips_of(motion: Any) -> Sequence[tuple[float, float]]:
    """Return the intervals [s] in which the shell slips. Contact engines do not record them."""
    return getattr(motion, "slipping", ())


def slip_parts(slips: Sequence[tuple[float, float]], times: Array) -> list[slice]:
    """Return which samples at ascending times (m,) [s] are in each interval of slip.

    A part includes the samples before and after its interval, so that no slip is too short to see.
    """
    return [
        slice(int(np.searchsorted(times, a, "right")) - 1, int(np.searchsorted(times, b)) + 1)
        for a, b in slips
        if a < times[-1]
    ]


def draw_slips(
    axes: "Axes", paths: Sequence[Array] = (), slips: Sequence[tuple[float, float]] = ()
) -> None:
    """Draw a band under the parts (k, 2) of a path with slip, or shade intervals [s] of slip."""
    style: Any = {"label": SLIPS.label, "zorder": 1}
    if paths:
        from matplotlib.collections import LineCollection

        band = LineCollection(paths, colors=SLIPS.colour, linewidths=BAND, capstyle="butt", **style)
        axes.add_collection(band, autolim=False)
    if slips:
        style |= {"color": SLIPS.colour, "alpha": SHADE, "linewidth": 0}
        spans = [(begin, end - begin) for begin, end in slips]
        axes.broken_barh(spans, (0, 1), transform=axes.get_xaxis_transform(), **style)


def label_of(motion: Any) -> str:
    """Return the names of engine and settings: "MuJoCo, fast", "MuJoCo, default settings"."""
    report = getattr(motion, "report", None)
    if report is None:
        return str(motion.engine.name)
    if report.settings.name in ("naive", "as-it-comes"):
        return f"{motion.engine.name}, default settings"
    return f"{motion.engine.name}, {report.settings.name}"


def line_looks(motions: Sequence[Any]) -> list[LineStyle]:
    """Return the line style of each motion, given by its preset or else by its engine.

    If a colour is already taken, for example by unnamed settings of the same engine, the next free
    colour is used. The equations have no marker.
    """
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


@dataclass(frozen=True)
class Moments:
    """The parts of a motion that a picture shows, at m times; fields as in Motion."""

    contact_point: Array
    attitude: Array
    hinge_angles: Array
    hinge_rates: Array

    def __getitem__(self, some: slice) -> "Moments":
        """Return a subset of the times."""
        return Moments(*(getattr(self, field.name)[some] for field in fields(Moments)))


@dataclass(frozen=True)
class Track:
    """A motion that can be interpolated: attitude with slerp, others with cubics of four samples.

    names: names of the robot's bodies. After its last sample the motion is at rest.
    """

    times: Array
    sampled: Moments
    names: tuple[str, ...]
    robot: Robot

    @property
    def points(self) -> Array:
        """Sampled contact points (n, 2) in radii."""
        return self.sampled.contact_point / self.robot.radius

    def at(self, times: Array) -> Moments:
        """Return the motion at ascending times (m,) [s]."""
        inside, last = np.minimum(times, self.times[-1]), len(self.times) - 1
        count = min(4, last + 1)  # of the samples around each time
        after = np.clip(np.searchsorted(self.times, inside), 1, last)
        rows = np.clip(after - count // 2, 0, last + 1 - count)[:, None] + np.arange(count)
        # Lagrange's polynomials: 1 at one sample and 0 at the others.
        gaps = self.times[rows][:, :, None] - self.times[rows][:, None] + np.eye(count)
        away = (inside[:, None] - self.times[rows])[:, None] * (1 - np.eye(count)) + np.eye(count)
        weights = (away / gaps).prod(axis=2)
        columns = {
            name: np.einsum("mc,mcn->mn", weights, column[rows])
            for name, column in vars(self.sampled).items()
        }
        begin, end = self.sampled.attitude[after - 1], self.sampled.attitude[after]
        part = (inside - self.times[after - 1]) / (self.times[after] - self.times[after - 1])
        columns["attitude"] = turned(begin, part[:, None] * turn_between(begin, end))
        return Moments(**columns)

    def sampled_at(self, times: Array) -> "Track":
        """Return the track resampled at ascending times (m,) [s]."""
        return replace(self, times=times, sampled=self.at(times))

    def stands(self, then: Moments) -> dict[str, tuple[Array, Array]]:
        """Return each body's rotation matrix (m, 3, 3) and translation (m, 3) in radii."""
        to_world, radius = rotation_matrix(then.attitude), self.robot.radius
        centre = np.column_stack([then.contact_point / radius, np.ones(len(then.attitude))])
        turned, shifted = self.robot.moved(then.hinge_angles)
        shifts = centre + np.einsum("nij,bnj->bni", to_world, shifted / radius)
        return dict(zip(self.names, zip(to_world @ turned, shifts, strict=True), strict=True))


def track_of(motion: Any) -> Track:
    """Return the track of a motion with at least two samples."""
    sampled = Moments(*(getattr(motion, field.name) for field in fields(Moments)))
    bodies = tuple(link.name for link in motion.scene.ball.tree)
    return Track(motion.times, sampled, bodies, motion.scene.robot)


def heading_of(points: Array) -> float:
    """Return the direction [rad] from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))
