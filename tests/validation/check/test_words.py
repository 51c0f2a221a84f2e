"""What `check` says: repairs, defaults, numbers that no robot has, rows, pictures, refusals."""

import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.user_model import UserModel
from robotball.user_model import robot_file
from robotball.user_model.mended_file import Change
from robotball.user_model.robot_file import default_class, friction_source, open_robot
from tests.messages import naming, unnamed
from tests.validation.check.planted_robots import planted
from tests.validation.check.test_check import own_loop, silent
from validation.check.ablate import Checked, check_model
from validation.check.observe import unusual_inertias
from validation.check.say import causes_of, difference, study_of
from validation.study import Study


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the subprocess that loads a file first."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)


def checked(folder: Path, text: str, duration: float = 1.0) -> Checked:
    path = folder / "robot.xml"
    path.write_text(text)
    return check_model(UserModel(open_robot(path), {}, None), None, duration, 1e-3, silent)


def rows_of(study: Study) -> dict[str, str]:
    return {row["change"]: row["words"] for row in study.rows}


REPAIRS = {
    "freejoint missing": ("<freejoint/>", "freejoint ball joint <freejoint/>"),
    "freejoint damped": ("<freejoint/>", "freejoint damping 0.3 class main ball <freejoint/>"),
    "floor missing": ('<geom type="plane"', "floor plane"),
}


@pytest.mark.parametrize("mistake", REPAIRS)
def test_a_file_that_cannot_roll_does_not_agree_and_its_mended_file_does(
    mistake: str, tmp_path: Path
) -> None:
    """Before, a missing part was added in silence, and the file agreed. Mended: below 1e-3."""
    new, facts = REPAIRS[mistake]
    record = checked(tmp_path, planted("gimbal", mistake))
    assert not record.agrees
    assert unnamed(facts, causes_of(record)[0]) == []
    assert "+ " + mistake.split()[0] in rows_of(study_of(record, []))
    added = [line for line in difference(record) if re.match(rf"\+(?!\s*<!--).*{new}", line)]
    assert len(added) == 1
    mended = tmp_path / "mended.xml"
    mended.write_text(record.text)
    model = mujoco.MjModel.from_xml_path(str(mended))
    assert (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE.value).sum() == 1
    assert not model.dof_damping[:6].any()
    theory = record.observation.theory
    away = np.abs(own_loop(mended, theory.times) - theory.contact_point).max()
    assert away < 1e-3 * theory.path_scale


WRONG = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="ball" pos="0 0 .16">
    {joint}
    <geom type="sphere" size=".15" mass=".6"/>
    <body name="plate">
      <joint name="axle" axis="0 1 0"/>
      <inertial pos="0 0 -.05" mass=".8" diaginertia="700 700 700"/>
      <geom type="box" size=".05 .05 .01" pos="0 0 -.05" contype="0" conaffinity="0"/>
    </body>
  </body>
</worldbody><actuator><motor name="drive" joint="axle"/></actuator>
<keyframe><key ctrl=".1"/></keyframe></mujoco>"""


@pytest.mark.parametrize("joint", ["", '<joint type="free" name="root" damping=".1"/>'])
def test_each_changed_tag_has_its_comment_on_the_line_above(joint: str, tmp_path: Path) -> None:
    """Before, only the change of the free joint had one, in the line of its body."""
    lines = checked(tmp_path, WRONG.format(joint=joint)).text.splitlines()
    body = next(i for i, line in enumerate(lines) if "<body name" in line)
    free = '    <freejoint name="root"/>' if joint else '  <body name="ball" pos="0 0 0.15"><'
    assert lines[body] == '  <body name="ball" pos="0 0 0.15">' + "<freejoint/>" * (not joint)
    for tag, name in (("<body name", "start"), (free, "freejoint"), ("<inertial", "inertia")):
        at = next(i for i, line in enumerate(lines) if tag in line)
        indent = lines[at].partition("<")[0]
        above = [line for line in lines[at - 2 : at] if line.startswith(f"{indent}<!-- {name}: ")]
        assert len(above) == 1
    assert unnamed("placeholder", next(line for line in lines if "<!-- inertia" in line)) == []


DEFAULTS = """<mujoco><default><default class="ice"><geom friction=".2 .005 .0001" condim="4"
solref=".05 1"/></default></default><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body pos="0 0 .1"><freejoint/><geom name="ball" class="ice" size=".1" mass="1" {}/></body>
</worldbody></mujoco>"""


def test_what_a_default_class_sets_is_told_with_its_class(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(DEFAULTS.format(""))
    robot = open_robot(path)
    assert unnamed("floor~(1) ball~(0.2) friction class~ice", friction_source(robot)) == []
    for kind in ("condim", "solref"):
        assert unnamed(f"{kind} class~ice", default_class(robot, kind)) == []
    assert default_class(robot, "margin") == ""
    path.write_text(DEFAULTS.format('friction=".3 .005 .0001"'))
    assert "ice" not in friction_source(open_robot(path))


INERTIAL = '<inertial mass="{}" pos="0 0 {}" diaginertia="{} {} {}"/>'
INERTIAS = {
    # 0.6 kg within 0.15 m: at most 0.0135 kg m² about the middle, 0.0054 for a solid ball.
    "at most": ((0.6, 0, *3 * (0.0134,)), None, ""),
    "above": ((0.6, 0, *3 * (0.0136,)), True, "0.0136 0.6~kg 0.15~m 0.013"),
    "aside": ((0.6, -0.1, *3 * (0.0076,)), True, "0.0076 0.15~m 0.0075"),
    "outside": ((0.6, -30, *3 * (0.001,)), True, "30~m 0.15~m"),
    "small": ((0.6, 0, *3 * (5.3e-5,)), False, "5.3e-05 0.0054"),
    "not small": ((0.6, 0, *3 * (5.5e-5,)), None, ""),
}
IMPOSSIBLE = {
    "diaginertia": ('diaginertia="700 700 700"', "700 0.8~kg 0.15~m 0.016 0.0017"),
    "fullinertia": ('fullinertia="1 1 1 .1 0 0"', "1.1 0.8~kg 0.15~m 0.016 0.0017"),
}


@pytest.mark.parametrize("attribute", IMPOSSIBLE)
def test_an_impossible_inertia_gets_a_value_in_the_mended_file(
    attribute: str, tmp_path: Path
) -> None:
    """0.0017 = 2/5 m r² of the plate's box, below m (r² - c²). The rest of the file agrees."""
    numbers, facts = IMPOSSIBLE[attribute]
    inertial = f'<inertial pos="0 0 -.05" mass=".8" {numbers}/>'
    record = checked(
        tmp_path, planted("pendulum").replace('damping=".01"/>', f'damping=".01"/>{inertial}')
    )
    assert not record.agrees
    assert unnamed(f"inertia plate {facts}", causes_of(record)[0]) == []
    assert "+ inertia" in rows_of(study_of(record, []))
    model = mujoco.MjModel.from_xml_string(record.text)
    assert model.body("plate").inertia == pytest.approx(3 * [0.4 * 0.8 * 0.00515625], rel=1e-3)
    assert model.body("ball").inertia == pytest.approx(3 * [0.4 * 0.6 * 0.15**2])


FAR = {
    "centre": ("0 0 -0.05", "0 0 -30", "30~m"),
    "plate": ("0.05 0.05 0.0125", "50 50 .0125", "plate 40.8~m 0.15~m"),
}


@pytest.mark.parametrize("name", FAR)
def test_a_part_far_outside_the_sphere_is_unusual(name: str, tmp_path: Path) -> None:
    """A geom at 30 m below a sphere of 0.15 m, or of 50 m, without contacts."""
    old, new, facts = FAR[name]
    text = planted("pendulum")
    assert old in text
    assert (
        unnamed(f"inertia {facts}", causes_of(checked(tmp_path, text.replace(old, new)))[0]) == []
    )


def test_a_mass_that_no_sphere_holds_is_named(tmp_path: Path) -> None:
    """700.6 kg in a sphere of 0.15 m are 49 600 kg/m³; osmium has 22 600."""
    text = planted("pendulum").replace('mass="0.8"', 'mass="700"')
    cause = causes_of(checked(tmp_path, text))[0]
    assert unnamed("mass 701~kg 0.15~m 4.96e+04~kg/m³ 22600", cause) == []


_SERVO = 'name="drive" joint="axle" kv=".05"'
ACTUATORS = {
    "gain of 0": (_SERVO.replace(".05", "0"), "gain drive 0"),
    "forcerange of an activation": (
        f'{_SERVO.replace("kv", "kp")} actrange="-9 9" forcerange="-.001 .001"',
        "forcerange drive 0.001",
    ),
    "forcerange of a servo": (
        f'{_SERVO} forcerange="-.001 .001"',
        "forcerange drive 0.25 -0.001~to~0.001 100%",
    ),
    "one-sided forcerange": (f'{_SERVO} forcerange="0 .02"', "forcerange drive 0~to~0.02"),
    "ctrlrange": (f'{_SERVO} ctrlrange="-1 1"', "ctrlrange drive 5 1"),
    "inverted ctrlrange": (f'{_SERVO} ctrlrange="1 -1"', "range ctrlrange drive 1 -1 inverted"),
    "inverted forcerange": (f'{_SERVO} forcerange="2 -1"', "range forcerange drive 2 -1 inverted"),
}


@pytest.mark.parametrize("name", ACTUATORS)
def test_what_keeps_an_actuator_from_its_command_is_a_row(name: str, tmp_path: Path) -> None:
    new, facts = ACTUATORS[name]
    text = planted("velocity servo").replace(_SERVO, new)
    text = text.replace("<velocity", "<intvelocity") if "activation" in name else text
    record = checked(tmp_path, text)
    assert unnamed(facts, causes_of(record)[0]) == []
    assert f"! {facts.split()[0]}" in rows_of(study_of(record, []))


def test_an_inverted_range_of_forces_on_a_joint_is_named(tmp_path: Path) -> None:
    text = planted("pendulum").replace('name="axle"', 'name="axle" actuatorfrcrange="1 -1"')
    facts = "range actuatorfrcrange axle inverted"
    assert unnamed(facts, causes_of(checked(tmp_path, text))[0]) == []


@pytest.mark.parametrize("bias", ["kp", "kv"])
def test_a_gain_that_drives_a_joint_away_is_named(bias: str, tmp_path: Path) -> None:
    """The equations lift off too, so that the file is refused, with the gain."""
    terms = {"kp": "0 2 0", "kv": "0 0 .05"}[bias]
    servo = f'<general name="drive" joint="axle" biastype="affine" biasprm="{terms}"/>'
    text = planted("pendulum").replace('<motor name="drive" joint="axle"/>', servo)
    with pytest.raises(rb.InputError, match=naming(f"gain drive {bias} negative")):
        checked(tmp_path, text)


def test_a_refusal_names_the_gain_with_which_the_file_diverges(tmp_path: Path) -> None:
    """A spring of 1e6 N m/rad that starts at 0.2 rad, where the equations lift off as well."""
    text = planted("pendulum").replace('name="axle"', 'name="axle" stiffness="1e6"')
    text = text.replace('ctrl=".1"', 'qpos="0 0 .15 1 0 0 0 .2"')
    facts = "robot.xml diverges lifts~off spring gain axle stiffness"
    with pytest.raises(rb.InputError, match=naming(facts)):
        checked(tmp_path, text)


def test_a_cause_says_which_file_diverges_without_its_change(tmp_path: Path) -> None:
    """The file as it is, or only the mended contact."""
    diverging = planted("velocity servo").replace('kv=".05"', 'kv="20"')
    assert unnamed("gain your~file~diverges", causes_of(checked(tmp_path, diverging))[0]) == []
    record = checked(tmp_path, planted("velocity servo"))
    needed = replace(record, needed=[(Change("timestep", "too long"), np.inf)])
    assert unnamed("timestep mended~contact~diverges", causes_of(needed)[0]) == []


def test_a_wall_is_the_cause_before_a_rounding_of_the_start(tmp_path: Path) -> None:
    """A ball at 1 m/s turns at 6.667 rad/s, so that its contact point slips at 5e-5 m/s."""
    wall = '<geom name="wall" type="plane" size="1 1 .1" pos=".3 0 0" zaxis="-1 0 0"/><body name="b'
    text = planted("pendulum").replace('ctrl=".1"', 'qvel="1 0 0 0 6.667 0 0"')
    causes = causes_of(checked(tmp_path, text.replace('<body name="b', wall, 1)))
    assert unnamed("ends~early shell wall", causes[0]) == []
    assert not any(cause.startswith("start") for cause in causes)


def test_a_sphere_that_rolls_off_a_box_ends_the_comparison(tmp_path: Path) -> None:
    """At 1.07 s. Before, it left the plane, and the cause was unknown."""
    floor = '<geom name="floor" type="box" size=".2 .2 .1" pos="0 0 -.1"/>'
    text = planted("pendulum").replace('<geom name="floor" type="plane" size="5 5 .1"/>', floor)
    record = checked(tmp_path, text, 2.0)
    study = study_of(record, [])
    assert unnamed("ends~early shell edge floor", causes_of(record)[0]) == []
    assert "! ends early" in rows_of(study)


@pytest.mark.parametrize("name", INERTIAS)
def test_an_inertia_is_measured_by_what_its_mass_can_have(name: str, tmp_path: Path) -> None:
    """On both sides of m (r² - c²), and of a hundredth of a solid ball."""
    numbers, never, facts = INERTIAS[name]
    path = tmp_path / "robot.xml"
    inertial = INERTIAL.format(*numbers)
    path.write_text(planted("pendulum").replace("<freejoint/>", f"<freejoint/>{inertial}"))
    found = list(unusual_inertias(open_robot(path)))
    assert [it.is_impossible for it in found] == ([] if never is None else [never])
    assert all(unnamed(f"ball {facts}", it.words) == [] for it in found)


def test_a_needed_change_does_not_say_that_there_is_enough(tmp_path: Path) -> None:
    """Friction 1 is above the need of 0.06, but creeps; then its row says so."""
    text = planted("pendulum").replace('friction="20 20', 'friction="1 1')
    rows = rows_of(study_of(checked(tmp_path, text.replace("elliptic", "pyramidal")), []))
    friction = next(words for change, words in rows.items() if "friction" in change)
    assert unnamed("creeps 1", friction) == []
    assert "needs" not in friction


@pytest.mark.parametrize("mistake", ["gravity", "range", "gear", "inertia too large"])
def test_every_named_cause_is_a_row_of_the_table(mistake: str, tmp_path: Path) -> None:
    study = study_of(checked(tmp_path, planted("gimbal", mistake)), [])
    assert study.record is not None
    causes = [cause.partition(": ")[0] for cause in study.record["causes"]]
    assert mistake.split()[0] in causes
    assert all(any(row[2:] == cause for row in rows_of(study)) for cause in causes)


@pytest.mark.parametrize("mistake", ["start above", "gain of a servo"])
def test_the_picture_shows_what_happens_after_the_fault_in_grey(
    mistake: str, tmp_path: Path
) -> None:
    """Within the frame of the reference. Before, both charts of such a file could be empty."""
    record = checked(tmp_path, planted("flywheel", mistake))
    study = study_of(record, [])
    assert study.picture is not None
    left, right = study.picture.axes
    assert any("bad state" in str(line.get_label()) for line in left.lines)
    for axes in (left, right):
        assert any(np.isfinite(line.get_ydata()).sum() > 1 for line in axes.lines)
    reach = (
        np.abs(record.observation.theory.contact_point).max() + record.observation.user.robot.radius
    )
    assert max(map(abs, left.get_xlim())) < 2 * reach


@pytest.mark.parametrize("stays", ["", 'qvel="0 0 0 0 0 9 0"'])
def test_the_picture_of_a_ball_that_stays_in_place_shows_its_size_and_its_turn(
    stays: str, tmp_path: Path
) -> None:
    text = planted("pendulum").replace('ctrl=".1"', stays)
    study = study_of(checked(tmp_path, text), [])
    assert study.picture is not None
    left, right = study.picture.axes
    assert len(left.patches) == 1  # the sphere
    assert unnamed("rolled turned radius", right.get_title()) == []
    turned = max(np.abs(line.get_ydata()).max() for line in right.lines)
    assert turned == pytest.approx(9.0 if stays else 0.0, rel=1e-3, abs=1e-6)


def test_the_picture_shows_a_run_that_ends_before_the_first_sample(tmp_path: Path) -> None:
    """It diverges within the 10 ms between two samples: its coloured part would be empty."""
    servo = '<velocity name="drive" joint="axle" kv="20"/>'
    text = planted("velocity servo").replace(
        '<velocity name="drive" joint="axle" kv=".05"/>', servo
    )
    record = checked(tmp_path, text)
    study = study_of(record, [])
    assert study.picture is not None
    right = study.picture.axes[1]
    assert "first bad state" in {str(line.get_label()) for line in right.lines}
    assert right.get_xscale() == "log"
    assert right.get_xlim()[0] < record.observation.symptoms.until
    grey, before = right.lines[:2]
    assert np.nanmax(np.asarray(grey.get_ydata(), dtype=float)) > 1e-3
    assert np.isfinite(np.asarray(before.get_ydata(), dtype=float)).any()


STANDS = {"stands~still": "", "spins spot 9~rad": 'qvel="0 0 0 0 0 9 0"'}


@pytest.mark.parametrize("words", STANDS)
def test_a_ball_that_stays_in_place_is_an_answer(words: str, tmp_path: Path) -> None:
    """With what it does, in place of no verdict."""
    text = planted("pendulum").replace('ctrl=".1"', STANDS[words])
    assert unnamed(words, checked(tmp_path, text).observation.failure or "") == []


def test_a_motor_that_lifts_the_ball_is_refused_in_words_of_a_robots_author(
    tmp_path: Path,
) -> None:
    text = planted("spring")
    text = text.replace('axis="1 0 0"', 'axis="0 0 1"').replace("<key ", '<key ctrl="-60" ')
    with pytest.raises(
        rb.InputError, match=naming("lifts~off motor too~strong control")
    ) as refused:
        checked(tmp_path, text)
    assert "plane_motion" not in str(refused.value)
    assert "more gently" not in str(refused.value)
