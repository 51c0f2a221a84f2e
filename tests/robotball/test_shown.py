"""Scenes and motions in a notebook: a line of words, the path, a picture, and equality."""

from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np
import pytest

import robotball as rb
from robotball.chart import LEAST_LOG, Line, chart, legend, ticks
from robotball.robot import Value
from robotball.rotations import Array
from validation import compare

SCENE = rb.load_scene("fig12")
TIMES = rb.sample_times(1.0)
THEORY = rb.integrate(SCENE, TIMES)
MOTION = rb.simulate(SCENE, TIMES, "fast")


def test_a_scene_and_a_motion_are_a_line() -> None:
    """With what a reader asks first, and no array."""
    assert repr(SCENE) == "<Scene fig12: rubber, 1 rotor, 0.9 kg, radius 1 m; 10 s>"
    assert repr(THEORY).startswith("<ReferenceMotion of fig12 by equations ")
    assert repr(MOTION).endswith(", fast: 51 times to 1 s, path 2.737 m, no fault>")
    servo = rb.simulate(rb.load_scene("fig12"), TIMES, replace(rb.preset("naive"), name="mine"))
    assert "mine: " in repr(servo)
    assert repr(servo).endswith("fault>") or repr(servo).endswith("faults>")


def test_an_agreement_says_its_verdict_in_a_line() -> None:
    """compare takes a scene's name as well."""
    agreement = compare("fig12", "fast", TIMES)
    assert repr(agreement).startswith("<Agreement of fig12 by MuJoCo, fast: agrees; path error ")
    assert "\n" not in repr(agreement)
    assert agreement == compare(SCENE, "fast", TIMES)


def test_a_notebook_shows_the_path() -> None:
    """As well-formed SVG, a line a motion, beside the words."""
    agreement = compare(SCENE, "fast", TIMES, theory=THEORY)
    for shown, lines in (
        (SCENE._repr_html_(), 1), (MOTION._repr_html_(), 1), (agreement._repr_html_(), 2),
    ):  # fmt: skip
        root = ElementTree.fromstring(shown)
        charts = [each for each in root.iter("svg") if each.get("class") == "chart"]
        assert [len(list(each.iter("polyline"))) for each in charts] == [lines]
    assert "&lt;ContactMotion of fig12" in MOTION._repr_html_()


def cells_of(shown: str) -> list[list[str]]:
    rows = ElementTree.fromstring(shown).iter("tr")
    return [[cell.text or "" for cell in row] for row in rows]


@pytest.mark.slow
def test_a_notebook_shows_what_is_in_a_scene() -> None:
    """A row a body: its mass, and what turns it."""
    assert cells_of(SCENE._repr_html_())[1:] == [
        ["shell", "0.07", ""],
        ["frame", "0.8016", "2 rad/s"],
        ["rotor1", "0.0284", "148 rad/s"],
    ]
    robot = rb.load_scene("steered_pendulum_robot")._repr_html_()
    assert [row[2] for row in cells_of(robot)] == ["turns", "", "velocity servo", "position servo"]
    wobbling = cells_of(rb.load_scene("wobbling_drive")._repr_html_())
    assert any(row[2].endswith(" at first") for row in wobbling)


def test_a_scene_that_has_no_path_is_shown_all_the_same() -> None:
    """With the reason: it must not raise in a cell, nor take minutes."""
    shown = rb.load_scene("servo_motors")._repr_html_()
    assert "4000 steps reach t = " in shown
    assert "<svg" not in shown
    odd = replace(SCENE, title="<b> & $x$", duration=0.5)._repr_html_()
    ElementTree.fromstring(odd)
    assert "&lt;b&gt; &amp; $x$" in odd


@pytest.mark.slow
def test_plot_draws_paths_to_one_scale() -> None:
    """A metre is as long along X as along Y, and the figure is shown without pyplot."""
    figure = MOTION.plot(THEORY)
    path, momentum = figure.axes
    assert path.get_aspect() == 1.0
    assert [line.get_label() for line in path.lines] == ["MuJoCo", "equations"]
    assert momentum.get_ylabel() == "M, world axes [kg m²/s]"
    assert figure._repr_png_()[:4] == b"\x89PNG"  # type: ignore[attr-defined]


def test_equality_is_of_values_and_never_raises() -> None:
    """The same scene twice, the same motion twice; a changed number, another type."""
    assert rb.load_scene("fig12") == SCENE
    assert rb.integrate(SCENE, TIMES) == THEORY
    assert rb.simulate(SCENE, TIMES, "fast") == MOTION  # though it took another time
    others: list[object] = [THEORY, "fig12", None]
    assert MOTION not in others
    assert SCENE not in others
    assert replace(SCENE, duration=3.0) != SCENE
    moved = SCENE.start.momentum + np.array([1e-15, 0.0, 0.0])
    assert rb.Start(SCENE.start.attitude, moved) != SCENE.start
    assert replace(MOTION, times=MOTION.times[:-1]) != MOTION
    assert SCENE.ball == rb.load_scene("fig13").ball


@pytest.mark.parametrize("kind", [rb.Shell, rb.Frame, rb.Rotor, rb.Pendulum, rb.Ball, rb.Start])
def test_what_a_scene_is_made_of_is_a_name_of_robotball(kind: type) -> None:
    """And is compared by its values."""
    assert issubclass(kind, Value)


def test_scenes_whose_rates_are_arrays_are_compared() -> None:
    """Samples given as arrays are those given as numbers, alone and in a sum."""
    times = np.linspace(0.0, 10.0, 50)

    def driven(values: Array) -> rb.Scene:
        samples = rb.Samples(times=times, values=values)  # type: ignore[arg-type]
        return replace(SCENE, frame_rate=samples, rotor_rates=(rb.Sum((samples, 1.0)),))

    assert driven(np.sin(times)) == driven(np.sin(times))
    assert driven(np.sin(times)) != driven(np.cos(times))
    plain = rb.Samples(times=tuple(times.tolist()), values=tuple(np.sin(times).tolist()))
    assert driven(np.sin(times)).frame_rate == plain


def test_a_rate_of_ones_own_that_cannot_be_compared_equals_itself() -> None:
    """A plain record with an array raises where it is compared; a scene that has it does not."""

    @dataclass(frozen=True)
    class Table:
        values: Array

        def __call__(self, t: float) -> float:
            return float(np.interp(t, (0.0, 10.0), self.values))

    first, second = Table(np.array([1.0, 2.0])), Table(np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="ambiguous"):
        assert first == second
    assert replace(SCENE, frame_rate=first) == replace(SCENE, frame_rate=first)
    assert replace(SCENE, frame_rate=first) != replace(SCENE, frame_rate=second)


def test_nan_equals_nan_within_an_array() -> None:
    """As in what a file does not say of a motion."""
    unknown = replace(THEORY.loads, spin_torque=np.full(51, np.nan))
    assert unknown == replace(unknown, spin_torque=np.full(51, np.nan))
    assert unknown != THEORY.loads


# Charts ------------------------------------------------------------------------------------------


def lines_of(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, [0, 2, 4, 6, 8, 10]),
        (-0.31, 0.52, [-0.2, 0, 0.2, 0.4]),
        (1000.05, 1000.7, [1000.1, 1000.2, 1000.3, 1000.4, 1000.5, 1000.6, 1000.7]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    """Steps of 1, 2 or 5 times a power of ten, at most seven of them."""
    assert ticks(low, high) == pytest.approx(expected, abs=1e-12)


def test_a_chart_stands_a_line_that_goes_nowhere() -> None:
    """A point, a constant, a zero on a logarithmic axis, a hole: as of M(0) = 0."""
    t = np.linspace(0.0, 1.0, 5)
    for y, log in (
        (np.zeros(5), False),
        (np.zeros(5), True),
        (np.full(5, 7.0), False),
        (np.array([0.0, 1e-3, np.nan, 1e-9, 1.0]), True),
    ):
        svg = chart([Line("a & b", "#000000", t, y)], "t < 1", "y", log=log)
        text = " ".join(each.text or "" for each in lines_of(svg).iter("text"))
        assert "t < 1" in text
        assert "nan" not in svg
    assert np.finfo(float).eps > LEAST_LOG


def test_a_flat_path_makes_a_low_picture_to_one_scale() -> None:
    """The pixels of a metre are the same on both axes."""
    x = np.linspace(0.0, 30.0, 900)
    svg = lines_of(chart([Line("a", "#000000", x, np.sin(x))], "X", "Y", equal=True))
    assert float((svg.get("viewBox") or "").split()[3]) == 180.0
    (line,) = svg.iter("polyline")
    points = np.array([p.split(",") for p in (line.get("points") or "").split()], dtype=float)
    assert len(points) == 400
    across, up = np.ptp(points, axis=0)
    assert across / up == pytest.approx(30 / 2, rel=0.01)  # measured 15.02


def test_a_legend_has_the_dashes_that_tell_lines_apart_without_colour() -> None:
    """Beside each name."""
    t = np.linspace(0.0, 1.0, 3)
    made = legend([Line("a", "#0072B2", t, t), Line("b", "#0072B2", t, t, dash="2 3")])
    assert made.count("stroke-dasharray") == 1
    assert made.index("dasharray") > made.index("> a<")
