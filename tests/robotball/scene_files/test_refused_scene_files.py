"""A scene file that cannot be used is refused in one line, with its name, key and reason."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.errors import UnitWarning
from robotball.scene_files.scene_file import CATALOG, read_scene
from robotball.scene_files.scene_keys import ask
from tests.imports import PROJECT
from tests.messages import naming, unnamed
from tests.robotball.scene_files.scene_texts import (
    BOB,
    FRAME,
    PENDULUM,
    SECTION,
    SHELL,
    edited,
    robot,
    scene_of,
)

ROBOT = "TOML MJCF URDF"
PATHS = {
    "fig21": "scene 'fig21' fig12",
    "zzzz": f"{len(rb.catalog())} {' '.join(rb.catalog()[:12])}",
    "": ROBOT,
    "mybot.txt": ROBOT,
    "mybot.xml": "mybot.xml ParseXML empty",
    "folder": ROBOT,
    "folder.toml": "folder.toml directory",
    "nowhere.toml": "nowhere.toml No~such~file",
    "a\nb.toml": "a~b.toml No~such~file",
    "a\0b.toml": ".toml embedded~null",
}


@pytest.mark.parametrize("path", PATHS)
def test_a_path_without_a_scene_is_refused_in_one_line(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An unknown name gets a suggestion; an existing file is not called missing."""
    monkeypatch.chdir(tmp_path)
    Path("mybot.xml").touch()
    Path("mybot.txt").touch()
    Path("folder").mkdir()
    Path("folder.toml").mkdir()
    with pytest.raises(rb.InputError, match=naming(PATHS[path])) as caught:
        rb.load_scene(path)
    assert "\n" not in str(caught.value)


WALL = "thickness = 0.004\n"
# Changes to the text of fig12: (old, new, facts of the refusal).
CHANGES = [
    # syntax
    ("[shell]", "[shell", "TOML"),
    ("[shell]", "title = ''\n[shell]", "TOML"),
    ("[shell]", f"a = {'9' * 5000}\n[shell]", "TOML"),
    ("[shell]", f"a = {'[' * 5000}\n[shell]", "TOML"),
    # keys
    ("duration = 10.0\n", "", "'duration' missing"),
    ("radius = 1.0\n", "", "shell 'radius' missing"),
    ("axial = 0.023, ", "", "rotor1.inertia 'axial' missing"),
    ("duration =", "duratoin =", "'duratoin' 'duration'"),
    ("radius =", "raduis =", "shell 'raduis' 'radius'"),
    ("radius =", '"rad\\nius" =', "shell"),
    ("axial = 0.023", "axail = 0.023", "rotor1.inertia 'axail' 'axial'"),
    ("mass = 0.0284", "max_torque = 1", "'max_torque' 'torque_limit'"),
    ("radius = 1.0", "max_torque = 1.0", "shell 'max_torque'"),
    ("g = 0.0,", "", "start.section 'g' missing"),
    # types
    ("duration = 10.0", "duration = '10'", "duration number text"),
    ("mass = 0.0284", "mass = {}", "rotor1.mass number table"),
    ("mass = 0.0284", "mass = true", "rotor1.mass number true"),
    ('rolling = "rubber"', 'rolling = "sliding"', "rolling 'sliding' rubber"),
    ('inertia = "thin"', 'inertia = "thick"', "shell.inertia 'thick' thin"),
    (SECTION, "attitude = [1.0, 0.0]", "attitude list 4 2"),
    # values; tests of bodies, starts and drives have the rest
    ("radius = 1.0", "radius = 0.0", "radius 0"),
    ("[0.46643401118350475,", "[inf,", "frame.inertia[0][0] 1e+50 inf"),
    ("axial = 0.023", "axial = nan", "rotor1.inertia.axial 1e+50 nan"),
    ("L = 3.6", "L = -1e51", "start.section.L 1e+50 -1e+51"),
    ("[shell]", "[shell]\naxis = [0.0, 0.0, 0.0]", "shell.axis zero"),
]
ATTITUDE, UP = "attitude = [1.0, 0.0, 0.0, 0.0]\n", "gamma = [0.0, 0.0, 1.0]\n"
STARTS = {
    "": "start section momentum",
    SECTION + "\nrest = true": "start rest section form",
    ATTITUDE: "start rest angular_velocity",
    ATTITUDE + "rest = true\nmomentum = [1.0, 0.0, 0.0]": "start attitude momentum rest form",
    ATTITUDE + UP + "rest = true": "start attitude gamma rest form",
    "gamma = [0.0, 0.0, 1.1]\nmomentum = [1.0, 0.0, 0.0]": "gamma |gamma|~=~1.1",
    UP + "alpha = [0.9, 0.0, 0.0]\nrest = true": "alpha |alpha|~=~0.9",
    "attitude = [1.0, 0.1, 0.0, 0.0]\nrest = true": "attitude |attitude|~=~1.00499",
    ATTITUDE + "angular_velocity = [0.0, 0.0, 2.5]": "angular_velocity rubber (2.2)",
}


def parts(*several: str) -> str:
    return f"part = [{', '.join(f'{{ kind = {each} }}' for each in several)}]\n"


BALL = '"sphere", mass = 1, radius = 0.1'
# In a whole robot, by the table that stands in the place of its own.
BODIES = [
    ("frame", "[frame]\n" + parts('"box", mass = 1, size = [0.3, 0.3, 0.1]'),
     "frame 0.217945~m 0.2~m"),
    ("frame", "[frame]\n" + parts('"rod", mass = 1, begin = [0, 0, -0.25], end = [0, 0, 0]', BALL),
     "frame 0.25~m 0.2~m"),
    ("frame", "[frame]\n" + parts(BALL, '"box", size = [0.1, 0.1, 0.1]'),
     "frame.part2 mass~[kg] density~[kg/m³] material"),
    ("frame", "[frame]\n" + parts('"box", size = [0.1, 0.1, 0.1], mass = 1, material = "pc"'),
     "frame.part1 mass material"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, material = "aluminum"'),
     "frame.part1 'aluminum' aluminium"),
    ("frame", "[frame]\n" + parts('"disc", radius = 0.1, material = "PC"'),
     "frame.part1 thickness mass density material"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, density = -1'),
     "frame.part1.density positive -1~kg/m³"),
    ("frame", "[frame]\n" + parts(BALL, '"box", size = [1, 0, 1], mass = 1'),
     "frame.part2.size[1] positive 0~m"),
    ("frame", "[frame]\n" + parts('"box", size = [1, 1, 1], mass = 1, attitude = [2, 0, 0, 0]'),
     "frame.part1 unit |attitude|~=~2"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, thickness = 0.2, mass = 1'),
     "frame.part1 thickness radius 0.1 0.2~m"),
    ("frame", "[frame]\n" + parts('"disc", radius = 0.1, inner_radius = 0.1, mass = 1'),
     "frame.part1 inner_radius radius 0.1~m"),
    ("frame", "[frame]\n" + parts('"disc", radius = 0.1, inner_radius = -0.1, mass = 1'),
     "frame.part1.inner_radius 0 -0.1~m"),
    ("frame", "[frame]\n" + parts('"rod", begin = [0, 0, 1], end = [0, 0, 1], mass = 1'),
     "frame.part1 rod [0.0,~0.0,~0.0]"),
    ("frame", "[frame]\n" + parts('"ring", radius = 0.1, axis = [0, 0, 0], mass = 1'),
     "frame.part1 axis [0.0,~0.0,~0.0]"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, diameter = 0.2, mass = 1'),
     "frame.part1 radius diameter"),
    ("shell", SHELL.replace("radius = 0.2\n", ""), "shell 'radius' 'diameter'"),
    ("rest", "[[rotor]]\naxis = [0, 0, 1]\n" + parts('"point", mass = 1, centre = [0, 0, -0.1]'),
     "rotor1 axis"),
    ("frame", FRAME + parts(BALL),
     "frame mass inertia part mjcf urdf"),
    ("rest", PENDULUM, "pendulum1 nothing mass inertia part mjcf"),
    ("frame", "[frame]\npart = []\n", "frame part empty"),
    ("frame", "[frame]\ninertia = [1, 1, 1]\n", "frame 'mass' missing"),
    ("frame", "", "'frame' missing shell numbers"),
    ("frame", "[numbers]\nradius = 1\nA = [1, 1, 1]\nK = [0, 0, 0]\nOmega = [0, 0, 0]\n",
     "scene bodies numbers"),
    ("shell", SHELL.replace(WALL, ""), "shell 'thickness' missing"),
    ("shell", SHELL.replace("mass = 1.0", 'inertia = "thin"').replace(WALL, ""),
     "shell 'mass' missing"),
    ("shell", SHELL.replace(WALL, "").replace("mass", "density"),
     "shell density thickness"),
    ("shell", SHELL + 'mjcf = { file = "a.xml", body = "b" }\n',
     "shell mass thickness mjcf"),
    ("shell", SHELL + 'inertia = "thin"\n', "shell thickness inertia"),
    ("shell", SHELL + "inertia = { thickness = 0.01 }\n", "shell.inertia thickness"),
    ("shell", SHELL.replace(WALL, "inertia = { axial = 1 }\n"), "shell.inertia transverse"),
    ("shell", SHELL + parts('"sphere", mass = 1, radius = 0.01, centre = [0.1, 0, 0]'),
     "shell centre 0.05~m axis"),
    ("shell", SHELL + parts('"box", mass = 1, size = [0.1, 0.1, 0.02]'),
     "shell axis 0.0004"),
    ("rest", "[[rotor]]\naxis = [0, 0, 1]\n" + parts('"box", mass = 1, size = [0.1, 0.05, 0.02]'),
     "rotor1 0.0003125 0.00104167~kg"),
    ("frame", "[frame]\nmass = 1\ninertia = [1, 1]\n", "frame.inertia three"),
    ("rest", "[pendulum]\naxis = [1, 0, 0]\n", "pendulum many"),
    ("frame", "[frame]\n" + parts('"bax", mass = 1'),
     "frame.part1.kind 'bax' point sphere box"),
    ("frame", "[frame]\n" + parts(BALL, '"sphere", mass = 1, raduis = 1'),
     "frame.part2 'raduis' 'radius'"),
    ("frame", "[frame]\n" + parts('"box", mass = 1, size = [0.1, 0.1, 0.1], axis = [1, 0, 0]'),
     "frame.part1 'axis' cylinder disc ring"),
    ("head", "gravity_direction = [1, 0, 0.5]\n",
     "gravity_direction Z 0.447214"),
    ("head", "gravity_direction = [0, 0, 0]\n", "gravity_direction zero"),
    ("head", "[friction]\nsliding = 0\n", "sliding friction 0"),
]  # fmt: skip

TABLES = {
    "late.csv": "t,rate\n5,1\n1,2\n",
    "rpm.csv": "t,rate\ns,rpm\n0,1\n5,2\n",
    "many.csv": "t,a,b\n0,1,2\n5,2,3\n",
}
# On a pendulum.
HINGES = {
    'drive = "servo"': "drive servo 'kv' N~m~s/rad",
    'drive = "position"\nangle = 0': "drive position 'kp' N~m/rad",
    'drive = "position"\nkp = 1': "drive position 'angle' rad",
    'drive = "dc_motor"\nsupply = 1\nstall_torque = 1': "drive dc_motor 'no_load_speed' rad/s",
    'drive = "dc_motor"\nsupply = 1\nstall_torque = 1\nno_load_speed = 1\ngear = 0': "motor gear 0",
    'drive = "torque"': "drive 'torque' N~m",
    'drive = "servo"\nkv = 0': "servo gain 0~N~m~s/rad",
    'drive = "servo"\nkv = 1\nkp = 1': 'kp "position" "servo"',
    "kv = 1": 'kv "servo" "prescribed"',
    "torque_limit = 1": 'torque_limit "servo" "position" "dc_motor" "prescribed"',
    'drive = "position"\nkp = 1\nangle = 1\nrate = 2': 'rate "prescribed" "servo" "position"',
    "rate = 1\ninitial_rate = 2": 'initial_rate "servo" "position" "dc_motor" "torque"',
    'drive = "servoo"': "drive 'servoo' dc_motor free position prescribed",
    'rate = { kind = "rmap", final = 1, end = 1 }': "rate.kind 'rmap' ramp sine samples",
    "rate = { final = 1, end = 1 }": "rate 'kind' ramp sine samples",
    'rate = "fast"': "rate number table list text",
    'rate = { kind = "samples", times = [0, 5] }': "samples 'values' 'file'",
    'rate = { kind = "samples", times = [0, 5], file = "x.csv" }': "samples file times values",
    'rate = { kind = "samples", file = "x.csv" }': "x.csv No~such~file",
    'rate = { kind = "samples", file = "rpm.csv" }': "rpm.csv rate rpm rad/s rad N~m",
    'rate = { kind = "samples", file = "many.csv" }': "many.csv two t a b",
    'rate = { kind = "samples", file = "late.csv" }': "late.csv times samples",
}

HUNG = PENDULUM + BOB
REFUSED = [
    *((edited(old, new), "", facts) for old, new, facts in CHANGES),
    *((edited(SECTION, start), "", facts) for start, facts in STARTS.items()),
    *((robot(**{table: text}), "", facts) for table, text, facts in BODIES),
    *((robot(rest=f"{HUNG}{keys}\n"), "pendulum1", facts) for keys, facts in HINGES.items()),
    (robot(frame=f"{FRAME}kv = 1\n"), "frame", HINGES["kv = 1"]),
    *((content, "", "TOML") for content in (b"\xff\xfe\x00", b"\0")),
]


def refusal(text: Any, folder: Path) -> str:
    """Return the message with which a scene file of this text in a folder is refused."""
    for name, table in TABLES.items():
        (folder / name).write_text(table)
    with pytest.raises(rb.InputError) as refused:
        scene_of(text, folder)
    return str(refused.value)


@pytest.mark.parametrize(("text", "body", "facts"), REFUSED, ids=[facts for *_, facts in REFUSED])
def test_an_invalid_scene_is_refused_with_key_and_reason(
    tmp_path: Path, text: str, body: str, facts: str
) -> None:
    """One line: the file, the key or the body, and the fault with its value."""
    message = refusal(text, tmp_path)
    assert unnamed(facts, message) == []
    assert message.startswith(f"{tmp_path}/mine.toml: {body}")
    assert "\n" not in message


EXAMPLE = (PROJECT / "examples" / "my_robot.toml").read_text()
SERVO = EXAMPLE[EXAMPLE.index('drive = "servo"') : EXAMPLE.index("\n\n[[frame.part]]")]
MOTOR = 'drive = "dc_motor"\nsupply = 1\nstall_torque = 1\nno_load_speed = 17'
# A text in the example robot, the same text with a number in another unit, and the question.
ASKED = [
    ("radius = 0.15\n", "radius = 150\n", "shell.radius 1.5 150~cm or 0.15 150~mm"),
    ("0.06, 0.04]", "60, 40]", "size[1] 60~m 0.6 60~cm or 0.06 60~mm frame.part2.size[2]"),
    ("density = 1200", "density = 1.2", "density 1.2~kg/m³ 1200 1.2~g/cm³"),
    ("mass = 0.9", "mass = 5000", "frame.part2.mass 5000~kg 5 5000~g"),
    ("amplitude = 0.3", "amplitude = 30", "angle.amplitude 30~rad 0.5236 30~°"),
    ("final = -6.0", "final = -6000", "frame.rate.final -6000~rad/s -628.3"),
    ("duration = 10.0", "duration = 10.0\ngravity = 9810", "gravity 9.81 9810~mm/s²"),
    (SERVO, MOTOR.replace("supply = 1", "supply = 12"), "frame.supply 12 0.12 12~%"),
    ("mass = 0.35", "mass = 900", "frame.part1.mass 900~kg 0.9 900~g"),
    ("torque_limit = 1.2", "torque_limit = 21", "frame.torque_limit 21~N~m 2.059"),
    (
        SERVO,
        MOTOR.replace("torque = 1", "torque = 21"),
        "stall_torque 21~N~m 2.059 21~kg~cm or 0.021 21~mN~m",
    ),
    (
        SERVO,
        MOTOR.replace("torque = 1", "torque = 60\ngear = 5"),
        "stall_torque 60~N~m 5.884 60~kg~cm or 0.06 60~mN~m",
    ),
    (SERVO, MOTOR.replace("17", "168"), "no_load_speed 168~rad/s 17.59 168~rpm"),
    (
        "axis = [1, 0, 0]",
        "axis = [1, 0, 0]\ninitial_angle = 30",
        "initial_angle 30~rad 0.5236",
    ),
    (
        "[start]",
        "[friction]\nrolling = 2\n\n[start]",
        "friction.rolling 2~m 0.02 2~cm or 0.002 2~mm",
    ),
    ("velocity = [0, 0, 0]", "velocity = [0, 360, 0]", "360~rad/s 37.7 360~rpm"),
    (
        SERVO,
        f"{MOTOR}\nrotor_inertia = 12",
        "frame.rotor_inertia 12~kg~m² 1.2e-06 12~g~cm²",
    ),
]


@pytest.mark.parametrize(("text", "typed", "facts"), ASKED)
def test_a_number_that_seems_to_be_in_another_unit_raises_a_question(
    text: str, typed: str, facts: str, tmp_path: Path
) -> None:
    """In one line, with the key and the value in the expected unit."""
    scene = rb.load_scene(PROJECT / "examples" / "my_robot.toml")
    (tmp_path / "mine.toml").write_text(edited(text, typed, EXAMPLE))
    with pytest.warns(UnitWarning) as caught:
        ask(tmp_path / "mine.toml", scene)
    (question,) = caught
    assert unnamed(facts, str(question.message)) == []


def test_plausible_numbers_raise_no_question(recwarn: pytest.WarningsRecorder) -> None:
    """For all catalog scenes and the example."""
    for path in (PROJECT / "examples" / "my_robot.toml", *CATALOG.glob("*.toml")):
        ask(path, rb.load_scene(path))
    assert [str(w.message) for w in recwarn if w.category is UnitWarning] == []


# Scenes with many kinds of tables, without their sources.
NAMES = ("fig12", "steered_pendulum_robot", "inclined_plane", "swinging_frame")
BARE = [
    re.sub(r'source = """[^"]*"""', "", text)
    for text in (
        *((CATALOG / f"{name}.toml").read_text() for name in NAMES),
        rb.scene_toml(rb.load_scene("steered_pendulum_robot")),
    )
]


VALUES = (
    *("1.0", "0.25", "9", "0", "-1.0", "nan", "-inf", "1e308", "1e-308", "true", "1979-05-27"),
    *("'x'", '"thin"', "[]", "[1.0, 2, 3]", "[nan, 0.0, 1.0]", "[[1.0]]"),
    *("{}", "{ axial = 1.0, transverse = 1.0 }", "1e50", "-1e-50", '"box"', '"free"', '"torque"'),
    *("[1.0, 1.0, 1.0]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", '{ kind = "sine" }'),
    *('{ kind = "ramp", final = 1e50, end = 1e-50 }', "[1, 2]", '[{ kind = "point", mass = 1 }]'),
    *('{ kind = "samples", times = [0, 1e9], values = [1e50, -1e50] }',),
)


@st.composite
def mutated_scenes(draw: st.DrawFn) -> bytes:
    """A catalog scene with one to three lines dropped, doubled, renamed, retyped or scrambled."""
    lines = [line for line in draw(st.sampled_from(BARE)).splitlines() if line]
    for _ in range(draw(st.integers(1, 3))):
        i = draw(st.integers(0, len(lines) - 1))
        key, equals, _ = lines[i].partition(" = ")
        match draw(st.sampled_from(["drop", "double", "rename", "retype", "scramble"])):
            case "drop":
                del lines[i]
            case "double":
                lines.insert(i, lines[i])
            case "rename":
                lines[i] = draw(st.text(max_size=8)) + lines[i][1:]
            case "retype" if equals:
                lines[i] = f"{key} = {draw(st.sampled_from(VALUES))}"
            case _:
                lines[i] = draw(st.text(max_size=12))
    return "\n".join(lines).encode("utf-8", errors="surrogatepass")


@pytest.mark.filterwarnings("error")
@settings(max_examples=100)
@given(content=mutated_scenes() | st.binary(max_size=40))
def test_any_file_is_a_scene_or_one_line(content: bytes) -> None:
    """Whatever a file holds, it loads or gives one InputError: no traceback, no warning."""
    try:
        scene = read_scene(Path("any.toml"), content)
        assert np.all(np.isfinite(scene.angular_velocity_at(scene.start)))
    except rb.InputError as error:
        assert re.fullmatch(r"any\.toml: [^\n]+", str(error))  # noqa: PT017
