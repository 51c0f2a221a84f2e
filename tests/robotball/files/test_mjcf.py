"""MJCF of somebody else's is loaded in a few seconds and a few hundred MB, or refused in a line."""

from pathlib import Path

import pytest

import robotball as rb
from robotball.files.foreign_bodies import solid_of_mjcf


def mjcf(inside: str = "", before: str = "") -> str:
    body = f'<body name="b"><geom size="1" mass="1"/>{inside}</body>'
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


def replicated(count: int, what: str) -> str:
    return f'<replicate count="{count}">{what}</replicate>'


GEOM = '<geom size=".1"/>'
LARGE = "it takes more than 500 MB to load"
# A few lines each: 100 GB of arena, 11 GB of texture, 27 million points, a body of no name.
HOSTILE = {
    "arena": (mjcf(before='<size memory="100G"/>'), LARGE),
    "texture": (
        mjcf(before='<asset><texture name="t" type="2d" builtin="flat" width="60000" '
                    'height="60000"/></asset>'),
        LARGE,
    ),
    "flex": (
        mjcf('<flexcomp name="f" type="grid" count="300 300 300" spacing=".1 .1 .1" dim="3"/>'),
        LARGE,
    ),
    "a key of 4000 characters": (mjcf(f'<geom {"k" * 4000}="1"/>'), "unrecognized attribute"),
    "3000 names": (
        mjcf("".join(f'<body name="n{i}"><geom size="1"/></body>' for i in range(3000))).replace(
            '"b"', '"c"'
        ),
        "no body is called 'b'; there are 3001, as c, n0",
    ),
    "no MJCF": ("<mujoco>", "XML parse error"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("text", "words"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_one_short_line(tmp_path: Path, text: str, words: str) -> None:
    """By MuJoCo's ValueError or RuntimeError, or by the end of a limit."""
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(rb.InputError, match=words) as refusal:
        solid_of_mjcf(path, "b")
    assert len(str(refusal.value)) <= 500


# What MuJoCo reads as not given, or as an angle of zero.
NO_NUMBERS = {
    "pos .* not 'nan 0 0'": mjcf('<body pos="nan 0 0"><geom size="1"/></body>'),
    "euler .* not 'inf 0 0'": mjcf('<body euler="inf 0 0"><geom size="1"/></body>'),
    "mass takes finite numbers, not '-NaN'": mjcf("<geom size='1' mass='-NaN'/>"),
    "density takes finite numbers, not 'Infinity'":
        mjcf(before='<default><geom density="Infinity"/></default>'),
}  # fmt: skip


@pytest.mark.parametrize(("words", "text"), NO_NUMBERS.items(), ids=NO_NUMBERS)
def test_a_number_that_is_none_is_refused(tmp_path: Path, words: str, text: str) -> None:
    """NaN and infinity anywhere in the file."""
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(rb.InputError, match=f"model.xml: {words}"):
        solid_of_mjcf(path, "b")


def test_a_number_that_is_none_is_refused_in_a_file_that_is_included(tmp_path: Path) -> None:
    """By that file's name."""
    path, inside = tmp_path / "model.xml", tmp_path / "parts" / "inside.xml"
    inside.parent.mkdir()
    path.write_text('<mujoco><include file="parts/inside.xml"/></mujoco>')
    words, text = next(iter(NO_NUMBERS.items()))
    inside.write_text(text)
    with pytest.raises(rb.InputError, match=f"inside.xml: {words}"):
        solid_of_mjcf(path, "b")


def test_a_range_without_end_and_a_name_are_no_numbers(tmp_path: Path) -> None:
    """Nor is anything in a comment, whatever its encoding."""
    path = tmp_path / "model.xml"
    hinge = '<body name="inf"><joint name="nan" range="-inf inf"/><geom size="1"/></body>'
    motor = '<actuator><motor joint="nan" ctrlrange="-inf inf"/></actuator>'
    text = (
        mjcf(hinge)
        .replace("</mujoco>", motor + "</mujoco>")
        .replace("<world", "<!-- é mass='nan' --><world")
    )
    path.write_text(text, encoding="latin-1")
    assert solid_of_mjcf(path, "inf").mass > 0


@pytest.mark.slow
def test_a_file_that_takes_long_is_given_up(tmp_path: Path) -> None:
    """Two million geoms in a line, after 5 s of processor time."""
    path = tmp_path / "model.xml"
    path.write_text(mjcf(replicated(2_000_000, GEOM)))
    with pytest.raises(rb.InputError, match=r"it takes more than (5 s|20 s|500 MB) to load"):
        solid_of_mjcf(path, "b")


@pytest.mark.slow
def test_an_ordinary_file_is_loaded(tmp_path: Path) -> None:
    """Limits leave room for a hundred geoms; their mass is the body's."""
    path = tmp_path / "model.xml"
    path.write_text(mjcf(replicated(100, '<geom size=".1" mass=".5"/>')))
    assert solid_of_mjcf(path, "b").mass == pytest.approx(51.0, rel=1e-12)
