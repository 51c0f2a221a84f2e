"""Draw motions frame by frame: balls with their names under one camera, and the errors below them.

Each ball has its engine's colour, or one of its own where an engine has several. A sheet has the
title, the time, and the distances of the contact points from the equations' with a moving cursor;
all that does not change is drawn once. Frames are encoded one by one, so that memory does not grow
with a film's length.
"""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from robotball.errors import InputError, check_positive
from robotball.files import as_path
from robotball.files.replacing import replacing
from robotball.motion import Motion
from robotball.processes import in_processes
from robotball.robot import looks as palette
from robotball.robot.looks import GHOST, MARKS, Looks, looks_of
from robotball.rotations import Array, Z, rotation_matrix
from robotball.view import gl
from robotball.view.lines import colours_of, label_of
from robotball.view.stage import LENS, Arrow, Camera, Pixels, Seen, Stage
from robotball.view.tracks import Moments, Track, heading_of, track_of

_FONTS = Path(matplotlib.get_data_path(), "fonts", "ttf")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PAPER = "#FFFFFF"
_LINES, _COLUMNS = 26, 25  # lines of text in the picture's height, and their heights in its width
_HEADER, _FOOTER = 2.5, 7.4  # heights in lines
_EDGE, _LEFT, _LOW, _HIGH = 0.6, 4.6, 1.5, 5.5  # in lines: of text and of curves, from their edges
_PLAIN = 0.68  # lines, the size of letters that are not bold
_TICKS = 6  # decades with a line and a number, at most, of the curves
_DPI = 64  # a power of two, by which a number of pixels is a number of inches without rounding
_LEAST_DISTANCE = 1e-17  # m; smaller ones are drawn there, as a logarithm has no zero
_Word = tuple[str, str, tuple[float, float]]  # a text, its colour, and the pixel of its middle


class _Sheet:
    """The frame around the pictures: what is fixed is drawn once, the rest in each frame.

    motions: the last is what the others are held against; note: the line below the title; times
    (m,) [s] and apart (n - 1, m) [m]: the curves of the others. Its `pane` is the (height, width)
    in pixels of one picture, `line` the height of a line.
    """

    def __init__(
        self, motions: Sequence[Motion], film: "Film", note: str, times: Array, apart: Array
    ) -> None:
        from matplotlib.figure import Figure  # the processes that draw need none

        self.names, self.colours = names, colours = [*map(label_of, motions)], colours_of(motions)
        (height, width), panes = film.size, 1 if film.together else len(motions)
        self.line = line = min(height / _LINES, width / _COLUMNS)
        top = round(_HEADER * line)
        tall = height - top - round(_FOOTER * line)
        # Pictures stand side by side, or one above the other on a narrow screen.
        down, along = (tall // panes, 0) if tall > width else (0, width // panes)
        self.pane = (down or tall) - 2, (along or width) - 2
        self._corners = [(top + 1 + i * down, 1 + i * along) for i in range(panes)]
        self._bold, plain = (
            ImageFont.truetype(str(_FONTS / f"DejaVuSans{kind}.ttf"), size * line)
            for kind, size in (("-Bold", 0.76), ("", _PLAIN))
        )
        # Right of the curves. A single motion has no curve.
        room = max(map(plain.getlength, names[:-1]), default=0.0) + 2 * _EDGE * line
        # From the left and from above, as a picture's pixels are counted.
        left, high = _LEFT * line, height - _HIGH * line
        right, low = width - room, height - _LOW * line
        self._curves, end = (left, high, right, low), float(times[-1])
        distances = apart if len(apart) else np.ones((1, len(times)))
        # The first errors are often rounding alone.
        least = np.floor(np.log10(max(np.percentile(distances[:, 1:], 1), _LEAST_DISTANCE)))
        most = np.ceil(np.log10(max(distances.max(), _LEAST_DISTANCE)))
        most = max(least + 1, most)
        ends = 10.0 ** np.array([least, most])
        # Every other decade, or fewer of many, so that the numbers have room.
        ticks = 10.0 ** np.arange(most, least - 1, -2 * np.ceil((most - least) / 2 / _TICKS))
        ticks = ticks[: len(apart) * len(ticks)]
        known = np.maximum(apart, ends[0])
        figure, points = Figure((width / _DPI, height / _DPI), _DPI), 72 / _DPI * line
        axes = figure.add_axes(
            (left / width, 1 - low / height, (right - left) / width, (low - high) / height),
            xlim=(0, end), xticks=(0, end), xticklabels=("0 s", f"{end:g} s"), yscale="log",
            ylim=ends, yticks=ticks, yticklabels=map(_metres, ticks), frame_on=False,
        )  # fmt: skip
        axes.minorticks_off()
        axes.tick_params(length=0, pad=0.4 * points, labelsize=_PLAIN * points)
        axes.grid(axis="y", color=palette.FAINT)
        for curve, colour in zip(known, colours, strict=False):
            axes.plot(times, curve, color=colour, linewidth=points / 12, clip_on=False)
        pixels = io.BytesIO()
        figure.savefig(pixels, format="png", dpi=_DPI)
        image = Image.open(pixels).convert("RGB")
        pen, edge = ImageDraw.Draw(image), _EDGE * line
        for text, font, y in (
            (" ".join(motions[-1].scene.title.split()), self._bold, 0.85 * line),
            (note, plain, 1.8 * line),
            (f"distance from the {names[-1]}" * bool(len(apart)), plain, high - 0.9 * line),
        ):
            while font.getlength(text) > width - 2 * edge:
                text = text.removesuffix("…")[:-1] + "…"
            pen.text((edge, y), text, palette.INK, font, "lm")
        heights = np.interp(np.log(known[:, -1]), np.log(ends), (low, high)).tolist()
        middles = [(width - room / 2, y) for y in heights]
        words = sorted(zip(names, colours, middles, strict=False), key=lambda word: -word[2][1])
        _write(image, words, plain, np.array([0, 0, width, height]))
        self._still, self._end = np.asarray(image), end

    def frame(self, pictures: list[Pixels], words: list[list[_Word]], t: float) -> Pixels:
        """Return the frame (height, width, 3) at t [s] with pictures and the words on each."""
        whole, (height, width) = self._still.copy(), self.pane
        for picture, (y, x) in zip(pictures, self._corners, strict=True):
            whole[y : y + height, x : x + width] = picture
        image = Image.fromarray(whole)
        for some, (y, x) in zip(words, self._corners, strict=True):
            moved = [(text, colour, (x + at[0], y + at[1])) for text, colour, at in some]
            _write(image, moved, self._bold, np.array([x, y, x + width, y + height]))
        pen, line, (left, high, right, low) = ImageDraw.Draw(image), self.line, self._curves
        at = left + (right - left) * min(t / self._end, 1.0)
        pen.line(
            (at, high - 0.3 * line, at, low + 0.3 * line), palette.INK, max(2, round(line / 10))
        )
        below = (left + right) / 2, low + 0.85 * line
        pen.text(below, f"t = {t:.2f} s", palette.INK, self._bold, "mm")
        return np.asarray(image)


def _write(
    image: Image.Image, words: list[_Word], font: ImageFont.FreeTypeFont, box: Array
) -> None:
    """Write words with a halo inside a box (4,): left, top, right, bottom; none over another.

    A word goes above those in its way; where the box has no room there, beside them, inwards.
    """
    pen, taken, halo = ImageDraw.Draw(image), list[Array](), round(font.size / 7)
    for text, colour, at in words:
        own = np.array(pen.textbbox(at, text, font, "mm", align="center", stroke_width=halo))
        into = np.maximum(box[:2] - own[:2], 0) - np.maximum(own[2:] - box[2:], 0)
        inwards = 1 if own[0] + own[2] < box[0] + box[2] else -1
        moved = into.copy()
        for other in sorted(taken, key=lambda each: -each[3]):  # from the lowest up
            if _cover(own + np.tile(moved, 2), other):
                moved[1] = other[1] - own[3] - halo
        if own[1] + moved[1] < box[1]:
            moved = into.copy()
            for other in sorted(taken, key=lambda each: inwards * each[0]):
                if _cover(own + np.tile(moved, 2), other):
                    ends = (other[2] - own[0], other[0] - own[2])
                    moved[0] = ends[inwards < 0] + inwards * round(font.size)
        taken.append(own + np.tile(moved, 2))
        pen.text(
            tuple(at + moved), text, colour, font, "mm", align="center",
            stroke_width=halo, stroke_fill=_PAPER,
        )  # fmt: skip


def _cover(one: Array, other: Array) -> bool:
    """Return whether two boxes (4,) have pixels in common."""
    return bool(np.all(one[:2] < other[2:]) and np.all(other[:2] < one[2:]))


def _metres(length: float) -> str:
    """Write a length [m] as text: 0.123 m, 4.2 × 10⁻¹² m, 10⁻⁹ m."""
    if length == 0 or length >= 1e-3:
        return f"{length:.3g} m" if length < 1000 else f"{length:.0f} m"
    digits, exponent = f"{length:.1e}".split("e")
    power = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)} m"
    return power if digits == "1.0" else f"{digits} × {power}"


_MANY = 100  # frames; for fewer, starting processes takes longer than it saves
_SMOOTH = 0.4  # s of the film, over which the camera averages the ball's motion
_STEP = 0.02  # s, of a path at most: its corners are not seen, however few the frames
_BLUR_FROM, _BLUR_TO = 0.25, 0.75  # rad a frame: beyond it a rotor's marks would mislead
# Room on each side of a ball in radii, elevation in degrees.
_CAMERAS = {"follow": (2.3, 24.0), "above": (2.9, 80.0), "whole": (1.7, 40.0)}
_ASIDE = 0.6  # rad from straight ahead, from where the camera sees a ball come
_OTHER = 0.4  # opacity of the other balls' paths
# Arrows: colour, length in radii of the largest.
_ARROWS = {"M": ("#93387A", 1.8), "ω": ("#00734F", 1.4), "contact force": ("#22262B", 1.0)}
_SHORTEST_ARROW = 1e-3  # an arrow shorter than that part of the largest is left out
_ROOM = 1.3  # the camera has so many times the room with arrows
_SAME = 0.02  # radii within which one ball hides another
_CLEAR = 1.06  # from the centre: outside the shell


@dataclass(frozen=True)
class Film:
    """The options of a film.

    fps     frames a second
    size    (height, width) in pixels, even
    slow    how many times slower than life
    camera  "follow" a ball, look from "above", or stand still and see the "whole" paths of all
    ghost   one picture with the last ball as a ghost, in place of a picture each
    arrows  draw M, ω and the contact force

    Raises InputError, with the limit, for a value that no film can have.
    """

    fps: int = 30
    size: tuple[int, int] = (720, 1280)
    slow: float = 1.0
    camera: Literal["follow", "above", "whole"] = "follow"
    ghost: bool = False
    arrows: bool = False

    def __post_init__(self) -> None:
        check_positive("slow", self.slow, "")
        if not (isinstance(self.fps, int) and 1 <= self.fps <= 240):
            raise InputError(f"fps must be a whole number from 1 to 240, not {self.fps}")
        if any(side % 2 or not 120 <= side <= 4320 for side in self.size):
            height, width = self.size
            raise InputError(
                f"a film's width and height must be even, and 120 to 4320 pixels, not "
                f"{width}x{height}"
            )
        if self.camera not in _CAMERAS:
            raise InputError(f"camera must be one of {', '.join(_CAMERAS)}, not {self.camera!r}")

    @property
    def together(self) -> bool:
        """Whether all balls are in one picture."""
        return self.ghost or self.camera == "whole"

    def times(self, motions: Sequence[Motion]) -> Array:
        """Return the times (m,) of the frames [s], up to the end of the shortest motion.

        They are two at least: a motion shorter than a frame is shown at its start and its end.
        Raises InputError if the motions are not sampled at the same times.
        """
        shared = min(len(each.times) for each in motions)
        if shared < 2 or np.ptp([each.times[:shared] for each in motions], axis=0).any():
            raise InputError(
                "a film needs motions sampled at the same times, of two samples at least, not "
                + " and ".join(str(len(each.times)) for each in motions)
            )
        rate, end = self.fps * self.slow, float(motions[0].times[shared - 1])
        # An end that is a whole number of frames must not be lost to rounding.
        count = np.floor(end * rate * (1 + 1e-12)) + 1
        # A path, and the axis of time below it, need two points.
        return np.arange(count) / rate if count > 1 else np.array([0.0, end])


def frames(motions: Sequence[Motion], film: Film | None = None) -> Iterator[Pixels]:
    """Yield the pictures (height, width, 3) of a film.

    motions: of one scene; the distances of the others from the last are shown. Raises InputError if
    the times differ, or if there is no off-screen GL.
    """
    # No generator itself, so that what cannot be drawn is refused here, not at the first picture.
    return _painted(_Painter(motions, film or Film()))


def _painted(painter: "_Painter") -> Iterator[Pixels]:
    with closing(painter):
        yield from in_processes(painter, range(len(painter.times)), _MANY)


class _Painter:
    """Draws the frames of a film by number, with an OpenGL of its own in each process.

    A track has `finer` samples for each frame, so that its path is smooth.
    """

    def __init__(self, motions: Sequence[Motion], film: Film) -> None:
        self.film, self.times, backend = film, film.times(motions), gl.find_backend()
        scene = motions[-1].scene
        if backend is None:
            raise InputError(gl.advice())
        self.backend = backend
        self.finer = int(np.ceil(self.times[1] / _STEP))
        fine = np.linspace(0.0, self.times[-1], (len(self.times) - 1) * self.finer + 1)
        self.tracks = [track_of(motion).sampled_at(fine) for motion in motions]
        points = np.array([track.points[:: self.finer] for track in self.tracks])
        self.apart = np.linalg.norm(points[:-1] - points[-1], axis=2) * scene.ball.radius
        self.looks = looks_of(scene.ball)
        corners = [each.triangles for shapes in self.looks.values() for each in shapes]
        # How far a ball reaches, in radii: a head stands above its shell.
        self.reach = max(float(np.linalg.norm(each, axis=-1).max()) for each in corners)
        self.lengths = _lengths(self.tracks[-1], scene.momentum_scale) if film.arrows else {}
        note = "; ".join(_notes(motions, film, self.looks))
        self.sheet = _Sheet(motions, film, note, self.times, self.apart)
        every, (height, width) = list(range(len(motions))), self.sheet.pane
        self.panes = [every] if film.together else [[i] for i in every]
        self.cameras = [_cameras(film, points[pane], width / height) for pane in self.panes]

    def __call__(self, k: int) -> Pixels:
        # An OpenGL cannot be sent to another process: each makes its own with its first picture.
        if "_stage" not in vars(self):
            self._drawn(0)  # the first picture of a GL may be off by a last bit
        return self._drawn(k)

    def _drawn(self, k: int) -> Pixels:
        last = k * self.finer
        then = [track.sampled[last : last + 1] for track in self.tracks]
        stands = [track.stands(each) for track, each in zip(self.tracks, then, strict=True)]
        self._stage.place(stands, [self._blurred(i, each) for i, each in enumerate(then)])
        pictures, words = [], []
        for pane, cameras in zip(self.panes, self.cameras, strict=True):
            balls, camera = range(len(then)), cameras[k]
            opacities = [float(i in pane) for i in balls]
            if self.film.together and len(then) > 1:
                opacities[-1] = GHOST
            trails = [1.0 if i in pane else _OTHER for i in balls]
            first = pane[0]
            arrows = _arrows(then[first], self.lengths, self.tracks[first].robot.radius)
            drawn = list(arrows.values())
            pictures.append(self._stage.draw(camera, opacities, trails, last, drawn))
            seen = {
                i: camera.seen(stands[i]["shell"][1][0], self.sheet.pane) for i in reversed(pane)
            }
            words.append([*self._named(k, seen), *self._pointed(seen[first], arrows, camera)])
        return self.sheet.frame(pictures, words, float(self.times[k]))

    def _named(self, k: int, seen: dict[int, Seen]) -> Iterator[_Word]:
        """Yield the name of each ball of a picture, and how far it is off.

        It stands above the ball; below it where arrows are above. The other way round for the
        equations' ball, as another one may be at its place, which is then said.
        """
        for i, (x, y, radius) in seen.items():
            if exact := i == len(self.apart):
                hidden = (
                    len(seen) > 1 and self.apart[:, k].min() < _SAME * self.tracks[i].robot.radius
                )
                off = "\nat the same place" if hidden else ""
            else:
                off = f"\n{_metres(self.apart[i, k])} off"
            below = bool(self.lengths) != (exact and len(seen) > 1)
            away = (self.reach * radius + 1.1 * self.sheet.line) * (1 if below else -1)
            yield self.sheet.names[i] + off, self.sheet.colours[i], (x, y + away)

    def _pointed(self, ball: Seen, arrows: dict[str, Arrow], camera: Camera) -> Iterator[_Word]:
        """Yield the name of each arrow at its head, but outside of the ball's outline."""
        x, y, radius = ball
        for name, (_, head, colour) in arrows.items():
            u, v, _ = camera.seen(head, self.sheet.pane)
            out = float(np.hypot(u - x, v - y)) or 1.0
            far = max(out, radius) / out
            # Half of the word's own size farther.
            room = np.array([0.4 + 0.27 * len(name), 0.8]) * self.sheet.line / out
            yield name, colour, (x + (u - x) * (far + room[0]), y + (v - y) * (far + room[1]))

    def _blurred(self, i: int, then: Moments) -> dict[str, float]:
        turned = np.abs(then.hinge_rates[0]) / (self.film.fps * self.film.slow)
        fast = np.clip((turned - _BLUR_FROM) / (_BLUR_TO - _BLUR_FROM), 0, 1).tolist()
        return dict(zip(self.tracks[i].names[1:], fast, strict=True))

    @cached_property
    def _stage(self) -> Stage:
        points = [track.points for track in self.tracks]
        far = max(each.distance for cameras in self.cameras for each in cameras)
        size, colours = self.sheet.pane, self.sheet.colours
        return Stage(size, self.looks, colours, points, far, self.backend)

    def close(self) -> None:
        """Free the OpenGL of this process."""
        if "_stage" in vars(self):
            self._stage.close()


def _notes(motions: Sequence[Motion], film: Film, looks: Looks) -> Iterator[str]:
    """Yield the engines' versions, and what a film shows otherwise than it is."""
    yield from dict.fromkeys(f"{each.engine.name} {each.engine.version}" for each in motions[:-1])
    if film.slow != 1:
        slow, way = (film.slow, "slower") if film.slow > 1 else (1 / film.slow, "faster")
        yield f"{slow:g} times {way} than life"
    marked = [any(each.material == MARKS for each in shapes) for shapes in looks.values()]
    rates = np.abs(motions[-1].hinge_rates[:, marked[1:]])
    if rates.size and rates.max() / (film.fps * film.slow) > _BLUR_FROM:
        yield "a rotor too fast for the film has no marks"


def _cameras(film: Film, paths: Array, aspect: float) -> list[Camera]:
    """Return the camera of each frame.

    paths: (n, m, 2), of each ball in the picture, in radii; aspect: width over height. One ball
    comes towards the camera; of several the way runs across the picture, where there is most room.
    """
    room, degrees = _CAMERAS[film.camera]
    room, up = room * (_ROOM if film.arrows else 1.0), np.radians(degrees)
    ahead = len(paths) == 1 and film.camera == "follow"
    azimuth = heading_of(paths[-1]) + (_ASIDE if ahead else -np.pi / 2)
    back = np.array([np.cos(azimuth), np.sin(azimuth)])
    axes = np.array([[-back[1], back[0]], back])
    low, high = (end(paths @ axes.T, axis=0) for end in (np.min, np.max))
    if film.camera == "whole":
        low[:], high[:] = low.min(axis=0), high.max(axis=0)
    across, deep = ((high - low) / 2).T
    # What is nearer to the camera is larger, so it stands farther away from a deep picture.
    far = deep * np.cos(up) + LENS * np.maximum(
        (across + room) / max(1.0, aspect), (deep * np.sin(up) + room) / max(1.0, 1 / aspect)
    )
    states = np.column_stack([(low + high) / 2 @ axes, far])
    states = gaussian_filter1d(states, _SMOOTH * film.fps, axis=0, mode="nearest")
    return [Camera(np.array([x, y, 0.85]), away, azimuth, up) for x, y, away in states.tolist()]


def _vectors(then: Moments) -> dict[str, Array]:
    """Return the vectors (n, 3) that arrows show, in world axes."""
    omega = np.einsum("nij,nj->ni", rotation_matrix(then.attitude), then.angular_velocity)
    return dict(zip(_ARROWS, (then.momentum, omega, then.contact_force), strict=True))


def _lengths(track: Track, scale: float) -> dict[str, float]:
    """Return the size of the vector that an arrow of one radius shows, for each kind of arrow.

    scale: kg m²/s, of M.
    """
    most = {
        name: float(np.linalg.norm(vectors, axis=1).max())
        for name, vectors in _vectors(track.sampled).items()
    }
    # A ball at M = 0 has rounding alone.
    most["M"] = max(most["M"], _SHORTEST_ARROW * scale)
    return {name: size / _ARROWS[name][1] for name, size in most.items()}


def _arrows(then: Moments, lengths: dict[str, float], radius: float) -> dict[str, Arrow]:
    """Return the arrows at one time; the contact force's begins where its line leaves the ball."""
    found = {}
    place = np.append(then.contact_point[0] / radius, 0.0)
    vectors = _vectors(then)
    for name, length in lengths.items():
        vector = vectors[name][0]
        size = float(np.linalg.norm(vector))
        if size > _SHORTEST_ARROW * length:
            along = vector / size
            begin = place + _CLEAR * along + Z
            if name == "contact force":
                begin = place + (2 * along[2] + _CLEAR - 1) * along
            found[name] = (begin, begin + vector / length, _ARROWS[name][0])
    return found


# By the file's suffix: the codec, its rate factor, and ffmpeg's own options. The bytes depend on
# the number of threads, so that is the same on any machine. The flag bitexact leaves out WebM's
# random mark.
_FORMATS: dict[str, tuple[str, int | None, str]] = {
    ".mp4": ("h264", 20, "-preset veryfast -threads 4"),
    ".webm": ("vp9", 32, "-deadline realtime -cpu-used 7 -row-mt 1 -threads 4 -fflags +bitexact"),
    # A palette for each frame: a common one would make ffmpeg hold all frames until the last.
    ".gif": (
        "gif",
        None,
        "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=bayer"
        " -loop 0",
    ),
}


def film(
    path: str | Path,
    motions: Motion | Sequence[Motion],
    *,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Path:
    """Write a video of one motion, or of several side by side.

    The last of several motions is the one from which the distances of the others are shown, such as
    the motion by the equations. The video ends with the shortest motion. An existing file is
    replaced once the new one is complete.

    Parameters
    ----------
    path : str or Path
        The file, whose suffix .mp4, .webm or .gif gives the format. Its folder must exist.
    motions : Motion or sequence of Motion
        The motions of one scene, sampled at the same times.
    progress : callable, optional
        Called with the fraction that is done, from 0 to 1.
    **options
        `fps`, frames a second, 30 by default. `size`, the height and the width in pixels. `slow`,
        how many times slower than life. `camera`, which is "follow", "above" or "whole". `ghost`,
        True for one picture with the last ball as a ghost. `arrows`, True to draw M, ω and the
        contact force.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the times of the motions differ, an option has a value that no film can have, the path
        cannot be written, or there is no off-screen OpenGL.

    Examples
    --------
    >>> import robotball as rb
    >>> theory = rb.integrate("fig12", 0.2)
    >>> motion = rb.simulate("fig12", theory.times, settings="naive")
    >>> print(rb.film("fig12.gif", [motion, theory], fps=10, size=(120, 240)))
    fig12.gif
    """
    # Their import takes longer than that of all else, which each process that draws would wait for.
    import imageio_ffmpeg
    import mediapy

    path, how = as_path("a video", path), Film(**options)
    motions = [motions] if isinstance(motions, Motion) else motions
    if path.suffix not in _FORMATS or not path.parent.is_dir():
        kinds = ", ".join(_FORMATS)
        raise InputError(f"a video must be a file ({kinds}) in a folder that exists, not {path}")
    codec, rate, encoding = _FORMATS[path.suffix]
    # Before the file is opened: what cannot be drawn must not leave one.
    pictures, number = frames(motions, how), len(how.times(motions))
    # mediapy looks for an ffmpeg on the PATH; imageio-ffmpeg brings one.
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with (
        replacing(path) as unfinished,
        _refused_by_the_encoder(path),
        mediapy.VideoWriter(
            unfinished, how.size, codec=codec, fps=how.fps, crf=rate, ffmpeg_args=encoding
        ) as video,
    ):
        for i, picture in enumerate(pictures, start=1):
            video.add_image(picture)
            if progress is not None:
                progress(i / number)
    return path


@contextmanager
def _refused_by_the_encoder(path: Path) -> Iterator[None]:
    """Turn mediapy's error, where the encoder ends before the film, into an InputError."""
    try:
        yield
    except RuntimeError as error:
        stopped = isinstance(error.__context__, KeyboardInterrupt)  # Ctrl-C ends the encoder, too
        if stopped or not str(error).startswith("Error writing"):
            raise
        why = (str(error).splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder says {why!r}") from None
