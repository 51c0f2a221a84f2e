"""Robot files as different users write them: none is falsely right, refused or mended away."""

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
    """Return the exit status of `check` of a case's file, and all that it prints, on one line."""
    path = Path("robot.urdf" if name.startswith("URDF") else "robot.xml")
    path.write_text(case.text)
    status, shown, complaint = robotball("check", path, "--duration", "0.5", *case.options)
    assert path.read_text() == case.text
    return status, " ".join(f"{shown} {complaint}".split())


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.status == REFUSED])
def test_what_cannot_be_checked_is_refused_in_one_line(
    name: str, robotball: Robotball, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With status 2, the file's name and the cause; each in a few hundredths of a second."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)  # another process; as it is
    status, said = answered(robotball, name, CASES[name])
    assert status == REFUSED
    assert CASES[name].words in said
    assert said.count("robotball: ") == 1
    assert "robot." in said or "robot:" in said


ANSWERED = [name for name, case in CASES.items() if case.status != REFUSED]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=() if i % 12 == 0 else pytest.mark.study)
        for i, n in enumerate(ANSWERED)
    ],
)
def test_every_file_has_the_answer_that_is_true_of_it(name: str, robotball: Robotball) -> None:
    """Status 0 for those that roll right all the time, 1 for the others, with the words; 1 s."""
    status, said = answered(robotball, name, CASES[name])
    assert status == CASES[name].status, said
    assert CASES[name].words in said


def test_there_are_sixty_files_with_each_answer() -> None:
    """Of 70 files: 34 right, 11 not, 25 that cannot be answered, or so."""
    assert len(CASES) >= 60
    assert min(Counter(case.status for case in CASES.values()).values()) >= 10


BIG = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body><freejoint/>
<geom size="150" mass="1"/>
</body></worldbody></mujoco>"""


def test_a_question_is_a_warning_of_the_library_and_a_refusal_of_the_command(
    robotball: Robotball,
) -> None:
    """Status 2, before anything runs; `--as-given` insists. The library takes any number."""
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
