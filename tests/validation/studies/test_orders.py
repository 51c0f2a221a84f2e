"""The order of convergence of errors with a known law, and of errors without a law."""

import numpy as np
import pytest

from validation.studies.measuring import fit_order, stalled_at

STEPS = 0.1 * 0.5 ** np.arange(8)


@pytest.mark.parametrize("order", [1, 2, 4, 8.5])
def test_a_power_law_has_its_order(order: float) -> None:
    """The runs may be in any order. Broken and exact runs are ignored."""
    errors = [*3.0 * STEPS**order]
    fitted = fit_order(STEPS[::-1].tolist(), errors[::-1])
    assert fitted is not None
    assert fitted.order == pytest.approx(order, rel=1e-12)
    assert fitted.points == 8
    assert fitted.stderr < 1e-10
    assert (fitted.shortest, fitted.longest) == pytest.approx((STEPS[-1], STEPS[0]))
    assert fitted.error_at(np.array([0.02, 0.5])) == pytest.approx(
        3.0 * np.array([0.02, 0.5]) ** order
    )
    gaps = fit_order([*STEPS, 1.0, 2.0, 3.0], [*errors, None, np.inf, 0.0])
    assert gaps == fitted


def test_both_ends_are_left_out() -> None:
    """Long steps, with a higher-order term, and short steps, with a stall, are ignored."""
    errors = 3.0 * STEPS**2 + 1e4 * STEPS**5 + 2e-5
    assert stalled_at(STEPS.tolist(), errors.tolist()) == errors.min()
    fitted = fit_order(STEPS.tolist(), errors.tolist())
    assert fitted is not None
    assert fitted.order == pytest.approx(2, abs=0.1)
    assert fitted.longest < 0.9 * STEPS[0]
    assert fitted.shortest > 1.1 * STEPS[-1]
    # The slope over all points differs.
    assert abs(np.polyfit(np.log(STEPS), np.log(errors), 1)[0] - 2) > 0.2


def test_errors_below_the_floor_are_ignored() -> None:
    """The fit uses only errors above the floor."""
    errors = (3.0 * STEPS**2).tolist()
    fitted = fit_order(STEPS.tolist(), errors, floor=errors[4])
    assert fitted is not None
    assert fitted.points == 4
    assert fitted.shortest == pytest.approx(STEPS[3])
    assert fit_order(STEPS.tolist(), errors, floor=errors[2]) is None


@pytest.mark.parametrize(
    ("steps", "errors"),
    [
        (STEPS[:2].tolist(), [1e-2, 1e-3]),
        ([0.1] * 4, [1e-2, 2e-2, 3e-2, 4e-2]),
        (STEPS.tolist(), [1e-2] * 8),
        (STEPS.tolist(), STEPS[::-1].tolist()),
        ([], []),
    ],
    ids=["two", "one step", "constant", "rising", "empty"],
)
def test_errors_without_a_law_have_no_order(steps: list[float], errors: list[float]) -> None:
    """The result is None, without an exception."""
    assert fit_order(steps, errors) is None
