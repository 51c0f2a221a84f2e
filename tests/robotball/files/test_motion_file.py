"""A motion written and read again is the same motion, whatever the kind of file."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from robotball.motion import Motion, arrays_of

KINDS = ("csv", "npz", "parquet")


def saved(motion: Motion, path: Path) -> Motion:
    if path.suffix == ".parquet":
        pytest.importorskip("pyarrow")
    motion.save(path)
    return rb.load_motion(path, motion.scene)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["fig12", "wobbling_drive", "three_rotors", "classical_regular"])
def test_a_motion_comes_back_to_the_last_bit(name: str, kind: str, tmp_path: Path) -> None:
    """Every array of a motion and of its loads, and the engine's label."""
    motion = rb.integrate(rb.load_scene(name), np.linspace(0, 1, 51))
    again = saved(motion, tmp_path / f"m.{kind}")
    for (place, array), (_, back) in zip(arrays_of(motion), arrays_of(again), strict=True):
        assert array.tobytes() == np.ascontiguousarray(back).tobytes(), place
        assert array.shape == back.shape
    assert again.engine == motion.engine


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_at_the_ends_of_the_range_come_back_too(kind: str, tmp_path: Path) -> None:
    """The least and the largest number, minus zero, and what a run that diverged leaves."""
    motion = rb.integrate(rb.load_scene("fig12"), np.linspace(0, 1, 7))
    odd = np.array([5e-324, -0.0, 1.7976931348623157e308, 0.1, np.nan, np.inf, 1 / 3])
    motion = replace(motion, momentum=np.stack([odd, odd[::-1], odd], axis=1))
    again = saved(motion, tmp_path / f"m.{kind}")
    assert again.momentum.tobytes() == motion.momentum.tobytes()


def test_the_header_has_the_scene_the_engine_and_the_units(tmp_path: Path) -> None:
    """The scene's TOML makes the same scene; a motion needs nothing beside its file."""
    scene = rb.load_scene("fig12")
    motion = rb.integrate(scene, np.linspace(0, 1, 5))
    motion.save(tmp_path / "m.csv")
    table = read_table(tmp_path / "m.csv")
    (tmp_path / "fig12.toml").write_text(table.header["scene_toml"])
    again = rb.load_scene(tmp_path / "fig12.toml")
    assert rb.scene_toml(again) == rb.scene_toml(scene)
    assert again.source == scene.source
    assert list(table.columns)[:7] == ["t", "x", "y", "qw", "qx", "qy", "qz"]
    assert tuple(table.units[name] for name in ("x", "wx", "Mx")) == ("m", "rad/s", "kg m²/s")
    assert '"name": "equations"' in table.header["engine"]


def test_a_contact_motion_leaves_its_step_in_the_header(tmp_path: Path) -> None:
    """From which the order of convergence of several files is told."""
    motion = rb.simulate(rb.load_scene("fig12"), np.linspace(0, 0.1, 5), "balanced")
    motion.save(tmp_path / "m.csv")
    assert f"# timestep: {motion.report.timestep}\n" in (tmp_path / "m.csv").read_text()


def test_a_drive_by_a_function_is_told_instead_of_the_scene(tmp_path: Path) -> None:
    """Such a scene has no TOML; its motion has a file all the same."""
    scene = replace(rb.load_scene("fig12"), frame_rate=lambda t: 2.0 + t)
    motion = rb.integrate(scene, np.linspace(0, 1, 5))
    motion.save(tmp_path / "m.csv")
    assert "# scene_toml_missing: a rate given by a function" in (tmp_path / "m.csv").read_text()
    assert rb.load_motion(tmp_path / "m.csv", scene).path_length == motion.path_length


def test_a_motion_of_another_scene_is_loaded_with_a_warning(tmp_path: Path) -> None:
    """Only where its columns fit; else the missing ones are named."""
    path = tmp_path / "m.csv"
    rb.integrate(rb.load_scene("fig12"), np.linspace(0, 1, 5)).save(path)
    with pytest.warns(rb.SceneWarning, match="a motion of fig12, and is taken as one of fig13"):
        rb.load_motion(path, rb.load_scene("fig13"))
    with (
        pytest.warns(rb.SceneWarning),
        pytest.raises(rb.InputError, match="rotor2_angle, rotor3_angle are missing"),
    ):
        rb.load_motion(path, rb.load_scene("three_rotors"))


def test_without_pyarrow_parquet_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It names the extra and the kinds of file that need none, and leaves no file."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    motion = rb.integrate(rb.load_scene("fig12"), np.linspace(0, 1, 5))
    with pytest.raises(rb.InputError, match=r"extra `parquet`, or use \.csv or \.npz"):
        motion.save(tmp_path / "m.parquet")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_suffix_is_refused(tmp_path: Path) -> None:
    """With the suffixes that there are."""
    motion = rb.integrate(rb.load_scene("fig12"), np.linspace(0, 1, 5))
    with pytest.raises(rb.InputError, match=r"one of \.csv, \.npz, \.parquet, not '\.xlsx'"):
        motion.save(tmp_path / "m.xlsx")
