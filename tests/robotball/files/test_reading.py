"""Whatever names a user's file, it is a regular one of a limited length, or refused in a line."""

import os
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import fault_window
from robotball.files import columns as table_file
from robotball.files import contents
from robotball.files.columns import read_samples, read_table
from robotball.files.foreign_bodies import solid_of_mjcf, solid_of_urdf
from validation.report.study_report import study_report

READERS: dict[str, Callable[[Path], object]] = {
    "scene.toml": rb.load_scene,
    "robot.xml": lambda path: solid_of_mjcf(path, "b"),
    "robot.urdf": lambda path: solid_of_urdf(path, "b"),
    "samples.csv": read_samples,
    "run.csv": rb.read_trajectory,
    "run.npz": rb.read_trajectory,
    "run.parquet": rb.read_trajectory,
    "fault.json": fault_window.load,
    "study.json": study_report,
}


@pytest.mark.parametrize("name", READERS)
def test_a_device_is_not_read(tmp_path: Path, name: str) -> None:
    """Nor one that a link names: /dev/zero has no end."""
    path = tmp_path / name
    path.symlink_to(os.devnull)
    with pytest.raises(rb.InputError, match="it is no regular file; copy what it gives") as error:
        READERS[name](path)
    assert str(error.value).startswith(f"{path}: ")


@pytest.mark.parametrize("name", READERS)
def test_a_file_without_end_is_not_read(tmp_path: Path, name: str) -> None:
    """10 MB are enough for a scene, and a table has 4000; these 5 GB take no place on the disk."""
    path = tmp_path / name
    path.touch()
    os.truncate(path, 5_000_000_000)
    with pytest.raises(rb.InputError, match=r"it has 5000 MB, and may have (10|4000); shorten it"):
        READERS[name](path)


def test_a_pipe_keeps_nobody_waiting(tmp_path: Path) -> None:
    """One that nobody writes into is refused at once."""
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    refused: list[str] = []

    def read() -> None:
        with pytest.raises(rb.InputError) as error:
            read_table(path)
        refused.append(str(error.value))

    reader = Thread(target=read, daemon=True)
    reader.start()
    reader.join(10)
    assert refused == [f"{path}: it is no regular file; copy what it gives into one"]


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_a_small_file_does_not_fill_the_memory(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A million equal numbers, 8 MB, are a few kB in a file; the limit is that of any other."""
    path, zeros = tmp_path / f"zeros{suffix}", np.zeros(1_000_000)
    if suffix == ".npz":
        np.savez_compressed(path, x=zeros)
    else:
        pyarrow, parquet = map(pytest.importorskip, ("pyarrow", "pyarrow.parquet"))
        parquet.write_table(pyarrow.table({"x": zeros}), path)
    assert read_table(path).columns["x"].shape == zeros.shape
    monkeypatch.setattr(table_file, "LONGEST", 1_000_000)
    with pytest.raises(rb.InputError, match="it unpacks to 8 MB, and may to 1"):
        read_table(path)


def test_a_file_of_the_greatest_length_is_read(tmp_path: Path) -> None:
    """One byte more is refused."""
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert contents(path, 5) == b"12345"
    with pytest.raises(rb.InputError, match="shorten it"):
        contents(path, 4)
