"""However a command is ended, its exit status says so, and it leaves no unfinished file."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

WORK = """
import ctypes, sys, time
from pathlib import Path
from robotball.files.replacing import replacing
from validation.endings import ended_by_signals

def in_compiled_code():
    lock, lock_it = ctypes.create_string_buffer(64), ctypes.CDLL(None).pthread_mutex_lock
    lock_it(lock)
    lock_it(lock)  # waits for good, and returns for no signal

def in_python():
    time.sleep(60)

def in_an_exec_of_text():
    exec("time.sleep(60)")

def in_a_library_that_makes_another_error_of_it():
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        raise ImportError("of a part of it") from None

def in_one_that_makes_nothing_of_it():
    while True:
        try:
            time.sleep(60)
        except KeyboardInterrupt:
            pass

with ended_by_signals(), replacing(Path("result.json")) as temporary:
    temporary.write_text("half of")
    print("at work", flush=True)
    globals()[sys.argv[1]]()
"""


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """What is started in the background of a shell ignores Ctrl-C, and hands that on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def ended(process: "subprocess.Popen[str]", number: int) -> tuple[int, str]:
    """Exit status and standard error of a process after a signal to it."""
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    return process.returncode, err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "where"),
    [
        (signal.SIGINT, "in_compiled_code"),
        (signal.SIGTERM, "in_compiled_code"),
        (signal.SIGINT, "in_python"),
        (signal.SIGTERM, "in_python"),
        (signal.SIGINT, "in_an_exec_of_text"),
        (signal.SIGINT, "in_a_library_that_makes_another_error_of_it"),
        (signal.SIGINT, "in_one_that_makes_nothing_of_it"),
    ],
)
def test_a_signal_ends_the_work_wherever_it_is(number: int, where: str, tmp_path: Path) -> None:
    """Status 128 and the signal's number, no traceback, and no file."""
    (tmp_path / "work.py").write_text(WORK)
    process = subprocess.Popen(
        [sys.executable, "-m", "work", where],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "at work\n"
    assert ended(process, number) == (128 + number, "")
    assert [path.name for path in tmp_path.iterdir()] == ["work.py"]


def listens(pid: int) -> bool:
    """Whether a process catches SIGTERM, which Python by itself does not."""
    caught = re.search(r"^SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text(), re.M)
    return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Start:
    """Starts the command in an empty folder."""

    def starting(*arguments: str) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [sys.executable, "-m", "validation", *arguments],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return starting


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_a_film_that_is_interrupted_leaves_nothing(start: Start, tmp_path: Path) -> None:
    """Ctrl-C goes to the encoder too, whose end is no error of its own."""
    process = start("video", "fig12", "--duration", "10")
    while not list(tmp_path.glob("out/.*.mp4")):
        assert process.poll() is None
        time.sleep(0.01)
    encoders = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(process.pid)], capture_output=True, text=True
    )
    for pid in encoders.stdout.split():
        os.kill(int(pid), signal.SIGINT)
    status, err = ended(process, signal.SIGINT)
    assert status == 130
    assert "Traceback" not in err
    assert list(tmp_path.glob("out/*")) + list(tmp_path.glob("out/.*")) == []


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 0.2, 0.7])
def test_a_command_that_is_interrupted_while_it_is_loaded_says_so(
    start: Start, seconds: float
) -> None:
    """Whatever part of it that is: for a second after it has begun to listen it imports."""
    process = start("compare", "fig12", "--duration", "1000")
    while not listens(process.pid):
        assert process.poll() is None
        time.sleep(0.001)
    time.sleep(seconds)
    status, err = ended(process, signal.SIGINT)
    assert status == 130
    assert "Traceback" not in err


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_no_disagreement(tmp_path: Path) -> None:
    """Status 2 and one line, for standard output as for a file."""
    for arguments, stdout in (
        (["model", "fig12"], "/dev/full"),
        (["model", "fig12", "--out", "/dev/full"], os.devnull),
    ):
        with Path(stdout).open("w") as file:
            done = subprocess.run(
                [sys.executable, "-m", "validation", *arguments],
                cwd=tmp_path,
                stdout=file,
                stderr=subprocess.PIPE,
                text=True,
            )
        assert done.returncode == 2
        assert done.stderr.startswith("robotball: ")
        assert "cannot be written: No space left on device" in done.stderr
        assert done.stderr.count("\n") == 1


def test_an_error_of_the_program_itself_is_no_disagreement(tmp_path: Path) -> None:
    """Its status is 3, with the traceback that its author needs."""
    broken = (
        "import sys, validation.cli as cli; cli.parse = lambda _: 1 / 0\n"
        "from validation.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", broken], capture_output=True, text=True)
    assert done.returncode == 3
    assert "ZeroDivisionError" in done.stderr
