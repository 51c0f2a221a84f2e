"""The command as a process: streams, signals, exit status, and no incomplete files."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import robotball as rb
from tests.imports import PROJECT
from tests.messages import unnamed

WORK = """
import ctypes, sys, time
from pathlib import Path
import validation.__main__ as main
from robotball.files.replacing import replacing

def in_compiled_code():
    main._GRACE = 0.3
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

with main._ended_by_signals(), replacing(Path("result.json")) as temporary:
    temporary.write_text("half of")
    print("at work", flush=True)
    globals()[sys.argv[1]]()
"""
PIPES: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """Restore SIGINT and SIGHUP, which children of background jobs and nohup ignore."""
    interrupt = signal.signal(signal.SIGINT, signal.default_int_handler)
    hang_up = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGHUP, hang_up)


def start(folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    """Start a script or a module as a process in a folder."""
    return subprocess.Popen([sys.executable, *arguments], cwd=folder, **PIPES)


def ended(process: "subprocess.Popen[str]", number: int) -> tuple[int, str]:
    """Send a signal to a process, and return its exit status and standard error."""
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    return process.returncode, err


def run(
    folder: Path, arguments: str, streams: str = "", **environment: str
) -> "subprocess.CompletedProcess[str]":
    """Run a module with arguments and redirections of a shell, and return the result."""
    command = f'exec "$@" {streams}'
    words = ["bash", "-c", command, "bash", sys.executable, "-m", *arguments.split()]
    return subprocess.run(words, cwd=folder, env={**os.environ, **environment}, **PIPES)


# Signals ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("where", "number"),
    [
        ("in_compiled_code", signal.SIGINT),
        ("in_compiled_code", signal.SIGTERM),
        ("in_compiled_code", signal.SIGHUP),
        ("in_python", signal.SIGTERM),
        ("in_python", signal.SIGHUP),
        ("in_an_exec_of_text", signal.SIGINT),
        ("in_a_library_that_makes_another_error_of_it", signal.SIGINT),
    ],
)
def test_a_signal_ends_the_work_at_any_point(where: str, number: int, tmp_path: Path) -> None:
    """The status is 128 plus the number of the signal, without traceback and without files."""
    (tmp_path / "work.py").write_text(WORK)
    process = start(
        tmp_path, "work.py", where
    )  # a script, because Python caches the bytecode of modules
    assert process.stdout is not None
    assert process.stdout.readline() == "at work\n"
    assert ended(process, number) == (128 + number, "")
    assert [path.name for path in tmp_path.iterdir()] == ["work.py"]


@pytest.mark.slow
@pytest.mark.usefixtures("screen", "linux")
def test_a_film_that_is_interrupted_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C also ends the encoder, which is not reported as an error."""
    small = ("--resolution", "320x180", "--duration", "6")
    process = start(tmp_path, "-m", "validation", "video", "fig12", *small)
    while not list(tmp_path.glob("out/.*.mp4")):
        assert process.poll() is None
        time.sleep(0.01)
    for children in Path(f"/proc/{process.pid}/task").glob("*/children"):
        for pid in children.read_text().split():
            os.kill(int(pid), signal.SIGINT)
    status, err = ended(process, signal.SIGINT)
    assert (status, re.search("Traceback|encoder", err)) == (130, None)
    assert list(tmp_path.glob("out/*")) + list(tmp_path.glob("out/.*")) == []


def listens(pid: int) -> bool:
    """Return whether a process catches SIGTERM, which Python does not by default."""
    caught = re.search(r"^SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text(), re.M)
    return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)


@pytest.mark.slow
@pytest.mark.usefixtures("linux")
@pytest.mark.parametrize("seconds", [0.0, 0.4])
def test_a_command_can_be_interrupted_during_its_imports(tmp_path: Path, seconds: float) -> None:
    """The signal may come at any time in the first second, during imports."""
    process = start(tmp_path, "-m", "validation", "compare", "fig12", "--duration", "1000")
    while not listens(process.pid):
        assert process.poll() is None
        time.sleep(0.001)
    time.sleep(seconds)
    status, err = ended(process, signal.SIGINT)
    assert (status, "Traceback" in err) == (130, False), err


def test_an_interrupt_that_python_drops_prints_no_traceback() -> None:
    """A callback of the import system drops it, and the process still ends."""
    code = """
import os, signal, weakref
from validation import __main__, cli
class Module: pass
def main():
    module = Module()
    kept = weakref.ref(module, lambda _: os.kill(os.getpid(), signal.SIGINT))
    del module
    while True: pass
cli.main = main
__main__.main()
"""
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT, capture_output=True, text=True, timeout=60
    )
    assert (run.returncode, run.stderr) == (130, "")


# Streams ---------------------------------------------------------------------------------------

COMPARE = "validation compare fig12 --duration 0.2 --no-plots --json a.json"
FULL = "robotball: the output cannot be written: No space left on device\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("streams", "arguments", "status", "error"),
    [
        # A reader that leaves, like `| head`.
        ("> >(true)", "validation scenes", 0, ""),
        ("> >(true)", "validation export fig12", 0, ""),
        # Closed streams. `python -m robotball` is the same command.
        (">&-", "robotball scenes", 0, ""),
        ("<&- >&- 2>&-", COMPARE, 0, ""),
        ("2>&-", "validation roll", 2, ""),
        (">/dev/full", "validation scenes", 2, FULL),
    ],
)
def test_a_closed_stream_discards_output(
    tmp_path: Path, streams: str, arguments: str, status: int, error: str
) -> None:
    """The status is the one of the command, and no message goes to another stream or file.

    A full disk gives a message and the status 2.
    """
    if "full" in streams and not Path("/dev/full").exists():
        pytest.skip("no such device")
    done = run(tmp_path, arguments, streams)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", error)
    for record in tmp_path.iterdir():
        assert json.loads(record.read_text())[0]["scene"] == "fig12"


ASCII = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONIOENCODING": ""}


def test_a_locale_without_greek_letters_shows_question_marks(tmp_path: Path) -> None:
    """Printed texts have `?` for ²; files are in UTF-8 everywhere."""
    scene = replace(rb.load_scene("fig12"), title="γ")
    (tmp_path / "greek.toml").write_bytes(rb.scene_toml(scene).encode())
    done = run(tmp_path, "validation design greek.toml", **ASCII)
    assert (done.returncode, done.stderr) == (0, "")
    assert "kg m?" in done.stdout
    assert "γ" in (tmp_path / "out" / "greek_designed.toml").read_text(encoding="utf-8")
    assert run(tmp_path, "validation scenes", **ASCII).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "platform", "facts"),
    [
        ("validation compare fig12", "", "MUJOCO_GL=osmesa"),
        ("validation video fig12", "egl", "MUJOCO_GL=osmesa PYOPENGL_PLATFORM=egl"),
    ],
)
def test_a_missing_opengl_library_is_reported_in_one_line(
    tmp_path: Path, arguments: str, platform: str, facts: str
) -> None:
    """Without the OSMesa library, importing MuJoCo raises PyOpenGL's AttributeError.

    If two backends are named, MuJoCo uses neither, and only commands that draw fail.
    """
    (tmp_path / "OpenGL").mkdir()
    (tmp_path / "OpenGL" / "__init__.py").write_text("raise AttributeError('glGetError')")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    names = {"MUJOCO_GL": "osmesa", "PYOPENGL_PLATFORM": platform, "PYTHONPATH": path}
    done = run(tmp_path, arguments, **names)
    assert done.returncode == 2
    assert re.fullmatch("robotball: .*\n", done.stderr)
    assert unnamed(facts, done.stderr) == []


def test_an_internal_error_has_its_own_status() -> None:
    """The status is 3, with a traceback."""
    broken = "import validation.cli as cli, validation.__main__ as process\n"
    broken += "cli.parse = lambda _: 1 / 0; process.main()"
    done = subprocess.run([sys.executable, "-c", broken], **PIPES)
    assert done.returncode == 3
    assert "ZeroDivisionError" in done.stderr
