"""README and docs agree with the program: numbers, commands, names, links.

`make gallery` writes docs/numbers.json, pictures and tables.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import robotball as rb
from bench.gallery import NUMBERS, OUTCOMES, law_list, outcomes_table
from robotball.dynamics.straight_motions import stability_limit
from robotball.engines.mujoco.settings import Prescribed
from robotball.errors import percent
from robotball.motion import path_error
from tests.conftest import Robotball
from tests.imports import PROJECT
from tests.random_balls import ball_of_points
from tests.random_robots import random_scene as random_robot
from tests.validation.examples import COMMANDS, example
from tests.validation.json_keys import misfits
from validation import compare, results
from validation.cli import parse
from validation.studies.cost import configurations
from validation.studies.extreme_maps import MAPS, cells_of
from validation.studies.extremes import LAWS

README = (PROJECT / "README.md").read_text(encoding="utf-8")
DOCS = {
    str(path.relative_to(PROJECT / "docs")): path.read_text(encoding="utf-8")
    for folder in ("docs", "docs/reference")
    for path in (PROJECT / folder).glob("*.md")
}
PAGES = {name: " ".join(text.split()) for name, text in {**DOCS, "README.md": README}.items()}

# Numbers ---------------------------------------------------------------------------------------

STUDIES = json.loads(NUMBERS.read_text(encoding="utf-8"))
EXTREMES, COST = STUDIES["extremes"], STUDIES["cost"]
TIMES = f"{COST['times_at_target']:,.0f}".replace(",", " ")
MISPRINTED = re.findall(r"^\| (E\d+) \|", DOCS["errata.md"], re.M)
PROVED = {  # tests have the number of a misprint in their docstrings
    number
    for path in (PROJECT / "tests/paper").glob("test_*.py")
    for number in re.findall(r'\ndef test_\w+\([^"]*"""[^"]*\b(E\d+)\b', path.read_text())
}
MISPRINTS, PROOFS = len(MISPRINTED), sum(number in PROVED for number in MISPRINTED)
FIG_10 = stability_limit(rb.load_scene("fig10").parameters)
SAID = {
    "README.md": [
        f"would take {TIMES} times the processor time of RK4",
        f"{EXTREMES['wrong']} runs were wrong or broke off. MuJoCo itself reports 36 % of them",
        f"The paper has {MISPRINTS} misprints and omissions; computations prove {PROOFS} of them",
    ],
    "extremes.md": [
        f"{len(MAPS)} maps, both rolling models",
        f"{EXTREMES['runs']} runs of the recipe",
        f"{EXTREMES['wrong']} runs failed",
        f"MuJoCo itself reports {EXTREMES['reported_by_engine']} of these failures",
        f"The precheck warns of {EXTREMES['foretold']} before the run",
        f"the monitor reports {EXTREMES['noticed']} during the run",
        f"warn in {EXTREMES['alarms']} of {EXTREMES['accurate']} accurate runs",
        f"they missed none of {STUDIES['random']['failed']} failures",
    ],
    "cost.md": [
        f"in {COST['servos_off_their_rates']} of {COST['servos']} configurations hinges",
        f"error of the other configurations is {COST['best_servo']:.0e}".replace("e-0", "e-"),
        f"reach an error of {COST['best_of_first_order']:.0e} in".replace("e-0", "e-"),
    ],
    "errata.md": [
        f"f < {FIG_10:.4f}",
        f"The [paper](method.md) has {MISPRINTS} misprints and omissions",
        f"Tests prove {PROOFS} of them",
    ],
}


@pytest.mark.parametrize("page", SAID)
def test_printed_numbers_are_the_numbers_of_the_studies(page: str) -> None:
    """Numbers agree to the last digit."""
    assert [sentence for sentence in SAID[page] if sentence not in PAGES[page]] == []


def test_the_page_has_the_law_of_each_limit() -> None:
    """The sentences are the docstrings of the limits."""
    assert f"\n\n{law_list()}\n\n" in DOCS["extremes.md"]


def test_the_studies_are_those_of_today() -> None:
    """Numbers of configurations and cells agree with the program, and statements in words hold."""
    assert len(configurations()) == COST["configurations"]
    assert sum(len(cells_of(item)) for item in MAPS.values()) == EXTREMES["runs"]
    assert sum(sum(item.values()) for item in EXTREMES["outcomes"].values()) == EXTREMES["runs"]
    assert outcomes_table(EXTREMES["outcomes"]) in DOCS["extremes.md"]
    assert len(re.findall(OUTCOMES, DOCS["extremes.md"], re.DOTALL)) == 1
    # "together they miss none", "they missed none", "they gave no false alarm".
    random = STUDIES["random"]
    assert (EXTREMES["missed"], random["missed"], random["false_alarms"]) == (0, 0, 0)
    assert EXTREMES["reported_by_engine"] / EXTREMES["wrong"] == pytest.approx(0.36, abs=0.005)
    assert COST["times_at_target"] == pytest.approx(20_000, rel=0.2)  # "about 20 000 times"


def test_each_misprint_has_a_test_of_its_number() -> None:
    """Exceptions: E20, a letter, and E30, a section number. E23 and E26 are not misprints."""
    numbers = {f"E{i}" for i in range(1, 31)}
    assert {*MISPRINTED} == numbers - {"E23", "E26"}
    assert {*PROVED} == numbers - {"E20", "E30"}


def test_the_demo_shows_what_the_readme_says(
    robotball: Robotball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two scenes run with all presets, and all but *naive* agree. The film is replaced.

    The prediction for naive comes after the table, and the last line has the result.
    """
    monkeypatch.setattr(
        "validation.comparing.film", lambda path, *_, **how: path.write_bytes(b"film")
    )
    records, show = list[results.Record](), results.show

    def kept(rows: Sequence[results.Record], console: Console) -> None:
        records.extend(rows)
        show(rows, console)

    monkeypatch.setattr(results, "show", kept)
    status, said, warned = robotball("demo", "--out", "demo")
    assert (status, "warning" in warned) == (0, False)
    assert said.index("Predicted before the runs:") > said.index("exact")
    ((off, near),) = re.findall(
        r"default settings: (\d+) m off after 10 s \(friction alone changes the path by 56 %; the "
        r"engine is \d+ % off the path with this friction\); robotball's settings: (\S+) m\."
        r"  open demo/demo\.html\n$",
        said,
    )
    assert [float(off), float(near)] == pytest.approx([24, 6e-8], rel=0.2)
    html = (tmp_path / "demo" / "demo.html").read_text(encoding="utf-8")
    assert (html.count("<video"), html.count('class="views"')) == (1, 2)
    assert {*re.findall("<option>(.*?)</option>", html)} == {"naive", "balanced"}
    assert [record["agrees"] for record in records] == 2 * [name != "naive" for name in rb.PRESETS]
    (balanced,) = (
        record["path_error"]
        for record in records
        if (record["scene"], record["preset"]) == ("fig12", "balanced")
    )
    (shown,) = re.findall(r"the path error is (\S+) after 10 s", PAGES["README.md"])
    assert balanced == pytest.approx(float(shown), rel=0.05)


@cache
def worst_theories() -> list[rb.Motion]:
    """Return the motions with the largest errors of the presets."""
    scenes = ball_of_points(14), random_robot(np.random.default_rng(74))
    return [rb.integrate(scene, rb.sample_times(10.0)) for scene in scenes]


@pytest.mark.parametrize(
    "name",
    [
        "fast",
        "balanced",
        pytest.param("accurate", marks=pytest.mark.study),
    ],
)
def test_the_settings_page_has_the_presets_worst_errors(name: str) -> None:
    """Ball 14 and robot 74 have the largest errors, 3.7e-6 and 6.3e-3 with *fast*, from RK4.

    A factor of 3 allows for last bits, which a sensitive robot magnifies.
    """
    (row,) = re.findall(rf"\| `{name}` \| (.*) of \d+ \|$", DOCS["settings.md"], re.M)
    tolerance, _, balanced, unbalanced, _ = row.split(" | ")
    assert float(tolerance) == rb.PRESETS[name].error_tolerance
    for theory, shown in zip(worst_theories(), (balanced, unbalanced), strict=True):
        error = compare(theory.scene, theory.times, settings=name, theory=theory).path_error
        assert float(shown) / 3 < error < 3 * float(shown)


# Commands and Python ---------------------------------------------------------------------------

# Commands follow four spaces, or are in a code span or in the first line of a scene file. Commands
# with words in capitals or brackets are templates.
COMMAND = r"(?:^ {4}|`)(?:\.venv/bin/)?robotball ([^`\n#>|]+)"
ALONE = {
    "demo",
    "scenes",
    "engines",
    "study extremes",
}
PRINTED = {
    command
    for text in (README, *DOCS.values())
    for found in re.findall(COMMAND, text, re.MULTILINE)
    if not re.search("[A-Z…\\[]{2}|N…", command := found.strip().partition("  ")[0])
    and (command in ALONE or (" " in command and command not in COMMANDS))
}


def test_printed_commands_are_valid() -> None:
    """Names, options and values are known, also in the examples of `--help`."""
    assert {"report fig12", "compare fig12 --preset fast,accurate", "scenes"} <= PRINTED
    examples = {example(name) for name in COMMANDS}
    assert all(example(name).startswith(name) for name in COMMANDS)
    for command in PRINTED | examples:
        assert parse(command.split())
    for name in COMMANDS:
        assert re.search(rf"\b{name}\b", DOCS["commands.md"]), name


def test_code_on_a_page_has_lines_of_at_most_88_characters() -> None:
    """Outputs may be longer: the site breaks them."""
    code = r"^```(?:python|sh|toml|xml|yaml)\n(.*?)^```|^( {4}\S*robotball .*)$"
    pages = [PROJECT / "README.md", *(PROJECT / "docs").rglob("*.md")]
    for page in pages:
        for block, command in re.findall(code, page.read_text(encoding="utf-8"), re.M | re.DOTALL):
            lines = (block or command.partition("\n")[0]).splitlines()
            assert [line for line in lines if len(line) > 88] == [], page


def test_every_warning_and_fault_has_a_law_and_a_remedy() -> None:
    """Each phrase of the table is part of a message, which the catalogue of messages has."""
    table = DOCS["commands.md"].split("| warning or fault |")[1].split("\n\n")[0]
    rows = [row.split(" | ") for row in table.splitlines()[2:]]
    phrases = [phrase for first, *_ in rows for phrase in first.removeprefix("| ").split("; ")]
    messages = (PROJECT / "tests/golden/messages.txt").read_text(encoding="utf-8")
    assert [phrase for phrase in phrases if phrase not in messages] == []
    faults = [kind.value for kind in rb.FaultKind]
    assert [text for text in faults if not any(phrase in text for phrase in phrases)] == []
    named = re.findall(r"`(\w+)`", " ".join(laws for _, laws, _ in rows))
    assert LAWS.keys() <= {*named}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "output"),
    [
        found
        for page in DOCS.values()
        for found in re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", page, re.DOTALL)
    ],
)
def test_printed_python_runs(
    text: str,
    output: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It runs in a folder with the examples and a trajectory, and prints the output shown."""
    monkeypatch.chdir(tmp_path)
    Path("examples").symlink_to(PROJECT / "examples")
    Path("my_robot.toml").symlink_to(PROJECT / "examples" / "my_robot.toml")
    rb.integrate(rb.load_scene("fig12"), rb.sample_times(0.4)).save("run.csv")
    exec(text, {})
    assert output in ("", capsys.readouterr().out)


def test_missing_and_extra_keys_of_docs_json_are_named() -> None:
    """Keys of a record and of the objects in its lists count; null has no keys."""
    record = {"file": "a.xml", "changes": [{"change": "", "without": None, "word": ""}]}
    absent = {"agrees", "rolling", "duration", "accuracy", "path_error", "since", "causes", "lines"}
    absent |= {"other_rolling.NAME", "mended_error", "changes[].words"}
    assert misfits("check", record) == {*absent, "changes[].word"}
    assert misfits("check", {**record, "changes": []}) == absent - {"changes[].words"}


# The README -----------------------------------------------------------------------------------


def test_the_readme_fits_a_screen_and_a_half_and_its_links_exist() -> None:
    """It names the paper, two commands, and further pages."""
    assert len(README.splitlines()) <= 70
    assert "10.1134/S1560354719050071" in README
    assert {"make demo", "make test"} <= set(re.findall("make demo|make test", README))
    links = re.findall(r"\]\((?!https?:)([^)#]+)", README)
    assert [link for link in links if not (PROJECT / link).exists()] == []


SPLIT = ("fig12", 2.0), ("fig12", 10.0), ("classical_regular", 2.0), ("classical_regular", 10.0)
HELD = {"drive": Prescribed(armature=1e8), "tolerance": 0.0}


def split_of(column: int) -> list[str]:
    """Return a column of the table that splits the error of default settings."""
    rows = DOCS["findings.md"].split("| friction that rolling needs")[1].split("\n\n")[0]
    return [row.removesuffix(" |").split(" | ")[1:][column] for row in rows.splitlines()]


@pytest.mark.parametrize(
    "column",
    [0, pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)],
)
def test_the_findings_split_the_error_of_default_settings(column: int) -> None:
    """What friction does is known to the digits shown. Contacts that chatter differ by a third."""
    name, time = SPLIT[column]
    needs, off, alone, *rest = split_of(column)
    agreement = compare(name, time, settings="naive")
    theory, slip = agreement.theory, agreement.slip
    loads, rubber = theory.loads, theory.scene.rolling == "rubber"
    torsional = f", {loads.torsional_friction.max():.3g} m" * rubber
    assert needs == f"{loads.sliding_friction.max():.3g}{torsional}"
    friction = rb.Friction(1.0, 0.005 if rubber else None)
    slipping = rb.integrate(replace(theory.scene, friction=friction), theory.times)
    assert alone == (percent(path_error(slipping, theory)) if slipping.slipping else "0 %")
    settings, errors = rb.preset("naive"), [agreement.path_error]
    changes: list[dict[str, Any]] = [{}, HELD, {"cone": "elliptic"}, {"integrator": "RK4"}]
    for change in changes:
        settings = replace(settings, name="changed", **change)
        motion = rb.simulate(theory.scene, theory.times, settings=settings)
        errors.append(path_error(motion, slipping))
    shown = [float(share.removesuffix(" %")) / 100 for share in (off, *rest)]
    assert shown == pytest.approx(errors, rel=0.35)
    assert (slip.by_engine if slip else agreement.path_error) == pytest.approx(errors[1], rel=1e-9)


def test_the_readme_has_the_split_of_the_findings() -> None:
    (needs, off, alone, rest, *_), (_, _, none, regular, *_) = split_of(0), split_of(2)
    assert none == "0 %"
    ample = replace(rb.load_scene("fig12"), friction=rb.Friction(sliding=1.5, torsional=2.0))
    motion = rb.simulate(ample, 2.0, settings=replace(rb.preset("naive"), stop_at_fault=False))
    error = percent(path_error(motion, rb.integrate(ample, motion.times)))
    for words in (
        f"{off} off the path of ideal rolling after 2 s",
        f"rolling needs {needs.replace(', ', ' and ')}. This lack of friction",
        f"This lack of friction alone changes the path by {alone}",
        f"MuJoCo is {rest} off this changed path.",
        f"with coefficients of 1.5 and 2 m MuJoCo is still {error} off",
        f"For a ball that needs less friction than 1, MuJoCo is {regular} off.",
    ):
        assert words in PAGES["README.md"]
    assert f"(*naive*) is {off} off ideal rolling on fig12 after 2 s" in PAGES["findings.md"]
    assert f"changes the path by {alone}; MuJoCo is {rest} off the path" in PAGES["findings.md"]
