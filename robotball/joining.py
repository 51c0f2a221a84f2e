"""One motion of its consecutive parts, which are made one after the other."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from numpy.typing import NDArray

from robotball.motion import Motion, Place, arrays_of
from robotball.room import let_go, room

AnyMotion = TypeVar("AnyMotion", bound=Motion)


def joined(parts: Iterable[AnyMotion], count: int) -> AnyMotion:
    """One motion of its consecutive parts, of `count` times at most in all.

    Each part is let go before the next is made; a long motion is in files (room.py).
    """
    done, whole, last = 0, {}, None
    for last in parts:
        size = len(last.times)
        for place, array in arrays_of(last):
            if place not in whole:
                whole[place] = room((count, *array.shape[1:]), array.dtype)
            whole[place][done : done + size] = array
        done += size
        let_go()
    assert last is not None
    return _with_arrays(last, {place: array[:done] for place, array in whole.items()})


def _with_arrays(record: Any, arrays: Mapping[Place, NDArray[Any]]) -> Any:
    own: dict[str, Any] = {place[0]: array for place, array in arrays.items() if len(place) == 1}
    for name in {place[0] for place in arrays} - set(own):
        inner = {place[1:]: array for place, array in arrays.items() if place[0] == name}
        own[name] = _with_arrays(getattr(record, name), inner)
    return replace(record, **own)
