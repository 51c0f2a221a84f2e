"""A scene file that cannot be used is refused in one line, with its name, key and reason."""

import re
from pathlib import Path

import pytest

import robotball as rb
from tests.robotball.files.scene_texts import (
    BOB,
    FIG12,
    FRAME,
    PENDULUM,
    SECTION,
    SHELL,
    Write,
    edited,
    refusal,
    robot,
    with_start,
)


def test_unknown_name_is_answered_by_the_nearest() -> None:
    """A misspelt catalog name gets its near matches, a wild one some of the catalog."""
    assert re.search("no scene is called 'fig21'; did you mean .*fig12", refusal("fig21"))
    some = ", ".join(rb.catalog()[:12])
    assert f"there are {len(rb.catalog())}, as {some}" in refusal("zzzz")


def test_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """A missing file, a directory and an empty path are one line each."""
    assert "No such file" in refusal(tmp_path / "nowhere.toml")
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    assert "Is a directory" in refusal(folder)
    refusal(tmp_path)
    refusal("")


@pytest.mark.parametrize("name", ["mybot.xml", "mybot.urdf", "folder"])
def test_what_is_there_and_no_scene_is_not_called_missing(tmp_path: Path, name: str) -> None:
    """The refusal says by which keys a scene takes a robot's file."""
    path = tmp_path / name
    path.mkdir() if name == "folder" else path.touch()
    words = refusal(path)
    assert "a scene is a TOML file" in words
    assert "write one with the key `mjcf` or `urdf`, see docs/scene.md" in words


def test_line_breaks_in_names_stay_out_of_the_message(write: Write, tmp_path: Path) -> None:
    """A key with a line break in it, or a file's name, still gives one line; so does a null."""
    assert "unknown" in refusal(write('"a\\nb" = 1\n' + FIG12))
    assert "unknown" in refusal(write(edited("radius =", '"rad\\nius" =')))
    with pytest.raises(rb.InputError, match=r"a b\.toml: No such file"):
        rb.load_scene(tmp_path / "a\nb.toml")
    with pytest.raises(rb.InputError, match=r"\.toml: .*embedded null"):
        rb.load_scene("a\0b.toml")


NOT_TOML = {
    "no key": b"= 3", "open bracket": b"[shell", "no text": b"\xff\xfe\x00", "null": b"\0",
    "doubled key": b"a = 1\na = 2", "5000 digits": b"a = " + b"9" * 5000,
    "5000 brackets": b"a = " + b"[" * 5000,
}  # fmt: skip


@pytest.mark.parametrize("content", NOT_TOML.values(), ids=NOT_TOML)
def test_text_that_is_not_toml_is_called_so(tmp_path: Path, content: bytes) -> None:
    """Broken syntax, a doubled key, bytes that are no text: 'not TOML' and the reason."""
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    assert "not TOML: " in refusal(path)


ROTOR_INERTIA = "inertia = { axial = 0.023, transverse = 0.0115 }"
ATTITUDE = "attitude = [1.0, 0.0, 0.0, 0.0]\n"
# In fig12, by what stands there.
CHANGES = [
    # keys
    ("duration = 10.0\n", "", "key 'duration' is missing"),
    ("radius = 1.0\n", "", "shell: key 'radius' is missing"),
    ("axial = 0.023, ", "", "inertia: key 'axial' is missing"),
    ("duration =", "duratoin =", "unknown key 'duratoin'; did you mean 'duration'?"),
    ("radius =", "raduis =", "shell: unknown key 'raduis'; did you mean 'radius'?"),
    ("axial = 0.023", "axail = 0.023", "rotor1.inertia: unknown key 'axail'; did you mean"),
    ("mass = 0.0284", "max_torque = 1", "key 'max_torque'; did you mean 'torque_limit'?"),
    ("mass = 0.0284", "effort = 1", "key 'effort'; did you mean 'torque_limit'?"),
    ("radius = 1.0", "max_torque = 1.0", "shell: unknown key 'max_torque'"),
    ("l = 0.6", "q = 0.6", "start.section: unknown key 'q'"),
    ("g = 0.0,", "", "start.section: key 'g' is missing"),
    # types
    ("duration = 10.0", "duration = '10'", "duration: it must be a number, not text"),
    ("mass = 0.0284", "mass = [1.0]", "rotor1.mass: it must be a number, not a list"),
    ("mass = 0.0284", "mass = true", "rotor1.mass: it must be a number, not true or false"),
    ('rolling = "rubber"', 'rolling = "sliding"', "rolling: unknown value 'sliding'; it takes"),
    ('inertia = "thin"', 'inertia = "thick"', "shell.inertia: unknown value 'thick'; it takes"),
    (
        "f = 25.0 }",
        "f = 25.0 }\nattitude = [1.0, 0.0]",
        "attitude: it must be a list of 4, not 2",
    ),
    # values, of which the tests of bodies and of starts have the rest
    ("radius = 1.0", "radius = 0.0", "the shell's radius must be positive and finite, not 0"),
    ("duration = 10.0", "duration = -1.0", "duration must be positive and finite, not -1"),
    (
        ROTOR_INERTIA,
        "inertia = { axial = -0.023, transverse = 0.01 }",
        "rotor1's inertia is not positive: its smallest principal moment is -0.023 kg m²",
    ),
    ("[0.46643401118350475,", "[1.5,", "frame's inertia breaks the triangle inequality: 1.5"),
    ('inertia = "thin"', 'inertia = "thin"\naxis = [0.0, 0.0, 0.0]', "shell.axis must have a"),
    ("L = 3.6", "L = 5.5", "|L| = 5.5 must not exceed sqrt(f) = 5"),
    ("f = 25.0 ", "f = 25.0, c = 1.0 ", "M is not horizontal"),
]
STARTS = {
    "": "start gives nothing; it takes one form",
    SECTION + "\nrest = true": "start gives rest, section; it takes one form",
    "rest = true": "start gives rest; it takes one form",
    ATTITUDE: "start gives attitude; it takes one form",
    ATTITUDE + "rest = true\nmomentum = [1.0, 0.0, 0.0]":
        "start gives attitude, momentum, rest; it takes one form",
    ATTITUDE + "gamma = [0.0, 0.0, 1.0]\nrest = true":
        "start gives attitude, gamma, rest; it takes one form",
    "gamma = [0.0, 0.0, 1.1]\nmomentum = [1.0, 0.0, 0.0]":
        "gamma is not of unit length: |gamma| = 1.1",
    "gamma = [0.0, 0.0, 1.0]\nalpha = [0.9, 0.0, 0.0]\nrest = true":
        "alpha is not of unit length: |alpha| = 0.9",
    "gamma = [0.0, 0.0, 1.0]\nalpha = [0.6, 0.0, 0.8]\nrest = true":
        "gamma and alpha are not orthogonal: (gamma, alpha) = 0.8",
    "attitude = [1.0, 0.1, 0.0, 0.0]\nrest = true":
        "attitude is not of unit length: |attitude| = 1.00499",
    ATTITUDE + "momentum_world = [3.0, 0.0, 4.0]":
        "M is not horizontal, as the rubber model's is by (3.1): (M, gamma) = 4 of |M| = 5",
    ATTITUDE + "angular_velocity = [0.0, 0.0, 2.5]":
        "angular_velocity spins the shell on the spot",
    "gamma = [0.0, 0.0, 1.0]\nmomentum = [0.0, 0.0, 0.0]":
        "M has no horizontal part to lay OX along; give alpha or a quaternion too",
}  # fmt: skip

# In a whole robot.
BODIES = [
    ("frame", '[frame]\npart = [{ kind = "box", mass = 1, size = [0.3, 0.3, 0.1] }]\n',
     "frame reaches 0.217945 m from the sphere's centre, beyond the shell's radius 0.2 m; make "
     "it smaller, move it, or make the shell larger"),
    ("frame", '[frame]\npart = [{ kind = "sphere", mass = 1, radius = 0.1 }, '
     '{ kind = "box", size = [0.1, 0.1, 0.1] }]\n',
     "frame.part2: a box needs a mass [kg] or a density [kg/m³]"),
    ("rest", PENDULUM + 'part = [{ kind = "point", mass = 1, centre = [0, 0, -0.1] }]\n',
     "pendulum1's parts lie on one line, about which nothing resists turning; give a rod its "
     "radius, or a point a sphere's size"),
    ("rest", PENDULUM.replace("[1, 0, 0]", "[0, 0, 0]") + BOB,
     "pendulum1's axis must have a length and a direction, unlike [0.0, 0.0, 0.0]"),
    ("frame", FRAME + 'part = [{ kind = "sphere", mass = 1, radius = 0.1 }]\n',
     "frame gives mass, inertia and part; it takes mass and inertia, or part, or mjcf, or urdf"),
    ("rest", PENDULUM,
     "pendulum1 gives nothing; it takes mass and inertia, or part, or mjcf, or urdf"),
    ("frame", "[frame]\npart = []\n", "frame.part is empty"),
    ("frame", "[frame]\ninertia = [1, 1, 1]\n", "frame: key 'mass' is missing"),
    ("shell", SHELL.replace("thickness = 0.004\n", ""),
     "shell: key 'thickness' is missing, or 'inertia' instead of it"),
    ("shell", SHELL.replace("thickness = 0.004\n", "").replace("mass", "density"),
     "shell: a density needs the wall's thickness [m] as well"),
    ("shell", SHELL + 'inertia = "thin"\n', "shell takes thickness or inertia, not both"),
    ("shell", SHELL + '[[shell.part]]\nkind = "sphere"\nmass = 1\nradius = 0.01\n'
     "centre = [0.1, 0, 0]\n",
     "shell's centre of mass is 0.05 m off its axis; what is not symmetric about the axis "
     "belongs to the frame"),
    ("shell", SHELL + '[[shell.part]]\nkind = "box"\nmass = 1\nsize = [0.1, 0.1, 0.02]\n',
     "shell is not symmetric about its axis: its inertia is off by 0.0004 of 0.0"),
    ("rest", "[[rotor]]\naxis = [0, 0, 1]\n"
     'part = [{ kind = "box", mass = 1, size = [0.1, 0.05, 0.02] }]\n',
     "rotor1 is not symmetric about its axis: its inertia is off by 0.0003125 of 0.00104167 kg "
     "m²; such a body is a pendulum"),
    ("frame", "[frame]\nmass = 1\ninertia = [1, 1]\n",
     "frame.inertia takes three moments, or three rows of three"),
    ("rest", "[pendulum]\naxis = [1, 0, 0]\n",
     "pendulum: a scene may have many; write [[pendulum]] for each"),
    ("frame", '[frame]\npart = [{ kind = "bax", mass = 1 }]\n',
     "frame.part1.kind: unknown value 'bax'; it takes point, sphere, box"),
    ("frame", '[frame]\npart = [{ kind = "sphere", mass = 1, raduis = 1 }]\n',
     "frame.part1: unknown key 'raduis'; did you mean 'radius'?"),
    ("frame", '[frame]\nurdf = { file = "no.urdf", link = "arm" }\n',
     "no.urdf: No such file or directory"),
    ("head", "gravity_direction = [1, 0, 0.5]\n",
     "gravity_direction must press the ball on the plane: its Z is 0.447214, and must be"),
    ("head", "gravity_direction = [0, 0, 0]\n",
     "gravity_direction must have a length and a direction"),
    ("head", "[friction]\nsliding = 0\n",
     "the sliding friction must be positive and finite, not 0"),
]  # fmt: skip

TABLES = {
    "bad.csv": "t,rate\n0,1\n1,x\n",
    "rpm.csv": "t,rate\ns,rpm\n0,1\n5,2\n",
    "many.csv": "t,a,b\n0,1,2\n5,2,3\n",
}
# On the frame and on a pendulum.
HINGES = {
    'drive = "servo"': 'drive = "servo" needs the key \'kv\' [N m s/rad]',
    'drive = "position"\nangle = 0': 'drive = "position" needs the key \'kp\' [N m/rad]',
    'drive = "position"\nkp = 1': 'drive = "position" needs the key \'angle\' [rad]',
    'drive = "torque"': 'drive = "torque" needs the key \'torque\' [N m]',
    'drive = "servo"\nkv = 0': "a servo's gain must be positive and finite, not 0 N m s/rad",
    'drive = "position"\nkp = -6\nangle = 1':
        "a position servo's gain must be positive and finite, not -6 N m/rad",
    'drive = "free"\ndamping = -1':
        "a free hinge's damping, where it is not 0, must be positive and finite, not -1",
    'drive = "servo"\nkv = 1\nkp = 1': 'kp belongs to drive = "position", not to "servo"',
    "kv = 1": 'kv belongs to drive = "servo", not to "prescribed"',
    "torque_limit = 1":
        'torque_limit belongs to drive = "servo" or "position", not to "prescribed"',
    'drive = "position"\nkp = 1\nangle = 1\nrate = 2':
        'rate belongs to drive = "prescribed" or "servo", not to "position"',
    "rate = 1\ninitial_rate = 2":
        'initial_rate belongs to drive = "servo" or "position" or "torque" or "free", not to',
    'drive = "servoo"':
        "drive: unknown value 'servoo'; it takes free, position, prescribed, servo, torque",
    'rate = { kind = "rmap", final = 1, end = 1 }':
        "rate.kind: unknown value 'rmap'; it takes ramp, sine, samples",
    "rate = { final = 1, end = 1 }": "rate: key 'kind' is missing; it takes ramp, sine, samples",
    'rate = "fast"': "rate: it must be a number or a table or a list, not text",
    "rate = []": "a sum needs at least one rate",
    'rate = { kind = "samples", times = [0, 3], values = [1, 2] }':
        "samples from t = 0 to 3 s do not reach over the run, from 0 to 5 s",
    'rate = { kind = "samples", times = [0, 5] }':
        "samples: key 'values' is missing, or 'file' instead",
    'rate = { kind = "samples", times = [0, 5], values = [1, 2], file = "x.csv" }':
        "samples take a file, or times and values, not both",
    'rate = { kind = "samples", file = "x.csv" }': "x.csv: No such file or directory",
    'rate = { kind = "samples", file = "rpm.csv" }':
        "rpm.csv: rate is in rpm; samples take rad/s, rad, N m",
    'rate = { kind = "samples", file = "many.csv" }':
        "many.csv: samples take two columns, time and value, not t, a, b",
    'rate = { kind = "samples", file = "bad.csv" }':
        "bad.csv: line 3: rate is 'x', and must be a number",
}  # fmt: skip

BODY = {"frame": ("frame", FRAME), "pendulum1": ("rest", PENDULUM + BOB)}
REFUSED = [
    *((edited(old, new), "", words) for old, new, words in CHANGES),
    *((with_start(start), "", words) for start, words in STARTS.items()),
    *((robot(**{table: text}), "", words) for table, text, words in BODIES),
    *(
        (robot(**{table: f"{text}{keys}\n"}), body, words)
        for body, (table, text) in BODY.items()
        for keys, words in HINGES.items()
    ),
]


@pytest.mark.parametrize(("text", "body", "words"), REFUSED, ids=[words for *_, words in REFUSED])
def test_scene_that_cannot_be_used_is_refused_with_key_and_reason(
    write: Write, text: str, body: str, words: str
) -> None:
    """One line: the file, then the key or the body, then what is wrong and by how much."""
    path = write(text)
    for name, table in TABLES.items():
        (path.parent / name).write_text(table)
    message = refusal(path)
    assert words in message
    assert f"mine.toml: {body}" in message
