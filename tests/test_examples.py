"""Each of examples/ runs as it is, and each tutorial prints what its notebook and its page have."""

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
    """An empty folder to run in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


# The facts that each script prints, and the file that it writes. Its numbers have the digits that
# hold on any machine.
SCRIPTS = {
    "own_ball": ("0.223~m agrees", None),
    "compare": ("naive 5.3e-01 balanced", "out/compare.png"),
    "sweep": ("1.2, needed 1.155", None),
    "many_starts": ("10~runs 0~with 1e-8 True", None),
    "section": ("1000 3972~s", "out/section.png"),
    "exponents": ("fig12 regular fig14 chaotic", None),
    "fit": ("frame.kv 0.4", "out/run.csv"),
    "controller": ("0.544~m agrees", None),
    "export": ("model.urdf 0.900~kg 3~joints", "out/fig12/model.xml"),
    "film": ("out/fig12.mp4 1.06~m", "out/fig12.mp4"),
}


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
    assert len(text.splitlines()) < 20
    assert f": python examples/{name}.py" in text.splitlines()[0]
    pages = ((EXAMPLES.parent / page).read_text() for page in ("README.md", "docs/index.md"))
    assert [page.count(f"`{name}.py`") for page in pages] == [1, 1]


# Tutorials -------------------------------------------------------------------------------------


def test_the_tutorials_but_settings_need_no_checkout() -> None:
    """Neither a file of it nor the package `validation`, which a wheel has by another name."""
    needs = [
        (name, found)
        for name in NOTEBOOKS
        for cell in code_cells(read(name))
        for found in re.findall(r"examples/|from validation", "".join(cell["source"]))
    ]
    assert needs == [("settings", "examples/")]


NUMBER = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]\d+)?"
SAME = Decimal("1e-4")  # relative, as a number of many digits differs in the last on two machines


def printed(outputs: list[Json]) -> str:
    """What a cell prints, in one spacing: columns are as wide as their numbers."""
    text = " ".join("".join(output.get("text", [])) for output in outputs)
    return " ".join(re.sub("─+", "─", text).split())


def pictures(outputs: list[Json]) -> int:
    return sum("image/png" in output.get("data", {}) for output in outputs)


def unit(number: str) -> Decimal:
    """The unit of a number's last digit; 0 of a whole number, which is exact."""
    exponent = Decimal(number).as_tuple().exponent
    return Decimal(1).scaleb(exponent) if isinstance(exponent, int) and exponent < 0 else Decimal(0)


def near(stored: str, computed: str, tags: list[str]) -> bool:
    """Whether two numbers are one, on two machines.

    Printed are the digits that hold, so they are a unit of the last one apart at most. Of a cell
    tagged "chance", of a chaotic motion, they are within a factor of two; "timing" are seconds.
    """
    one, other = Decimal(stored), Decimal(computed)
    if "chance" in tags:
        return max(one, other) <= 2 * min(one, other)
    apart = max(unit(stored), unit(computed), SAME * abs(one) if unit(stored) else Decimal(0))
    return "timing" in tags or abs(one - other) <= apart


def differences(cell: Json, text: str) -> list[str]:
    """Return in which words and numbers a text differs from what the cell has stored."""
    stored, tags = printed(cell["outputs"]), cell["metadata"].get("tags", [])
    if re.sub(NUMBER, "#", stored) != re.sub(NUMBER, "#", text):
        return [stored, text]
    pairs = zip(re.findall(NUMBER, stored), re.findall(NUMBER, text), strict=True)
    return [f"{one}, now {other}" for one, other in pairs if not near(one, other, tags)]


# The other four are run by `make test-studies`.
QUICK = ("data_sheet", "first_ten_minutes")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.study) for n in NOTEBOOKS]
)
def test_a_tutorial_prints_what_it_stores(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every word, every number to its last digit, and as many pictures, on a CI server too."""
    monkeypatch.setenv("CI", "true")  # at which pytest cuts no line
    monkeypatch.setenv("PY_COLORS", "1")
    cells = code_cells(read(name))
    for cell, outputs in zip(cells, run(read(name), folder), strict=True):
        assert differences(cell, printed(outputs)) == []
        assert pictures(outputs) == pictures(cell["outputs"])


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_page_is_that_of_its_notebook(name: str) -> None:
    """To the byte, with all pictures, each of less than 60 kB; the index leads to it."""
    files = page(name, read(name))
    assert {path.name for path in FOLDER.glob(f"{name}-*.png")} == {*files} - {f"{name}.md"}
    assert [each for each in files if (FOLDER / each).read_bytes() != files[each]] == []
    assert [each for each in files if len(files[each]) > 60_000] == []
    assert 5 <= len(code_cells(read(name))) <= 10
    assert f"({name}.md)" in (FOLDER / "index.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_command_that_a_tutorial_names_is_one(name: str) -> None:
    """Those that it only names; the others are run."""
    prose = ("".join(cell["source"]) for cell in read(name)["cells"] if "outputs" not in cell)
    for line in re.findall(r"(?:^ {4}|`)(?:\S+/)?robotball (\w+ [^`\n#]+)", "\n".join(prose), re.M):
        assert line in COMMANDS or parse(line.split()), line


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_stored_number_that_is_wrong_is_noticed(name: str) -> None:
    """Each that neither chance nor a clock decides, by two of its last digit or 3e-4 of it."""
    for cell in code_cells(read(name)):
        text = printed(cell["outputs"])
        for found in [] if cell["metadata"].get("tags") else re.finditer(NUMBER, text):
            number = Decimal(found.group())
            last = unit(found.group()) or Decimal(1)
            wrong = number + max(2 * last, (3 * SAME * abs(number)).quantize(last))
            assert differences(cell, f"{text[: found.start()]}{wrong:g}{text[found.end() :]}"), (
                wrong
            )
        assert not text or differences(cell, f"{text} more")


def test_a_tutorial_notices_another_motion(folder: Path) -> None:
    """Where the ball starts with three times the momentum, and the text has twice."""
    book = read("first_ten_minutes")
    for cell in book["cells"]:
        cell["source"] = [line.replace("=2 *", "=3 *") for line in cell["source"]]
    cells, outputs = code_cells(book), run(book, folder)
    found = [differences(*each) for each in zip(cells, map(printed, outputs), strict=True)]
    assert [i for i, each in enumerate(found) if each] == [len(cells) - 1]


def test_the_tutorial_s_test_is_the_example() -> None:
    """But for the robot with its numbers, and the sentence on how to run it."""
    book = "".join("".join(cell["source"]) for cell in code_cells(read("regression_test")))
    example = (EXAMPLES / "test_my_robot.py").read_text(encoding="utf-8")
    same = re.sub(NUMBER, "0", example[example.index("SETTINGS = ") :].rstrip())
    assert same in re.sub(NUMBER, "0", book)
