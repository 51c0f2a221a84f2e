"""The study of the errors that `--accuracy` estimates: misses, and a quick form."""

from dataclasses import replace
from itertools import product

from bench.estimates import ACCURACIES, cells, lines, measure, missed
from validation.sweeps import Result

HONEST = Result(
    {"ball": 3, "accuracy": 1e-7},
    {"estimated": 6e-8, "actual": 3e-8, "reference": 1e-15, "warned": False, "faults": []},
    None,
)


def changed(**values: object) -> Result:
    return replace(HONEST, record={**(HONEST.record or {}), **values})


def test_a_miss_is_an_error_without_a_warning() -> None:
    """Warned, faulty and unfinished runs are not misses. Misses are listed."""
    miss = changed(actual=1.3e-7)
    others = [
        HONEST,
        changed(actual=1.3e-7, warned=True),
        changed(actual=1.3e-7, faults=["contact lost"]),
        changed(actual=None, estimated=None),
        replace(HONEST, record=None, failure="took longer than 300 s"),
    ]
    assert [missed(run) for run in (miss, *others)] == [True] + 5 * [False]
    counts, ratios, listed = lines([miss, *others])
    assert counts == "5 balls: 1 warned, 1 with a fault, 1 missed"
    assert ratios == "actual over estimated error: median 2.2, 99 % 2.2, largest 2.2"
    assert listed.startswith("missed: ball 3, 1e-07 requested, 6.0e-08 estimated, 1.3e-07 actual")


def test_two_balls_have_their_estimated_errors() -> None:
    """At 1e-5 the ratio of the error to its estimate is 0.85 to 0.88, from RK4's next order.

    Twelve balls cover every accuracy and number of rotors.
    """
    met = {(cell["ball"] % 4, cell["accuracy"]) for cell in cells(12)}
    assert met == {*product(range(4), ACCURACIES)}
    results = [Result(dict(cell), measure(cell), None) for cell in cells(2)]
    assert not any(map(missed, results))
    for result in results:
        assert result.record is not None
        assert 0.75 < result.record["actual"] / result.record["estimated"] < 1.0
