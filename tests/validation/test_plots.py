"""The pictures of a comparison show what their axes say, also where M = 0."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import robotball as rb
from validation import compare
from validation.output import title
from validation.plots import ROOM, momentum_picture, path_picture, sheet_of
from validation.studies.extremes import round_ticks

TIMES = rb.sample_times(0.5)


def test_a_path_is_drawn_to_one_scale() -> None:
    """A metre along X is a metre along Y, and the title says so."""
    paths, _ = path_picture(sheet_of([compare("fig12", "fast", TIMES)])).axes
    assert paths.get_aspect() == 1.0
    assert "to one scale" in paths.get_title()


def test_a_ball_at_rest_has_a_momentum_of_zero_in_its_picture() -> None:
    """fig06 has M = 0: rounding does not fill the axis, and the error's scale is told."""
    agreement = compare("fig06", "fast", TIMES)
    components, errors = momentum_picture(sheet_of([agreement])).axes
    low, high = components.get_ylim()
    assert high - low > 0.09 * agreement.scene.momentum_scale  # measured 0.1
    assert errors.get_ylabel() == "error of M, over 1.46 kg m²/s"


@pytest.mark.parametrize("length", [20, 90, 150, 400])
def test_a_long_title_stays_within_its_picture(length: int) -> None:
    """By smaller letters, then by a second line; never past the edges, nor into the axes below."""
    figure = Figure(figsize=(8.0, 7.0))
    axes = figure.subplots(gridspec_kw=ROOM)
    axes.set_title("contact point on the plane, to one scale")
    title(figure, ("a wide-rolling robot " * 20)[:length])
    figure.draw_without_rendering()
    (words,) = figure.texts
    box, below = words.get_window_extent(), axes.title.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width
    assert below.y1 <= box.y0 < box.y1 <= figure.bbox.height


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig06", "fig05d", "chaplygin_ball", "zero_rotor"])
def test_no_picture_warns(name: str, tmp_path: Path) -> None:
    """Not of a path that is a circle, of a momentum that is zero, nor of an equal limit."""
    agreement = compare(name, "fast", TIMES)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for picture in (
            path_picture(sheet_of([agreement])),
            momentum_picture(sheet_of([agreement])),
        ):
            picture.savefig(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        (np.geomspace(1e-4, 0.2, 8), ["$10^{-4}$", "$10^{-3}$", "$10^{-2}$", "$10^{-1}$"]),
        (np.geomspace(1e-13, 0.1, 5), ["$10^{-13}$", "$10^{-9}$", "$10^{-5}$", "$10^{-1}$"]),
        (np.array([0.0, 1.0, 2.0]), ["0", "1", "2"]),
        (np.array([2.0, 3.0]), ["2", "3"]),
    ],
)
def test_a_failure_maps_ticks_are_round(values: np.ndarray, labels: list[str]) -> None:
    """Powers of ten where the cells go over some, four at most."""
    places, shown = round_ticks(values.tolist())
    assert shown == labels
    assert all(-0.5 <= place <= len(values) - 0.5 for place in places)
