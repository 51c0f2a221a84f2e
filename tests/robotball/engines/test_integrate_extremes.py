"""`integrate` at its edges: the singular is refused in a line, the merely fast is finished."""

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, event, given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.drives import Rate
from robotball.equations import Rolling
from robotball.robot import Ball, Frame, Rotor, Shell
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Start

STILL = np.array([1.0, 0.0, 0.0, 0.0])
TILTED = np.array([0.8, 0.2, -0.4, 0.4])


def scene_of(
    rolling: Rolling,
    moments: tuple[float, float, float],
    momentum: tuple[float, float, float],
    rotor_rate: float = 30.0,
    **changes: Any,
) -> rb.Scene:
    """A ball of radius 1 m and about 1 kg, with the frame's moments [kg m²] and one rotor."""
    least = min(moments)
    ball = Ball(
        shell=Shell(1.0, 0.1, 1e-3 * least, 1e-3 * least, np.array([0.0, 0.6, 0.8])),
        frame=Frame(0.8, np.diag(moments)),
        rotors=(Rotor(0.1, 1e-3 * least, 1e-3 * least, np.array([1.0, 0.0, 0.0])),),
    )
    scene = rb.Scene(
        name="edge", title="", source="", ball=ball, rolling=rolling, frame_rate=1.0,
        rotor_rates=(rotor_rate,), start=Start(TILTED, np.array(momentum)), duration=2.0,
    )  # fmt: skip
    return replace(scene, **changes)


def momentum_error(scene: rb.Scene, motion: rb.Motion) -> float:
    """How far M by the motion's ω and γ is from the start's, in world axes, and so (M, γ).

    Relative to the terms that M is the sum of, of |M|, |K|, d|Ω| and max(I + d) |ω| the largest: ω
    is known to rounding of its length only, in axes that are known to rounding only.
    """
    p = scene.parameters
    omega, gamma = (v @ scene.principal_axes for v in (motion.angular_velocity, motion.gamma))
    M = np.stack(p.momentum(tuple(omega.T), tuple(gamma.T)), axis=1) @ scene.principal_axes.T
    world = np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), M)
    start = scene.start.momentum
    term = np.linalg.norm(omega, axis=1).max() / min(p.A)
    scale = max(math.hypot(*start), math.hypot(*p.K), p.d * math.hypot(*p.Omega), term)
    return float(np.abs(world - start).max() / scale)


def length_error(motion: rb.Motion) -> float:
    """How far |q| and |γ| are from 1."""
    units = (motion.attitude, motion.gamma)
    return max(float(np.abs(np.linalg.norm(unit, axis=1) - 1).max()) for unit in units)


EQUAL, FLAT, NEEDLE = (0.3, 0.35, 0.4), (1e6, 1e6, 1.9e6), (1.0, 1e6, 1e6)
UP = rotation_matrix(TILTED)[2]
EDGES = {
    "A with ratios to 1e6": scene_of("rubber", NEEDLE, (1e6, 2.0, 0.0)),
    "A with ratios to 1e6, classical": scene_of("classical", NEEDLE, (1.0, 2e3, 3.0)),
    "I a billionth of d": scene_of("rubber", (1e-9, 1.1e-9, 1.2e-9), (1.0, 2.0, 0.0)),
    "I a millionth of d": scene_of("classical", (1e-6, 1.1e-6, 1.2e-6), (1e-6, 2e-6, 1e-6)),
    "I a million of d": scene_of("classical", FLAT, (1e5, 2e5, 3e5)),
    "M = 0": scene_of("rubber", EQUAL, (0.0, 0.0, 0.0)),
    "M = 0, classical": scene_of("classical", EQUAL, (0.0, 0.0, 0.0)),
    "M near 0": scene_of("rubber", EQUAL, (1e-200, 0.0, 0.0)),
    "M along γ": scene_of("classical", EQUAL, (0.0, 0.0, 3.0)),
    "f near c²": scene_of("classical", EQUAL, (1e-9, 0.0, 3.0)),
    "a huge K": scene_of("rubber", EQUAL, (1.0, 2.0, 0.0), rotor_rate=1e7),
    "a huge K, classical": scene_of("classical", EQUAL, (1.0, 2.0, 3.0), rotor_rate=1e6),
    "a huge M": scene_of("rubber", EQUAL, (1e3, 2e3, 0.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("edge", EDGES)
def test_invariants_hold_at_the_edges(edge: str) -> None:
    """M, (M, γ), |q| and |γ| are the start's at 1e-14 for every ball that can be followed.

    Rounding of ω(M, γ) and back: measured at most 8e-16 of M, 4.4e-16 of the lengths.
    """
    motion = rb.integrate(EDGES[edge], np.linspace(0.0, 0.5, 26))
    assert momentum_error(EDGES[edge], motion) < 4e-15
    assert length_error(motion) < 2e-15


@pytest.mark.slow
def test_a_million_seconds_keep_the_invariants() -> None:
    """A tenth of them here: 7e4 turns at steady rates go to the compiled step.

    Rounding: measured 4.3e-16 of M and 2.2e-16 of the lengths after 1e5 s, 4.8e-16 after 1e6 s.
    """
    scene = rb.load_scene("fig12")
    times = np.array([0.0, 1.0, 1e5])
    motion = rb.integrate(scene, times)
    assert momentum_error(scene, motion) < 4e-15
    assert length_error(motion) < 2e-15
    assert np.abs(motion.momentum - scene.start.momentum).max() < 2e-14


def test_a_long_motion_is_that_of_many_short_ones() -> None:
    """The compiled step takes up where the other leaves: fig12 over 8000 s, after the first 5 s.

    The difference of two tolerances over 5 s; measured 1.1e-13 m.
    """
    scene = rb.load_scene("fig12")
    short = rb.integrate(scene, np.array([0.0, 2.5, 5.0]))
    long = rb.integrate(scene, np.array([0.0, 2.5, 5.0, 8000.0]))
    assert np.abs(long.contact_point[:3] - short.contact_point).max() < 1e-12


def test_a_motion_that_turns_too_often_ends_at_the_step_limit() -> None:
    """The error says how far it came, how fast it turns, what the whole needs, and what to do."""
    fast = scene_of("rubber", EQUAL, (1e6, 2e6, 0.0))
    words = (
        r"1000 steps reach t = \S+ s of 2: the ball turns at 1\.\d+e\+06 rad/s, and the "
        r"whole needs some \S+e\+07 steps; shorten the motion or raise max_steps"
    )
    with pytest.raises(rb.InputError, match=words):
        rb.integrate(fast, max_steps=1000)
    driven = replace(fast, frame_rate=rb.Sine(amplitude=1.0, frequency=1.0))
    with pytest.raises(rb.InputError, match=words):
        rb.integrate(driven, max_steps=1000)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (scene_of("rubber", EQUAL, (1e60, 0.0, 0.0)), r"the ball may turn at .*e\+59 rad/s, of at"),
        (scene_of("classical", (1e-100,) * 3, (1.0, 0.0, 0.0)), r"the ball may turn at .* rad/s"),
    ],
)
def test_what_no_number_can_hold_is_refused(scene: rb.Scene, message: str) -> None:
    """A ball that turns beyond 1e50 rad/s is an InputError, before a step is taken."""
    with pytest.raises(rb.InputError, match=message):
        rb.integrate(scene)


def test_samples_beyond_memory_are_refused() -> None:
    """A duration that would fill the memory with the scene's own times is refused in a line."""
    with pytest.raises(
        rb.InputError, match=r"1e\+20 s would be 5e\+21 samples .* times of your own"
    ):
        rb.integrate(scene_of("rubber", EQUAL, (0.0, 0.0, 0.0), duration=1e20))


def test_a_tolerance_that_cannot_be_judged_is_refused() -> None:
    """Below 1e-15 rounding would be taken for error."""
    with pytest.raises(rb.InputError, match="rtol must be at least 1e-15 and less than 1, not 0"):
        rb.integrate(EDGES["M = 0"], rtol=0.0)


@pytest.mark.parametrize(
    ("A", "K", "message"),
    [
        ((1e-140, 1e-140, 1e-140), 1.0, r"A must lie between 1e-50 and 1e\+50 1/\(kg m²\), not at"),
        ((1.0, 1.0, 1.0), 1e170, r"K must be finite and at most 1e\+50 in size, not 1e\+170"),
    ],
)
def test_numbers_beyond_any_ball_are_not_designed(
    A: tuple[float, float, float], K: float, message: str
) -> None:
    """A design is asked for in the same range as a ball is given in."""
    with pytest.raises(rb.InputError, match=message):
        rb.design(A, (0.0, 0.0, 1.0), (K, 0.0, 0.0), radius=1.0)


# Anything -----------------------------------------------------------------------------------


def powers(decades: float) -> st.SearchStrategy[float]:
    """Positive numbers over so many decades either side of 1."""
    return st.floats(-decades, decades).map(lambda x: float(10**x))


@st.composite
def any_scene(draw: st.DrawFn) -> rb.Scene:
    """Bodies, rates and momenta over hundreds of decades; half of them within the usual twenty."""
    decades = draw(st.sampled_from([3.0, 10.0, 10.0, 45.0, 150.0]))
    size = powers(decades)
    direction = st.sampled_from(list(rotation_matrix(TILTED)) + list(np.eye(3)))
    signed = st.builds(lambda sign, x: sign * x, st.sampled_from([-1.0, 0.0, 1.0]), size)
    radius, mass = draw(powers(min(decades, 100.0))), draw(size)
    moments = st.tuples(*3 * [st.floats(-min(decades, 20.0), 0.0)])

    def rate() -> Rate:
        kinds = (
            signed,
            st.builds(rb.Ramp, final=signed, initial=signed, end=size),
            st.builds(rb.Sine, amplitude=signed, frequency=size, mean=signed),
        )
        return draw(st.sampled_from(kinds).flatmap(lambda kind: kind))

    def moment(part: float) -> float:
        return part * radius * radius * draw(st.floats(0.1, 1.0))

    def tensor(part: float) -> Array:
        x, y, z = (part * radius * radius * 10**e for e in draw(moments))
        axes = rotation_matrix(draw(st.sampled_from([STILL, TILTED])))
        inertia = axes @ np.diag([y + z, x + z, x + y]) @ axes.T
        return (inertia + inertia.T) / 2

    parts = [mass, *(mass * x for x in draw(st.lists(powers(min(decades, 9.0)), max_size=3)))]
    axial = [moment(part) for part in parts]
    ball = Ball(
        Shell(radius, mass, axial[0], axial[0] * draw(st.floats(0.5, 1e3)), draw(direction)),
        Frame(mass, tensor(mass)),
        tuple(Rotor(m, j, j, draw(direction)) for m, j in zip(parts[1:], axial[1:], strict=True)),
    )
    rolling: Rolling = draw(st.sampled_from(("rubber", "classical")))
    momentum = draw(direction) * ball.d * draw(signed)
    return rb.Scene(
        name="any", title="", source="", ball=ball, rolling=rolling, frame_rate=rate(),
        rotor_rates=tuple(rate() for _ in parts[1:]),
        start=Start(
            draw(st.sampled_from([STILL, TILTED])),
            momentum * [1.0, 1.0, 0.0 if rolling == "rubber" else 1.0],
        ),
        duration=draw(size), gravity=draw(size),
    )  # fmt: skip


@pytest.mark.slow
@settings(
    max_examples=500,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(data=st.data())
def test_any_scene_gives_finite_numbers_or_one_line(data: st.DataObject) -> None:
    """No traceback, no warning, no number that is not finite, whatever the scene.

    A third of the examples finish; the step limit ends another third, and the rest are refused.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            scene = data.draw(any_scene())
            motion = rb.integrate(scene, np.array([0.0, 0.3, 1.0]) * scene.duration, max_steps=60)
        except rb.InputError as error:
            message = str(error)
        else:
            loads = motion.loads
            needs = (loads.sliding_friction, loads.torsional_friction, motion.motor_powers)
            for numbers in (motion.contact_point, motion.angular_velocity, *needs):
                assert np.isfinite(numbers).all()
            assert length_error(motion) < 2e-15
            message = "finished"
    event(message[:20])
    assert len(message.splitlines()) == 1
