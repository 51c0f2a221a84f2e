"""A scene file that cannot be used is refused in one line, with its name, key and reason."""

import re
from pathlib import Path

import pytest

import robotball as rb
from tests.robotball.files.scene_texts import FIG12, SECTION, Write, edited, refusal


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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
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
        (
            'rolling = "rubber"',
            'rolling = "sliding"',
            "rolling: unknown value 'sliding'; it takes",
        ),
        (
            'inertia = "thin"',
            'inertia = "thick"',
            "shell.inertia: unknown value 'thick'; it takes",
        ),
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
        # starts
        ("L = 3.6", "L = 5.5", "|L| = 5.5 must not exceed sqrt(f) = 5"),
        ("f = 25.0 ", "f = 25.0, c = 1.0 ", "M is not horizontal"),
        (SECTION, "", "start gives nothing; it takes one form"),
        (SECTION, SECTION + "\nrest = true", "start gives rest, section; it takes one form"),
        (SECTION, "rest = true", "start gives rest; it takes one form"),
        (SECTION, ATTITUDE, "start gives attitude; it takes one form"),
        (
            SECTION,
            ATTITUDE + "rest = true\nmomentum = [1.0, 0.0, 0.0]",
            "start gives attitude, momentum, rest; it takes one form",
        ),
        (
            SECTION,
            ATTITUDE + "gamma = [0.0, 0.0, 1.0]\nrest = true",
            "start gives attitude, gamma, rest; it takes one form",
        ),
        (
            SECTION,
            "gamma = [0.0, 0.0, 1.1]\nmomentum = [1.0, 0.0, 0.0]",
            "gamma is not of unit length: |gamma| = 1.1",
        ),
        (
            SECTION,
            "gamma = [0.0, 0.0, 1.0]\nalpha = [0.9, 0.0, 0.0]\nrest = true",
            "alpha is not of unit length: |alpha| = 0.9",
        ),
        (
            SECTION,
            "gamma = [0.0, 0.0, 1.0]\nalpha = [0.6, 0.0, 0.8]\nrest = true",
            "gamma and alpha are not orthogonal: (gamma, alpha) = 0.8",
        ),
        (
            SECTION,
            "attitude = [1.0, 0.1, 0.0, 0.0]\nrest = true",
            "attitude is not of unit length: |attitude| = 1.00499",
        ),
        (
            SECTION,
            ATTITUDE + "momentum_world = [3.0, 0.0, 4.0]",
            "M is not horizontal, as the rubber model's is by (3.1): (M, gamma) = 4 of |M| = 5",
        ),
        (
            SECTION,
            ATTITUDE + "angular_velocity = [0.0, 0.0, 2.5]",
            "angular_velocity spins the shell on the spot",
        ),
        (
            SECTION,
            "gamma = [0.0, 0.0, 1.0]\nmomentum = [0.0, 0.0, 0.0]",
            "M has no horizontal part to lay OX along; give alpha or a quaternion too",
        ),
    ],
)
def test_scene_that_cannot_be_used_is_refused_with_key_and_reason(
    write: Write, old: str, new: str, message: str
) -> None:
    """One line: the file, then the key or the body, then what is wrong and by how much."""
    assert message in refusal(write(edited(old, new)))
