"""Commands: exit status, standard output and files."""

import csv
import json
import os
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.imports import PROJECT
from tests.messages import unnamed
from tests.robotball.scene_files.scene_texts import PLATE
from tests.validation.examples import COMMANDS
from validation.cli import FAMILIES, GROUPS, main
from validation.results import controlled
from validation.studies import engine_study
from validation.studies.ablation import CHOICES
from validation.studies.extreme_maps import MAPS

approx = pytest.approx

ERRORS = ["path error", "gamma error", "momentum error"]
FOCI = ["slow stable focus"] * 2 + ["stable focus"] * 2
CYCLE = "cycle of period 8.743261 s"
HOPF = "supercritical, l₁ = -0.00499 1/s, stable cycles above"
# Command line: (printed text, values of the JSON record by their paths).
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "scenes": ("fig12 rubber 10 s ", {}),
    "compare fig12 --duration 1 --keep-going --json a.json": (
        "plots: out/fig12-mujoco-balanced-1s-path.png",
        {
            "0/preset": "balanced",
            "0/timestep": 0.005,
            "0/path_error": approx(6.0e-10, rel=0.1),
            "0/verdict": "agrees",
        },
    ),
    "compare fig12 --starts 3 --duration 1 --preset fast --seed 2 --json a.json": (
        "",
        {"spread/*/error": ERRORS, "spread/*/runs": [3] * 3, "spread/*/faulty": [0] * 3},
    ),
    "engines wobbling_drive --only mujoco --quick --duration 0.2 --workers 1 --json a.json": (
        "* on the Pareto front",
        {"runs/*/label": ["MuJoCo"], "runs/*/preset": ["naive"], "failed": []},
    ),
    "engines --only mujoco --json a.json": ("accurate", {"engines/0/engine": "mujoco"}),
    "view fig12 --web --duration 0.1": ("out/fig12-mujoco-balanced-0.1s-view.html", {}),
    "dynamics section fig12 --count 40 --preset fast --json a.json": (
        "equations: 40 crossings, 20 with g growing, 20 falling MuJoCo: 40 crossings",
        {"equations/directions": [1, -1] * 20, "MuJoCo/directions": [1, -1] * 20},
    ),
    "dynamics section fig10_stable --count 20 --json a.json": (
        "only by rounding; 'robotball dynamics equilibria fig10_stable'",
        {"equations/times/0": approx(1.1370694, abs=1e-6)},
    ),
    "dynamics section classical_chaotic --starts 3 --count 20 --skip 2 --g 0.4": (
        "equations: 60 crossings",
        {},
    ),
    "dynamics exponents fig14 --starts 2 --duration 100 --transient 20 --threads 1 --json a.json": (
        "λ₆ [1/s]",
        {
            "largest": approx([0.15, 0.15], abs=0.05),
            "smallest": approx([-0.17, -0.17], abs=0.05),
            "dimension": approx(1.89, abs=0.05),
        },
    ),
    "dynamics basins fig12 --starts 8 --transient 1000 --json a.json": (
        "attractor share of the starts",
        {"reached": [CYCLE, *["torus"] * 6, CYCLE]},
    ),
    "dynamics basins fig10_stable --starts 8 --json a.json": (
        "",
        {"reached": ["straight line"] * 8},
    ),
    "dynamics equilibria fig07 --longest 70 --json a.json": (
        "period 60.0086320 s",
        {
            "fixed_points/*/kind": [*FOCI[:2], "saddle", "saddle", *FOCI[2:]],
            "limit_cycles/*/period": approx([60.0086320], abs=1e-6),
        },
    ),
    "dynamics equilibria rubber_chaplygin_gyrostat --longest 0 --json a.json": (
        "every motion from rest is closed",
        {"fixed_points/*/kind": ["centre"] * 2, "fixed_points/*/contact_speed": [0.0] * 2},
    ),
    "dynamics equilibria classical_regular --json a.json": (
        "A classical ball can roll straight on at any γ",
        {"straight_motions/*/speed": approx([1.44])},
    ),
    "dynamics equilibria chaplygin_ball": ("0, 0, 0 neutral, at rest", {}),
    "dynamics equilibria routh_sphere": ("0, 0 ± 2.722i neutral, straight line", {}),
    "dynamics equilibria fig10_stable --longest 0 --json a.json": (
        "Two straight-line motions are stable where M² < 2.08062 (kg m²/s)²",
        {
            "straight_motions/*/name": ["δ₊", "σ₊", "δ₋", "σ₋"],
            "straight_motions/*/eigenvalues/2/0": approx(
                [-2.954e-3, 0.2237, 0.2237, -2.954e-3], rel=1e-3
            ),
        },
    ),
    "dynamics branches fig07 --of equilibrium --over K3=0.4:0.6 --json a.json": (
        "γ in principal axes out/fig07-branches-equilibrium-K3.png",
        {
            "special/*/kind": ["fold", "fold"],
            "special/*/value": approx([0.5150283] * 2, abs=1e-7),
            "ends": [["the range ends"] * 2] * 8,
        },
    ),
    "dynamics branches fig07 --of cycle --over K3=2.9:3 --csv a.csv": ("branches: 1", {}),
    "dynamics branches fig10 --of line --over f=2:2.2 --json a.json": (
        "branches: 4",
        {
            "special/*/kind": ["Hopf point"] * 2,
            "special/*/value": approx([2.080624] * 2, abs=1e-6),
            "special/*/what": [HOPF] * 2,
        },
    ),
}
# Commands run below or in the tests of studies, films and the table of the demo.
ELSEWHERE = {
    *["check", "demo", "design", "export", "judge", "fit", "report", "steer", "video"],
    *(f"study {name}" for name in ("ablation", "cones", "convergence", "cost", "extremes")),
    "dynamics chart",
}


def at(record: Any, path: str) -> Any:
    """Return the value at a path of keys and indices, with `*` for every item of a list."""
    first, _, rest = path.partition("/")
    if first == "*":
        return [at(item, rest) for item in record]
    inner = record[int(first) if isinstance(record, list) else first]
    return at(inner, rest) if rest else inner


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words", "numbers"),
    [(command, *expected) for command, expected in RUNS.items()],
    ids=RUNS,
)
def test_a_command_prints_and_writes_its_result(
    robotball: Robotball,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: str,
    words: str,
    numbers: dict[str, Any],
) -> None:
    """Status 0, a line on standard output, and a JSON record with versions.

    A width of 40 columns does not truncate tables, and the output contains no box characters.
    """
    all_cells = engine_study.cells_of  # one process each
    monkeypatch.setattr(engine_study, "cells_of", lambda *args: all_cells(*args)[:1])
    monkeypatch.setenv("COLUMNS", "40")
    status, out, _ = robotball(*arguments.split())
    assert status == 0
    assert words in " ".join(out.split())
    assert not {*"…│┃┏└"} & {*out}
    if numbers:
        record = json.loads((tmp_path / "a.json").read_text())
        for file in tmp_path.glob("out/*.json"):
            assert json.loads(file.read_text()) == record
        assert {path: at(record, path) for path in numbers} == numbers
        versions = record[0]["versions"] if isinstance(record, list) else record["versions"]
        assert versions["mujoco"] == mujoco.__version__
    for picture in tmp_path.glob("out/*.png"):
        assert picture.read_bytes()[:4] == b"\x89PNG"


PAGE = """\
Fixed points and cycles of the motion from rest (M = 0); γ in principal axes.

        γ                                    eigenvalues [1/s] or multiplier
 ────────────────────────────────────────────────────────────────────────────────────────────────
  Γ₁    1, 0, 0                              0 ± 1.131i                        centre,
                                                                               circle of 0.559 m
  Γ₂    -1, 0, 0                             0 ± 1.131i                        centre,
                                                                               circle of 0.559 m
  Γ₃    0, 1, 0                              -0.5, 0.5                         saddle,
                                                                               circle of 2.062 m
  Γ₄    0, -1, 0                             -0.5, 0.5                         saddle,
                                                                               circle of 2.062 m
  Γ₅    0, 0, 1                              0 ± 0.4714i                       centre,
                                                                               circle of 4.472 m
  Γ₆    0, 0, -1                             0 ± 0.4714i                       centre,
                                                                               circle of 4.472 m
  Σ_s   ± from -0.46102, 0.88415, 0.075754   0, and 0 to -0.7181               attracts,
        to -0.15988, -0.16673, 0.97296                                         straight line
  Σ_u   ± from -0.15988, -0.16673, 0.97296   0, and 0 to 0.7181                repels,
        to 0.46102, -0.88415, -0.075754                                        straight line

The indices of the points add up to 2; the circle (Ω, γ) = 0 adds 0, which makes 2. On a \
sphere the sum must be 2.
out/fig05c-equilibria.png
"""


def test_a_table_is_printed_in_full_at_any_width(
    robotball: Robotball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The printed numbers are those of the record."""
    monkeypatch.setenv("COLUMNS", "40")
    status, out, _ = robotball("dynamics", "equilibria", "fig05c", "--json", "a.json")
    lines = [line.rstrip() for line in out.splitlines()]
    assert (status, "\n".join(lines) + "\n") == (0, PAGE)
    record = json.loads((tmp_path / "a.json").read_text())
    kinds = ["centre", "centre", "saddle", "saddle", "centre", "centre"]
    assert [point["kind"] for point in record["fixed_points"]] == kinds
    assert record["fixed_circle"]["index"] == 0
    assert f"{record['fixed_points'][0]['eigenvalues'][1][1]:.4g}i" in PAGE


def test_every_command_is_run() -> None:
    """In this file, or in another test."""
    run = {name for name in COMMANDS for line in RUNS if f"{line} ".startswith(f"{name} ")}
    assert {*COMMANDS} == run | ELSEWHERE


# compare ---------------------------------------------------------------------------------------


def test_compare_takes_controls_for_a_robot_file(robotball: Robotball, tmp_path: Path) -> None:
    """They are in the names of results; joint ranges and `robotball check` are mentioned."""
    ranged = PLATE.replace('name="axle"', 'name="axle" range="-40 40"')
    (tmp_path / "mybot.xml").write_text(ranged)
    (tmp_path / "fly.csv").write_text("t,value\n0,0\n1,20\n")
    (tmp_path / "mine.toml").write_text('robot = "mybot.xml"\nduration = 0.5\n')
    controls = ("--control", "drive=0.2", "--control", "fly=fly.csv")
    status, out, err = robotball("compare", "mybot.xml", "mine.toml", *controls, "--no-plots")
    assert status == 1  # the motion ends before the requested duration
    assert len(re.findall("no verdict.*axle", out)) == 2
    assert "mine-drive-0.2-fly-fly.csv" in out
    assert out.count("robotball check mybot.xml") == 2
    assert len(re.findall("axle.*-40 to 40 deg.* 0.1", err)) == 2


@pytest.mark.slow
def test_compare_runs_a_controller_from_a_file(robotball: Robotball, tmp_path: Path) -> None:
    """From one or many starts; its name is in the names of results, and it can be pickled."""
    text = "import robotball as rb\nhold = rb.Controller(lambda _: {'frame': -2.0}, 0.01)\n"
    (tmp_path / "loop.py").write_text(text)
    options = ("pendulum_robot", "--controller", "loop.py:hold", "--duration", "0.5")
    status, out, _ = robotball("compare", *options, "--no-plots", "--json", "a.json")
    assert (status, "path error" in out) == (0, True)
    (record,) = json.loads((tmp_path / "a.json").read_text())
    assert record["scene"] == "pendulum_robot-loop.py-hold"
    assert record["loop_growth"] > 0
    status, _, _ = robotball("compare", *options, "--starts", "2", "--json", "b.json")
    assert status == 0
    status, out, _ = robotball("report", *options)
    assert (status, "without its controller" in Path(out.split()[-1]).read_text()) == (0, True)
    scene = controlled("pendulum_robot", (), "loop.py:hold")
    sent = pickle.loads(pickle.dumps(scene))
    times = rb.sample_times(0.1)
    one, other = (rb.simulate(s, times, settings="fast").contact_point for s in (scene, sent))
    assert np.array_equal(one, other)


def test_results_can_be_reproduced_from_their_record(robotball: Robotball, tmp_path: Path) -> None:
    """The JSON has all numbers, settings and versions; a second run gives the same numbers.

    Both ways of giving several presets are equivalent. Status 1, because one run is faulty.
    """
    results, more = [], "fig12 classical_regular --duration 1 --no-plots --json a.json --csv a.csv"
    for presets in ("--preset naive --preset fast", "--preset=naive,fast,"):
        status, out, _ = robotball("compare", *presets.split(), *more.split())
        assert status == 1
        results.append(json.loads((tmp_path / "a.json").read_text()))
    assert "faulty" in out
    # Not truncated, since the output is not a terminal.
    assert re.search(r"fig12, naive: .* 0\.1 % .* t = 0\.002", out)
    rows = list(csv.DictReader((tmp_path / "a.csv").open()))
    runs = [f"{scene} {name}" for scene in more.split()[:2] for name in ("naive", "fast")]
    for table in (*results, rows):
        assert [f"{run['scene']} {run['preset']}" for run in table] == runs
        assert [float(run["path_error"]) for run in table] == [r["path_error"] for r in results[0]]
    naive, fast = results[0][:2]
    assert (fast["duration"], fast["samples"]) == (1.0, 51)
    assert fast["settings"]["timestep"] == fast["timestep"] == 0.02
    assert fast["settings"]["drive"] == {"armature": 1e14}
    assert fast["versions"]["mujoco"] == mujoco.__version__
    assert fast["needs"]["torsional_friction"] == pytest.approx(1.873, abs=1e-3)  # m
    assert len(fast["needs"]["motor_torques"]) == 2
    assert (fast["agrees"], naive["agrees"]) == (True, False)
    assert naive["settings"]["drive"]["gain"] == 1.0
    assert unnamed("hinge 0.1~%", naive["faults"][0]["cause"]) == []


def test_a_dash_writes_to_standard_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Only the result; the table goes to standard error, and no file is written."""
    monkeypatch.chdir(tmp_path)
    for option, begin in (("--json", '[\n  {\n    "scene": "fig12",'), ("--csv", "scene,rolling,")):
        with pytest.raises(SystemExit, match="0"):
            main(["compare", "fig12", "--duration", "0.1", "--no-plots", option, "-"])
        out, err = capfd.readouterr()
        assert out.startswith(begin)
        assert "agrees" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("others", [[], ["fig12", "fig13"]])
def test_a_scene_refused_by_the_equations_does_not_end_the_batch(
    robotball: Robotball, tmp_path: Path, others: list[str]
) -> None:
    """The other scenes are run and written; a line names the refused scene; status 2.

    If there are no others, no files are left.
    """
    # A fast rotating weight lifts the ball off the plane.
    lifting_off = rb.load_scene("pendulum_robot").with_hinges(motor=[None], command=[25.0])
    (tmp_path / "off.toml").write_text(rb.scene_toml(lifting_off))
    arguments = ("off.toml", *others, "--preset", "fast", "--duration", 0.2, "--no-plots")
    status, out, err = robotball("compare", *arguments, "--json", "a.json", "--out", "new/folder")
    assert status == 2
    assert unnamed("off.toml plane 0.1017…~s", err) == []
    assert err.count("\n") == 1
    assert [line.split()[0] for line in out.splitlines() if "agrees" in line] == others
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == (["a.json", "off.toml"] if others else ["off.toml"])


def test_titles_and_file_names_are_shown_literally(robotball: Robotball, tmp_path: Path) -> None:
    """Not as formulas in pictures, nor as styles in the terminal."""
    name = "x$_{$[red]"
    scene = replace(rb.load_scene("fig12"), title="$5 and $6 [/b] [red] \\")
    (tmp_path / f"{name}.toml").write_text(rb.scene_toml(scene))
    status, out, _ = robotball("compare", f"{name}.toml", "--preset", "naive", "--duration", 0.1)
    assert status == 1
    assert name in out


def test_a_run_that_fails_in_its_first_step_has_a_report_and_no_film(
    robotball: Robotball, tmp_path: Path
) -> None:
    """One line says when and why it ended."""
    fig12 = rb.load_scene("fig12")
    start = replace(fig12.start, momentum=1e5 * fig12.start.momentum)
    (tmp_path / "wild.toml").write_text(rb.scene_toml(replace(fig12, start=start)))
    options = ("wild.toml", "--preset", "fast", "--duration", 0.1)
    assert robotball("report", *options)[0] == 1
    page = (tmp_path / "out" / "wild-mujoco-fast-0.1s-report.html").read_text()
    assert "0\u00a0s." in page
    for kind, web in (("video", ()), ("view", ("--web",))):
        status, _, err = robotball(kind, *options, *web)
        assert status == 2
        assert unnamed(f"wild {kind} 0~s cone", err.splitlines()[-1]) == []


# Scenes and robots -----------------------------------------------------------------------------


def test_export_prints_a_complete_mjcf_file(robotball: Robotball) -> None:
    """The printed text compiles and has the initial attitude of the scene."""
    status, out, complaint = robotball("export", "fig12")
    model = mujoco.MjModel.from_xml_string(out)
    start = rb.load_scene("fig12").start.attitude
    assert model.key_qpos[0, 3:7].tolist() == start.tolist()
    assert (status, complaint) == (0, "")


def test_export_takes_a_friction(robotball: Robotball) -> None:
    status, out, complaint = robotball("export", "fig12", "--friction", "1,0.5")
    assert (status, complaint) == (0, "")
    assert mujoco.MjModel.from_xml_string(out).pair_friction[0, :3].tolist() == [1.0, 1.0, 0.5]


def test_export_writes_a_player_for_varying_controls(robotball: Robotball, tmp_path: Path) -> None:
    """The folder has the player and the printed model; a moving plane has no MJCF."""
    options = ("wobbling_drive", "--duration", 0.1, "--preset", "fast")
    printed, complaint = robotball("export", *options)[1:]
    assert unnamed("mujoco-play.py --out", complaint) == []
    status, out, _ = robotball("export", *options, "--out", "ball")
    assert status == 0
    names = sorted(path.name for path in (tmp_path / "ball").iterdir())
    assert [Path(line).name for line in out.split()] == names
    assert {"mujoco.xml", "mujoco-play.py", "mujoco-controls.csv", "model.urdf"} <= {*names}
    assert (tmp_path / "ball" / "mujoco.xml").read_text() == printed
    status, out, _ = robotball("export", "shaken_ball", "--duration", 0.1, "--out", "shaken")
    assert status == 0
    assert "mujoco.xml" not in out


def test_design_prints_bodies_and_writes_a_scene_that_runs(robotball: Robotball) -> None:
    """It prints masses, radii, rates and the verdict; both engines agree on the scene."""
    status, out, _ = robotball("design", "fig12", "--rotor-speed", 200)
    assert status == 0
    assert re.search(r"rotor1 .* ring of radius .* rad/s", out)
    assert "can be built" in out
    path = out.split()[-1]
    assert path == "out/fig12_designed-rotor-speed-200.toml"
    assert robotball("compare", path, "--duration", 1, "--no-plots")[0] == 0


HALF = ("three_rotors", "--path", "circle", "--size", 0.5, "--turns", 0.25, "--duration", 2)


@pytest.mark.slow
def test_a_robot_is_steered_along_an_arc(robotball: Robotball, tmp_path: Path) -> None:
    """Status 0; the written scene follows the arc under the equations, and pictures are drawn.

    A rate limit that is too low gives status 1 and a line that begins with `cannot`.
    """
    status, out, _ = robotball("steer", *HALF)
    assert status == 0
    assert unnamed("circle 0.7854~m 2~s", out) == []
    assert "MuJoCo: agrees" in out
    off = float(re.findall(r"equations: at most (\S+) m off the path", out)[0])
    assert off < 3e-5  # measured 1.2e-5, from interpolating the rates
    *_, file, path, momentum = map(Path, out.splitlines())
    assert file.name == "three_rotors_circle-size-0.5-turns-0.25-2s.toml"
    assert all((tmp_path / f).read_bytes()[:4] == b"\x89PNG" for f in (path, momentum))
    motion = rb.integrate(rb.load_scene(tmp_path / file))
    # A quarter of a circle of 0.5 m to the left of X, from rest to rest.
    assert motion.contact_point[-1] == pytest.approx([0.5, 0.5], abs=3e-5)
    radii = np.linalg.norm(motion.contact_point - [0.0, 0.5], axis=1)
    assert radii == pytest.approx(0.5, abs=3e-5)
    status, out, _ = robotball("steer", *HALF, "--rate-limit", 1)
    assert status == 1
    assert re.search(r"^cannot: .*rad/s", out, re.MULTILINE)


# judge -----------------------------------------------------------------------------------------


def test_the_reference_of_an_export_is_judged_to_agree(
    robotball: Robotball, tmp_path: Path
) -> None:
    """Status 0; the export lists all of its files."""
    status, out, _ = robotball("export", "fig12", "--out", "ball", "--duration", 1)
    assert status == 0
    names = sorted(path.name for path in (tmp_path / "ball").iterdir())
    assert [Path(line).name for line in out.split()] == names
    status, out, _ = robotball("judge", "ball/scene.toml", "ball/reference.csv", "--json", "a.json")
    assert status == 0
    assert unnamed("agrees 0.01 path momentum", out) == []
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["agrees"]
    assert record["files"][0]["path_error"] < 1e-13
    assert record["versions"]["robotball"]


def test_judge_names_a_mistake_of_convention(robotball: Robotball, tmp_path: Path) -> None:
    """Status 1; errors are shown before and after correcting the mistake."""
    path = tmp_path / "order.csv"
    rb.integrate(rb.load_scene("fig12"), np.linspace(0, 2, 101)).save(path)
    path.write_text(path.read_text().replace("t,x,y,qw,qx,qy,qz", "t,x,y,qx,qy,qz,qw"))
    status, out, _ = robotball("judge", "fig12", "order.csv", "--json", "a.json")
    assert status == 1
    assert re.search(r"WRONG: .*qx, qy, qz, qw.*w, x, y, z\n", out)
    assert "path error 0.0e+00" in out
    (judged,) = json.loads((tmp_path / "a.json").read_text())["files"]
    (mistake,) = judged["mistakes"]
    assert unnamed("qx,~qy,~qz,~qw w,~x,~y,~z", mistake["name"]) == []
    before, after = (mistake[when]["attitude"] for when in ("before", "after"))
    assert before == judged["attitude_error"] == approx(3.1, abs=0.1)
    assert after == judged["without_mistakes"]["attitude_error"] < 1e-7
    for line, name in zip(out.splitlines()[-2:], ("any change", mistake["name"]), strict=True):
        assert line.startswith(name)


# Help ------------------------------------------------------------------------------------------


def test_the_help_lists_the_commands_and_the_values_of_options(robotball: Robotball) -> None:
    """Commands are in groups, each with a sentence that begins with a verb.

    `--version` prints one line; `--completion` prints a script for the shell.
    """
    versions = rf"robotball {version('robotball')} \(.*mujoco {version('mujoco')}.*\n"
    helped, named, completed = (
        robotball(*options.split()) for options in ("--help", "--version", "--completion bash")
    )
    assert (helped[0], named[0], completed[0]) == (0, 0, 0)
    listed = {"": helped[1]} | {family: robotball(family, "--help")[1] for family in FAMILIES}
    rows = [
        (f"{family} {name}".strip(), verb)
        for family, text in listed.items()
        for name, verb in re.findall(r"^│ (\w+) +([A-Z][a-z]+) ", text, re.MULTILINE)
    ]
    assert {name for name, _ in rows} == {*COMMANDS, *FAMILIES}
    assert not {verb for _, verb in rows} & {"The", "An", "Orders"}  # not verbs
    assert all(f"─ {group} ─" in helped[1] for group in GROUPS)
    assert robotball("help") == helped
    assert robotball("help", "study", "cost") == robotball("study", "cost", "--help")
    assert re.fullmatch(versions, named[1])
    words = {word for name in COMMANDS for word in name.split()}
    assert all(word in completed[1] for word in (*words, "--preset", "--accuracy"))
    for option, values in {
        **{f"{c} --preset": rb.PRESETS for c in ("compare", "dynamics section", "export")},
        "study convergence --without": [choice.name for choice in CHOICES],
        "study extremes MAPS": MAPS,
    }.items():
        command, _, name = option.rpartition(" ")
        out = robotball(*command.split(), "--help")[1]
        assert out.count("Example: robotball") == 1
        beside = out.partition(f"│ {name} ")[2].partition("│ --")[0]
        assert all(re.search(rf"\b{value}\b", beside) for value in values), option


HELPED = """
import contextlib, sys
from tests.validation.examples import COMMANDS
from validation.cli import parse

for name in ["", "study", "dynamics", *COMMANDS]:
    with contextlib.suppress(SystemExit):
        parse([*name.split(), "--help"])
print(*sorted({"numpy", "scipy", "mujoco", "numba", "matplotlib", "msgspec"} & sys.modules.keys()))
"""


def test_help_imports_no_numerical_packages() -> None:
    """Neither for one command nor for the list of all commands."""
    *_, loaded = subprocess.check_output(
        [sys.executable, "-c", HELPED], text=True, cwd=PROJECT
    ).splitlines()
    assert loaded == ""


PLANTED = ("mujoco", "ctypes", "numpy", "json", "multiprocessing", "tempfile", "robotball", "os")
ROBOT = (
    '<mujoco><worldbody><body name="ball" pos="0 0 .15"><freejoint/>'
    '<geom type="sphere" size=".15" mass=".6"/></body></worldbody></mujoco>'
)


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize(
    "arguments",
    [
        "video r.xml --duration 0.2 --fps 10 --resolution 320x180",
        pytest.param(
            "compare fig12 --starts 2 --duration 0.2 --threads 2", marks=pytest.mark.study
        ),
    ],
)
def test_modules_in_the_current_folder_are_not_imported(tmp_path: Path, arguments: str) -> None:
    """Not by the command, nor by any Python process that it starts."""
    for name in PLANTED:
        (tmp_path / f"{name}.py").write_text(f"open('{tmp_path}/{name}-ran', 'w')\n")
    (tmp_path / "r.xml").write_text(ROBOT)
    command = [str(Path(sys.executable).with_name("robotball")), *arguments.split()]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode < 2, done.stderr
    assert list(tmp_path.glob("*-ran")) == []


def test_a_copied_scene_is_the_catalogs_and_is_never_overwritten(robotball: Robotball) -> None:
    """Its first line names the schema beside it, and the output the next command."""
    status, said, _ = robotball("scenes", "--copy", "pendulum_robot")
    assert (status, unnamed("pendulum_robot.toml robotball.schema.json compare", said)) == (0, [])
    file = Path("pendulum_robot.toml")
    kind, _, schema = file.read_text().splitlines()[0].partition(" ")
    assert kind == "#:schema"
    assert Path(schema).read_text() == (PROJECT / "docs" / "scene.schema.json").read_text()
    assert rb.load_scene(file) == rb.load_scene("pendulum_robot")
    file.write_text("mine")
    status, _, warned = robotball("scenes", "--copy", "pendulum_robot")
    assert (status, file.read_text()) == (2, "mine")
    assert unnamed("pendulum_robot.toml rename", warned) == []
    status, _, warned = robotball("scenes", "--copy", "pendulum")
    assert (status, unnamed("pendulum pendulum_robot", warned)) == (2, [])
