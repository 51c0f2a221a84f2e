"""The pictures of the paper's figures show what is so."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.qualitative.equilibria import fixed_points
from robotball.qualitative.portraits import separatrices
from robotball.qualitative.tori import invariant_curve
from robotball.rotations import rotation_matrix
from validation.figures import attractor_sections as figures_sections
from validation.figures import attractor_sections as figures_tori
from validation.figures import lines as figures_lines
from validation.figures import rest as figures_rest
from validation.figures.lines import LINE_K, growth_rate, line_verticals
from validation.figures.paper_figures import FIGURES, draw_figures
from validation.figures.rest import both, closed_contour
from validation.figures.sheets import theory_motion
from validation.paper.formulas import paper_scene
from validation.studies.contact_sections import (
    cloud_by_contact,
    cloud_by_equations,
    distance_to_curve,
)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarser maps, shorter motions and smaller clouds: a picture in a second or two."""
    changed: dict[Any, dict[str, Any]] = {
        figures_lines: {"FINENESS": 20, "SHOWN": 20.0, "LONG": 30.0},
        figures_rest: {"DURATION": 10.0},
        figures_tori: {"LEVELS": (0.2, 0.5, 0.6), "FOLLOWED": 210.0},
    }
    for module, values in changed.items():
        for name, value in values.items():
            monkeypatch.setattr(module, name, value)
    for name, changes in {
        "REGULAR": {"starts": 8, "count": 320},
        "REGULAR_BY_CONTACT": {"starts": 3, "count": 10},
        "TORUS": {"starts": 8},
        "TORUS_BY_CONTACT": {"skipped": 5, "count": 20},
        "CHAOS": {"starts": 4, "count": 400},
        "CHAOS_BY_CONTACT": {"starts": 4, "count": 40},
    }.items():
        recipe = replace(getattr(figures_sections, name), **changes)
        monkeypatch.setattr(figures_sections, name, recipe)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ["3", "4", "5", "7", "9", "10", "11", "12", "tori"])
def test_every_kind_of_figure_is_drawn(name: str, tmp_path: Path) -> None:
    """Each is a picture with its own name, and in both engines' colours where there is a motion."""
    written = draw_figures([name], tmp_path)
    assert [path.stem for path in written] == list(FIGURES[name])
    for path in written:
        pixels = imread(path)[:, :, :3]
        assert pixels.shape[0] > 500
        assert pixels.shape[1] > 900
        # More red than blue, and more blue than red.
        warm = pixels[:, :, 0] - pixels[:, :, 2]
        assert np.count_nonzero(warm > 0.3) > 200
        assert name in ("3", "9") or np.count_nonzero(warm < -0.3) > 200


@pytest.mark.parametrize("name", ["fig05b", "fig05c", "fig06", "fig08"])
def test_the_drawn_motions_from_rest_agree(name: str) -> None:
    """What is drawn over the equations' path is MuJoCo's, and it lies on it."""
    scene = paper_scene(name)
    path, gamma, engine = both(scene)
    # Measured 1.1e-6 m and 1.5e-7 at most over 10 s: RK4's error at 5 ms and 4.6 rad/s.
    assert np.abs(engine.contact_point - path).max() < 3e-6
    assert np.abs(engine.gamma - gamma).max() < 5e-7
    assert engine.report.seconds > 0


def test_fig5_runs_along_curves_of_eulers_top() -> None:
    """With K = 0 (Aγ,γ) is constant, along MuJoCo's motion too, and the end is a straight line."""
    scene = replace(paper_scene("fig05b"), duration=20.0)
    _, _, engine = both(scene)
    A = np.array(scene.parameters.A)
    level = (engine.gamma**2) @ A
    assert np.ptp(level) < 1e-7  # measured 1.1e-8
    assert np.ptp(engine.gamma[:, 2]) > 0.04  # measured 0.051
    across = engine.gamma[-1] @ np.array(scene.parameters.Omega)
    assert abs(across) < 0.003  # measured 0.0015: it comes to rest on the circle (Ω,γ) = 0
    speed = np.linalg.norm(np.diff(engine.contact_point[-2:], axis=0)) / np.diff(engine.times[-2:])
    assert speed[0] == pytest.approx(np.sqrt(21), rel=1e-3)  # a|Ω|; measured 2e-4 off


@pytest.mark.parametrize(("number", "arcs"), [(6, 4), (7, 0)])
def test_the_closed_contour_of_fig6_has_four_arcs(number: int, arcs: int) -> None:
    """δ₁ → δ₃ ← δ₂ → δ₄ ← δ₁; at Fig. 7 it is gone, and the limit cycle is there."""
    scene = paper_scene(f"fig{number:02}")
    manifolds = separatrices(scene.parameters, fixed_points(scene.parameters), 400.0)
    assert len(closed_contour(scene, manifolds)) == arcs


def test_fig9_has_its_boundary_where_fig10_turns_unstable() -> None:
    """At K = (4, 5, 0) σ₋ is stable below f = 2.0806 and not above; σ₊ is stable nowhere."""
    ball = paper_scene("fig10").parameters
    assert growth_rate(ball, LINE_K, 2.0806) < 0 < growth_rate(ball, LINE_K, 2.0807)
    side = np.linspace(-8, 8, 12)
    rates = [growth_rate(ball, (K1, K2, 0.0), 2.0, "σ₊") for K1 in side for K2 in side]
    assert np.nanmin(rates) > 0.1  # measured 0.125 1/s


def test_fig9s_straight_lines_go_opposite_ways() -> None:
    """M of σ is along e₃ and M of δ against it, of the size √f."""
    for name, gamma in line_verticals(3.0, LINE_K).items():
        M = np.cross(gamma, LINE_K)
        assert gamma @ gamma == pytest.approx(1)
        assert M[2] == pytest.approx(np.sqrt(3) * (1 if name[0] == "σ" else -1))


def test_fig10_turns_round_in_both_engines() -> None:
    """From dY/dt = -a|Ω| to +a|Ω| in 60 s: the ball has gone from σ₊ to δ₊."""
    scene = paper_scene("fig10")
    times = rb.sample_times(60.0)
    attitudes, path = theory_motion(scene, times)
    engine = rb.simulate(scene, times)
    for Y in (path[:, 1], engine.contact_point[:, 1]):
        speeds = np.diff(Y) / np.diff(times)
        assert speeds[0] == pytest.approx(-1, abs=0.05)  # the start is 0.01 off
        assert speeds[-1] == pytest.approx(1, abs=3e-5)  # measured 8.6e-6 off
    end = line_verticals(3.0, LINE_K)["δ₊"]
    assert rotation_matrix(attitudes[-1])[2] == pytest.approx(end, abs=1e-2)
    # Measured 1.4e-8 m of 60 m, though errors grow by e every 4 s on the way from σ₊.
    assert np.abs(engine.contact_point - path).max() < 1e-6


@pytest.mark.slow
def test_mujocos_torus_of_fig11a_is_that_of_the_equations() -> None:
    """60 points in 20 ms steps: measured 1.9e-4 of unit vectors at most, RK4's error.

    A control: points of the strange attractor of Fig. 11b are as far away as 1.6.
    """
    scene = rb.load_scene("fig12")
    curve = cloud_by_equations(scene.parameters, figures_sections.TORUS, seed=0)
    few = replace(figures_sections.TORUS_BY_CONTACT, skipped=60, count=60)
    model = build(scene, rb.preset("fast"))
    points = cloud_by_contact(model, few, seed=0)
    assert distance_to_curve(points.states, curve.states).max() < 6e-4
    chaos = cloud_by_equations(rb.load_scene("fig14").parameters, figures_sections.CHAOS, seed=0)
    assert distance_to_curve(chaos.states, curve.states).max() > 1


@pytest.mark.parametrize("by_engine", [False, True])
def test_both_chaplygin_balls_cross_on_the_same_curve(by_engine: bool) -> None:
    """By either engine the rubber ball's crossings are on the classical ball's curve: measured 3e-7
    of unit vectors, the chords that stand for the curve. They go round at different rates.
    """
    rubber, classical = (
        figures_tori.started(paper_scene(name), 0.5)
        for name in ("rubber_chaplygin_ball", "chaplygin_ball_same_tori")
    )
    curves = [
        invariant_curve(figures_tori.points_of(figures_tori.crossings_of(scene)))
        for scene in (rubber, classical)
    ]
    assert curves[0].rotation == pytest.approx(0.08697, abs=1e-5)
    assert curves[1].rotation == pytest.approx(0.14492, abs=1e-5)
    crossings_of = figures_tori.engine_crossings_of if by_engine else figures_tori.crossings_of
    points = figures_tori.points_of(crossings_of(rubber))
    assert figures_tori.apart(points, curves[1]) < 1e-6
    # A control: another start is on another torus.
    other = figures_tori.points_of(figures_tori.crossings_of(figures_tori.started(rubber, 0.4)))
    assert figures_tori.apart(other, curves[1]) > 0.1  # measured 0.23
