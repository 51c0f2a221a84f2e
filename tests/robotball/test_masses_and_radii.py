"""The same numbers at any mass, in any axes and within any limits that leave room for them."""

import re
from dataclasses import replace

import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import Limits, design
from tests.robotball.designs import A12, K12, OMEGA12, check_bodies, error, fig12


def test_a_heavier_or_lighter_ball_has_the_same_numbers() -> None:
    """Any mass below 1.0119 kg will do for Fig. 12; from 0.8690 kg on it can be built."""
    for mass, buildable in (
        (0.01, False),
        (0.5, False),
        (0.869, False),
        (0.8695, True),
        (1.01, True),
    ):
        made = fig12(mass=mass)
        check_bodies(made, mass)
        assert made.buildable is buildable
        assert error(made, A12, OMEGA12, K12) < 1e-14
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


@pytest.mark.parametrize(
    "limits",
    [
        Limits(shell_thickness=0.05),
        Limits(frame_radius=0.9, rotor_radius=0.3),
        Limits(shell_mass=0.07, frame_mass=0.5, rotor_mass=0.2),
        Limits(rotor_speed=40, rotor_radius=0.9, frame_radius=0.97, shell_mass=0.02),
    ],
)
@pytest.mark.parametrize("mass", [None, 0.95])
def test_limits_are_kept(limits: Limits, mass: float | None) -> None:
    """Each alone, and several together."""
    made = fig12(limits=limits, mass=mass)
    check_bodies(made, mass)
    assert made.buildable


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


@pytest.mark.parametrize(("needed", "place"), [(0.85, "the frame's radius"), (0.95, "the shell")])
def test_a_frame_beyond_the_shells_inner_radius_lies_outside_the_shell(
    needed: float, place: str
) -> None:
    """The shell leaves 0.9 m, the limit 0.5 m, of which only the first cannot be changed."""
    limits = Limits(shell_thickness=0.1, frame_radius=0.5)
    made = replace(fig12(), limits=limits, needed_radius=needed)
    assert f"mass would lie outside {place}: the frame needs" in made.verdict
