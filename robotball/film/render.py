"""Two motions → frames → mp4: their balls side by side, each in its engine's colour."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import imageio_ffmpeg
import matplotlib
import mediapy
import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from robotball import palette
from robotball.errors import InputError
from robotball.files.replacing import replacing
from robotball.film import gl
from robotball.film.canvas import Canvas, Pixels
from robotball.film.picture import Strip, build_stage, pose, strip, track
from robotball.motion import Label, Motion
from robotball.processes import in_processes
from robotball.rotations import Array
from robotball.scene import Scene

Progress = Callable[[float], None]

FPS = 30
SIZE = (720, 1280)  # height and width
MANY = 100  # frames, worth more than one process
FONTS = Path(matplotlib.get_data_path(), "fonts", "ttf")
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# Lengths in radii of the ball.
LANES = 2.9  # between the balls while they agree
DISTANCE = 8.0  # of the camera; further where the balls part
ELEVATION = 30.0  # degrees: the horizon stays out of sight
SIGHT = 20.0  # the top of the picture, from the balls
BEHIND = 0.7  # the balls, of what the camera looks at: room for their paths
SMOOTH = 0.4  # s, over which the camera averages the balls' motion
SHADOW = 0.6  # radius
NAME_AHEAD = 1.1  # of the contact point


def frames(
    motion: Motion,
    theory: Motion,
    *,
    fps: int = FPS,
    size: tuple[int, int] = SIZE,
) -> Iterator[Pixels]:
    """Pictures (height, width, 3), one by one, at 0, 1/fps, … s while both motions last.

    motion: an engine's, on the left; theory: that of the equations of the same scene, sampled at
    the same times. size: (height, width) in pixels. Raises InputError where the times differ, or
    where there is no off-screen GL.
    """
    story = _tell(motion, theory, fps)
    if gl.find_backend() is None:
        raise InputError(gl.advice())
    return _draw(theory.scene, story, size)


def write_video(
    path: Path | str,
    motion: Motion,
    theory: Motion,
    *,
    fps: int = FPS,
    size: tuple[int, int] = SIZE,
    progress: Progress | None = None,
) -> None:
    """Writes `frames` to an mp4; a file that is there already is replaced once it is complete.

    Even height and width play everywhere. progress is called with the fraction that is done.
    Raises InputError as `frames` does, and where `path` can be no mp4 file.
    """
    path = Path(path)
    if path.suffix != ".mp4" or not path.parent.is_dir():
        raise InputError(f"a video must be an .mp4 file in a folder that exists, not {path}")
    pictures = frames(motion, theory, fps=fps, size=size)
    number = len(_frame_times(motion, theory, fps))
    mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    with (
        replacing(path) as unfinished,
        _refused_by_the_encoder(path),
        mediapy.VideoWriter(
            unfinished, size, fps=fps, crf=20, ffmpeg_args="-preset veryfast"
        ) as video,
    ):
        for i, picture in enumerate(pictures, start=1):
            video.add_image(picture)
            if progress is not None:
                progress(i / number)


@contextmanager
def _refused_by_the_encoder(path: Path) -> Iterator[None]:
    """Makes an InputError of what mediapy raises where the encoder ends before the film does."""
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("Error writing"):
            raise
        why = (str(error).splitlines() or [""])[-1]
        raise InputError(f"{path} cannot be written: the encoder says {why!r}") from None


@dataclass(frozen=True)
class _Story:
    """What each of m frames shows; lengths in radii; [0] is the engine's, [1] the equations'."""

    labels: tuple[Label, Label]
    times: Array  # (m,) s
    centres: Array  # (2, m, 3)
    attitudes: Array  # (2, m, b, 4)
    paths: tuple[Strip, Strip]
    apart: Array  # (m,) m, between the contact points
    look_at: Array  # (m, 3)
    zoom: Array  # (m,): times DISTANCE
    heading: float  # rad: the balls come towards the camera


def _frame_times(motion: Motion, theory: Motion, fps: int) -> Array:
    shared = min(len(motion.times), len(theory.times))
    if shared < 2 or not np.array_equal(motion.times[:shared], theory.times[:shared]):
        raise InputError("a video needs two motions sampled at the same times, two at least")
    return np.arange(np.floor(motion.times[shared - 1] * fps * (1 + 1e-12)) + 1) / fps


def _tell(motion: Motion, theory: Motion, fps: int) -> _Story:
    times = _frame_times(motion, theory, fps)
    tracks = [track(theory.scene.ball, each, times) for each in (motion, theory)]
    shared = min(len(motion.times), len(theory.times))
    gap = motion.contact_point[:shared] - theory.contact_point[:shared]
    travel = tracks[1].point[-1] - tracks[1].point[0]
    heading = float(np.arctan2(travel[1], travel[0]))
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    lane = LANES / 2 * np.array([-ahead[1], ahead[0]])
    points = np.array([tracks[0].point - lane, tracks[1].point + lane])
    centres = np.concatenate([points, np.ones((2, len(times), 1))], axis=2)
    middle = gaussian_filter1d(centres.mean(axis=0), SMOOTH * fps, axis=0, mode="nearest")
    between = np.linalg.norm(points[1] - points[0], axis=1)
    return _Story(
        labels=(motion.engine, theory.engine),
        times=times,
        centres=centres,
        attitudes=np.array([each.attitudes for each in tracks]),
        paths=(strip(points[0]), strip(points[1])),
        apart=np.interp(times, motion.times[:shared], np.linalg.norm(gap, axis=1)),
        look_at=middle - BEHIND * ahead,
        zoom=np.maximum(1.0, between / (1.2 * LANES)),
        heading=heading,
    )


@dataclass(frozen=True)
class _Painter:
    """Draws frames of a story, by a GL of its own in each process."""

    scene: Scene
    story: _Story
    size: tuple[int, int]
    backend: str | None

    def __call__(self, i: int) -> Pixels:
        if "_canvas" not in vars(self):
            self._drawn(0)  # the first picture of a GL may be off by a last bit
        return self._drawn(i)

    def _drawn(self, i: int) -> Pixels:
        story, canvas, colours = self.story, self._canvas, self._colours
        pose(self._model, self._data, story.centres[:, i], story.attitudes[:, i])
        camera = mujoco.MjvCamera()
        camera.azimuth, camera.elevation = np.degrees(story.heading) + 180, -ELEVATION
        camera.lookat[:] = story.look_at[i]
        camera.distance = DISTANCE * story.zoom[i]
        canvas.begin(self._data, camera)
        for colour, centres, path in zip(colours, story.centres, story.paths, strict=True):
            _add_shadow(canvas, centres[i])
            _add_path(canvas, path, i, story, colour)
        return _write(canvas, self.scene.title, story, i)

    @cached_property
    def _colours(self) -> list[str]:
        return [label.colour for label in self.story.labels]

    @cached_property
    def _model(self) -> mujoco.MjModel:
        return build_stage(len(self.scene.ball.rotors), self._colours)

    @cached_property
    def _data(self) -> mujoco.MjData:
        return mujoco.MjData(self._model)

    @cached_property
    def _canvas(self) -> Canvas:
        return Canvas(self._model, self.size, 2 * len(self.story.times), self.backend)

    def close(self) -> None:
        """Frees what this process has drawn with."""
        if "_canvas" in vars(self):
            self._canvas.close()


def _draw(scene: Scene, story: _Story, size: tuple[int, int]) -> Iterator[Pixels]:
    painter = _Painter(scene, story, size, gl.find_backend())
    with closing(painter):
        yield from in_processes(painter, range(len(story.times)), MANY)


def _add_shadow(canvas: Canvas, centre: Array) -> None:
    # A real one would draw everything once more.
    disc, size = mujoco.mjtGeom.mjGEOM_CYLINDER, np.array([SHADOW, 1e-3, 0.0])
    canvas.add(disc, size, centre * [1, 1, 0] + [0, 0, 3e-3], np.eye(3), "#000000", 0.2)


def _add_path(canvas: Canvas, path: Strip, i: int, story: _Story, colour: str) -> None:
    """The path up to frame i, as far as it is in sight."""
    away = np.linalg.norm(path.pos[:i, :2] - story.look_at[i, :2], axis=1)
    for j in np.flatnonzero(away < SIGHT * story.zoom[i]):
        box, size = mujoco.mjtGeom.mjGEOM_BOX, path.size[j] * [1, story.zoom[i], 1]
        canvas.add(box, size, path.pos[j], path.turn[j], colour)


def _write(canvas: Canvas, title: str, story: _Story, i: int) -> Pixels:
    """Finishes frame i: the picture with its words."""
    image = Image.fromarray(canvas.finish())
    pen = ImageDraw.Draw(image, "RGBA")
    line = canvas.height / 18
    plain, bold = (
        ImageFont.truetype(str(FONTS / name), 0.68 * line)
        for name in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf")
    )
    pen.rectangle((0, 0, canvas.width, 2.7 * line), fill=(255, 255, 255, 215))
    left, right = 0.7 * line, canvas.width - 0.7 * line
    state = f"contact points {_metres(story.apart[i])} apart"
    pen.text((left, line), " ".join(title.split()), palette.INK, bold, "lm")
    pen.text((left, 2 * line), state, palette.INK, plain, "lm")
    pen.text((right, 2 * line), f"t = {story.times[i]:.2f} s", palette.INK, plain, "rm")
    ahead = NAME_AHEAD * np.array([np.cos(story.heading), np.sin(story.heading), 0.0])
    for label, centres in zip(story.labels, story.centres, strict=True):
        x, y = canvas.pixel(centres[i] * [1, 1, 0] + ahead)
        pen.text((x, min(y, canvas.height - line)), label.name, label.colour, bold, "mt")
    return np.asarray(image)


def _metres(length: float) -> str:
    """A length [m] for reading: 0.123 m, 4.2 × 10⁻¹² m."""
    if length == 0 or length >= 1e-3:
        return f"{length:.3f} m"
    digits, exponent = f"{length:.1e}".split("e")
    return f"{digits} × 10{str(int(exponent)).translate(SUPERSCRIPTS)} m"
