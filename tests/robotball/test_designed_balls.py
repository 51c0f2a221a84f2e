"""Balls that are designed from their numbers, at any mass, in any axes and within any limits."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import Limits, design
from robotball.designing import WIDER, describe
from tests.robotball.designs import A12, K12, OMEGA12, UNBUILDABLE, check_bodies, error, fig12


@pytest.mark.parametrize("name", ["fig12", "fig06", "fig10"])
def test_a_paper_ball_has_its_numbers_and_is_built_where_it_can_be(name: str) -> None:
    """By one rotor, to rounding: measured 2e-16; else the verdict has the frame's least radius."""
    p = rb.load_scene(name).parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15
    assert made.buildable == (name == "fig12")
    if made.buildable:
        assert made.verdict.startswith("can be built")
        assert len(made.ball.rotors) == 1
        return
    assert made.verdict.startswith(UNBUILDABLE)
    b = 1 / np.array(p.A)
    radius = math.sqrt((3 * b.max() - b.sum()) / (b.sum() - 2 * b.max()))
    # It is searched to four digits.
    assert made.needed_radius == pytest.approx(radius, rel=3e-4)
    assert f"needs a radius of {made.needed_radius:.4g} m" in made.verdict
    assert made.needed_radius <= made.reach <= WIDER * made.needed_radius
    assert made.masses[0] > made.masses[1]


@pytest.mark.parametrize(
    ("mass", "limits"),
    [
        (0.01, Limits()),
        (0.869, Limits()),
        (0.8695, Limits()),
        (1.01, Limits()),
        (None, Limits(shell_thickness=0.05)),
        (0.95, Limits(shell_mass=0.07, frame_mass=0.5, rotor_mass=0.2)),
        (None, Limits(rotor_speed=40, rotor_radius=0.9, frame_radius=0.97, shell_mass=0.02)),
    ],
)
def test_any_mass_and_limits_have_the_same_numbers(mass: float | None, limits: Limits) -> None:
    """Any mass below 1.0119 kg will do for Fig. 12; from 0.8690 kg on it can be built."""
    made = fig12(mass=mass, limits=limits)
    check_bodies(made, mass)
    assert made.buildable is (mass is None or mass > 0.8692)
    assert error(made, A12, OMEGA12, K12) < 1e-14
    if limits == Limits():
        assert made.masses == pytest.approx((0.869048, 1.011905), abs=1e-6)


def test_axes_need_not_be_principal() -> None:
    """A turned request gives the same bodies, turned."""
    Q = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    plain = fig12()
    A, Omega, K = Q @ A12 @ Q.T, Q @ OMEGA12, Q @ K12
    turned = design(A, Omega, K, 1.0)
    assert error(turned, A, Omega, K) < 2e-15  # measured 2e-16: rounding
    assert turned.ball.mass == pytest.approx(plain.ball.mass, rel=1e-6)
    assert Q.T @ turned.ball.rotors[0].axis == pytest.approx(plain.ball.rotors[0].axis, abs=1e-6)


def test_a_frame_too_small_is_told_what_it_needs() -> None:
    """Fig. 12's frame cannot lie within 0.7 m, though within the shell."""
    small = Limits(frame_radius=0.7)
    made = fig12(limits=small)
    assert made.verdict.startswith(
        "can be simulated, not be built: mass would lie outside the frame's radius: "
        f"the frame needs a radius of {made.needed_radius:.4g} m"
    )
    refusal = (
        f"the frame may reach 0.7 m, and within the limits it needs {made.needed_radius:.4g} m"
    )
    with pytest.raises(rb.InputError, match=f"mass inside the shell: {re.escape(refusal)}"):
        fig12(limits=replace(small, buildable=True))
    enough = replace(small, frame_radius=made.needed_radius * 1.001, buildable=True)
    assert fig12(limits=enough).buildable
    # A shell that leaves 0.9 m, and a limit of 0.5 m, of which only the first cannot be changed.
    thick = replace(made, limits=Limits(shell_thickness=0.1, frame_radius=0.5))
    for radius, place in ((0.85, "the frame's radius"), (0.95, "the shell")):
        verdict = replace(thick, needed_radius=radius).verdict
        assert f"mass would lie outside {place}: the frame needs" in verdict


def test_a_description_lists_bodies_rates_and_the_verdict() -> None:
    """A line for the ball, for each body, and for the verdict."""
    made = fig12(limits=Limits(rotor_speed=18.5, rotor_radius=0.9, shell_thickness=0.001))
    lines = describe(made).splitlines()
    said = [f"mass {made.ball.mass:.6g} kg", "0.001 m thick", "2 rad/s", "ring of radius 0.9 m",
            "18.5 rad/s", "can be built"]  # fmt: skip
    assert [words in line for words, line in zip(said, lines, strict=True)] == [True] * 6
