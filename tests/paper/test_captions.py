"""The captions of the paper's figures are the starts of the catalog's scenes."""

import numpy as np
import pytest

from robotball import catalog, integrate, load_scene
from robotball.rotations import rotation_matrix
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, motion, near_sigma_plus
from tests.paper.formulas import Numbers

# Fig. 10's level below 2.08 has a scene too.
STARTED = CAPTIONS | {"fig10_stable": near_sigma_plus(2.0)}


@pytest.mark.parametrize("name", STARTED)
def test_a_scene_of_the_catalog_starts_and_moves_as_its_caption_says(name: str) -> None:
    """α, β, γ, M and the numbers of the equations, to rounding; γ and contact point after 3 s.

    The motion is another integration of another state, typed once more: measured 1.5e-13 m
    (fig07) and 6.2e-14 (fig14) at most, rounding of both.
    """
    caption, scene = STARTED[name], load_scene(name)
    axes = rotation_matrix(scene.start.attitude)
    assert axes == pytest.approx(caption.axes, abs=2e-15)
    assert scene.start.momentum @ axes == pytest.approx(caption.M, abs=1e-14)
    given: Numbers = f.numbers(scene.parameters)
    for each in ("A", "Omega", "K"):
        assert getattr(given, each) == pytest.approx(getattr(caption.n, each), abs=5e-15)
    assert given.d == pytest.approx(0.9, rel=1e-15) or name < "fig11"  # of Figs 12 to 14, chosen
    times = np.array([0.0, 3.0])
    gamma, path = motion(caption, times, 1e-13)
    ours = integrate(scene, times)
    assert np.linalg.norm(ours.contact_point - path, axis=1).max() < 5e-13
    assert np.abs(ours.gamma - gamma).max() < 2e-13


def test_no_figure_is_left_out() -> None:
    """Every scene named after a figure has its caption."""
    assert sorted(STARTED) == [name for name in catalog() if name.startswith("fig")]
