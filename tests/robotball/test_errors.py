"""Bad input of any kind is one short line."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.settings import Prescribed
from robotball.errors import LONGEST_LINE, check_count, check_positive, check_seed

FAST = rb.preset("fast")
REQUIRED = {each.name for each in fields(rb.Settings) if each.default is not None}
ODD = [
    -np.inf, np.nan, -1e30, 1e300, 10**400, "x" * 4000, b"x", {}, object(), (1e300, 1e300),
    (np.nan,), np.array([]), np.array([1.0, 2.0, 3.0]), np.array(0.02),
]  # fmt: skip


def changed(**values: Any) -> rb.Settings:
    return replace(FAST, **values)


@pytest.mark.parametrize("name", [each.name for each in fields(rb.Settings)])
def test_a_setting_of_any_kind_fits_or_is_one_short_line(name: str) -> None:
    """None too, where nothing is left open; no other error, now or in the run."""
    for value in [*ODD, *([None] if name in REQUIRED else [])]:
        if name == "name" and isinstance(value, str):
            continue
        with pytest.raises(rb.InputError, match=f"{name}|a Servo") as refusal:
            changed(**{name: value})
        assert len(str(refusal.value)) <= LONGEST_LINE


def test_numbers_of_numpy_are_settings() -> None:
    """They are kept as Python's own, which JSON takes."""
    given: dict[str, Any] = {
        "timestep": np.float64(0.01), "solref": np.array([0.04, 1.0]), "iterations": np.int64(3),
        "condim": 3.0, "sliding_friction": 10**30,
    }  # fmt: skip
    plain = changed(**given).plain()
    assert [plain[name] for name in given] == [0.01, [0.04, 1.0], 3, 3, 1e30]
    assert [type(plain[name]) for name in given] == [float, list, int, int, float]


def limited(limit: Any) -> rb.Servo:
    return rb.Servo(1.0, "" if limit is None else limit)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [None, "x", (1.0, 2.0), np.array([1.0, 2.0]), -np.inf])
def test_a_drive_is_refused_in_a_line(value: Any) -> None:
    """A servo's gain and torque limit, and the armature."""
    for make in (Prescribed, rb.Servo, limited):
        with pytest.raises(rb.InputError, match="must be"):
            make(value)


def test_counts_and_seeds_have_limits() -> None:
    """More would fill the memory; a negative seed starts no random numbers."""
    assert (check_count("starts", 5, 1), check_seed(0)) == (5, 0)
    for check, words in (
        (lambda: check_count("starts", 10**12, 1), "starts must be at most 10000000, not 10000"),
        (lambda: check_seed(-1), "seed must be at least 0, not -1"),
        (lambda: check_positive("mass", "x", "kg"), "mass must be a number, not 'x'"),  # type: ignore[arg-type]
    ):
        with pytest.raises(rb.InputError, match=words):
            check()


def test_a_message_is_short_however_long_its_parts_are() -> None:
    """Its beginning and its end, which says what to do, stay."""
    key = "k" * 4000
    message = str(rb.InputError(f"{key}: unknown key; " + "name " * 1000 + "did you mean mass?"))
    assert len(message) <= LONGEST_LINE
    assert message.startswith("kkk")
    assert message.endswith("did you mean mass?")
