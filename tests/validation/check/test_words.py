"""What `check` says: repairs, defaults, numbers that no robot has, rows, pictures, refusals."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.user_model import UserModel
from robotball.user_model import robot_file
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
    added = [line for line in difference(record) if line.startswith("+") and new in line]
    assert len(added) == 1
    mended = tmp_path / "mended.xml"
    mended.write_text(record.text)
    model = mujoco.MjModel.from_xml_path(str(mended))
    assert (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE.value).sum() == 1
    assert not model.dof_damping[:6].any()
    theory = record.observation.theory
    away = np.abs(own_loop(mended, theory.times) - theory.contact_point).max()
    assert away < 1e-3 * theory.path_scale


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


@pytest.mark.parametrize("name", INERTIAS)
def test_an_inertia_is_measured_by_what_its_mass_can_have(name: str, tmp_path: Path) -> None:
    """On both sides of m (r² - c²), and of a hundredth of a solid ball."""
    numbers, never, facts = INERTIAS[name]
    path = tmp_path / "robot.xml"
    inertial = INERTIAL.format(*numbers)
    path.write_text(planted("pendulum").replace("<freejoint/>", f"<freejoint/>{inertial}"))
    found = list(unusual_inertias(open_robot(path)))
    assert [it for _, it in found] == ([] if never is None else [never])
    assert all(unnamed(f"ball {facts}", words) == [] for words, _ in found)


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
