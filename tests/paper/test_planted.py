"""Each error planted in a formula of robotball makes a test of the paper fail."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotball.dynamics import equilibria, straight_motions
from robotball.robot import ball
from robotball.robot import formulas as eq
from tests import figures
from tests.paper import test_appendix_a_bodies as bodies
from tests.paper import test_section_2_equations_of_motion as motion
from tests.paper import test_section_3_momentum as momentum
from tests.paper import test_section_4_1_without_k as without_k
from tests.paper import test_section_4_2_with_k as with_k
from tests.paper import test_section_4_motion_from_rest as from_rest
from tests.paper import test_section_5_1_straight_lines as straight_lines
from tests.paper import test_section_5_2_poincare_map as poincare_map

Formula = Callable[..., Any]


def with_argument(index: int, change: Formula) -> Callable[[Formula], Formula]:
    """Change a positional argument of a formula."""

    def planted(formula: Formula) -> Formula:
        def wrong(*values: Any, **named: Any) -> Any:
            return formula(*values[:index], change(values[index]), *values[index + 1 :], **named)

        return wrong

    return planted


def with_value(change: Formula) -> Callable[[Formula], Formula]:
    """Change the result of a formula."""
    return lambda formula: lambda *values, **named: change(formula(*values, **named))


def minus(v: Any) -> Any:
    """Return a number or a vector with the other sign."""
    return tuple(-x for x in v) if isinstance(v, tuple) else -v


def without_double_phase(taylor: Formula) -> Formula:
    """Leave out the term of l₁ at twice the phase; then l₁ of a slow focus doubles.

    The other terms are at the conjugate of the eigenvector, and at a real vector.
    """

    def wrong(flow: Any, u: Any, v: Any) -> Any:
        real = np.abs(v.imag).max() < 1e-9 * np.abs(v).max()
        return taylor(flow, u, v) * (np.array_equal(v, u.conj()) or real)

    return wrong


# By name of the error: module and name of the formula, the change, the test that must fail and its
# arguments.
# fmt: off
PLANTED: dict[str, tuple[Any, ...]] = {
    "the sign of k in (2.4)-(2.5)": (eq, "full_angular_acceleration", with_argument(4, minus),
        motion.test_the_angular_acceleration_is_that_of_mujoco_while_the_rates_change),
    "λ₀'s sign in (2.5)": (eq, "full_angular_acceleration", with_value(lambda v: (v[0], -v[1])),
        motion.test_the_multiplier_is_the_spin_torque_of_mujocos_contact),
    "the sign of dq/dt": (eq, "attitude_rate", with_value(minus),
        motion.test_the_space_axes_rotate_with_the_angular_velocity),
    "α and β exchanged": (eq, "space_axes", with_value(lambda axes: (axes[1], axes[0], axes[2])),
        motion.test_the_space_axes_rotate_with_the_angular_velocity),
    "Ẏ's sign in (2.7)": (eq, "contact_velocity", with_value(lambda v: (v[0], -v[1])),
        motion.test_the_velocity_of_the_contact_point_is_a_times_that_of_the_shell),
    "the γ term of L": (eq, "contact_angular_momentum", with_argument(2, minus),
        momentum.test_the_momentum_is_that_of_the_bodies, True),
    "K's sign in (3.1)": (eq, "contact_angular_momentum", with_argument(3, minus),
        momentum.test_the_momentum_is_that_of_the_bodies, False),
    "Ω's sign in (3.2)": (eq, "rubber_angular_velocity", with_argument(2, minus),
        momentum.test_the_rubber_velocity_solves_the_definition_of_the_momentum),
    "Ω's sign in (3.3)": (eq, "_classical_angular_velocity", with_argument(2, minus),
        momentum.test_the_classical_velocity_solves_the_definition_of_the_momentum),
    "the sign of (3.2)'s divergence": (eq, "rubber_divergence", with_value(minus),
        momentum.test_robotballs_divergence_is_that_of_the_reduced_equations, False),
    "the sign of (3.3)'s divergence": (eq, "_classical_divergence", with_value(minus),
        momentum.test_robotballs_divergence_is_that_of_the_reduced_equations, True),
    "Ω's sign in E": (eq, "energy", with_argument(2, minus),
        momentum.test_energy_changes_by_the_power_of_the_drives, "fig12", 1.5e-6),
    "the rubber E for the classical": (eq, "energy",
        lambda E: lambda *v, spinning: E(*v, spinning=False),
        momentum.test_energy_changes_by_the_power_of_the_drives, "classical_chaotic", 1e-5),
    "the sign of (4.1)": (equilibria, "flow", with_value(minus),
        from_rest.test_from_rest_gamma_follows_a_field_on_the_sphere),
    "Prop. 2's B, as printed": (figures, "proposition_2",
        lambda old: lambda p: (*old(p)[:2], p.K[2] * old(p)[2]),
        with_k.test_B_does_not_have_the_factor_K3),
    "the sign of the first Lyapunov value": (equilibria, "lyapunov_value", with_value(minus),
        with_k.test_the_focus_is_stable_if_and_only_if_B_over_A1_is_negative),
    "a term of the first Lyapunov value": (equilibria, "_taylor", without_double_phase,
        with_k.test_the_focus_grows_with_the_first_lyapunov_value),
    "the sign of κ": (equilibria, "kappa", with_value(minus),
        with_k.test_the_angles_of_the_fixed_points_have_the_arctangent_of_omega, with_k.DELTA),
    "the sense of a circle": (equilibria, "contact_path",
        with_value(lambda path: replace(path, turning=-path.turning)),
        without_k.test_at_a_fixed_point_the_contact_point_describes_a_circle, 2, 6e-6),
    "a circle at Γ₅ as at Γ₁": (equilibria, "contact_path", with_argument(1, np.flip),
        without_k.test_at_a_fixed_point_the_contact_point_describes_a_circle, 2, 6e-6),
    "Σ_u for Σ_s": (equilibria, "fixed_circle",
        with_value(lambda circle: replace(circle, axes=circle.axes * [[1], [-1]])),
        without_k.test_half_of_the_circle_is_stable),
    "the free term of P₃": (straight_motions, "straight_motion",
        with_value(lambda line: replace(line, polynomial=line.polynomial * [1, 1, 1, -1])),
        straight_lines.test_the_characteristic_polynomial_of_a_straight_line,
        "any", 61, 3, straight_lines.P3),
    "a straight line's speed": (straight_motions, "straight_motion",
        with_value(lambda line: replace(line, speed=1.01 * line.speed)),
        straight_lines.test_on_sigma_the_ball_rolls_against_OY_and_on_delta_along_it),
    "one root of the classical lines": (straight_motions, "straight_motions",
        lambda old: lambda p, f, c: 2 * old(p, f, c)[:2],
        momentum.test_all_straight_lines_of_the_classical_ball_are_found),
    "c's sign in the classical lines": (straight_motions, "straight_motions",
        with_argument(2, minus),
        momentum.test_all_straight_lines_of_the_classical_ball_are_found),
    "σ for δ": (straight_motions, "name_of_line", with_argument(1, minus),
        straight_lines.test_there_are_four_straight_lines_below_the_largest_momentum_and_two_at_it),
    "aⱼ for aₖ in stability_limit": (straight_motions, "stability_limit",
        with_argument(0, lambda p: replace(p, I=(p.I[1], p.I[0], p.I[2]))),
        straight_lines.test_the_lines_of_fig_10_are_stable_below_its_level_only, 1.0),
    "g of (5.5), half a turn on": (poincare_map, "crossings_of_motion",
        lambda crossings: lambda *of: crossings(*of, np.pi),
        poincare_map.test_robotballs_sections_are_the_crossings_of_g_zero),
    "l's sign in (5.5)": (poincare_map, "section_state", with_argument(1, minus),
        poincare_map.test_the_variables_of_the_section_lie_on_the_level_of_the_integrals),
    "the point of Steiner's terms": (ball, "inertia_about",
        with_argument(0, lambda point: point + 0.1),
        bodies.test_the_inertia_has_steiners_terms),
}
# fmt: on


@pytest.mark.parametrize("error", PLANTED)
def test_an_error_in_a_formula_of_robotball_is_found(
    error: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test passes without the error, and fails with it."""
    module, name, plant, test, *arguments = PLANTED[error]
    test(*arguments)  # first, so that the tests' caches have no planted error
    monkeypatch.setattr(module, name, plant(getattr(module, name)))
    with pytest.raises(AssertionError):
        test(*arguments)
