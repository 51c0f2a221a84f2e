"""The command among others: its streams and its files' names, as a shell's user meets them."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import robotball as rb
from tests.conftest import Robotball
from validation.output import in_picture, write_rows

Run = Callable[..., "subprocess.CompletedProcess[str]"]
SHORT = ("--duration", "0.2", "--no-plots")


@pytest.fixture
def shell(tmp_path: Path) -> Run:
    """Runs the command as a process of its own in an empty folder."""

    def run(*arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [sys.executable, "-m", "validation", *arguments],
            cwd=tmp_path,
            env={**os.environ, **environment},
            capture_output=True,
            encoding="utf-8",
            errors="replace",
        )

    return run


@pytest.mark.slow
def test_a_dash_is_standard_output(shell: Run, tmp_path: Path) -> None:
    """It holds the result alone, whole; the table goes to standard error, and no file is left."""
    done = shell("compare", "fig12", *SHORT, "--json", "-")
    assert done.returncode == 0
    assert [each["scene"] for each in json.loads(done.stdout)] == ["fig12"]
    assert "agrees" in done.stderr
    done = shell("compare", "fig12", *SHORT, "--csv", "-")
    assert done.stdout.startswith("scene,rolling,")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "presets", ["--preset naive --preset fast", "--preset naive,fast", "--preset=naive,fast,"]
)
def test_every_preset_counts_and_takes_no_scene(
    presets: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Given twice or with a comma, before the scene."""
    status, _, _ = robotball("compare", *presets.split(), "fig12", *SHORT, "--json", "a.json")
    assert status == 1
    records = json.loads((tmp_path / "a.json").read_text())
    assert [each["preset"] for each in records] == ["naive", "fast"]


@pytest.mark.slow
def test_pictures_of_different_settings_have_different_names(robotball: Robotball) -> None:
    """By scene, engine, preset or accuracy, and a duration that is not the scene's own."""
    for options in ("", "--preset fast", "--preset fast,balanced", "--accuracy 1e-5"):
        assert robotball("compare", "fig12", "--duration", 0.2, *options.split())[0] == 0
    assert sorted(path.name for path in Path("out").glob("*-path.png")) == [
        f"fig12-mujoco-{settings}-0.2s-path.png"
        for settings in ("balanced", "fast", "fast-balanced", "to-1e-05")
    ]


@pytest.mark.slow
def test_scenes_of_one_name_are_told_apart(robotball: Robotball) -> None:
    """By their folders, in table, files and pictures; the same scene twice is run once."""
    for folder, of in (("a", "fig13"), ("b", "fig14"), ("far/b", "fig12")):
        path = Path(folder, "fig12.toml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(rb.scene_toml(rb.load_scene(of)))
    paths = ("a/fig12.toml", "fig12", "b/fig12.toml", "./a/fig12.toml", "far/b/fig12.toml", "fig12")
    assert robotball("compare", *paths, "--duration", 0.1, "--csv", "a.csv")[0] == 0
    names = ["a-fig12", "fig12", "b-fig12", "b-fig12-2"]
    rows = Path("a.csv").read_text().splitlines()[1:]
    assert [row.partition(",")[0] for row in rows] == names
    pictures = sorted(path.name for path in Path("out").glob("*-path.png"))
    assert pictures == sorted(f"{name}-mujoco-balanced-0.1s-path.png" for name in names)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", ["scenes", "model fig12", f"compare fig12 {' '.join(SHORT)} --json -"]
)
def test_a_reader_who_leaves_ends_nothing(tmp_path: Path, arguments: str) -> None:
    """As `| head` does: no word on standard error but the table, and the command's own status."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "validation", *arguments.split()],
        cwd=tmp_path,
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writing)
    assert done.returncode == 0
    assert "Error" not in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("closed", "arguments", "status"),
    [
        (">&-", "scenes", 0),
        (">&-", f"compare fig12 {' '.join(SHORT)} --json a.json", 0),
        ("2>&-", f"compare fig12 {' '.join(SHORT)} --json a.json", 0),
        ("<&- >&- 2>&-", f"compare fig12 {' '.join(SHORT)} --json a.json", 0),
        ("2>&-", "compare fig112", 2),
    ],
)
def test_a_stream_that_is_closed_is_as_one_to_nowhere(
    tmp_path: Path, closed: str, arguments: str, status: int
) -> None:
    """The command's own status; a message goes to no other stream, and into no file."""
    command = (sys.executable, "-m", "validation", *arguments.split())
    done = subprocess.run(
        ["sh", "-c", f'exec "$@" {closed}', "sh", *command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (status, "")
    assert "no scene is called" not in done.stdout
    for record in tmp_path.iterdir():
        assert json.loads(record.read_text())[0]["scene"] == "fig12"


NO_OPENGL = "robotball: no off-screen GL with MUJOCO_GL=osmesa; unset it, or name one that works"


@pytest.mark.slow
@pytest.mark.parametrize("arguments", ["compare fig12", "engines"])
def test_an_opengl_that_is_not_there_is_one_line(
    shell: Run, tmp_path: Path, arguments: str
) -> None:
    """MuJoCo's import ends in an AttributeError of PyOpenGL's where OSMesa's library is missing."""
    (tmp_path / "OpenGL").mkdir()
    (tmp_path / "OpenGL" / "__init__.py").write_text("raise AttributeError('glGetError')")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = shell(*arguments.split(), MUJOCO_GL="osmesa", PYOPENGL_PLATFORM="", PYTHONPATH=path)
    assert done.returncode == 2
    assert done.stderr.startswith(NO_OPENGL)
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("arguments", ["compare fig12", "engines"])
def test_two_opengls_that_are_named_are_one_line(shell: Run, arguments: str) -> None:
    """MuJoCo's and dm-control's imports end in an ImportError of their own."""
    done = shell(*arguments.split(), MUJOCO_GL="osmesa", PYOPENGL_PLATFORM="egl")
    assert done.returncode == 2
    assert "MUJOCO_GL=osmesa and PYOPENGL_PLATFORM=egl; unset both" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_name_in_a_table_is_no_formula(tmp_path: Path) -> None:
    """An apostrophe before it has a spreadsheet take it for text; numbers stay as they are."""
    names = ["=1+2", "+1", "-1", "@a", "\ta", "a=1"]
    write_rows(tmp_path / "a.csv", [{"scene": name, "error": -1.5} for name in names])
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["scene"] for row in rows] == ["'=1+2", "'+1", "'-1", "'@a", "'\ta", "a=1"]
    assert {row["error"] for row in rows} == {"-1.5"}


ODD = "$5 and $6 [/b] [red] \\"


@pytest.mark.slow
def test_a_users_text_is_shown_as_it_is(robotball: Robotball) -> None:
    """Neither a formula in a picture nor a style in the terminal: title, file's name, settings."""
    scene = replace(rb.load_scene("fig12"), title=ODD)
    name = "x$_{$[red]"
    Path(f"{name}.toml").write_text(rb.scene_toml(scene))
    naive = ("--preset", "naive", "--duration", 0.1)
    status, out, _ = robotball("compare", f"{name}.toml", *naive)
    assert status == 1
    assert name in out
    window = next(Path("out").glob("*-fault.json"))
    assert window.name == f"{name}-mujoco-naive-fault.json"
    window.write_text(window.read_text().replace("hinge rate", "hinge [/rate]"))
    status, out, _ = robotball("replay", window)
    assert status == 0
    assert f"{name}, naive: hinge [/rate]" in out


def test_a_picture_has_a_titles_dollars() -> None:
    """As text, not as a formula."""
    title = Figure().suptitle(in_picture(ODD))
    assert title._preprocess_math(title.get_text()) == (ODD, False)  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.parametrize(
    "locale",
    [
        {"PYTHONIOENCODING": "latin-1"},
        {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONIOENCODING": ""},
    ],
    ids=["Latin-1", "ASCII"],
)
def test_a_locale_without_greek_letters_shows_something_else(
    shell: Run, tmp_path: Path, locale: dict[str, str]
) -> None:
    """What is printed has `?` for γ; files are the same everywhere, in UTF-8."""
    scene = replace(rb.load_scene("fig12"), title="γ")
    (tmp_path / "greek.toml").write_bytes(rb.scene_toml(scene).encode())
    files = ("--json", "a.json", "--csv", "a.csv")
    done = shell("compare", "greek.toml", "--duration", "0.1", *files, **locale)
    assert (done.returncode, done.stderr) == (0, "")
    assert "? error" in done.stdout
    assert "γ" in shell("design", "greek.toml", **locale).stdout + (
        tmp_path / "out" / "greek_designed.toml"
    ).read_text(encoding="utf-8")
