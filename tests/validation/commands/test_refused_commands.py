"""Whatever a command cannot use is refused in one line that says why, and nothing is written."""

import re
import shlex
from pathlib import Path

import pytest

from tests.conftest import Robotball
from tests.messages import unnamed
from tests.validation.examples import COMMANDS

LONG = "n" * 256
LATER = "constant 'robotball~compare~wobbling_drive'"
AT_REST = "fig06 M 'robotball~dynamics~equilibria~fig06'"
# Of every command one.
MISTYPED = {
    "--json": (
        "--jsn",
        "check,fit,judge,dynamics section,dynamics exponents,dynamics basins,dynamics equilibria,"
        "dynamics branches",
    ),
    "--preset": ("--presett", "compare,report,video,view,steer,study convergence"),
    "--keep-going": ("--keepgoing", "compare"),
    "--no-plots": ("--no-plot", "compare"),
    "--out": (
        "--outt",
        "demo,design,study ablation,study cones,study cost,study extremes,dynamics chart",
    ),
    "--duration": ("--durration", "engines,export"),
    "--help": ("--hlep", "scenes"),
}
EVERY = {
    f"{name} {mistyped}": f"{mistyped} {meant}"
    for meant, (mistyped, names) in MISTYPED.items()
    for name in names.split(",")
}
REFUSED = {
    # names, options and their values
    "": "robotball --help",
    "roll": "roll",
    "help compair": "'compair' compare",
    "--verson": "--version",
    "hlp": "'hlp' help",
    "compair fig12": "'compair' compare",
    "compare": "compare scene",
    "check": "check FILE --help",
    "dynamics branches fig07 --over K3=0:1": "--of --help",
    "study": "robotball~study~--help",
    "check a.xml b.xml": "check 'b.xml' --help",
    "study sweep": "'sweep' ablation cones convergence cost extremes",
    "compare fig112": "fig112 fig12",
    "judge fig112 a.csv": "fig112 fig12",
    "compare fig12 --preset balancd": "preset 'balancd' balanced",
    "compare fig12 fast": "'fast' preset --preset~fast",
    "compare fig12 --preset naive fast": "'fast' --preset~naive,fast",
    "compare fig12 --preset": "--preset value",
    "video fig12 --camera hand": ("--camera follow above whole hand"),
    "dynamics section fig12 --xyz 1": "--xyz robotball~dynamics~section~--help",
    "study convergence fig12 --workers 1": "--workers",
    "compare fig12 --durration 1": "--durration --duration",
    "demo --rubbish=3": "--rubbish robotball~demo~--help",
    "export fig12 --to a": "--to --out",
    "export fig12 --preset fst": '"fst" --preset naive fast balanced accurate efficient exact',
    "compare fig12 --json --csv a.csv": '"--csv" --json standard~output',
    **EVERY,
    "compare fig12 --duration 1 --duration 2": "--duration",
    "steer fig12 --preset=fast --preset naive": "--preset",
    **{
        f"{each} fig12 --preset fast --accuracy 1e-6": "settings accuracy"
        for each in ("compare", "video")
    },
    "engines fig12 --only mujoco-3.17": ("MuJoCo engines --install mujoco-3.17"),
    "study extremes zzzz": "map 'zzzz' momentum frame",
    "dynamics branches fig06 --of cycle --over K4=0:1": "number 'K4' K",
    "dynamics branches fig06 --of cycle --over K3=1:0": "--over FROM TO 'K3=1:0'",
    "dynamics branches fig06 --of cycle --over K3=1:inf": "--over NAME=FROM:TO 'K3=1:inf'",
    "dynamics branches fig06 --of line --over f=1:2": "fig06 rest lines",
    "dynamics section shaken_ball --starts 3": "rest starts M²",
    "dynamics branches fig12 --of equilibrium --over f=1:2": "M~=~0 f c",
    "dynamics branches fig12 --of line --over f=1:2 --longest -3": "longest -3~s",
    "dynamics branches fig06 --of cycle --over K3=0.1:0.2": "cycle K3",
    "dynamics branches chaplygin_ball --of line --over K3=0:1": "Omega~=~0",
    "dynamics branches fig06 --of cycle --over f=1:2": "state c",
    "dynamics branches wobbling_drive --of cycle --over K3=0:1": "number 'K3'",
    "dynamics branches wobbling_drive --of line --over K3=0:1": LATER,
    "dynamics branches beaver_ball --of cycle --over frequency=1:2": "beaver_ball turns period",
    # numbers
    "compare fig12 --seed 1": "--seed --device --starts",
    "compare fig12 --starts 2 --device cuda": "MuJoCo device",
    "compare fig12 --starts 0": "starts 1 0",
    "compare fig12 --starts 2 --accuracy 1e-6": "starts presets --accuracy",
    "compare fig12 --starts 2 --duration 0": "duration 0~s",
    "compare fig12 --duration soon": "--duration number 'soon'",
    "compare fig12 --starts 1.5": "--starts whole '1.5'",
    "compare fig12 --duration 0": "duration 0~s",
    "compare fig12 --duration nan": "duration nan~s",
    "study cost fig12 --duration 0": "duration 0~s",
    "export fig12 --duration 0": "duration 0~s",
    "dynamics exponents fig12 --duration -1": "duration transient positive",
    "dynamics basins fig12 --threads 0": "threads 1 0",
    "dynamics basins fig12 --starts 1": "starts 2 1",
    "dynamics exponents fig12 --starts 0": "starts 1 0",
    "dynamics section fig12 --count 0": "count 1 0",
    "judge fig12 right.csv --tolerance -1": "tolerance -1",
    "steer three_rotors --through '1,0 1'": "'1,0~1'",
    "dynamics chart fig14 --over Kay=0:1": "'Kay' 16 K1 K2 K3 Omega1",
    "dynamics chart fig14 --over K=0:1,Omega": "NAME=FROM:TO 'Omega'",
    "dynamics chart fig14 --over K=2:2": "NAME=FROM:TO 'K=2:2'",
    "dynamics chart fig14 --over K=0:1,K=1:2": "two 'K=0:1,K=1:2'",
    "dynamics chart fig14 --over c=0:2,K=0:1": "c~must~be~0 (3.1) 2 f",
    "dynamics chart classical_chaotic --over f=1:8,K=1:2 --quick": "(M,~γ) 3 M² 8",
    "dynamics chart chaplygin_ball --over Omega=0:1,K=0:1": "Omega~=~0",
    "dynamics chart fig14 --over K=0:1,Omega=0:1 --duration 0": "duration 0~s",
    "section fig12": "'section' 'robotball~dynamics~section'",
    # scenes that a command is not for, each answered by a command that is
    "design fig12 --rotor-speed 0.01": "rotor 0.01~rad/s",
    "dynamics section fig12 --preset naive --count 2": "MuJoCo t~=~0.001…~s",
    **{f"{each} wobbling_drive": LATER for each in ("dynamics equilibria", "dynamics basins")},
    "dynamics exponents pendulum_robot": "motors states",
    "dynamics section wobbling_drive --g 1": "section phase g",
    **{
        f"{each} fig06": AT_REST
        for each in (
            "dynamics section",
            "dynamics exponents",
            "dynamics basins",
            "dynamics chart --over K=0:1",
        )
    },
    "dynamics basins chaplygin_ball": "turn 'robotball~dynamics~section~chaplygin_ball'",
    "dynamics equilibria rubber_chaplygin_ball": (
        "rest 'robotball~dynamics~section~rubber_chaplygin_ball'"
    ),
    # files to read
    **{
        f"{each} pendulum_robot --controller {given}": facts
        for each in ("compare", "report", "video")
        for given, facts in {
            "loop.py": "--controller FILE.py:NAME 'loop.py'",
            "none.py:stop": "none.py FileNotFoundError",
            "loop.py:stopp": "loop.py rb.Controller 'stopp'",
            "broken.py:stop": "broken.py line~1: NameError 'rb'",
            "leaving.py:stop": "leaving.py line~1: SystemExit",
        }.items()
    },
    "compare pendulum_robot --controller loop.py:fails": ("0~s loop.py line~4 ZeroDivisionError"),
    "compare pendulum_robot --controller loop.py:leaves": "0~s loop.py line~6 SystemExit 0",
    "compare fig12 --controller loop.py:stop": "fig12 motor",
    "compare nowhere.toml": "nowhere.toml No~such~file",
    f"compare {LONG}.toml": "File~name~too~long",
    "judge fig12": "judge t,x,y,qw,qx,qy,qz",
    "judge fig12 a.csv": "a.csv y t x",
    "judge fig12 late.csv": "late.csv t 1e+300 row~2",
    "judge fig12 huge.csv --json j": "huge.csv x 1e+300 row~2",
    "judge fig12 deep.csv": "deep.csv CSV recursion",
    "compare far.urdf": "far.urdf start MuJoCo",
    "report": "report scene",
    # files to write
    "compare fig12 --out /dev/null/x": "/dev/null/x",
    "compare fig12 --json /dev/null/x/a.json": "/dev/null/x",
    **{
        f"{each} --json /dev/null/x/a.json": "/dev/null/x"
        for each in ("dynamics exponents fig12", "study ablation fig12", "study extremes")
    },
    "compare fig12 --json .": ". folder",
    "export fig12 --out a.csv": "a.csv",
    f"compare fig12 --json {LONG}": "File~name~too~long",
    "study cost fig12 --quick --out t": "t/fig12-cost.jsonl",
    "compare fig12 --json - --csv -": "standard~output one",
    "compare fig12 --out=-": "--out folder",
}

# What the catalogue of messages leaves out: one message again, a slow one and the system's own.
UNLISTED = {
    *EVERY,
    "dynamics branches fig06 --of cycle --over K3=0.1:0.2",
    f"compare {LONG}.toml",
    f"compare fig12 --json {LONG}",
}


# A joint at 10⁹ m.
LINK = (
    '<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    "</inertial>"
)
FAR = (
    f'<robot name="far"><link name="base">{LINK}<collision><geometry><sphere radius="0.2"/>'
    f'</geometry></collision></link><link name="arm">{LINK}</link>'
    '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/>'
    '<axis xyz="0 1 0"/><origin xyz="1e9 0 0"/></joint></robot>'
)
FILES = {
    "a.csv": "t,x\n0,1\n",
    "right.csv": "t,x,y,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1,0,0,1,0,0,0\n",
    "late.csv": "t,x,y,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1e300,0,0,1,0,0,0\n",
    "huge.csv": "t,x,y,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1,1e300,0,1,0,0,0\n",
    "deep.csv": "# units: " + "[" * 100_000 + "\nt,x,y,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1,0,0,1,0,0,0\n",
    "far.urdf": FAR,
    "loop.py": (
        "import robotball as rb\nstop = rb.Controller(lambda _: {}, 0.1)\n"
        "def failing(reading):\n    return {'frame': 1 / reading.time}\n"
        "fails = rb.Controller(failing, 0.1)\n"
        "leaves = rb.Controller(lambda _: exit(0), 0.1)\n"
    ),
    "broken.py": "stop = rb.Controller(lambda _: {}, 0.1)\n",
    "leaving.py": "raise SystemExit\n",
}


def test_an_option_of_every_command_is_mistyped() -> None:
    """Once at least."""
    assert {name for _, names in MISTYPED.values() for name in names.split(",")} == {*COMMANDS}


def refusal(robotball: Robotball, folder: Path, arguments: str) -> str:
    """Return what a command writes to standard error when it refuses its arguments.

    Its status is 2, as 1 says that motions do not agree, and it writes nothing else.
    """
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "t" / "fig12-cost.jsonl").mkdir(parents=True, exist_ok=True)  # a study's record
    before = sorted(folder.rglob("*"))
    status, out, err = robotball(*shlex.split(arguments))
    assert (status, out) == (2, "")
    assert sorted(folder.rglob("*")) == before
    # Without progress, on a slow machine, and what set-up has not compiled for such a processor.
    return re.sub(r"^(\d+%: |robotball: compiling to).*\n", "", err, flags=re.MULTILINE)


@pytest.mark.parametrize(("arguments", "facts"), REFUSED.items())
def test_bad_input_is_one_line_and_writes_nothing(
    robotball: Robotball, tmp_path: Path, arguments: str, facts: str
) -> None:
    """Beside warnings; no traceback."""
    message = refusal(robotball, tmp_path, arguments)
    warned = "(robotball: warning: (fig06|far|far\\.urdf|Inertia matrix)\\b.*\n)*"
    assert re.fullmatch(rf"{warned}robotball: (?!warning).*\n", message)
    assert unnamed(facts, message) == []
