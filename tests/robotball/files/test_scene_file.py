"""Scenes read from TOML: what a file may say, and that anything else is one clear line."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.files.catalog import CATALOG
from robotball.rotations import rotation_matrix
from tests.scenes import FOUR

FIG12 = (CATALOG / "fig12.toml").read_text()
CLASSICAL = (CATALOG / "classical_regular.toml").read_text()
SECTION = "section = { L = 3.6, l = 0.6, g = 0.0, f = 25.0 }"

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a scene file and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write


def edited(old: str, new: str, text: str = FIG12) -> str:
    """The text with its one occurrence of `old` replaced."""
    assert text.count(old) == 1
    return text.replace(old, new)


def with_start(start: str, text: str = FIG12) -> str:
    return edited(SECTION, start, text)


# Fig. 12's ball with its rotor laid elsewhere, so that the frame's axes are not principal ones.
ASKEW = re.sub(r"(?m)^axis = .*", "axis = [1.0, -2.0, 2.0]", FIG12)
ASKEW_CLASSICAL = edited('rolling = "rubber"', 'rolling = "classical"', ASKEW)


def refusal(path: Path | str) -> str:
    """The message of the InputError that loading gives: one line, which names the file."""
    with pytest.raises(rb.InputError) as caught:
        rb.load_scene(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


# What a file may say -----------------------------------------------------------------------


def test_catalog_has_the_papers_scenes_and_all_of_it_loads() -> None:
    """Every catalog scene loads by its name and by its path, to the same scene."""
    assert set(FOUR) < set(rb.catalog())
    for name in rb.catalog():
        by_name, by_path = rb.load_scene(name), rb.load_scene(CATALOG / f"{name}.toml")
        assert by_name.name == by_path.name == name
        assert by_name == by_path


def test_scene_has_what_its_file_says() -> None:
    """Title, rolling model, rates, duration and the default gravity are the file's."""
    scene = rb.load_scene("fig12")
    assert scene.title == "Drifting along a limit cycle, rubber (Fig. 12)"
    assert scene.rolling == "rubber"
    assert scene.frame_rate == 2.0
    assert scene.rotor_rates == (147.98400204185404,)
    assert (scene.duration, scene.gravity) == (10.0, 9.81)
    assert scene.times[0] == 0
    assert scene.times[-1] == 10.0


def test_axes_need_not_be_of_unit_length(write: Write) -> None:
    """A rotor's axis gives a direction; (2, 0, 0) is (1, 0, 0)."""
    axis = re.search(r"axis = \[.*\]", FIG12)
    assert axis
    scene = rb.load_scene(write(edited(axis[0], "axis = [0.0, -2.0, 0.0]")))
    np.testing.assert_array_equal(scene.ball.rotors[0].axis, [0.0, -1.0, 0.0])


def vector(v: Any) -> str:
    return str([float(x) for x in v])


@pytest.mark.parametrize(
    "text",
    [FIG12, CLASSICAL, ASKEW, ASKEW_CLASSICAL],
    ids=["rubber", "classical", "askew rubber", "askew classical"],
)
def test_every_form_of_a_start_gives_the_same_start(write: Write, text: str) -> None:
    """The section's state, given as γ and M, as attitudes and as ω, is the same state."""
    scene = rb.load_scene(write(text))
    R = rotation_matrix(scene.start.attitude)
    alpha, gamma = vector(R[0]), vector(R[2])
    attitude, momentum = vector(scene.start.attitude), vector(R.T @ scene.start.momentum)
    omega = vector(scene.angular_velocity_at(scene.start))
    attitudes = f"attitude = {attitude}", f"gamma = {gamma}\nalpha = {alpha}"
    momenta = (
        f"momentum = {momentum}",
        f"momentum_world = {vector(scene.start.momentum)}",
        f"angular_velocity = {omega}",
    )
    forms = [f"{a}\n{m}" for a in attitudes for m in momenta]
    forms.append(f"gamma = {gamma}\nmomentum = {momentum}")
    for form in forms:
        other = rb.load_scene(write(with_start(form, text)))
        # Rounding: measured 4.4e-16 and 3.6e-15.
        assert np.abs(rotation_matrix(other.start.attitude) - R).max() < 3e-15, form
        assert np.abs(other.start.momentum - scene.start.momentum).max() < 2e-14, form


def test_section_is_one_of_the_principal_axes(write: Write) -> None:
    """For a ball whose frame axes are askew, L and g = 0 of (5.5) hold in the principal axes."""
    scene = rb.load_scene(write(ASKEW))
    assert np.abs(scene.principal_axes - np.eye(3)).max() > 0.1
    R = rotation_matrix(scene.start.attitude) @ scene.principal_axes
    M, gamma = R.T @ scene.start.momentum, R[2]
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert abs(M[2] - 3.6) < 1e-14
    assert abs(np.cross(M, gamma)[2]) < 1e-14


def test_section_with_c_gives_a_momentum_with_a_vertical_part(write: Write) -> None:
    """c of (5.5) is (M, γ), which is M's world Z."""
    start = "section = { L = 3.6, l = 0.6, g = 0.3, f = 25.0, c = 3.0 }"
    M = rb.load_scene(write(with_start(start, CLASSICAL))).start.momentum
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert np.abs(M - [-4.0, 0.0, 3.0]).max() < 5e-15


def test_rest_is_no_momentum_and_standing_still_is_another_start(write: Write) -> None:
    """A rotor that turns at the start turns a ball with M = 0; what to give for ω = 0 is told."""
    attitude = "attitude = [0.6, 0.0, 0.8, 0.0]\n"
    rest, still = (
        rb.load_scene(write(with_start(attitude + form, CLASSICAL)))
        for form in ("rest = true", "angular_velocity = [0.0, 0.0, 0.0]")
    )
    assert np.linalg.norm(rest.angular_velocity_at(rest.start)) > 0.1  # rad/s
    assert not rest.start.momentum.any()
    assert np.linalg.norm(still.angular_velocity_at(still.start)) < 1e-13  # rounding
    assert still.start.momentum.any()
    assert "# M = 0; ω is not, where frame or rotors turn" in rb.scene_toml(rest)
    assert "# M = 0" not in rb.scene_toml(still)
    with pytest.raises(rb.InputError, match=r"rest \(M = 0; a ball that stands still has angular_"):
        rb.load_scene(write(with_start(attitude, CLASSICAL)))


@pytest.mark.parametrize("text", [FIG12, CLASSICAL], ids=["rubber", "classical"])
def test_rest_is_no_momentum(write: Write, text: str) -> None:
    """`rest = true` is M = 0 at the attitude given."""
    scene = rb.load_scene(write(with_start("attitude = [0.6, 0.0, 0.8, 0.0]\nrest = true", text)))
    np.testing.assert_array_equal(scene.start.momentum, [0.0, 0.0, 0.0])
    assert np.abs(scene.start.attitude - [0.6, 0.0, 0.8, 0.0]).max() < 2e-16


# What is refused ---------------------------------------------------------------------------


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


def test_line_breaks_in_names_stay_out_of_the_message(write: Write, tmp_path: Path) -> None:
    """A key with a line break in it, or a file's name, still gives one line; so does a null."""
    assert "unknown" in refusal(write('"a\\nb" = 1\n' + FIG12))
    assert "unknown" in refusal(write(edited("radius =", '"rad\\nius" =')))
    with pytest.raises(rb.InputError, match=r"a b\.toml: No such file"):
        rb.load_scene(tmp_path / "a\nb.toml")
    with pytest.raises(rb.InputError, match=r"\.toml: embedded null"):
        rb.load_scene("a\0b.toml")


@pytest.mark.parametrize(
    "content",
    [
        b"= 3",
        b"[shell",
        b"\xff\xfe\x00",
        b"a = 1\na = 2",
        b"\0",
        b"a = " + b"9" * 5000,
        b"a = " + b"[" * 5000,
    ],
    ids=[
        "no key",
        "open bracket",
        "no text",
        "doubled key",
        "null",
        "5000 digits",
        "5000 brackets",
    ],
)
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
        # values
        ("radius = 1.0", "radius = 0.0", "the shell's radius must be positive and finite, not 0"),
        ("mass = 0.07", "mass = -0.07", "shell's mass must be positive and finite, not -0.07 kg"),
        ("mass = 0.0284", "mass = 0", "rotor1's mass must be positive and finite, not 0 kg"),
        ("duration = 10.0", "duration = -1.0", "duration must be positive and finite, not -1"),
        ("duration = 10.0", "duration = 0", "duration must be positive and finite, not 0"),
        (
            ROTOR_INERTIA,
            "inertia = { axial = 0.023, transverse = 0.01 }",
            "rotor1 is flatter than a disk: its axial inertia 0.023 exceeds twice the "
            "transverse 0.01 by 0.003 kg m²",
        ),
        (
            ROTOR_INERTIA,
            "inertia = { axial = -0.023, transverse = 0.01 }",
            "rotor1's inertia is not positive: its smallest principal moment is -0.023 kg m²",
        ),
        ("[0.46643401118350475,", "[1.5,", "frame's inertia breaks the triangle inequality: 1.5"),
        ("[0.46643401118350475, -", "[0.46643401118350475, ", "frame's inertia is not symmetric"),
        ('inertia = "thin"', 'inertia = "thin"\naxis = [0.0, 0.0, 0.0]', "shell.axis must have a"),
        # starts
        ("L = 3.6", "L = 5.5", "|L| = 5.5 must not exceed sqrt(f) = 5"),
        ("f = 25.0", "f = -25.0", "f = M² must be positive, not -25"),
        ("f = 25.0 ", "f = 25.0, c = 5.0 ", "|c| = 5 must be smaller than sqrt(f) = 5"),
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


def numbers(value: Any, path: str = "") -> Iterator[str]:
    """The paths of all the numbers in a decoded TOML value, as `rotor[0].axis[2]`."""
    if isinstance(value, float | int) and not isinstance(value, bool):
        yield path
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from numbers(inner, f"{path}[{i}]")


def replaced(value: Any, path: str, new: float, here: str = "") -> Any:
    """The decoded TOML value with the number at `path` replaced."""
    if here == path:
        return new
    if isinstance(value, dict):
        return {
            key: replaced(inner, path, new, f"{here}.{key}" if here else key)
            for key, inner in value.items()
        }
    if isinstance(value, list):
        return [replaced(inner, path, new, f"{here}[{i}]") for i, inner in enumerate(value)]
    return value


def toml(value: Any) -> str:
    """A value as TOML: a table's keys a line each, everything inside them inline."""

    def inline(value: Any) -> str:
        if isinstance(value, dict):
            return f"{{ {', '.join(f'{key} = {inline(v)}' for key, v in value.items())} }}"
        if isinstance(value, list):
            return f"[{', '.join(map(inline, value))}]"
        return json.dumps(value) if isinstance(value, str | bool) else repr(value)

    return "\n".join(f"{key} = {inline(inner)}" for key, inner in value.items())


# Every key that can hold a number stands in one of these.
FULL = msgspec.toml.decode(
    edited('inertia = "thin"', "inertia = { axial = 0.05, transverse = 0.05 }").replace(
        "[shell]", "gravity = 9.81\n\n[shell]\naxis = [0.0, 0.0, 1.0]"
    )
)
STARTS: tuple[dict[str, Any], ...] = (
    {"section": {"L": 3.6, "l": 0.6, "g": 0.1, "f": 25.0, "c": 0.0}},
    {"gamma": [0.0, 0.0, 1.0], "momentum": [1.0, 0.0, 0.0]},
    {"attitude": [1.0, 0.0, 0.0, 0.0], "momentum_world": [1.0, 0.0, 0.0]},
    {"gamma": [0.0, 0.0, 1.0], "alpha": [1.0, 0.0, 0.0], "angular_velocity": [1.0, 0.0, 2.0]},
)
NUMBERS = [
    (FULL | {"start": start}, path)
    for start in STARTS
    for path in numbers(FULL | {"start": start})
    if start is STARTS[0] or path.startswith("start")
]


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf", "1e+300"])
def test_number_that_is_not_finite_is_refused_by_its_key(write: Write, bad: str) -> None:
    """NaN, infinity or 1e300 in any numeric entry of any table is refused, the entry named."""
    assert len(NUMBERS) == 54
    for scene, path in NUMBERS:
        rb.load_scene(write(toml(scene)))  # the unchanged scene is a good one
        changed = replaced(scene, path, float(bad))
        message = refusal(write(toml(changed)))
        named = re.sub(r"rotor\[0\]", "rotor1", path)  # as the body is
        assert f"{named} must be finite and at most 1e+50 in size, not {bad}" in message


# Anything at all ---------------------------------------------------------------------------

BASES = [
    [line for line in re.sub(r'source = """[^"]*"""', "", text).splitlines() if line]
    for text in (
        FIG12,
        *(
            (CATALOG / f"{name}.toml").read_text()
            for name in ("steered_pendulum_robot", "inclined_plane", "swinging_frame")
        ),
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
    lines = list(draw(st.sampled_from(BASES)))
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
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=mutated_scenes() | st.binary(max_size=40))
def test_any_file_is_a_scene_or_one_line(tmp_path: Path, content: bytes) -> None:
    """Whatever a file holds, it loads or gives one InputError: no traceback, no warning."""
    path = tmp_path / "any.toml"
    path.write_bytes(content)
    accepted, message = True, ""
    try:
        scene = rb.load_scene(path)
        assert np.all(np.isfinite(scene.angular_velocity_at(scene.start)))
    except rb.InputError as error:
        message = str(error)
        accepted = False
    assert accepted or ("\n" not in message and str(path) in message)
