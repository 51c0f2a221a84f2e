"""The integrators of a MuJoCo model: their orders, how far a step may go, and their marks.

Limits are of a rate times the timestep, None where an integrator has none: beyond it a step makes
grow what should keep its size or die out. The measurements behind them are in step_limits.py.
"""

from dataclasses import dataclass

RK4_REAL, RK4_IMAGINARY = 2.785, 2.828  # where |1 + z + z²/2 + z³/6 + z⁴/24| = 1 on the axes
EXPLICIT_REAL = 2.0  # where |1 - z| = 1


@dataclass(frozen=True)
class Integrator:
    """One way to step a model.

    order            of its error in the timestep, for a smooth motion
    rotation_limit   of a rotation's rate
    friction_limit   of the rate at which slip dies out
    servo_limit      of a velocity servo's rate, its gain over the inertia
    momentum_loss    (p, f): of |M|, a step at the rotation θ loses or gains the part f θᵖ
    marker, size     in plots; a large mark holds the smaller ones of the same error
    own              whether it is MuJoCo's own; scipy's drives MuJoCo's forward dynamics
    """

    name: str
    order: int
    rotation_limit: float | None = None
    friction_limit: float | None = None
    servo_limit: float | None = None
    momentum_loss: tuple[int, float] | None = None
    marker: str = "o"
    size: float = 6.0
    own: bool = True


_FIRST, _FOURTH = (2, 1 / 2), (6, 1 / 144)  # of the momentum lost
INTEGRATORS = {
    each.name: each
    for each in (
        Integrator("Euler", 1, None, EXPLICIT_REAL, EXPLICIT_REAL, _FIRST, "o", 11.0),
        Integrator("implicit", 1, None, EXPLICIT_REAL, None, _FIRST, "v"),
        Integrator("implicitfast", 1, None, EXPLICIT_REAL, None, _FIRST, "s"),
        Integrator("discrete", 1, None, None, EXPLICIT_REAL, _FIRST, "x", 4.0),
        Integrator("RK4", 4, RK4_IMAGINARY, RK4_REAL, RK4_REAL, _FOURTH, "D"),
        Integrator("DOP853", 8, marker="^", size=7.0, own=False),
    )
}
ADAPTIVE = "DOP853"
OWN = tuple(each.name for each in INTEGRATORS.values() if each.own)
FIRST_ORDER = tuple(each.name for each in INTEGRATORS.values() if each.order == 1)
MUJOCOS_DEFAULT = "Euler"
