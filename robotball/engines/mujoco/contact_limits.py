"""Limits of contacts and starts that differ from the recipe's: laws as in `limits`."""

import numpy as np

from robotball.engines.mujoco.limits import Law, LimitCheck, PlannedRun, inverse_inertia, percent
from robotball.motion import path_unit

_SHORT = 1e-4  # of 1/b: the series' first term replaces a difference that cancels


def contact_dimension(plan: PlannedRun) -> LimitCheck | None:
    """Require condim 4 for rubber, which has the torsional row; with 3 the ball is classical."""
    if plan.scene.rolling != "rubber":
        return None
    warning = (
        f"the ball will spin on the spot: condim is {plan.condim}, and rubber needs 4: leave "
        "condim None"
    )
    return LimitCheck(plan.condim, 4, warning, least=True)


def drag(plan: PlannedRun) -> LimitCheck | None:
    """Predict the part μ m g t of M that rolling and torsional friction take.

    The rolling model has no such rows: rolling friction with condim 6 in both models, and torsional
    friction in the classical one, which may spin. dM/dt = -μ m g at most, with the μ of the row
    [m].
    """
    coefficient = plan.friction[2] if plan.condim >= 6 else 0.0
    if plan.scene.rolling == "classical" and plan.condim >= 4:
        coefficient += plan.friction[1]
    if not coefficient:
        return None
    weight = plan.scene.ball.mass * plan.scene.gravity
    value = coefficient * weight * plan.duration / plan.scene.momentum_scale
    warning = (
        "rolling or torsional friction, which the rolling model does not have, will reduce M by "
        f"about {percent(value)}; {_allowed(plan)}: leave condim None"
    )
    return LimitCheck(value, plan.settings.error_tolerance, warning)


def frame_as_root(plan: PlannedRun) -> LimitCheck | None:
    """Predict the slip |a (ω×Ω)×γ|/(b v) over the speed, of a model whose root is the frame.

    MuJoCo leaves the J̇v term out of its contact rows, which is a(ω×Ω)×γ if the shell hangs on a
    hinge. Friction that reduces slip at the rate b leaves this slip. M stays constant, so it does
    not show the slip. Measured 0.6 to 3.5 times the prediction, which is made from the numbers of
    the start.
    """
    if plan.settings.root == "shell" or not plan.reduced:
        return None
    left_out = np.cross(plan.angular_velocity, plan.Omega)
    acceleration = plan.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, plan.axes[2])))
    value = _slip(plan, acceleration)
    warning = (
        f"with the frame as root the ball will slip off its path by about {percent(value)}; "
        f'{_allowed(plan)}: take root="shell"'
    )
    return LimitCheck(value, plan.settings.error_tolerance, warning)


def creep(plan: PlannedRun) -> LimitCheck | None:
    """Predict the slip (1 - d)/d α/(b v) over the speed, by which soft friction carries its load.

    The noslip solver removes it. A row of impedance d gives its force with a deviation of
    (1 - d)/d of the acceleration α that the force makes: divided by impratio in an elliptic cone,
    times μ² in a pyramidal one, whose edges lean that far. So b v = (1 - d)/d α. Measured within
    3 % on fig12, and a sixth of it on classical_regular, whose force changes during the motion.
    """
    if plan.option("noslip_iterations") or not plan.reduced:
        return None
    softness = (1 - plan.impedance) / plan.impedance
    if plan.option("cone") == "elliptic":
        softness /= plan.option("impratio")
    else:
        softness *= plan.friction[0] ** 2
    force = float(np.linalg.norm(plan.loads.contact_force[:, :2], axis=1).max())
    value = _slip(plan, softness * force * inverse_inertia(plan)[0, 0])
    warning = (
        f"soft friction will let the ball creep off its path by about {percent(value)}; "
        f"{_allowed(plan)}: give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1"
    )
    return LimitCheck(value, plan.settings.error_tolerance, warning)


def _slip(plan: PlannedRun, acceleration: float) -> float:
    """Return the slip over the path, under an acceleration [m/s²] against damping.

    dv/dt = α - b v from rest has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = plan.friction_damping, plan.duration
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > _SHORT else b * T / 2
    path = path_unit(plan.scene, T * float(np.linalg.norm(plan.rolling_velocity)))
    return float(acceleration * (grown / b if b else T / 2) * T / path)


def start_depth(plan: PlannedRun) -> LimitCheck | None:
    """Predict the lever arm's error g (1 - d)/(d² k) over the radius, of a start just touching.

    Half of it is in the path. The contact carries the weight at the depth p = g (1 - d)/(d² k),
    into which the ball falls. A start in equilibrium has this depth as the margin of the pair, and
    the lever arm is a.
    """
    if plan.settings.start_in_equilibrium:
        return None
    value, limit = plan.equilibrium_depth / plan.scene.ball.radius, plan.settings.error_tolerance
    warning = (
        f"the ball will fall into the contact by about {percent(value)} of its radius; "
        f"{percent(2 * limit)} is allowed: set start_in_equilibrium"
    )
    return LimitCheck(value, 2 * limit, warning)


def first_step(plan: PlannedRun) -> LimitCheck | None:
    """Predict the slip α dt over the speed of M, which a start just touching begins with.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if plan.settings.start_in_equilibrium or not plan.reduced or not np.isfinite(plan.timestep):
        return None
    force = float(np.linalg.norm(plan.loads.contact_force[0, :2]))
    slip = force * float(inverse_inertia(plan)[0, 0]) * plan.timestep
    value = slip / (plan.scene.momentum_scale * plan.scene.ball.radius / plan.scene.ball.d)
    warning = (
        f"the ball will slip by about {percent(value)} of its speed in the first step, which finds "
        f"no contact; {_allowed(plan)}: set start_in_equilibrium"
    )
    return LimitCheck(value, plan.settings.error_tolerance, warning)


def _allowed(plan: PlannedRun) -> str:
    return f"{percent(plan.settings.error_tolerance)} is allowed"


LAWS: tuple[Law, ...] = (contact_dimension, drag, frame_as_root, creep, start_depth, first_step)
