"""Names with markup are text in every page."""

import json
from pathlib import Path

import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.pages import Page
from validation import compare
from validation.report.scene_report import report

# A body, a joint and an actuator with markup in their names.
HOSTILE = """<mujoco model="&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;">
<option timestep=".005" integrator="RK4" cone="elliptic"/><worldbody>
<geom name="floor" type="plane" size="5 5 .1"/>
<body name="shell&lt;!--&lt;script&gt;" pos="0 0 .1"><freejoint/>
<geom type="sphere" size=".1" mass="1"/>
<body name="a&quot;&gt;&lt;img src=x onerror=a()&gt;&lt;!--&lt;script&gt;">
<joint name="h&lt;svg onload=a()&gt;" axis="0 1 0"/>
<geom type="box" size=".02 .02 .02" pos="0 0 -.04" mass=".5" contype="0" conaffinity="0"/></body>
</body></worldbody><actuator>
<velocity name="m&lt;script&gt;a()&lt;/script&gt;" joint="h&lt;svg onload=a()&gt;" kv=".1"/>
</actuator></mujoco>"""
MARKUP = "<!--<script>"


def bodies_in(page: str) -> list[str]:
    """Return the names of the bodies in the views of a page, like its scripts read them.

    Check that no element or attribute has a name of the file.
    """
    parsed = Page(page)
    assert not {"onerror", "onload"} & parsed.found
    data = [script for script in parsed.scripts if script.startswith("{")]
    # After `<!--<script>` browsers read `</script>` as text, unlike some parsers of Python.
    assert not any("<" in script for script in data)
    return [body["name"] for script in data for body in json.loads(script)["bodies"]]


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Write the file of the hostile robot."""
    path = tmp_path / "robot.xml"
    path.write_text(HOSTILE)
    return path


def test_the_page_of_a_view_has_hostile_names_as_text(robotball: Robotball, robot: Path) -> None:
    status, _, complaint = robotball("view", "--web", robot, "--duration", "0.1")
    assert status == 0, complaint
    (page,) = Path("out").glob("*.html")
    assert MARKUP in bodies_in(page.read_text(encoding="utf-8"))[1]


def test_the_page_of_a_check_has_hostile_names_as_text(robotball: Robotball, robot: Path) -> None:
    status, _, complaint = robotball("check", robot, "--duration", "0.1")
    assert status in (0, 1), complaint
    assert MARKUP in bodies_in(Path("out/robot-check.html").read_text(encoding="utf-8"))[1]


def test_a_report_has_hostile_names_as_text(robot: Path) -> None:
    """It includes names and values of plots in attributes."""
    scene = rb.load_scene(robot).until(0.1)
    page = report([compare(scene, settings="fast")], f"robotball report {MARKUP}")
    assert MARKUP in bodies_in(page)[1]
