"""Any result can be written as JSON, and the JSON is strict."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NoReturn

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robotball.files import embedded_json, json_text
from tests.pages import Page


@dataclass
class Point:
    """A dataclass with any value."""

    x: Any
    y: Any = math.nan


class Pair(msgspec.Struct):
    """A msgspec struct with any value."""

    a: Any
    b: Any = None


class Colour(Enum):
    """An enumeration with values of two types."""

    RED = "red"
    BLUE = np.float32(3)


class Broken(Mapping[str, Any]):
    """An object whose methods all raise."""

    def __getitem__(self, key: str) -> NoReturn:
        raise RuntimeError(key)

    __len__ = __iter__ = __str__ = __getitem__  # type: ignore[assignment]


def strict(text: str) -> Any:
    """Read JSON, refusing the NaN and Infinity that Python's reader accepts."""

    def refused(constant: str) -> NoReturn:
        raise ValueError(constant)

    return json.loads(text, parse_constant=refused)


NUMBERS = st.one_of(
    st.integers(),
    st.integers(300, 5000).map(lambda n: 10**n),
    st.floats(),
    st.fractions(),
    st.complex_numbers(),
    *(arrays(kind, ()).map(lambda a: a[()]) for kind in (float, np.float32, int, bool, complex)),
)
LEAVES = st.one_of(
    NUMBERS, st.none(), st.booleans(), st.text(), st.text(st.characters(categories=["Cs"])),
    st.binary(), st.sampled_from([Path("a/b"), *Colour, Colour, Broken(), object(), len]),
    arrays(st.sampled_from([np.dtype(float), np.dtype("U3"), np.dtype("M8[s]")]), (2, 1)),
)  # fmt: skip
KEYS = st.one_of(st.text(), st.integers(), st.floats(), st.sampled_from([*Colour, None]))
ANYTHING = st.recursive(
    LEAVES,
    lambda parts: st.one_of(
        st.lists(parts),
        st.dictionaries(KEYS, parts),
        st.tuples(parts, parts),
        st.builds(Point, parts),
        st.builds(Pair, parts),
        st.frozensets(st.integers()),
        parts.map(lambda part: np.array([part, None], dtype=object)),
    ),
    max_leaves=20,
)


@settings(max_examples=60)
@given(ANYTHING, st.sampled_from([None, 1]))
def test_any_nested_result_is_written_as_strict_json(value: object, indent: int | None) -> None:
    """It is valid UTF-8, and on one line unless indented."""
    text = json_text(value, indent)
    strict(text.encode().decode())
    assert indent is not None or "\n" not in text


def endless() -> Iterator[int]:
    """Yield forever."""
    while True:
        yield 1


CYCLE: dict[str, Any] = {"x": 1}
CYCLE.update(a=CYCLE, b=[CYCLE])
# Deeper than any Python writes as text; Python 3.13 writes 5000 levels.
DEEP: list[Any] = []
for _ in range(100_000):
    DEEP = [DEEP]
VALUES = {
    "finite": ([0.1, 1e300, 3, True, None, "é"], [0.1, 1e300, 3, True, None, "é"]),
    "not finite": ([math.nan, math.inf, -math.inf, np.float32("nan")], [None] * 4),
    "too large": (10**400, None),
    "numpy": ([np.int8(3), np.float32(0.5), np.bool_(True), np.ones(1)], [3, 0.5, True, [1.0]]),
    "array with NaN": (np.array([[1.0, np.nan]]), [[1.0, None]]),
    "dataclass": (Point(1), {"x": 1, "y": None}),
    "struct": (Pair(Point(2)), {"a": {"x": 2, "y": None}, "b": None}),
    "enumeration": ([*Colour], ["red", 3.0]),
    "keys": ({Colour.RED: 1, 2: 3}, {"red": 1, "2": 3}),
    "path": (Path("a/b"), "a/b"),
    "half a character": ("a\ud800", "a?"),
    "complex": (1 + 2j, "(1+2j)"),
    "broken": (Broken(), "<Broken>"),
}


@pytest.mark.parametrize("name", VALUES)
def test_each_kind_of_value_has_its_form(name: str) -> None:
    value, form = VALUES[name]
    assert strict(json_text(value)) == form


@pytest.mark.parametrize("value", [CYCLE, DEEP, endless()], ids=["cycle", "deep", "endless"])
def test_the_text_of_an_endless_object_is_cut_off(value: object) -> None:
    assert len(json_text(value)) < 10_000
    strict(json_text(value))


@given(st.text(st.sampled_from("<!-/scriptSCRIPT>&\"' \u2028")) | st.just("<!--<script>"))
def test_embedded_json_cannot_end_its_script(text: str) -> None:
    """Nor start a comment, in which the script's end tag would not count."""
    embedded = embedded_json({text: [text]})
    page = Page(f'<script type="application/json">{embedded}</script><script>end</script>')
    assert [strict(page.scripts[0]), page.scripts[1]] == [{text: [text]}, "end"]
    assert "<" not in embedded
