"""Whatever a command cannot use is refused in one line that says why, and nothing is written."""

import re
import shlex
from pathlib import Path

import pytest

from tests.conftest import Robotball
from validation.cli import COMMANDS

LONG = "n" * 256
POSITIVE = "duration must be positive and finite, not"
LATER = (
    r"its drives change in time, and an? \w+ needs constant rates; "
    r"'robotball compare wobbling_drive' shows its motion"
)
AT_REST = (
    r"fig06 starts from rest, and an? \w+ needs a momentum M other than zero; "
    r"'robotball equilibria fig06' shows the motion from rest"
)
# Of every command one.
MISTYPED = {
    "--json": (
        "--jsn",
        "check judge section lyapunov attractors basins equilibria continue paper",
    ),
    "--preset": ("--presett", "compare report fit video view model steer convergence chart"),
    "--keep-going": ("--keepgoing", "compare"),
    "--no-plots": ("--no-plot", "compare"),
    "--out": ("--outt", "demo figures design ablation tradeoff extremes portraits results"),
    "--duration": ("--durration", "engines export"),
    "--bisect": ("--bisekt", "history"),
    "--help": ("--hlep", "scenes"),
}
REFUSED = {
    # names, options and their values
    "": "which command. 'robotball --help' lists them",
    "roll": "roll",
    "help compair": r"no command is called 'compair'; did you mean compare\?$",
    "--verson": r"did you mean --version\?$",
    "hlp": r"^robotball: no command is called 'hlp'; did you mean help\?$",
    "compair fig12": r"^robotball: no command is called 'compair'; did you mean compare\?$",
    "compare": "compare needs a scene",
    "check": "^robotball: check needs FILE; `robotball help check` says what it is$",
    "continue fig07 --over K3": "continue needs --of, --from, --to; `robotball help continue`",
    "model fig12 --out x.urdf": "x.urdf: a model is MJCF, in a file whose name ends in .xml",
    "compare fig112": "no scene is called 'fig112'; did you mean fig12",
    "history mujco": "no engine is called 'mujco'; did you mean mujoco",
    "history multibody": "multibody comes with robotball: it has no released versions",
    "judge fig112 a.csv": "no scene is called 'fig112'; did you mean fig12",
    "compare fig12 --preset balancd": r"no preset is called 'balancd'; did you mean balanced\?",
    "compare fig12 fast": "'fast' is a preset and no scene: write --preset fast",
    "compare fig12 --preset naive fast": (
        "^robotball: there is no place for fast: names stand together, and values of one option ha"
    ),
    "compare fig12 --preset": "^robotball: --preset needs a value$",
    "video fig12 --camera hand": (
        "^robotball: --camera is one of 'follow', 'above', 'whole', not 'hand'$"
    ),
    "section fig12 --at 1": "'--at'; there are --help, --starts, --count, --skip, --g, --preset, -",
    "convergence fig12 --workers 1": "'--workers'; there are --help, .* --without, --duration, --q",
    "compare fig12 --durration 1": "no option of compare is called '--durration'; did you mean",
    "demo --rubbish=3": "no option of demo is called '--rubbish'; there are --help, --out",
    **{
        f"{name} {mistyped}": f"no option of {name} is called '{mistyped}'; did you mean {meant}"
        for meant, (mistyped, names) in MISTYPED.items()
        for name in names.split()
    },
    "compare fig12 --duration 1 --duration 2": "--duration is given 2 times: give it once",
    "steer fig12 --preset=fast --preset naive": "--preset is given 2 times: give it once",
    **{
        f"{each} fig12 --preset fast --accuracy 1e-6": "give settings or an accuracy, not both"
        for each in ("compare", "video")
    },
    "engines fig12 --only mujoco-3.17": (
        "^robotball: MuJoCo is not installed: robotball engines --install mujoco-3.17$"
    ),
    "extremes zzzz": "no map is called 'zzzz'; there are momentum, frame",
    "portraits axail": r"^robotball: no map is called 'axail'; did you mean axial\?$",
    "results --only drifts": r"^robotball: no part is called 'drifts'; did you mean drift\?$",
    "continue fig06 --of cycle --over K4 --from 0 --to 1": "no number is called 'K4'; did you mean",
    "continue fig06 --of cycle --over K3 --from 1 --to 0": "--from 1 must be below --to 0",
    "continue fig06 --of cycle --over K3 --from 1 --to inf": "below --to inf, both of them finite",
    "continue fig06 --of line --over f --from 1 --to 2": "fig06 starts from rest: its lines are",
    "section shaken_ball --starts 3": "starts from rest, and random starts have its M²: give",
    "continue fig12 --of equilibrium --over f --from 1 --to 2": "M = 0, which has no f and c$",
    "continue fig12 --of line --over f --from 1 --to 2 --longest -3": "longest must be positive",
    "continue fig12 --of line --over f --from 1 --to 2 --preset fast": "--preset repeats cycles of",
    "continue fig06 --of cycle --over K3 --from 0.1 --to 0.2": "no cycle found over K3 from",
    "continue chaplygin_ball --of line --over K3 --from 0 --to 1": "with Omega = 0 the ball rolls",
    "continue fig06 --of cycle --over f --from 1 --to 2": "no start has c",
    "continue wobbling_drive --of cycle --over K3 --from 0 --to 1": "no number is called 'K3'",
    "continue wobbling_drive --of line --over K3 --from 0 --to 1": LATER,
    "continue beaver_ball --of cycle --over frequency --from 1 --to 2": "whole turns are in its",
    "figures 2": "no figure 2 to draw; there are 3 to 14, and tori",
    "figures ten": "no figure ten to draw",
    # numbers
    "compare fig12 --seed 1": "--seed, --cluster and --device are of random starts: give --starts",
    "compare fig12 --starts 2 --device cuda": "MuJoCo has no choice of a device: leave it out",
    "compare fig12 --starts 0": "starts must be at least 1, not 0",
    "compare fig12 --starts 2 --accuracy 1e-6": "random starts run by presets: leave out --acc",
    "compare fig12 --starts 2 --duration 0": f"{POSITIVE} 0 s",
    "compare fig12 --duration soon": "^robotball: --duration takes a number, not 'soon'$",
    "compare fig12 --starts 1.5": "^robotball: --starts takes a whole number, not '1.5'$",
    "compare fig12 --duration 0": f"{POSITIVE} 0 s",
    "compare fig12 --duration nan": f"{POSITIVE} nan s",
    "tradeoff fig12 --friction --duration 0": f"{POSITIVE} 0 s",
    "tradeoff fig06 --friction --quick": "fig06 starts from rest: there is no M for friction to ta",
    "export fig12 --duration 0": f"{POSITIVE} 0 s",
    "lyapunov fig12 --duration -1": "duration and transient must be positive",
    "basins fig12 --threads 0": "threads must be at least 1, not 0",
    "basins fig12 --starts 1": "starts must be at least 2, not 1",
    "lyapunov fig12 --starts 0": "starts must be at least 1, not 0",
    "section fig12 --count 0": "count must be at least 1, not 0",
    "judge fig12 right.csv --timestep soon": "a timestep must be a number of seconds, not 'soon'",
    "judge fig12 right.csv --timestep 0": "timestep must be positive and finite, not 0 s",
    "judge fig12 right.csv --timestep 0.1,0.2": "each file needs its timestep: 1, not 2",
    "judge fig12 right.csv --tolerance -1": "tolerance must be positive",
    "steer three_rotors --through '1,0 1'": "points are pairs like \"1,0 1,1\", not '1,0 1'",
    "chart fig14 --over Kay=0:1": "no number is called 'Kay'; there are 16, as K1, K2, K3, Omega1",
    "chart fig14 --over K=0:1,Omega": "NAME=FROM:TO, two different numbers, not 'Omega'",
    "chart fig14 --over K=2:2": "NAME=FROM:TO, two different numbers, not 'K=2:2'",
    "chart fig14 --over K=0:1,K=1:2": "takes one or two different names, not 'K=0:1,K=1:2'",
    "chart fig14 --over K=0:1,Omega=0:1 --follow": "goes along one number: give one to --over",
    "chart fig14 --over c=0:2": r"c is 0 in the rubber model, by \(3\.1\), not 2: vary f",
    "chart classical_chaotic --over f=1:8 --quick": r"no start has c = \(M, γ\) = 3 and f = M² = 8",
    "chart chaplygin_ball --over Omega=0:1": "Omega is zero and has no direction to keep",
    "chart fig14 --over K=0:1 --duration 0": f"{POSITIVE} 0 s",
    # scenes that a command is not for, each answered by a command that is
    "design fig12 --rotor-speed 0.01": r"rotor speed: at most 0\.01 rad/s is allowed",
    "section fig12 --preset naive --count 2": "MuJoCo's run is no result",
    **{f"{each} wobbling_drive": LATER for each in ("equilibria", "basins")},
    "lyapunov pendulum_robot": "what a motor moves has a state of its own",
    "section wobbling_drive --g 1": "its section is a phase of its drives, without a g",
    **{
        f"{each} fig06": AT_REST for each in ("section", "lyapunov", "basins", "chart --over K=0:1")
    },
    "basins chaplygin_ball": "does not turn .* no attractors; 'robotball section chaplygin_ball'",
    "equilibria rubber_chaplygin_ball": (
        "the ball rests at every γ; 'robotball section rubber_chaplygin_ball' shows how it rolls"
    ),
    # files to read
    **{
        f"{each} pendulum_robot --controller {given}": words
        for each in ("compare", "report", "video")
        for given, words in {
            "loop.py": "--controller takes FILE.py:NAME, not 'loop.py'",
            "none.py:stop": r"none\.py cannot be run: FileNotFoundError: .*none\.py'",
            "loop.py:stopp": r"loop\.py has no rb\.Controller that is called 'stopp'",
            "broken.py:stop": r"broken\.py cannot be run: NameError: name 'rb' is not defined",
        }.items()
    },
    "compare pendulum_robot --controller loop.py:fails": (
        r"the controller fails at t = 0 s, in loop\.py line 4: ZeroDivisionError: float div"
    ),
    "compare fig12 --controller loop.py:stop": "fig12 has no motor that a controller could command",
    "compare nowhere.toml": r"nowhere\.toml: No such file",
    f"compare {LONG}.toml": "File name too long",
    "judge fig12": "judge needs a file with a trajectory: t,x,y,qw,qx,qy,qz",
    "judge fig12 a.csv": r"a\.csv: the columns y,qw,qx,qy,qz are missing; there are t, x",
    "judge fig12 late.csv": r"late\.csv: t is 1e\+300 in row 2; it must be finite",
    "judge fig12 huge.csv --json j": r"huge\.csv: x is 1e\+300 in row 2 .*; it must be finite",
    "judge fig12 deep.csv": r"deep\.csv: it is no CSV file that can be read: maximum recursion",
    "compare far.urdf": r"far \(far\.urdf\): at the start MuJoCo has no finite accelerations",
    "report": "report needs a scene, or the JSON file of a study",
    "report a.json fig12": "one study's JSON file at a time",
    "report a.json": r"a\.json: No such file",
    "report b.json": r"b\.json is no JSON",
    "report c.json": r"c\.json is no record of a study",
    "report e.json": r"e\.json is no JSON",
    # files to write
    "compare fig12 --out /dev/null/x": "/dev/null/x cannot be made",
    "compare fig12 --json /dev/null/x/a.json": "/dev/null/x cannot be made",
    **{
        f"{each} --json /dev/null/x/a.json": "/dev/null/x cannot be made"
        for each in ("lyapunov fig12", "ablation fig12", "portraits")
    },
    "compare fig12 --json .": r"\. cannot be written: it is a folder",
    "export fig12 --to a.csv": r"a\.csv cannot be made",
    f"compare fig12 --json {LONG}": "File name too long",
    "tradeoff fig12 --quick --out t": r"t/fig12-tradeoff\.jsonl",
    "compare fig12 --json - --csv -": "standard output takes one result",
    "compare fig12 --out -": "the output folder must be a folder",
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
    ),
    "broken.py": "stop = rb.Controller(lambda _: {}, 0.1)\n",
    "b.json": "{",
    "c.json": '{"versions": 1}',
    "e.json": '{"versions": {}, "a": ' + "[" * 200_000 + "]" * 200_000 + "}",
}


def test_an_option_of_every_command_is_mistyped() -> None:
    """Once at least."""
    assert {name for _, names in MISTYPED.values() for name in names.split()} == {*COMMANDS}


@pytest.mark.parametrize(("arguments", "words"), REFUSED.items())
def test_bad_input_is_one_line_and_writes_nothing(
    robotball: Robotball, tmp_path: Path, arguments: str, words: str
) -> None:
    """Status 2 (1 says that motions do not agree), no traceback, no output and no file."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "t" / "fig12-tradeoff.jsonl").mkdir(parents=True)  # where a study has its record
    before = sorted(tmp_path.rglob("*"))
    status, out, err = robotball(*shlex.split(arguments))
    # Of progress, on a slow machine, and of what set-up has not compiled for such a processor.
    err = re.sub(r"^(\d+%: |robotball: compiling, once).*\n", "", err, flags=re.MULTILINE)
    assert (status, out) == (2, "")
    warned = "(robotball: warning: (fig06|far|far\\.urdf|Inertia matrix)\\b.*\n)*"
    assert re.fullmatch(rf"{warned}robotball: (?!warning).*\n", err)
    assert re.search(words, err, re.MULTILINE)
    assert sorted(tmp_path.rglob("*")) == before
