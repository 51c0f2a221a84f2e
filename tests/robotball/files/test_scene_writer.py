"""What is written of a scene is all of it, to the last bit."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, reject, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.bodies import Ball, Frame, Rotor, Shell, thin_shell_inertia
from robotball.drives import Ramp, Sine
from robotball.motors import Servo
from robotball.parameters import Rolling
from robotball.rotations import Array
from robotball.start import Start


def same(a: Any, b: Any) -> bool:
    """Whether two scenes, or parts of scenes, are equal in every bit but the sign of a zero."""
    if type(a) is not type(b):
        return False
    if dataclasses.is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else bool(a == b)


def read_back(scene: rb.Scene, folder: Path) -> rb.Scene:
    path = folder / f"{scene.name}.toml"
    path.write_bytes(rb.scene_toml(scene).encode())
    return rb.load_scene(path)


@pytest.mark.parametrize("name", rb.catalog())
def test_every_scene_of_the_catalog_comes_back(name: str, tmp_path: Path) -> None:
    """Drives, motors and starts of all kinds among them."""
    scene = rb.load_scene(name)
    assert same(read_back(scene, tmp_path), scene)


def numbers(low: float = -1e6, high: float = 1e6) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


positive = numbers(1e-9, 1e9)


@st.composite
def units(draw: st.DrawFn, size: int) -> Array:
    """A unit vector (size,)."""
    v = np.array([draw(numbers(-1, 1)) for _ in range(size)])
    length = np.linalg.norm(v)
    assume(length > 1e-3)
    return v / length


@st.composite
def centres(draw: st.DrawFn) -> Array:
    """A centre of mass (3,): the sphere's, or another."""
    return np.array([draw(numbers()) for _ in range(3)]) if draw(st.booleans()) else np.zeros(3)


@st.composite
def shells(draw: st.DrawFn) -> Shell:
    """Thin, or of two moments."""
    radius, mass, transverse = draw(positive), draw(positive), draw(positive)
    axial = transverse * draw(numbers(0.1, 1.9))
    if draw(st.booleans()):
        axial = transverse = thin_shell_inertia(radius, mass)
    return Shell(radius, mass, axial, transverse, draw(units(3)))


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Of any second moments about any axes."""
    axes = Rotation.from_quat(draw(units(4))).as_matrix()
    second = axes @ np.diag([draw(numbers(1e-3, 1e3)) for _ in range(3)]) @ axes.T
    return Frame(draw(positive), np.trace(second) * np.eye(3) - second, draw(centres()))


@st.composite
def rotors(draw: st.DrawFn) -> Rotor:
    """From a ring to a rod."""
    axial = draw(positive)
    return Rotor(
        draw(positive), axial, axial * draw(numbers(0.5, 1e3)), draw(units(3)), draw(centres())
    )


rates = st.one_of(
    numbers(),
    st.builds(
        lambda start, length, **others: Ramp(start=start, end=start + length, **others),
        start=numbers(0, 10),
        length=numbers(0.1, 10),
        initial=numbers(-1e3, 1e3),
        final=numbers(-1e3, 1e3),
        shape=st.sampled_from(["linear", "smooth"]),
    ),
    st.builds(
        Sine, mean=numbers(), amplitude=numbers(), frequency=numbers(1e-3, 10), phase=numbers()
    ),
)
servos = st.builds(Servo, gain=positive, torque_limit=st.none() | positive)
texts = st.text(st.characters(exclude_categories=["Cs"]))


@st.composite
def scenes(draw: st.DrawFn) -> rb.Scene:
    """Any bodies, rates, motors and starts."""
    bodies = draw(shells()), draw(frames()), tuple(draw(st.lists(rotors(), max_size=3)))
    try:
        ball = Ball(*bodies)
    except rb.InputError:  # bodies of such different sizes that the whole is one of them, rounded
        reject()
    hinges = 1 + len(ball.rotors)
    turning = [draw(rates) for _ in range(hinges)]
    motors = tuple(draw(st.none() | servos) for _ in range(hinges))
    rolling: Rolling = "rubber" if draw(st.booleans()) else "classical"
    vertical = draw(numbers()) if rolling == "classical" else 0.0
    return rb.Scene(
        name="any",
        title=draw(texts),
        source=draw(texts),
        ball=ball,
        rolling=rolling,
        frame_rate=turning[0],
        rotor_rates=tuple(turning[1:]),
        start=Start(draw(units(4)), np.array([draw(numbers()), draw(numbers()), vertical])),
        duration=draw(positive),
        gravity=draw(st.just(9.81) | positive),
        motors=motors if any(motors) else (),
    )


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
@given(scene=scenes())
def test_any_scene_comes_back(scene: rb.Scene, tmp_path: Path) -> None:
    """Whatever its bodies, rates and texts, from quotes to control characters."""
    assert same(read_back(scene, tmp_path), scene)


def test_a_rate_given_by_a_function_has_no_text() -> None:
    """It is refused, not left out."""
    scene = dataclasses.replace(rb.load_scene("fig12"), frame_rate=lambda t: 2.0 + t)
    with pytest.raises(rb.InputError, match="a rate given by a function of time cannot be written"):
        rb.scene_toml(scene)
