"""Scenes are written and read again to the last bit."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.robot.drives import Rate
from robotball.robot.motors import Free
from robotball.robot.scene import Friction
from tests.random_robots import random_scene
from tests.robotball.scene_files.scene_texts import scene_of

CURVES: tuple[rb.Ramp | rb.Sine | rb.Samples, ...] = (
    rb.Samples(times=(0.0, 0.1, 1 / 3, 1e10), values=(1e-300, -0.1, 1e6, 2 / 3)),
    rb.Sine(mean=-0.7, amplitude=1 / 3, frequency=1e-3, phase=2.0),
    rb.Sine(amplitude=0.0, frequency=1 / 7),
    rb.Ramp(initial=-1e3, final=2 / 3, start=0.1, end=7.0, shape="quintic"),
    rb.Ramp(final=1.0, end=1e-5),
)
RATES: tuple[Rate, ...] = (0.0, -1 / 3, 1e22, *CURVES, rb.Sum((0.5, *CURVES)))
rates, positive = st.sampled_from(RATES), st.floats(1e-9, 1e9)
maybe, sometimes = st.none() | positive, st.just(0.0) | positive
texts = st.just('\x00\x7f\t\r\n"""\\🎱') | st.text(st.characters(exclude_categories=["Cs"]))


@st.composite
def scenes(draw: st.DrawFn) -> rb.Scene:
    """Draw any robot, with any rates, plane and texts."""
    scene = random_scene(np.random.default_rng(draw(st.integers(0, 2**32))))
    # The command of a free hinge is not used, and not written.
    told = [0.0 if isinstance(hinge.motor, Free) else draw(rates) for hinge in scene.hinges]
    return replace(
        scene,
        title=draw(texts),
        source=draw(texts),
        ball=scene.ball.with_hinges(command=told),
        duration=draw(positive),
        gravity=draw(positive),
        friction=draw(st.builds(Friction, maybe, maybe, sometimes)),
        plane_motion=(draw(rates), draw(rates), draw(rates)),
        plane_rotation=draw(rates),
    )


@settings(max_examples=100)
@given(scene=scenes())
def test_any_scene_is_restored_from_its_text(scene: rb.Scene) -> None:
    """With any bodies, rates and texts, including quotes and control characters."""
    assert replace(scene_of(rb.scene_toml(scene)), name=scene.name) == scene
