"""Random runs: what is far out is reported, and what is ordinary is not."""

import pytest

from validation.studies.random_runs import extreme, judged, ordinary

pytestmark = pytest.mark.core


@pytest.mark.parametrize("number", [6, 10, 15, 19, 27, 34])
def test_no_extreme_run_fails_unreported(number: int) -> None:
    """Far out along one to three axes: a path over 10 % off is warned of, or stopped, or both."""
    each = judged(extreme(7, number))
    assert (each.failed, bool(each.reported)) == (True, True)


@pytest.mark.parametrize("number", [1, 2, 12, 17])
def test_no_ordinary_run_is_called_wrong(number: int) -> None:
    """A recipe preset on a varied ball of the catalog: no warning, no fault, within tolerance."""
    each = judged(ordinary(7, number))
    assert (each.within, bool(each.reported)) == (True, False)
