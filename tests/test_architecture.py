"""The architecture is as its plan says, and the tests of it catch what they forbid."""

import ast
import builtins
import keyword
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from robotball.engines.engine import OURS
from tests.imports import PROJECT, graph_of, imported, modules_of, nodes_of, reached

ENGINES = PROJECT / "robotball/engines"
MODULES = modules_of(PROJECT)
ADAPTERS = tuple(f"robotball.engines.{name}" for name in OURS if (ENGINES / f"{name}.py").is_file())
REFERENCES = ("robotball.theory.reduced", "robotball.theory.multibody.integration")
MUJOCO = "robotball.engines.mujoco"
HOMES = (ast.Module, ast.ClassDef, ast.FunctionDef)  # of docstrings
ROOMS = (*REFERENCES, MUJOCO, "robotball.engines.recorded", *ADAPTERS)
# Each may import the floors before it, and none after it.
FLOORS = (
    ("robotball.errors",),
    ("robotball.rotations",),
    ("robotball.robot",),
    ("robotball.files",),
    ("robotball.processes", "robotball.motion"),
    ("robotball.theory", "robotball.user_model"),
    ("robotball.design",),
    ("robotball.scene_files",),
    ("robotball.engines",),
    ("robotball.dynamics", "robotball.fit", "robotball.view"),
    ("robotball",),
    ("validation",),
)


@cache
def whole_graph() -> Mapping[str, set[str]]:
    """Return what each module imports, which takes half a second to find."""
    return graph_of(MODULES)


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def floor_of(name: str) -> int:
    """Return the place of a module's floor: that of its package, or of the face that is on top."""
    homes = {home: floor for floor, homes in enumerate(FLOORS) for home in homes}
    return next(homes[home] for home in sorted(homes, key=len, reverse=True) if within(name, home))


def broken(graph: Mapping[str, set[str]]) -> Iterator[tuple[str, str]]:
    """The rules that imports break, each with the import."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        yield "a circle", " -> ".join(error.args[1])
    for name, others in graph.items():
        for other in others:
            if floor_of(other) > floor_of(name):
                yield "up from a floor", f"{name} -> {other}"
            known = within(name, "robotball") and not within(name, MUJOCO)
            if known and within(other, MUJOCO):
                yield "an engine's types outside its room", f"{name} -> {other}"
        for room in (each for each in ROOMS if within(name, each)):
            for other in reached(graph, name):
                if any(within(other, each) for each in ROOMS if each != room):
                    yield "from a room to another", f"{name} -> {other}"


def test_no_import_breaks_a_rule() -> None:
    """Imports run down, in no circle, late ones included; no engine knows another, however far."""
    assert [*broken(whole_graph())] == []
    both = [reached(whole_graph(), ROOMS[0]), reached(whole_graph(), f"{MUJOCO}.mujoco_engine")]
    assert {"robotball.robot.formulas", "robotball.robot.scene", "robotball.motion"} <= both[
        0
    ] & both[1]


@pytest.mark.parametrize(
    ("home", "line", "rule"),
    [
        ("robotball/theory/reduced", "import robotball.engines.mujoco.model", "from a room"),
        ("robotball/theory/reduced", "from ..engines.mujoco.model import build", "from a room"),
        ("robotball/motion", "def f(): from .engines.mujoco import model", "an engine's types"),
        ("robotball/robot/scene", "import validation", "up from a floor"),
        ("robotball/robot/scene", "def f(): from robotball.view import notebook", "up from"),
        ("robotball/robot/formulas", "from robotball.robot import scene", "a circle"),
    ],
)
def test_an_import_that_is_forbidden_is_found(
    tmp_path: Path, home: str, line: str, rule: str
) -> None:
    """One line is added to a file, and the checks are made again."""
    changed, module = tmp_path / "changed.py", home.replace("/", ".")
    changed.write_text(f"{MODULES[module].read_text()}\n\n{line}\n")
    found = dict(broken({**whole_graph(), module: set(imported(module, changed, MODULES))}))
    assert any(each.startswith(rule) for each in found), found


def test_the_tests_mirror_the_packages() -> None:
    """Every folder of tests but tests/paper is one of the project's."""
    here = Path(__file__).parent
    folders = {file.parent.relative_to(here) for file in here.rglob("test_*.py")}
    assert {folder for folder in folders if not (PROJECT / folder).is_dir()} == {Path("paper")}


def test_the_tests_of_the_core_know_nothing_of_validation() -> None:
    """Neither they nor the helpers that they import, so that the core stands by itself."""
    modules = MODULES | modules_of(PROJECT, ("tests",))
    graph: dict[str, set[str]] = {name: set() for name in MODULES}
    graph |= {n: set(imported(n, modules[n], modules)) for n in modules.keys() - MODULES.keys()}
    known = {name: reached(graph, name) for name in graph if within(name, "tests.robotball")}
    assert len(known) > 50
    assert [
        (name, other) for name in known for other in known[name] if within(other, "validation")
    ] == []
    assert "validation" in reached(graph, "tests.validation.test_agreement")


def test_an_engines_name_is_typed_in_its_room_alone() -> None:
    """Printed, drawn and written words take it from its label; docstrings may say it."""
    for name, file in MODULES.items():
        if within(name, MUJOCO) or "MuJoCo" not in (text := file.read_text()):
            continue
        nodes = nodes_of(text)
        homes = [each for each in nodes if isinstance(each, HOMES) and each.body]
        firsts = {each.body[0].value for each in homes if isinstance(each.body[0], ast.Expr)}
        texts = [
            each.value for each in nodes if isinstance(each, ast.Constant) if each not in firsts
        ]
        assert not [each for each in texts if isinstance(each, str) and "MuJoCo" in each], name


def prose_of(text: str) -> Iterator[str]:
    """Yield the docstrings and the comments of a module."""
    for node in nodes_of(text):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    yield from re.findall(r"(?:^|\s)(#.*)", text)


def words_of(text: str) -> Iterator[str]:
    """Yield what a module names: its own names and those it uses, and its texts."""
    for node in nodes_of(text):
        for key in ("name", "id", "attr", "arg"):
            name = getattr(node, key, None)
            yield from name.split(".") if isinstance(name, str) else ()
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def unknown_names(text: str, known: set[str]) -> Iterator[str]:
    """Yield what prose names and is nowhere: `names`, and CONSTANTS that are private ones here."""
    own = {node.id for node in nodes_of(text) if isinstance(node, ast.Name)}
    for prose in prose_of(text):
        for name in re.findall(r"`([A-Za-z_][\w.]*)(?:\(.*?\))?`", prose):
            if name not in known and not set(name.split(".")) <= known:
                yield name
        for name in re.findall(r"(?<!\w)[A-Z][A-Z0-9]+(?:_[A-Z0-9]+)*(?![\w(])", prose):
            if name not in own and f"_{name}" in own and name not in OTHERS:
                yield name


# Packages' own words, and columns of a user's file.
OTHERS = {
    "MjSpec.attach",
    "README",
    "TAMSI",
    "skip_file_prefixes",
    "x_mm",
    "x_error",
    "rich.table.Table",
}
UNMENDED: set[str] = set()


def test_every_name_that_a_docstring_or_comment_mentions_exists() -> None:
    """In the two packages; one that does not, or is private by now, is found."""
    texts = {name: file.read_text() for name, file in MODULES.items()}
    known = {word for text in texts.values() for word in words_of(text)}
    known |= {part for name in MODULES for part in name.split(".")} | OTHERS | {*dir(builtins)}
    known |= {file.name for file in MODULES.values()} | {*keyword.kwlist}
    found = {name: [*unknown_names(text, known)] for name, text in texts.items()}
    assert {name: each for name, each in found.items() if each and name not in UNMENDED} == {}
    planted = '"""Of `no_such_name`, `path_error` and COUNT."""\n_COUNT = 1  # as `str.such_a_one`'
    assert [*unknown_names(planted, known)] == ["no_such_name", "COUNT", "str.such_a_one"]


def test_the_core_names_validation_where_its_everyday_names_are_asked_for() -> None:
    """`robotball.compare` and four others are validation's, and load it when they are used.

    A user who has one line to write should write one import. Else robotball stands by itself.
    """
    assert {
        name
        for name in MODULES
        if within(name, "robotball")
        for text in strings_of(MODULES[name])
        if text.split(".")[0] == "validation"
    } == {"robotball", "robotball.errors"}  # the latter names it in warnings' place in user's code
    code = """
import sys, robotball as rb
rb.integrate(rb.load_scene("fig12"), rb.sample_times(0.1))
before = "validation" in sys.modules
print(before, *(getattr(rb, name).__module__ for name in rb._EVERYDAY), "compare" in dir(rb))
"""
    told = subprocess.check_output([sys.executable, "-c", code], text=True).split()
    assert told == [
        "False", "validation.agreement", "validation.results", "validation.agreement",
        "validation.random_starts", "validation.parameter_sweep", "True",
    ]  # fmt: skip


def strings_of(file: Path) -> Iterator[str]:
    for node in nodes_of(file.read_text()):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.parametrize(
    ("code", "count", "unneeded"),
    [
        ("from validation import compare; compare('fig12')", 29, {"matplotlib", "mediapy"}),
        ("import robotball as rb; rb.integrate(rb.load_scene('fig12'))", 16, {"mujoco"}),
        ("import validation.cli", 5, {"numpy", "msgspec"}),  # robotball --help
    ],
)
def test_a_run_loads_what_it_needs(code: str, count: int, unneeded: set[str]) -> None:
    """A process loads at most so many files with code, and no package that it does not need."""
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    loaded = subprocess.check_output(
        [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"],
        text=True,
        env=environment,
    ).split()
    files = [MODULES[name] for name in loaded if name in MODULES]
    with_code = [file for file in files if len(nodes_of(file.read_text())) > 3]  # not a docstring
    assert len(with_code) <= count, sorted(file.stem for file in with_code)
    assert unneeded.isdisjoint(loaded)


SETTINGS = """
import contextlib, importlib, os, sys, warnings
import matplotlib, numba, numpy
import scipy.sparse, scipy.special, sympy  # which add filters of warnings of their own
with contextlib.suppress(ImportError):  # as what this one imports does
    import mujoco.sysid

def settings():
    compiler = {name: repr(each) for name, each in vars(numba.config).items() if name.isupper()}
    pictures, rounding = dict.copy(matplotlib.rcParams), numpy.geterr()
    return compiler, pictures, rounding, [*warnings.filters], dict(os.environ)

def changed():
    names = "numba", "matplotlib", "numpy", "warnings", "environment"
    return [name for name, a, b in zip(names, before, settings()) if a != b]

before = settings()
for module in sys.argv[1:]:
    with contextlib.suppress(ImportError):  # of an engine that is not installed
        importlib.import_module(module)
print(*changed(), sep=",")
numba.config.CPU_FEATURES, matplotlib.rcParams["font.size"] = "+sse2", 7.0
numpy.seterr(all="ignore"), warnings.simplefilter("ignore"), os.environ.update(ROBOTBALL="1")
print(*changed(), sep=",")
"""


@pytest.mark.slow
def test_to_import_every_module_changes_no_setting_of_the_process() -> None:
    """Neither of numba, matplotlib, NumPy and warnings nor the environment; planted ones show."""
    names = [name for name in MODULES if not name.endswith("__main__")]
    command = [sys.executable, "-c", SETTINGS, *names]
    ours, planted = subprocess.check_output(command, text=True, cwd=PROJECT).splitlines()
    assert (ours, planted) == ("", "numba,matplotlib,numpy,warnings,environment")
