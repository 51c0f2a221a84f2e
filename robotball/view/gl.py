"""Find an OpenGL backend for off-screen drawing; `python -m robotball.view.gl` prints it.

A broken OpenGL can crash the process that uses it, so each candidate is tested in a child process.
"""

import functools
import importlib
import os
import platform
import subprocess
import sys
from traceback import walk_tb
from typing import Any

_PATIENCE = 60.0  # s for one candidate, several times the time needed on a busy machine
_OFF = ("disable", "disabled", "off", "false", "0")
_ANY = ("", "enable", "enabled", "on", "true", "1")
_FIX = {"Linux": "sudo apt-get install libosmesa6", "Darwin": "a session with a window server"}

# MuJoCo chooses its backend from MUJOCO_GL when it is first imported, here in the child.
_PROBE = """
import mujoco
with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8) as renderer:
    renderer.render()
"""


@functools.cache
def find_backend() -> str | None:
    """Return the name of a working off-screen backend ("egl", "osmesa", …), or None.

    If MUJOCO_GL is set, it is the only candidate. The result is cached.
    """
    return next(filter(_works, _candidates()), None)


def context(width: int, height: int, backend: str) -> Any:
    """Return a current MuJoCo GLContext for pictures up to this size [px].

    backend: from `find_backend()`, here or in another process. It may differ from the backend that
    `import mujoco` chose.
    """
    gl_context = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
    gl_context.make_current()
    return gl_context


def advice() -> str:
    """Return one line: there is no off-screen OpenGL, and how to get it."""
    chosen = os.environ.get("MUJOCO_GL")
    platform_of_pyopengl = os.environ.get("PYOPENGL_PLATFORM")
    if chosen and platform_of_pyopengl not in (None, "", chosen):
        both = f"MUJOCO_GL={chosen} and PYOPENGL_PLATFORM={platform_of_pyopengl}"
        return f"no off-screen GL with {both}; unset both, or set both to the same value"
    if chosen:
        return f"no off-screen GL with MUJOCO_GL={chosen}; unset MUJOCO_GL, or try another value"
    fix = _FIX.get(platform.system(), "an OpenGL driver")
    return f"no off-screen GL; video needs: {fix}"


def ended_import(error: Exception) -> bool:
    """Return whether MuJoCo's import raised the error while loading MUJOCO_GL's OpenGL."""
    modules = {frame.f_globals.get("__name__") for frame, _ in walk_tb(error.__traceback__)}
    return bool(os.environ.get("MUJOCO_GL")) and "mujoco" in modules


def _candidates() -> tuple[str, ...]:
    chosen = os.environ.get("MUJOCO_GL", "").lower().strip()
    if chosen in _OFF:
        return ()
    if chosen not in _ANY:
        # MuJoCo's names for a window's OpenGL on Linux and Windows; both are opened with GLFW.
        return ("glfw",) if chosen in ("glx", "wgl") else (chosen,)
    # EGL first, because it may use a GPU; OSMesa draws on the CPU.
    return {"Linux": ("egl", "osmesa"), "Darwin": ("cgl", "glfw")}.get(platform.system(), ("glfw",))


def _works(backend: str) -> bool:
    try:
        command, env = [sys.executable, "-P", "-c", _PROBE], {**os.environ, "MUJOCO_GL": backend}
        child = subprocess.run(command, env=env, capture_output=True, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return False
    return child.returncode == 0


if __name__ == "__main__":
    _backend = find_backend()
    if "--quiet" not in sys.argv:
        print(advice() if _backend is None else f"off-screen GL: {_backend}")
    sys.exit(_backend is None)
