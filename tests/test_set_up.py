"""Set-up, continuous integration, the release and the check of commit subjects."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from docs.tutorials.notebooks import FOLDER, INSTALL, NOTEBOOKS
from tests.imports import PROJECT
from tests.messages import unnamed

OUTSIDE = re.compile(r"validation(\.\w+)*$")  # a module of the top-level package validation
SUBJECTS = PROJECT / ".ci" / "subjects"
GITHUB = PROJECT / ".github"
PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text())
VERSION = PYPROJECT["project"]["version"]


def test_pythons_from_3_11_to_3_14_are_supported() -> None:
    """The package and the Makefile state the same range."""
    (by_make,) = re.findall(r"^PYTHON_RANGE := (.*)$", (PROJECT / "Makefile").read_text(), re.M)
    assert by_make == PYPROJECT["project"]["requires-python"] == ">=3.11,<3.15"
    matrix = yaml_of(GITHUB / "workflows" / "ci.yml")["jobs"]["run"]["strategy"]["matrix"]
    assert matrix == {"system": ["ubuntu", "macos"], "python": ["3.11", "3.12", "3.13", "3.14"]}


def yaml_of(file: Path) -> Any:
    return import_module("yaml").safe_load(file.read_text(encoding="utf-8"))


def test_the_workflow_runs_the_checks_of_ci_with_the_python_of_the_matrix() -> None:
    """setup-python puts it first on the PATH. The subjects since the last tag need all commits."""
    job = yaml_of(GITHUB / "workflows" / "ci.yml")["jobs"]["run"]
    checkout, python, cache, run, check = job["steps"]
    assert checkout["with"]["fetch-depth"] == 0
    assert python["with"]["python-version"] == "${{ matrix.python }}"
    assert cache["with"]["path"] == ".cache"
    assert {*job["env"]} == {"UV_CACHE_DIR", "PIP_CACHE_DIR"}
    assert all("/.cache/" in folder for folder in job["env"].values())
    assert run["run"] == ".ci/run"
    assert check["run"].startswith(".venv/bin/python --version")


@pytest.mark.parametrize("name", ["engine_finding", "refused_model", "wrong_result"])
def test_an_issue_form_requires_the_scene_and_the_version(name: str) -> None:
    form = yaml_of(GITHUB / "ISSUE_TEMPLATE" / f"{name}.yml")
    fields = {field["id"]: field for field in form["body"]}
    assert [fields[name]["validations"]["required"] for name in ("scene", "version")] == [True] * 2
    assert "robotball --version" in fields["version"]["attributes"]["description"]
    assert {*form} == {"name", "description", "labels", "body"}


def test_the_dockerfile_runs_the_two_commands_of_the_readme() -> None:
    """Its image has git for the tests, so git's folder is copied."""
    readme = (PROJECT / "README.md").read_text(encoding="utf-8")
    file = (PROJECT / "Dockerfile").read_text(encoding="utf-8")
    commands = re.findall(r"^RUN (make.*)|^CMD (.*)", file, re.M)
    words = [run or " ".join(ast.literal_eval(cmd)) for run, cmd in commands]
    assert words == re.findall(r"^(?: {4})?(make (?:demo|test))\b", readme, re.M)
    assert ".git\n" not in (PROJECT / ".dockerignore").read_text()


def test_the_first_code_cell_of_a_tutorial_installs_robotball() -> None:
    """In a hosted notebook; `make tutorials` writes the cell below the title."""
    for name in NOTEBOOKS:
        book = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
        assert "".join(book["cells"][1]["source"]) == INSTALL.rstrip(), name


def test_labmaze_is_left_out() -> None:
    """dm-control requires it, but it has no wheel for Python 3.13, where dm-control is omitted."""
    lock = (PROJECT / "requirements.lock").read_text()
    assert re.findall(r"^labmaze.*(?=\\)", lock, re.M) == [
        "labmaze==1.0.6 ; python_full_version < '3.13' and sys_platform == 'never' "
    ]
    (line,) = (text for text in PYPROJECT["project"]["dependencies"] if "dm-control" in text)
    assert line.endswith("; python_version < '3.13'")
    assert find_spec("labmaze") is None
    assert (find_spec("dm_control") is not None) == (sys.version_info < (3, 13))


def executable(path: Path, script: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def run_ci(tmp_path: Path, *pythons: str) -> tuple[list[str], str]:
    """Return the log of each call of make in `.ci/run`, and the output of `.ci/run`.

    `make pythons` lists the given Pythons, and .venv's as the oldest. Every other call logs its
    arguments, its environment and the contents of HOME.
    """
    clone = tmp_path / "clone"
    shutil.copytree(PROJECT / ".ci", clone / ".ci")
    git_commit(clone, "Add the checks")
    listed = " ".join([*pythons, "3.11=/clone/.venv/bin/python"])
    make = executable(
        tmp_path / "make",
        f"test \"$*\" = '--silent pythons' && {{ printf '%s\\n' {listed}; exit; }}\n"
        '{ echo "make $*"; env; ls -A "$HOME"; } >> "$0.log"',
    )
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    machine = {**os.environ, "PATH": path, "HOME": str(PROJECT), "UV_CACHE_DIR": "/downloads"}
    machine.pop("PIP_CACHE_DIR", None)
    command = [clone / ".ci" / "run"]
    ran = subprocess.run(command, env=machine, check=True, capture_output=True, text=True)
    calls = re.split(r"^make ", make.with_name("make.log").read_text(), flags=re.M)[1:]
    return calls, ran.stdout + ran.stderr


def git_commit(folder: Path, subject: str) -> None:
    """Commit all files, or none, in a new repository if the folder is not one."""
    git = ["git", "-C", str(folder), "-c", "user.name=A", "-c", "user.email=a@b.c"]
    subprocess.run([*git, "init", "--quiet"], check=True)
    subprocess.run([*git, "add", "--all"], check=True)
    subprocess.run([*git, "commit", "--quiet", "--allow-empty", "-m", subject], check=True)


def check_subject(tmp_path: Path, message: str) -> str:
    """Return the faults that `.ci/subjects` prints for the file of a commit message."""
    file = tmp_path / "COMMIT_EDITMSG"
    file.write_text(message, encoding="utf-8")
    done = subprocess.run([SUBJECTS, file], capture_output=True, text=True)
    assert (done.returncode == 0) == (not done.stderr)
    return done.stderr


@pytest.mark.parametrize(
    "subject",
    ["Add a check of commit subjects", "Pass --json on", "Embed the font", "Fix " + 68 * "x"],
)
def test_an_imperative_subject_of_at_most_72_characters_is_accepted(
    tmp_path: Path, subject: str
) -> None:
    assert check_subject(tmp_path, f"# a comment\n\n{subject}\n\nThe reason is long.\n") == ""


@pytest.mark.parametrize(
    ("subject", "facts"),
    [
        ("Added a check", "'Added' Add"),
        ("Fixes a check", "'Fixes' Fix"),
        ("Removing a check", "'Removing' Remove"),
        ("What breaks off can be printed", "'What'"),
        ("add a check", "'add'"),
        ("Add a check.", "stop"),
        ("Fix " + 69 * "x", "73 72"),
        ("", "''"),
    ],
)
def test_a_subject_that_breaks_a_rule_is_named_with_the_rule(
    tmp_path: Path, subject: str, facts: str
) -> None:
    assert unnamed(facts, check_subject(tmp_path, f"{subject}\n")) == []


def test_the_commits_since_the_last_tag_are_checked(tmp_path: Path) -> None:
    """Without a tag it is the newest 20."""

    def checked() -> list[str]:
        done = subprocess.run([SUBJECTS], cwd=tmp_path, capture_output=True, text=True)
        return [line.partition(":")[0] for line in done.stderr.splitlines()]

    for subject in ("Added one", "Added two", *(f"Add {i}" for i in range(19))):
        git_commit(tmp_path, subject)
    assert checked() == ["Added two"]
    subprocess.run(["git", "-C", tmp_path, "tag", "v1"], check=True)
    assert checked() == []
    git_commit(tmp_path, "Added three")
    assert checked() == ["Added three"]


def test_continuous_integration_sees_no_variable_of_its_machine_but_PATH(tmp_path: Path) -> None:
    """It runs the README's two commands and two more, each with an empty HOME.

    The folders in which uv and pip keep downloads are passed on if they are set.
    """
    calls, output = run_ci(tmp_path, "3.13=/new/python3.13", "3.12=/old/python3.12")
    commands = [call.split("\n")[0] for call in calls]
    other = "VENV=.venv-other PYTHON=/new/python3.13 UV_COMPILE_BYTECODE=0"
    assert commands == ["demo", "test", f"demo test TESTS=core and not slow {other}", "wheel ONE=1"]
    bits = {"OPENBLAS_CORETYPE=Haswell", "NUMBA_CPU_NAME=generic"}
    for call, more in zip(calls, (set(), set(), bits, set()), strict=True):
        of_the_shell = re.compile("PWD=|OLDPWD=|SHLVL=|_=")
        variables = {line for line in call.split("\n")[1:-1] if not of_the_shell.match(line)}
        home = {line for line in variables if line.startswith("HOME=")} - {f"HOME={PROJECT}"}
        assert len(home) == 1
        path = f"PATH={tmp_path}:{os.environ['PATH']}"
        assert variables == home | more | {path, "UV_CACHE_DIR=/downloads"}
    assert len(re.findall(r"^== .*make .*: \S+s, processor time \S+s user", output, re.M)) == 4


def test_continuous_integration_reports_that_a_machine_has_only_one_python(tmp_path: Path) -> None:
    """The numeric tests run again with it, with other rounding errors."""
    calls, output = run_ci(tmp_path)
    assert calls[2].startswith("demo test TESTS=core and not slow VENV=.venv\n")
    assert "no other Python here" in output


@pytest.mark.parametrize(("tests", "types"), [(0, 0), (1, 0), (0, 1)])
def test_make_test_fails_if_tests_or_mypy_fail(tmp_path: Path, tests: int, types: int) -> None:
    """Both run, and their outputs are not mixed."""
    shutil.copy(PROJECT / "Makefile", tmp_path)
    for name in ("pyproject.toml", "requirements.lock"):
        (tmp_path / name).touch()
    (tmp_path / ".ci").symlink_to(PROJECT / ".ci")
    bin_folder = tmp_path / "environment" / "bin"
    executable(bin_folder / "pytest", f"sleep 0.2; echo 'tests: {tests} failed'; exit {tests}")
    executable(bin_folder / "mypy", f"echo 'types: {types} errors'; exit {types}")
    for name in ("python", "ruff", "uv", "chromium"):
        executable(bin_folder / name, "exit 0")
    (bin_folder.parent / ".stamp").touch()
    # The environment must not contain variables of a make that runs this test.
    machine = {"PATH": f"{bin_folder}:{os.environ['PATH']}"}
    ran = subprocess.run(
        ["make", "test", "VENV=environment"],
        cwd=tmp_path,
        env=machine,
        capture_output=True,
        text=True,
    )
    assert (ran.returncode == 0) == (tests == types == 0)
    lines = [f"tests: {tests} failed", "mypy:", f"types: {types} errors"]
    lines += [f"exit status: pytest {tests}, mypy {types}"]
    assert ran.stdout.splitlines()[-4:] == lines


def test_the_wheel_has_the_files_of_the_checkout(tmp_path: Path) -> None:
    """To the byte, all in `robotball`. validation does not name a top-level `validation`."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=PROJECT, check=True, capture_output=True)
    with ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        files = {name: wheel.read(name) for name in wheel.namelist() if ".dist-info/" not in name}
    folders = ("robotball", "validation", "mjcf")
    listed = subprocess.check_output(["git", "ls-files", *folders], cwd=PROJECT, text=True)
    checkout = {
        (name if name.startswith("robotball/") else f"robotball/{name}"): PROJECT / name
        for name in listed.splitlines()
    }
    assert files == {name: file.read_bytes() for name, file in checkout.items()}
    modules = [name for name in files if re.match(r"robotball/validation/.*\.py$", name)]
    assert len(modules) > 40
    for name in modules:
        for node in ast.walk(ast.parse(files[name])):
            names: list[object] = []
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom | ast.Constant):
                names.append(node.module if isinstance(node, ast.ImportFrom) else node.value)
            assert not [module for module in names if OUTSIDE.match(str(module))], name


def release(folder: Path, *step: str) -> tuple[int, str]:
    """Run a step of a release in a copy of the project, and return its status and output."""
    command = [sys.executable, str(folder / ".ci" / "release"), *step]
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a repository with the files that a release reads, all committed."""
    folder = tmp_path / "clone"
    shutil.copytree(PROJECT / ".ci", folder / ".ci")
    for name in ("pyproject.toml", "CITATION.cff"):
        shutil.copy(PROJECT / name, folder)
    (folder / "CHANGELOG.md").write_text(f"# Changelog\n\n## {VERSION} (unreleased)\n")
    git_commit(folder, "Add the files")
    return folder


def test_all_files_state_the_same_version() -> None:
    assert release(PROJECT, "versions") == (0, "")
    assert version("robotball") == VERSION


@pytest.mark.parametrize("file", ["CITATION.cff", "CHANGELOG.md", "pyproject.toml"])
def test_a_version_that_differs_is_named_with_its_file(clone: Path, file: str) -> None:
    text = (clone / file).read_text().replace(VERSION, "9.8.7", 1)
    (clone / file).write_text(text)
    status, output = release(clone, "versions")
    assert (status, unnamed(f"{file}~9.8.7 {VERSION}", output)) == (1, [])


def test_only_a_clean_tree_with_a_dated_changelog_is_tagged(clone: Path) -> None:
    """All that is missing is named in a line. The tag is annotated."""
    for key, value in (("name", "A"), ("email", "a@b.c")):
        subprocess.run(["git", "-C", clone, "config", f"user.{key}", value], check=True)
    tags = ["git", "-C", str(clone), "for-each-ref", "--format=%(objecttype) %(refname:short)"]
    tag = f"v{VERSION}"
    (clone / "more.txt").touch()
    status, output = release(clone, "tag")
    assert (status, unnamed("CHANGELOG.md date changes", output)) == (1, [])
    assert output.count("\n") == 1
    (clone / "more.txt").unlink()
    (clone / "CHANGELOG.md").write_text(f"## [{VERSION}] - 2030-01-02\n")
    assert "date" not in release(clone, "tag")[1]
    git_commit(clone, "Date the changelog")
    assert release(clone, "tag")[0] == 0
    assert f"tag {tag}" in subprocess.check_output(tags, text=True).splitlines()
    status, output = release(clone, "tag")
    assert (status, unnamed(f"{tag} exists", output)) == (1, [])


def test_the_contents_of_a_release_are_its_files_and_the_licences(tmp_path: Path) -> None:
    """Of the wheel, the sdist and each Python's dependencies."""
    with ZipFile(tmp_path / "a.whl", "w") as wheel:
        wheel.writestr("a/b.py", "12345")
    (tmp_path / "c.py").write_text("123")
    with tarfile.open(tmp_path / "a.tar.gz", "w:gz") as sdist:
        sdist.add(tmp_path / "c.py", "a/c.py")
    for python, lines in (("3.12", "n 2: MIT"), ("3.13", "n 2: MIT\no 1: BSD-3-Clause")):
        (tmp_path / f"licences-{python}").write_text(f"{lines}\n")
    assert release(PROJECT, "contents", str(tmp_path)) == (0, "")
    listed = " ".join((tmp_path / "CONTENTS").read_text().split())
    facts = ("5 a/b.py", "3 a/c.py", "n 2: MIT (Python 3.12, 3.13)", "o 1: BSD-3-Clause (Python")
    assert [fact for fact in facts if fact not in listed] == []
    assert f"above: {PYPROJECT['project']['license']} " in listed


def test_the_licence_of_each_installed_package_is_stated() -> None:
    """As an expression, by classifiers or in words."""
    _, output = release(PROJECT, "licences")
    rows = dict(line.split(": ", 1) for line in output.splitlines())
    numpy, mujoco = (rows[f"{name} {version(name)}"] for name in ("numpy", "mujoco"))
    assert ("BSD-3-Clause" in numpy, "Apache" in mujoco) == (True, True)
