"""A scene may be given by the numbers of the equations; bodies are then designed for it."""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.designing import redesign
from validation import compare

NUMBERS = """
title = "by numbers"
rolling = "rubber"
duration = 5.0
[numbers]
A = [0.7, 0.6, 0.8]
Omega = [0, 0, 2]
K = [2, 2, 0]
radius = 1.0
[start]
section = { L = 3.6, l = 0.6, g = 0.0, f = 25.0 }
"""


def scene_of(folder: Path, text: str) -> rb.Scene:
    path = folder / "scene.toml"
    path.write_text(text)
    return rb.load_scene(path)


@pytest.mark.parametrize("A", ["[0.7, 0.6, 0.8]", "[[0.7, 0, 0], [0, 0.6, 0], [0, 0, 0.8]]"])
def test_numbers_move_as_the_catalogs_bodies_do(tmp_path: Path, A: str) -> None:
    """Fig. 12 by its numbers has the path of Fig. 12 by bodies, in both engines."""
    scene = scene_of(tmp_path, NUMBERS.replace("[0.7, 0.6, 0.8]", A))
    times = rb.sample_times(5.0)
    by_bodies = rb.integrate(rb.load_scene("fig12"), times).contact_point
    # Measured 5e-14 m: rounding in A and K.
    assert np.abs(rb.integrate(scene, times).contact_point - by_bodies).max() < 1e-12
    agreement = compare(scene, "balanced")
    assert agreement.path_error is not None
    assert agreement.path_error < 3e-9  # measured 8.7e-10, RK4's


@pytest.mark.parametrize("name", ["fig12", "fig06", "classical_chaotic", "three_rotors"])
def test_designed_bodies_keep_the_motion_of_their_scene(tmp_path: Path, name: str) -> None:
    """Other bodies with the same A, Ω and K: the same path, also from the file written for them."""
    scene = rb.load_scene(name)
    found, designed = redesign(scene, None, rb.Limits())
    reread = scene_of(tmp_path, rb.scene_toml(designed))
    expected = rb.integrate(scene).contact_point
    # Measured 2e-12 m at most (fig06): rounding in A and K, grown by the motion.
    assert np.abs(rb.integrate(reread).contact_point - expected).max() < 3e-11
    assert found.buildable == (name != "fig06")


REFUSED = {
    "both": ("[start]", "[shell]\nradius = 1.0\nmass = 1.0\ninertia = 'thin'\n[start]",
             "a scene takes bodies or numbers, not both"),
    "neither": (NUMBERS[NUMBERS.index("[numbers]") : NUMBERS.index("[start]")], "",
                "a scene takes shell and frame, or numbers"),
    "no numbers": ("[numbers]", "[other]", "unknown key 'other'"),
    "too few": ("A = [0.7, 0.6, 0.8]", "A = [0.7, 0.6]", "numbers.A takes a diagonal of three"),
    "mixed": ("A = [0.7, 0.6, 0.8]", "A = [0.7, [0, 0.6, 0], 0.8]", "numbers.A takes a diagonal"),
    "not symmetric": ("A = [0.7, 0.6, 0.8]", "A = [[0.7, 0.1, 0], [0, 0.6, 0], [0, 0, 0.8]]",
                      "symmetric"),
    "no such body": ("A = [0.7, 0.6, 0.8]", "A = [0.9, 0.9, 0.2]", "triangle inequality"),
    "negative": ("A = [0.7, 0.6, 0.8]", "A = [0.7, -0.6, 0.8]", "A must be|positive"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_numbers_without_a_ball_are_refused(tmp_path: Path, case: str) -> None:
    """One line with the file and the condition that fails."""
    old, new, words = REFUSED[case]
    with pytest.raises(rb.InputError, match=words) as refused:
        scene_of(tmp_path, NUMBERS.replace(old, new))
    assert "scene.toml" in str(refused.value)
