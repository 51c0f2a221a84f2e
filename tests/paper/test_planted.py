"""Errors planted in robotball's own formulas: each turns a row of the paper."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotball import ball
from robotball import equations as eq
from robotball.qualitative import equilibria, normal_forms, straight_motions
from tests.paper import SECTIONS, section_5
from tests.paper import test_buildable_balls as ours
from tests.paper.claim import examine

Formula = Callable[..., Any]


def with_argument(index: int, change: Formula) -> Callable[[Formula], Formula]:
    """Plant an error in a positional argument of a formula."""

    def planted(formula: Formula) -> Formula:
        def wrong(*given: Any, **named: Any) -> Any:
            return formula(*given[:index], change(given[index]), *given[index + 1 :], **named)

        return wrong

    return planted


def with_value(change: Formula) -> Callable[[Formula], Formula]:
    """Plant an error in what a formula returns."""
    return lambda formula: lambda *given, **named: change(formula(*given, **named))


def minus(v: Any) -> Any:
    """The other sign, of a number or a vector."""
    return tuple(-x for x in v) if isinstance(v, tuple) else -v


def without_double_phase(taylor: Formula) -> Formula:
    """Leave out the term by what turns twice as fast as the pair; of a slow focus l₁ then doubles.

    The other terms are at the conjugate of the eigenvector, and at a real vector.
    """

    def wrong(flow: Any, u: Any, v: Any) -> Any:
        real = np.abs(v.imag).max() < 1e-9 * np.abs(v).max()
        return taylor(flow, u, v) * (np.array_equal(v, u.conj()) or real)

    return wrong


# What is planted: in which formula, how, and the row that turns, by its place and first words.
PLANTED: dict[str, tuple[Any, str, Callable[[Formula], Formula], str, str]] = {
    "the sign of k in (2.4)-(2.5)": (
        eq, "full_angular_acceleration", with_argument(4, minus), "(2.4)", "dω/dt while",
    ),
    "λ₀'s sign in (2.5)": (
        eq, "full_angular_acceleration", with_value(lambda v: (v[0], -v[1])), "(2.5)", "λ₀ is",
    ),
    "the sign of dq/dt": (eq, "attitude_rate", with_value(minus), "(2.6)", "dα/dt"),
    "α and β exchanged": (
        eq, "space_axes", with_value(lambda axes: (axes[1], axes[0], axes[2])), "(2.6)", "dα/dt",
    ),
    "Ẏ's sign in (2.7)": (
        eq, "contact_velocity", with_value(lambda v: (v[0], -v[1])), "(2.7)", "Ẋ",
    ),
    "the γ term of L": (
        eq, "contact_angular_momentum", with_argument(2, minus), "3.2", "M is the momentum",
    ),
    "K's sign in (3.1)": (
        eq, "contact_angular_momentum", with_argument(3, minus), "(3.1)", "M is the momentum",
    ),
    "Ω's sign in (3.2)": (
        eq, "rubber_angular_velocity", with_argument(2, minus), "(3.2)", "ω(M, γ) solves",
    ),
    "Ω's sign in (3.3)": (
        eq, "_classical_angular_velocity", with_argument(2, minus), "(3.3)", "ω(M, γ) solves",
    ),
    "(3.2)'s divergence": (eq, "rubber_divergence", with_value(minus), "Remark 5", "and (Aγ,γ)"),
    "(3.3)'s divergence": (
        eq, "_classical_divergence", with_value(minus), "Remark 5", "and (1/d",
    ),
    "Ω's sign in E": (eq, "energy", with_argument(2, minus), "3.1", "dE/dt"),
    "the classical E, of rubber": (
        eq, "energy", lambda E: lambda *v, spinning: E(*v, spinning=False), "3.2", "dE/dt",
    ),
    "the sign of (4.1)": (equilibria, "flow", with_value(minus), "(4.1)", "dγ/dt"),
    "Prop. 2's B, as printed": (
        equilibria, "proposition_2",
        lambda old: lambda p: (*old(p)[:2], p.K[2] * old(p)[2]), "E7, Prop. 2", "B =",
    ),
    "the first Lyapunov value": (
        equilibria, "lyapunov_value", with_value(minus), "E6, Prop. 2", "the focus",
    ),
    "κ in closed_form_points": (equilibria, "kappa", with_value(minus), "E10, 4.2", "Δ: φ"),
    "a term of the first Lyapunov value": (
        normal_forms, "_taylor", without_double_phase, "Prop. 2", "dr/dt",
    ),
    "the sense of a circle": (
        equilibria, "contact_path",
        with_value(lambda path: replace(path, turning=-path.turning)), "Prop. 1", "a circle",
    ),
    "a circle at Γ₅ as at Γ₁": (
        equilibria, "contact_path", with_argument(1, np.flip), "Prop. 1", "a circle",
    ),
    "Σ_u for Σ_s": (
        equilibria, "fixed_circle",
        with_value(lambda circle: replace(circle, axes=circle.axes * [[1], [-1]])),
        "4.1", "stable where",
    ),
    "the free term of P₃": (
        straight_motions, "straight_motion",
        with_value(lambda line: replace(line, polynomial=line.polynomial * [1, 1, 1, -1])),
        "(5.2)", "λ³P₃",
    ),
    "a straight line's speed": (
        straight_motions, "straight_motion",
        with_value(lambda line: replace(line, speed=1.01 * line.speed)), "E15, 5.1", "X =",
    ),
    "one root of the classical lines": (
        straight_motions, "straight_motions",
        lambda old: lambda p, f, c: 2 * old(p, f, c)[:2], "3.2", "classical: the straight",
    ),
    "c's sign in the classical lines": (
        straight_motions, "straight_motions", with_argument(2, minus), "3.2",
        "classical: the straight",
    ),
    "σ for δ": (
        straight_motions, "name_of_line", with_argument(1, minus), "Prop. 3", "four of them",
    ),
    "aⱼ for aₖ in stability_limit": (
        straight_motions, "stability_limit",
        with_argument(0, lambda p: replace(p, I=(p.I[1], p.I[0], p.I[2]))), "Fig. 10", "16/7.69",
    ),
    "g of (5.5), half a turn on": (
        section_5, "crossings_of_motion",
        lambda crossings: lambda *of: crossings(*of, np.pi), "(5.6)", "section and",
    ),
    "l's sign in (5.5)": (section_5, "section_state", with_argument(1, minus), "(5.5)", "γ² = 1"),
    "Steiner's terms": (
        ball, "inertia_about", with_argument(0, lambda point: point + 0.1), "E21, (A.3)", "I =",
    ),
}  # fmt: skip


@pytest.mark.parametrize("error", PLANTED)
def test_an_error_in_a_formula_turns_a_row(error: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a number; without it the row holds, as every row does."""
    module, name, planted, place, words = PLANTED[error]
    claims = [
        claim for part in (*SECTIONS, ours.SECTION) for claim in part.claims if claim.place == place
    ]
    (claim,) = [each for each in claims if each.statement.startswith(words)]
    monkeypatch.setattr(module, name, planted(getattr(module, name)))
    found = examine(claim)
    assert found.verdict == "does not reproduce"
    assert not isinstance(found.evidence, str), found.evidence
