"""Whatever stands in a scene file, it is a scene or one clear line."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.files.scene_file import CATALOG
from tests.robotball.files.scene_texts import FIG12

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
