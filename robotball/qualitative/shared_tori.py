"""The tori that a rubber and a classical Chaplygin ball share: Ω = K = 0 and (M, γ) = 0.

Of the rubber ball take ℓ = M×γ, the horizontal part of its angular momentum; of the classical one
ℓ = M. Both are constant in space and across γ. The rubber ball's energy is half of

    J(γ, ℓ) = (Aℓ, ℓ) - (Aγ, ℓ)²/(Aγ, γ),

and that of a classical ball with A' = E/d' - sA, s > 0, half of ℓ²/d' - sJ: each ball keeps the
other's energy. So from the same (γ, ℓ) both motions wind round the same torus, each in its way.
"""

import numpy as np

from robotball.parameters import Parameters
from robotball.rotations import Array


def shared_integral(parameters: Parameters, gamma: Array, level: Array) -> Array:
    """J (n,) at γ and ℓ (n, 3), in principal axes, with the A of the rubber ball [J]."""
    A = np.array(parameters.A)
    weight, mixed = (A * gamma * gamma).sum(axis=1), (A * gamma * level).sum(axis=1)
    return np.asarray((A * level * level).sum(axis=1) - mixed**2 / weight)
