"""Limits of the contact: friction, softness, and what numbers can hold."""

import numpy as np

from robotball.engines.mujoco.planned_run import Laws, LimitCheck, PlannedRun
from robotball.engines.mujoco.settings import Prescribed
from robotball.rotations import Array

LARGEST_STATE = 1e10  # mjMAXVAL: MuJoCo calls a larger position, velocity or control bad
LEAST_DETERMINANT = 1e-10  # below it MuJoCo takes a contact's friction for singular


def sliding_friction(plan: PlannedRun) -> LimitCheck | None:
    """μ ≥ |F_horizontal|/N: what the motion by (2.4) asks of the plane.

    At the start if that is all that is known, so that a demand which grows later is not seen.
    """
    return LimitCheck(
        "sliding friction",
        plan.friction[0],
        float(plan.loads.sliding_friction.max()),
        "the ball slips; give sliding_friction more",
        least=True,
    )


def torsional_friction(plan: PlannedRun) -> LimitCheck | None:
    """μ_t ≥ |λ₀|/N for rubber; with less the ball spins under drag, and that is not rubber."""
    if plan.scene.rolling != "rubber" or plan.condim < 4:
        return None
    return LimitCheck(
        "torsional friction",
        plan.friction[1],
        float(plan.loads.torsional_friction.max()),
        "the ball spins on the spot; give torsional_friction more",
        "m",
        least=True,
    )


def contact_dimension(plan: PlannedRun) -> LimitCheck | None:
    """Rubber needs the torsional row: with condim 3 the ball is the classical one."""
    if plan.scene.rolling != "rubber":
        return None
    return LimitCheck(
        "condim", plan.condim, 4, "the rubber model needs a torsional row; leave condim None",
        least=True,
    )  # fmt: skip


def drag(plan: PlannedRun) -> LimitCheck | None:
    """Rows that the rolling model has not eat M: dM/dt = -μ m g, with the μ of the row [m].

    Rolling friction with condim 6 in both models, torsional friction in the classical one, which
    may spin. The part that is gone by the end, at most.
    """
    eats = plan.friction[2] if plan.condim >= 6 else 0.0
    if plan.scene.rolling == "classical" and plan.condim >= 4:
        eats += plan.friction[1]
    if not eats:
        return None
    weight = plan.scene.ball.mass * plan.scene.gravity
    return LimitCheck(
        "the part of M that rolling and torsional friction may eat",
        eats * weight * plan.duration / plan.scene.momentum_scale,
        plan.settings.error_tolerance,
        "neither rolling model has that friction; leave condim None",
    )


def frame_as_root(plan: PlannedRun) -> LimitCheck | None:
    """The slip of a model whose root is the frame, over the speed: |a (ω×Ω)×γ|/(b v).

    The contact rows' J̇v term, which MuJoCo leaves out, is a(ω×Ω)×γ when the shell hangs on a
    hinge; friction that takes slip away at the rate b lets so much of it stand. M keeps its value
    all the while: it is measured, not rolled. Measured 0.6 to 3.5 times what is predicted, for the
    start's numbers stand for the whole motion's.
    """
    if plan.settings.root == "shell" or not plan.reduced:
        return None
    left_out = np.cross(plan.angular_velocity, plan.Omega)
    acceleration = plan.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, plan.axes[2])))
    return LimitCheck(
        "the part of the path that a model with the frame as root slips",
        _slip(plan, acceleration),
        plan.settings.error_tolerance,
        'take root="shell"',
    )


def creep(plan: PlannedRun) -> LimitCheck | None:
    """The slip that soft friction needs to carry its load, over the speed; noslip takes it away.

    A row of impedance d gives its force with a deviation of (1 - d)/d of the acceleration α that
    the force makes: divided by impratio in an elliptic cone, times μ² in a pyramidal one, whose
    edges lean that far. So b v = (1 - d)/d α. Measured within 3 % on fig12, and a sixth of it on
    classical_regular, whose force is not always that of the start.
    """
    if plan.noslip or not plan.reduced:
        return None
    softness = (1 - plan.impedance) / plan.impedance
    if plan.cone == "elliptic":
        softness /= plan.impratio
    else:
        softness *= plan.friction[0] ** 2
    force = float(np.linalg.norm(plan.loads.contact_force[:, :2], axis=1).max())
    return LimitCheck(
        "the part of the path that soft friction lets the ball creep",
        _slip(plan, softness * force * inverse_inertia(plan)[0, 0]),
        plan.settings.error_tolerance,
        "give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1",
    )


def _slip(plan: PlannedRun, acceleration: float) -> float:
    """The mean slip over the speed under an acceleration [m/s²] that the friction's damping meets.

    dv/dt = α - b v from rest has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = plan.friction_damping, plan.duration
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > 1e-4 else b * T / 2
    speed = float(np.linalg.norm(plan.rolling_velocity))
    return _ratio(acceleration * (grown / b if b else T / 2), speed)


def friction_block(plan: PlannedRun) -> LimitCheck | None:
    """MuJoCo's PGS and noslip take a contact's friction for singular below 1e-10, in silence.

    Both solve the block of its friction rows in an elliptic cone: D A D, with A the inverse inertia
    that the rows feel and D their coefficients. PGS adds their softness, (1 - d)/d A_nn μ²/impratio
    in every row. With two or three rows the determinant must be 1e-10, with five each pivot of
    Cholesky's. Below that PGS gives no friction, and noslip leaves what slip there is. A goes with
    1/m: the limit is at 2e6 kg on fig12 with μ = 20, at 1e4 kg with μ = 1.4. Measured on five
    settings: right at 0.95 of that mass, and off by the whole path at 1.05; on classical_regular,
    whose A does not stay the start's, right at half of it.
    """
    if plan.cone != "elliptic" or not (plan.noslip or plan.solver == "PGS"):
        return None
    rows = plan.condim - 1
    slide, spin, roll = plan.friction
    scale = np.diag([slide, slide, spin, roll, roll][:rows])
    block = scale @ inverse_inertia(plan)[:rows, :rows] @ scale
    if not plan.noslip:
        softness = plan.settings.softness * (1 - plan.impedance) / plan.impedance
        normal = 1 / plan.scene.ball.mass
        block += softness * normal * slide**2 / plan.impratio * np.eye(rows)
    minors = np.array([np.linalg.det(block[:n, :n]) for n in range(1, rows + 1)])
    value = minors[-1] if rows < 5 else (minors / [1.0, *minors[:-1]]).min()
    name = "noslip" if plan.noslip else "PGS"
    return LimitCheck(
        "the determinant of the friction's inverse inertia"
        if rows < 5
        else "the least pivot of the friction's inverse inertia",
        float(value),
        LEAST_DETERMINANT,
        f"MuJoCo's {name} solver takes it for singular; scale the masses down or the friction up, "
        "or take solver Newton without noslip",
        least=True,
    )


def inverse_inertia(plan: PlannedRun) -> Array:
    """(5, 5): accelerations of slip, spin and roll by unit forces and torques, world axes.

    Of the ball with its hinges held; slip is at the contact, a below the centre.
    """
    ball = plan.scene.ball
    turning = plan.axes @ np.diag(1 / ball.principal[0]) @ plan.axes.T
    x, y, z = np.eye(3)
    arm = np.array([0.0, 0.0, -ball.radius])
    linear = np.array([x, y, *np.zeros((3, 3))])
    angular = np.array([np.cross(arm, x), np.cross(arm, y), z, x, y])
    return linear @ linear.T / ball.mass + angular @ turning @ angular.T


def start_depth(plan: PlannedRun) -> LimitCheck | None:
    """The lever arm's error of a start just touching, over the radius: half of it is in the path.

    The contact carries the weight at the depth p = g (1 - d)/(d² k), into which the ball falls.
    A start in equilibrium has it as the pair's margin, and the lever arm is a.
    """
    if plan.settings.start_in_equilibrium:
        return None
    return LimitCheck(
        "the depth into which the ball falls, over its radius",
        plan.equilibrium_depth / plan.scene.ball.radius,
        2 * plan.settings.error_tolerance,
        "set start_in_equilibrium",
    )


def first_step(plan: PlannedRun) -> LimitCheck | None:
    """The slip that a start just touching begins with, α dt, over the speed that M is worth.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if plan.settings.start_in_equilibrium or not plan.reduced or not np.isfinite(plan.timestep):
        return None
    force = float(np.linalg.norm(plan.loads.contact_force[0, :2]))
    slip = force * float(inverse_inertia(plan)[0, 0]) * plan.timestep
    return LimitCheck(
        "the slip that the first step makes, over the speed",
        slip / (plan.scene.momentum_scale * plan.scene.ball.radius / plan.scene.ball.d),
        plan.settings.error_tolerance,
        "set start_in_equilibrium",
    )


def solver_tolerance(plan: PlannedRun) -> LimitCheck | None:
    """A solver that measures itself by the huge armatures stops before it has begun.

    Newton's stops where the gradient over the sum of the inertias, armatures included, is below the
    tolerance, and without a force yet the gradient is m g d/(1 - d). Measured: right at 2 and
    nothing at 20 times that; CG, which goes by the cost as well, stops a hundred times earlier.
    PGS always takes its first iteration, and that is enough.
    """
    drive = plan.settings.drive
    if not isinstance(drive, Prescribed) or plan.solver == "PGS":
        return None
    prescribed = [each for each in plan.hinges if not each.own_motor]
    d, weight = plan.impedance, plan.scene.ball.mass * plan.scene.gravity
    return LimitCheck(
        "the solver's tolerance times the armatures",
        plan.tolerance * drive.armature * len(prescribed),
        weight * d / (1 - d) / (1 if plan.solver == "Newton" else 100),
        "the solver stops before it has begun: give tolerance 0, or solver PGS",
    )


def largest_number(plan: PlannedRun) -> LimitCheck | None:
    """MuJoCo calls a coordinate, a rate or a control beyond 1e10 bad.

    The path by the speed of the start, the angles that the hinges turn through, and the controls
    of the actuators.
    """
    rates = [abs(hinge.rate) for hinge in plan.scene.hinges]
    speed = float(np.linalg.norm(plan.rolling_velocity))
    controls = [abs(hinge.control(0.0)) for hinge in plan.hinges]
    reach = max(1.0, plan.duration)
    return LimitCheck(
        "the largest coordinate, rate or control",
        max(speed * reach, *(rate * reach for rate in rates), *controls, plan.rotation_rate),
        LARGEST_STATE,
        "MuJoCo takes more for a bad state; choose other units or a shorter run",
    )


def _ratio(part: float, whole: float) -> float:
    if part == 0:
        return 0.0
    return part / whole if whole else np.inf


# Each prediction with its law, as a legend tells it.
LAWS: Laws = {
    sliding_friction: "μ is at least |F_horizontal|/N",
    torsional_friction: "μ_t is at least |λ₀|/N for rubber",
    contact_dimension: "rubber needs the torsional row, condim 4",
    drag: "rolling and torsional friction eat M at μ m g",
    frame_as_root: "with the frame as root the ball slips by |a (ω×Ω)×γ|/b",
    creep: "soft friction needs slip to carry its load",
    friction_block: "PGS and noslip skip friction with det(D A D) below 1e-10",
    start_depth: "a start just touching falls into the contact",
    first_step: "the first step of a start just touching slips by α dt",
    solver_tolerance: "beside huge armatures a solver stops before it has begun",
    largest_number: "a coordinate, a rate or a control is 1e10 at most",
}
