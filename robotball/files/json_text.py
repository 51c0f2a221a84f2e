"""Write any result as strict JSON, also inside a web page.

A result is written after the work, so writing never fails: a value that JSON does not have becomes
null, a list, an object or its text.
"""

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from typing import Any

import msgspec
import numpy as np

_DEEPEST = 100  # levels of lists and objects; readers may refuse more
_LARGEST = 1024  # bits of an integer; a float overflows beyond it


def json_text(value: object, indent: int | None = None) -> str:
    """Return a value as JSON text, on one line if `indent` is None.

    A number that is NaN, infinite or too large for a float becomes null, a member of an enumeration
    its value, a dataclass or msgspec struct an object, an array or other collection a list. All
    other values become their text.
    """
    return json.dumps(_plain(value), indent=indent, ensure_ascii=False)


def embedded_json(value: object) -> str:
    """Return JSON that ends no script of a page: `<` is written as an escape sequence."""
    return json_text(value).replace("<", "\\u003c")


def _plain(value: Any, above: tuple[int, ...] = ()) -> Any:
    """Return a value as the types that JSON has; above: the ids of what contains it."""
    try:
        match value:
            case None | bool():
                return value
            case Enum():
                return _plain(value.value, above)
            case str():
                return _text(value)
            case Integral():
                return int(value) if int(value).bit_length() <= _LARGEST else None
            case Real():
                return float(value) if math.isfinite(value) else None
            case _ if id(value) in above or len(above) >= _DEEPEST or isinstance(value, bytes):
                return _text(value)
            case np.ndarray() | np.generic():
                inside = value.tolist()
                return _text(value) if inside is value else _plain(inside, (*above, id(value)))
            case Mapping():
                items = [*value.items()]
            case _ if is_dataclass(value) and not isinstance(value, type):
                items = [(each.name, getattr(value, each.name)) for each in fields(value)]
            case msgspec.Struct():
                items = [(name, getattr(value, name)) for name in value.__struct_fields__]
            case Collection():
                return [_plain(each, (*above, id(value))) for each in value]
            case _:
                return _text(value)
        return {_key(key): _plain(each, (*above, id(value))) for key, each in items}
    except Exception:  # of an object's own methods; the other results must not be lost
        return _text(value)


def _key(key: object) -> str:
    return _text(key.value if isinstance(key, Enum) else key)


def _text(value: object) -> str:
    """Return a value's text, in which half a character is `?`."""
    try:
        return str(value).encode(errors="replace").decode()
    except Exception:
        return f"<{type(value).__name__}>"
