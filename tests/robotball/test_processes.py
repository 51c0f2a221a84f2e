"""Work in processes: in order, with its errors and warnings, and gone with who asked for it."""

import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from robotball import InputError, SceneWarning
from robotball.cores import allowed, at_most
from robotball.errors import warn
from robotball.files.replacing import replacing
from robotball.processes import in_processes


def late(job: int) -> tuple[int, int, int]:
    """The earlier of seven, the longer it takes; also its process and the threads allowed there."""
    time.sleep(0.02 * (7 - job))
    return job, os.getpid(), allowed()


def faulty(job: int) -> int:
    """Warns of job 1, refuses job 2, and ends its process at job 3."""
    if job == 1:
        warn("job 1 is odd")
    if job == 2:
        raise InputError("job 2 cannot be done")
    if job == 3:
        os._exit(job)
    return job


def half_written(folder: Path, job: int) -> None:
    """Job 0 goes on writing a file; job 1 finds the disk full as soon as it has begun."""
    if job == 0:
        with replacing(folder / "picture.png") as temporary:
            temporary.write_bytes(b"half of a picture")
            time.sleep(60)
    while not list(folder.iterdir()):
        time.sleep(0.01)
    raise InputError("No space left on device")


def known(module: str) -> bool:
    """Whether a module is imported already."""
    return module in sys.modules


@pytest.mark.parametrize(("most", "least", "count"), [(2, 2, 2), (1, 2, 1), (4, 8, 1)])
def test_results_come_in_the_order_of_the_jobs(most: int, least: int, count: int) -> None:
    """From so many processes of one thread each; one, or one for too few jobs, is this one."""
    with at_most(most):
        found = list(in_processes(late, range(7), least))
    assert [job for job, _, _ in found] == list(range(7))
    processes = {process for _, process, _ in found}
    assert len(processes) == count
    assert (os.getpid() in processes) == (count == 1)
    assert {threads for _, _, threads in found} == {1 if count > 1 else most}


@pytest.mark.parametrize("most", [1, 2])
def test_warnings_and_errors_are_the_callers(most: int) -> None:
    """With their own words, wherever the work is done; a process that dies ends the work."""
    with at_most(most), pytest.warns(SceneWarning, match="job 1 is odd"):
        assert list(in_processes(faulty, [0, 1, 4])) == [0, 1, 4]
    with at_most(most), pytest.raises(InputError, match="job 2 cannot be done"):
        list(in_processes(faulty, [0, 2, 4]))
    if most > 1:
        with at_most(most), pytest.raises(ChildProcessError, match="ended from outside"):
            list(in_processes(faulty, [3, 3]))


def test_a_process_that_is_ended_leaves_no_half_file(tmp_path: Path) -> None:
    """As the disk that is full for one picture of a comparison ends the drawing of the other."""
    with at_most(2), pytest.raises(InputError, match="No space left"):
        list(in_processes(partial(half_written, tmp_path), range(2)))
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
from robotball.cores import at_most
from robotball.processes import in_processes, prepare
from tests.robotball.test_processes import known
def main():
    with at_most(2):
        prepare("colorsys")
        print(*in_processes(known, ["colorsys", "wave"]), known("colorsys"))
"""


@pytest.mark.parametrize("guarded", [True, False])
def test_a_script_prepares_processes_below_its_guard(tmp_path: Path, guarded: bool) -> None:
    """They alone import what is prepared; without the guard they would run the script for ever."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + ("if __name__ == '__main__':\n    main()" if guarded else "main()"))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, env=environment)
    if guarded:
        assert (done.stdout, done.stderr) == ("True False False\n", "")
        return
    assert done.stdout == ""
    assert 'put what it does below `if __name__ == "__main__":`' in done.stderr.splitlines()[-1]
