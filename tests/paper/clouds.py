"""Clouds of points on the section g = 0 from MuJoCo and from the equations, and their distances.

Long runs in MuJoCo are cut into stretches. Each begins on the constraints with the initial
momentum, so that M² does not drift. Two clouds are compared by their energy distance, and by its
rank among the energy distances of clouds from the equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from robotball import InputError, Scene, Settings, preset
from robotball.dynamics.sections import (
    Crossings,
    crossings_of_motion,
    joined,
    own_start,
    section_starts,
    sections_of,
)
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.robot.formulas import Parameters
from robotball.robot.scene import Start
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE
from validation.studies.contact_sections import each_step, random_starts, sound_run

_STRETCH = 100.0  # s, in which M drifts by a few millionths at most
_NO_RETURN = 100  # stretches without enough crossings, after which a run is given up


def _returns(
    model: Model, start: Start, count: int, direction: int = 1
) -> tuple[Crossings, float, Array]:
    """Return the first `count` crossings of g = 0 in a direction (0: in both).

    Also return the run's duration [s] and the contact point's displacement (2,) [m]. Raises
    InputError if a run has a fault or too few crossings.
    """
    parts: list[Crossings] = []
    moved, at = np.zeros(2), start
    # Chaotic returns may be far apart, but not arbitrarily far.
    for stretch in range(_NO_RETURN * count):
        motion = sound_run(model, at, each_step(model, _STRETCH))
        some = crossings_of_motion(motion, model.scene).only(direction)
        parts.append(replace(some, times=some.times + stretch * _STRETCH))
        moved = moved + motion.contact_point[-1]
        # The initial M, not the final one: otherwise M², on which the attractor depends, would
        # drift.
        at = Start(motion.attitude[-1], start.momentum)
        if sum(len(part.times) for part in parts) >= count:
            return joined(parts)[:count], (stretch + 1) * _STRETCH, moved
    raise InputError(f"{LABEL.name}'s ball does not return to the section")


# An attractor tolerates a longer step: a path error of 3e-5 in 10 s, in a third of the time of
# "fast". The contact's time constant must be at least two steps.
COARSE: Settings = replace(
    preset("fast"), name="coarse", timestep=0.05, solref=(0.1, 1.0), error_tolerance=1e-3
)


@dataclass(frozen=True)
class Recipe:
    """A cloud of section points: from each of `starts` starts, `count` crossings after `skipped`.

    f = M² [(kg m²/s)²] and c = (M, γ) [kg m²/s] are those levels; direction: of crossings, ±1, or
    0 for both.
    """

    f: float
    starts: int
    skipped: int
    count: int
    direction: int = 1
    c: float = 0.0

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3), uniform on the annulus."""
        return random_starts(self.f, self.starts, seed, c=self.c)


@dataclass(frozen=True, kw_only=True)
class Torus(Recipe):
    """The cloud of a limit torus, from starts on g = 0 uniformly within `spread` of (L, l).

    spread applies to L [kg m²/s] and l [rad].
    """

    L: float
    l: float
    spread: float

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3)."""
        offsets = np.random.default_rng(seed).uniform(-self.spread, self.spread, (2, self.starts))
        return section_starts(self.L + offsets[0], self.l + offsets[1], self.f)


def cloud_by_equations(parameters: Parameters, recipe: Recipe, seed: int) -> Crossings:
    """Return the recipe's cloud from the equations.

    Raises InputError if a start gives too few points.
    """
    attitudes, momenta = recipe.points(seed)
    total = recipe.skipped + recipe.count
    crossings = sections_of(
        parameters, attitudes, momenta, total, 0.0, recipe.direction, LONG_RUN_TOLERANCE
    )
    if crossings.status.any():
        raise InputError(f"{np.count_nonzero(crossings.status)} starts do not keep crossing g = 0")
    return crossings.after(recipe.skipped)


def cloud_by_contact(
    scene: Scene,
    settings: Settings,
    recipe: Recipe,
    seed: int,
) -> tuple[Crossings, Array]:
    """Return the recipe's cloud from MuJoCo, and the contact point's mean velocities (starts, 2).

    Their axes are OX = -M/√f and OY [m/s]. Raises InputError if a run has a fault.
    """
    parts, velocities, model = [], [], build(scene, settings)
    for attitude, momentum in zip(*recipe.points(seed), strict=True):
        start = own_start(scene, attitude, momentum)
        crossings, duration, moved = _returns(
            model, start, recipe.skipped + recipe.count, recipe.direction
        )
        parts.append(crossings[recipe.skipped :])
        velocities.append(moved / duration)
    return joined(parts), np.array(velocities)


_NEIGHBOURS = 8


def distance(cloud: Array, reference: Array) -> float:
    """Return 2E|x - y| - E|x - x'| of clouds (n, k), (m, k).

    This is their energy distance without the term that depends only on the reference.
    """
    return float(2 * cdist(cloud, reference).mean() - cdist(cloud, cloud).mean())


def rank_probability(cloud: Array, peers: Sequence[Array], reference: Array) -> float:
    """Return the p-value of the distance of `cloud` from `reference`, at least 1/(1 + peers).

    peers: clouds from the recipe that `cloud` should follow, with other starts. If it does, all
    these clouds are exchangeable, so the rank of its energy distance is exactly uniform, however
    correlated the points of a cloud are.
    """
    ours = distance(cloud, reference)
    return (1 + sum(distance(peer, reference) >= ours for peer in peers)) / (1 + len(peers))


def distance_to_curve(points: Array, curve: Array) -> Array:
    """Return the distances (n,) of points (n, k) from a curve through many points (m, k).

    The distance is from the straight line that best fits the 8 nearest points. On a curve of
    curvature κ, where these extend by s, its error is κs²/2.
    """
    _, nearest = cKDTree(curve).query(points, k=_NEIGHBOURS)
    near = curve[nearest]
    # The nearest point alone would add the spacing of the points to the distance.
    middle = near.mean(axis=1, keepdims=True)
    along = np.linalg.svd(near - middle, full_matrices=False)[2][:, 0]
    arm = points - middle[:, 0]
    across = arm - (arm * along).sum(axis=1, keepdims=True) * along
    return np.linalg.norm(across, axis=1)
