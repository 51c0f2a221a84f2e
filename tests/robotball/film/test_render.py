"""The video: the parts, what a run leaves out of them, the poses, the frames, the file."""

import dataclasses
import subprocess
import sys
import tracemalloc
from dataclasses import fields
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.cores import at_most
from robotball.engines.mujoco import LABEL, model
from robotball.film import gl
from robotball.film import looks as palette
from robotball.film.render import Film, frames
from robotball.film.stage import Pixels
from robotball.film.write import write_video
from robotball.motion import Loads
from robotball.robot import PARTS
from robotball.rotations import multiply
from tests.scenes import FOUR

TIMES = np.linspace(0.0, 0.3, 16)  # s
COLUMNS = ("times", "contact_point", "attitude", "momentum", "angular_velocity", "hinge_angles",
           "hinge_rates")  # fmt: skip
SMALL = Film(size=(180, 320))


@pytest.fixture(scope="module")
def scene() -> rb.Scene:
    return rb.load_scene("fig12")


@pytest.fixture(scope="module")
def theory(scene: rb.Scene) -> rb.Motion:
    return rb.integrate(scene, TIMES)


@pytest.mark.parametrize("name", ["floor", "shell", "frame", "rotor"])
def test_each_part_opens_alone(name: str) -> None:
    part = mujoco.MjModel.from_xml_path(str(PARTS / f"{name}.xml"))
    assert part.ngeom > 0
    assert part.nmat > 0


@pytest.mark.parametrize("name", FOUR)
def test_a_run_carries_nothing_of_a_picture(name: str) -> None:
    scene = rb.load_scene(name)
    run = model.build(scene, rb.preset("balanced")).compiled
    assert [run.geom(i).name for i in range(run.ngeom)] == ["floor", "shell_sphere"]
    assert (run.nlight, run.nmat, run.ntex, run.nmesh, run.ncam) == (0, 0, 0, 0, 0)
    # World, shell, frame, rotors: the attached parts add no bodies of their own.
    assert run.nbody == 3 + len(scene.ball.rotors)


@pytest.mark.usefixtures("screen")
def test_a_frame_shows_each_engine_s_ball_on_its_side(theory: rb.Motion) -> None:
    picture = next(frames(dataclasses.replace(theory, engine=LABEL), theory, SMALL))
    assert picture.shape == (180, 320, 3)
    left, right = picture[:, :160], picture[:, 160:]
    assert _share(left, LABEL.colour) > 0.01
    assert _share(right, LABEL.colour) == 0
    assert _share(right, theory.engine.colour) > 0.02
    # The rotor's gold is near the equations' colour, and in both balls.
    assert _share(left, theory.engine.colour) < 0.015


@pytest.mark.usefixtures("screen")
@pytest.mark.slow
def test_frames_are_the_same_from_any_number_of_processes(theory: rb.Motion) -> None:
    """109 of them, enough to be drawn by two: to the last pixel, and in order."""
    drawn = []
    for count in (1, 2):
        with at_most(count):
            drawn.append(
                list(frames(theory, theory, dataclasses.replace(SMALL, fps=240, slow=1.5)))
            )
    assert len(drawn[0]) == 109
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0][0], drawn[0][-1])


def test_a_frame_shows_where_the_engines_differ(theory: rb.Motion) -> None:
    quarter = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    engine = dataclasses.replace(theory, attitude=multiply(quarter, theory.attitude))
    same, other = (next(frames(each, theory, SMALL)) for each in (theory, engine))
    changed = np.any(same != other, axis=2)
    assert changed[:, :160].mean() > 0.02
    assert not changed[:, 160:].any()


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_a_video_has_every_frame_in_its_size(theory: rb.Motion, tmp_path: Path) -> None:
    done: list[float] = []
    target = tmp_path / "ball.mp4"
    write_video(target, theory, theory, SMALL, progress=done.append)
    reader = imageio_ffmpeg.read_frames(str(target))
    about = next(reader)
    assert about["size"] == (320, 180)
    assert about["fps"] == 30
    assert sum(1 for _ in reader) == 10  # 0 … 0.3 s
    assert len(done) == 10
    assert done[-1] == 1
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("suffix", ["webm", "gif"])
def test_other_formats_have_every_frame_too(theory: rb.Motion, tmp_path: Path, suffix: str) -> None:
    """At 10 frames a second, four times slower than life."""
    target = tmp_path / f"ball.{suffix}"
    write_video(target, theory, theory, dataclasses.replace(SMALL, fps=10, slow=4.0))
    reader = imageio_ffmpeg.read_frames(str(target))
    assert next(reader)["size"] == (320, 180)
    assert sum(1 for _ in reader) == 13  # 0 … 0.3 s


@pytest.mark.usefixtures("screen")
def test_a_video_ends_where_a_run_broke_off(theory: rb.Motion) -> None:
    short = dataclasses.replace(
        theory,
        **{name: getattr(theory, name)[:6] for name in COLUMNS},
        loads=Loads(*(getattr(theory.loads, each.name)[:6] for each in fields(Loads))),
    )
    assert sum(1 for _ in frames(short, theory, SMALL)) == 4  # 0 … 0.1 s


@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("end", [0.01, 1 / 30])
def test_a_motion_of_no_more_than_a_frame_shows_its_start_and_end(
    scene: rb.Scene, end: float
) -> None:
    short = rb.integrate(scene, np.linspace(0.0, end, 3))
    assert SMALL.times(short, short).tolist() == [0.0, end]
    first, last = frames(short, short, SMALL)
    assert not np.array_equal(first, last)


@pytest.mark.usefixtures("screen")
def test_every_choice_changes_the_picture(theory: rb.Motion) -> None:
    """Two panes, a ghost, arrows, and the three cameras: no two alike."""
    changes: list[dict[str, Any]] = [
        {}, {"ghost": True}, {"arrows": True}, {"camera": "above"}, {"camera": "whole"}
    ]  # fmt: skip
    drawn = [
        next(frames(theory, theory, dataclasses.replace(SMALL, **change))).tobytes()
        for change in changes
    ]
    assert len(set(drawn)) == len(changes)


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_a_rotor_too_fast_for_the_film_shows_no_marks(theory: rb.Motion) -> None:
    """At 148 rad/s and 30 frames/s its angle changes nothing but rounding; slowed 60 times it does.

    By a twelfth of a turn, which brings the facets of its rim onto each other. Measured 0 and 0.008
    of the pixels.
    """
    turned = dataclasses.replace(
        theory, hinge_angles=theory.hinge_angles + np.array([0.0, np.pi / 6])
    )
    still = dataclasses.replace(theory)  # another motion than the reference, to the film
    for slow, least, most in ((1.0, 0.0, 5e-4), (60.0, 2e-3, 1.0)):
        film = dataclasses.replace(SMALL, slow=slow)
        first, second = (next(frames(each, theory, film)) for each in (still, turned))
        off = np.any(first != second, axis=2)
        assert least <= off.mean() <= most


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_memory_does_not_grow_with_the_film(theory: rb.Motion) -> None:
    """Four times the frames: all that is more would be 9 MB; measured 0.03 MB."""
    peaks = []
    for slow in (2.0, 8.0):
        with at_most(1):
            tracemalloc.start()
            for _ in frames(theory, theory, dataclasses.replace(SMALL, slow=slow)):
                pass
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    assert peaks[1] - peaks[0] < 1e6


@pytest.mark.usefixtures("screen")
def test_a_failed_write_leaves_the_old_file(theory: rb.Motion, tmp_path: Path) -> None:
    target = tmp_path / "ball.mp4"
    target.write_bytes(b"the old one")

    def give_up(fraction: float) -> None:
        if fraction > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(target, theory, theory, SMALL, progress=give_up)
    assert target.read_bytes() == b"the old one"
    assert list(tmp_path.iterdir()) == [target]


def test_motions_at_different_times_are_refused(theory: rb.Motion) -> None:
    late = dataclasses.replace(theory, times=theory.times * 1.01)
    with pytest.raises(rb.InputError, match="same times"):
        frames(late, theory)


@pytest.mark.parametrize("path", ["ball.avi", "no/such/folder/ball.mp4"])
def test_a_path_that_can_be_no_video_is_refused(path: str, theory: rb.Motion) -> None:
    with pytest.raises(rb.InputError, match=r"\.mp4"):
        write_video(path, theory, theory)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fps": 0}, "fps must be a whole number from 1 to 240, not 0"),
        ({"size": (721, 1280)}, "must be even, and 120 to 4320 pixels, not 1280x721"),
        ({"slow": 0.0}, "slow must be"),
        ({"camera": "behind"}, "camera must be one of follow, above, whole, not 'behind'"),
    ],
)
def test_a_film_that_cannot_be_is_refused(given: dict[str, Any], words: str) -> None:
    """Each with the limit."""
    with pytest.raises(rb.InputError, match=words):
        Film(**given)


def test_without_a_gl_the_message_says_what_to_install(
    theory: rb.Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gl, "find_backend", lambda: None)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(rb.InputError, match="no off-screen GL; video needs"):
        frames(theory, theory)


def test_mujoco_gl_is_the_only_candidate_where_set(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def refuse(backend: str) -> bool:
        tried.append(backend)
        return False

    monkeypatch.setattr(gl, "_works", refuse)
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert gl.find_backend.__wrapped__() is None
    assert tried == ["osmesa"]
    monkeypatch.setenv("MUJOCO_GL", "off")
    assert gl.find_backend.__wrapped__() is None
    assert tried == ["osmesa"]


def test_the_library_imports_without_its_video() -> None:
    code = "import sys, robotball; print([m for m in sys.modules if m in ('OpenGL', 'PIL')])"
    child = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert child.stdout.strip() == "[]"


def _share(picture: Pixels, colour: str) -> float:
    """The share of the pixels in which a colour's strongest channel stands out, as in the ball."""
    wanted = np.array(palette.rgb(colour))
    strong, weak = int(wanted.argmax()), int(wanted.argmin())
    return float((picture[..., strong].astype(int) - picture[..., weak] > 60).mean())
