"""Random starts with a scene's own M² and (M, γ): on such a level all its long-run motion is."""

import numpy as np

from robotball import Scene
from robotball.errors import check_count, check_seed
from robotball.rotations import Array, multiply


def level_starts(scene: Scene, count: int, seed: int, g: float = 0.0) -> tuple[Array, Array]:
    """Attitudes (n, 4), principal axes, and world momenta (n, 3) on the scene's level of M.

    The scene's own start for a count of 1, else random points of its section g = `g`.
    """
    from robotball.qualitative.sections import section_starts  # compiled code takes a while to come

    check_count("starts", count, 1)
    check_seed(seed)
    M = scene.start.momentum
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    if count == 1:
        return attitude[None], M[None]
    random, f = np.random.default_rng(seed), float(M @ M)
    L = random.uniform(-1.0, 1.0, count) * np.sqrt(f)
    # The rubber model's M is horizontal by (3.1).
    c = float(M[2]) if scene.rolling == "classical" else 0.0
    return section_starts(L, random.uniform(-np.pi, np.pi, count), f, g, c)
