"""Families of motions: a ball and its momentum with one or several numbers varied.

`NUMBERS` names the numbers that continuation, charts and diagrams can vary. (3.2) and (3.3) are
linear in (K, Ω, M): scaling all three by s gives the same motion, s times as fast.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robotball.errors import InputError, unknown
from robotball.robot.formulas import Parameters, Rolling, as_vector
from robotball.rotations import Array

# Name: (symbol, unit). K1 to Omega3 are components along principal axes. K and Omega are lengths:
# varying one keeps the direction, or reverses it if negative.
NUMBERS = {
    **{f"K{i}": (f"K{sub}", "kg m²/s") for i, sub in zip("123", "₁₂₃", strict=True)},
    **{f"Omega{i}": (f"Ω{sub}", "rad/s") for i, sub in zip("123", "₁₂₃", strict=True)},
    "K": ("|K|", "kg m²/s"),
    "Omega": ("|Ω|", "rad/s"),
    "f": ("f = M²", "(kg m²/s)²"),
    "c": ("c = (M, γ)", "kg m²/s"),
    # Angles in the plane of two principal axes; the length of the projection is kept.
    **{
        f"{vector}{plane}": (f"angle of ({symbol}{i}, {symbol}{j})", "degrees")
        for vector, symbol in (("K", "K"), ("Omega", "Ω"))
        for plane, i, j in (("12", "₁", "₂"), ("23", "₂", "₃"), ("31", "₃", "₁"))
    },
}
_PLANES = {"12": [0, 1], "23": [1, 2], "31": [2, 0]}


def numbers_of(parameters: Parameters, momentum: Array) -> dict[str, float]:
    """Return all `NUMBERS` of a ball with momentum (3,) kg m²/s, world."""
    K, Omega = parameters.K, parameters.Omega
    lengths = (np.linalg.norm(K), np.linalg.norm(Omega), momentum @ momentum, momentum[2])
    angles = (np.degrees(np.arctan2(v[j], v[i])) for v in (K, Omega) for i, j in _PLANES.values())
    return dict(zip(NUMBERS, map(float, (*K, *Omega, *lengths, *angles)), strict=True))


def varied(
    parameters: Parameters, momentum: Array, changes: Mapping[str, float]
) -> tuple[Parameters, Array]:
    """Return the ball and its world momentum (3,) with the named numbers changed, others kept.

    The horizontal direction of M is kept. Raises InputError for an unknown name, the length of a
    zero vector, a nonzero c in the rubber model, and f <= c².
    """
    vectors = {"K": np.array(parameters.K), "Omega": np.array(parameters.Omega)}
    level = {"f": float(momentum @ momentum), "c": float(momentum[2])}
    for name, value in changes.items():
        if name not in NUMBERS:
            raise unknown("number", name, NUMBERS)
        if name in level:
            level[name] = value
        elif name[-2:] in _PLANES:
            v, plane, turn = vectors[name[:-2]], _PLANES[name[-2:]], np.radians(value)
            v[plane] = np.hypot(*v[plane]) * np.array([np.cos(turn), np.sin(turn)])
        elif name not in vectors:
            vectors[name[:-1]][int(name[-1]) - 1] = value
        elif length := float(np.linalg.norm(vectors[name])):
            vectors[name] *= value / length
        else:
            raise InputError(f"{name} = 0 has no direction to keep: vary {name}1, 2 or 3")
    K, Omega = map(as_vector, vectors.values())
    if level.keys() & changes.keys():  # otherwise M may be zero
        momentum = momentum_across(parameters.rolling, momentum, **level)
    return replace(parameters, K=K, Omega=Omega), momentum


def momentum_across(rolling: Rolling, momentum: Array, f: float, c: float) -> Array:
    """Return M (3,), world, with the given f = M² and c = (M, γ), in the heading of `momentum`."""
    if rolling == "rubber" and c != 0:
        raise InputError(f"c must be 0 in the rubber model (3.1), not {c:g}: vary f instead")
    across = float(np.hypot(*momentum[:2]))
    if not (f > c * c and across > 0):
        raise InputError(
            f"no initial state has c = (M, γ) = {c:g} and f = M² = {f:g}: c² must be below f, and "
            "the scene's M neither vertical nor zero"
        )
    return np.array([*(momentum[:2] * (np.sqrt(f - c * c) / across)), c])
