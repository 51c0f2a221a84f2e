"""Line charts as SVG: ticks, scales, degenerate lines, legends."""

from xml.etree import ElementTree

import numpy as np
import pytest

from validation.report.chart import LEAST_LOG, Line, chart, legend, ticks


def lines_of(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, [0, 2, 4, 6, 8, 10]),
        (-0.31, 0.52, [-0.2, 0, 0.2, 0.4]),
        (1000.05, 1000.7, [1000.1, 1000.2, 1000.3, 1000.4, 1000.5, 1000.6, 1000.7]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    """Steps of 1, 2 or 5 times a power of ten, at most seven of them."""
    assert ticks(low, high) == pytest.approx(expected, abs=1e-12)


def test_a_chart_stands_a_line_that_goes_nowhere() -> None:
    """A point, a constant, a zero on a logarithmic axis, a hole: as of M(0) = 0."""
    t = np.linspace(0.0, 1.0, 5)
    for y, log in (
        (np.zeros(5), False),
        (np.zeros(5), True),
        (np.full(5, 7.0), False),
        (np.array([0.0, 1e-3, np.nan, 1e-9, 1.0]), True),
    ):
        svg = chart([Line("a & b", "#000000", t, y)], "t < 1", "y", log=log)
        text = " ".join(each.text or "" for each in lines_of(svg).iter("text"))
        assert "t < 1" in text
        assert "nan" not in svg
    assert np.finfo(float).eps > LEAST_LOG


def test_a_flat_path_makes_a_low_picture_to_one_scale() -> None:
    """The pixels of a metre are the same on both axes."""
    x = np.linspace(0.0, 30.0, 900)
    svg = lines_of(chart([Line("a", "#000000", x, np.sin(x))], "X", "Y", equal=True))
    assert float((svg.get("viewBox") or "").split()[3]) == 180.0
    (line,) = svg.iter("polyline")
    points = np.array([p.split(",") for p in (line.get("points") or "").split()], dtype=float)
    assert len(points) == 400
    across, up = np.ptp(points, axis=0)
    assert across / up == pytest.approx(30 / 2, rel=0.01)  # measured 15.02


def test_a_legend_has_the_dashes_that_tell_lines_apart_without_colour() -> None:
    """Beside each name."""
    t = np.linspace(0.0, 1.0, 3)
    made = legend([Line("a", "#0072B2", t, t), Line("b", "#0072B2", t, t, dash="2 3")])
    assert made.count("stroke-dasharray") == 1
    assert made.index("dasharray") > made.index("> a<")
