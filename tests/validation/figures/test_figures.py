"""The pictures of the paper's figures show what is so, and the charts that they are drawn on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

import robotball as rb
from robotball.film import gl
from robotball.film.looks import INK
from robotball.qualitative.equilibria import closed_form_points, fixed_points
from robotball.qualitative.portraits import separatrices
from robotball.qualitative.sections import invariant_curve
from robotball.qualitative.straight_motions import stability_limit
from tests.figures import from_rest
from validation.figures import View, lines, motion_from_rest, paper_scene
from validation.figures import attractor_figures as tori
from validation.figures.lines import growth_rate, line_verticals
from validation.figures.motion_from_rest import closed_contour
from validation.figures.paper_figures import FIGURES, chosen
from validation.figures.sphere import Globe, Involute


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarser maps, shorter motions and smaller clouds: a picture in a second or two."""
    for module, name, value in (
        (lines, "FINENESS", 20),
        (lines, "SHOWN", 20.0),
        (lines, "LONG", 30.0),
        (motion_from_rest, "DURATIONS", {7: 10.0}),
        (tori, "LEVELS", (0.2, 0.5, 0.6)),
        (tori, "REGULAR", replace(tori.REGULAR, starts=8, count=320)),
        (tori, "REGULAR_BY_CONTACT", replace(tori.REGULAR_BY_CONTACT, starts=3, count=10)),
        (tori, "TORUS", replace(tori.TORUS, starts=8)),
        (tori, "TORUS_BY_CONTACT", replace(tori.TORUS_BY_CONTACT, skipped=5, count=20)),
        (tori, "CHAOS", replace(tori.CHAOS, starts=4, count=400)),
        (tori, "CHAOS_BY_CONTACT", replace(tori.CHAOS_BY_CONTACT, starts=4, count=40)),
    ):
        monkeypatch.setattr(module, name, value)


DRAWN = {
    file: figure
    for number in ("4", "5", "7", "9", "10", "11", "12", "tori")
    for file, figure in FIGURES[number].items()
}


# A figure of motions by both engines; the others are run by `make test-studies`.
QUICK = ("fig12",)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.study) for n in DRAWN]
)
def test_every_kind_of_figure_is_drawn(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """In both engines' colours where there is a motion: more red than blue, and the reverse."""
    if name == "fig04":
        request.getfixturevalue("screen")
    DRAWN[name]().savefig(tmp_path / "drawn.png")
    pixels = imread(tmp_path / "drawn.png")[:, :, :3]
    assert pixels.shape[0] > 500
    assert pixels.shape[1] > 900
    warm = pixels[:, :, 0] - pixels[:, :, 2]
    assert np.count_nonzero(warm > 0.3) > 100
    assert name == "fig09" or np.count_nonzero(warm < -0.3) > 100


def test_without_an_opengl_figs_3_and_4_alone_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """All figures are then all others; one that is named says what it needs."""
    monkeypatch.setattr(gl, "find_backend", lambda: None)
    every = {file for files in FIGURES.values() for file in files}
    assert every - set(chosen(())) == {"fig03", "fig04"}
    with pytest.raises(rb.InputError, match="no off-screen GL"):
        chosen(("3",))["fig03"]()


# What they show ----------------------------------------------------------------------------


@pytest.mark.parametrize(("number", "arcs"), [(6, 4), (7, 0)])
def test_the_closed_contour_of_fig6_has_four_arcs(number: int, arcs: int) -> None:
    """δ₁ → δ₃ ← δ₂ → δ₄ ← δ₁; at Fig. 7 it is gone, and the limit cycle is there."""
    scene = paper_scene(f"fig{number:02}")
    manifolds = separatrices(scene.parameters, fixed_points(scene.parameters), 400.0)
    assert len(closed_contour(scene, manifolds)) == arcs


def test_fig9_has_its_boundary_where_fig10_turns_unstable() -> None:
    """At K = (4, 5, 0) σ₋ is stable below the limit in f and not above.

    M of σ is along e₃ and M of δ against it, of the size √f.
    """
    ball = paper_scene("fig10").parameters
    limit = stability_limit(ball)
    assert limit is not None
    assert growth_rate(ball, ball.K, limit - 1e-4) < 0 < growth_rate(ball, ball.K, limit + 1e-4)
    for name, gamma in line_verticals(ball, 3.0).items():
        M = np.cross(gamma, ball.K)
        assert gamma @ gamma == pytest.approx(1)
        assert M[2] == pytest.approx(np.sqrt(3) * (1 if name[0] == "σ" else -1))


def test_both_chaplygin_balls_cross_on_the_same_curve() -> None:
    """By either engine the rubber ball's crossings are on the classical ball's curve: measured 3e-7
    of unit vectors, the chords that stand for the curve. They go round at different rates.
    """
    names = ("rubber_chaplygin_ball", "chaplygin_ball_same_tori")
    rubber, classical = (tori.started(paper_scene(name), 0.5) for name in names)
    by_equations = tori.crossings_of(tori.followed(rubber)).states
    by_engine = tori.crossings_of(tori.engine_followed(rubber)).states
    curve = invariant_curve(tori.crossings_of(tori.followed(classical)).states)
    assert invariant_curve(by_equations).rotation == pytest.approx(0.08697, abs=1e-5)
    assert curve.rotation == pytest.approx(0.14492, abs=1e-5)
    assert tori.apart(by_equations, curve) < 1e-6
    assert tori.apart(by_engine, curve) < 1e-6
    # A control: another start is on another torus.
    other = tori.crossings_of(tori.followed(tori.started(rubber, 0.4))).states
    assert tori.apart(other, curve) > 0.1  # measured 0.23


# The sphere of γ and bodies in space -------------------------------------------------------


def test_a_view_is_a_right_handed_frame() -> None:
    """Right, up and towards the viewer; from a height of 0 the third axis points straight up."""
    axes = View(azimuth=37.0, elevation=21.0).axes
    assert axes @ axes.T == pytest.approx(np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1)
    up = View(azimuth=10.0, elevation=0.0).places(np.eye(3)[2])
    assert up == pytest.approx((0, 1))


def test_the_involute_is_unrolled_once_and_keeps_areas() -> None:
    """θ and δ stand a quarter turn apart where the paper's φ puts them; even stays even."""
    involute = Involute(Figure().subplots(), "")
    points = closed_form_points(from_rest(0.3))
    places = {name: involute.places(gamma)[0] / np.pi for name, gamma in points.items()}
    expected = {"δ₁": 1.25, "δ₂": 0.25, "δ₃": 0.25, "δ₄": 1.25,
                "θ₁": 1.75, "θ₂": 0.75, "θ₃": 0.75, "θ₄": 1.75}  # fmt: skip
    assert {name: places[name] for name in expected} == pytest.approx(expected)
    gamma = np.random.default_rng(0).normal(size=(40_000, 3))
    gamma /= np.linalg.norm(gamma, axis=1, keepdims=True)
    phi, height = involute.places(gamma).T
    assert 0 <= phi.min() < phi.max() < 2 * np.pi
    counts = np.histogram2d(phi, height, bins=4, range=((0, 2 * np.pi), (-1, 1)))[0]
    assert counts == pytest.approx(2500, abs=200)  # four standard errors of 50


def test_a_line_on_the_involute_is_cut_and_not_drawn_across() -> None:
    """Once round the equator there is a gap, and no segment longer than a step."""
    involute = Involute(Figure().subplots(), "")
    turn = np.linspace(0.0, 2 * np.pi, 200)
    involute.line(np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))
    (line,) = involute.axes.get_lines()
    x = np.asarray(line.get_xdata(), dtype=float)
    assert np.isnan(x).sum() == 1
    assert np.nanmax(np.abs(np.diff(x))) < 0.05


def test_the_far_side_of_the_ball_is_pale() -> None:
    """A circle towards the viewer is one whole line in front; turned round, one behind."""
    globe = Globe(Figure().subplots(), View(azimuth=0.0, elevation=0.0), "")
    turn = np.linspace(0.0, 2 * np.pi, 100)
    ring = np.stack([np.full(100, 0.8), 0.6 * np.cos(turn), 0.6 * np.sin(turn)], axis=1)
    for gamma, front, back in ((ring, 0, 100), (-ring, 100, 0)):
        globe.line(gamma, alpha=1.0)
        near, far = globe.axes.get_lines()[-2:]
        assert np.isnan(np.asarray(near.get_xdata(), dtype=float)).sum() == front
        assert np.isnan(np.asarray(far.get_xdata(), dtype=float)).sum() == back
        assert far.get_alpha() < near.get_alpha()  # type: ignore[operator]


def test_a_name_keeps_clear_of_lines_and_names_and_one_behind_is_grey() -> None:
    """Of three beside one point on a line each is off the line and off the other names."""
    axes, turn = Figure().subplots(), np.linspace(-0.3, 0.3)
    globe, names = Globe(axes, View(azimuth=0.0, elevation=0.0), ""), list[np.ndarray]()
    point = np.array([0.8, 0.36, 0.48])
    globe.line(np.stack([0.8 + 0 * turn, 0.36 + turn, 0.48 + turn], axis=1))
    for gamma in (point, point, point * [-1, 1, 1]):
        globe.name(gamma, "Γ")
        name = axes.texts[-1]
        off = np.array(name.get_position()) - point[1:]
        assert np.hypot(*off) == pytest.approx(0.17, abs=1e-3)
        assert abs(off[0] - off[1]) / np.sqrt(2) > 0.08  # measured 0.12 at least
        assert all(np.hypot(*(off - other)) > 0.12 for other in names)  # measured 0.17 at least
        assert (name.get_color() == INK) == (gamma[0] > 0)
        names.append(off)
