"""Errors of a motion; processing long motions in pieces changes no number and saves memory."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
import robotball.motion
from robotball.engines.mujoco import stepping
from robotball.motion import _PIECE, attitude_error, gamma_error, momentum_error, path_error
from robotball.rotations import Array, multiply
from robotball.theory.reduced import motion_of
from tests.messages import naming

FIG12 = rb.load_scene("fig12")
MEASURES = (path_error, attitude_error, gamma_error, momentum_error)


@pytest.mark.parametrize(
    ("axis", "angle", "of_gamma"),
    [([0.0, 0.0, 1.0], 0.2, 0.0), ([0.6, 0.8, 0.0], 0.3, 0.3), ([0.0, 1.0, 0.0], 2 * np.pi, 0.0)],
)
def test_each_error_has_its_scale(axis: list[float], angle: float, of_gamma: float) -> None:
    """Metres over the path length, radians for frame and vertical, and M over its magnitude, 5.

    At the motion's times, every other sample of the reference.
    """
    theory = rb.integrate(FIG12, np.linspace(0.0, 2.0, 21))
    turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])
    length = np.linalg.norm(np.diff(theory.contact_point, axis=0), axis=1).sum()
    off = replace(
        theory,
        times=theory.times[::2],
        contact_point=(theory.contact_point + np.outer(theory.times, [0.3, 0.4]))[::2],
        attitude=multiply(turn, theory.attitude)[::2],
        momentum=(theory.momentum + np.outer(theory.times, [0.0, 1.0, 0.0]))[::2],
    )
    assert path_error(off, theory) == pytest.approx(0.5 * 2.0 / length, rel=1e-12)
    assert attitude_error(off, theory) == pytest.approx(angle % (2 * np.pi), abs=1e-12)
    assert gamma_error(off, theory) == pytest.approx(of_gamma, abs=1e-12)
    assert momentum_error(off, theory) == pytest.approx(2.0 / 5.0, rel=1e-12)
    with pytest.raises(rb.InputError, match=naming("0.1~s")):
        path_error(theory, off)


def arrays(motion: rb.Motion) -> dict[Any, Array]:
    return dict(robotball.motion.arrays_of(motion))


@pytest.mark.parametrize("scene", ["classical_regular", "wobbling_drive"])
def test_pieces_do_not_change_a_bit(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compares both motions with all loads and reports, and every error of the two.

    Piece sizes are multiples of the four numbers that BLAS adds at once.
    """
    of, times, found = rb.load_scene(scene), rb.sample_times(2.0), []
    for size in (_PIECE, 32):
        monkeypatch.setattr(robotball.motion, "_PIECE", size)
        monkeypatch.setattr(stepping, "_LOOK", size)
        theory, motion = rb.integrate(of, times), rb.simulate(of, times, settings="fast")
        measures = {measure.__name__: np.array(measure(motion, theory)) for measure in MEASURES}
        found.append([arrays(theory), arrays(motion), measures])
    for whole, parts in zip(*found, strict=True):
        assert whole.keys() == parts.keys()
        for name, values in whole.items():
            assert np.array_equal(values, parts[name]), name


def test_a_run_that_ends_early_keeps_its_first_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every array has as many rows as there are times."""
    monkeypatch.setattr(stepping, "_LOOK", 4)
    slippery = replace(rb.preset("fast"), sliding_friction=0.6)
    stopped = rb.simulate(FIG12, settings=slippery)
    assert 4 < len(stopped.times) < len(FIG12.times)  # slips at 0.12 s
    assert {len(array) for array in arrays(stopped).values()} == {len(stopped.times)}


def test_a_long_motion_needs_little_more_memory_than_its_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """50 000 samples of 184 bytes: 301 bytes each to compute, 37 and 22 to compare.

    The comparison holds one piece of 8192 samples, with the nine entries of its matrices.
    """
    count = 50_000
    monkeypatch.setattr(robotball.motion, "_PIECE", 8192)
    times = np.linspace(0.0, 1000.0, count)
    states = np.random.default_rng(0).normal(size=(count, 6))

    def peak_of(work: Callable[[], object]) -> int:
        """Return the peak allocation of some work [bytes], including its result."""
        tracemalloc.start()
        kept = work()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        del kept
        return peak

    motion = motion_of(FIG12, times, states)
    assert sum(array.nbytes for array in arrays(motion).values()) == 184 * count
    assert peak_of(lambda: motion_of(FIG12, times, states)) < 350 * count
    assert peak_of(lambda: gamma_error(motion, motion)) < 40 * count
    assert peak_of(lambda: attitude_error(motion, motion)) < 30 * count
