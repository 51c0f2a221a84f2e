"""Clouds of points of the section g = 0, from MuJoCo and from the equations, and their distances.

A run of many returns in MuJoCo is cut into stretches. Each begins on the constraints and with the
momentum of the start, so that an attractor is seen at its own level of M² however long the run is.
Two clouds are compared by their energy distance, and by its rank among those of clouds that the
equations drew.
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

_STRETCH = 100.0  # s; in it M drifts by a few millionths at most
_NO_RETURN = 100  # stretches without enough crossings, after which a run is given up


def _returns(
    model: Model, start: Start, count: int, direction: int = 1
) -> tuple[Crossings, float, Array]:
    """Return the first `count` crossings of g = 0 in a direction (0: in both).

    Besides, how long the run was [s], and the contact point's displacement (2,) over it [m]. Raises
    InputError where a run has a fault, or does not come back often enough.
    """
    found: list[Crossings] = []
    moved, at = np.zeros(2), start
    # Chaotic returns may be far apart, but not for ever.
    for stretch in range(_NO_RETURN * count):
        motion = sound_run(model, at, each_step(model, _STRETCH))
        some = crossings_of_motion(motion, model.scene).only(direction)
        found.append(some.later(stretch * _STRETCH))
        moved = moved + motion.contact_point[-1]
        # M as it was at first, not at the end: else the run would drift from its level of M², on
        # which the attractor depends.
        at = Start(motion.attitude[-1], start.momentum)
        if sum(len(each.times) for each in found) >= count:
            return joined(found)[:count], (stretch + 1) * _STRETCH, moved
    raise InputError(f"{LABEL.name}'s ball does not come back to the section")


# An attractor forgives a longer step as well: 3e-5 of a path in 10 s at this one, in a third of
# the time that "fast" takes. The contact's time constant must not be below two steps.
COARSE: Settings = replace(
    preset("fast"), name="coarse", timestep=0.05, solref=(0.1, 1.0), error_tolerance=1e-3
)


@dataclass(frozen=True)
class Recipe:
    """A cloud of section points: from `starts` starts, `count` crossings of each after `skipped`.

    f = M² (kg m²/s)² and c = (M, γ) [kg m²/s] of every start; direction: of the crossings, ±1 or 0
    for both.
    """

    f: float
    starts: int
    skipped: int
    count: int
    direction: int = 1
    c: float = 0.0

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3), evenly over the annulus."""
        return random_starts(self.f, self.starts, seed, c=self.c)


@dataclass(frozen=True, kw_only=True)
class Torus(Recipe):
    """The cloud of a limit torus, from starts evenly within `spread` of (L, l) on g = 0.

    spread is in kg m²/s and rad.
    """

    L: float
    l: float
    spread: float

    def points(self, seed: int) -> tuple[Array, Array]:
        """Return attitudes (starts, 4) and world momenta (starts, 3)."""
        offsets = np.random.default_rng(seed).uniform(-self.spread, self.spread, (2, self.starts))
        return section_starts(self.L + offsets[0], self.l + offsets[1], self.f)


def cloud_by_equations(parameters: Parameters, recipe: Recipe, seed: int) -> Crossings:
    """Return the recipe's cloud by the equations.

    Raises InputError where a start gives too few points.
    """
    attitudes, momenta = recipe.points(seed)
    total = recipe.skipped + recipe.count
    found = sections_of(
        parameters, attitudes, momenta, total, 0.0, recipe.direction, LONG_RUN_TOLERANCE
    )
    if found.status.any():
        raise InputError(f"{np.count_nonzero(found.status)} starts do not keep crossing g = 0")
    return found.after(recipe.skipped)


def cloud_by_contact(
    scene: Scene,
    settings: Settings,
    recipe: Recipe,
    seed: int,
) -> tuple[Crossings, Array]:
    """Return the recipe's cloud by MuJoCo, and the mean velocity from each of its starts.

    velocities (starts, 2): of the contact point, along OX = -M/√f and OY [m/s]. Raises InputError
    where a run has a fault.
    """
    parts, velocities, model = [], [], build(scene, settings)
    for attitude, momentum in zip(*recipe.points(seed), strict=True):
        start = own_start(scene, attitude, momentum)
        found, duration, moved = _returns(
            model, start, recipe.skipped + recipe.count, recipe.direction
        )
        parts.append(found[recipe.skipped :])
        velocities.append(moved / duration)
    return joined(parts), np.array(velocities)


_NEIGHBOURS = 8


def distance(cloud: Array, reference: Array) -> float:
    """Return 2E|x - y| - E|x - x'| of clouds (n, k), (m, k).

    That is their energy distance, but for a part that depends on the reference alone.
    """
    return float(2 * cdist(cloud, reference).mean() - cdist(cloud, cloud).mean())


def rank_probability(cloud: Array, peers: Sequence[Array], reference: Array) -> float:
    """Return how probable it is that by chance `cloud` is so far from `reference`, or farther.

    peers: clouds drawn by the very recipe that `cloud` claims to be drawn by, each from starts of
    its own. If the claim is true all of them and `cloud` are exchangeable, so the rank of its
    energy distance from the reference is uniform: exactly, however correlated the points of one
    cloud are. The least value is 1/(1 + number of peers).
    """
    ours = distance(cloud, reference)
    return (1 + sum(distance(peer, reference) >= ours for peer in peers)) / (1 + len(peers))


def distance_to_curve(points: Array, curve: Array) -> Array:
    """Return how far points (n, k) are from a curve given by many points (m, k) of it, (n,).

    The distance is to the straight line that fits the nearest few best. It misses a curve of
    curvature κ by κs²/2 where those few reach s along it.
    """
    _, nearest = cKDTree(curve).query(points, k=_NEIGHBOURS)
    near = curve[nearest]
    # A line through the neighbours, not the nearest of them: the spacing of the points would be
    # taken for a distance.
    middle = near.mean(axis=1, keepdims=True)
    along = np.linalg.svd(near - middle, full_matrices=False)[2][:, 0]
    arm = points - middle[:, 0]
    across = arm - (arm * along).sum(axis=1, keepdims=True) * along
    return np.linalg.norm(across, axis=1)
