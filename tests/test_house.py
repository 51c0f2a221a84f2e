"""The house stands as its plan says."""

import ast
from pathlib import Path

import pytest

HOUSE = Path(__file__).parent.parent
MODULES = sorted((HOUSE / "robotball").rglob("*.py"))


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

    equations, engine = reached("robotball.reduced", set()), reached("robotball.simulate", set())
    assert "robotball.contact.model" not in equations
    assert "robotball.reduced" not in engine
    assert {"robotball.equations", "robotball.scene"} <= equations & engine
