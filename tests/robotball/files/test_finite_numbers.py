"""Every number of a scene file must be finite, and is named where it is not."""

import json
import re
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

import robotball as rb
from tests.robotball.files.scene_texts import Write, edited, refusal


def numbers(value: Any, path: str = "") -> Iterator[str]:
    """The paths of all the numbers in a decoded TOML value, as `rotor[0].axis[2]`."""
    if isinstance(value, float | int) and not isinstance(value, bool):
        yield path
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from numbers(inner, f"{path}[{i}]")


def replaced(value: Any, path: str, new: float, here: str = "") -> Any:
    """The decoded TOML value with the number at `path` replaced."""
    if here == path:
        return new
    if isinstance(value, dict):
        return {
            key: replaced(inner, path, new, f"{here}.{key}" if here else key)
            for key, inner in value.items()
        }
    if isinstance(value, list):
        return [replaced(inner, path, new, f"{here}[{i}]") for i, inner in enumerate(value)]
    return value


def toml(value: Any) -> str:
    """A value as TOML: a table's keys a line each, everything inside them inline."""

    def inline(value: Any) -> str:
        if isinstance(value, dict):
            return f"{{ {', '.join(f'{key} = {inline(v)}' for key, v in value.items())} }}"
        if isinstance(value, list):
            return f"[{', '.join(map(inline, value))}]"
        return json.dumps(value) if isinstance(value, str | bool) else repr(value)

    return "\n".join(f"{key} = {inline(inner)}" for key, inner in value.items())


# Every key that can hold a number stands in one of these.
FULL = msgspec.toml.decode(
    edited('inertia = "thin"', "inertia = { axial = 0.05, transverse = 0.05 }").replace(
        "[shell]", "gravity = 9.81\n\n[shell]\naxis = [0.0, 0.0, 1.0]"
    )
)
STARTS: tuple[dict[str, Any], ...] = (
    {"section": {"L": 3.6, "l": 0.6, "g": 0.1, "f": 25.0, "c": 0.0}},
    {"gamma": [0.0, 0.0, 1.0], "momentum": [1.0, 0.0, 0.0]},
    {"attitude": [1.0, 0.0, 0.0, 0.0], "momentum_world": [1.0, 0.0, 0.0]},
    {"gamma": [0.0, 0.0, 1.0], "alpha": [1.0, 0.0, 0.0], "angular_velocity": [1.0, 0.0, 2.0]},
)
NUMBERS = [
    (FULL | {"start": start}, path)
    for start in STARTS
    for path in numbers(FULL | {"start": start})
    if start is STARTS[0] or path.startswith("start")
]


def test_the_scenes_unchanged_are_good_ones(write: Write) -> None:
    """Of whichever start, so that it is the number that is refused."""
    assert len(NUMBERS) == 54
    for start in STARTS:
        rb.load_scene(write(toml(FULL | {"start": start})))


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf", "1e+300"])
def test_number_that_is_not_finite_is_refused_by_its_key(write: Write, bad: str) -> None:
    """NaN, infinity or 1e300 in any numeric entry of any table is refused, the entry named."""
    for scene, path in NUMBERS:
        changed = replaced(scene, path, float(bad))
        message = refusal(write(toml(changed)))
        named = re.sub(r"rotor\[0\]", "rotor1", path)  # as the body is
        assert f"{named} must be finite and at most 1e+50 in size, not {bad}" in message
