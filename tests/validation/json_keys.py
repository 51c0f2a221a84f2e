"""The keys of a command's JSON, compared with docs/json.md."""

import re
from collections.abc import Iterable, Iterator
from typing import Any

from tests.imports import PROJECT

PAGE = (PROJECT / "docs" / "json.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (`.*?`) \| .*? ?\| ?(.*) \|$", re.MULTILINE)


def misfits(section: str, record: Any) -> set[str]:
    """Return the keys that a record has in excess or lacks, compared with its table.

    Null and empty lists have no keys. Keys with `if` or `where` in their meaning are optional.
    """
    table = PAGE.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    rows = [
        (key, meaning)
        for keys, meaning in ROW.findall(table)
        for key in re.findall("`(.+?)`", keys)
    ]
    paths = dict(_paths(record))
    empty = [path for path, value in paths.items() if value in (None, [], {})]
    matches = {key: _matching(key, paths) for key, _ in rows}
    above = {
        key: {path for part in _above(key) for path in _matching(part, empty)} for key in matches
    }
    lost = {
        key
        for key, meaning in rows
        if not matches[key] and not above[key] and not re.search(r"\b(if|where)\b", meaning)
    }
    versions = {path for path in paths if path.startswith("versions.")}
    return {*paths}.difference(versions, *matches.values(), *above.values()) | lost


def _above(key: str) -> Iterator[str]:
    """Yield the keys of the objects and lists that contain a key."""
    return (key[: cut.start()] for cut in re.finditer(r"\.|\[", key))


def _matching(key: str, paths: Iterable[str]) -> set[str]:
    """Return the paths that match a listed key."""
    return {path for path in paths if re.fullmatch(_pattern(key), path)}


def _pattern(key: str) -> str:
    pattern = re.sub(r"\d+$", r"\\d+", re.escape(key)).replace("NAME", ".+")
    return re.sub(r"\\\.…$", r"[.[].+", pattern)


def _paths(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the paths of the values that are neither objects nor lists of objects."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from _paths(item, f"{path}.{key}".removeprefix("."))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for item in value:
            yield from _paths(item, f"{path}[]" if path else "")
    else:
        yield path, value
