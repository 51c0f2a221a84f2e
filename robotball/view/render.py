"""Draw films: one or more rolling balls, with their errors plotted below.

Each ball has its engine's colour, or a different colour if an engine appears several times. The
title, the time axis and the distances from the reference path are drawn once; only a cursor moves.
Film frames are encoded one by one, so memory use does not grow with the length of the film.
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

from robotball.errors import InputError, check_positive
from robotball.files import as_path
from robotball.files.replacing import replacing
from robotball.motion import Motion
from robotball.processes import in_processes
from robotball.robot import looks as palette
from robotball.robot.looks import GHOST, MARKS, Looks, looks_of
from robotball.rotations import Array
from robotball.view import gl
from robotball.view.stage import LENS, Camera, Pixels, Projection, Stage, smoothed
from robotball.view.tracks import (
    Moments,
    colours_of,
    heading_of,
    label_of,
    slip_parts,
    slips_of,
    track_of,
)

_FONTS = Path(matplotlib.get_data_path(), "fonts", "ttf")
_PAPER = "#FFFFFF"
_LINES, _COLUMNS = 26, 25  # height and width of a picture, in heights of a line of text
_HEADER, _FOOTER = 2.5, 7.4  # heights, in lines
_EDGE, _LEFT, _LOW, _HIGH = 0.6, 4.6, 1.5, 5.5  # margins of text and plot, in lines
_PLAIN = 0.68  # size of letters that are not bold, in lines
_TICKS = 6  # largest number of labelled decades of the plot
_DPI = 64  # a power of two, so that pixels convert to inches without rounding
_LEAST_DISTANCE = 1e-17  # m, lower limit of the logarithmic plot
_MANY = 100  # frames above which drawing in several processes is faster
_SMOOTH = 0.4  # s of the film, over which the camera averages the ball's motion
_STEP = 0.02  # s, largest step of a drawn path, fine enough to hide its corners
_BLUR_FROM, _BLUR_TO = 0.25, 0.75  # rad per film frame: a rotor's marks fade out, as they mislead
# Camera: (room on each side of a ball in radii, elevation in degrees).
_CAMERAS = {"follow": (2.3, 24.0), "above": (2.9, 80.0), "whole": (1.7, 40.0)}
_ASIDE = 0.6  # rad between the camera's position and the ball's heading
_OTHER = 0.4  # opacity of the other balls' paths
_SAME = 0.02  # radii, distance within which one ball hides another
# Codec, rate factor and ffmpeg options by file suffix. The result depends on the number of threads,
# so this number is the same on every machine. The flag bitexact omits WebM's random identifier.
_FORMATS: dict[str, tuple[str, int | None, str]] = {
    ".mp4": ("h264", 20, "-preset veryfast -threads 4"),
    ".webm": ("vp9", 32, "-deadline realtime -cpu-used 7 -row-mt 1 -threads 4 -fflags +bitexact"),
    # One palette per film frame: for a common palette, ffmpeg would buffer all film frames.
    ".gif": (
        "gif",
        None,
        "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=bayer"
        " -loop 0",
    ),
}
_Label = tuple[str, str, tuple[float, float]]  # text, colour, and pixel of its centre


class _Sheet:
    """The border around the pictures: fixed parts are drawn once, others for each film frame.

    motions: the last one is the reference. note: line below the title. times (m,) [s] and apart (n
    - 1, m) [m]: curves of the other motions. Attributes: `pane`, (height, width) of one picture
    [px]; `line`, height of a line of text [px].
    """

    def __init__(
        self, motions: Sequence[Motion], film: "Film", note: str, times: Array, apart: Array
    ) -> None:
        from matplotlib.figure import Figure  # late: drawing processes do not need it

        self.names, self.colours = names, colours = [*map(label_of, motions)], colours_of(motions)
        (height, width), panes = film.size, 1 if film.together else len(motions)
        self.line = line = min(height / _LINES, width / _COLUMNS)
        top = round(_HEADER * line)
        tall = height - top - round(_FOOTER * line)
        # Pictures are side by side, or stacked on a narrow screen.
        down, along = (tall // panes, 0) if tall > width else (0, width // panes)
        self.pane = (down or tall) - 2, (along or width) - 2
        self._corners = [(top + 1 + i * down, 1 + i * along) for i in range(panes)]
        self._bold, plain = (
            ImageFont.truetype(str(_FONTS / f"DejaVuSans{kind}.ttf"), size * line)
            for kind, size in (("-Bold", 0.76), ("", _PLAIN))
        )
        # The names stand right of the curves. A single motion has no curve.
        room = max(map(plain.getlength, names[:-1]), default=0.0) + 2 * _EDGE * line
        # Coordinates from the left and from the top, as in images.
        left, high = _LEFT * line, height - _HIGH * line
        right, low = width - room, height - _LOW * line
        self._curves, end = (left, high, right, low), float(times[-1])
        distances = apart if len(apart) else np.ones((1, len(times)))
        # The first errors are often only rounding.
        least = np.floor(np.log10(max(np.percentile(distances[:, 1:], 1), _LEAST_DISTANCE)))
        most = np.ceil(np.log10(max(distances.max(), _LEAST_DISTANCE)))
        most = max(least + 1, most)
        ends = 10.0 ** np.array([least, most])
        # At most every other decade, to leave room for the numbers.
        ticks = 10.0 ** np.arange(most, least - 1, -2 * np.ceil((most - least) / 2 / _TICKS))
        ticks = ticks[: len(apart) * len(ticks)]
        known = np.maximum(apart, ends[0])
        figure, points = Figure((width / _DPI, height / _DPI), _DPI), 72 / _DPI * line
        box = (left / width, 1 - low / height, (right - left) / width, (low - high) / height)
        axes = figure.add_axes(box, xlim=(0, end), yscale="log", ylim=ends, frame_on=False)
        axes.set_xticks((0, end), ("0 s", f"{end:g} s"))
        axes.set_yticks(ticks, [f"{tick:g} m" for tick in ticks.tolist()])
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
        labels = sorted(zip(names, colours, middles, strict=False), key=lambda label: -label[2][1])
        _write(image, labels, plain, np.array([0, 0, width, height]))
        self._still, self._end = np.asarray(image), end

    def frame(self, pictures: list[Pixels], labels: list[list[_Label]], t: float) -> Pixels:
        """Return the film frame (height, width, 3) at t [s] with pictures and their labels."""
        whole, (height, width) = self._still.copy(), self.pane
        for picture, (y, x) in zip(pictures, self._corners, strict=True):
            whole[y : y + height, x : x + width] = picture
        image = Image.fromarray(whole)
        for pane_labels, (y, x) in zip(labels, self._corners, strict=True):
            moved = [(text, colour, (x + at[0], y + at[1])) for text, colour, at in pane_labels]
            _write(image, moved, self._bold, np.array([x, y, x + width, y + height]))
        pen, line, (left, high, right, low) = ImageDraw.Draw(image), self.line, self._curves
        at = left + (right - left) * min(t / self._end, 1.0)
        ends = at, high - 0.3 * line, at, low + 0.3 * line
        pen.line(ends, palette.INK, max(2, round(line / 10)))
        below = (left + right) / 2, low + 0.85 * line
        pen.text(below, f"t = {t:.2f} s", palette.INK, self._bold, "mm")
        return np.asarray(image)


def _write(
    image: Image.Image, labels: list[_Label], font: ImageFont.FreeTypeFont, box: Array
) -> None:
    """Write labels with a halo inside a box: left, top, right, bottom. They do not overlap."""
    pen, taken, halo = ImageDraw.Draw(image), list[Array](), round(font.size / 7)
    outline: dict[str, Any] = {"align": "center", "stroke_width": halo}
    for text, colour, at in labels:
        extent = np.array(pen.textbbox(at, text, font, "mm", **outline))
        into = np.maximum(box[:2] - extent[:2], 0) - np.maximum(extent[2:] - box[2:], 0)
        inwards = 1 if extent[0] + extent[2] < box[0] + box[2] else -1
        moved = into.copy()
        for other in sorted(taken, key=lambda area: -area[3]):  # from the bottom up
            if _cover(extent + np.tile(moved, 2), other):
                moved[1] = other[1] - extent[3] - halo
        if extent[1] + moved[1] < box[1]:
            moved = into.copy()
            for other in sorted(taken, key=lambda area: inwards * area[0]):
                if _cover(extent + np.tile(moved, 2), other):
                    ends = (other[2] - extent[0], other[0] - extent[2])
                    moved[0] = ends[inwards < 0] + inwards * round(font.size)
        taken.append(extent + np.tile(moved, 2))
        pen.text(tuple(at + moved), text, colour, font, "mm", **outline, stroke_fill=_PAPER)


def _cover(one: Array, other: Array) -> bool:
    return bool(np.all(one[:2] < other[2:]) and np.all(other[:2] < one[2:]))


@dataclass(frozen=True)
class Film:
    """Options of a film. Raises InputError for an invalid value.

    Attributes
    ----------
    fps : frames per second
    size : (height, width) in pixels, even
    slow : how many times slower than real time
    camera : "follow" a ball, look from "above", or fixed with the "whole" path in view
    ghost : draw all balls in one picture, the last as a ghost, instead of one picture per ball
    note : a text below the title
    """

    fps: int = 30
    size: tuple[int, int] = (720, 1280)
    slow: float = 1.0
    camera: Literal["follow", "above", "whole"] = "follow"
    ghost: bool = False
    note: str = ""

    def __post_init__(self) -> None:
        check_positive("slow", self.slow, "")
        if not (isinstance(self.fps, int) and 1 <= self.fps <= 240):
            raise InputError(f"fps must be an integer from 1 to 240, not {self.fps}")
        if any(side % 2 or not 120 <= side <= 4320 for side in self.size):
            height, width = self.size
            raise InputError(
                f"a film's width and height must be even and from 120 to 4320 pixels, not "
                f"{width}x{height}"
            )
        if self.camera not in _CAMERAS:
            raise InputError(f"camera must be one of {', '.join(_CAMERAS)}, not {self.camera!r}")

    @property
    def together(self) -> bool:
        """Whether all balls are in one picture."""
        return self.ghost or self.camera == "whole"

    def times(self, motions: Sequence[Motion]) -> Array:
        """Return the times (m,) of the film frames [s], up to the end of the shortest motion.

        There are at least two times: if a motion is shorter than one film frame, its start and its
        end are shown. Raises InputError unless all motions have the same sample times.
        """
        shared = min(len(motion.times) for motion in motions)
        sampled = [motion.times[:shared] for motion in motions]
        if shared < 2 or np.ptp(sampled, axis=0).any():
            raise InputError(
                "a film needs motions with the same sample times, at least two; these have "
                + " and ".join(f"{len(motion.times)} samples" for motion in motions)
            )
        rate, end = self.fps * self.slow, float(motions[0].times[shared - 1])
        # Rounding must not lose an end that falls on the time of a film frame.
        count = np.floor(end * rate * (1 + 1e-12)) + 1
        # The path and the time axis need two points.
        return np.arange(count) / rate if count > 1 else np.array([0.0, end])


def frames(motions: Sequence[Motion], film: Film | None = None) -> Iterator[Pixels]:
    """Yield the pictures (height, width, 3) of a film.

    motions: one or more motions of one scene. If there are several, the last one is the reference.
    Raises InputError if their sample times differ, and if there is no off-screen GL.
    """
    # Not a generator itself, so that errors are raised here and not at the first picture.
    return _painted(_Painter(motions, film or Film()))


def _painted(painter: "_Painter") -> Iterator[Pixels]:
    with closing(painter):
        yield from in_processes(painter, range(len(painter.times)), _MANY)


class _Painter:
    """Draw film frames by number, with a separate OpenGL context in each process."""

    def __init__(self, motions: Sequence[Motion], film: Film) -> None:
        self.film, self.times, backend = film, film.times(motions), gl.find_backend()
        scene = motions[-1].scene
        # The angle of the floor in each film frame [rad].
        self.floor = scene.until(float(self.times[-1])).plane_turn.angle(self.times)
        if backend is None:
            raise InputError(gl.advice())
        self.backend = backend
        self.finer = int(np.ceil(self.times[1] / _STEP))
        fine = np.linspace(0.0, self.times[-1], (len(self.times) - 1) * self.finer + 1)
        self.tracks = [track_of(motion).sampled_at(fine) for motion in motions]
        points = np.array([track.points[:: self.finer] for track in self.tracks])
        self.apart = np.linalg.norm(points[:-1] - points[-1], axis=2) * scene.ball.radius
        self.looks = looks_of(scene.ball)
        corners = [shape.triangles for shapes in self.looks.values() for shape in shapes]
        # Radius that contains the ball and anything on it, such as a head above its shell.
        self.reach = max(float(np.linalg.norm(points, axis=-1).max()) for points in corners)
        self.slips = np.zeros(len(fine), bool)
        for part in slip_parts(slips_of(motions[-1]), fine):
            self.slips[part] = True
        note = "; ".join(_notes(motions, film, self.looks))
        self.sheet = _Sheet(motions, film, note, self.times, self.apart)
        all_balls, (height, width) = list(range(len(motions))), self.sheet.pane
        self.panes = [all_balls] if film.together else [[i] for i in all_balls]
        self.cameras = [_cameras(film, points[pane], width / height) for pane in self.panes]

    def __call__(self, k: int) -> Pixels:
        # A context cannot be sent to another process: each process makes one for its first film
        # frame.
        if "_stage" not in vars(self):
            self._drawn(0)  # the first picture of a context may differ in the last bit
        return self._drawn(k)

    def _drawn(self, k: int) -> Pixels:
        last = k * self.finer
        now = [track.sampled[last : last + 1] for track in self.tracks]
        stands = [track.stands(moment) for track, moment in zip(self.tracks, now, strict=True)]
        blurred = [self._blurred(i, moment) for i, moment in enumerate(now)]
        self._stage.place(stands, blurred, float(self.floor[k]))
        pictures, labels = [], []
        for pane, cameras in zip(self.panes, self.cameras, strict=True):
            balls, camera = range(len(now)), cameras[k]
            opacities = [float(i in pane) for i in balls]
            if self.film.together and len(now) > 1:
                opacities[-1] = GHOST
            trails = [1.0 if i in pane else _OTHER for i in balls]
            pictures.append(self._stage.draw(camera, opacities, trails, last))
            centres = [stand["shell"][1][0] for stand in stands]
            outlines = {i: camera.project(centres[i], self.sheet.pane) for i in reversed(pane)}
            labels.append([*self._ball_names(k, outlines)])
        return self.sheet.frame(pictures, labels, float(self.times[k]))

    def _ball_names(self, k: int, outlines: dict[int, Projection]) -> Iterator[_Label]:
        """Yield each ball's name and distance from the reference, whose name is below it."""
        for i, (x, y, radius) in outlines.items():
            if exact := i == len(self.apart):
                hidden = (
                    len(outlines) > 1
                    and self.apart[:, k].min() < _SAME * self.tracks[i].robot.radius
                )
                slips = ", slipping" if self.slips[k * self.finer] else ""
                off = slips + ("\nat the same place" if hidden else "")
            else:
                off = f"\n{self.apart[i, k]:.2g} m off"
            below = exact and len(outlines) > 1
            away = (self.reach * radius + 1.1 * self.sheet.line) * (1 if below else -1)
            yield self.sheet.names[i] + off, self.sheet.colours[i], (x, y + away)

    def _blurred(self, i: int, now: Moments) -> dict[str, float]:
        turned = np.abs(now.hinge_rates[0]) / (self.film.fps * self.film.slow)
        fast = np.clip((turned - _BLUR_FROM) / (_BLUR_TO - _BLUR_FROM), 0, 1).tolist()
        return dict(zip(self.tracks[i].names[1:], fast, strict=True))

    @cached_property
    def _stage(self) -> Stage:
        points = [track.points for track in self.tracks]
        far = max(camera.distance for cameras in self.cameras for camera in cameras)
        size, colours = self.sheet.pane, self.sheet.colours
        return Stage(size, self.looks, colours, points, far, self.backend, self.slips)

    def close(self) -> None:
        """Free the OpenGL context of this process."""
        if "_stage" in vars(self):
            self._stage.close()


def _notes(motions: Sequence[Motion], film: Film, looks: Looks) -> Iterator[str]:
    """Yield the engines' versions, the film's note, and how the film deviates from reality."""
    engines = (motion.engine for motion in motions[:-1])
    yield from dict.fromkeys(f"{engine.name} {engine.version}" for engine in engines)
    if film.note:
        yield film.note
    if slips_of(motions[-1]):
        yield "yellow path: the ball slips"
    if film.slow != 1:
        slow, change = (film.slow, "slower") if film.slow > 1 else (1 / film.slow, "faster")
        yield f"{slow:g} times {change} than real time"
    marked = [any(shape.material == MARKS for shape in shapes) for shapes in looks.values()]
    rates = np.abs(motions[-1].hinge_rates[:, marked[1:]])
    if rates.size and rates.max() / (film.fps * film.slow) > _BLUR_FROM:
        yield "marks are omitted on rotors that are too fast for the film"


def _cameras(film: Film, paths: Array, aspect: float) -> list[Camera]:
    """Return the camera of each film frame.

    paths (n, m, 2): the path of each ball in the picture, in radii. aspect: width divided by
    height. A single ball comes towards the camera. Several balls roll across the picture, because
    it has most room in this direction.
    """
    room, degrees = _CAMERAS[film.camera]
    up = np.radians(degrees)
    ahead = len(paths) == 1 and film.camera == "follow"
    azimuth = heading_of(paths[-1]) + (_ASIDE if ahead else -np.pi / 2)
    back = np.array([np.cos(azimuth), np.sin(azimuth)])
    axes = np.array([[-back[1], back[0]], back])
    low, high = (end(paths @ axes.T, axis=0) for end in (np.min, np.max))
    if film.camera == "whole":
        low[:], high[:] = low.min(axis=0), high.max(axis=0)
    across, deep = ((high - low) / 2).T
    # Nearer objects look larger, so the camera stays away by the depth of the scene too.
    far = deep * np.cos(up) + LENS * np.maximum(
        (across + room) / max(1.0, aspect), (deep * np.sin(up) + room) / max(1.0, 1 / aspect)
    )
    states = np.column_stack([(low + high) / 2 @ axes, far])
    states = smoothed(states, _SMOOTH * film.fps, "edge")
    return [Camera(np.array([x, y, 0.85]), away, azimuth, up) for x, y, away in states.tolist()]


def film(
    path: str | Path,
    motions: Motion | Sequence[Motion],
    *,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Path:
    """Write a video of one motion, or of several motions side by side.

    If there are several motions, the last one is the reference, such as the motion from the
    equations, and the video shows the distances of the other balls from it. The video ends with the
    shortest motion. An existing file is replaced when the new file is complete.

    Parameters
    ----------
    path : str or Path
        The file. Its suffix .mp4, .webm or .gif gives the format. Its folder must exist.
    motions : Motion or sequence of Motion
        The motions of one scene, sampled at the same times.
    progress : callable, optional
        Called with the fraction that is done, from 0 to 1.
    **options
        `fps`: pictures per second, 30 by default. `size`: the height and the width in pixels.
        `slow`: how many times slower than real time. `camera`: "follow", "above" or "whole".
        `ghost`: True for one picture with the last ball as a ghost. `note`: a text below the title.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the times of the motions differ, an option has an invalid value, the path cannot be
        written, or there is no off-screen OpenGL.

    Examples
    --------
    >>> import robotball as rb
    >>> theory = rb.integrate("fig12", 0.2)
    >>> motion = rb.simulate("fig12", theory.times, settings="naive")
    >>> print(rb.film("fig12.gif", [motion, theory], fps=10, size=(120, 240)))
    fig12.gif
    """
    # Late: these imports take longer than all others, and drawing processes do not need them.
    import imageio_ffmpeg
    import mediapy

    path, how = as_path("a video", path), Film(**options)
    motions = [motions] if isinstance(motions, Motion) else motions
    if path.suffix not in _FORMATS or not path.parent.is_dir():
        kinds = ", ".join(_FORMATS)
        raise InputError(f"{path}: a video must end with {kinds} and be in a folder that exists")
    codec, rate, encoding = _FORMATS[path.suffix]
    # Before the file is opened, so that an error leaves no file behind.
    pictures, number = frames(motions, how), len(how.times(motions))
    # mediapy searches the PATH for ffmpeg; imageio-ffmpeg provides one.
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with (
        replacing(path) as unfinished,
        _encoder_errors(path),
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
def _encoder_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        stopped = isinstance(error.__context__, KeyboardInterrupt)  # Ctrl-C ends the encoder, too
        if stopped or not str(error).startswith("Error writing"):
            raise
        why = (str(error).splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder reports {why!r}") from None
