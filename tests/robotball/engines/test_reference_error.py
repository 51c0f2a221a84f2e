"""The equations' motion states its own error: against heyoka in 80-bit numbers, and by itself."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball import equations as eq
from robotball.motion import path_error
from robotball.rotations import Array, multiply
from tests.scenes import FOUR

with warnings.catch_warnings(action="ignore", category=rb.SceneWarning):  # built by nobody
    SCENES = {name: rb.load_scene(name) for name in rb.catalog()}
    STEADY = [name for name, each in SCENES.items() if each.steady and not each.not_reduced]


def right_path(scene: rb.Scene, times: Array) -> Array:
    """Contact points (n, 2) by heyoka's Taylor series, in steps to 1e-19 of long doubles.

    The ball's numbers are parameters, so that heyoka compiles once for each rolling model.
    """
    hy = pytest.importorskip("heyoka")  # for Linux alone
    p = scene.parameters
    q, path = hy.make_vars("w", "x", "y", "z"), hy.make_vars("X", "Y")
    numbers = (*p.A, *p.I, *p.Omega, *p.K, *scene.start.momentum, p.d, p.a)
    A, I, Omega, K, momentum = ((hy.par[i], hy.par[i + 1], hy.par[i + 2]) for i in range(0, 15, 3))
    d, a = hy.par[15], hy.par[16]
    alpha, beta, gamma = axes = eq.space_axes((q[0], q[1], q[2], q[3]))
    M = eq.seen_from_frame(momentum, axes)
    omega = (
        eq.rubber_angular_velocity(M, gamma, Omega, K, A)
        if scene.rolling == "rubber"
        else eq.classical_angular_velocity(M, gamma, Omega, K, A, I, d)
    )
    rates = (
        *eq.attitude_rate((q[0], q[1], q[2], q[3]), omega),
        *eq.contact_velocity(alpha, beta, omega, Omega, a),
    )
    start = [*multiply(scene.start.attitude, scene.principal_quaternion), 0.0, 0.0]
    stepper = hy.taylor_adaptive(
        list(zip((*q, *path), rates, strict=True)),
        np.array(start, dtype=np.longdouble),
        fp_type=np.longdouble,
        tol=np.longdouble(1e-19),
        pars=np.array(numbers, dtype=np.longdouble),
    )
    states = stepper.propagate_grid(times.astype(np.longdouble))[5]
    return np.array(states[:, 4:], dtype=float)


def against_heyoka(scene: rb.Scene, times: Array) -> float:
    """The true path error over the estimated one."""
    motion = rb.integrate(scene, times)
    off = np.linalg.norm(motion.contact_point - right_path(scene, times), axis=1).max()
    return float(off / motion.path_scale / motion.reference_error)


@pytest.mark.slow
@pytest.mark.parametrize("name", STEADY)
def test_the_estimate_is_of_the_size_of_the_error(name: str) -> None:
    """On every steady scene of (3.2) and (3.3); rounding dominates, and differs in the two runs.

    Measured 0.13 to 2.1 over the variants of `make test-variants`; with Python 3.14 0.06 to 2.
    """
    scene = rb.load_scene(name)
    assert 0.05 < against_heyoka(scene, scene.times) < 3


@pytest.mark.slow
@pytest.mark.parametrize("duration", [100.0, 1000.0])
@pytest.mark.parametrize("name", ["classical_regular", "fig12"])
def test_the_estimate_holds_over_long_times(name: str, duration: float) -> None:
    """By scipy's steps and by the compiled ones; measured 0.15 to 1.3."""
    assert 0.1 < against_heyoka(rb.load_scene(name), rb.sample_times(duration)) < 3


def test_two_motions_that_agree_by_chance_leave_rounding() -> None:
    """No error is below a few roundings: 8.9e-16, where the other motion is the same to the bit."""
    motion = rb.integrate(rb.load_scene("fig05b"))
    assert replace(motion, again=lambda: motion.contact_point).reference_error == 2.0**-50


@pytest.mark.parametrize("rtol", [1e-12, 1e-8])
@pytest.mark.parametrize("name", FOUR)
def test_a_looser_motion_tells_a_larger_error(name: str, rtol: float) -> None:
    """The negative control: of truncation the estimate is several times the error itself."""
    scene = rb.load_scene(name)
    motion = rb.integrate(scene, rtol=rtol)
    right = path_error(motion, rb.integrate(scene))
    assert 1 < motion.reference_error / right < 12  # measured 2.2 to 7.1
