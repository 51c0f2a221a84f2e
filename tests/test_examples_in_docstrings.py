"""Every public name has a numpydoc docstring with an example that runs."""

import ast
import doctest
import inspect
import re
import warnings
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from robotball.view import gl
from tests.imports import PUBLIC

# The sections of numpydoc that are in use, in its order.
SECTIONS = ("Parameters", "Attributes", "Returns", "Raises", "Warns", "Notes", "Examples")
NAMED = ("Parameters", "Attributes")


def docstring(home: str, name: str) -> str:
    """Return the docstring of a function or class, or the string below a constant."""
    body = ast.parse(Path(import_module(home).__file__ or "").read_text()).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return ast.get_docstring(node) or ""
        targets = [getattr(node, "target", None), *getattr(node, "targets", [])]
        if name in [target.id for target in targets if isinstance(target, ast.Name)]:
            text = after.value if isinstance(after, ast.Expr) else None
            return inspect.cleandoc(str(text.value)) if isinstance(text, ast.Constant) else ""
    return ""


def sections_of(text: str) -> dict[str, str]:
    """Return the sections of a docstring by title; the text above the first has title ""."""
    head, *rest = re.split(r"(?m)^(\w[\w ]*)\n-{3,}$", text)
    return {"": head, **dict(zip(rest[::2], rest[1::2], strict=True))}


def entries(section: str) -> dict[str, str]:
    """Return the names (or, without names, types) in a section with their descriptions."""
    pairs = re.findall(r"(?m)^(\S.*)\n((?:(?: +.*)?\n?(?=$| |\n))*)", section.strip("\n") + "\n")
    return {head.partition(" : ")[0].strip("* "): text.strip() for head, text in pairs}


def needed(value: Any) -> set[str]:
    """Return the parameters of a function, or the fields that a class adds to its base."""
    if inspect.isfunction(value):
        return set(inspect.signature(value).parameters)
    if not inspect.isclass(value) or issubclass(value, Enum):
        return set()
    if struct := getattr(value, "__struct_fields__", ()):  # msgspec
        return set(struct)
    if not is_dataclass(value):
        annotations = vars(value).get("__annotations__", {})
        return {name for name in annotations if name[0] != "_"}
    base = value.__mro__[1]
    known = fields(base) if is_dataclass(base) else ()
    return {field.name for field in fields(value)} - {field.name for field in known}


def faults(text: str, value: Any) -> Iterator[str]:
    """Yield the rules of numpydoc that the docstring of a value breaks."""
    sections = sections_of(text)
    summary, _, more = sections[""].partition("\n")
    if not re.fullmatch(r"[A-Z][a-z]+ [^;]*\.", summary) or summary.split()[0] in ("A", "The"):
        yield "the summary is not a one-line sentence that begins with a verb"
    if more.partition("\n")[0].strip():
        yield "the summary has a second line"
    titles = [title for title in sections if title]
    if titles != [title for title in SECTIONS if title in titles]:
        yield f"sections {titles}"
    named = {
        name.strip(): text
        for title in NAMED
        for names, text in entries(sections.get(title, "")).items()
        for name in names.split(",")
    }
    if missing := needed(value) - named.keys():
        yield f"no entry for {sorted(missing)}"
    allowed = needed(value) if inspect.isfunction(value) else {*needed(value), *dir(value)}
    if inspect.isclass(value):
        allowed |= {*inspect.signature(value.__init__).parameters}
    if unknown := named.keys() - allowed:
        yield f"unknown names {sorted(unknown)}"
    others = [
        entries(sections[title]) for title in ("Returns", "Raises", "Warns") if title in sections
    ]
    if empty := [name for group in (named, *others) for name, text in group.items() if not text]:
        yield f"no description of {empty}"
    if inspect.isfunction(value) and "Returns" not in titles:
        yield "no Returns"
    if ">>> " not in sections.get("Examples", ""):
        yield "no example"


@pytest.mark.parametrize(("home", "name"), PUBLIC, ids=lambda text: text.rpartition(".")[2])
def test_a_public_name_has_a_complete_numpydoc_docstring(home: str, name: str) -> None:
    """A summary, every parameter or field, the return value and an example."""
    assert [*faults(docstring(home, name), getattr(import_module(home), name))] == []


@pytest.mark.parametrize(("home", "name"), PUBLIC, ids=lambda text: text.rpartition(".")[2])
def test_an_example_prints_its_stated_output(
    home: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each runs alone in an empty folder, with its own imports."""
    if name == "dm_environment":
        pytest.importorskip("dm_control", reason="dm-control is not installed")
    if name == "film" and gl.find_backend() is None:
        pytest.skip(gl.advice())
    monkeypatch.chdir(tmp_path)
    assert failures(docstring(home, name)) == []


def failures(text: str) -> list[str]:
    printed: list[str] = []
    examples = doctest.DocTestParser().get_doctest(text, {}, "example", None, None)
    assert examples.examples
    with warnings.catch_warnings():
        doctest.DocTestRunner(verbose=False).run(examples, out=printed.append)
    return printed


GOOD = """Add two numbers.

Parameters
----------
a : int
    The first.
b : int, optional
    The second.

Returns
-------
int
    The sum.

Examples
--------
>>> 1 + 2
3
"""


def add(a: int, b: int = 1) -> int:
    return a + b


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("Add two numbers.", "The sum of two numbers.", "the summary is not"),
        ("Add two numbers.", "Add one; add another.", "the summary is not"),
        ("numbers.\n", "numbers.\nOr none.\n", "the summary has"),
        ("b : int, optional\n    The second.\n", "", "no entry for ['b']"),
        ("b : int", "b, c : int", "unknown names ['c']"),
        ("    The second.\n", "", "no description of ['b']"),
        ("    The sum.\n", "", "no description of ['int']"),
        ("Returns\n-------", "Yield\n-----", "sections"),
        ("Returns\n-------\nint\n    The sum.\n", "", "no Returns"),
        (">>> 1 + 2\n3", "None.", "no example"),
    ],
)
def test_a_docstring_that_breaks_a_rule_is_found(old: str, new: str, fault: str) -> None:
    """A good one passes; every broken rule and a wrong output are named."""
    assert [*faults(GOOD, add)] == []
    assert any(text.startswith(fault) for text in faults(GOOD.replace(old, new), add)), old
    assert failures(GOOD) == []
    assert "Expected:\n    4\n" in "".join(failures(GOOD.replace("3", "4")))
