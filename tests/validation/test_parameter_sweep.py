"""A sweep is a table of comparisons, and an assertion in a user's test says what went wrong."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from tests.messages import naming, unnamed

FAST = rb.preset("fast")
TIMES = np.linspace(0.0, 0.2, 11)
ERRORS = ("path_error", "gamma_error", "momentum_error")


@pytest.mark.parametrize("count", [2, 9])
def test_a_row_is_the_comparison_at_its_value(count: int) -> None:
    """To the last bit and in order, in one process and in several."""
    values = np.linspace(0.02, 0.01, count)
    table = rb.sweep("fig12", "timestep", values, TIMES, settings="fast")
    assert table["value"].tolist() == values.tolist()
    last = rb.compare("fig12", TIMES, settings=replace(FAST, timestep=values[-1]))
    assert [table[name][-1] for name in ERRORS] == [getattr(last, name) for name in ERRORS]
    assert table["agrees"].all()


def test_a_number_of_the_scene_is_named_by_its_path_or_the_end_of_it() -> None:
    """The errors equal the errors of a scene with the changed body."""
    shown: list[float] = []
    frame = rb.load_scene("fig12").ball.hinges[0].body
    scene = rb.load_scene("fig12").with_hinges(body={"frame": replace(frame, mass=1.2)})
    table = rb.sweep("fig12", "frame.mass", [0.8, 1.2], TIMES, settings=FAST, progress=shown.append)
    assert table["path_error"][1] == rb.compare(scene, TIMES, settings=FAST).path_error
    assert table["path_error"][0] != table["path_error"][1]
    assert shown == [0.5, 1.0]
    assert rb.sweep("fig12", "offset", [], 0.2).parameter == "shell.offset"


def test_a_run_that_breaks_off_is_nan_with_its_verdict_and_a_refused_one_says_why() -> None:
    slippery = rb.sweep("fig12", "sliding_friction", [0.1], 0.5, settings="fast")
    assert np.isnan([slippery[name] for name in ERRORS]).all()
    assert unnamed("0.1 -", repr(slippery)) == []
    assert "saturated" in slippery.rows[0]["verdict"]
    (row,) = rb.sweep("fig12", "max_steps", [1], 0.5, settings="fast").rows
    assert unnamed("max_steps 1", row["verdict"]) == []


@pytest.mark.parametrize(
    ("name", "facts"),
    [
        ("timestp", "'timestp' timestep"),
        ("fog", "'fog' timestep"),
        ("mass", "'mass' shell.mass frame.mass"),
    ],
)
def test_an_unknown_parameter_is_refused_with_those_that_there_are(name: str, facts: str) -> None:
    with pytest.raises(rb.InputError, match=naming(facts)):
        rb.sweep("fig12", name, [1.0])


def test_an_assertion_that_fails_has_the_fault_and_the_table() -> None:
    """Its first line is the first fault; one that holds returns the agreement."""
    assert rb.assert_agrees("fig12", TIMES, settings="fast").agrees
    naive = rb.compare("fig12", TIMES, settings="naive")
    with pytest.raises(AssertionError) as raised:
        rb.assert_agrees("fig12", TIMES, settings="naive")
    first, *table = str(raised.value).splitlines()
    assert first == f"fig12: {naive.faults[0]}"
    assert (
        unnamed(f"fig12 rubber naive faulty {naive.verdict.replace(' ', '~')}", "\n".join(table))
        == []
    )


def test_an_assertion_without_a_fault_says_by_how_much_it_is_off() -> None:
    strict = replace(FAST, error_tolerance=1e-12, stop_at_fault=False)
    with pytest.raises(AssertionError, match=naming("fig12 1e-12")):
        rb.assert_agrees("fig12", TIMES, settings=strict)
