"""Files of different runs have different names."""

from dataclasses import replace

import pytest

import robotball as rb
from robotball.engines.mujoco import LABEL
from validation import compare
from validation.cli import parse
from validation.results import changed, file_name, file_stem

TIMES = rb.sample_times(0.1)


def test_a_comparison_is_named_after_scene_engine_and_preset() -> None:
    """The default preset too; a duration where it is not the scene's own; all presets as `all`."""
    short = replace(rb.load_scene("fig12"), duration=0.1)
    agreements = [compare(short, name, TIMES) for name in rb.PRESETS]
    assert file_stem([agreements[2]]) == "fig12-mujoco-balanced"
    assert file_stem(agreements[1:3]) == "fig12-mujoco-fast-balanced"
    assert file_stem(agreements) == "fig12-mujoco-all"
    assert file_stem([compare("fig12", "fast", TIMES)]) == "fig12-mujoco-fast-0.1s"


def test_what_settings_are_called_makes_a_file_s_name() -> None:
    """Whatever is in it; the scene's part is its file's."""
    engine = replace(LABEL, name="PhysX 5 (SAPIEN)")
    words = ["accurate - cone - noslip", "to 1e-05", "size/2"]
    name = "x$[1]-y-physx-5-sapien-accurate-cone-noslip-to-1e-05-size-2"
    assert file_name("x$[1] y", engine, words) == name


@pytest.mark.parametrize(
    ("command", "names", "words"),
    [
        ("video fig12", "fps size slow camera ghost arrows", []),
        (
            "video fig12 --camera above --ghost --slow 2",
            "slow camera ghost",
            ["slow-2", "above", "ghost"],
        ),
        ("section fig12 --starts 4 --g 0.5", "starts count g", ["starts-4", "g-0.5"]),
        ("design fig12 --rotor-speed 20", "mass rotor_speed", ["rotor-speed-20"]),
        ("tradeoff fig12 --duration 4", "duration", ["4s"]),
        ("engines fig12 --only mujoco", "only", ["mujoco"]),
        ("steer three_rotors --turns -2", "turns", ["turns--2"]),
    ],
)
def test_an_option_that_is_not_at_its_default_is_in_the_name(
    command: str, names: str, words: list[str]
) -> None:
    """A word each, in the order of `--help`; one at its default has none."""
    assert changed(parse(command.split()), *names.split()) == words
