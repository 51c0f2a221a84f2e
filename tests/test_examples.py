"""All examples run, and every tutorial prints the outputs stored in its notebook and page."""

import re
import runpy
from decimal import Decimal
from pathlib import Path

import pytest

from docs.tutorials.notebooks import FOLDER, NOTEBOOKS, Json, code_cells, page, read, run
from tests.messages import unnamed
from tests.validation.examples import COMMANDS
from validation.cli import parse

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


# The facts that each script prints, and the file that it writes. Its numbers have the digits that
# hold on any machine.
SCRIPTS = {
    "own_ball": ("0.223~m agrees", None),
    "compare": ("naive 5.3e-01 balanced", "out/compare.png"),
    "sweep": ("1.2, needed 1.155", None),
    "many_starts": ("10~runs 0~with 1e-8 True", None),
    "section": ("1000 2.4241~s", "out/section.png"),
    "exponents": ("fig12 regular fig14 chaotic", None),
    "fit": ("frame.kv 0.4", "out/run.csv"),
    "controller": ("0.544~m agrees", None),
    "export": ("model.urdf 0.900~kg 3~joints", "out/fig12/model.xml"),
    "film": ("out/fig12.mp4 1.06~m", "out/fig12.mp4"),
    "order_8": ("2.0~s 40~steps 1e-9 True", None),
}
LINES = {"order_8": 40}  # the others have under 20


@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_prints_its_numbers_and_writes_its_file(
    name: str, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "film":
        request.getfixturevalue("screen")
    facts, written = SCRIPTS[name]
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert unnamed(facts, capsys.readouterr().out) == []
    assert written is None or Path(written).stat().st_size > 1000


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_is_short_and_says_how_it_is_run(name: str) -> None:
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) < LINES.get(name, 20)
    assert f": python examples/{name}.py" in text.splitlines()[0]
    assert (EXAMPLES.parent / "docs" / "commands.md").read_text().count(f"`{name}.py`") == 1


# Tutorials


def test_no_tutorial_needs_the_checkout() -> None:
    """They read no file of it and do not import `validation`, which a wheel renames."""
    needs = [
        (name, use)
        for name in NOTEBOOKS
        for cell in code_cells(read(name))
        for use in re.findall(r"examples/|from validation", "".join(cell["source"]))
    ]
    assert needs == []


NUMBER = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]\d+)?"
SAME = Decimal("1e-4")  # relative: the last of many digits differs between machines


def printed(outputs: list[Json]) -> str:
    """Return a cell's output with normalised spaces: column widths depend on their numbers."""
    text = " ".join("".join(output.get("text", [])) for output in outputs)
    return " ".join(re.sub("─+", "─", text).split())


def pictures(outputs: list[Json]) -> int:
    return sum("image/png" in output.get("data", {}) for output in outputs)


def unit(number: str) -> Decimal:
    """Return the unit of a number's last digit; 0 for an integer, which is exact."""
    exponent = Decimal(number).as_tuple().exponent
    return Decimal(1).scaleb(exponent) if isinstance(exponent, int) and exponent < 0 else Decimal(0)


def near(stored: str, computed: str, tags: list[str]) -> bool:
    """Return whether two numbers agree up to differences between machines.

    They may differ by a unit of the last digit. In a cell tagged "chance", with a chaotic motion,
    they may differ by a factor of two; in one tagged "timing", by any amount.
    """
    one, other = Decimal(stored), Decimal(computed)
    if "chance" in tags:
        return max(one, other) <= 2 * min(one, other)
    apart = max(unit(stored), unit(computed), SAME * abs(one) if unit(stored) else Decimal(0))
    return "timing" in tags or abs(one - other) <= apart


def differences(cell: Json, text: str) -> list[str]:
    """Return the differences in words and numbers between a text and a cell's stored output."""
    stored, tags = printed(cell["outputs"]), cell["metadata"].get("tags", [])
    if re.sub(NUMBER, "#", stored) != re.sub(NUMBER, "#", text):
        return [stored, text]
    pairs = zip(re.findall(NUMBER, stored), re.findall(NUMBER, text), strict=True)
    return [f"{one}, now {other}" for one, other in pairs if not near(one, other, tags)]


# `make test-studies` runs the other three.
QUICK = ("attractor", "data_sheet", "first_ten_minutes")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.study) for n in NOTEBOOKS]
)
def test_a_tutorial_prints_its_stored_outputs(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every word, every number to its last digit, and as many pictures; also on a CI server."""
    monkeypatch.setenv("CI", "true")  # pytest then truncates no line
    monkeypatch.setenv("PY_COLORS", "1")
    cells = code_cells(read(name))
    for cell, outputs in zip(cells, run(read(name), folder), strict=True):
        assert differences(cell, printed(outputs)) == []
        assert pictures(outputs) == pictures(cell["outputs"])


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_page_is_generated_from_its_notebook(name: str) -> None:
    """To the byte, with all pictures, each below 60 kB. The first page links to it."""
    files = page(name, read(name))
    assert {path.name for path in FOLDER.glob(f"{name}-*.png")} == {*files} - {f"{name}.md"}
    assert [file for file in files if (FOLDER / file).read_bytes() != files[file]] == []
    assert [file for file in files if len(files[file]) > 60_000] == []
    assert 5 <= len(code_cells(read(name))) <= 10
    assert f"(tutorials/{name}.md)" in (FOLDER.parent / "index.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_commands_in_the_text_of_a_tutorial_parse(name: str) -> None:
    """Commands in cells are run."""
    prose = ("".join(cell["source"]) for cell in read(name)["cells"] if "outputs" not in cell)
    for line in re.findall(r"(?:^ {4}|`)(?:\S+/)?robotball (\w+ [^`\n#]+)", "\n".join(prose), re.M):
        assert line in COMMANDS or parse(line.split()), line


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_wrong_stored_number_is_noticed(name: str) -> None:
    """If it is off by two units of the last digit or by 3e-4; not in tagged cells."""
    for cell in code_cells(read(name)):
        text = printed(cell["outputs"])
        for match in [] if cell["metadata"].get("tags") else re.finditer(NUMBER, text):
            number = Decimal(match.group())
            last = unit(match.group()) or Decimal(1)
            wrong = number + max(2 * last, (3 * SAME * abs(number)).quantize(last))
            assert differences(cell, f"{text[: match.start()]}{wrong:g}{text[match.end() :]}"), (
                wrong
            )
        assert not text or differences(cell, f"{text} more")


def test_a_tutorial_notices_another_motion(folder: Path) -> None:
    """With three times the momentum instead of twice."""
    book = read("first_ten_minutes")
    for cell in book["cells"]:
        cell["source"] = [line.replace("=2 *", "=3 *") for line in cell["source"]]
    cells, outputs = code_cells(book), run(book, folder)
    pairs = zip(cells, map(printed, outputs), strict=True)
    by_cell = [differences(cell, text) for cell, text in pairs]
    assert [i for i, texts in enumerate(by_cell) if texts] == [len(cells) - 1]


def test_the_researchers_script_has_20_lines() -> None:
    """The title of its tutorial says so."""
    title, script = read("attractor")["cells"][0]["source"][0], code_cells(read("attractor"))[0]
    assert "in 20 lines of Python" in title
    assert len(script["source"]) <= 20


def test_the_test_in_the_tutorial_is_the_example_and_its_workflow_runs_it() -> None:
    """Except for the robot's numbers and the sentence on how to run it."""
    book = "".join("".join(cell["source"]) for cell in code_cells(read("regression_test")))
    (steps,) = re.findall(r"%%writefile rolling.yml\n(?:.*\n)+?    steps:\n((?: .*\n?)+)", book)
    assert [step for step in steps.splitlines() if "- run:" in step] == [
        "      - run: pip install pytest wheels/robotball-*.whl",
        "      - run: pytest test_my_robot.py",
    ]
    example = (EXAMPLES / "test_my_robot.py").read_text(encoding="utf-8")
    same = re.sub(NUMBER, "0", example[example.index("SETTINGS = ") :].rstrip())
    assert same in re.sub(NUMBER, "0", book)
