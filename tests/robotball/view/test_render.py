"""Films: the frames, their contents, and the file."""

import dataclasses
import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageFont

import robotball as rb
from robotball.engines.mujoco import LABEL
from robotball.processes import at_most, cores
from robotball.robot.looks import rgb
from robotball.rotations import multiply
from robotball.view import gl, render
from robotball.view.render import Film, frames
from robotball.view.stage import Pixels
from robotball.view.tracks import colours_of
from tests.messages import naming

TIMES = np.linspace(0.0, 0.3, 16)  # s
FIG12 = rb.load_scene("fig12")
SMALL = Film(size=(120, 240))
THEORY = rb.integrate(FIG12, TIMES)
COLOURS = ("#ff0000", "#00ff00", "#0000ff")
screen = pytest.mark.usefixtures("screen")


def share(picture: Pixels, colour: str) -> float:
    """Return the fraction of pixels in which a colour's strongest channel stands out."""
    expected = np.array(rgb(colour))
    strong, weak = int(expected.argmax()), int(expected.argmin())
    return float((picture[..., strong].astype(int) - picture[..., weak] > 60).mean())


@screen
def test_a_frame_shows_each_engines_ball_on_its_side() -> None:
    """In the engines' colours; rotating one ball changes only its side."""
    engine = dataclasses.replace(THEORY, engine=LABEL)
    quarter = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    turned = dataclasses.replace(engine, attitude=multiply(quarter, THEORY.attitude))
    picture, other = (next(frames([motion, THEORY], SMALL)) for motion in (engine, turned))
    assert picture.shape == (*SMALL.size, 3)
    left, right = np.hsplit(picture[12:94], 2)  # without the texts and the plot
    assert share(left, LABEL.colour) > 0.01
    assert share(right, LABEL.colour) == 0
    assert share(right, THEORY.engine.colour) > 0.02
    # The rotor's gold is similar to the equations' colour, and on both balls.
    assert share(left, THEORY.engine.colour) < 0.015
    changed = np.hsplit(np.any(picture != other, axis=2), 2)
    assert changed[0].mean() > 0.02
    assert not changed[1].any()


@screen
def test_motions_with_one_engine_differ_in_ball_colour_and_curve() -> None:
    """Three motions in one picture and in separate ones; measured fractions of at least 0.006."""
    engine = dataclasses.replace(THEORY, engine=LABEL)
    away = dataclasses.replace(engine, contact_point=THEORY.contact_point + np.array([5.0, 0.0]))
    motions, film = [engine, away, THEORY], Film(size=(264, 480))
    colours = colours_of(motions)
    assert (len(set(colours)), colours[0], colours[2]) == (3, LABEL.colour, THEORY.engine.colour)
    separate = next(frames(motions, film))
    for third, colour in zip(np.hsplit(separate[26:186], 3), colours, strict=True):
        assert share(third, colour) > 0.01  # measured 0.019
    one = next(frames(motions, dataclasses.replace(film, ghost=True)))
    assert min(share(one[26:186], colour) for colour in colours[:2]) > 0.003
    assert min(share(separate[186:], colour) for colour in colours[:2]) > 0.002


@screen
def test_a_film_shows_where_a_ball_slips() -> None:
    """A yellow band on the floor, a word beside the ball's name, and a note below the title."""
    slipping = dataclasses.replace(THEORY, slipping=((0.0, 0.05), (0.13, 0.19)))
    film = Film(fps=10, size=(264, 480), camera="above")
    sticks, slips = (
        np.stack([*frames([motion], film)])[-1].astype(int) for motion in (THEORY, slipping)
    )
    yellow = (slips[..., 1] - slips[..., 2] > 60) & (sticks[..., 1] - sticks[..., 2] < 20)
    assert yellow.sum() > 10  # measured 32
    painter = render._Painter([slipping], film)
    names = [next(painter._ball_names(k, {0: (0.0, 0.0, 1.0)}))[0] for k in range(4)]
    assert names == ["equations, slipping", "equations", "equations, slipping", "equations"]
    notes = [*render._notes([slipping], film, painter.looks)]
    assert "yellow path: the ball slips" in notes


@screen
def test_a_path_is_smooth_in_a_film_with_few_frames() -> None:
    """At 1 and at 200 frames per second its corners are at most 0.02 s apart, and on the motion."""
    long = rb.integrate(FIG12, np.linspace(0.0, 2.0, 101))
    for fps in (1, 200):
        painter = render._Painter([long, long], dataclasses.replace(SMALL, fps=fps))
        track, k = painter.tracks[0], painter.finer
        assert np.diff(track.times).max() <= 0.02 + 1e-12
        assert track.times[::k] == pytest.approx(painter.times)
        assert np.abs(track.at(long.times).contact_point - long.contact_point).max() < 1e-6


@pytest.mark.parametrize("place", [(295.0, 190.0), (40.0, 30.0)], ids=["corner", "no room above"])
def test_labels_stay_inside_the_picture_and_do_not_overlap(place: tuple[float, float]) -> None:
    """Three at one place have as many coloured pixels as alone, wherever the place is."""
    font = ImageFont.truetype(str(render._FONTS / "DejaVuSans-Bold.ttf"), 20)
    box = np.array([0, 0, 300, 200])

    def written(*words: str) -> Pixels:
        image = Image.new("RGB", (300, 200), "white")
        render._write(image, [("a ball\n1 m off", colour, place) for colour in words], font, box)
        return np.asarray(image)

    alone = {
        colour: np.all(written(colour) == 255 * np.array(rgb(colour)), axis=2).sum()
        for colour in COLOURS
    }
    together = written(*COLOURS)
    for colour, pixels in alone.items():
        assert pixels > 300
        assert np.all(together == 255 * np.array(rgb(colour)), axis=2).sum() == pixels


# A head of 0.08 m, its centre 0.2 m above the centre of a shell of 0.15 m.
HEADED = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body name="ball" pos="0 0 .15">
  <freejoint/><geom type="sphere" size=".15" mass="1"/><body name="head">
  <joint name="neck" axis="0 0 1"/>
  <geom type="sphere" size=".08" pos="0 0 .2" mass=".1" contype="0" conaffinity="0"/></body></body>
</worldbody><actuator><velocity name="turn" joint="neck" kv="1"/></actuator></mujoco>"""


@screen
def test_a_name_is_clear_of_parts_above_a_shell(tmp_path: Path) -> None:
    """Two lines of text are above a head in the picture; without a head they are lower."""
    file, film = tmp_path / "headed.xml", Film(size=(264, 480))
    file.write_text(HEADED)

    def clear(scene: rb.Scene) -> float:
        """Return the pixels from the head's top, 28/15 radii up, to the name above it."""
        theory = rb.integrate(scene, TIMES)
        motions = [dataclasses.replace(theory, engine=LABEL), theory]
        painter = render._Painter(motions, dataclasses.replace(film, ghost=True))
        name, _ = painter._ball_names(0, {0: (100.0, 100.0, 30.0), 1: (100.0, 100.0, 30.0)})
        return (100.0 - 28 / 15 * 30.0) - (name[2][1] + painter.sheet.line)

    assert 0 <= clear(rb.load_scene(str(file))) < 3  # measured 1.0
    assert clear(FIG12) < -20  # measured -24


@pytest.mark.slow
@screen
def test_frames_do_not_depend_on_the_number_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last pixel, and in order."""
    monkeypatch.setattr(render, "_MANY", 2)
    drawn = []
    for count in (1, 2):
        with at_most(count):
            drawn.append(list(frames([THEORY, THEORY], dataclasses.replace(SMALL, fps=10))))
    assert len(drawn[0]) == 4
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0][0], drawn[0][-1])


@pytest.mark.slow
@screen
@pytest.mark.parametrize("suffix", ["mp4", "webm", "gif"])
def test_a_video_ends_with_the_shorter_motion(tmp_path: Path, suffix: str) -> None:
    """10 frames per second, slowed twice, of a run that ended at 0.3 s."""
    done: list[float] = []
    target = tmp_path / f"ball.{suffix}"
    film = dataclasses.replace(SMALL, fps=10, slow=2.0)
    longer = rb.integrate(FIG12, np.concatenate([TIMES, np.array([0.4])]))
    rb.film(target, [THEORY, longer], progress=done.append, **vars(film))
    reader = imageio_ffmpeg.read_frames(str(target))
    about = next(reader)
    assert about["size"] == SMALL.size[::-1]
    assert about["fps"] == 10
    assert sum(1 for _ in reader) == 7  # 0 … 0.3 s
    assert (len(done), done[-1]) == (7, 1)
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.slow
@screen
@pytest.mark.usefixtures("linux")
@pytest.mark.skipif(cores() < 2, reason="there is one core")
@pytest.mark.parametrize("suffix", ["mp4", pytest.param("webm", marks=pytest.mark.study)])
def test_the_bytes_of_a_video_do_not_depend_on_the_number_of_cores(
    tmp_path: Path, suffix: str
) -> None:
    """By default the encoder would use as many threads as there are cores."""
    allowed, film, written = os.sched_getaffinity(0), Film(size=(240, 320), fps=20), []
    try:
        for some in ({min(allowed)}, allowed):
            os.sched_setaffinity(0, some)
            target = tmp_path / f"{len(some)}.{suffix}"
            rb.film(target, [THEORY, THEORY], **vars(film))
            written.append(target.read_bytes())
    finally:
        os.sched_setaffinity(0, allowed)
    assert written[0] == written[1]


@screen
def test_a_motion_shorter_than_a_frame_shows_its_start_and_end() -> None:
    """The two pictures differ."""
    for end in (0.01, 1 / 30):
        short = rb.integrate(FIG12, np.linspace(0.0, end, 3))
        assert SMALL.times([short, short]).tolist() == [0.0, end]
    first, last = frames([short, short], SMALL)
    assert not np.array_equal(first, last)


@screen
def test_one_motion_alone_is_filmed(tmp_path: Path) -> None:
    """Opaque, also with a ghost, which is half transparent; without a curve of distances."""
    alone, ghost = (
        next(frames([THEORY], dataclasses.replace(SMALL, ghost=each))) for each in (False, True)
    )
    assert np.array_equal(alone, ghost)
    path = str(tmp_path / "ball.gif")
    assert rb.film(path, THEORY, fps=5, size=SMALL.size) == Path(path)
    assert Path(path).read_bytes()[:3] == b"GIF"


@pytest.mark.slow
@screen
def test_every_option_changes_the_picture() -> None:
    """Two panes, a ghost, and the three cameras give different pictures."""
    changes: list[dict[str, Any]] = [
        {},
        {"ghost": True},
        {"camera": "above"},
        {"camera": "whole"},
    ]
    films = [dataclasses.replace(SMALL, **change) for change in changes]
    drawn = [next(frames([THEORY, THEORY], film)).tobytes() for film in films]
    assert len(set(drawn)) == len(changes)


@pytest.mark.slow
@screen
def test_a_rotor_too_fast_for_the_film_has_no_marks() -> None:
    """At 148 rad/s and 30 frames/s its angle has no visible effect; slowed 60 times it has.

    It is rotated by a twelfth of a turn, which maps the facets of its rim onto each other.
    Measured 0 and 0.008 of the pixels.
    """
    turned = dataclasses.replace(
        THEORY, hinge_angles=THEORY.hinge_angles + np.array([0.0, np.pi / 6])
    )
    still = dataclasses.replace(THEORY)  # a different object from the reference
    for slow, least, most in ((1.0, 0.0, 5e-4), (60.0, 2e-3, 1.0)):
        film = dataclasses.replace(SMALL, size=(160, 240), slow=slow)
        with at_most(1):  # a slow film has enough frames to be drawn in several processes
            first, second = (next(frames([motion, THEORY], film)) for motion in (still, turned))
        assert least <= np.any(first != second, axis=2).mean() <= most


@screen
def test_memory_does_not_grow_with_the_length_of_a_film() -> None:
    """In the second half of 10 frames: keeping them would take 0.4 MB; measured 0.005 MB."""
    with at_most(1):
        drawn, peaks = frames([THEORY, THEORY], SMALL), []
        tracemalloc.start()
        for _ in drawn:
            peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[-1] - peaks[4] < 1e5


@screen
def test_a_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    """And leaves no partial new file."""
    target = tmp_path / "ball.mp4"
    target.write_bytes(b"the old one")

    def give_up(fraction: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rb.film(target, [THEORY, THEORY], progress=give_up, **vars(SMALL))
    assert target.read_bytes() == b"the old one"
    assert list(tmp_path.iterdir()) == [target]


REFUSED: dict[str, Callable[[], object]] = {
    "fps 1 240 0": lambda: Film(fps=0),
    "even 120 4320 1280x721": lambda: Film(size=(721, 1280)),
    "even 120 4320 118x120": lambda: Film(size=(120, 118)),
    "slow": lambda: Film(slow=0.0),
    "camera follow above whole 'behind'": lambda: Film(camera="behind"),  # type: ignore[arg-type]
    "same~sample~times": lambda: frames(
        [dataclasses.replace(THEORY, times=THEORY.times * 1.01), THEORY]
    ),
    ".mp4 ball.avi": lambda: rb.film("ball.avi", [THEORY, THEORY]),
    ".mp4 no/folder/ball.mp4": lambda: rb.film("no/folder/ball.mp4", [THEORY] * 2),
    "GL video": lambda: frames([THEORY, THEORY]),
}


@pytest.mark.parametrize("facts", REFUSED)
def test_invalid_films_are_refused(facts: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The message has the limit or, without OpenGL, what to install."""
    monkeypatch.setattr(gl, "find_backend", lambda: None)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(rb.InputError, match=naming(facts)):
        REFUSED[facts]()


def test_mujoco_gl_is_the_only_candidate_if_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """If it is off, nothing is tried."""
    tried: list[str] = []
    monkeypatch.setattr(gl, "_works", tried.append)
    for name in ("osmesa", "off"):
        monkeypatch.setenv("MUJOCO_GL", name)
        assert gl.find_backend.__wrapped__() is None
        assert tried == ["osmesa"]
