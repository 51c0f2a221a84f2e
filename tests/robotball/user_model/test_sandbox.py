"""Bodies of MJCF and URDF files agree with MuJoCo or are refused in one line.

A small file can make MuJoCo run forever, so time and memory are limited.
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
    """Write the text to `arm.urdf` or `model.xml` and return the path."""
    path = folder / ("arm.urdf" if "<robot" in text else "model.xml")
    path.write_text(text)
    return path


def work_here(monkeypatch: pytest.MonkeyPatch) -> dict[int, tuple[int, int]]:
    """Run the work of the subprocess in this process, and return the limits that it sets."""
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
    """The limits set by the subprocess, whose work runs in this process."""
    return work_here(monkeypatch)


def mjcf(inside: str = "", before: str = "") -> str:
    body = f'<body name="b"><geom size="1" mass="1"/>{inside}</body>'
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


def test_a_link_agrees_with_the_compiled_body_of_mujoco(
    tmp_path: Path, at_once: dict[int, tuple[int, int]]
) -> None:
    """MuJoCo fuses links at a fixed joint. Measured 5e-17 kg m², of 0.007: rounding."""
    ours = solid_of_file(written(tmp_path, URDF), "link", "arm")
    theirs = mujoco.MjModel.from_xml_string(URDF).body("arm")
    axes = Rotation.from_quat(theirs.iquat, scalar_first=True).as_matrix()
    assert ours.mass == pytest.approx(1.3, rel=1e-15)
    np.testing.assert_allclose(ours.centre, theirs.ipos, atol=1e-16)
    np.testing.assert_allclose(ours.inertia, axes @ np.diag(theirs.inertia) @ axes.T, atol=2e-16)
    assert (at_once[resource.RLIMIT_CPU], at_once[resource.RLIMIT_CORE]) == ((5, 5), (0, 0))
    assert sys.platform != "linux" or at_once[resource.RLIMIT_AS][0] > 500_000_000


def test_a_body_of_mjcf_includes_bodies_that_are_fixed_to_it(tmp_path: Path) -> None:
    """In body axes, at any pose: 2 kg, and 2 kg in a rotated child body.

    The limits allow a hundred geoms. Expected inertias are from the parallel axis theorem.
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
def test_any_body_of_a_scene_may_come_from_a_file(tmp_path: Path) -> None:
    """With an origin and an attitude: a rotation by 90° about x takes y to z.

    Unused links may be ones that MuJoCo cannot compile.
    """
    mesh = '<collision><geometry><mesh filename="none.stl"/></geometry></collision>'
    path = written(tmp_path, URDF.replace("/>", f">{mesh}</link>", 1))
    arm = solid_of_file(path, "link", "arm")
    half = repr(np.sqrt(0.5).item())
    placed = f"origin = [0, 0, 0.05], attitude = [{half}, {half}, 0, 0] }}\n"
    hung = robot(rest=PENDULUM + 'urdf = { file = "arm.urdf", link = "arm", ' + placed)
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
# Facts of the refusal: text of the file with link `arm` or body `b`.
URDFS = {
    "link 'arm' base leg": URDF.replace('"arm"', '"leg"'),
    "link 'arm' 'bob'": URDF.replace('"fixed"', '"continuous"'),
    "line~1 closed": "<robot>",
    "URDF <mujoco> <robot>": "<mujoco/>",
    "'value'": URDF.replace('"0.8"', '"heavy"'),
    "value 'nan'": URDF.replace('"0.8"', '"nan"'),
    "xyz '-inf": URDF.replace('xyz="0.01', 'xyz="-inf'),
    "'arm' mass 0~kg": URDF.replace('"0.8"', '"0"'),
    "URDF multiple~parents": URDF.replace(SECOND, '<child link="arm"/>'),
    "URDF parent child missing": URDF.replace(SECOND, '<child link="bab"/>'),
}
NAMED = "".join(f'<body name="n{i}"><geom size="1"/></body>' for i in range(30))
NAN = mjcf('<body pos="nan 0 0"><geom size="1"/></body>')
MJCFS = {
    # MuJoCo reads these as missing, or as an angle of zero.
    "model.xml pos 'nan~0~0'": NAN,
    "euler 'inf~0~0'": mjcf('<body euler="inf 0 0"><geom size="1"/></body>'),
    "mass '-NaN'": mjcf("<geom size='1' mass='-NaN'/>"),
    "density 'Infinity'": mjcf(before='<default><geom density="Infinity"/></default>'),
    "inside.xml pos 'nan~0~0'": '<mujoco><include file="parts/inside.xml"/></mujoco>',
    "body 'b' 'c'": mjcf('<body name="c"><joint/><geom size="1"/></body>'),
    "body 'b' mass": mjcf().replace('mass="1"', 'mass="0"'),
    "line~2 closed": "<mujoco>\n<worldbody>",
    "line~3 <body> closed": "<mujoco>\n<worldbody>\n<body></worldbody></mujoco>",
    "line~2 <option> value quotes": "<mujoco>\n<option timestep=1/></mujoco>",
    "line~2 <option> 'speed'": '<mujoco>\n<option speed="1"/></mujoco>',
    "unrecognized~attribute": mjcf(f'<geom {"k" * 4000}="1"/>'),
    "body 'b' 31 c n0": mjcf(NAMED).replace('"b"', '"c"'),
}


def refusal(body: tuple[str, str], text: str, folder: Path) -> str:
    """Return the message that refuses the body of a file with this text."""
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
    [*((ARM, *item) for item in URDFS.items()), *((B, *item) for item in MJCFS.items())],
    ids=[*URDFS, *MJCFS],
)
def test_an_unusable_file_is_refused(
    tmp_path: Path, body: tuple[str, str], facts: str, text: str
) -> None:
    """In a short line that names the file, or the included file."""
    message = refusal(body, text, tmp_path)
    assert unnamed(facts, message) == []
    assert len(message) <= 500


@pytest.mark.usefixtures("at_once")
def test_infinite_ranges_and_names_like_nan_are_allowed(tmp_path: Path) -> None:
    """As is any text in a comment, in any encoding."""
    hinge = '<body name="inf"><joint name="nan" range="-inf inf"/><geom size="1"/></body>'
    motor = '<actuator><motor joint="nan" ctrlrange="-inf inf"/></actuator>'
    path = written(tmp_path, mjcf(hinge).replace("</mujoco>", motor + "</mujoco>"))
    comment = "<!-- é mass='nan' -->".encode("latin-1")
    path.write_bytes(comment + path.read_bytes())
    assert solid_of_file(path, "body", "inf").mass > 0


def test_a_file_name_that_cannot_be_encoded_is_refused_with_the_locale(tmp_path: Path) -> None:
    """Such as a non-ASCII name under LC_ALL=C; the memory limit is not the cause."""
    with pytest.raises(rb.InputError, match=naming("locale LC_ALL=C.UTF")):
        solid_of_file(written(tmp_path, URDF).rename(tmp_path / "\udcc3.urdf"), "link", "arm")


HEIGHTS = '<asset><hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/></asset>'


@pytest.mark.parametrize("before", ['<size memory="100G"/>', HEIGHTS])
def test_a_file_that_needs_too_much_memory_is_refused(tmp_path: Path, before: str) -> None:
    """With either error of MuJoCo at the limit; on an overloaded machine after 60 s."""
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
def test_a_subprocess_that_ends_early_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: int | None, facts: str
) -> None:
    """At its CPU time limit, for lack of memory, or after a timeout."""
    done = subprocess.CompletedProcess("", end or 0, b"", b"first\nlast words\n")
    late = subprocess.TimeoutExpired("", 60)
    monkeypatch.setattr(subprocess, "run", Mock(side_effect=[late if end is None else done]))
    with pytest.raises(rb.InputError, match=naming(facts)):
        solid_of_file(written(tmp_path, mjcf()), "body", "b")
