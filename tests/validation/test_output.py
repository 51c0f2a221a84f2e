"""Output: file names, tables, CSV and pictures."""

import csv
import json
import os
import stat
import threading
import warnings
from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import robotball as rb
from robotball.engines.engine import engine_named, engine_names
from robotball.engines.mujoco import LABEL
from robotball.files.replacing import replacing
from robotball.motion import path_error
from robotball.theory.reduced import LABEL as EQUATIONS
from robotball.view.tracks import PRESET_LOOKS, line_looks, slip_parts
from tests.messages import naming, unnamed
from tests.robotball.theory.test_friction import regular
from validation import Agreement, compare
from validation.cli import parse
from validation.output import (
    progress_bar,
    writable_file,
    write_rows,
    write_text,
)
from validation.plots import (
    in_view,
    momentum_picture,
    path_picture,
)
from validation.results import changed, file_name, file_stem, scenes_of
from validation.slip import others
from validation.studies.extremes import round_ticks
from validation.study import Column, Row, Study, present, table_of

TIMES = rb.sample_times(0.1)

# Names -----------------------------------------------------------------------------------------


def test_a_comparison_is_named_after_scene_engine_and_preset() -> None:
    """The name has the duration if it is not the scene's, and `all` for all presets.

    Any names of settings and scenes give valid file names.
    """
    short = replace(rb.load_scene("fig12"), duration=0.1)
    agreements = [compare(short, TIMES, settings=name) for name in rb.PRESETS]
    assert file_stem([agreements[2]]) == "fig12-mujoco-balanced"
    assert file_stem(agreements[1:3]) == "fig12-mujoco-fast-balanced"
    assert file_stem(agreements) == "fig12-mujoco-all"
    assert file_stem([compare("fig12", TIMES, settings="fast")]) == "fig12-mujoco-fast-0.1s"
    engine = replace(LABEL, name="PhysX 5 (SAPIEN)")
    words = ["accurate - cone - noslip", "to 1e-05", "size/2"]
    name = "x$[1]-y-physx-5-sapien-accurate-cone-noslip-to-1e-05-size-2"
    assert file_name("x$[1] y", engine, words) == name


def test_scenes_with_the_same_name_get_different_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their folders distinguish them; a repeated scene is used once."""
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b", "far/b"):
        Path(folder).mkdir(parents=True)
        Path(folder, "fig12.toml").write_bytes(rb.scene_toml(rb.load_scene("fig12")).encode())
    paths = ("a/fig12.toml", "fig12", "b/fig12.toml", "./a/fig12.toml", "far/b/fig12.toml", "fig12")
    names = [scene.name for scene in scenes_of(paths).values()]
    assert names == ["a-fig12", "fig12", "b-fig12", "b-fig12-2"]


@pytest.mark.parametrize(
    ("command", "names", "words"),
    [
        ("video fig12", "fps resolution slow camera ghost", ""),
        ("video fig12 --camera above --ghost --slow 2", "slow camera ghost", "slow-2 above ghost"),
        ("dynamics section fig12 --starts 4 --g 0.5", "starts count g", "starts-4 g-0.5"),
        ("study cost fig12 --duration 4", "duration", "4s"),
        ("engines fig12 --only mujoco", "only", "mujoco"),
    ],
)
def test_options_that_differ_from_the_default_are_in_the_name(
    command: str, names: str, words: str
) -> None:
    """In the order of `--help`; options with their default value are left out."""
    function, bound = parse(command.split())
    bound.apply_defaults()
    options = {name: bound.arguments[name] for name in names.split()}
    assert changed(function, **options) == words.split()


# Tables ----------------------------------------------------------------------------------------

ROWS: list[Row] = [{"name": "a[b]", "error": 1.2e-3}, {"name": "c", "error": None}, {"name": "d"}]
COLUMNS = (Column("name", itemgetter("name"), words=True), Column("error", "error", "m"))


def test_the_files_and_tables_of_a_study_have_its_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Numbers have two digits, missing ones a dash, and brackets are kept.

    A section of a table ends with the last row of a key.
    """
    table = table_of(COLUMNS, ROWS)
    study = Study("x y", LABEL, ["study"], ROWS, {"runs": ROWS}, ["[bold]note[/]", table], Figure())
    picture, data, rows = (tmp_path / f"{study.stem('4s')}.{end}" for end in ("png", "json", "csv"))
    assert picture.name == "x-y-mujoco-study-4s.png"
    assert present(study, picture, data, rows) == [picture, data, rows]
    printed = capsys.readouterr().out
    lines = [line.split() for line in printed.splitlines()]
    assert lines == [
        ["note"],
        ["error"],
        ["name", "[m]"],
        [printed.splitlines()[3].strip()],
        ["a[b]", "1.2e-03"],
        ["c", "-"],
        ["d", "-"],
    ]
    assert rows.read_text() == "name,error\na[b],0.0012\nc,\nd,\n"
    assert json.loads(data.read_text())["runs"] == ROWS
    assert picture.read_bytes()[:4] == b"\x89PNG"
    # No picture, no data and no rows.
    empty = tmp_path / "empty.csv"
    assert present(Study("x", None, ["study"], []), tmp_path / "a.png", None, empty) == [empty]
    assert empty.read_text().strip() == ""
    sections = table_of(COLUMNS, [{"name": letter} for letter in "aab"], section="name").rows
    assert [row.end_section for row in sections] == [False, True, True]


@pytest.mark.parametrize(
    ("form", "value", "text"),
    [
        (".4f", -1e-9, "0.0000"),
        (".4f", -1e-4, "-0.0001"),
        (".7g", -0.0, "0"),
        (".1e", -0.0, "0.0e+00"),
        (".0%", -1e-4, "0%"),
        ("d", -3, "-3"),
    ],
)
def test_a_number_that_rounds_to_zero_has_no_sign(form: str, value: float, text: str) -> None:
    """It holds in any format; other numbers keep their sign."""
    assert Column("x", "x", form=form).text({"x": value}) == text


def test_a_name_in_a_table_is_not_a_formula(tmp_path: Path) -> None:
    """An apostrophe makes a spreadsheet read it as text; numbers are unchanged."""
    names = ["=1+2", "+1", "-1", "@a", "\ta", "a=1"]
    write_rows(tmp_path / "a.csv", [{"scene": name, "error": -1.5} for name in names])
    _, *rows = csv.reader((tmp_path / "a.csv").open(newline=""))
    assert rows == [[name if name == "a=1" else f"'{name}", "-1.5"] for name in names]


def test_an_old_file_is_kept_if_writing_fails(tmp_path: Path) -> None:
    """A full disk leaves the old file, and no fragment."""
    old = tmp_path / "a.json"
    write_text(old, "old")
    full = pytest.raises(rb.InputError, match=naming("a.json No~space~left"))
    with full, replacing(old) as temporary:
        temporary.write_text("half of")
        raise OSError(28, "No space left on device")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_long_work_writes_a_line_from_time_to_time_to_a_log(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Outside a terminal, the first line comes after the interval.

    Jupyter forces colours, but is not a terminal.
    """
    monkeypatch.setenv("FORCE_COLOR", "1")
    clock = iter((0.0, 29.0, 31.0, 45.0))
    monkeypatch.setattr("validation.output.time.monotonic", lambda: next(clock))
    with progress_bar(8) as show:
        for done in (1, 2, 3):
            show(done, f"{done} of 8 cells")
    assert capsys.readouterr().err == "25%: 2 of 8 cells, about 12 s to go\n"


def test_long_work_says_early_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Work that takes 2 s more gets no line; work that takes longer, one after 0.2 s."""
    for parts, line in (((0.0, 0.1, 0.2), ""), ((0.0, 0.01, 0.02), "1%: file, about 25 s to go\n")):
        clock = iter((0.0, 0.15, 0.4, 0.65))
        monkeypatch.setattr("validation.output.time.monotonic", lambda: next(clock))  # noqa: B023
        with progress_bar(1, first_line=0.2) as show:
            for done in parts:
                show(done, "file")
        assert capsys.readouterr().err == line


# Pictures --------------------------------------------------------------------------------------


def test_pictures_show_where_a_ball_slips() -> None:
    """A band under the path and a shade behind the times, named in the legend; M is constant."""
    agreement = compare(regular(0.3), rb.sample_times(3.0), settings="fast")
    assert isinstance(agreement.theory, rb.ReferenceMotion)
    pictures = path_picture([agreement]), momentum_picture([agreement])
    for picture in pictures:
        (shade,) = picture.axes[-1].collections
        ends = [path.get_extents().intervalx for path in shade.get_paths()]
        assert np.array(ends) == pytest.approx(np.array(agreement.theory.slipping))
        names = [text.get_text() for text in picture.legends[0].get_texts()]
        assert names.count("slips") == 1
    (band,) = pictures[0].axes[0].collections
    assert len(band.get_paths()) == len(agreement.theory.slipping) == 3
    assert "is constant" in pictures[1].axes[0].get_title()
    assert "equations without slip" in pictures[0].axes[0].get_legend_handles_labels()[1]


def test_the_picture_of_a_run_with_too_little_friction_splits_its_error() -> None:
    """It has the ball with this friction, and the parts of friction and engine as its title."""
    agreement = compare("fig12", TIMES, settings="naive")
    paths = path_picture([agreement]).axes[0]
    assert "equations with this friction" in paths.get_legend_handles_labels()[1]
    assert agreement.slip is not None
    assert paths.get_title() == agreement.slip.split
    (ball,) = others([agreement])
    assert path_error(ball, agreement.theory) == agreement.slip.by_friction
    assert others([agreement, agreement]) == []


def test_a_slip_between_two_samples_is_shown() -> None:
    """It has the samples around it. A slip after the last sample is not shown."""
    times = np.array([0.0, 1.0, 2.0, 3.0])
    assert slip_parts([(0.0, 0.5), (1.2, 1.4), (2.0, 2.5)], times) == [
        slice(0, 2), slice(1, 3), slice(2, 4)
    ]  # fmt: skip
    assert slip_parts([(3.0, 4.0)], times) == []


@pytest.mark.parametrize("name", ["fig06", "fig05d", "chaplygin_ball", "routh_sphere"])
def test_pictures_show_what_their_axes_say(name: str) -> None:
    """X and Y have equal scales, errors end at rounding, and a constant M is a text.

    No picture warns about circles, M = 0 as in fig06, or equal limits.
    """
    agreement = compare(name, rb.sample_times(0.5), settings="fast")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pictures = path_picture([agreement]), momentum_picture([agreement])
        for picture in pictures:
            picture.draw_without_rendering()
    (paths, distance), (errors,) = (picture.axes for picture in pictures)
    (x0, x1), (y0, y1), box = paths.get_xlim(), paths.get_ylim(), paths.get_window_extent()
    assert box.width / (x1 - x0) == pytest.approx(box.height / (y1 - y0), rel=1e-6)
    assert ("constant" in errors.get_title()) == agreement.scene.keeps_momentum
    assert f"over\n{agreement.scene.momentum_scale:.3g} kg m²/s" in errors.get_ylabel()
    drawn = np.asarray(distance.get_lines()[0].get_ydata(), dtype=float)
    assert drawn.max() == agreement.path_errors.max()
    assert drawn.min() >= 1e-17 * agreement.theory.path_scale


def test_a_straight_paths_errors_end_at_rounding_and_its_panel_is_flat() -> None:
    """Errors of 1e-33 are drawn at 1e-17 of the path, and the axis says so; one in six is flat."""
    agreement = compare("fig12", TIMES, settings="fast")
    times = agreement.motion.times
    ahead, aside = (np.column_stack([times, np.full(len(times), y)]) for y in (0.0, 1e-33))
    straight = Agreement(
        replace(agreement.theory, contact_point=ahead),
        replace(agreement.motion, contact_point=aside),
    )
    paths, errors = path_picture([straight]).axes
    floor = 1e-17 * straight.theory.path_scale
    assert errors.get_ylim()[0] > floor / 100  # measured 0.1: a decade around a constant
    assert unnamed(f"time~[s] {floor:.0e}", errors.get_xlabel()) == []
    box = paths.get_position()
    assert box.height < errors.get_position().height / 1.5  # measured 1.3 and 2.7 inches


def test_runs_are_distinguished_without_colour_and_a_cross_marks_an_early_end() -> None:
    """Each has a different colour, dash and marker; default settings have the colour of MuJoCo."""
    agreements = [compare("fig12", TIMES, settings=name) for name in rb.PRESETS]
    motions = [agreements[0].theory, *(item.motion for item in agreements)]
    reference_look, *looks = line_looks(motions)
    for part in ("colour", "dash", "marker"):
        assert len({getattr(item, part) for item in (reference_look, *looks)}) >= len(looks)
    assert looks[0].colour == LABEL.colour
    # A preset has the same look in every picture.
    assert [line_looks([item])[0] for item in motions] == [reference_look, *looks]
    assert line_looks(motions[::-1]) == [reference_look, *looks][::-1]
    assert len({item.colour for item in line_looks([motions[1], *motions])}) == len(motions) + 1
    mine = replace(rb.preset("naive"), name="mine", stop_at_fault=True)
    broken = Agreement(
        agreements[0].theory, rb.simulate(rb.load_scene("fig12"), TIMES, settings=mine)
    )
    for agreement, crosses in ((agreements[1], 0), (broken, 1)):
        lines = path_picture([agreement]).axes[0].get_lines()
        ends = [line for line in lines if line.get_marker() == "X" and np.size(line.get_xdata())]
        assert len(ends) == crosses


def test_an_engine_and_its_presets_have_one_look_each() -> None:
    """Engines differ in their markers; presets differ in colour, dash and marker."""
    engines = [engine_named(name) for name in engine_names()]
    assert len({engine_item.label.marker for engine_item in engines}) == len(engines)
    for engine in engines:
        unlisted = {*engine.presets} - {*PRESET_LOOKS}
        assert unlisted <= {"naive", "as-it-comes"}, engine.label.name
        engine_look = (engine.label.colour, (), engine.label.marker)
        looks = [
            engine_look,
            *(PRESET_LOOKS[name] for name in engine.presets if name in PRESET_LOOKS),
        ]
        for part in zip(*looks, strict=True):
            assert len({*part}) == len(looks), engine.label.name
        if engine.label.name != "multibody equations":
            assert EQUATIONS.colour not in {colour for colour, _, _ in looks}


def test_a_run_that_flies_away_leaves_the_view() -> None:
    """Infinite values and values beyond the reach do not widen the axes."""
    view = np.array([0.0, 2.0])
    assert in_view(view, np.array([0.0, 2.0, 3.0, -1e9, np.nan, np.inf]), 4.0) == (-4.0, 3.0)
    assert in_view(np.array([np.nan]), np.array([np.nan]), 1.0) == (0.0, 0.0)


@pytest.mark.parametrize("length", [40, 90, 150, 400])
def test_a_long_title_stays_within_its_picture(length: int) -> None:
    """Its letters become smaller, then it has two lines; it does not overlap the axes.

    Dollars are text.
    """
    errors = ": path error 1.0e-07 (fast)"
    name = ("$5 a robot of $6 rolls " * 20)[: length - len(errors)]
    agreement = compare(replace(rb.load_scene("fig12"), name=name), TIMES, settings="fast")
    figure = path_picture([agreement])
    figure.draw_without_rendering()
    (drawn,), (names,) = figure.texts, figure.legends
    box, below = drawn.get_window_extent(), names.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width
    assert below.y1 <= box.y0 < box.y1 <= figure.bbox.height
    assert ("…" in drawn.get_text()) == (length == 400)
    assert not drawn._preprocess_math(drawn.get_text())[1]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        (np.geomspace(1e-4, 0.2, 8), ["$10^{-4}$", "$10^{-3}$", "$10^{-2}$", "$10^{-1}$"]),
        (np.geomspace(1e-13, 0.1, 5), ["$10^{-13}$", "$10^{-9}$", "$10^{-5}$", "$10^{-1}$"]),
        ([0.0, 1.0, 2.0], ["0", "1", "2"]),
        ([2.0, 3.0], ["2", "3"]),
    ],
)
def test_a_failure_maps_ticks_are_round(values: Sequence[float], labels: list[str]) -> None:
    """Ticks are at most four powers of ten if the values span some."""
    places, shown = round_ticks(list(values))
    assert shown == labels
    assert all(-0.5 <= place <= len(values) - 0.5 for place in places)


# Special files ------------------------------------------------------------------


def write(path: Path, text: str) -> None:
    with replacing(writable_file(path)) as temporary:
        temporary.write_text(text)


def test_a_pipe_is_written_to_and_kept(tmp_path: Path) -> None:
    """Its reader gets the whole text; the same holds for a device."""
    fifo, read = tmp_path / "fifo", list[str]()
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: read.append(fifo.read_text()), daemon=True)
    reader.start()
    write(fifo, "whole")
    reader.join(10)
    assert read == ["whole"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert list(tmp_path.iterdir()) == [fifo]


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_kept_and_its_target_is_replaced(tmp_path: Path, there: bool) -> None:
    """It holds for existing and new targets, without fragments in either folder."""
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far" / "real.json", tmp_path / "link.json"
    link.symlink_to("far/real.json")
    if there:
        target.write_text("old")
    write(link, "new")
    assert link.is_symlink()
    assert (target.is_symlink(), target.read_text()) == (False, "new")
    assert [path.name for path in target.parent.iterdir()] == ["real.json"]


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(link)
    with pytest.raises(rb.InputError, match=naming("link Too~many~levels")):
        write(link, "new")
