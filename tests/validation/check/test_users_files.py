"""`check` gives the right answer for robot files in the style of many users."""

from collections import Counter
from pathlib import Path

import pytest

import robotball as rb
from robotball.errors import UnitWarning
from robotball.user_model import robot_file
from tests.conftest import Robotball
from tests.messages import naming, unnamed
from tests.validation.check.users_files import CASES, REFUSED, Case


def answered(robotball: Robotball, name: str, case: Case) -> tuple[int, str]:
    """Return the exit status of `check` and everything that it prints, on one line."""
    path = Path("robot.urdf" if name.startswith("URDF") else "robot.xml")
    path.write_text(case.text)
    status, shown, complaint = robotball("check", path, "--duration", "0.5", *case.options)
    assert path.read_text() == case.text
    return status, " ".join(f"{shown} {complaint}".split())


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.status == REFUSED])
def test_files_that_cannot_be_checked_are_refused_in_one_line(
    name: str, robotball: Robotball, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With status 2, the name of the file and the cause."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)  # skip a subprocess
    status, output = answered(robotball, name, CASES[name])
    assert status == REFUSED
    assert CASES[name].words in output
    assert output.count("robotball: ") == 1
    assert "robot." in output or "robot:" in output


ANSWERED = [name for name, case in CASES.items() if case.status != REFUSED]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=() if i % 12 == 0 else pytest.mark.study)
        for i, n in enumerate(ANSWERED)
    ],
)
def test_every_file_gets_the_expected_answer(name: str, robotball: Robotball) -> None:
    """Status 0 for models that roll correctly, 1 for the others, with the expected words."""
    status, output = answered(robotball, name, CASES[name])
    assert status == CASES[name].status, output
    assert CASES[name].words in output


def test_there_are_many_files_for_each_answer() -> None:
    """About 34 of 70 are right, 11 wrong, and 25 cannot be checked."""
    assert len(CASES) >= 60
    assert min(Counter(case.status for case in CASES.values()).values()) >= 10


BIG = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body><freejoint/>
<geom size="150" mass="1"/>
</body></worldbody></mujoco>"""


def test_implausible_units_give_a_warning_in_python_and_a_refusal_in_commands(
    robotball: Robotball,
) -> None:
    """Status 2 before the run, unless `--as-given` confirms the number."""
    Path("big.xml").write_text(BIG)
    facts = "big.xml shell radius 150~m 0.15 150~mm"
    with pytest.warns(UnitWarning, match=naming(facts)):
        rb.load_scene("big.xml")
    for command in ("check", "compare"):
        status, out, complaint = robotball(command, "big.xml")
        assert (status, out) == (2, "")
        assert unnamed(f"{facts} --as-given", complaint.splitlines()[-1]) == []
    status, _, complaint = robotball("export", "big.xml", "--as-given")
    assert status == 0
    assert unnamed(f"warning {facts}", complaint) == []
