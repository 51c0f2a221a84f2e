"""The attractors of section 5.3, drawn by either engine by the same recipe.

A recipe says from which starts, drawn by a seed, after how many returns, and how many crossings
are taken.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robotball import InputError, preset
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.settings import Settings
from robotball.engines.reduced.compiled.kernels import LONG_RUN_TOLERANCE, Integers
from robotball.parameters import Parameters
from robotball.qualitative.motion_section import joined
from robotball.qualitative.sections import section, section_starts
from robotball.rotations import Array, rotation_matrix
from validation.studies.attractors.clouds import states
from validation.studies.attractors.contact_map import own_start, returns

# An attractor forgives a longer step as well: 3e-5 of a path in 10 s at this one, in a third of
# the time that "fast" takes. The contact's time constant must not be below two steps.
COARSE: Settings = replace(
    preset("fast"), name="coarse", timestep=0.05, solref=(0.1, 1.0), error_tolerance=1e-3
)


@dataclass(frozen=True)
class Recipe:
    """A cloud of section points: from `starts` starts, `count` crossings of each after `skipped`.

    f = M² (kg m²/s)², of every start; direction: of the crossings, ±1 or 0 for both.
    """

    f: float
    starts: int
    skipped: int
    count: int
    direction: int = 1

    def points(self, seed: int) -> tuple[Array, Array]:
        """Attitudes (starts, 4) and world momenta (starts, 3), evenly over the annulus."""
        random = np.random.default_rng(seed)
        L = random.uniform(-1.0, 1.0, self.starts) * np.sqrt(self.f)
        return section_starts(L, random.uniform(-np.pi, np.pi, self.starts), self.f)


@dataclass(frozen=True)
class Torus:
    """Where a limit torus crosses g = 0: from `starts` starts evenly within `spread` of (L, l).

    spread is in kg m²/s and rad; f, skipped, count, direction as in Recipe.
    """

    L: float
    l: float
    spread: float
    f: float
    starts: int
    skipped: int
    count: int
    direction: int = 1

    def points(self, seed: int) -> tuple[Array, Array]:
        """Attitudes (starts, 4) and world momenta (starts, 3)."""
        offsets = np.random.default_rng(seed).uniform(-self.spread, self.spread, (2, self.starts))
        return section_starts(self.L + offsets[0], self.l + offsets[1], self.f)


@dataclass(frozen=True)
class Cloud:
    """Section points of one engine: `states` (n, 6), as in clouds.py; L, l and directions (n,);
    and, from MuJoCo, the mean velocity (starts, 2) of the contact point along OX = -M/√f and OY,
    m/s.
    """

    states: Array
    L: Array
    l: Array
    directions: Integers
    velocities: Array


def cloud_by_equations(parameters: Parameters, recipe: Recipe | Torus, seed: int) -> Cloud:
    """The recipe's cloud by the equations; raises InputError where a start gives too few points."""
    attitudes, momenta = recipe.points(seed)
    total = recipe.skipped + recipe.count
    found = section(
        parameters, attitudes, momenta, total, 0.0, recipe.direction, LONG_RUN_TOLERANCE
    )
    if found.status.any():
        raise InputError(f"{np.count_nonzero(found.status)} starts do not keep crossing g = 0")
    late = slice(recipe.skipped, None)
    axes = rotation_matrix(found.attitudes[:, late].reshape(-1, 4))
    M = np.einsum("nji,nj->ni", axes, np.repeat(momenta, recipe.count, axis=0))
    L, l = found.L[:, late].ravel(), found.l[:, late].ravel()
    directions = found.directions[:, late].ravel()
    return Cloud(states(axes[:, 2], M), L, l, directions, np.empty((0, 2)))


def cloud_by_contact(
    model: Model, recipe: Recipe | Torus, seed: int, progress: Callable[[float], None] | None = None
) -> Cloud:
    """The same by MuJoCo's contact model; raises InputError where a run has a fault."""
    parts, velocities = [], []
    for i, (attitude, momentum) in enumerate(zip(*recipe.points(seed), strict=True)):
        start = own_start(model.scene, attitude, momentum)
        found, duration, moved = returns(
            model, start, recipe.skipped + recipe.count, recipe.direction
        )
        parts.append(found[recipe.skipped :])
        velocities.append(moved / duration)
        if progress is not None:
            progress((i + 1) / recipe.starts)
    points = joined(parts)
    return Cloud(
        states(points.gamma, points.momenta), points.L, points.l, points.directions,
        np.array(velocities),
    )  # fmt: skip
