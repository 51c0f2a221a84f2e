"""Work for the tests of sweeps: a square, after the trouble that a cell asks for."""

import ctypes
import fcntl
import multiprocessing
import os
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from validation.sweeps import Cell, Result

WORKERS = 2


def square(cell: Cell) -> Mapping[str, Any]:
    """Return the record of a cell {x, ran, trouble, seconds}, and log the run in `ran`."""
    ran = Path(cell["ran"])
    with ran.open("a") as lines:
        lines.write(f"{cell['x']}\n")
    with ran.with_name("pids").open("a") as lines:
        lines.write(f"{os.getpid()}\n")
    match cell.get("trouble"):
        case "raises":
            raise ValueError("no\n  square")
        case "ends":
            os._exit(7)
        case "spins":
            while True:
                pass
        case "hangs":  # in compiled code that holds the interpreter lock
            held = ran.with_name("held").open("w")
            fcntl.flock(held, fcntl.LOCK_EX)
            ran.with_name("hangs").touch()
            ctypes.PyDLL(None).sleep(60)
        case "pauses":
            pause(seconds=1.5)
        case "nan":
            return {"square": float("nan")}
        case "list":
            return [1]  # type: ignore[return-value]
        case "threads":
            a = np.ones((400, 400))
            return {"sum": (a @ a).sum(), "threads": len([*Path("/proc/self/task").iterdir()])}
    time.sleep(cell.get("seconds", 0.0))
    return {"square": cell["x"] ** 2, "none": None, "parts": [cell["x"], 0.1]}


def pause(seconds: float) -> None:
    """Stop this process and the sweeping process, like Ctrl-Z, and continue them later."""
    sweeping = multiprocessing.parent_process()
    assert sweeping is not None
    assert sweeping.pid is not None
    both = (sweeping.pid, os.getpid())
    subprocess.Popen(["sh", "-c", f"sleep {seconds}; kill -CONT {both[0]} {both[1]}"])
    for process in both:
        os.kill(process, signal.SIGSTOP)


def cells_of(
    folder: Path, count: int, troubles: Mapping[int, str] | None = None, **more: Any
) -> list[dict[str, Any]]:
    """Return cells for `square`, with a trouble for some x and a log in this folder."""
    ran, by_x = str(folder / "ran"), troubles or {}
    return [{"x": x, "ran": ran, "trouble": by_x.get(x), **more} for x in range(count)]


def runs(folder: Path) -> Counter[int]:
    """Count the runs of each cell."""
    ran = folder / "ran"
    return Counter(map(int, ran.read_text().split()) if ran.exists() else [])


def failures(results: list[Result]) -> dict[int, str]:
    return {result.cell["x"]: result.failure for result in results if result.failure}


def lines_of(file: Path) -> list[str]:
    return file.read_text().splitlines()[1:] if file.exists() else []
