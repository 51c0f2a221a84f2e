"""The video: the parts, what a run leaves out of them, the poses, the frames, the file."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import palette
from robotball.engines.mujoco import LABEL, model
from robotball.film import gl
from robotball.film.canvas import Pixels
from robotball.film.picture import track
from robotball.film.render import frames, write_video
from robotball.looks import PARTS
from robotball.rotations import Array, conjugate, multiply, z_along
from robotball.threads import at_most
from tests.scenes import FOUR

TIMES = np.linspace(0.0, 0.3, 16)  # s
SMALL = (180, 320)  # pixels


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


def test_the_picture_s_bodies_stand_as_the_run_s(scene: rb.Scene) -> None:
    """Shell, frame and rotor, at t = 0.3 s; measured 7e-16 rad."""
    run = model.build(scene, rb.preset("balanced"))
    data = run.start_data()
    while data.time < TIMES[-1] - 1e-9:
        mujoco.mj_step(run.compiled, data)
    mujoco.mj_kinematics(run.compiled, data)
    shell, frame, rotor = data.xquat[1:]
    motion = rb.simulate(scene, TIMES, settings="balanced")
    drawn = track(scene.ball, motion, TIMES[-1:])
    # A part's z is its body's axis; the run's rotor has it so already.
    upright = z_along(scene.ball.shell.axis)
    expected = np.array([multiply(shell, upright), multiply(frame, upright), rotor])
    assert _angles(drawn.attitudes[0], expected).max() < 1e-12
    assert np.abs(drawn.point[0] * scene.ball.radius - data.qpos[:2]).max() < 1e-12


def test_poses_between_samples_follow_the_motion(scene: rb.Scene, theory: rb.Motion) -> None:
    """Half way between samples 20 ms apart; measured 6e-4 rad and 2e-6 radii."""
    between = (TIMES[:-1] + TIMES[1:]) / 2
    exact = rb.integrate(scene, np.concatenate([[0.0], between]))
    drawn, expected = track(scene.ball, theory, between), track(scene.ball, exact, between)
    assert _angles(drawn.attitudes, expected.attitudes).max() < 2e-3
    assert np.abs(drawn.point - expected.point).max() < 1e-5


@pytest.mark.usefixtures("screen")
def test_a_frame_shows_each_engine_s_ball_on_its_side(theory: rb.Motion) -> None:
    picture = next(frames(dataclasses.replace(theory, engine=LABEL), theory, size=SMALL))
    assert picture.shape == (*SMALL, 3)
    left, right = picture[:, :160], picture[:, 160:]
    assert _share(left, LABEL.colour) > 0.01
    assert _share(right, LABEL.colour) == 0
    assert _share(right, theory.engine.colour) > 0.02
    # The rotor's gold is near the equations' colour, and in both balls.
    assert _share(left, theory.engine.colour) < 0.015


@pytest.mark.usefixtures("screen")
@pytest.mark.slow
def test_frames_are_the_same_from_any_number_of_processes(theory: rb.Motion) -> None:
    """121 of them, enough to be drawn by two: to the last pixel, and in order."""
    drawn = []
    for count in (1, 2):
        with at_most(count):
            drawn.append(list(frames(theory, theory, fps=400, size=SMALL)))
    assert len(drawn[0]) == 121
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0][0], drawn[0][-1])


def test_a_frame_shows_where_the_engines_differ(theory: rb.Motion) -> None:
    quarter = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    engine = dataclasses.replace(theory, attitude=multiply(quarter, theory.attitude))
    same, other = (next(frames(each, theory, size=SMALL)) for each in (theory, engine))
    changed = np.any(same != other, axis=2)
    assert changed[:, :160].mean() > 0.02
    assert not changed[:, 160:].any()


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_a_video_has_every_frame_in_its_size(theory: rb.Motion, tmp_path: Path) -> None:
    done: list[float] = []
    target = tmp_path / "ball.mp4"
    write_video(target, theory, theory, size=SMALL, progress=done.append)
    reader = imageio_ffmpeg.read_frames(str(target))
    about = next(reader)
    assert about["size"] == SMALL[::-1]
    assert about["fps"] == 30
    assert sum(1 for _ in reader) == 10  # 0 … 0.3 s
    assert len(done) == 10
    assert done[-1] == 1
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.usefixtures("screen")
def test_a_video_ends_where_a_run_broke_off(theory: rb.Motion) -> None:
    columns = ("times", "contact_point", "attitude", "momentum", "angular_velocity", "hinge_angles")
    short = dataclasses.replace(theory, **{name: getattr(theory, name)[:6] for name in columns})
    assert sum(1 for _ in frames(short, theory, size=SMALL)) == 4  # 0 … 0.1 s


@pytest.mark.usefixtures("screen")
def test_a_failed_write_leaves_the_old_file(theory: rb.Motion, tmp_path: Path) -> None:
    target = tmp_path / "ball.mp4"
    target.write_bytes(b"the old one")

    def give_up(fraction: float) -> None:
        if fraction > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(target, theory, theory, size=SMALL, progress=give_up)
    assert target.read_bytes() == b"the old one"
    assert list(tmp_path.iterdir()) == [target]


def test_motions_at_different_times_are_refused(theory: rb.Motion) -> None:
    late = dataclasses.replace(theory, times=theory.times * 1.01)
    with pytest.raises(rb.InputError, match="same times"):
        frames(late, theory)


@pytest.mark.parametrize("path", ["ball.gif", "no/such/folder/ball.mp4"])
def test_a_path_that_can_be_no_video_is_refused(path: str, theory: rb.Motion) -> None:
    with pytest.raises(rb.InputError, match=r"\.mp4"):
        write_video(path, theory, theory)


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
    code = "import sys, robotball; print([m for m in sys.modules if m in ('mediapy', 'PIL')])"
    child = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert child.stdout.strip() == "[]"


def _angles(p: Array, q: Array) -> Array:
    """The angles [rad] between attitudes (..., 4)."""
    between = multiply(p.reshape(-1, 4), conjugate(q.reshape(-1, 4)))
    return np.asarray(Rotation.from_quat(between, scalar_first=True).magnitude())


def _share(picture: Pixels, colour: str) -> float:
    """The share of the pixels in which a colour's strongest channel stands out, as in the ball."""
    wanted = np.array(palette.rgb(colour))
    strong, weak = int(wanted.argmax()), int(wanted.argmin())
    return float((picture[..., strong].astype(int) - picture[..., weak] > 60).mean())
