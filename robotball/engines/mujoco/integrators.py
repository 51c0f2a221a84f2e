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
    own              whether it is MuJoCo's own; scipy's drives MuJoCo's forward dynamics
    rotation_limit   of a rotation's rate
    friction_limit   of the rate at which slip dies out
    servo_limit      of a velocity servo's rate, its gain over the inertia
    momentum_loss    (p, f): of |M|, a step at the rotation θ loses or gains the part f θᵖ
    marker, size     in plots; a large mark holds the smaller ones of the same error
    """

    name: str
    order: int
    own: bool = True
    rotation_limit: float | None = None
    friction_limit: float | None = None
    servo_limit: float | None = None
    momentum_loss: tuple[int, float] | None = None
    marker: str = "o"
    size: float = 6.0


INTEGRATORS: dict[str, Integrator] = {
    each.name: each
    for each in (
        Integrator(
            "Euler",
            order=1,
            friction_limit=EXPLICIT_REAL,
            servo_limit=EXPLICIT_REAL,
            momentum_loss=(2, 1 / 2),
            marker="o",
            size=11.0,
        ),
        Integrator(
            "implicit",
            order=1,
            friction_limit=EXPLICIT_REAL,
            momentum_loss=(2, 1 / 2),
            marker="v",
        ),
        Integrator(
            "implicitfast",
            order=1,
            friction_limit=EXPLICIT_REAL,
            momentum_loss=(2, 1 / 2),
            marker="s",
        ),
        Integrator(
            "discrete",
            order=1,
            servo_limit=EXPLICIT_REAL,
            momentum_loss=(2, 1 / 2),
            marker="x",
            size=4.0,
        ),
        Integrator(
            "RK4",
            order=4,
            rotation_limit=RK4_IMAGINARY,
            friction_limit=RK4_REAL,
            servo_limit=RK4_REAL,
            momentum_loss=(6, 1 / 144),
            marker="D",
        ),
        Integrator("DOP853", order=8, own=False, marker="^", size=7.0),
    )
}
ADAPTIVE = "DOP853"
OWN = tuple(each.name for each in INTEGRATORS.values() if each.own)
FIRST_ORDER = tuple(each.name for each in INTEGRATORS.values() if each.order == 1)
MUJOCOS_DEFAULT = "Euler"
