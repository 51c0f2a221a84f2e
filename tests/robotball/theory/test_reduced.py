"""`integrate` by the reduced equations: invariants, accuracy, edges, refusals."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.motion import path_error
from robotball.robot.ball import Ball, Frame, Hinge, Hung, Rotor, Shell
from robotball.robot.drives import Rate
from robotball.robot.formulas import Rolling
from robotball.robot.scene import Start
from robotball.rotations import Array, rotation_matrix
from robotball.theory.ensembles.orbits import Starts, kernel_start
from robotball.theory.ensembles.steppers import PATH
from tests.messages import naming
from tests.scenes import FOUR

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")
STILL = np.array([1.0, 0.0, 0.0, 0.0])
TILTED = np.array([0.8, 0.2, -0.4, 0.4])


def scene_of(
    rolling: Rolling,
    moments: tuple[float, float, float],
    momentum: tuple[float, float, float],
    rotor_rate: float = 30.0,
    duration: float = 2.0,
) -> rb.Scene:
    """A ball of radius 1 m and about 1 kg, with the frame's moments [kg m²] and one rotor."""
    least = min(moments)
    rotor = Rotor(0.1, 1e-3 * least, 1e-3 * least, np.array([1.0, 0.0, 0.0]))
    ball = Ball(
        Shell(1.0, 0.1, 1e-3 * least, 1e-3 * least, np.array([0.0, 0.6, 0.8])),
        (Hinge(Frame(0.8, np.diag(moments)), 1.0), Hinge(rotor, rotor_rate)),
    )
    return rb.Scene(
        name="edge",
        title="",
        source="",
        ball=ball,
        rolling=rolling,
        start=Start(TILTED, np.array(momentum)),
        duration=duration,
    )


def momentum_error(motion: rb.Motion) -> float:
    """Return the change of M since the start, both as recorded and from ω and γ, in world axes.

    Relative to the largest term of M: |M|, |K|, d|Ω| or max(I + d) |ω|, since ω and the principal
    axes carry rounding errors.
    """
    scene, p, start = motion.scene, motion.scene.parameters, motion.scene.start.momentum
    omega, gamma = (v @ scene.principal_axes for v in (motion.angular_velocity, motion.gamma))
    M = np.stack(p.momentum(tuple(omega.T), tuple(gamma.T)), axis=1) @ scene.principal_axes.T
    world = np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), M)
    term = np.linalg.norm(omega, axis=1).max() / min(p.A)
    scale = max(math.hypot(*start), math.hypot(*p.K), p.d * math.hypot(*p.Omega), term)
    return float(np.abs([world - start, motion.momentum - start]).max() / scale)


def length_error(motion: rb.Motion) -> float:
    """How far |q| and |γ| are from 1."""
    units = (motion.attitude, motion.gamma)
    return max(float(np.abs(np.linalg.norm(unit, axis=1) - 1).max()) for unit in units)


EQUAL, FLAT, NEEDLE = (0.3, 0.35, 0.4), (1e6, 1e6, 1.9e6), (1.0, 1e6, 1e6)
EDGES = {
    **{name: rb.load_scene(name) for name in FOUR},
    "A with ratios to 1e6": scene_of("rubber", NEEDLE, (1e6, 2.0, 0.0)),
    "I a millionth of d": scene_of("classical", (1e-6, 1.1e-6, 1.2e-6), (1e-6, 2e-6, 1e-6)),
    "I a million of d": scene_of("classical", FLAT, (1e5, 2e5, 3e5)),
    "M = 0": scene_of("rubber", EQUAL, (0.0, 0.0, 0.0)),
    "M near 0": scene_of("rubber", EQUAL, (1e-200, 0.0, 0.0)),
    "M along γ": scene_of("classical", EQUAL, (0.0, 0.0, 3.0)),
    "f near c²": scene_of("classical", EQUAL, (1e-9, 0.0, 3.0)),
    "a huge K": scene_of("rubber", EQUAL, (1.0, 2.0, 0.0), rotor_rate=1e6),
    "a huge K, classical": scene_of("classical", EQUAL, (1.0, 2.0, 3.0), rotor_rate=1e6),
}


@pytest.mark.parametrize("edge", EDGES)
def test_invariants_hold_to_rounding(edge: str) -> None:
    """M, (M, γ), |q| and |γ| are the start's for every ball that can be followed.

    Rounding of ω(M, γ) and back: measured at most 9e-16 of M, 4.4e-16 of the lengths.
    """
    motion = rb.integrate(EDGES[edge], np.linspace(0.0, 10.0 if edge in FOUR else 0.01, 26))
    assert momentum_error(motion) < 4e-15
    assert length_error(motion) < 2e-15


def test_a_long_motion_agrees_with_a_short_one_and_conserves_the_invariants() -> None:
    """2e4 s, or 1.4e4 rotations, with the compiled step; the first 5 s are compared with scipy.

    Measured 1.1e-13 m, the difference of two tolerances; 3.3e-16 of M and 2.2e-16 of the lengths.
    """
    short = rb.integrate(FIG12, np.array([0.0, 2.5, 5.0]))
    long = rb.integrate(FIG12, np.array([0.0, 2.5, 5.0, 2e4]))
    assert np.abs(long.contact_point[:3] - short.contact_point).max() < 1e-12
    assert momentum_error(long) < 4e-15
    assert length_error(long) < 2e-15


@pytest.mark.parametrize("name", FOUR)
def test_the_error_falls_with_the_tolerance_as_it_is_estimated(name: str) -> None:
    """The slope of log error on log rtol is 1 ± 0.2; the estimate is several times the error.

    Measured slopes 0.92 to 1.15, and estimates 2.6 to 7.6: the step is chosen by an estimate.
    """
    scene, times = rb.load_scene(name), np.linspace(0.0, 10.0, 21)
    right, off, tolerances = rb.integrate(scene, times), [], (1e-8, 1e-10, 1e-12)
    for rtol in tolerances:
        motion = rb.integrate(scene, times, rtol)
        off.append(path_error(motion, right))
        assert 1 < motion.reference_error / off[-1] < 12
    slope = np.polyfit(np.log(tolerances), np.log(off), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.2)


def test_an_error_estimate_is_never_below_a_few_roundings() -> None:
    """It is 8.9e-16 if both motions are equal to the last bit."""
    motion = rb.integrate(FIG12, np.array([0.0, 1.0]))
    assert replace(motion, again=lambda: motion.contact_point).reference_error == 2.0**-50


def right_path(scene: rb.Scene, times: Array) -> Array:
    """Contact points (n, 2) by heyoka's Taylor series, in steps to 1e-19 of long doubles."""
    hy = pytest.importorskip("heyoka")  # for Linux alone
    from bench.kernels import equations_of, pars_of

    starts = Starts(*kernel_start(scene))
    # The ball's numbers are parameters: heyoka compiles once for each rolling model, and in compact
    # mode in a tenth of the time.
    stepper = hy.taylor_adaptive(
        equations_of(PATH, scene.parameters),
        np.array([*starts.attitudes[0], 0.0, 0.0], dtype=np.longdouble),
        fp_type=np.longdouble,
        tol=np.longdouble(1e-19),
        compact_mode=True,
        pars=pars_of(starts)[0].astype(np.longdouble),
    )
    states = stepper.propagate_grid(times.astype(np.longdouble))[5]
    return starts.turned_back(np.array(states[None, :, 4:], dtype=float))[0]


@pytest.mark.parametrize(
    ("name", "duration"),
    [*((name, 10.0) for name in FOUR), ("fig12", 1000.0), ("classical_regular", 1000.0)],
)
def test_the_estimate_is_of_the_size_of_the_error(name: str, duration: float) -> None:
    """Against steps in 80-bit numbers, by scipy's steps and by the compiled ones.

    Rounding dominates, and differs in the two runs. Measured 0.13 to 2.1 over the variants of
    `make test-variants`; with Python 3.14 0.06 to 2.
    """
    scene, times = rb.load_scene(name), rb.sample_times(duration)
    motion = rb.integrate(scene, times)
    off = np.linalg.norm(motion.contact_point - right_path(scene, times), axis=1).max()
    assert 0.05 < off / motion.path_scale / motion.reference_error < 3


def turned(scene: rb.Scene, axes: Rotation, heading: Rotation) -> rb.Scene:
    """Return the ball with the frame's own axes turned, v_new = R v, in another heading."""
    R, ball, start = axes.as_matrix(), scene.ball, scene.start
    attitude = heading * Rotation.from_quat(start.attitude, scalar_first=True) * axes.inv()
    frame = Frame(ball.frame.mass, R @ ball.frame.inertia @ R.T)
    bodies = (frame, *(replace(rotor, axis=R @ rotor.axis) for rotor in ball.rotors))
    return replace(
        scene,
        ball=Ball(
            shell=replace(ball.shell, axis=R @ ball.shell.axis),
            hinges=ball.with_hinges(body=bodies).hinges,
        ),
        start=Start(attitude.as_quat(scalar_first=True), heading.apply(np.array(start.momentum))),
    )


@pytest.mark.parametrize("name", FOUR)
def test_neither_axes_nor_heading_nor_samples_change_the_motion(name: str) -> None:
    """The heading rotates the path, the axes rotate ω and γ; samples change no bit of the end.

    Other principal axes round differently in every step: measured 1.6e-14 m, 1.1e-14 in γ and
    8.2e-14 rad/s, of 20.
    """
    scene, times = rb.load_scene(name), np.linspace(0.0, 2.0, 11)
    axes, heading = Rotation.from_euler("zyx", (0.7, -1.1, 2.9)), Rotation.from_euler("z", -2.3)
    plain, other = (rb.integrate(s, times) for s in (scene, turned(scene, axes, heading)))
    dense = rb.integrate(scene, np.linspace(0.0, 2.0, 501))
    assert plain.contact_point[-1].tolist() == dense.contact_point[-1].tolist()
    path = plain.contact_point @ heading.as_matrix()[:2, :2].T
    assert np.abs(other.contact_point - path).max() < 5e-14
    assert np.abs(other.gamma - plain.gamma @ axes.as_matrix().T).max() < 5e-14
    omega = plain.angular_velocity @ axes.as_matrix().T
    assert np.abs(other.angular_velocity - omega).max() < 3e-13


@pytest.mark.parametrize("equations", ["reduced", "multibody"])
def test_the_fraction_that_is_known_is_shown(equations: Literal["reduced", "multibody"]) -> None:
    """It grows from step to step and stays below 1: a stiff motor may take minutes."""
    shown: list[float] = []
    rb.integrate(FIG12, np.array([0.0, 8.0]), equations=equations, progress=shown.append)
    assert len(shown) > 1
    assert shown == sorted(set(shown))
    assert shown[-1] < 1


def at(*times: float) -> rb.Motion:
    return rb.integrate(FIG12, np.array(times))


QUICK = scene_of("rubber", EQUAL, (1e6, 2e6, 0.0))  # it turns too often for a thousand steps
SINE = rb.Sine(amplitude=1.0, frequency=1.0)
OFTEN = "1000 t 1.…e+06~rad/s max_steps"
REFUSED = {
    "at([0.0, 1.0])": "duration two (1,~2)",
    "at(0.1, 0.2)": "0 0.1",
    "at(0.0, 2.0, 1.5)": "1.5 2",
    "at(0.0, np.inf)": "times finite",
    "rb.integrate(QUICK, max_steps=1000)": OFTEN,
    "rb.integrate(QUICK.with_hinges(command={'frame': SINE}), max_steps=1000)": OFTEN,
    "rb.integrate(scene_of('rubber', EQUAL, (1e60, 0.0, 0.0)))": "rad/s 1e+50",
    "rb.integrate(scene_of('rubber', EQUAL, (0.0, 0.0, 0.0), duration=1e20))": "1e+20~s 1e+21",
    "rb.integrate(FIG12, rtol=0.0)": "rtol 1e-15 1 0",
    "rb.integrate(FIG12, rtol=1.0)": "rtol less 1",
    "rb.integrate(FIG12, equations='reduce')": "'reduce' reduced",
    "rb.design((1e-140,) * 3, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), radius=1.0)": (
        "A 1e-50 1e+50~1/(kg~m²)"
    ),
    "rb.design((1.0,) * 3, (0.0, 0.0, 1.0), (1e170, 0.0, 0.0), radius=1.0)": "K 1e+50 1e+170",
}


@pytest.mark.parametrize(("snippet", "facts"), REFUSED.items())
def test_impossible_motions_are_refused(snippet: str, facts: str) -> None:
    """With the value and the remedy; a ball beyond 1e50 rad/s is refused before the first step."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        eval(snippet, globals())


def any_scene(rng: np.random.Generator) -> rb.Scene:
    """Bodies, rates and momenta over hundreds of decades; half of them within the usual twenty."""
    decades = float(rng.choice([3.0, 10.0, 10.0, 45.0, 150.0]))

    def size(most: float = 150.0) -> float:
        """A positive number over so many decades either side of 1."""
        return float(10 ** rng.uniform(-min(decades, most), min(decades, most)))

    def signed() -> float:
        return float(rng.choice([-1.0, 0.0, 1.0])) * size()

    def direction() -> Array:
        return rng.choice([*rotation_matrix(TILTED), *np.eye(3)])

    def rate() -> Rate:
        ramp = rb.Ramp(final=signed(), initial=signed(), end=size())
        sine = rb.Sine(amplitude=signed(), frequency=size(), mean=signed())
        return (signed(), ramp, sine)[rng.integers(3)]

    radius, mass = size(100.0), size()
    parts = [mass, *(mass * size(9.0) for _ in range(rng.integers(4)))]
    axial = [part * radius * radius * rng.uniform(0.1, 1.0) for part in parts]
    x, y, z = mass * radius**2 * 10 ** rng.uniform(-min(decades, 20.0), 0.0, 3)
    axes = rotation_matrix(rng.choice([STILL, TILTED]))
    inertia = axes @ np.diag([y + z, x + z, x + y]) @ axes.T
    shell = Shell(radius, mass, axial[0], axial[0] * 10 ** rng.uniform(-0.3, 3.0), direction())
    frame = Frame(mass, (inertia + inertia.T) / 2)
    rotors = [Rotor(m, j, j, direction()) for m, j in zip(parts[1:], axial[1:], strict=True)]
    bodies: list[Hung] = [frame, *rotors]
    ball = Ball(shell, tuple(map(Hinge, bodies)))
    rolling: Rolling = ("rubber", "classical")[rng.integers(2)]
    momentum = direction() * ball.d * signed() * [1.0, 1.0, float(rolling == "classical")]
    ball = ball.with_hinges(command=[rate() for _ in parts])
    return rb.Scene(
        name="any",
        title="",
        source="",
        ball=ball,
        rolling=rolling,
        duration=size(),
        gravity=size(),
        start=Start(rng.choice([STILL, TILTED]), momentum),
    )


@pytest.mark.filterwarnings("error")
def test_any_scene_gives_finite_numbers_or_one_line() -> None:
    """No traceback, no warning, no number that is not finite, whatever the scene.

    A third finish; the step limit ends most others, and the rest are refused.
    """
    refused: list[str] = []
    for seed in range(100):
        try:
            scene = any_scene(np.random.default_rng(seed))
            motion = rb.integrate(scene, np.array([0.0, 0.3, 1.0]) * scene.duration, max_steps=60)
        except rb.InputError as error:
            refused.append(str(error))
            continue
        loads = motion.loads
        needs = (loads.sliding_friction, loads.torsional_friction, motion.motor_powers)
        for numbers in (motion.contact_point, motion.angular_velocity, *needs):
            assert np.isfinite(numbers).all(), seed
        assert length_error(motion) < 2e-15, seed
    assert 20 < len(refused) < 80
    assert "\n" not in "".join(refused)
