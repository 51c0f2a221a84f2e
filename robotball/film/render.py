"""Two motions → frames: their balls under the same camera, each in its engine's colour."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d

from robotball.errors import InputError, check_positive
from robotball.film import gl
from robotball.film.camera import LENS, Camera
from robotball.film.canvas import Canvas, Pixels
from robotball.film.pane import Drawn, Line, Loose, Pane
from robotball.film.sheet import Name, Sheet
from robotball.film.tracks import Moments, Track, heading_of, track_of
from robotball.film.triangles import arrow, moved
from robotball.looks import Shape, looks_of
from robotball.motion import ContactMotion, Motion
from robotball.processes import in_processes
from robotball.rotations import Array, rotation_matrix

Progress = Callable[[float], None]

MANY = 100  # frames, worth more than one process
SMOOTH = 0.4  # s of the film, over which the camera averages the ball's motion
BLUR_FROM, BLUR_TO = 0.25, 0.75  # rad a frame: beyond it a rotor's marks would mislead
CAMERAS = {"follow": (7.2, 24.0), "above": (9.0, 80.0), "whole": (9.0, 40.0)}  # radii, degrees
TRAIL = 0.035  # half of a path's width, at the distance of the first camera
OTHER, GHOST = 0.4, 0.35  # opacity of the other ball's path, and of a ghost
# Arrows: colour, length in radii of the largest, and thickness.
ARROWS = {"M": ("#CC79A7", 1.5), "ω": ("#009E73", 1.2), "contact force": ("#22262B", 0.9)}
THICK = 0.045
LEAST = 1e-3  # of the largest: a shorter arrow is not seen
ROOM = 1.3  # that arrows take
CLEAR = 1.06  # from the centre: outside the shell


@dataclass(frozen=True)
class Film:
    """How a film is to be made.

    fps: frames a second; size: (height, width) in pixels, even; slow: so many times slower than
    life; camera: it follows the ball, looks from above, or stands still and sees the whole path;
    ghost: one picture with the second ball as a ghost, in place of two pictures; arrows: M, ω and
    the contact force. Raises InputError for what cannot be.
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
        if self.camera not in CAMERAS:
            raise InputError(f"camera must be one of {', '.join(CAMERAS)}, not {self.camera!r}")

    def times(self, motion: Motion, theory: Motion) -> Array:
        """The times of its frames (m,) [s], while both motions last.

        Raises InputError where these are not sampled at the same times.
        """
        shared = min(len(motion.times), len(theory.times))
        if shared < 2 or not np.array_equal(motion.times[:shared], theory.times[:shared]):
            raise InputError("a video needs two motions sampled at the same times, two at least")
        rate = self.fps * self.slow
        return np.arange(np.floor(motion.times[shared - 1] * rate * (1 + 1e-12)) + 1) / rate


def frames(motion: Motion, theory: Motion, film: Film | None = None) -> Iterator[Pixels]:
    """The pictures (height, width, 3) of a film, one by one.

    motion: an engine's, on the left; theory: that of the equations of the same scene. Raises
    InputError where the times differ, or where there is no off-screen GL.
    """
    film = film or Film()
    times, backend = film.times(motion, theory), gl.find_backend()
    if backend is None:
        raise InputError(gl.advice())
    motions = (motion, theory)
    tracks = (track_of(motion).sampled_at(times), track_of(theory).sampled_at(times))
    apart = np.linalg.norm(tracks[0].points - tracks[1].points, axis=1) * theory.scene.ball.radius
    return _painted(
        _Painter(
            film,
            times,
            tracks,
            looks_of(theory.scene.ball),
            (motion.engine.colour, theory.engine.colour),
            _sheet(motions, film, times, apart),
            _lengths(tracks[1].sampled, theory.scene.momentum_scale) if film.arrows else {},
            backend,
        )
    )


def _painted(painter: "_Painter") -> Iterator[Pixels]:
    with closing(painter):
        yield from in_processes(painter, range(len(painter.times)), MANY)


@dataclass(frozen=True)
class _Painter:
    """Draws the frames of a film by their numbers, with an OpenGL of its own in each process."""

    film: Film
    times: Array
    tracks: tuple[Track, Track]
    looks: dict[str, tuple[Shape, ...]]
    colours: tuple[str, str]
    sheet: Sheet
    lengths: dict[str, float]
    backend: str

    def __call__(self, k: int) -> Pixels:
        if "_canvas" not in vars(self):
            self._drawn(0)  # the first picture of a GL may be off by a last bit
        return self._drawn(k)

    def _drawn(self, k: int) -> Pixels:
        then = [track.sample(k) for track in self.tracks]
        balls = [
            self._ball(i, moment, GHOST if self.film.ghost and i else 1.0)
            for i, moment in enumerate(then)
        ]
        panes = []
        for pane, camera in zip(self._panes, self._cameras, strict=True):
            lines = [
                Line(f"path {i}", 2 * (k + 1), self.colours[i], 1.0 if i in pane else OTHER)
                for i in dict.fromkeys([*pane, 0, 1])
            ]
            first = pane[0]
            arrows = _arrows(then[first], self.lengths, self.tracks[first].radius)
            panes.append(Pane(camera(k), [balls[i] for i in pane], lines, arrows))
        off = np.linalg.norm(then[0].contact_point - then[1].contact_point)
        return self.sheet.frame(self._canvas.draw(panes), float(self.times[k]), float(off))

    def _ball(self, i: int, then: Moments, opacity: float) -> Drawn:
        turned = np.abs(then.hinge_rates[0]) / (self.film.fps * self.film.slow)
        blurred = np.clip((turned - BLUR_FROM) / (BLUR_TO - BLUR_FROM), 0, 1).tolist()
        matrices = {}
        for name, (turn, shift) in self.tracks[i].stands(then).items():
            matrices[name] = np.eye(4)
            matrices[name][:3, :3], matrices[name][:3, 3] = turn[0], shift[0]
        names = [name for name, _, _ in self.tracks[i].hinges]
        return Drawn(self.colours[i], matrices, dict(zip(names, blurred, strict=True)), opacity)

    @property
    def _panes(self) -> list[list[int]]:
        return [[0, 1]] if self.film.ghost else [[0], [1]]

    @cached_property
    def _points(self) -> list[Array]:
        return [track.points for track in self.tracks]

    @cached_property
    def _cameras(self) -> list[Callable[[int], Camera]]:
        height, width = self.sheet.pane
        return [
            _camera(self.film, [self._points[i] for i in pane], width / height)
            for pane in self._panes
        ]

    @cached_property
    def _canvas(self) -> Canvas:
        height, width = self.sheet.pane
        canvas = Canvas((height, width * len(self._panes)), self.looks, self.backend)
        for i, points in enumerate(self._points):
            strip = _strip(points, self._cameras[0](0).distance)
            canvas.keep(f"path {i}", strip, strip=True)
        return canvas

    def close(self) -> None:
        """Frees what this process has drawn with."""
        if "_canvas" in vars(self):
            self._canvas.close()


def _sheet(motions: Sequence[Motion], film: Film, times: Array, apart: Array) -> Sheet:
    names = []
    for motion, at in zip(motions, (0.25, 0.75), strict=True):
        text = f"{motion.engine.name} {motion.engine.version}"
        if isinstance(motion, ContactMotion):
            text += f", {motion.report.settings.name}"
        elif motion is motions[1]:
            text = motion.engine.name
        names.append(Name(text + (" (ghost)" if film.ghost and at > 0.5 else ""),
                          motion.engine.colour, at))  # fmt: skip
    arrows = [Name(name, colour) for name, (colour, _) in ARROWS.items() if film.arrows]
    notes = []
    if film.slow != 1:
        notes.append(f"{film.slow:g} times slower than life" if film.slow > 1 else
                     f"{1 / film.slow:g} times faster than life")  # fmt: skip
    rates = np.abs(motions[1].hinge_rates[:, 1:])
    if rates.size and rates.max() / (film.fps * film.slow) > BLUR_FROM:
        notes.append("a rotor too fast for the film has no marks")
    return Sheet(
        film.size,
        1 if film.ghost else 2,
        motions[1].scene.title,
        names,
        arrows,
        "; ".join(notes),
        times,
        apart,
    )


def _camera(film: Film, points: Sequence[Array], aspect: float) -> Callable[[int], Camera]:
    """The camera of a frame, by its number; points (m, 2) of each ball in the picture."""
    distance, elevation = CAMERAS[film.camera]
    room = ROOM if film.arrows else 1.0
    between = np.linalg.norm(points[0] - points[-1], axis=1)
    azimuth = heading_of(points[-1]) + (0.6 if film.camera == "follow" else 0.0)
    up = np.radians(elevation)
    if film.camera == "whole":
        every = np.concatenate(points)
        low, high = every.min(axis=0), every.max(axis=0)
        half = float(np.linalg.norm(high - low)) / 2 + 1.5 * room
        fixed = Camera(
            np.array([*(low + high) / 2, 0.5]), LENS * half / min(1.0, aspect), azimuth, up
        )
        return lambda k: fixed
    middle = np.mean(points, axis=0)
    smooth = gaussian_filter1d(middle, SMOOTH * film.fps, axis=0, mode="nearest")
    far = room * distance * np.maximum(1.0, (between + 2.5) / 4.0) / min(1.0, 1.25 * aspect)
    far = gaussian_filter1d(far, SMOOTH * film.fps, mode="nearest")
    return lambda k: Camera(np.array([*smooth[k], 0.85]), float(far[k]), azimuth, up)


def _strip(points: Array, distance: float) -> Array:
    """A path's strip (2 m, 6) on the floor through points (m, 2); its normals say which side."""
    steps = np.gradient(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.divide(steps, lengths, out=np.tile([1.0, 0.0], (len(points), 1)), where=lengths > 0)
    side = TRAIL * distance / CAMERAS["follow"][0] * np.column_stack([-along[:, 1], along[:, 0]])
    strip = np.zeros((2 * len(points), 6))
    strip[0::2, :2], strip[1::2, :2] = points + side, points - side
    strip[0::2, 3], strip[1::2, 3] = 1.0, -1.0
    return strip


def _vectors(then: Moments) -> dict[str, Array]:
    """What arrows show (n, 3), world axes."""
    omega = np.einsum("nij,nj->ni", rotation_matrix(then.attitude), then.angular_velocity)
    return dict(zip(ARROWS, (then.momentum, omega, then.contact_force), strict=True))


def _lengths(reference: Moments, momentum_scale: float) -> dict[str, float]:
    """What an arrow of one radius stands for, by the reference's largest."""
    least = {"M": LEAST * momentum_scale}  # of a ball at M = 0 it is rounding
    return {
        name: max(float(np.linalg.norm(vectors, axis=1).max()), least.get(name, 0.0))
        / ARROWS[name][1]
        for name, vectors in _vectors(reference).items()
    }


def _arrows(then: Moments, lengths: dict[str, float], radius: float) -> list[Loose]:
    """The arrows at one time; the contact force's begins where its line leaves the ball."""
    found = []
    place = np.append(then.contact_point[0] / radius, 0.0)
    vectors = _vectors(then)
    for name, length in lengths.items():
        vector = vectors[name][0]
        size = float(np.linalg.norm(vector))
        if size > LEAST * length:
            along = vector / size
            start = CLEAR * along + np.array([0.0, 0.0, 1.0])
            if name == "contact force":
                start = (2 * along[2] + CLEAR - 1) * along
            corners = moved(arrow(vector / length, THICK), np.eye(3), place + start)
            found.append(Loose(corners, ARROWS[name][0]))
    return found
