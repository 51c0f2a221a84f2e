"""Draw two motions frame by frame: two balls under one camera, and the error below them.

Each ball has its engine's colour. A sheet has the title, the names, the time, and the distance of
the contact points with a moving cursor; all that does not change is drawn once. Frames are encoded
one by one, so that memory does not grow with a film's length.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from robotball.errors import InputError, check_positive
from robotball.files.replacing import replacing
from robotball.film import gl
from robotball.film import looks as palette
from robotball.film.looks import GHOST, MARKS, Looks, looks_of
from robotball.film.stage import LENS, NEAR, Arrow, Camera, Pixels, Stage
from robotball.film.tracks import Moments, Track, heading_of, track_of
from robotball.motion import ContactMotion, Motion
from robotball.processes import in_processes
from robotball.rotations import Array, Z, rotation_matrix

_FONTS = Path(matplotlib.get_data_path(), "fonts", "ttf")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PAPER = "#FFFFFF"
_LINES = 30  # of text in the picture's height
_HEADER, _FOOTER = 2.7, 6.0  # heights in lines
_LEAST_DISTANCE = 1e-17  # m; smaller ones are drawn there, as a logarithm has no zero
_FINE = 3  # the curve is drawn so many times larger, as Pillow does not smooth lines


class _Sheet:
    """The frame around the pictures: what is fixed is drawn once, the rest in each frame.

    motions: left and right, or the second as a ghost; times (m,) [s] and apart (m,) [m]: the
    error's curve. Its `pane` is the (height, width) in pixels of one picture.
    """

    def __init__(
        self, motions: Sequence[Motion], film: "Film", looks: Looks, times: Array, apart: Array
    ) -> None:
        (height, width), panes = film.size, 1 if film.ghost else 2
        self._line = height / _LINES
        self._end = float(times[-1])
        self.top = round(_HEADER * self._line)
        self.bottom = height - round(_FOOTER * self._line)
        self.pane = (self.bottom - self.top, width // panes)
        self._edges = [i * width // panes for i in range(1, panes)]
        image = Image.new("RGB", (width, height), _PAPER)
        pen = ImageDraw.Draw(image)
        self._bold = ImageFont.truetype(str(_FONTS / "DejaVuSans-Bold.ttf"), 0.72 * self._line)
        self._plain = ImageFont.truetype(str(_FONTS / "DejaVuSans.ttf"), 0.66 * self._line)
        line, edge = self._line, 0.6 * self._line
        title = " ".join(motions[1].scene.title.split())
        pen.text((edge, 0.75 * line), title, palette.INK, self._bold, "lm")
        for motion, name, at in zip(motions, _names(motions, film), (0.25, 0.75), strict=True):
            pen.text((at * width, 1.95 * line), name, motion.engine.colour, self._bold, "mm")
        arrows = {name: self._bold.getlength(name) + line for name in _ARROWS if film.arrows}
        begin = (width - sum(arrows.values()) + line) / 2
        for name, length in arrows.items():
            pen.text((begin, 1.95 * line), name, _ARROWS[name][0], self._bold, "lm")
            begin += length
        # The curve has room for its numbers on the left, and for the value on the right.
        self._box = (5.6 * line, self.bottom + 1.8 * line, width - 8.6 * line, height - 1.6 * line)
        left, _, right, low = self._box
        note, below = "; ".join(_notes(motions[1], film, looks)), self.bottom + 0.8 * line
        pen.text((edge, below), "contact points apart", palette.INK, self._plain, "lm")
        pen.text((width - edge, below), note, palette.INK, self._plain, "rm")
        self._scale(apart)
        for value in (self._least, self._most):
            y = float(self._height(np.array([value]))[0])
            pen.line((left, y, right, y), palette.FAINT, 1)
            pen.text((left - 0.3 * line, y), _metres(value), palette.INK, self._plain, "rm")
        for x, t in ((left, 0.0), (right, self._end)):
            pen.text((x, low + 0.75 * line), f"{t:g} s", palette.INK, self._plain, "mm")
        self._curve(image, times, apart)
        self._still = np.asarray(image)

    def frame(self, pictures: Pixels, t: float, apart: float) -> Pixels:
        """Return the frame (height, width, 3) at t [s] with the pictures in it."""
        whole = self._still.copy()
        whole[self.top : self.bottom] = pictures
        for edge in self._edges:
            whole[self.top : self.bottom, edge - 1 : edge + 1] = 0xFF
        width = whole.shape[1]
        line, (left, high, right, low) = self._line, self._box
        self._put(whole, f"t = {t:.2f} s", width - 0.6 * line, 0.75 * line)
        x = left + (right - left) * min(t / self._end, 1.0)
        half = max(1, round(line / 20))
        column = slice(round(x) - half, round(x) + half)
        whole[round(high - 0.3 * line) : round(low + 0.3 * line), column] = 0x22
        self._put(whole, _metres(apart), width - 0.6 * line, (high + low) / 2)
        return whole

    def _put(self, whole: Pixels, text: str, right: float, middle: float) -> None:
        line = self._line
        x, y = int(right - 8 * line), int(middle - 0.7 * line)
        # Pillow draws on a copy, so it is given no more than the text needs.
        patch = Image.fromarray(whole[y : y + int(1.4 * line), x : round(right)])
        at = (patch.width - 1, middle - y)
        ImageDraw.Draw(patch).text(at, text, palette.INK, self._bold, "rm")
        whole[y : y + patch.height, x : x + patch.width] = np.asarray(patch)

    def _scale(self, apart: Array) -> None:
        """Choose decades for an error that spans a factor of 100, else a linear scale from 0.

        The tenth percentile stands for the least: the first errors are often rounding alone.
        """
        positive = apart[apart > _LEAST_DISTANCE]
        self._log = len(positive) > 0 and positive.max() > 100 * np.percentile(positive, 10)
        self._least, self._most = 0.0, float(apart.max()) or 1.0
        if self._log:
            self._least = 10.0 ** np.floor(np.log10(np.percentile(positive, 10)))
            self._most = 10.0 ** np.ceil(np.log10(positive.max()))

    def _height(self, apart: Array) -> Array:
        _, high, _, low = self._box
        if self._log:
            ends = np.log([self._least, self._most])
            part = (np.log(np.maximum(apart, _LEAST_DISTANCE)) - ends[0]) / (ends[1] - ends[0])
        else:
            part = apart / self._most
        return low - np.clip(part, -0.08, 1.0) * (low - high)

    def _curve(self, image: Image.Image, times: Array, apart: Array) -> None:
        left, high, right, low = self._box
        margin = self._line / 4
        corner = (int(left - margin), int(high - margin))
        area = image.crop((*corner, int(right + margin), int(low + margin)))
        large = area.resize((area.width * _FINE, area.height * _FINE), Image.Resampling.NEAREST)
        x = left + (right - left) * times / self._end
        points = (np.column_stack([x, self._height(apart)]) - corner) * _FINE
        corners, wide = list(map(tuple, points.tolist())), max(3, round(self._line / 4))
        ImageDraw.Draw(large).line(corners, palette.INK, wide, "curve")
        image.paste(large.resize(area.size, Image.Resampling.BOX), corner)


def _metres(length: float) -> str:
    """Write a length [m] as text: 0.123 m, 4.2 × 10⁻¹² m, 10⁻⁹ m."""
    if length == 0 or length >= 1e-3:
        return f"{length:.3g} m" if length < 1000 else f"{length:.0f} m"
    digits, exponent = f"{length:.1e}".split("e")
    power = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)} m"
    return power if digits == "1.0" else f"{digits} × {power}"


_Progress = Callable[[float], None]

_MANY = 100  # frames; for fewer, starting processes takes longer than it saves
_SMOOTH = 0.4  # s of the film, over which the camera averages the ball's motion
_BLUR_FROM, _BLUR_TO = 0.25, 0.75  # rad a frame: beyond it a rotor's marks would mislead
_CAMERAS = {"follow": (NEAR, 24.0), "above": (9.0, 80.0), "whole": (9.0, 40.0)}  # radii, degrees
_OTHER = 0.4  # opacity of the other ball's path
# Arrows: colour, length in radii of the largest.
_ARROWS = {"M": ("#CC79A7", 1.5), "ω": ("#009E73", 1.2), "contact force": ("#22262B", 0.9)}
_LEAST = 1e-3  # an arrow shorter than that part of the largest is left out
_ROOM = 1.3  # the camera's distance is so many times larger with arrows
_CLEAR = 1.06  # from the centre: outside the shell


@dataclass(frozen=True)
class Film:
    """The options of a film.

    fps     frames a second
    size    (height, width) in pixels, even
    slow    how many times slower than life
    camera  "follow" a ball, look from "above", or stand still and see the "whole" path
    ghost   one picture with the second ball as a ghost, in place of two pictures
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

    def times(self, motion: Motion, theory: Motion) -> Array:
        """Return the times (m,) of the frames [s], up to the end of the shorter motion.

        They are two at least: a motion shorter than a frame is shown at its start and its end.
        Raises InputError if the motions are not sampled at the same times.
        """
        shared = min(len(motion.times), len(theory.times))
        if shared < 2 or not np.array_equal(motion.times[:shared], theory.times[:shared]):
            raise InputError(
                "a film needs two motions sampled at the same times, of two samples at least, not "
                f"{len(motion.times)} and {len(theory.times)}"
            )
        rate, end = self.fps * self.slow, float(motion.times[shared - 1])
        # An end that is a whole number of frames must not be lost to rounding.
        count = np.floor(end * rate * (1 + 1e-12)) + 1
        # A path, and the axis of time below it, need two points.
        return np.arange(count) / rate if count > 1 else np.array([0.0, end])


def frames(motion: Motion, theory: Motion, film: Film | None = None) -> Iterator[Pixels]:
    """Yield the pictures (height, width, 3) of a film.

    motion: an engine's, on the left; theory: the equations' motion of the same scene. Raises
    InputError if the times differ, or if there is no off-screen GL.
    """
    film = film or Film()
    times, backend = film.times(motion, theory), gl.find_backend()
    if backend is None:
        raise InputError(gl.advice())
    motions = (motion, theory)
    tracks = (track_of(motion).sampled_at(times), track_of(theory).sampled_at(times))
    apart = np.linalg.norm(tracks[0].points - tracks[1].points, axis=1) * theory.scene.ball.radius
    looks = looks_of(theory.scene.ball)
    # No generator itself, so that what cannot be drawn is refused here, not at the first picture.
    return _painted(
        _Painter(
            film, times, tracks, looks,
            colours=(motion.engine.colour, theory.engine.colour),
            sheet=_Sheet(motions, film, looks, times, apart),
            lengths=_lengths(tracks[1], theory) if film.arrows else {},
            backend=backend,
        )
    )  # fmt: skip


def _painted(painter: "_Painter") -> Iterator[Pixels]:
    with closing(painter):
        yield from in_processes(painter, range(len(painter.times)), _MANY)


@dataclass(frozen=True)
class _Painter:
    """Draws the frames of a film by number, with an OpenGL of its own in each process."""

    film: Film
    times: Array
    tracks: tuple[Track, Track]
    looks: Looks
    colours: tuple[str, str]
    sheet: _Sheet
    lengths: dict[str, float]
    backend: str

    def __call__(self, k: int) -> Pixels:
        # An OpenGL cannot be sent to another process: each makes its own with its first picture.
        if "_stage" not in vars(self):
            self._drawn(0)  # the first picture of a GL may be off by a last bit
        return self._drawn(k)

    def _drawn(self, k: int) -> Pixels:
        then = [track.sample(k) for track in self.tracks]
        stands = [track.stands(each) for track, each in zip(self.tracks, then, strict=True)]
        self._stage.place(stands, [self._blurred(i, each) for i, each in enumerate(then)])
        pictures = []
        for pane, camera in zip(self._panes, self._cameras, strict=True):
            opacities = [float(i in pane) for i in (0, 1)]
            if self.film.ghost:
                opacities[1] = GHOST
            trails = [1.0 if i in pane else _OTHER for i in (0, 1)]
            first = pane[0]
            arrows = _arrows(then[first], self.lengths, self.tracks[first].robot.radius)
            pictures.append(self._stage.draw(camera(k), opacities, trails, k, arrows))
        off = np.linalg.norm(then[0].contact_point - then[1].contact_point)
        return self.sheet.frame(np.hstack(pictures), float(self.times[k]), float(off))

    def _blurred(self, i: int, then: Moments) -> dict[str, float]:
        turned = np.abs(then.hinge_rates[0]) / (self.film.fps * self.film.slow)
        fast = np.clip((turned - _BLUR_FROM) / (_BLUR_TO - _BLUR_FROM), 0, 1).tolist()
        return dict(zip(self.tracks[i].names[1:], fast, strict=True))

    @property
    def _panes(self) -> list[list[int]]:
        return [[0, 1]] if self.film.ghost else [[0], [1]]

    @cached_property
    def _cameras(self) -> list[Callable[[int], Camera]]:
        height, width = self.sheet.pane
        return [
            _camera(self.film, [self.tracks[i].points for i in pane], width / height)
            for pane in self._panes
        ]

    @cached_property
    def _stage(self) -> Stage:
        distance, points = self._cameras[0](0).distance, [track.points for track in self.tracks]
        return Stage(self.sheet.pane, self.looks, self.colours, points, distance, self.backend)

    def close(self) -> None:
        """Free the OpenGL of this process."""
        if "_stage" in vars(self):
            self._stage.close()


def _names(motions: Sequence[Motion], film: Film) -> Iterator[str]:
    """Yield the headings of both motions."""
    for motion, ghost in zip(motions, (False, film.ghost), strict=True):
        name = motion.engine.name
        if isinstance(motion, ContactMotion):
            name += f" {motion.engine.version}, {motion.report.settings.name}"
        elif motion is not motions[1]:
            name += f" {motion.engine.version}"
        yield f"{name} (ghost)" if ghost else name


def _notes(theory: Motion, film: Film, looks: Looks) -> Iterator[str]:
    """Yield what a film shows otherwise than it is."""
    if film.slow != 1:
        slow, way = (film.slow, "slower") if film.slow > 1 else (1 / film.slow, "faster")
        yield f"{slow:g} times {way} than life"
    marked = [any(each.material == MARKS for each in shapes) for shapes in looks.values()]
    rates = np.abs(theory.hinge_rates[:, marked[1:]])
    if rates.size and rates.max() / (film.fps * film.slow) > _BLUR_FROM:
        yield "a rotor too fast for the film has no marks"


def _camera(film: Film, points: Sequence[Array], aspect: float) -> Callable[[int], Camera]:
    """Return the camera as a function of the frame's number.

    points: the path (m, 2) of each ball in the picture, in radii; aspect: width over height.
    """
    distance, elevation = _CAMERAS[film.camera]
    room = _ROOM if film.arrows else 1.0
    between = np.linalg.norm(points[0] - points[-1], axis=1)
    azimuth = heading_of(points[-1]) + (0.6 if film.camera == "follow" else 0.0)
    up = np.radians(elevation)
    if film.camera == "whole":
        every = np.concatenate(points)
        low, high = every.min(axis=0), every.max(axis=0)
        half = float(np.linalg.norm(high - low)) / 2 + 1.5 * room
        middle, away = np.array([*(low + high) / 2, 0.5]), LENS * half / min(1.0, aspect)
        return lambda k: Camera(middle, away, azimuth, up)
    middle = np.mean(points, axis=0)
    smooth = gaussian_filter1d(middle, _SMOOTH * film.fps, axis=0, mode="nearest")
    # Farther away where a ghost leaves the ball by more than the picture shows.
    far = room * distance * np.maximum(1.0, (between + 2.5) / 4.0) / min(1.0, 1.25 * aspect)
    far = gaussian_filter1d(far, _SMOOTH * film.fps, mode="nearest")
    return lambda k: Camera(np.array([*smooth[k], 0.85]), float(far[k]), azimuth, up)


def _vectors(then: Moments) -> dict[str, Array]:
    """Return the vectors (n, 3) that arrows show, in world axes."""
    omega = np.einsum("nij,nj->ni", rotation_matrix(then.attitude), then.angular_velocity)
    return dict(zip(_ARROWS, (then.momentum, omega, then.contact_force), strict=True))


def _lengths(track: Track, theory: Motion) -> dict[str, float]:
    """Return the size of the vector that an arrow of one radius shows, for each kind of arrow."""
    most = {
        name: float(np.linalg.norm(vectors, axis=1).max())
        for name, vectors in _vectors(track.sampled).items()
    }
    # A ball at M = 0 has rounding alone.
    most["M"] = max(most["M"], _LEAST * theory.scene.momentum_scale)
    return {name: size / _ARROWS[name][1] for name, size in most.items()}


def _arrows(then: Moments, lengths: dict[str, float], radius: float) -> list[Arrow]:
    """Return the arrows at one time; the contact force's begins where its line leaves the ball."""
    found = []
    place = np.append(then.contact_point[0] / radius, 0.0)
    vectors = _vectors(then)
    for name, length in lengths.items():
        vector = vectors[name][0]
        size = float(np.linalg.norm(vector))
        if size > _LEAST * length:
            along = vector / size
            begin = place + _CLEAR * along + Z
            if name == "contact force":
                begin = place + (2 * along[2] + _CLEAR - 1) * along
            found.append((begin, begin + vector / length, _ARROWS[name][0]))
    return found


# By the file's suffix: the codec, its rate factor, and ffmpeg's own options.
_FORMATS: dict[str, tuple[str, int | None, str]] = {
    ".mp4": ("h264", 20, "-preset veryfast"),
    ".webm": ("vp9", 32, "-deadline realtime -cpu-used 7 -row-mt 1"),
    # A palette for each frame: a common one would make ffmpeg hold all frames until the last.
    ".gif": (
        "gif",
        None,
        "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=bayer"
        " -loop 0",
    ),
}


def write_video(
    path: Path | str,
    motion: Motion,
    theory: Motion,
    film: Film | None = None,
    *,
    progress: _Progress | None = None,
) -> None:
    """Write `frames` as mp4, webm or gif, by the suffix of the path.

    An existing file is replaced once the new one is complete. progress is called with the
    fraction that is done. Raises InputError as `frames` does, and for a path that has no such
    suffix or folder.
    """
    # Their import takes longer than that of all else, which each process that draws would wait for.
    import imageio_ffmpeg
    import mediapy

    path, film = Path(path), film or Film()
    if path.suffix not in _FORMATS or not path.parent.is_dir():
        kinds = ", ".join(_FORMATS)
        raise InputError(f"a video must be a file ({kinds}) in a folder that exists, not {path}")
    codec, rate, options = _FORMATS[path.suffix]
    # Before the file is opened: what cannot be drawn must not leave one.
    pictures, number = frames(motion, theory, film), len(film.times(motion, theory))
    # mediapy looks for an ffmpeg on the PATH; imageio-ffmpeg brings one.
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with (
        replacing(path) as unfinished,
        _refused_by_the_encoder(path),
        mediapy.VideoWriter(
            unfinished, film.size, codec=codec, fps=film.fps, crf=rate, ffmpeg_args=options
        ) as video,
    ):
        for i, picture in enumerate(pictures, start=1):
            video.add_image(picture)
            if progress is not None:
                progress(i / number)


@contextmanager
def _refused_by_the_encoder(path: Path) -> Iterator[None]:
    """Turn mediapy's error, where the encoder ends before the film, into an InputError."""
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("Error writing"):
            raise
        why = (str(error).splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder says {why!r}") from None
