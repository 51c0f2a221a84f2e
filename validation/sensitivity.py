"""Sensitivity: whether the motion itself, not the engine, explains how far the two engines part.

The engine is set anew on the equations' motion at equal stretches and followed to the next: what
it misses there, its defect, is all that it can be blamed for. What the motion then makes of a
defect's turn of the attitude is a matter of the equations alone, to first order a linear one:
the turns of all stretches, carried on and added, are the turn to expect.
"""

import math
from dataclasses import dataclass

import numpy as np

from robotball import Motion, Scene, Settings, integrate
from robotball.contact.model import build
from robotball.rotations import Array, conjugate, multiply
from robotball.simulate import run
from robotball.start import Start

# Short beside the time in which a chaotic motion of the catalog doubles a difference, 2 to 6 s.
STRETCH = 2.5  # s
FEWEST, MOST = 8, 64  # stretches
# Twice the time doubles the growth of a regular motion; more than this is exponential.
EXPONENTIAL = 10.0
# How many times the expected error the measured one may be: 0.2 to 2 on the chaotic scenes.
LEEWAY = 10.0


@dataclass(frozen=True)
class Sensitivity:
    """What a motion makes of the engine's small errors, over `duration` s.

    exponent     1/s  of the growth of a small turn of the attitude, over the motion's second half
    doubling     by how much twice the time multiplies that growth; 2 in a regular motion
    defect       of the engine over stretches from states of the equations, over path length
    expected     the path error over path length that defects and growth make together
    measured     the path error over path length
    promise      that the settings are held to
    agrees_until s    when the path error passes the promise
    """

    exponent: float
    doubling: float
    defect: float
    expected: float
    measured: float
    promise: float
    agrees_until: float

    @property
    def explains(self) -> bool:
        """Whether the engine keeps its promise, and the motion's exponential growth does the rest.

        Errors beyond what the growth makes of the defects stay the engine's, and so do all errors
        of a motion that is regular.
        """
        return (
            self.defect <= self.promise
            and self.doubling > EXPONENTIAL
            and self.measured <= LEEWAY * self.expected
        )

    def __str__(self) -> str:
        return (
            f"sensitive: agrees until t = {self.agrees_until:.3g} s, then the motion's own "
            f"sensitivity (exponent {self.exponent:.3g}/s) carries errors of {self.defect:.1e} "
            f"past {self.promise:g}"
        )


def sensitivity(
    scene: Scene, settings: Settings, theory: Motion, path_errors: Array
) -> Sensitivity | None:
    """The sensitivity of a scene's motion to the errors of MuJoCo at some settings.

    theory: the equations' motion; path_errors (n,) m, of MuJoCo at its times. None where the
    drives change in time, where M = 0 and where the ball stays in place: there it is not known.
    Costs as much as the two motions once more.
    """
    if not scene.steady or not scene.start.momentum.any() or not theory.path_length > 0:
        return None
    duration = float(theory.times[-1])
    count = int(np.clip(duration / STRETCH, FEWEST, MOST))
    marks = np.linspace(0.0, duration, count + 1)
    right = integrate(scene, marks)
    paths, turns = _defects(scene, settings, right)
    if not np.isfinite(paths).all():
        return None
    carried, growth = _carried(scene, right, turns)
    # A turn of the frame turns the path with it: the point goes aside as fast as it rolls.
    aside = np.minimum(np.linalg.norm(carried, axis=1), math.pi) * theory.path_length / count
    half = count // 2
    doubling = growth[-1] - growth[half - 1]
    passed = path_errors > settings.promise * theory.path_length
    return Sensitivity(
        exponent=float(doubling / (duration - marks[half])),
        doubling=math.exp(doubling),
        defect=float(paths.sum() / theory.path_length),
        expected=float((aside.sum() + paths.sum()) / theory.path_length),
        measured=float(path_errors.max() / theory.path_length),
        promise=settings.promise,
        agrees_until=float(theory.times[np.argmax(passed)] if passed.any() else duration),
    )


def _defects(scene: Scene, settings: Settings, right: Motion) -> tuple[Array, Array]:
    """What MuJoCo misses at the end of each of k stretches that start on the right motion.

    Of the path (k,) m, and of the attitude (k, 3) rad, a turn in principal axes; infinite where a
    stretch is not run to its end.
    """
    model, count = build(scene, settings), len(right.times) - 1
    paths, turns = np.full(count, math.inf), np.zeros((count, 3))
    for i, length in enumerate(np.diff(right.times)):
        start = Start(right.attitude[i], right.momentum[i])
        engine = run(model, np.array([0.0, length]), start=start)
        if len(engine.times) == 2:
            way = right.contact_point[i + 1] - right.contact_point[i]
            paths[i] = np.linalg.norm(engine.contact_point[1] - engine.contact_point[0] - way)
            w, *turn = multiply(conjugate(right.attitude[i + 1]), engine.attitude[1])
            turns[i] = 2 * math.copysign(1, w) * np.array(turn) @ scene.principal_axes
    return paths, turns


def _carried(scene: Scene, right: Motion, turns: Array) -> tuple[Array, Array]:
    """The turn (k, 3) rad at the end of each of k stretches that small turns before it add up to.

    turns (k, 3): those that each stretch adds at its end. With it the logarithm (k,) of what the
    motion makes of a small turn at its start.
    """
    from robotball.compiled.kernels import TOLERANCE, Starts  # numba, which only this needs
    from robotball.compiled.systems import DEVIATION

    count = len(turns)
    attitudes = multiply(right.attitude[:-1], scene.principal_quaternion)
    # A defect is added where a stretch ends, and the next one carries it on.
    sizes = np.concatenate([[0.0], np.linalg.norm(turns[:-1], axis=1)])
    directions = np.tile([1.0, 0.0, 0.0], (count, 1))
    there = sizes > 0
    directions[there] = turns[:-1][there[1:]] / sizes[there, None]
    starts = Starts(scene.parameters, attitudes, right.momentum[:-1])
    rest = np.concatenate([directions, np.zeros((count, 2))], axis=1)
    states, _ = starts.march(DEVIATION, rest, right.times[1:], TOLERANCE)
    carried = turns.copy()
    for i in range(1, count):
        left = count - i
        growth = sizes[i] * np.exp(states[i, :left, 7])
        carried[i:] += growth[:, None] * states[i, :left, 4:7]
    return carried, states[0, :, 7]
