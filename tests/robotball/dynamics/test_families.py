"""Balls and momenta with some of their numbers changed."""

from dataclasses import replace

import numpy as np
import pytest

from robotball.dynamics.families import NUMBERS, numbers_of, varied
from robotball.errors import InputError
from tests.figures import CHAOTIC, CLASSICAL, from_rest
from tests.messages import naming

MOMENTA = {"rubber": np.array([-3.0, 4.0, 0.0]), "classical": np.array([-3.0, 4.0, 1.0])}
BALL = replace(CLASSICAL, K=(2.0, 3.0, 1.0), Omega=(1.0, -1.0, 2.0))


def kept(name: str) -> set[str]:
    """The numbers of the same vector that stay: other components, or the length in a plane."""
    vector, axes = name.rstrip("123"), name[len(name.rstrip("123")) :]
    others = {f"{vector}{i}" for i in "123" if i not in axes} if axes else set()
    return others | ({vector} if len(axes) == 2 else set())


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_is_changed_and_no_other(name: str) -> None:
    """To 2.5; a length keeps the direction, and M its heading."""
    before = numbers_of(BALL, MOMENTA["classical"])
    ball, momentum = varied(BALL, MOMENTA["classical"], {name: 2.5})
    after = numbers_of(ball, momentum)
    assert after[name] == pytest.approx(2.5, rel=1e-14)
    for each in kept(name) | {other for other in NUMBERS if other[0] != name[0]}:
        assert after[each] == pytest.approx(before[each], abs=1e-13), each
    if name == "K":
        assert np.cross(ball.K, BALL.K) == pytest.approx(np.zeros(3), abs=1e-14)
    assert momentum[0] / momentum[1] == pytest.approx(-0.75)


def test_a_length_below_zero_turns_the_vector_round() -> None:
    """And by itself, or to zero, it is as it is said; several numbers change together."""
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
def test_what_no_ball_has_is_refused(changes: dict[str, float], facts: str) -> None:
    """In one line."""
    with pytest.raises(InputError, match=naming(facts)):
        varied(CHAOTIC, MOMENTA["rubber"], changes)


def test_a_length_of_nothing_has_no_direction() -> None:
    """It is named, with what to vary instead."""
    with pytest.raises(InputError, match=naming("K K1 2 3")):
        varied(from_rest(0.0), np.zeros(3), {"K": 1.0})
