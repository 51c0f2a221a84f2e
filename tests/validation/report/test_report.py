"""Reports: self-contained pages with numbers, texts and charts, also in a browser."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import robotball as rb
from robotball.view.tracks import SLIPS, LineStyle
from tests.browser import Browser, needs_browser, opened
from tests.conftest import Robotball
from tests.messages import unnamed
from tests.robotball.theory.test_friction import regular
from validation import Agreement, compare
from validation.margins import Margin
from validation.output import program, together
from validation.plots import LEAST
from validation.report.chart import Line, chart, legend, ticks
from validation.report.scene_report import friction_needed, report, sentence

TIMES = rb.sample_times(1.0)
COMMAND = "robotball report fig12 --preset naive,fast"


@pytest.fixture(scope="module")
def agreements() -> list[Agreement]:
    return [compare("fig12", TIMES, settings=name) for name in ("naive", "fast")]


@pytest.fixture(scope="module")
def page(agreements: list[Agreement]) -> str:
    return report(agreements, COMMAND)


def test_a_report_has_settings_versions_and_command(page: str, agreements: list[Agreement]) -> None:
    """It has the settings, the versions, the scene file and the command.

    It loads nothing else, and does not depend on the speed of the run.
    """
    for text in (COMMAND, "fig12", "mujoco", rb.scene_toml(agreements[0].scene).splitlines()[1]):
        assert text in page.replace("&quot;", '"')
    for name, value in agreements[1].settings.plain().items():
        assert f"<td>{name}</td>" in page
        assert f">{value}<" in page or isinstance(value, dict | list)
    outside = r"(?:src|href)=\"(?!data:)|url\(|@import|fetch\(|https?://(?!www\.w3\.org/2000/svg)"
    assert re.findall(outside, page) == []
    assert len(page) < 1e6  # measured 0.2 MB
    slower = [
        replace(
            agreement,
            motion=replace(agreement.motion, report=replace(agreement.report, seconds=77.0)),
        )
        for agreement in agreements
    ]
    assert slower[0].realtime_factor != agreements[0].realtime_factor
    assert report(slower, COMMAND) == page


def test_a_sentence_has_the_error_and_its_bound_or_the_end_of_the_run(
    agreements: list[Agreement],
) -> None:
    """Cases: a sound run, a faulty one, and a run that broke off.

    Markup in a title is text.
    """
    naive, fast = agreements
    error = fast.path_error
    assert unnamed(f"{error:.1e} 0.0005", sentence(fast)) == []
    assert unnamed("0.01", sentence(naive)) == []
    mine = replace(rb.preset("naive"), name="mine", stop_at_fault=True)
    stopped = rb.simulate(rb.load_scene("fig12"), TIMES, settings=mine)
    broken = Agreement(naive.theory, stopped)
    assert not broken.finished
    assert unnamed(f"{stopped.times[-1]:.4g}~s", sentence(broken)) == []
    assert "mine" in report([broken], COMMAND)
    scene = replace(fast.scene, title="<img src=x onerror=alert(1)>")
    odd = Agreement(replace(fast.theory, scene=scene), replace(fast.motion, scene=scene))
    assert "<img src=x" not in report([odd], COMMAND)


def test_a_page_has_the_speed_of_the_ball_and_the_tilt_of_the_frame() -> None:
    agreement = compare("fig12", TIMES, settings="fast")
    theory = agreement.theory
    step = np.linalg.norm(theory.contact_point[-1] - theory.contact_point[-2])
    end = step / (theory.times[-1] - theory.times[-2])
    tilt = np.degrees(np.arccos(theory.gamma[:, 2].min()))
    page = report([agreement], COMMAND)
    assert unnamed(f"at~the~end~{end:.3g}~m/s {tilt:.3g}°", page.replace("\u00a0", " ")) == []


def test_the_friction_needed_is_shown_beside_the_friction_available() -> None:
    """fig12 needs 1.32 according to the equations; the recipe has 20."""
    agreement = compare("fig12", settings="fast")
    sentence = friction_needed(agreement.theory)
    assert unnamed("sliding 1.32 torsional 1.87~m", sentence) == []
    page = report([agreement], COMMAND)
    assert together(sentence) in page
    assert '<td class="number">20.0</td><td>9.58\u00a0%</td>' in page


def test_a_page_says_where_the_ball_slips_and_how_much_of_the_path_is_friction() -> None:
    """With the scene's friction, 0.3: 1 path with 3 bands, and 3 shades in each chart over time."""
    page = report([compare(regular(0.3), rb.sample_times(3.0), settings="fast")], COMMAND)
    for text in ("rolling without slip needs 0.991", "0 to 0.86 s", "changes the path by 21 %"):
        assert together(text) in page
    assert "does not slip" not in page
    assert "rolling needs a coefficient" not in page
    assert '<td class="number">0.3</td><td>100\u00a0%</td>' in page
    paths, *charts = re.findall(r'<svg class="chart".*?</svg></svg>', page)
    assert paths.count(f'stroke="{SLIPS.colour}"') == 3
    assert {chart.count(f'fill="{SLIPS.colour}"') for chart in charts} == {3}
    assert page.count(f"> {SLIPS.label}</span>") == 1 + len(charts)


def test_a_page_splits_the_distance_of_default_settings() -> None:
    page = report([compare("fig12", rb.sample_times(2.0), settings="naive")], COMMAND)
    for text in ("MuJoCo, default settings: sliding friction is 1", "by 42 %", "28 % off the path"):
        assert together(text) in page


def test_a_closed_loop_has_plots_of_its_calls_and_margins() -> None:
    """Of every command and reading in both engines; a loop that is unstable is called so."""
    controller = rb.Controller(lambda reading: {"pendulum1": 0.1 * reading.gyro[0]}, 0.01)
    loop = rb.load_scene("steered_pendulum_robot").with_controller(controller)
    runs = [compare(loop, 0.5, settings="fast")]
    gain = Margin("times the commands", 2.0, 4.0, {1.0: 0.1, 2.0: 1.0, 4.0: np.inf})
    late = Margin("s more delay", np.nan, 0.0, {0.0: 12.0})
    page = report(runs, COMMAND, margins={loop.name: [gain, late]})
    plots = re.findall(r"<figcaption>(.*?)</figcaption>(.*?)</figure>", page)
    keys = {caption: re.findall("</svg> (.*?)</span>", inside) for caption, inside in plots}
    for name in ("command[pendulum1]", "gyro[0]", "attitude[3]", "angles[frame]", "rates[frame]"):
        assert keys[name] == ["multibody equations", "MuJoCo, fast"]
    assert "contact_point[0]" not in keys  # it is not read
    assert keys["Margin: times the commands"] == ["growth", "limit"]
    assert (
        '<p class="verdict good">The loop works with 2 times the commands (4 is too much)' in page
    )
    assert '<p class="verdict bad">The loop is unstable as it is' in page
    without = report([compare("fig12", 0.5, settings="fast")], COMMAND)
    assert "Closed loop" not in without


# In a browser ------------------------------------------------------------------------------


def in_browser(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.slow(needs_browser(test))


@pytest.fixture(scope="module")
def browser(page: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Open the page, with a long name in its heading, and check its console and requests."""
    heading, folder = "<h1>Rolling balls: fig12", tmp_path_factory.mktemp("page")
    assert heading in page
    named = page.replace(heading, f"{heading}_steered_along_a_circle_and_back")
    with opened(named, folder) as browser:
        yield browser
        assert browser.console == []
        asked = [each for each in browser.requests if not each.startswith("data:")]
        assert asked == [(folder / "page.html").as_uri()]


@in_browser
def test_a_pointer_and_a_key_show_a_charts_values(browser: Browser) -> None:
    """The key moves to another time, and the values disappear when the pointer leaves."""
    first, second, after = browser.run(
        """(() => {
        const chart = document.querySelectorAll('svg.chart')[1];
        const box = chart.getBoundingClientRect();
        const readout = chart.parentElement.querySelector('.readout');
        return [
            new PointerEvent('pointermove',
                {clientX: box.left + box.width / 2, clientY: box.top + box.height / 2}),
            new KeyboardEvent('keydown', {key: 'ArrowRight'}),
            new PointerEvent('pointerleave'),
        ].map(event => (chart.dispatchEvent(event), readout.textContent));
        })()"""
    )
    values = r"t = 0\.\d+ s · MuJoCo, default settings: [\d.e-]+ · MuJoCo, fast: [\d.e-]+"
    assert re.fullmatch(values, first)
    assert second != first
    assert after == "Point at the plot, or use the arrow keys, for values."


@in_browser
def test_a_choice_shows_the_other_run(browser: Browser) -> None:
    """One view is shown at a time, with the distance of the balls of its run."""
    apart = browser.run(
        """[0, 1].map(each => {
            const select = document.querySelector('.views select');
            select.selectedIndex = each;
            select.onchange();
            const view = document.querySelector('.views .rb-view');
            view.rollingBalls.set({playing: false, t: 0.9});
            return JSON.parse(view.querySelector('script').textContent).balls[0].apart;
        })"""
    )
    assert apart[0] != apart[1]
    assert browser.run("document.querySelectorAll('.rb-view').length") == 1


COLOUR = "getComputedStyle(document.body).{}"


@in_browser
@pytest.mark.parametrize(
    ("width", "dark", "background"), [(360, False, "255, 255, 255"), (1280, True, "22, 25, 29")]
)
def test_a_page_fits_its_screen(browser: Browser, width: int, dark: bool, background: str) -> None:
    """Nothing is wider than the screen of a phone or desktop, in light and dark mode."""
    browser.size(width, 800, dark)
    assert browser.run("document.documentElement.scrollWidth") == width
    assert browser.run(COLOUR.format("backgroundColor")) == f"rgb({background})"


@in_browser
def test_a_page_is_printed_dark_on_white(browser: Browser) -> None:
    """On a few sheets, without folded parts and controls, and without broken numbers."""
    browser.size(1280, 800, dark=True, media="print")
    assert browser.run(COLOUR.format("color")) == "rgb(34, 38, 43)"
    shown = "each => each.getClientRects().length"
    for kind in ("details:not([open])", ".rb-controls", ".readout"):
        assert browser.run(f"[...document.querySelectorAll('{kind}')].some({shown})") is False
    assert browser.run(
        "[...document.querySelectorAll('table:not(.words) td.number')].every("
        "each => getComputedStyle(each).whiteSpace == 'nowrap')"
    )
    sheets = len(re.findall(rb"/Type\s*/Page\b", browser.pdf()))
    assert 3 <= sheets <= 8  # measured 5


def test_a_report_of_a_motorized_scene_has_the_loads(page: str) -> None:
    """Each driven hinge has torque, rate and power with units."""
    for text in (
        "Torque of frame: at most",
        "Rate of frame: at most 2\u00a0rad/s; the runs differ by at most ",
        "Power of rotor1: at most",
    ):
        assert text in page


@pytest.mark.parametrize(
    ("started", "words"),
    [
        ("/x/bin/robotball", "robotball"),
        ("{here}/.venv/bin/robotball", ".venv/bin/robotball"),
        ("{here}/validation/__main__.py", "python -m validation"),
    ],
)
def test_a_command_to_repeat_is_on_the_readers_path(
    started: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is the command on the path, or a path relative to the working folder."""
    monkeypatch.setattr("sys.argv", [started.format(here=Path.cwd())])
    monkeypatch.setattr("validation.output.which", lambda _: "/x/bin/robotball")
    assert program() == words


def test_the_command_writes_a_page_of_several_scenes(robotball: Robotball, tmp_path: Path) -> None:
    """The page is named after the scenes, and the printed command repeats it."""
    arguments = ("report", "fig12", "fig13", "--preset", "fast", "--duration", "0.5")
    status, out, _ = robotball(*arguments)
    assert status == 0
    assert out.splitlines()[-1] == "out/fig12-mujoco-fast-0.5s-fig13-report.html"
    page = (tmp_path / "out" / "fig12-mujoco-fast-0.5s-fig13-report.html").read_text("utf-8")
    assert "robotball report fig12 fig13 --preset fast --duration 0.5" in page
    assert page.count('class="rb-view"') == 2


# Charts ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, [0, 2, 4, 6, 8, 10]),
        (-0.31, 0.52, [-0.2, 0, 0.2, 0.4]),
        (1000.05, 1000.7, [1000.1, 1000.2, 1000.3, 1000.4, 1000.5, 1000.6, 1000.7]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    """At most seven ticks in steps of 1, 2 or 5 times a power of ten."""
    assert ticks(low, high) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("y", [[0.0] * 5, [7.0] * 5, [0.0, 1e-3, float("nan"), 1e-9, 1.0]])
def test_a_chart_can_draw_degenerate_lines(y: list[float], log: bool) -> None:
    """Cases: a constant, zeros on a logarithmic axis, and a gap, for example with M(0) = 0."""
    line = Line(LineStyle("a & b", "#000000"), np.linspace(0.0, 1.0, 5), np.array(y))
    svg = chart([line], "t < 1", "y", log=log)
    assert "t < 1" in [each.text for each in ElementTree.fromstring(svg).iter("text")]
    assert "nan" not in svg.lower()
    assert np.finfo(float).eps > LEAST


def test_a_chart_interrupts_a_line_where_a_value_is_missing() -> None:
    """Of many points it keeps some, and every missing one. Before, a line crossed each gap."""
    y = np.sin(np.arange(5000.0))
    y[[1001, 3333]] = np.nan
    svg = ElementTree.fromstring(chart([Line(LineStyle("y", "red"), np.arange(5000.0), y)], "", ""))
    assert len([*svg.iter("polyline")]) == 3


def test_a_flat_path_makes_a_low_picture_to_one_scale() -> None:
    """Pixels per metre are equal on both axes; the legend has the dashes of the line."""
    x = np.linspace(0.0, 30.0, 900)
    line = Line(LineStyle("a", "#000000", (2, 3)), x, np.sin(x), width=1.0)
    assert 'stroke-dasharray="2 3"' in legend([line])
    frame = np.array([[-1.0, 31.0], [-3.2, 3.2]])
    svg = ElementTree.fromstring(chart([line], "X", "Y", frame=frame))
    assert float((svg.get("viewBox") or "").split()[3]) == 0.2 * 478 // 1 + 1 + 38 + 46
    (drawn,) = svg.iter("polyline")
    points = np.array([p.split(",") for p in (drawn.get("points") or "").split()], dtype=float)
    assert len(points) == 400
    across, up = np.ptp(points, axis=0)
    assert across / up == pytest.approx(30 / 2, rel=0.01)  # measured 15.02
