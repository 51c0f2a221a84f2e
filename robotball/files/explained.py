"""Explain what is wrong in a scene file: the key's path first, then what it takes."""

import difflib
import re
from collections.abc import Iterator

from msgspec import inspect

from robotball.files.scene_tables import SceneTable

WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
# Other formats' words for a key, of which another key has more letters.
MEANT = dict.fromkeys(("max_torque", "torque_max", "effort", "forcerange"), "torque_limit")
MANY = ("rotor", "pendulum", "part")


def explained(message: str) -> str:
    """Return msgspec's message with the key's path first, and near matches or the known values."""
    where = re.search(r" - at `\$\.?(.*)`$", message)
    key, what = (where[1], message[: where.start()]) if where else ("", message)
    told = _told(key, what)
    return f"{key}: {told}" if key else told


def counted(message: str) -> str:
    """Return the message with bodies numbered from 1, as everywhere else: rotor[0] is rotor1."""
    many = rf"\b({'|'.join(MANY)})\[(\d+)\]"
    return re.sub(many, lambda found: f"{found[1]}{int(found[2]) + 1}", message)


def _told(key: str, what: str) -> str:
    if unknown := re.search(r"unknown field `(.*)`", what):
        word, known = unknown[1], known_keys(key)
        meant = MEANT.get(word)
        near = [meant] if meant in known else difflib.get_close_matches(word, known, n=1)
        return f"unknown key {word!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    if missing := re.search(r"missing required field `(.*)`", what):
        kinds = _listed(f"{key}.kind") if missing[1] == "kind" else ""
        return f"key {missing[1]!r} is missing{kinds}"
    if invalid := re.match(r"Invalid (?:enum )?value (.*)$", what):
        return f"unknown value {invalid[1]}{_listed(key)}"
    if expected := re.match(r"Expected (.*), got `?(\w+)`?$", what):
        if key.split(".")[-1] in MANY and expected[2] == "object":
            return f"a scene may have many; write [[{key}]] for each"
        types, given = expected[1].replace(" | null", ""), expected[2]
        types = re.sub(r"`array` of length (\d+)", r"a list of \1", types).replace(" | ", " or ")
        types = re.sub(r"\w+", lambda word: WORDS.get(word[0], word[0]), types).replace("`", "")
        return f"it must be {types}, not {WORDS.get(given, given)}"
    return what


def _listed(path: str) -> str:
    known = ", ".join(dict.fromkeys(_values_at(path)))
    return f"; it takes {known}" if known else ""


def known_keys(path: str) -> list[str]:
    """Return the keys of the table at a path such as `frame.part[0]`, of any of its kinds."""
    return [field.name for table in tables_at(path) for field in table.fields]


def tables_at(path: str) -> Iterator[inspect.StructType]:
    """Yield the tables that may stand at a path."""
    words = [word for word in re.sub(r"\[.*?\]", "", path).split(".") if word]
    found = [*tables_in(inspect.type_info(SceneTable))]
    for word in words:
        fields = [field for table in found for field in table.fields if field.name == word]
        found = [table for field in fields for table in tables_in(field.type)]
    yield from found


def tables_in(kind: inspect.Type) -> Iterator[inspect.StructType]:
    """Yield the tables that a value of a type may be, or hold in a list."""
    for each in _parts_of(kind):
        if isinstance(each, inspect.StructType):
            yield each


def _values_at(path: str) -> Iterator[str]:
    """Yield the words that may stand at a path."""
    above, _, name = path.rpartition(".")
    for table in tables_at(above):
        if name == table.tag_field:
            yield str(table.tag)
        for field in table.fields:
            if field.name == re.sub(r"\[.*", "", name):
                for kind in _parts_of(field.type):
                    if isinstance(kind, inspect.LiteralType):
                        yield from map(str, kind.values)


def _parts_of(kind: inspect.Type) -> Iterator[inspect.Type]:
    """Yield a type without its annotations, or the types of a union or of a list's items."""
    if isinstance(kind, inspect.Metadata):
        yield from _parts_of(kind.type)
    elif isinstance(kind, inspect.UnionType):
        for each in kind.types:
            yield from _parts_of(each)
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        yield from _parts_of(kind.item_type)
    else:
        yield kind
