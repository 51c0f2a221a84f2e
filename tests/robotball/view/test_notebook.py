"""Scenes and motions in a notebook: repr, path, figure, and equality."""

import subprocess
import sys
from base64 import b64decode
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from matplotlib.text import Annotation
from PIL import Image

import robotball as rb
from robotball.robot.looks import rgb
from robotball.rotations import Array
from robotball.view import notebook
from robotball.view.notebook import by_value, cell
from robotball.view.tracks import line_looks
from tests.messages import naming

SCENE = rb.load_scene("fig12")
TIMES = rb.sample_times(1.0)
THEORY = rb.integrate(SCENE, TIMES)
MOTION = rb.simulate(SCENE, TIMES, settings="fast")


@cache
def notebook_shell() -> Any:
    """Return an IPython shell as in a notebook's kernel."""
    shell: Any = InteractiveShell()  # type: ignore[no-untyped-call]
    notebook.register(shell)
    return shell


def shown_in_a_notebook(value: object) -> str:
    """Return the HTML that a notebook displays for a value."""
    shown, _ = notebook_shell().display_formatter.format(value, include={"text/html"})
    return str(shown["text/html"])


def test_importing_robotball_in_a_notebook_displays_scenes_as_cells() -> None:
    """IPython's HTML of a scene is its cell."""
    code = "import robotball as rb; html = get_ipython().display_formatter.formatters['text/html']"
    code += "; print(html.lookup(rb.load_scene('fig12')).__name__)"
    shown = subprocess.check_output([sys.executable, "-m", "IPython", "-c", code], text=True)
    assert shown == "scene_cell\n"


def test_the_repr_of_a_scene_or_motion_is_one_line() -> None:
    """With scene, engine, settings and faults, and without arrays."""
    assert repr(SCENE) == "<Scene fig12: rubber, 1 rotor, 0.9 kg, radius 1 m; 10 s>"
    assert repr(THEORY).startswith("<ReferenceMotion of fig12 by equations ")
    assert repr(MOTION).endswith(", fast: 51 times to 1 s, path 2.737 m, no fault>")
    assert "\n" not in repr(MOTION)


def test_the_repr_of_a_report_has_a_line_for_each_fault(tmp_path: Path) -> None:
    """And the largest reading of each kind, without arrays."""
    assert repr(MOTION.report).count("\n") == 6
    assert repr(MOTION.report).endswith("\n  no fault>")
    assert f"largest slip [m/s]: {MOTION.report.slip.max():.2g}\n" in str(MOTION.report)
    nothing = np.empty(0)
    broken = replace(MOTION.report, slip=nothing, spin=nothing, depth=nothing)
    assert repr(broken).count("\n") == 3  # of a run that ended in its first step
    start = replace(SCENE.start, momentum=1e12 * SCENE.start.momentum)  # and one that ended at once
    none = rb.simulate(replace(SCENE, start=start), np.linspace(0.0, 0.1, 6), settings="naive")
    assert repr(none).endswith(", naive: 0 times, path 0 m, 1 fault>")
    assert "<img" not in shown_in_a_notebook(none)
    none.save(tmp_path / "none.csv")
    with pytest.raises(rb.InputError, match=naming("rows")):
        rb.load_motion(tmp_path / "none.csv", SCENE)
    naive = rb.simulate(SCENE, TIMES, settings="naive").report
    assert repr(naive).endswith(
        "\n  ".join(["", *(f"fault: {fault}" for fault in naive.faults)]) + ">"
    )


def pixels_of(shown: str) -> Array:
    """Return the picture (height, width, 3) of a cell, channels 0 to 255."""
    (image,) = ElementTree.fromstring(shown).iter("img")
    png = b64decode((image.get("src") or "").removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(BytesIO(png)).convert("RGB"), dtype=float)


def test_a_notebook_cell_shows_the_paths_in_the_engines_colours() -> None:
    """They cover 0.39 % to 0.70 % of the pixels, no other engine's colour appears."""
    for shown, motions in (
        (shown_in_a_notebook(SCENE), [THEORY]),
        (shown_in_a_notebook(MOTION), [MOTION]),
        (cell("both", [THEORY, MOTION]), [THEORY, MOTION]),
    ):
        pixels = pixels_of(shown)
        for motion, look in zip((THEORY, MOTION), line_looks([THEORY, MOTION]), strict=True):
            colour = 255 * np.array(rgb(look.colour))
            share = np.all(np.abs(pixels - colour) < 2, axis=2).mean()
            assert (share > 1e-3) == (motion in motions)
    assert "&lt;ContactMotion of fig12" in shown_in_a_notebook(MOTION)


@pytest.mark.parametrize(("across", "along", "height"), [(1, 1, 720), (1, 30, 480), (0, 0, 480)])
def test_a_flat_path_gives_a_low_picture(across: float, along: float, height: int) -> None:
    """At least half as high as its 960 pixels of width, also for a ball at rest."""
    circle = np.column_stack([along * np.cos(TIMES), across * np.sin(6 * TIMES)])
    shown = cell("flat", [replace(THEORY, contact_point=circle)])
    assert pixels_of(shown).shape == (height, 960, 3)


def cells_of(scene: rb.Scene) -> list[list[str]]:
    """Return the rows below the header of the table that shows a scene; they need no path."""
    shown = shown_in_a_notebook(replace(scene, duration=0.02))
    rows = ElementTree.fromstring(shown).iter("tr")
    return [[cell.text or "" for cell in row] for row in rows][1:]


def test_a_notebook_shows_the_bodies_of_a_scene() -> None:
    """One row per body: its mass and what drives it."""
    assert cells_of(SCENE) == [
        ["shell", "0.07", ""],
        ["frame", "0.8016", "2 rad/s"],
        ["rotor1", "0.0284", "148 rad/s"],
    ]
    robot = cells_of(rb.load_scene("steered_pendulum_robot"))
    assert [row[2] for row in robot] == ["", "velocity servo", "position servo"]
    wobbling = cells_of(rb.load_scene("wobbling_drive"))
    assert any(row[2].endswith(" initially") for row in wobbling)


def test_a_scene_without_a_path_is_still_displayed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cell shows the reason; it neither raises nor takes minutes."""
    monkeypatch.setattr(notebook, "_STEPS", 200)
    shown = shown_in_a_notebook(rb.load_scene("servo_motors"))
    assert "200 steps reach only t = " in shown
    assert "<img" not in shown
    odd = shown_in_a_notebook(replace(SCENE, title="<b> & $x$", duration=0.1))
    ElementTree.fromstring(odd)
    assert "&lt;b&gt; &amp; $x$" in odd


def test_plot_draws_paths_with_equal_scales() -> None:
    """Along X and Y; the figure is displayed without pyplot."""
    figure = rb.plot(MOTION, THEORY)
    path, momentum = figure.axes
    assert path.get_aspect() == 1.0
    assert [line.get_label() for line in path.lines] == ["MuJoCo, fast", "equations"]
    assert momentum.get_ylabel() == "M, world axes [kg m²/s]"
    assert figure._repr_png_()[:4] == b"\x89PNG"  # type: ignore[attr-defined]
    assert by_value(np.array([2.0, 1.92, 0.0])) == {2.0: "X, Y", 0.0: "Z"}
    assert len(by_value(np.array([2.0, 1.88, 0.0]))) == 3


def test_plot_shows_where_a_ball_slips() -> None:
    """Each component of M is named at its last value."""
    scene = replace(SCENE, friction=rb.Friction(1.0, 0.5, rolling=0.05))
    motion = rb.integrate(scene, 0.5)
    path, momentum = rb.plot(motion).axes
    assert path.get_legend() is not None
    assert path.get_legend_handles_labels()[1] == ["multibody equations", "slips"]
    (shade,) = momentum.collections
    ends = [span.get_extents().intervalx for span in shade.get_paths()]
    assert np.array(ends) == pytest.approx(np.array(motion.slipping))
    heights = [note.xy[1] for note in momentum.texts if isinstance(note, Annotation)]
    assert heights == [*by_value(motion.momentum[-1])]


def test_equality_compares_values_and_never_raises() -> None:
    """Equal values make equal scenes and motions; a changed number or another type does not."""
    assert rb.load_scene("fig12") == SCENE
    assert rb.integrate(SCENE, TIMES) == THEORY
    assert rb.simulate(SCENE, TIMES, settings="fast") == MOTION  # although its run time differs
    others: list[object] = [THEORY, "fig12", None]
    assert MOTION not in others
    assert SCENE not in others
    assert replace(SCENE, duration=3.0) != SCENE
    moved = SCENE.start.momentum + np.array([1e-15, 0.0, 0.0])
    assert rb.Start(SCENE.start.attitude, moved) != SCENE.start
    assert replace(MOTION, times=MOTION.times[:-1]) != MOTION
    assert SCENE.ball == rb.load_scene("fig13").ball
    # Quantities missing in a file are NaN in its motion, which still equals itself.
    unknown = replace(THEORY.loads, spin_torque=np.full(51, np.nan))
    assert unknown == replace(unknown, spin_torque=np.full(51, np.nan))
    assert unknown != THEORY.loads


def test_scenes_are_compared_for_any_kind_of_rate() -> None:
    """Samples given as arrays equal those given as tuples; incomparable rates equal themselves."""
    times, scenes = np.linspace(0.0, 10.0, 50), []
    for values in (np.sin(times), np.sin(times).tolist(), np.cos(times)):
        samples = rb.Samples(times=times, values=values)  # type: ignore[arg-type]
        scenes.append(SCENE.with_hinges(command=(samples, rb.Sum((samples, 1.0)))))
    assert scenes[0] == scenes[1] != scenes[2]

    @dataclass(frozen=True)
    class Table:
        values: Array

        def __call__(self, t: float) -> float:
            return float(np.interp(t, (0.0, 10.0), self.values))

    one, other = (
        SCENE.with_hinges(command={"frame": Table(np.array([1.0, 2.0]))}) for _ in range(2)
    )
    assert replace(one, duration=10.0) == one
    assert one != other
