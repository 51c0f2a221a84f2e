"""The house stands as its plan says."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

HOUSE = Path(__file__).parent.parent
MODULES = sorted((HOUSE / "robotball").rglob("*.py"))
LAYER = sorted((HOUSE / "validation").rglob("*.py"))


def imports_of(path: Path) -> set[str]:
    """The modules that a file imports, by their full names."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_the_library_never_imports_the_validation_layer(path: Path) -> None:
    """robotball stands without validation."""
    assert not any(name.split(".")[0] == "validation" for name in imports_of(path))


def test_no_imports_go_in_a_circle() -> None:
    """Of all modules, those loaded late by a command included."""
    names = {
        ".".join(path.relative_to(HOUSE).with_suffix("").parts).removesuffix(".__init__")
        for path in (*MODULES, *LAYER)
    }
    graph = {name: members_of(name, names) for name in names}
    TopologicalSorter(graph).prepare()  # raises CycleError, with the circle


def members_of(module: str, names: set[str]) -> set[str]:
    """The modules among `names` that one imports, or imports names from."""
    file = HOUSE / module.replace(".", "/")
    path = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (inner & names) or {node.module}
    return (found & names) - {module}


def test_neither_engine_knows_the_other() -> None:
    """The equations never reach MuJoCo, and MuJoCo's side never reaches their integration."""

    def reached(module: str, seen: set[str]) -> set[str]:
        path = HOUSE / f"{module.replace('.', '/')}.py"
        if module in seen or not path.exists():
            return seen
        seen.add(module)
        for name in imports_of(path):
            reached(name, seen)
        return seen

    equations, engine = (
        reached("robotball.engines.reduced.integrate", set()),
        reached("robotball.engines.mujoco.run", set()),
    )
    assert "robotball.engines.mujoco.model" not in equations
    assert "robotball.engines.reduced.integrate" not in engine
    assert {"robotball.equations", "robotball.scene"} <= equations & engine
