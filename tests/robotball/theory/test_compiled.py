"""Compiled code is cached in a private folder of its user, and recompiled if it is unusable."""

import os
import resource
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core import caching

from bench import ahead
from robotball.errors import SceneWarning
from robotball.theory import compiled as kept
from robotball.theory.ensembles import steppers
from tests.messages import naming, unnamed


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache and an empty temporary folder; one-time warnings are reset."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    kept._warn_once.cache_clear()
    kept._say_once.cache_clear()
    return tmp_path / "cache" / "robotball"


def compiled(source: str = "2 x", **options: Any) -> tuple[float, int]:
    """Return the value of a compiled function at 3, and its number of cache misses."""
    double: Any = kept.compiled_from(source, "f8(f8)", **options)(lambda x: 2.0 * x)
    return double(3.0), double.code.stats.cache_misses.total()


def test_cached_code_is_loaded(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code is recompiled only if its source or an option changes.

    Each processor has a separate folder, since machines may share a home.
    """
    assert [compiled(), compiled(), compiled("x + x")] == [(6.0, 1), (6.0, 0), (6.0, 1)]
    loose: dict[str, Any] = {"fastmath": {"nsz", "contract"}}
    assert [compiled(**loose), compiled(**loose)] == [(6.0, 1), (6.0, 0)]
    assert len([*home.rglob("*.nbc")]) == 3
    monkeypatch.setattr(numba.config, "CPU_NAME", "another")
    assert kept._folder_for("2 x", {}) not in set(home.iterdir())


def test_the_first_compilation_is_announced_in_one_line(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On standard error, once per process; not for cached code, nor before the first call."""
    kept.compiled_from("never called", "f8(f8)")(lambda x: x)
    assert (*capsys.readouterr(), home.exists()) == ("", "", False)
    compiled()
    compiled("x + x")
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), unnamed("robotball compiling 10~s", err)) == ("", 1, [])
    kept._say_once.cache_clear()
    compiled()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("on_terminal", [True, False])
def test_set_up_shows_the_progress_of_compilation(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], on_terminal: bool
) -> None:
    """A counting line on a terminal; only the final count in a log."""
    monkeypatch.setattr(kept.Compiled, "code", None)
    monkeypatch.setattr(steppers, "stepper", lambda *_: None)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: on_terminal)
    ahead.compile_all()
    first = range(1, 14) if on_terminal else ()
    counts = "".join(f"robotball: compiled {done} of 14\r" for done in first)
    assert capsys.readouterr().err == counts + "robotball: compiled 14 of 14\n"


def test_a_cached_file_that_others_may_write_is_not_loaded(home: Path) -> None:
    """The function is recompiled, with a warning that names the file."""
    compiled()
    (file,) = home.rglob("*.nbc")
    file.chmod(0o666)
    with pytest.warns(SceneWarning, match=naming(str(file))):
        assert compiled() == (6.0, 1)


CUT = [("nbi", 0), ("nbc", 0), ("nbi", 40), ("nbc", 400)]


@pytest.mark.parametrize(("ending", "kept_bytes"), CUT)
def test_a_damaged_file_is_replaced(home: Path, ending: str, kept_bytes: int) -> None:
    """A truncated or overwritten index or object file is recompiled, and loaded the next time."""
    compiled()
    (file,) = home.rglob(f"*.{ending}")
    file.write_bytes(file.read_bytes()[:kept_bytes])
    assert [compiled(), compiled()] == [(6.0, 1), (6.0, 0)]
    file.write_bytes(b"garbage " * 1000)
    assert [compiled(), compiled()] == [(6.0, 1), (6.0, 0)]


def test_a_full_disk_gives_a_warning(home: Path) -> None:
    """The compiled code works, and no partial file is left in the cache."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        with pytest.warns(SceneWarning, match=naming("compiled File~too~large")):
            assert compiled()[0] == 6.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [file for file in home.rglob("*") if file.is_file()] == []


def test_code_is_never_cached_in_an_unchecked_folder(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the folder is not writable, numba would fall back to the folder of the source file."""
    monkeypatch.setattr(caching.UserProvidedCacheLocator, "from_function", lambda *_: None)
    with pytest.warns(SceneWarning, match=naming("compiled cached")):
        assert compiled()[0] == 6.0


@pytest.mark.slow
def test_processes_may_compile_the_same_code_at_once(home: Path) -> None:
    """Two processes start with an empty cache: both results are right, and the file is loadable."""
    script = home.parents[1] / "doubled.py"
    script.write_text(
        "from robotball.theory.compiled import compiled_from\n"
        "double = compiled_from('2 x', 'f8(f8)')(lambda x: 2.0 * x)\n"
        "print(double(3.0), double.code.stats.cache_misses.total())\n"
    )
    command = [sys.executable, str(script)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate()[0].split()[0] for process in both] == ["6.0"] * 2
    assert subprocess.check_output(command, text=True).split() == ["6.0", "0"]
    assert len([*home.rglob("*.nbc")]) == 1
    assert list(home.rglob("*.tmp.*")) == []


@pytest.mark.parametrize(("mode", "used"), [(None, True), (0o770, False), (0o702, False)])
def test_a_folder_that_others_may_write_is_not_used(
    home: Path, mode: int | None, used: bool
) -> None:
    """Without a home, a temporary folder with mode 700 is used.

    A folder that others may write could contain their code: nothing is cached, with one warning.
    """
    home.parent.write_text("a file instead of the cache folder")
    folder = Path(tempfile.gettempdir()) / f"robotball-{os.getuid()}"
    if mode is not None:
        folder.mkdir()
        folder.chmod(mode)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert [compiled(), compiled()] == [(6.0, 1), (6.0, 0 if used else 1)]
    assert folder.stat().st_mode & 0o777 == (0o700 if used else mode)
    assert len(caught) == (not used)
    for warning in caught:
        assert unnamed("user XDG_CACHE_HOME", str(warning.message)) == []
    assert bool(list(folder.iterdir())) == used


def test_a_folder_of_another_user_is_not_used(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither in the home nor in the temporary folder, whatever its mode."""
    home.mkdir(parents=True, mode=0o700)
    stranger = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: stranger)
    (Path(tempfile.gettempdir()) / f"robotball-{stranger}").mkdir(mode=0o700)
    with pytest.warns(SceneWarning, match=naming("user")):
        assert kept.cache_folder() is None


def test_every_loop_and_system_is_compiled_ahead() -> None:
    """The lists of `ahead` contain every compiled loop and system of the package."""
    modules = [module for name, module in sys.modules.items() if name.startswith("robotball.")]
    values = [value for module in modules for value in vars(module).values()]
    loops = {id(value) for value in values if isinstance(value, kept.Compiled)}
    systems = {id(value) for value in values if isinstance(value, steppers.System)}
    assert {id(loop) for loop in ahead._LOOPS} == loops
    assert {id(system) for system, _ in ahead._STEPS} == systems
