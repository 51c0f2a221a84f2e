"""Only regular files of limited length are read; files are written completely or not at all."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files import columns as table_file
from robotball.files import contents
from robotball.files.columns import read_samples, read_table
from robotball.files.replacing import replacing
from robotball.user_model.robot_file import solid_of_file
from tests.messages import naming

READERS: dict[str, Callable[[Path], object]] = {
    "scene.toml": rb.load_scene,
    "whole.xml": rb.load_scene,
    "robot.xml": lambda path: solid_of_file(path, "body", "b"),
    "robot.urdf": lambda path: solid_of_file(path, "link", "b"),
    "samples.csv": read_samples,
    "run.csv": rb.read_trajectory,
    "run.npz": rb.read_trajectory,
    "run.parquet": rb.read_trajectory,
}


@pytest.mark.parametrize("name", READERS)
def test_devices_and_endless_files_are_not_read(tmp_path: Path, name: str) -> None:
    """Nor links to them: /dev/zero never ends, and a pipe blocks its reader.

    10 MB suffice for a scene, and 4000 MB for a table; the test's sparse 5 GB take no disk space.
    """
    check_length(READERS[name], tmp_path / name)


def check_length(read: Callable[[Path], object], path: Path) -> None:
    """Assert that neither a device nor a file of 5 GB is read."""
    path.symlink_to(os.devnull)
    with pytest.raises(rb.InputError, match=naming("regular~file")) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: ")
    path.unlink()
    path.touch()
    os.truncate(path, 5_000_000_000)
    with pytest.raises(rb.InputError, match=r"5000 MB.*\b(10|4000)\b"):
        read(path)


def test_a_file_of_the_greatest_length_is_read(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert contents(path, 5) == b"12345"
    with pytest.raises(rb.InputError, match="shorten the file"):
        contents(path, 4)


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_a_small_file_does_not_fill_the_memory(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A million equal numbers, 8 MB, compress to a few kB; their unpacked size counts."""
    path, zeros = tmp_path / f"zeros{suffix}", np.zeros(500_000)
    if suffix == ".npz":
        np.savez_compressed(path, x=zeros, y=zeros)
    else:
        pyarrow, parquet = map(pytest.importorskip, ("pyarrow", "pyarrow.parquet"))
        parquet.write_table(pyarrow.table({"x": zeros, "y": zeros}), path)
    assert read_table(path).columns["x"].shape == zeros.shape
    monkeypatch.setattr(table_file, "_MAX_MEMORY", 1_000_000)
    with pytest.raises(rb.InputError, match=naming("8~MB 1")):
        read_table(path)


def test_two_writers_never_share_a_temporary_file(tmp_path: Path) -> None:
    """Processes of two machines may have the same number; names may have the greatest length."""
    path = tmp_path / ("n" * 250 + ".json")
    with replacing(path) as first, replacing(path) as second:
        assert first != second
        assert first.parent == tmp_path
        first.write_text("first")
        second.write_text("second")
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]
