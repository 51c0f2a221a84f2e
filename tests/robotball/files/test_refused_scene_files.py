"""A scene file that cannot be used is refused in one line, with its name, key and reason."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.errors import UnitWarning
from robotball.files.scene_file import CATALOG, read_scene
from robotball.files.scene_keys import ask
from tests.imports import PROJECT
from tests.robotball.files.scene_texts import (
    BOB,
    FRAME,
    PENDULUM,
    SECTION,
    SHELL,
    edited,
    robot,
    scene_of,
)

ROBOT = "a scene is a TOML file, and a robot as it is an MJCF or URDF file, with a name that"
PATHS = {
    "fig21": "no scene is called 'fig21'; did you mean .*fig12",
    "zzzz": f"there are {len(rb.catalog())}, as {', '.join(rb.catalog()[:12])}",
    "": ROBOT,
    "mybot.txt": ROBOT,
    "mybot.xml": "mybot.xml: ParseXML: empty file",
    "folder": ROBOT,
    "folder.toml": "folder.toml: Is a directory",
    "nowhere.toml": "nowhere.toml: No such file",
    "a\nb.toml": "a b.toml: No such file",
    "a\0b.toml": ".toml: .*embedded null",
}


@pytest.mark.parametrize("path", PATHS)
def test_a_path_to_no_scene_is_a_line(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that is unknown is answered by the nearest; what is there is not called missing."""
    monkeypatch.chdir(tmp_path)
    Path("mybot.xml").touch()
    Path("mybot.txt").touch()
    Path("folder").mkdir()
    Path("folder.toml").mkdir()
    with pytest.raises(rb.InputError, match=PATHS[path]) as caught:
        rb.load_scene(path)
    assert "\n" not in str(caught.value)


WALL = "thickness = 0.004\n"
FINITE = "must be finite and at most 1e+50 in size, not"
# In fig12, by what stands there.
CHANGES = [
    # syntax
    ("[shell]", "[shell", "not TOML: "),
    ("[shell]", "title = ''\n[shell]", "not TOML: "),
    ("[shell]", f"a = {'9' * 5000}\n[shell]", "not TOML: "),
    ("[shell]", f"a = {'[' * 5000}\n[shell]", "not TOML: "),
    # keys
    ("duration = 10.0\n", "", "key 'duration' is missing"),
    ("radius = 1.0\n", "", "shell: key 'radius' is missing"),
    ("axial = 0.023, ", "", "inertia: key 'axial' is missing"),
    ("duration =", "duratoin =", "unknown key 'duratoin'; did you mean 'duration'?"),
    ("radius =", "raduis =", "shell: unknown key 'raduis'; did you mean 'radius'?"),
    ("radius =", '"rad\\nius" =', "shell: "),
    ("axial = 0.023", "axail = 0.023", "rotor1.inertia: unknown key 'axail'; did you mean"),
    ("mass = 0.0284", "max_torque = 1", "key 'max_torque'; did you mean 'torque_limit'?"),
    ("radius = 1.0", "max_torque = 1.0", "shell: unknown key 'max_torque'"),
    ("g = 0.0,", "", "start.section: key 'g' is missing"),
    # types
    ("duration = 10.0", "duration = '10'", "duration: it must be a number, not text"),
    ("mass = 0.0284", "mass = {}", "rotor1.mass: it must be a number, not a table"),
    ("mass = 0.0284", "mass = true", "rotor1.mass: it must be a number, not true or false"),
    ('rolling = "rubber"', 'rolling = "sliding"', "rolling: unknown value 'sliding'; it takes"),
    ('inertia = "thin"', 'inertia = "thick"', "shell.inertia: unknown value 'thick'; it takes"),
    (SECTION, "attitude = [1.0, 0.0]", "attitude: it must be a list of 4, not 2"),
    # values, of which the tests of bodies, starts and drives have the rest
    ("radius = 1.0", "radius = 0.0", "the shell's radius must be positive and finite, not 0"),
    ("[0.46643401118350475,", "[inf,", f"mine.toml: frame.inertia[0][0] {FINITE} inf"),
    ("axial = 0.023", "axial = nan", f"mine.toml: rotor1.inertia.axial {FINITE} nan"),
    ("L = 3.6", "L = -1e51", f"mine.toml: start.section.L {FINITE} -1e+51"),
    ("[shell]", "[shell]\naxis = [0.0, 0.0, 0.0]", "shell.axis must have a length"),
]
ATTITUDE, UP = "attitude = [1.0, 0.0, 0.0, 0.0]\n", "gamma = [0.0, 0.0, 1.0]\n"
STARTS = {
    "": "start gives nothing; it takes one form: section, or gamma and momentum, or",
    SECTION + "\nrest = true": "start gives rest, section; it takes one form",
    ATTITUDE: "and rest (M = 0; a ball that stands still has angular_velocity = [0, 0, 0])",
    ATTITUDE + "rest = true\nmomentum = [1.0, 0.0, 0.0]":
        "start gives attitude, momentum, rest; it takes one form",
    ATTITUDE + UP + "rest = true": "start gives attitude, gamma, rest; it takes one form",
    "gamma = [0.0, 0.0, 1.1]\nmomentum = [1.0, 0.0, 0.0]":
        "gamma is not of unit length: |gamma| = 1.1",
    UP + "alpha = [0.9, 0.0, 0.0]\nrest = true": "alpha is not of unit length: |alpha| = 0.9",
    "attitude = [1.0, 0.1, 0.0, 0.0]\nrest = true":
        "attitude is not of unit length: |attitude| = 1.00499",
    ATTITUDE + "angular_velocity = [0.0, 0.0, 2.5]":
        "angular_velocity spins the shell on the spot",
}  # fmt: skip


def parts(*several: str) -> str:
    return f"part = [{', '.join(f'{{ kind = {each} }}' for each in several)}]\n"


BALL = '"sphere", mass = 1, radius = 0.1'
# In a whole robot, by the table that stands in the place of its own.
BODIES = [
    ("frame", "[frame]\n" + parts('"box", mass = 1, size = [0.3, 0.3, 0.1]'),
     "frame reaches 0.217945 m from the sphere's centre, beyond the shell's radius 0.2 m"),
    ("frame", "[frame]\n" + parts('"rod", mass = 1, begin = [0, 0, -0.25], end = [0, 0, 0]', BALL),
     "frame reaches 0.25 m"),
    ("frame", "[frame]\n" + parts(BALL, '"box", size = [0.1, 0.1, 0.1]'),
     "frame.part2: a box needs a mass [kg], a density [kg/m³] or a material"),
    ("frame", "[frame]\n" + parts('"box", size = [0.1, 0.1, 0.1], mass = 1, material = "pc"'),
     "frame.part1: a box takes a mass, a density or a material, not mass and material"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, material = "aluminum"'),
     "frame.part1: no material is called 'aluminum'; did you mean aluminium?"),
    ("frame", "[frame]\n" + parts('"disc", radius = 0.1, material = "PC"'),
     "frame.part1: a disc of no thickness takes a mass, not a density or a material"),
    ("frame", "[frame]\n" + parts('"sphere", radius = 0.1, diameter = 0.2, mass = 1'),
     "frame.part1: it takes a radius or a diameter, not both"),
    ("shell", SHELL.replace("radius = 0.2\n", ""), "shell: key 'radius' is missing, or 'diameter'"),
    ("rest", "[[rotor]]\naxis = [0, 0, 1]\n" + parts('"point", mass = 1, centre = [0, 0, -0.1]'),
     "rotor1's parts lie on its axis, and so do not resist turning"),
    ("frame", FRAME + parts(BALL),
     "frame gives mass, inertia and part; it takes mass and inertia, or part, or mjcf, or urdf"),
    ("rest", PENDULUM, "pendulum1 gives nothing; it takes mass and inertia, or part, or mjcf"),
    ("frame", "[frame]\npart = []\n", "frame.part is empty"),
    ("frame", "[frame]\ninertia = [1, 1, 1]\n", "frame: key 'mass' is missing"),
    ("frame", "", "key 'frame' is missing; a scene takes shell and frame, or numbers"),
    ("frame", "[numbers]\nradius = 1\nA = [1, 1, 1]\nK = [0, 0, 0]\nOmega = [0, 0, 0]\n",
     "a scene takes bodies or numbers, not both"),
    ("shell", SHELL.replace(WALL, ""), "shell: key 'thickness' is missing"),
    ("shell", SHELL.replace("mass = 1.0", 'inertia = "thin"').replace(WALL, ""),
     "shell: key 'mass' is missing"),
    ("shell", SHELL.replace(WALL, "").replace("mass", "density"),
     "shell: a density needs the wall's thickness [m] as well"),
    ("shell", SHELL + 'mjcf = { file = "a.xml", body = "b" }\n',
     "shell gives mass, thickness and mjcf; it takes"),
    ("shell", SHELL + 'inertia = "thin"\n', "shell takes thickness or inertia, not both"),
    ("shell", SHELL + "inertia = { thickness = 0.01 }\n", "shell.inertia takes a thickness alone"),
    ("shell", SHELL.replace(WALL, "inertia = { axial = 1 }\n"),
     'shell.inertia takes "thin", or thickness, or axial and transverse'),
    ("shell", SHELL + parts('"sphere", mass = 1, radius = 0.01, centre = [0.1, 0, 0]'),
     "shell's centre of mass is 0.05 m off its axis; what is not symmetric about the axis"),
    ("shell", SHELL + parts('"box", mass = 1, size = [0.1, 0.1, 0.02]'),
     "shell is not symmetric about its axis: its inertia is off by 0.0004 of 0.0"),
    ("rest", "[[rotor]]\naxis = [0, 0, 1]\n" + parts('"box", mass = 1, size = [0.1, 0.05, 0.02]'),
     "rotor1 is not symmetric about its axis: its inertia is off by 0.0003125 of 0.00104167 kg"),
    ("frame", "[frame]\nmass = 1\ninertia = [1, 1]\n", "frame.inertia takes three moments"),
    ("rest", "[pendulum]\naxis = [1, 0, 0]\n", "pendulum: a scene may have many"),
    ("frame", "[frame]\n" + parts('"bax", mass = 1'),
     "frame.part1.kind: unknown value 'bax'; it takes point, sphere, box"),
    ("frame", "[frame]\n" + parts(BALL, '"sphere", mass = 1, raduis = 1'),
     "frame.part2: unknown key 'raduis'; did you mean 'radius'?"),
    ("frame", "[frame]\n" + parts('"box", mass = 1, size = [0.1, 0.1, 0.1], axis = [1, 0, 0]'),
     "frame.part1: key 'axis' is of the kinds cylinder, disc, ring alone"),
    ("head", "gravity_direction = [1, 0, 0.5]\n",
     "gravity_direction must press the ball on the plane: its Z is 0.447214, and must be"),
    ("head", "gravity_direction = [0, 0, 0]\n", "gravity_direction must have a length"),
    ("head", "[friction]\nsliding = 0\n", "the sliding friction must be positive"),
]  # fmt: skip

TABLES = {
    "late.csv": "t,rate\n5,1\n1,2\n",
    "rpm.csv": "t,rate\ns,rpm\n0,1\n5,2\n",
    "many.csv": "t,a,b\n0,1,2\n5,2,3\n",
}
# On a pendulum.
HINGES = {
    'drive = "servo"': 'drive = "servo" needs the key \'kv\' [N m s/rad]',
    'drive = "position"\nangle = 0': 'drive = "position" needs the key \'kp\' [N m/rad]',
    'drive = "position"\nkp = 1': 'drive = "position" needs the key \'angle\' [rad]',
    'drive = "dc_motor"\nsupply = 1\nstall_torque = 1':
        'drive = "dc_motor" needs the key \'no_load_speed\' [rad/s]',
    'drive = "dc_motor"\nsupply = 1\nstall_torque = 1\nno_load_speed = 1\ngear = 0':
        "a motor's gear must be positive and finite, not 0",
    'drive = "torque"': 'drive = "torque" needs the key \'torque\' [N m]',
    'drive = "servo"\nkv = 0': "a servo's gain must be positive and finite, not 0 N m s/rad",
    'drive = "servo"\nkv = 1\nkp = 1': 'kp belongs to drive = "position", not to "servo"',
    "kv = 1": 'kv belongs to drive = "servo", not to "prescribed"',
    "torque_limit = 1":
        'torque_limit belongs to drive = "servo" or "position" or "dc_motor", not to "prescribed"',
    'drive = "position"\nkp = 1\nangle = 1\nrate = 2':
        'rate belongs to drive = "prescribed" or "servo", not to "position"',
    "rate = 1\ninitial_rate = 2":
        'initial_rate belongs to drive = "servo" or "position" or "dc_motor" or "torque" or',
    'drive = "servoo"':
        "drive: unknown value 'servoo'; it takes dc_motor, free, position, prescribed,",
    'rate = { kind = "rmap", final = 1, end = 1 }':
        "rate.kind: unknown value 'rmap'; it takes ramp, sine, samples",
    "rate = { final = 1, end = 1 }": "rate: key 'kind' is missing; it takes ramp, sine, samples",
    'rate = "fast"': "rate: it must be a number or a table or a list, not text",
    'rate = { kind = "samples", times = [0, 5] }':
        "samples: key 'values' is missing, or 'file' instead",
    'rate = { kind = "samples", times = [0, 5], file = "x.csv" }':
        "samples take a file, or times and values, not both",
    'rate = { kind = "samples", file = "x.csv" }': "x.csv: No such file or directory",
    'rate = { kind = "samples", file = "rpm.csv" }':
        "rpm.csv: rate is in rpm; samples take rad/s, rad, N m",
    'rate = { kind = "samples", file = "many.csv" }':
        "many.csv: samples take two columns, time and value, not t, a, b",
    'rate = { kind = "samples", file = "late.csv" }': "late.csv: the times of samples must",
}  # fmt: skip

HUNG = PENDULUM + BOB
REFUSED = [
    *((edited(old, new), "", words) for old, new, words in CHANGES),
    *((edited(SECTION, start), "", words) for start, words in STARTS.items()),
    *((robot(**{table: text}), "", words) for table, text, words in BODIES),
    *((robot(rest=f"{HUNG}{keys}\n"), "pendulum1", words) for keys, words in HINGES.items()),
    (robot(frame=f"{FRAME}kv = 1\n"), "frame", HINGES["kv = 1"]),
    *((content, "", "not TOML: ") for content in (b"\xff\xfe\x00", b"\0")),
]


@pytest.mark.parametrize(("text", "body", "words"), REFUSED, ids=[words for *_, words in REFUSED])
def test_scene_that_cannot_be_used_is_refused_with_key_and_reason(
    tmp_path: Path, text: str, body: str, words: str
) -> None:
    """One line: the file, then the key or the body, then what is wrong and by how much."""
    for name, table in TABLES.items():
        (tmp_path / name).write_text(table)
    with pytest.raises(rb.InputError) as caught:
        scene_of(text, tmp_path)
    message = str(caught.value)
    assert words in message
    assert message.startswith(f"{tmp_path}/mine.toml: {body}")
    assert "\n" not in message


EXAMPLE = (PROJECT / "examples" / "my_robot.toml").read_text()
# In the example robot: what stands there, the same in a data sheet's unit, and the question.
ASKED = {
    "radius = 0.15\n": ("radius = 150\n", "shell.radius is 150 m; did you mean 0.15 (150 mm)?"),
    "0.06, 0.04]": ("60, 40]", "size[1] is 60 m; did you mean 0.06 (60 mm)? More such numbers: 1"),
    "density = 1200": ("density = 1.2", "density is 1.2 kg/m³; did you mean 1200 (1.2 g/cm³)?"),
    "mass = 0.9": ("mass = 5000", "frame.part2.mass is 5000 kg; did you mean 5 (5000 g)?"),
    "amplitude = 0.3": ("amplitude = 30", "angle.amplitude is 30 rad; did you mean 0.5236 (30 °)?"),
    "final = -6.0": ("final = -6000", "frame.rate.final is -6000 rad/s; did you mean -628.3 (-6"),
    "duration = 10.0": ("duration = 10.0\ngravity = 9810", "did you mean 9.81 (9810 mm/s²)?"),
    'drive = "servo"': ("supply = 12", "frame.supply is 12; did you mean 0.12 (12 %)?"),
    "mass = 0.35": ("mass = 900", "frame.part1.mass is 900 kg; did you mean 0.9 (900 g)?"),
    "torque_limit = 1.2": (
        "torque_limit = 21",
        "frame.torque_limit is 21 N m; did you mean 2.059 ",
    ),
    "armature = 0.0004": ("stall_torque = 21", "stall_torque is 21 N m; did you mean 2.059 (21 kg"),
    "kd = 0.3": ("stall_torque = 60\ngear = 5", "60 N m; did you mean 0.06 (60 mN m)?"),
    "rate = {": ("no_load_speed = 168\nrate = {", "168 rad/s; did you mean 17.59 (168 rpm)?"),
    "axis = [1, 0, 0]": ("axis = [1, 0, 0]\ninitial_angle = 30", "30 rad; did you mean 0.5236"),
    "[start]": (
        "[friction]\nrolling = 2\n\n[start]",
        "friction.rolling is 2 m; did you mean 0.002 (2 mm)?",
    ),
    "velocity = [0, 0, 0]": (
        "velocity = [0, 360, 0]",
        "is 360 rad/s; did you mean 37.7 (360 rpm)?",
    ),
    "kv = 0.4": ("rotor_inertia = 12", "inertia is 12 kg m²; did you mean 1.2e-06 (12 g cm²)"),
}


@pytest.mark.parametrize("stands", ASKED)
def test_a_number_that_seems_to_be_in_another_unit_is_asked_back(
    stands: str, tmp_path: Path
) -> None:
    """In one line, with the key and the number in the key's unit."""
    typed, words = ASKED[stands]
    scene = rb.load_scene(PROJECT / "examples" / "my_robot.toml")
    (tmp_path / "mine.toml").write_text(edited(stands, typed, EXAMPLE))
    with pytest.warns(UnitWarning) as caught:
        ask(tmp_path / "mine.toml", scene)
    (said,) = caught
    assert words in str(said.message)


def test_no_number_of_ours_is_asked_about(recwarn: pytest.WarningsRecorder) -> None:
    """Of the catalog and the example, nor a motor of the class that the data sheet's page has."""
    for path in (PROJECT / "examples" / "my_robot.toml", *CATALOG.glob("*.toml")):
        ask(path, rb.load_scene(path))
    assert [str(each.message) for each in recwarn if each.category is UnitWarning] == []


# Scenes of many kinds of tables, without the texts about them.
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
