"""The architecture follows its plan, and the checks find violations."""

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
# Every floor may import the floors before it only.
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
    """Return the imports of all modules; it takes half a second."""
    return graph_of(MODULES)


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def floor_of(name: str) -> int:
    homes = {home: floor for floor, homes in enumerate(FLOORS) for home in homes}
    return next(homes[home] for home in sorted(homes, key=len, reverse=True) if within(name, home))


def broken(graph: Mapping[str, set[str]]) -> Iterator[tuple[str, str]]:
    """Yield each broken rule with the import that breaks it."""
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
        for room in (room for room in ROOMS if within(name, room)):
            others_rooms = [other_room for other_room in ROOMS if other_room != room]
            for other in reached(graph, name):
                if any(within(other, other_room) for other_room in others_rooms):
                    yield "from a room to another", f"{name} -> {other}"


def test_imports_run_down_without_cycles_and_engines_are_independent() -> None:
    """Including late and indirect imports."""
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
def test_a_forbidden_import_is_found(tmp_path: Path, home: str, line: str, rule: str) -> None:
    """After one line has been added to a file."""
    changed, module = tmp_path / "changed.py", home.replace("/", ".")
    changed.write_text(f"{MODULES[module].read_text()}\n\n{line}\n")
    violations = dict(broken({**whole_graph(), module: set(imported(module, changed, MODULES))}))
    assert any(violation.startswith(rule) for violation in violations), violations


def test_the_folders_of_tests_mirror_the_packages() -> None:
    """Except for tests/paper."""
    here = Path(__file__).parent
    folders = {file.parent.relative_to(here) for file in here.rglob("test_*.py")}
    assert {folder for folder in folders if not (PROJECT / folder).is_dir()} == {Path("paper")}


def test_the_page_has_the_tree_in_the_order_of_the_floors() -> None:
    page = (PROJECT / "docs" / "architecture.md").read_text(encoding="utf-8")
    names = re.findall(r"^      (\w+)(?:/|\.py) ", page, re.MULTILINE)
    files = {path.stem for path in (PROJECT / "robotball").iterdir() if path.name[0] not in "_."}
    assert {*names} == files - {"py", "scenes"}
    floors = [floor_of(f"robotball.{name}") for name in names]
    assert floors == sorted(floors)


def test_tests_of_the_core_do_not_import_validation() -> None:
    """Nor do the helpers that they import."""
    modules = MODULES | modules_of(PROJECT, ("tests",))
    graph: dict[str, set[str]] = {name: set() for name in MODULES}
    graph |= {n: set(imported(n, modules[n], modules)) for n in modules.keys() - MODULES.keys()}
    known = {name: reached(graph, name) for name in graph if within(name, "tests.robotball")}
    assert len(known) > 50
    assert [
        (name, other) for name in known for other in known[name] if within(other, "validation")
    ] == []
    assert "validation" in reached(graph, "tests.validation.test_agreement")


def test_only_its_own_room_contains_an_engines_name() -> None:
    """Other code takes the name from the engine's label; docstrings may contain it."""
    for name, file in MODULES.items():
        if within(name, MUJOCO) or "MuJoCo" not in (text := file.read_text()):
            continue
        nodes = nodes_of(text)
        homes = [node for node in nodes if isinstance(node, HOMES) and node.body]
        docs = {home.body[0].value for home in homes if isinstance(home.body[0], ast.Expr)}
        constants = [node for node in nodes if isinstance(node, ast.Constant) and node not in docs]
        texts = [node.value for node in constants if isinstance(node.value, str)]
        assert not [text for text in texts if "MuJoCo" in text], name


def prose_of(text: str) -> Iterator[str]:
    for node in nodes_of(text):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    yield from re.findall(r"(?:^|\s)(#.*)", text)


def words_of(text: str) -> Iterator[str]:
    """Yield all names in a module, and its string constants."""
    for node in nodes_of(text):
        for key in ("name", "id", "attr", "arg"):
            name = getattr(node, key, None)
            yield from name.split(".") if isinstance(name, str) else ()
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def unknown_names(text: str, known: set[str]) -> Iterator[str]:
    """Yield names in prose that do not exist: `names`, and CONSTANTS that have become private."""
    names = {node.id for node in nodes_of(text) if isinstance(node, ast.Name)}
    for prose in prose_of(text):
        for name in re.findall(r"`([A-Za-z_][\w.]*)(?:\(.*?\))?`", prose):
            if name not in known and not set(name.split(".")) <= known:
                yield name
        for name in re.findall(r"(?<!\w)[A-Z][A-Z0-9]+(?:_[A-Z0-9]+)*(?![\w(])", prose):
            if name not in names and f"_{name}" in names and name not in OTHERS:
                yield name


# Names of other packages, and columns of a user's file.
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


def test_every_name_in_a_docstring_or_comment_exists() -> None:
    """In the two packages. A missing and a private name are found."""
    texts = {name: file.read_text() for name, file in MODULES.items()}
    known = {word for text in texts.values() for word in words_of(text)}
    known |= {part for name in MODULES for part in name.split(".")} | OTHERS | {*dir(builtins)}
    known |= {file.name for file in MODULES.values()} | {*keyword.kwlist}
    unknown = {name: [*unknown_names(text, known)] for name, text in texts.items()}
    assert {name: names for name, names in unknown.items() if names and name not in UNMENDED} == {}
    planted = '"""Of `no_such_name`, `path_error` and COUNT."""\n_COUNT = 1  # as `str.such_a_one`'
    assert [*unknown_names(planted, known)] == ["no_such_name", "COUNT", "str.such_a_one"]


def test_the_core_loads_validation_only_for_six_everyday_names() -> None:
    """`robotball.compare` and five others come from validation, so that users need one import only.

    They are loaded on first use; all else in robotball works without validation.
    """
    assert {
        name
        for name in MODULES
        if within(name, "robotball")
        for text in strings_of(MODULES[name])
        if text.split(".")[0] == "validation"
    } == {"robotball", "robotball.errors"}  # errors needs it to attribute warnings to user code
    code = """
import sys, robotball as rb
rb.integrate(rb.load_scene("fig12"), rb.sample_times(0.1))
before = "validation" in sys.modules
print(before, *(getattr(rb, name).__module__ for name in rb._EVERYDAY), "compare" in dir(rb))
"""
    output = subprocess.check_output([sys.executable, "-c", code], text=True).split()
    assert output == [
        "False",
        "validation.agreement",
        "validation.results",
        "validation.check.checking",
        "validation.agreement",
        "validation.many_runs",
        "validation.many_runs",
        "True",
    ]


def strings_of(file: Path) -> Iterator[str]:
    for node in nodes_of(file.read_text()):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


# numba loads scipy.linalg.
PARTS_OF_SCIPY = {f"scipy.{part}" for part in ("integrate", "optimize", "spatial", "special")}
LISTED = """import contextlib
from validation.cli import main
with contextlib.suppress(SystemExit): main(["engines"])"""


@pytest.mark.parametrize(
    ("code", "count", "unneeded"),
    [
        ("from validation import compare; compare('fig12')", 29, {"matplotlib", "numba", "scipy"}),
        ("import robotball as rb; rb.integrate('fig12', 0.1)", 16, {"mujoco", "numba", "scipy"}),
        ("import robotball as rb; rb.integrate('pendulum_robot', 0.1)", 31, PARTS_OF_SCIPY),
        (LISTED, 64, {"matplotlib", "numba", "scipy"}),
        ("import validation.studies.fitting", 39, {"matplotlib", "scipy.stats"}),
        ("import robotball.view.render", 19, {"matplotlib.pyplot", "scipy"}),
        ("import validation.cli", 5, {"numpy", "msgspec"}),  # robotball --help
    ],
)
def test_a_run_loads_only_the_files_that_it_needs(
    code: str, count: int, unneeded: set[str]
) -> None:
    """At most `count` files with code, and no package that it does not need."""
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    output = subprocess.check_output(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        text=True,
        env=environment,
    )
    loaded = output.splitlines()[-1].split()
    files = [MODULES[name] for name in loaded if name in MODULES]
    with_code = [file for file in files if len(nodes_of(file.read_text())) > 3]  # else docstrings
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
def test_importing_every_module_changes_no_setting_of_the_process() -> None:
    """Of numba, matplotlib, NumPy, warnings and the environment; planted changes are found."""
    names = [name for name in MODULES if not name.endswith("__main__")]
    command = [sys.executable, "-c", SETTINGS, *names]
    ours, planted = subprocess.check_output(command, text=True, cwd=PROJECT).splitlines()
    assert (ours, planted) == ("", "numba,matplotlib,numpy,warnings,environment")
