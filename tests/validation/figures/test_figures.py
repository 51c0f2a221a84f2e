"""The pictures of the paper's figures show what is so; the commands behind them say it too."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

import robotball as rb
from robotball.rotations import rotation_matrix
from tests.validation.commands.test_cli import Robotball, robotball  # noqa: F401
from validation.figures import lines as figures_lines
from validation.figures import sections as figures_sections
from validation.figures.figures import FIGURES, draw_figures
from validation.figures.lines import LINE_K, growth_rate, line_verticals
from validation.figures.parts import on_disc, paper_scene, theory_motion
from validation.figures.rest import both
from validation.studies.attractors.sampling import Recipe


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarser maps and smaller clouds: a picture in a second or two."""
    small = Recipe(f=25.0, starts=4, skipped=2, count=40, direction=0)
    monkeypatch.setattr(figures_lines, "FINENESS", 20)
    monkeypatch.setattr(figures_sections, "CHAOS", replace(small, count=400))
    monkeypatch.setattr(figures_sections, "CHAOS_BY_CONTACT", small)
    short = replace(figures_sections.TORUS_BY_CONTACT, skipped=5, count=20)
    monkeypatch.setattr(figures_sections, "TORUS_BY_CONTACT", short)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("number", [5, 7, 9, 11])
def test_every_kind_of_figure_is_drawn(number: int, tmp_path: Path) -> None:
    """Each is a picture of two colours and more, with its own name."""
    written = draw_figures([number], tmp_path)
    assert [path.stem for path in written] == list(FIGURES[number])
    for path in written:
        pixels = imread(path)[:, :, :3]
        assert pixels.shape[0] > 500
        assert pixels.shape[1] > 900
        # Both engines' hues are there: more red than blue, and more blue than red.
        warm = pixels[:, :, 0] - pixels[:, :, 2]
        assert np.count_nonzero(warm > 0.3) > 200
        assert number == 9 or np.count_nonzero(warm < -0.3) > 200


@pytest.mark.parametrize("name", ["fig05b", "fig05c", "fig06", "fig08"])
def test_the_drawn_motions_from_rest_agree(name: str) -> None:
    """What is drawn over the equations' path is MuJoCo's, and it lies on it."""
    scene = paper_scene(name)
    path, gamma, engine = both(scene)
    # Measured 1.7e-5 m of 38 m and 3.3e-6 at most (fig06, which passes a saddle in 30 s): steps
    # of 5 ms at 4.6 rad/s.
    assert np.abs(engine.contact_point - path).max() < 1e-4
    assert np.abs(engine.gamma - gamma).max() < 2e-5
    assert engine.diagnostics is not None
    assert engine.diagnostics.seconds > 0


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


def test_fig9_has_its_boundary_where_fig10_turns_unstable() -> None:
    """At K = (4, 5, 0) σ₋ is stable below f = 2.0806 and not above; σ₊ is stable nowhere."""
    ball = paper_scene("fig10").parameters
    assert growth_rate(ball, LINE_K, 2.0806) < 0 < growth_rate(ball, LINE_K, 2.0807)
    side = np.linspace(-8, 8, 12)
    rates = [growth_rate(ball, (K1, K2, 0.0), 2.0, "σ₊") for K1 in side for K2 in side]
    assert np.nanmin(rates) > 0.1  # measured 0.25 1/s


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


def test_a_point_and_its_opposite_are_one_on_the_disc() -> None:
    """The disc keeps areas and takes γ and -γ to the same place, within its rim."""
    gamma = np.random.default_rng(0).normal(size=(20_000, 3))
    gamma /= np.linalg.norm(gamma, axis=1, keepdims=True)
    places = on_disc(gamma)
    assert np.array_equal(places, on_disc(-gamma))
    radii = np.linalg.norm(places, axis=1)
    assert radii.max() <= 1
    # Even on the sphere, even on the disc: a quarter within half the radius, ± 0.003.
    assert np.mean(radii < 0.5) == pytest.approx(0.25, abs=0.012)


COMMANDS = {
    "section fig12 --count 40 --preset fast --json a.json": (
        r"equations: 40 crossings, 20 with g growing, 20 falling\nmujoco: 40 crossings"
    ),
    "section classical_chaotic --starts 3 --count 20 --skip 2 --g 0.4 --json a.json": (
        r"equations: 60 crossings"
    ),
    "lyapunov fig14 --starts 4 --duration 500 --transient 100 --preset fast --json a.json": (
        r"λ₁ \[1/s\] +0\.1[\s\S]*λ₁ by MuJoCo, fast"
    ),
    "basins fig12 --starts 24 --transient 2000 --json a.json": r"cycle of period 8\.743261 s +0\.",
    "equilibria fig07 --longest 70 --json a.json": r"saddle[\s\S]*period 60\.0086320 s",
    "equilibria classical_regular --json a.json": r"straight +0\.",
    "figures 10 --json a.json": r"out/fig10\.png",
}


@pytest.mark.parametrize(("arguments", "words"), COMMANDS.items())
def test_the_commands_say_it_and_write_it(
    robotball: Robotball,  # noqa: F811
    tmp_path: Path,
    arguments: str,
    words: str,
) -> None:
    """Status 0, the result on standard output, and the same as JSON with its versions."""
    status, out, _ = robotball(*arguments.split())
    assert status == 0
    assert re.search(words, out)
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["versions"]["mujoco"]


BAD_INPUT = {
    "figures 3": r"no figure 3 to draw; there are Figs 5 to 14",
    "figures ten": r"'ten'",
    "section fig12 --count 0": r"count must be at least 1, not 0",
    "section fig12 --preset fastt": r"no preset is called 'fastt'",
    "section fig12 --preset naive --count 2": r"MuJoCo's run is no result",
    "lyapunov fig12 --starts 0": r"starts must be at least 1, not 0",
    "lyapunov fig12 --duration -1": r"duration and transient must be positive",
    "basins fig12 --starts 1": r"starts must be at least 2, not 1",
    "section wobbling_drive": r"the drives change in time",
}


@pytest.mark.parametrize(("arguments", "words"), BAD_INPUT.items())
def test_what_they_cannot_use_is_one_line(
    robotball: Robotball,  # noqa: F811
    arguments: str,
    words: str,
) -> None:
    """Status 2 and one clear line, no traceback."""
    status, _, err = robotball(*arguments.split())
    assert status == 2
    assert re.search(rf"robotball: .*{words}.*\n$", err)
