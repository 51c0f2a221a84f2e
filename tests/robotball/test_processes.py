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


def late(jobs: int, job: int) -> tuple[int, int, int]:
    """The earlier a job, the longer it takes; also its process and the threads allowed there."""
    time.sleep(0.02 * (jobs - job))
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


def test_results_come_in_the_order_of_the_jobs() -> None:
    """From two processes of one thread each, none of them this one."""
    with at_most(2):
        found = list(in_processes(partial(late, 7), range(7)))
    assert [job for job, _, _ in found] == list(range(7))
    processes = {process for _, process, _ in found}
    assert len(processes) == 2
    assert os.getpid() not in processes
    assert {threads for _, _, threads in found} == {1}


def test_one_process_is_this_one() -> None:
    """Where one is allowed, and where the jobs are too few."""
    for most, least in ((1, 2), (4, 5)):
        with at_most(most):
            found = list(in_processes(partial(late, 4), range(4), least))
        assert {process for _, process, _ in found} == {os.getpid()}


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
from functools import partial
from robotball.processes import in_processes, prepare
from robotball.cores import at_most
from tests.robotball.test_processes import known, late
def main():
    with at_most(2):
        prepare("colorsys")
        print(*in_processes(known, ["colorsys", "wave"]), known("colorsys"), flush=True)
        for _, process, _ in in_processes(partial(late, 60), range(60)):
            print(process, flush=True)
"""


@pytest.mark.slow
def test_no_process_outlives_who_asked_for_it(tmp_path: Path) -> None:
    """Not even where that is killed; what is prepared is imported for the processes alone."""
    (tmp_path / "script.py").write_text(f"{SCRIPT}if __name__ == '__main__':\n    main()")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, tmp_path / "script.py"], stdout=subprocess.PIPE, text=True, env=environment
    ) as script:
        assert script.stdout is not None
        assert script.stdout.readline().split() == ["True", "False", "False"]
        processes = {int(script.stdout.readline()) for _ in range(2)}
        script.kill()
    for process in processes:
        deadline = time.monotonic() + 20
        while Path(f"/proc/{process}").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not Path(f"/proc/{process}").exists()


@pytest.mark.slow
def test_a_script_that_its_processes_would_run_again_is_refused(tmp_path: Path) -> None:
    """One line says what the script lacks, and the script is not run for ever."""
    (tmp_path / "script.py").write_text(f"{SCRIPT}main()")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    script = [sys.executable, str(tmp_path / "script.py")]
    done = subprocess.run(script, capture_output=True, text=True, env=environment)
    assert done.stdout == ""
    assert 'put what it does below `if __name__ == "__main__":`' in done.stderr.splitlines()[-1]
