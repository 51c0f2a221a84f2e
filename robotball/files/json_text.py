"""Write any result as strict JSON, also inside a web page.

Results are written after long computations, so writing never fails: a value without a JSON
equivalent becomes null, a list, an object or its text.
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

_MAX_DEPTH = 100  # nested lists and objects; JSON readers may refuse more
_MAX_BITS = 1024  # of an integer; more would overflow a float


def json_text(value: object, indent: int | None = None) -> str:
    """Return a value as JSON text, on one line if `indent` is None.

    NaN, infinities and integers beyond the range of a float become null, enumeration members their
    value, dataclasses and msgspec structs objects, arrays and other collections lists, and any
    other value its text.
    """
    return json.dumps(_plain(value), indent=indent, ensure_ascii=False)


def embedded_json(value: object) -> str:
    """Return JSON that cannot end a script element of a page: `<` is escaped."""
    return json_text(value).replace("<", "\\u003c")


def _plain(value: Any, above: tuple[int, ...] = ()) -> Any:
    """Return a value as JSON types; above: ids of the containers around it."""
    try:
        match value:
            case None | bool():
                return value
            case Enum():
                return _plain(value.value, above)
            case str():
                return _text(value)
            case Integral():
                return int(value) if int(value).bit_length() <= _MAX_BITS else None
            case Real():
                return float(value) if math.isfinite(value) else None
            case _ if id(value) in above or len(above) >= _MAX_DEPTH or isinstance(value, bytes):
                return _text(value)
            case np.ndarray() | np.generic():
                inside = value.tolist()
                return _text(value) if inside is value else _plain(inside, (*above, id(value)))
            case Mapping():
                items = [*value.items()]
            case _ if is_dataclass(value) and not isinstance(value, type):
                items = [(field.name, getattr(value, field.name)) for field in fields(value)]
            case msgspec.Struct():
                items = [(name, getattr(value, name)) for name in value.__struct_fields__]
            case Collection():
                return [_plain(item, (*above, id(value))) for item in value]
            case _:
                return _text(value)
        return {_key(key): _plain(item, (*above, id(value))) for key, item in items}
    except Exception:  # raised by a method of the object; the other results must not be lost
        return _text(value)


def _key(key: object) -> str:
    return _text(key.value if isinstance(key, Enum) else key)


def _text(value: object) -> str:
    """Return a value's text, with unpaired surrogates replaced by `?`."""
    try:
        return str(value).encode(errors="replace").decode()
    except Exception:
        return f"<{type(value).__name__}>"
