"""Imports between the project's modules, read from the files; lazy imports included."""

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.util import resolve_name
from pathlib import Path

PROJECT = Path(__file__).parent.parent
PACKAGES = ("robotball", "validation")
# (home module, name) of every public name.
PUBLIC = [
    (f"{package}.{home}", name)
    for package in PACKAGES
    for stub in [(PROJECT / package / "__init__.pyi").read_text()]
    for home, name in re.findall(r"^from \.(\S+) import \w+ as (\w+)$", stub, re.MULTILINE)
]


def modules_of(root: Path, packages: Sequence[str] = PACKAGES) -> dict[str, Path]:
    """Return the modules of packages under a root by full name."""
    files = [file for package in packages for file in sorted((root / package).rglob("*.py"))]
    return {_name(file.relative_to(root)): file for file in files}


def graph_of(modules: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return each module's imports of the others, by `import`, `from` or as a package's attribute.

    A package's own imports count only if the module takes a name from them.
    """
    return {name: set(imported(name, file, modules)) for name, file in modules.items()}


def reached(graph: Mapping[str, set[str]], start: str) -> set[str]:
    """Return all modules that a module imports, directly or not."""
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        for module in graph[waiting.pop()] - seen:
            seen.add(module)
            waiting.append(module)
    return seen


@cache
def nodes_of(text: str) -> list[ast.AST]:
    """Return the syntax nodes of a module's text, parsed once for all checks."""
    return [*ast.walk(ast.parse(text))]


def imported(module: str, file: Path, modules: Mapping[str, Path]) -> Iterator[str]:
    """Yield the other modules that one module imports."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    for node in nodes_of(file.read_text()):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            home = resolve_name("." * node.level + (node.module or ""), package)
            names = [f"{home}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            while name and name not in modules:  # strip attributes
                name = name.rpartition(".")[0]
            if name:
                yield name


def _name(file: Path) -> str:
    return ".".join(file.with_suffix("").parts).removesuffix(".__init__")
