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
from robotball.drives import Ramp, Sine
from robotball.equations import Rolling
from robotball.motors import Free, PositionServo, Servo, Torque
from robotball.robot import Ball, Frame, Pendulum, Rotor, Shell, thin_shell_inertia
from robotball.rotations import Array
from robotball.scene import Friction, Start


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
    offset = draw(st.just(0.0) | numbers())
    return Shell(radius, mass, axial, transverse, draw(units(3)), offset)


@st.composite
def tensors(draw: st.DrawFn) -> Array:
    """An inertia (3, 3) of any second moments about any axes."""
    axes = Rotation.from_quat(draw(units(4))).as_matrix()
    second = axes @ np.diag([draw(numbers(1e-3, 1e3)) for _ in range(3)]) @ axes.T
    return np.trace(second) * np.eye(3) - second


frames = st.builds(Frame, positive, tensors(), centres())
pendulums = st.builds(Pendulum, positive, tensors(), centres(), units(3), centres())


@st.composite
def rotors(draw: st.DrawFn) -> Rotor:
    """From a ring to a rod."""
    axial = draw(positive)
    return Rotor(
        draw(positive), axial, axial * draw(numbers(0.5, 1e3)), draw(units(3)), draw(centres())
    )


@st.composite
def samples(draw: st.DrawFn) -> rb.Samples:
    """From 0 to beyond any duration."""
    steps = draw(st.lists(numbers(1e-3, 1e3), min_size=1, max_size=5))
    times = (0.0, *np.cumsum([*steps, 1e10]).tolist())
    return rb.Samples(times=times, values=tuple(draw(numbers()) for _ in times))


simple_rates: st.SearchStrategy[rb.Ramp | rb.Sine | rb.Samples | float] = st.one_of(
    numbers(),
    st.builds(
        lambda start, length, **others: Ramp(start=start, end=start + length, **others),
        start=numbers(0, 10),
        length=numbers(0.1, 10),
        initial=numbers(-1e3, 1e3),
        final=numbers(-1e3, 1e3),
        shape=st.sampled_from(["linear", "smooth", "quintic"]),
    ),
    st.builds(
        Sine, mean=numbers(), amplitude=numbers(), frequency=numbers(1e-3, 10), phase=numbers()
    ),
    samples(),
)
rates = simple_rates | st.lists(simple_rates, min_size=1, max_size=3).map(
    lambda parts: rb.Sum(tuple(parts))
)
maybe, sometimes = st.none() | positive, st.just(0.0) | positive
motors = st.one_of(
    st.none(),
    st.builds(Servo, gain=positive, torque_limit=maybe, armature=sometimes),
    st.builds(PositionServo, positive, sometimes, torque_limit=maybe, armature=sometimes),
    st.builds(Torque, armature=sometimes),
    st.builds(Free, sometimes, sometimes, rest=numbers(), armature=sometimes),
)
texts = st.text(st.characters(exclude_categories=["Cs"]))


@st.composite
def scenes(draw: st.DrawFn) -> rb.Scene:
    """Any bodies, rates, motors and starts."""
    bodies = draw(shells()), draw(frames), tuple(draw(st.lists(rotors(), max_size=2)))
    hung = tuple(draw(st.lists(pendulums, max_size=2)))
    try:
        ball = Ball(*bodies, hung)
    except rb.InputError:  # bodies of such different sizes that the whole is one of them, rounded
        reject()
    moved = [draw(motors) for _ in ball.named_bodies[1:]]
    # What a free hinge is commanded is not used, and not written.
    told = [0.0 if isinstance(motor, Free) else draw(rates) for motor in moved]
    angles = np.array([draw(sometimes) for _ in moved])
    turned = (
        np.array([draw(numbers()) for _ in moved]) if any(moved) and draw(st.booleans()) else None
    )
    rolling: Rolling = "rubber" if draw(st.booleans()) else "classical"
    vertical = draw(numbers()) if rolling == "classical" else 0.0
    momentum = np.array([draw(numbers()), draw(numbers()), vertical])
    down = draw(st.just((0.0, 0.0, -1.0)) | units(3).map(lambda v: (v[0], v[1], -abs(v[2]))))
    assume(down[2] < 0)
    return rb.Scene(
        name="any",
        title=draw(texts),
        source=draw(texts),
        ball=ball,
        rolling=rolling,
        frame_rate=told[0],
        rotor_rates=tuple(told[1 : 1 + len(ball.rotors)]),
        pendulum_rates=tuple(told[1 + len(ball.rotors) :]),
        start=Start(draw(units(4)), momentum, angles, turned),
        duration=draw(positive),
        gravity=draw(st.just(9.81) | positive),
        gravity_direction=down,
        friction=draw(st.builds(Friction, maybe, maybe, sometimes)),
        motors=tuple(moved) if any(moved) else (),
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
