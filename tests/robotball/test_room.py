"""Long motions: in files that nobody sees, with the same numbers, and little memory a sample."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from robotball.engines.mujoco.stepping import stretches
from robotball.motion import PIECE
from robotball.room import LARGE, let_go, room

MEASURE = """
import resource, sys
import numpy as np
import robotball as rb
from validation import compare
from validation.results import record

times = np.arange(int(sys.argv[1])) * 0.02
record(compare(rb.load_scene("fig12"), "fast", times))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


def test_what_is_let_go_is_there_again() -> None:
    """Every bit of a large array, which is a file's; a small one is an array as any other."""
    large, small = room((LARGE // 8, 2)), room((3, 2))
    values = np.random.default_rng(1).normal(size=large.shape)
    large[:], small[:] = values, values[:3]
    let_go()
    assert np.array_equal(large, values)
    assert np.array_equal(small, values[:3])
    assert large.flags.writeable


def test_a_file_has_no_name_and_goes_with_its_array(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the folder for temporary files, where nothing is seen."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def files() -> int:
        return sum(str(tmp_path) in line for line in Path("/proc/self/maps").open())

    held = room((LARGE,))
    assert files() == 1
    assert list(tmp_path.iterdir()) == []
    del held
    assert files() == 0


def test_without_a_place_for_files_all_is_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk, or none, costs memory and nothing else."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    held = room((LARGE, 2))
    held[:] = 1.5
    let_go()
    assert (held == 1.5).all()


def test_a_long_runs_steps_are_those_of_a_short_one() -> None:
    """Cut into pieces of samples: each span once, with its steps and its samples."""
    times = 0.02 * np.arange(2.0 * PIECE + 10)
    breaks = (1.0001, float(times[PIECE]), 1500.007)
    parts = list(stretches(times, breaks, 0.005))
    ends = np.concatenate([part.ends for part in parts])
    edges = np.union1d(times, breaks)
    assert np.array_equal(ends[:, 0], edges[:-1])
    assert np.abs(ends[:, 1] - edges[1:]).max() < 1e-12
    assert sum(len(part.samples) for part in parts) == len(times) - 1
    assert max(int(part.counts.sum()) for part in parts) <= 2 * 4096


@pytest.mark.slow
def test_a_sample_of_a_comparison_takes_little_memory() -> None:
    """138 bytes for each of 300 000 (547 where the motions are in memory), so a day's take 0.6 GB.

    Beside what 100 000 take, with all that is loaded and one piece.
    """
    peaks = [
        int(subprocess.check_output([sys.executable, "-c", MEASURE, str(count)], text=True))
        for count in (100_000, 400_000)
    ]
    assert (peaks[1] - peaks[0]) / 300_000 < 200
