"""All messages of the program are in one file, where their wording is reviewed.

Tests of messages check facts only. `make messages` writes the file again.
"""

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

import robotball as rb
from robotball.errors import UnitWarning
from robotball.scene_files.scene_keys import ask
from robotball.user_model import robot_file
from tests.conftest import Robotball
from tests.imports import PROJECT
from tests.messages import naming, unnamed
from tests.robotball import test_refused
from tests.robotball.design import test_designing
from tests.robotball.engines.mujoco import test_limits, test_settings
from tests.robotball.files import test_trajectory_file
from tests.robotball.fit import test_fitting
from tests.robotball.robot import test_controllers
from tests.robotball.scene_files import test_refused_scene_files
from tests.robotball.scene_files.scene_texts import edited
from tests.robotball.theory import test_reduced
from tests.robotball.user_model import test_robot_file, test_sandbox
from tests.validation.commands import test_refused_commands
from tests.validation.examples import COMMANDS, command

GOLDEN = PROJECT / "tests" / "golden" / "messages.txt"
# The text after these comes from Python, NumPy or MuJoCo.
OTHERS = r"((?:\w*Error|JSON|TOML|read|[A-Z]+ file|ParseXML):)"
# The input that causes a message, and the message.
Rows = Iterator[tuple[str, str]]


def refusal(work: Callable[[], object]) -> str:
    with pytest.raises(rb.InputError) as refused:
        work()
    return str(refused.value)


def in_python(_: Path) -> Rows:
    for snippet in test_refused.ALL:
        yield snippet, test_refused.refusal(snippet)
    for snippet in test_reduced.REFUSED:
        yield snippet, refusal(partial(eval, snippet, vars(test_reduced)))
    for changes in test_settings.BAD.values():
        yield str(changes), refusal(partial(test_settings.changed, changes))
    for facts, asked in test_designing.INFEASIBLE.items():
        yield f"a design: {facts}", refusal(partial(test_designing.infeasible, asked))
    for kind, row in test_controllers.RUNS.items():
        yield f"a controller: {kind}", refusal(partial(test_controllers.integrated, row[0]))


def in_scene_files(folder: Path) -> Rows:
    for text, body, facts in test_refused_scene_files.REFUSED:
        asked = f"{body} {facts}".strip()
        yield asked, test_refused_scene_files.refusal(text, folder)
    path = folder / "unit.toml"
    for text, typed, _ in test_refused_scene_files.ASKED:
        path.write_text(edited(text, typed, test_refused_scene_files.EXAMPLE))
        with pytest.warns(UnitWarning) as warned:
            ask(path, rb.load_scene(PROJECT / "examples" / "my_robot.toml"))
        yield typed, str(warned[0].message)


def in_robot_files(folder: Path) -> Rows:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_file, "check_loads", lambda path: None)
        for file in test_robot_file.WARNED:
            for line in test_robot_file.warned(file, folder):
                yield file[0], line
        for facts, change in test_robot_file.REFUSED.items():
            yield facts, test_robot_file.refusal(change, folder)
    with pytest.MonkeyPatch.context() as patch:
        test_sandbox.work_here(patch)
        for body, texts in (
            (test_sandbox.ARM, test_sandbox.URDFS),
            (test_sandbox.B, test_sandbox.MJCFS),
        ):
            for facts, text in texts.items():
                yield facts, test_sandbox.refusal(body, text, folder)


def in_logs(folder: Path) -> Rows:
    for name, data, facts in test_trajectory_file.NO_TABLES:
        yield f"{name}: {facts}", test_trajectory_file.refusal(name, data, folder)
    for text in test_fitting.LOGS:
        yield repr(text), test_fitting.refusal(text, folder)


def in_commands(robotball: Robotball, folder: Path) -> Rows:
    for arguments in test_refused_commands.REFUSED:
        if arguments not in test_refused_commands.UNLISTED:
            error = test_refused_commands.refusal(robotball, folder, arguments)
            yield f"robotball {arguments}", error.splitlines()[-1]


def of_runs(_: Path) -> Rows:
    for name, limit in dict(test_limits.checks()).items():
        # Predictions far from their limits may be rounding errors.
        yield name, re.sub(r"\d+\.\d+(e[-+]\d+)?|\d+e[-+]\d+", "…", limit.warning)
    for kind in rb.FaultKind:
        yield kind.name, kind.value


def of_help(_: Path) -> Rows:
    for name in COMMANDS:
        yield f"robotball {name} --help", command(name).help.partition("\n")[0]


def shown(rows: Rows, folder: Path) -> str:
    """Return rows as text, without machine-dependent numbers and other programs' words."""
    lines = set()
    for asked, message in rows:
        line = message.replace(f"{folder}/", "").replace(f"{PROJECT}/", "")
        line = re.sub(r"(tests/\S+ line) \d+", r"\1 …", line)
        line = re.sub(rf"{OTHERS} .+", r"\1 …", line)
        line = re.sub(r"(masses: only|only t =|needs about) \S+", r"\1 …", line)
        line = re.sub(r"\d+\.\d{3,}(e[-+]\d+)?", lambda number: f"{float(number[0]):.3g}", line)
        lines.add(f"{' '.join(asked.split())}\n    {line}\n")
    return "".join(sorted(lines))


def test_the_catalogue_has_all_messages(
    robotball: Robotball, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """After changing a message run: make messages."""
    sections = {
        "Refused in Python": in_python(tmp_path),
        "Refused and asked about scene files": in_scene_files(tmp_path),
        "Refused and warned of about robot files": in_robot_files(tmp_path),
        "Refused logs": in_logs(tmp_path),
        "Refused commands": in_commands(robotball, tmp_path),
        "Warnings and faults of runs": of_runs(tmp_path),
        "Summaries of commands": of_help(tmp_path),
    }
    catalogue = "\n".join(
        f"== {title}\n\n{shown(rows, tmp_path)}" for title, rows in sections.items()
    )
    if request.config.getoption("rewrite"):
        GOLDEN.write_text(catalogue, encoding="utf-8")
    assert GOLDEN.read_text(encoding="utf-8") == catalogue, "run: make messages"


def test_a_fact_is_not_found_within_a_longer_word_or_number() -> None:
    """Nor with another unit."""
    message = "frame.kv is 1.5 kg, of 21 at most: --outer 'x' 0.27064 s"
    facts = "frame.kv 1.5~kg 21 'x' 0.27…~s"
    assert unnamed(facts, message) == []
    assert re.search(naming(facts), message)
    for missing in ("1", "5~kg", "1.5~m", "2", "--out", "fram", "-21", "0.28…~s"):
        assert unnamed(missing, message) == [missing]
        assert not re.search(naming(f"21 {missing}"), message)
