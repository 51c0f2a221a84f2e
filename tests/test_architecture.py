"""The architecture is as its plan says, and the tests of it catch what they forbid."""

import ast
import os
import subprocess
import sys
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from robotball.engine import OURS
from tests.imports import PROJECT, graph_of, imported, modules_of, reached

ENGINES = PROJECT / "robotball/engines"
MODULES = modules_of(PROJECT)
GRAPH = graph_of(MODULES)
Graph = Mapping[str, set[str]]
ADAPTERS = tuple(f"robotball.engines.{name}" for name in OURS if (ENGINES / f"{name}.py").is_file())
REFERENCES = ("robotball.engines.reduced", "robotball.engines.multibody")
ROOMS = (*REFERENCES, "robotball.engines.mujoco", "robotball.engines.recorded", *ADAPTERS)
# Each may import those before it, and none after it.
FLOORS = (
    ("robotball",),
    ("validation.output",),
    ("validation.sweeps",),
    ("validation.sensitivity", "validation.agreement", "validation.results"),
    ("validation.plots", "validation.runs", "validation.study"),
    ("validation.options",),
    ("validation.studies",),
    ("validation.figures", "validation.paper", "validation.bench", "validation.report"),
    ("validation.commands",),
    ("validation.cli",),
    ("validation.__main__",),
)


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def floor_of(name: str) -> int:
    (floor,) = [i for i, homes in enumerate(FLOORS) if any(within(name, home) for home in homes)]
    return floor


def backward(graph: Graph) -> list[str]:
    """Imports that run up from a floor to a higher one."""
    return [
        f"{name} -> {other}"
        for name, others in graph.items()
        if name != "validation"
        for other in others
        if other != "validation" and floor_of(other) > floor_of(name)
    ]


def between_rooms(graph: Graph) -> list[str]:
    """Modules of one engine's room that reach a module of another's."""
    return [
        f"{name} -> {other}"
        for name in graph
        for room in ROOMS
        if within(name, room)
        for other in reached(graph, name)
        if any(within(other, each) for each in ROOMS if each != room)
    ]


def types_known_outside(graph: Graph) -> list[str]:
    """Modules of the library outside the contact engine's room that import from it."""
    room = "robotball.engines.mujoco"
    return [
        f"{name} -> {other}"
        for name, others in graph.items()
        if within(name, "robotball") and not within(name, room)
        for other in others
        if within(other, room)
    ]


def test_no_import_runs_up() -> None:
    """The library stands without validation, and no study knows a command."""
    assert backward(GRAPH) == []


def test_no_imports_go_in_a_circle() -> None:
    """Of all modules, those loaded late by a command included."""
    TopologicalSorter(GRAPH).prepare()  # raises CycleError, with the circle


def test_no_engine_knows_another() -> None:
    """The equations never reach the contact model, nor it their integration, however far."""
    assert between_rooms(GRAPH) == []
    both = [reached(GRAPH, ROOMS[0]), reached(GRAPH, f"{ROOMS[2]}.mujoco_engine")]
    assert {"robotball.equations", "robotball.scene", "robotball.motion"} <= both[0] & both[1]


def test_nothing_outside_an_engines_room_knows_its_types() -> None:
    """The library goes through the registry alone."""
    assert types_known_outside(GRAPH) == []


@pytest.mark.parametrize(
    ("home", "line"),
    [
        ("robotball/engines/reduced.py", "from robotball.engines.mujoco import model"),
        ("robotball/engines/reduced.py", "import robotball.engines.mujoco.model"),
        ("robotball/engines/reduced.py", "from .mujoco.model import build"),
        ("robotball/motion.py", "def f():\n    from robotball.engines.mujoco import model"),
        ("robotball/scene.py", "from validation.sweeps import sweep"),
        ("robotball/scene.py", "import validation"),
        ("validation/studies/convergence.py", "from validation.commands import compare"),
        ("robotball/equations.py", "from robotball import scene"),
    ],
)
def test_an_import_that_is_forbidden_is_found(tmp_path: Path, home: str, line: str) -> None:
    """The same checks on the same files with one line more; at least one of them fails."""
    changed = tmp_path / Path(home).name
    changed.write_text(f"{(PROJECT / home).read_text()}\n\n{line}\n")
    module = home.removesuffix(".py").replace("/", ".")
    graph = {**GRAPH, module: set(imported(module, changed, MODULES))}
    try:
        TopologicalSorter(graph).prepare()
        circles = False
    except CycleError:
        circles = True
    up = [each for each in graph["robotball.scene"] if within(each, "validation")]
    assert circles or up or backward(graph) or between_rooms(graph) or types_known_outside(graph)


def test_the_tests_mirror_the_packages() -> None:
    """Every folder of tests is one of the packages'."""
    here = Path(__file__).parent
    folders = {file.parent.relative_to(here) for file in here.rglob("test_*.py")}
    assert {folder for folder in folders if not (PROJECT / folder).is_dir()} == set()


def names_typed(file: Path, name: str) -> list[str]:
    """The texts of a module that hold a name, but for docstrings and what names a module."""
    tree = ast.parse(file.read_text())
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and name in node.value
        and id(node) not in docstrings
    ]


def test_an_engines_name_is_typed_in_its_room_alone() -> None:
    """What is printed, drawn and written takes it from the engine's label."""
    typed = {
        name: texts
        for name, file in MODULES.items()
        if not within(name, "robotball.engines.mujoco") and (texts := names_typed(file, "MuJoCo"))
    }
    assert typed == {}


# What tyro and Python's own library need comes on top.
HELP_IMPORTS = {
    "robotball", "robotball.errors", "robotball.files", "robotball.files.replacing",
    "robotball.cores", "validation", "validation.cli", "validation.options",
}  # fmt: skip


@pytest.mark.slow
def test_help_imports_next_to_nothing() -> None:
    """The command line loads what a command needs when that command runs."""
    code = "import sys, validation.cli; print(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True).split()
    heavy = {"numpy", "scipy", "mujoco", "matplotlib", "numba", "msgspec", "dm_control", "mediapy"}
    assert heavy & set(loaded) == set()
    ours = {name for name in loaded if within(name, "robotball") or within(name, "validation")}
    assert ours == HELP_IMPORTS


def code_lines(file: Path) -> int:
    """The lines that are not blank, a comment or a docstring."""
    text = file.read_text()
    strings = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(bool(line) and line[0] != "#" and i not in strings for i, line in lines)


@pytest.mark.parametrize(
    ("code", "most_files", "most_lines"),
    [
        # Measured 27 files and 4662 lines.
        ("from validation import compare; compare('fig12')", 27, 4700),
        # Measured 14 files and 2487 lines.
        ("import robotball as rb; rb.integrate(rb.load_scene('fig12'))", 14, 2500),
    ],
)
def test_a_run_loads_what_it_needs(code: str, most_files: int, most_lines: int) -> None:
    """A fresh process loads a core that can be read in an evening; the rest loads when asked for.

    The bounds are what is measured, rounded up: what is new behind a door does not count.
    """
    listed = "import sys; print(*sys.modules)"
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    loaded = subprocess.check_output(
        [sys.executable, "-c", f"{code}; {listed}"], text=True, env=environment
    )
    files = [MODULES[name] for name in loaded.split() if name in MODULES]
    lines = sum(map(code_lines, files))
    assert (len(files) <= most_files, lines <= most_lines) == (True, True), (
        f"{len(files)} files with {lines} lines: " + ", ".join(sorted(file.stem for file in files))
    )
