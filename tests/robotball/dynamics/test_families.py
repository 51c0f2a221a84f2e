"""Families: balls and momenta with some of their numbers changed."""

from dataclasses import replace

import numpy as np
import pytest

from robotball.dynamics.motion_branches import NUMBERS, numbers_of, varied
from robotball.errors import InputError
from tests.figures import CHAOTIC, CLASSICAL, from_rest
from tests.messages import naming

MOMENTA = {"rubber": np.array([-3.0, 4.0, 0.0]), "classical": np.array([-3.0, 4.0, 1.0])}
BALL = replace(CLASSICAL, K=(2.0, 3.0, 1.0), Omega=(1.0, -1.0, 2.0))


def kept(name: str) -> set[str]:
    """Return the other numbers of the same vector: components, or the length in a plane."""
    vector, axes = name.rstrip("123"), name[len(name.rstrip("123")) :]
    others = {f"{vector}{i}" for i in "123" if i not in axes} if axes else set()
    return others | ({vector} if len(axes) == 2 else set())


@pytest.mark.parametrize("name", NUMBERS)
def test_one_number_is_changed_and_no_other(name: str) -> None:
    """To 2.5. A length keeps the direction, and M its heading."""
    before = numbers_of(BALL, MOMENTA["classical"])
    ball, momentum = varied(BALL, MOMENTA["classical"], {name: 2.5})
    after = numbers_of(ball, momentum)
    assert after[name] == pytest.approx(2.5, rel=1e-14)
    for number in kept(name) | {other for other in NUMBERS if other[0] != name[0]}:
        assert after[number] == pytest.approx(before[number], abs=1e-13), number
    if name == "K":
        assert np.cross(ball.K, BALL.K) == pytest.approx(np.zeros(3), abs=1e-14)
    assert momentum[0] / momentum[1] == pytest.approx(-0.75)


def test_a_negative_length_reverses_the_vector() -> None:
    """Unchanged and zero lengths work, too; several numbers change together."""
    ball, momentum = varied(CHAOTIC, MOMENTA["rubber"], {"Omega": -2.0, "K": 0.0, "f": 4.0})
    assert (ball.Omega, ball.K) == ((0.0, 0.0, -2.0), (0.0, 0.0, 0.0))
    assert momentum == pytest.approx(np.array([-1.2, 1.6, 0.0]))
    still = varied(from_rest(0.3), np.zeros(3), {"K3": 0.5})
    assert still[0].K == (0.0, 0.0, 0.5)
    assert not still[1].any()


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"L": 1.0}, "'L'"),
        ({"c": 1.0}, "c~must~be~0 rubber"),
        ({"f": -1.0}, "c 0 f M²~=~-1"),
    ],
)
def test_numbers_that_no_ball_has_are_refused(changes: dict[str, float], facts: str) -> None:
    """In one line."""
    with pytest.raises(InputError, match=naming(facts)):
        varied(CHAOTIC, MOMENTA["rubber"], changes)


def test_the_length_of_a_zero_vector_cannot_be_varied() -> None:
    """The message names it and what to vary instead."""
    with pytest.raises(InputError, match=naming("K K1 K2 K3")):
        varied(from_rest(0.0), np.zeros(3), {"K": 1.0})
