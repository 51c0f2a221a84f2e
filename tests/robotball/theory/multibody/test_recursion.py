"""The recursive derivative, against sums over all bodies with dense matrices."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from robotball.robot.ball import Ball, Hinge, Link, Shell
from robotball.robot.drives import Sine
from robotball.robot.motors import Servo
from robotball.robot.scene import Friction, Scene, Start
from robotball.rotations import Array
from robotball.theory.multibody.derivative import HINGES, MOMENTUM, Modes
from robotball.theory.multibody.system import System
from tests.random_balls import cloud_inertia, random_axis
from tests.random_robots import MODELS, random_tree
from tests.robotball.theory.multibody.sums_over_bodies import Sums, differentiate
from tests.robots import turning

pytestmark = pytest.mark.core

T = 0.3  # s, at which drives and plane move
LEAST = 0.1  # SI units
FRICTIONS = (
    Friction(), Friction(0.3), Friction(None, 0.05), Friction(rolling=0.01),
    Friction(0.3, 0.05, 0.01),
)  # fmt: skip
MOVED = {
    "plane_motion": (Sine(amplitude=0.5, frequency=1.0), 0.3, Sine(amplitude=1.0, frequency=2.0)),
    "plane_rotation": Sine(amplitude=1.0, frequency=1.0),
}


def branched(rng: np.random.Generator, links: int, branches: float) -> Scene:
    """Return links that each hang on the last one, or with a probability on any body.

    A tenth are slides, and every third joint has a prescribed rate.
    """
    a, reach, names, hinges = 0.3, 0.1 / links**0.5, ["shell"], []
    for i in range(links):
        parent = names[-1] if rng.random() >= branches else names[rng.integers(len(names))]
        names.append(f"link{i}")
        m, centre, pivot = 1 / links, reach * random_axis(rng), reach * random_axis(rng)
        inertia = cloud_inertia(rng, m, 0.2 * a)
        link = Link(
            names[-1], parent, m, inertia, pivot + centre, random_axis(rng), pivot,
            slides=rng.random() < 0.1,
        )  # fmt: skip
        command = Sine(amplitude=rng.uniform(0.2, 1), frequency=rng.uniform(0.1, 0.5))
        motor = None if i % 3 == 2 else Servo(0.02, armature=0.002)
        hinges.append(Hinge(link, command, motor, rng.uniform(-1, 1), rng.uniform(-1, 1)))
    shell = Shell(a, 1.0, 0.05, 0.06, random_axis(rng), offset=0.02)
    start = Start(np.eye(4)[0], np.zeros(3))
    rolling = MODELS[rng.integers(2)]
    scene = Scene("tree", "", "", Ball(shell, tuple(hinges)), rolling, start, duration=1.0)
    return turning(scene, rng.normal(size=3))


def any_state(rng: np.random.Generator, system: System) -> Array:
    """Return the state at the start, with other numbers in place of zeros.

    The momenta along the joints stay, because others of this size would turn light links fast.
    """
    change = 0.1 * system.scale * rng.normal(size=system.size)
    change[HINGES + system.count : HINGES + 2 * system.count] = 0.0
    change[MOMENTUM + 2] *= system.spins or system.scene.rolling == "classical"
    return system.start() + change


def recursive(system: System, state: Array) -> Sums:
    """Return the derivative and the readings of the package."""
    rate, readings = system.rate(T, state), system.readings(T, state)._asdict()
    return Sums(rate, *(readings[name].copy() for name in Sums._fields[1:]))


def apart(system: System, one: Sums, other: Sums) -> float:
    """Return the largest difference of a quantity, relative to its size.

    The size is at least LEAST, and that of the plane's force at least the weight.
    """
    h, weight = system.count, system.scene.ball.mass * system.scene.gravity
    ends = [0, 4, 6, 9, 10, HINGES + h, HINGES + 2 * h, HINGES + 3 * h, system.size]
    pairs = [(one.rate[a:b], other.rate[a:b], LEAST) for a, b in pairwise(ends) if a < b]
    pairs += [(one.force, other.force, weight)]
    pairs += [(ours, theirs, LEAST) for ours, theirs in zip(one[2:], other[2:], strict=True)]
    return max(
        float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), least))
        for ours, theirs, least in pairs
    )


def check(system: System, state: Array) -> None:
    """Compare with the sums, to 3e-13 or 30 times the change by a rounding of the state."""
    ours = recursive(system, state)
    rounded = recursive(system, np.nextafter(state, np.inf))
    bound = max(3e-13, 30 * apart(system, ours, rounded))
    assert apart(system, ours, differentiate(system, T, state)) < bound < 1e-10


@pytest.mark.parametrize("branches", [0.0, 0.4, 1.0])
def test_trees_of_one_to_forty_links_have_the_derivative_of_their_sums(branches: float) -> None:
    """A chain, a tree, and short branches.

    Measured up to 2e-14, but 7e-14 and 8e-13 in a chain of 20 and 40: rounding, which grows along a
    chain. A rounding of the state changes as much.
    """
    rng = np.random.default_rng(5)
    for links in (1, 2, 5, 10, 20, 40):
        system = System(branched(rng, links, branches))
        check(system, any_state(rng, system))


@pytest.mark.parametrize("friction", FRICTIONS, ids=str)
@pytest.mark.parametrize("plane", [{}, MOVED], ids=["still", "moved"])
def test_all_modes_have_the_derivative_of_their_sums(
    friction: Friction, plane: dict[str, Any]
) -> None:
    """Rolling, standing, beginning to roll, slip, and its begin; on a plane that moves and turns.

    Measured up to 7e-14, for the acceleration of slip, and to 1.2e-13 with NumPy 2.5: rounding.
    """
    rng = np.random.default_rng(6)
    for framed in (True, False):
        for rolling in MODELS:
            scene, still = random_tree(rng, framed), Start(np.eye(4)[0], np.zeros(3))
            scene = replace(scene, rolling=rolling, start=still, friction=friction, **plane)
            system = System(turning(scene, rng.normal(size=3)))
            for modes in modes_of(system, random_axis(rng)):
                system.modes = modes
                check(system, any_state(rng, system))


def modes_of(system: System, ahead: Array) -> Iterator[Modes]:
    """Yield the modes that a system may have; ahead: direction (3,) in which slip begins."""
    motors = np.zeros(len(system.limits), dtype=np.int64)
    rolls = Modes(motors)
    yield rolls
    yield rolls._replace(motors=motors + np.isfinite(system.limits))
    if system.resistance:
        yield rolls._replace(standing=True)
        yield rolls._replace(toward=np.array([0.6, 0.8, 0.0]))
    if system.scene.may_slip:
        yield rolls._replace(slipping=True)
        yield rolls._replace(slipping=True, ahead=system.weights * ahead[None, None])
