"""A body of somebody else's MJCF or URDF file is MuJoCo's body, or is refused in a line.

What a few lines may ask of MuJoCo is limited to a few seconds and a few hundred MB.
"""

import contextlib
import io
import resource
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.user_model import sandbox
from robotball.user_model.robot_file import solid_of_file
from tests.messages import naming, unnamed
from tests.robotball.scene_files.scene_texts import PENDULUM, URDF, robot, scene_of


def written(folder: Path, text: str) -> Path:
    """A file of this text: `arm.urdf`, or `model.xml` where it is MJCF."""
    path = folder / ("arm.urdf" if "<robot" in text else "model.xml")
    path.write_text(text)
    return path


def work_here(monkeypatch: pytest.MonkeyPatch) -> dict[int, tuple[int, int]]:
    """Run the work of another process in this one, and return the limits that it had."""
    limits: dict[int, tuple[int, int]] = {}

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[bytes]:
        monkeypatch.setattr(sys, "argv", command[3:])
        with contextlib.redirect_stdout(io.StringIO()) as answer:
            runpy.run_path(sandbox.__file__, run_name="__main__")
        return subprocess.CompletedProcess(command, 0, answer.getvalue().encode())

    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    monkeypatch.setattr(subprocess, "run", run)
    return limits


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> dict[int, tuple[int, int]]:
    """Runs the work of another process in this one; gives the limits that it had."""
    return work_here(monkeypatch)


def mjcf(inside: str = "", before: str = "") -> str:
    body = f'<body name="b"><geom size="1" mass="1"/>{inside}</body>'
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


def test_a_link_is_mujocos_body_of_the_same_file(
    tmp_path: Path, at_once: dict[int, tuple[int, int]]
) -> None:
    """Compiled, MuJoCo fuses what a fixed joint holds. Measured 5e-17 of 0.007 kg m²: rounding."""
    ours = solid_of_file(written(tmp_path, URDF), "link", "arm")
    theirs = mujoco.MjModel.from_xml_string(URDF).body("arm")
    axes = Rotation.from_quat(theirs.iquat, scalar_first=True).as_matrix()
    assert ours.mass == pytest.approx(1.3, rel=1e-15)
    np.testing.assert_allclose(ours.centre, theirs.ipos, atol=1e-16)
    np.testing.assert_allclose(ours.inertia, axes @ np.diag(theirs.inertia) @ axes.T, atol=2e-16)
    assert (at_once[resource.RLIMIT_CPU], at_once[resource.RLIMIT_CORE]) == ((5, 5), (0, 0))
    assert at_once[resource.RLIMIT_AS][0] > 500_000_000


def test_a_body_of_mjcf_has_what_is_fixed_to_it(tmp_path: Path) -> None:
    """In its own axes, wherever it is: of 2 kg, and of 2 kg that are turned beside it.

    Limits leave room for a hundred geoms. Inertias are by hand, after Steiner.
    """
    inside = (
        '<replicate count="100"><geom size=".1" mass=".01"/></replicate>'
        '<body pos="3 0 0" euler="0 0 90"><geom size="1" pos="0 1 0" mass="2"/></body>'
    )
    text = mjcf(inside).replace('<body name="b">', '<body name="b" pos="1 2 3" euler="30 20 10">')
    solid = solid_of_file(written(tmp_path, text), "body", "b")
    assert solid.mass == pytest.approx(4.0, rel=1e-13)
    along = 0.4 * (1 + 2 + 0.1**2)
    np.testing.assert_allclose(solid.centre, [1.0, 0.0, 0.0], atol=3e-15)
    np.testing.assert_allclose(solid.inertia, np.diag([along, along + 4, along + 4]), atol=1e-13)


@pytest.mark.usefixtures("at_once")
def test_any_body_is_taken_from_a_file(tmp_path: Path) -> None:
    """Laid at its origin and attitude: a quarter turn about x takes y to z.

    A link of which nobody asked may be one that MuJoCo would not compile.
    """
    mesh = '<collision><geometry><mesh filename="none.stl"/></geometry></collision>'
    path = written(tmp_path, URDF.replace("/>", f">{mesh}</link>", 1))
    arm = solid_of_file(path, "link", "arm")
    half = repr(np.sqrt(0.5).item())
    laid = f"origin = [0, 0, 0.05], attitude = [{half}, {half}, 0, 0] }}\n"
    hung = robot(rest=PENDULUM + 'urdf = { file = "arm.urdf", link = "arm", ' + laid)
    pendulum = scene_of(hung, path.parent).ball.pendulums[0]
    x, y, z = arm.centre
    np.testing.assert_allclose(pendulum.centre, [x, -z, y + 0.05], atol=1e-16)
    moments = np.linalg.eigvalsh(pendulum.inertia)
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(arm.inertia), rtol=1e-13)
    written(tmp_path, mjcf())
    whole = 'mjcf = { file = "model.xml", body = "b", origin = [0, 0.01, 0] }'
    shell = scene_of(robot(shell=f"[shell]\nradius = 2\naxis = [0, 1, 0]\n{whole}\n"), tmp_path)
    assert (shell.ball.shell.mass, shell.ball.shell.offset) == (1.0, 0.01)
    assert shell.ball.shell.axial_inertia == pytest.approx(0.4, rel=1e-15)


ARM, B = ("link", "arm"), ("body", "b")
SECOND = '<child link="bob"/>'
# By what is refused of a link `arm`, and of a body `b`.
URDFS = {
    "link 'arm' base leg": URDF.replace('"arm"', '"leg"'),
    "link 'arm' 'bob'":
        URDF.replace('"fixed"', '"continuous"'),
    "XML~parse~error": "<robot>",
    "URDF <mujoco> <robot>": "<mujoco/>",
    "'value'": URDF.replace('"0.8"', '"heavy"'),
    "value 'nan'": URDF.replace('"0.8"', '"nan"'),
    "xyz '-inf": URDF.replace('xyz="0.01', 'xyz="-inf'),
    "'arm' mass 0~kg": URDF.replace('"0.8"', '"0"'),
    "URDF multiple~parents": URDF.replace(SECOND, '<child link="arm"/>'),
    "URDF parent child missing": URDF.replace(SECOND, '<child link="bab"/>'),
}  # fmt: skip
NAMED = "".join(f'<body name="n{i}"><geom size="1"/></body>' for i in range(30))
NAN = mjcf('<body pos="nan 0 0"><geom size="1"/></body>')
MJCFS = {
    # What MuJoCo reads as not given, or as an angle of zero.
    "model.xml pos 'nan~0~0'": NAN,
    "euler 'inf~0~0'":
        mjcf('<body euler="inf 0 0"><geom size="1"/></body>'),
    "mass '-NaN'": mjcf("<geom size='1' mass='-NaN'/>"),
    "density 'Infinity'":
        mjcf(before='<default><geom density="Infinity"/></default>'),
    "inside.xml pos 'nan~0~0'":
        '<mujoco><include file="parts/inside.xml"/></mujoco>',
    "body 'b' 'c'":
        mjcf('<body name="c"><joint/><geom size="1"/></body>'),
    "body 'b' mass": mjcf().replace('mass="1"', 'mass="0"'),
    "XML~parse~error": "<mujoco>",
    "unrecognized~attribute": mjcf(f'<geom {"k" * 4000}="1"/>'),
    "body 'b' 31 c n0": mjcf(NAMED).replace('"b"', '"c"'),
}  # fmt: skip


def refusal(body: tuple[str, str], text: str, folder: Path) -> str:
    """Return the message with which a body of a file with this text is refused."""
    path = written(folder, text)
    (path.parent / "parts").mkdir(exist_ok=True)
    (path.parent / "parts" / "inside.xml").write_text(NAN)
    with pytest.raises(rb.InputError) as refused:
        solid_of_file(path, *body)
    message = str(refused.value)
    assert str(path) in message
    return message


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(
    ("body", "facts", "text"),
    [*((ARM, *each) for each in URDFS.items()), *((B, *each) for each in MJCFS.items())],
    ids=[*URDFS, *MJCFS],
)
def test_a_file_that_cannot_be_used_is_refused(
    tmp_path: Path, body: tuple[str, str], facts: str, text: str
) -> None:
    """In a short line that names the file, or one that it includes."""
    message = refusal(body, text, tmp_path)
    assert unnamed(facts, message) == []
    assert len(message) <= 500


@pytest.mark.usefixtures("at_once")
def test_a_range_without_end_and_a_name_are_no_numbers(tmp_path: Path) -> None:
    """Nor is anything in a comment, whatever its encoding."""
    hinge = '<body name="inf"><joint name="nan" range="-inf inf"/><geom size="1"/></body>'
    motor = '<actuator><motor joint="nan" ctrlrange="-inf inf"/></actuator>'
    path = written(tmp_path, mjcf(hinge).replace("</mujoco>", motor + "</mujoco>"))
    comment = "<!-- é mass='nan' -->".encode("latin-1")
    path.write_bytes(comment + path.read_bytes())
    assert solid_of_file(path, "body", "inf").mass > 0


def test_a_name_that_is_no_text_is_refused_as_such(tmp_path: Path) -> None:
    """As under LC_ALL=C a name beyond ASCII is: it has nothing to do with memory."""
    with pytest.raises(rb.InputError, match=naming("locale LC_ALL=C.UTF")):
        solid_of_file(written(tmp_path, URDF).rename(tmp_path / "\udcc3.urdf"), "link", "arm")


HEIGHTS = '<asset><hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/></asset>'


@pytest.mark.parametrize("before", ['<size memory="100G"/>', HEIGHTS])
def test_a_file_that_takes_much_memory_is_given_up(tmp_path: Path, before: str) -> None:
    """By MuJoCo's own error at the limit, of either kind; on a starved machine after 60 s."""
    with pytest.raises(rb.InputError, match=r"500 MB|60 s"):
        solid_of_file(written(tmp_path, mjcf(before=before)), "body", "b")


@pytest.mark.parametrize(
    ("end", "facts"),
    [
        (-signal.SIGXCPU, "5~s"),
        (-signal.SIGKILL, "5~s"),
        (1, "500~MB last~words"),
        (None, "60~s"),
    ],
)
def test_a_process_that_ends_early_is_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: int | None, facts: str
) -> None:
    """At the limit of its processor time, by lack of memory, or after it was starved."""
    done = subprocess.CompletedProcess("", end or 0, b"", b"first\nlast words\n")
    late = subprocess.TimeoutExpired("", 60)
    monkeypatch.setattr(subprocess, "run", Mock(side_effect=[late if end is None else done]))
    with pytest.raises(rb.InputError, match=naming(facts)):
        solid_of_file(written(tmp_path, mjcf()), "body", "b")
