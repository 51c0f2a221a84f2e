"""`check` answers questions that people asked in public about balls in simulators.

The files are our own, with the numbers of the questions. The truth is a formula.
"""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.user_model import UserModel
from robotball.robot.drives import Constant
from robotball.user_model import robot_file
from robotball.user_model.robot_file import friction_source, open_robot
from tests.messages import naming, unnamed
from tests.validation.check.test_check import silent
from validation.check.ablate import Checked, check_model
from validation.check.say import causes_of

G = 9.81  # m/s²
FLOOR = '<geom name="floor" type="plane" size="9 9 .1"/>'


def ball(radius: float, start: str = "", *, floor: str = FLOOR, **of: str) -> str:
    """Return the file of a solid ball on a floor. start: its qvel.

    of: at, quat, joint and inertial of its body; others are attributes of the geom.
    """
    body = f'pos="{of.pop("at", f"0 0 {radius}")}" quat="{of.pop("quat", "1 0 0 0")}"'
    joint, inertial = of.pop("joint", "<freejoint/>"), of.pop("inertial", "")
    more = " ".join(f'{name}="{value}"' for name, value in of.items())
    key = f'<keyframe><key qvel="{start}"/></keyframe>' if start else ""
    return f"""<mujoco><worldbody>{floor}<body name="body" {body}>{joint}{inertial}
<geom name="ball" type="sphere" size="{radius}" {more}/></body></worldbody>{key}</mujoco>"""


def arm(joint: str = "", option: str = "", actuator: str = "motor", head: str = "") -> str:
    """Return the file of a ball with a weight on a hinge inside, which `drive` moves."""
    return f"""<mujoco>{head}<option {option}/><worldbody>{FLOOR}<body pos="0 0 .15"><freejoint/>
<geom name="ball" type="sphere" size=".15" mass="1"/>
<body name="arm"><joint name="hinge" axis="0 1 0" {joint}/>
<inertial pos="0 0 -.01" mass=".3" diaginertia="1e-4 1e-4 1e-4"/></body></body></worldbody>
<actuator><{actuator} name="drive" joint="hinge"/></actuator></mujoco>"""


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the subprocess that loads a file first."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)


def checked(folder: Path, text: str, duration: float = 1.0, **controls: float) -> Checked:
    path = folder / "robot.xml"
    path.write_text(text)
    drives = {name: Constant(value) for name, value in controls.items()}
    return check_model(UserModel(open_robot(path), drives, None), None, duration, 1e-3, silent)


def test_a_ball_rolls_down_a_tilted_box_as_down_a_plane(tmp_path: Path) -> None:
    """By 5/14 g sin 30° in 1 s, to 1e-6. Before, a tilted box was refused."""
    ramp = '<geom type="box" size="20 5 .5" euler="0 30 0"/>'
    answer = checked(tmp_path, ball(0.5, floor=ramp, at="0.5 0 0.8660254"))
    assert answer.observation.theory.path_length == pytest.approx(5 / 14 * G / 2, rel=1e-5)
    assert answer.observation.error < 5e-3  # 2.2e-3: the contact is soft


def test_a_ball_on_a_ramp_beyond_7_2_of_its_friction_slides(tmp_path: Path) -> None:
    """With 45°, friction 0.2 and a need of 2/7."""
    steep = '<geom type="plane" size="9 9 .1" euler="0 45 0" friction=".2 .005 .0001"/>'
    answer = checked(
        tmp_path, ball(0.1, floor=steep, at="0.0707107 0 0.0707107", friction=".2 .005 .0001")
    )
    assert unnamed("friction 0.2 0.29", causes_of(answer)[0]) == []


def test_a_bowling_ball_slides_for_two_sevenths_of_its_speed_over_its_friction(
    tmp_path: Path,
) -> None:
    """For 1.2417 s, to 5/7 of 8.1 m/s; the interval is right to a sample of 0.01 s or better."""
    lane = FLOOR.replace("/>", ' friction=".19 .005 .0001"/>')
    text = ball(0.11, "8.1 0 0 0 0 0", floor=lane, mass="6", friction=".19 .005 .0001")
    theory = checked(tmp_path, text, 1.5).observation.theory
    assert theory.slipping[-1][1] == pytest.approx(2 * 8.1 / (7 * 0.19 * G), rel=1e-6)
    speed = np.diff(theory.contact_point[-2:, 0])[0] / np.diff(theory.times[-2:])[0]
    assert speed == pytest.approx(5 / 7 * 8.1, rel=1e-6)


def test_the_pyramid_is_named_that_pulls_a_pool_ball_aside(tmp_path: Path) -> None:
    """Before, the cause was only that the contact lifts the ball and holds it too late."""
    cloth = FLOOR.replace("/>", ' friction=".2 .005 .0001"/>')
    text = ball(0.028575, "2 .8 0 0 0 0", floor=cloth, mass=".17", friction=".2 .005 .0001")
    assert unnamed("slip aside", causes_of(checked(tmp_path, text, 2.0))[0]) == []


def test_a_friction_of_zero_does_not_let_a_ball_glide_on_a_rough_floor(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(ball(0.0375, mass=".067", condim="6", friction="0 0 0"))
    assert unnamed("larger floor~(1) ball~(0)", friction_source(open_robot(path))) == []


def test_the_axes_of_qvel_are_named_if_a_start_rolls_in_world_axes(tmp_path: Path) -> None:
    """A yaw of 90°, and (0, 10, 0) rad/s: a slip of 1.41 m/s. Before, the cause was the cone."""
    text = ball(0.1, "1 0 0 0 10 0", quat=".70710678 0 0 .70710678", mass="1")
    facts = "axes 1.41~m/s world body qvel"
    assert unnamed(facts, causes_of(checked(tmp_path, text, 0.5))[0]) == []
    text = text.replace("1 0 0 0 10 0", "1 0 0 0 5 0")
    assert causes_of(checked(tmp_path, text, 0.5))[0].partition(":")[0] != "axes"


def test_a_gain_is_the_cause_of_a_file_that_diverges_and_not_a_gear(tmp_path: Path) -> None:
    """RK4 takes damping explicitly: 0.4·0.002/1.21e-4 = 6.6, above 2.79. Before: the gear."""
    answer = checked(tmp_path, arm('damping=".4"', 'integrator="RK4"'), drive=0.05)
    assert answer.mended_error < 1e-3  # 3e-4: the contact is soft
    assert unnamed("gain damping 6.59 2.79 implicitfast", causes_of(answer)[0]) == []


def test_a_ball_that_sinks_is_not_only_off_its_path(tmp_path: Path) -> None:
    """Friction 8 and a pyramidal cone: it sinks by 0.7 m. Before: "does not agree"."""
    rough = FLOOR.replace("/>", ' friction="8"/>')
    answer = checked(tmp_path, ball(0.1, "1 0 0 0 10 0", floor=rough))
    assert unnamed("sinks m", answer.observation.failure or "") == []
    assert unnamed("cone pyramid", causes_of(answer)[0]) == []
    assert answer.mended_error < 1e-3  # 5e-4: the contact is soft


def test_a_football_is_told_what_would_stop_it(tmp_path: Path) -> None:
    """Within 10 s from 1.5 m/s: a r(1 + k)/g = 0.00235 m, right to the reference's 1e-5."""
    text = ball(0.11, f"1.5 0 0 0 {1.5 / 0.11} 0", mass=".45")
    resistance = checked(tmp_path, text).resistance
    assert resistance is not None
    assert resistance.friction == pytest.approx(0.15 * 0.11 * 1.4 / G, rel=1e-4)


def test_a_ball_that_rocks_is_not_said_to_roll_for_ever(tmp_path: Path) -> None:
    """Before: "it keeps 1.11 m/s", of which MuJoCo "delivers 1488 %"."""
    offset = '<inertial pos=".1 .1 0" mass="10" diaginertia="1 1 1"/>'
    answer = checked(tmp_path, ball(0.5, inertial=offset))
    assert answer.resistance is None
    x, y = answer.observation.theory.contact_point[-1]
    assert x == pytest.approx(y, rel=1e-6)  # it rocks along the diagonal


SLAB = '<geom name="slab" type="box" size=".1 .1 .01" pos="0 0 .05" euler="0 30 0"/>'
TOWER = """<body name="tower" pos="0 0 .33"><freejoint/><geom type="cylinder" size=".1 .1"/>
<geom name="foot" size=".03" pos="0 0 -.11"/></body>"""
SLIDES = '<joint name="slide_x" type="slide" axis="1 0 0"/><joint name="turn" axis="0 0 1"/>'
REFUSED = {
    "a ramp below": (ball(0.01, floor=FLOOR + SLAB, at="0 0 .3"), "slab 0.29~m above plane"),
    "a tower on top": (ball(0.1, floor=FLOOR + TOWER, at="0 0 .1"), "tower moves one~robot"),
    "slides": (ball(0.1, joint=SLIDES), "<freejoint/> place slide_x, turn"),
    "no weight": (ball(0.1).replace("<body ", '<body gravcomp="1" '), "gravcomp weight plane"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_names_what_the_file_has_and_the_equations_do_not(
    name: str, tmp_path: Path
) -> None:
    text, facts = REFUSED[name]
    with pytest.raises(rb.InputError, match=naming(facts)):
        checked(tmp_path, text)


def test_a_range_of_many_turns_may_be_in_degrees(tmp_path: Path) -> None:
    """90 rad each way are 28.6 turns, and a command of 45 rad lifts the ball off."""
    radian = '<compiler angle="radian"/>'
    text = arm('range="-90 90"', 'integrator="implicitfast"', 'position kp="30" kv=".3"', radian)
    with pytest.raises(rb.InputError, match=naming("lifts range -90 90 28.6~turns degree")):
        checked(tmp_path, text, drive=45)
