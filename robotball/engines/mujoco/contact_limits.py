"""Edges of the contact and of the hinges: friction, softness, and what numbers can hold."""

import numpy as np

from robotball.drives import turns
from robotball.engines.mujoco.planned_run import Case, Edge, momentum_scale
from robotball.engines.mujoco.settings import Prescribed
from robotball.rotations import Array

LARGEST_STATE = 1e10  # mjMAXVAL: MuJoCo calls a larger position, velocity or control bad
LEAST_DETERMINANT = 1e-10  # below it MuJoCo's noslip solver takes the contact for singular


def sliding_friction(case: Case) -> Edge | None:
    """μ ≥ |F_horizontal|/N: what the motion by (2.4) asks of the plane.

    At the start if that is all that is known, so that a demand which grows later is not seen.
    """
    if not case.balanced:
        return None
    return Edge(
        "sliding friction",
        case.settings.sliding_friction,
        float(case.loads.sliding_friction.max()),
        "the ball slips; give sliding_friction more",
        least=True,
    )


def torsional_friction(case: Case) -> Edge | None:
    """μ_t ≥ |λ₀|/N for rubber; with less the ball spins under drag, and that is not rubber."""
    if not case.balanced or case.scene.rolling != "rubber" or case.condim < 4:
        return None
    return Edge(
        "torsional friction",
        case.settings.torsional_friction,
        float(case.loads.torsional_friction.max()),
        "the ball spins on the spot; give torsional_friction more",
        "m",
        least=True,
    )


def contact_dimension(case: Case) -> Edge | None:
    """Rubber needs the torsional row: with condim 3 the ball is the classical one."""
    if case.scene.rolling != "rubber":
        return None
    return Edge(
        "condim", case.condim, 4, "the rubber model needs a torsional row; leave condim None",
        least=True,
    )  # fmt: skip


def drag(case: Case) -> Edge | None:
    """Rows that the rolling model has not eat M: dM/dt = -μ m g, with the μ of the row [m].

    Rolling friction with condim 6 in both models, torsional friction in the classical one, which
    may spin. The part that is gone by the end, at most.
    """
    eats = case.settings.rolling_friction if case.condim >= 6 else 0.0
    if case.scene.rolling == "classical" and case.condim >= 4:
        eats += case.settings.torsional_friction
    if not eats:
        return None
    weight = case.scene.ball.mass * case.scene.gravity
    return Edge(
        "the part of M that rolling and torsional friction may eat",
        eats * weight * case.duration / case.momentum_scale,
        case.settings.promise,
        "neither rolling model has that friction; leave condim None",
    )


def frame_as_root(case: Case) -> Edge | None:
    """The slip of a model whose root is the frame, over the speed: |a (ω×Ω)×γ|/(b v).

    The contact rows' J̇v term, which MuJoCo leaves out, is a(ω×Ω)×γ when the shell hangs on a
    hinge; friction that takes slip away at the rate b lets so much of it stand. M keeps its value
    all the while: it is measured, not rolled. Measured 0.6 to 3.5 times what is predicted, for the
    start's numbers stand for the whole motion's.
    """
    if case.settings.root == "shell" or not case.balanced:
        return None
    left_out = np.cross(case.angular_velocity, case.parameters.Omega)
    acceleration = case.scene.ball.radius * float(np.linalg.norm(np.cross(left_out, case.axes[2])))
    return Edge(
        "the part of the path that a model with the frame as root slips",
        _slip(case, acceleration),
        case.settings.promise,
        'take root="shell"',
    )


def creep(case: Case) -> Edge | None:
    """The slip that soft friction needs to carry its load, over the speed; noslip takes it away.

    A row of impedance d gives its force with a deviation of (1 - d)/d of the acceleration α that
    the force makes: divided by impratio in an elliptic cone, times μ² in a pyramidal one, whose
    edges lean that far. So b v = (1 - d)/d α. Measured within 3 % on fig12, and a sixth of it on
    classical_regular, whose force is not always that of the start.
    """
    if case.noslip or not case.balanced:
        return None
    softness = (1 - case.impedance) / case.impedance
    if case.cone == "elliptic":
        softness /= case.impratio
    else:
        softness *= case.settings.sliding_friction**2
    force = float(np.linalg.norm(case.loads.contact_force[:, :2], axis=1).max())
    return Edge(
        "the part of the path that soft friction lets the ball creep",
        _slip(case, softness * force * inverse_inertia(case)[0, 0]),
        case.settings.promise,
        "give noslip_iterations 1 with an elliptic cone, or solimp nearer to 1",
    )


def _slip(case: Case, acceleration: float) -> float:
    """The mean slip over the speed under an acceleration [m/s²] that the friction's damping meets.

    dv/dt = α - b v from rest has the mean α/b (1 - (1 - exp(-bT))/(bT)) over the time T.
    """
    b, T = case.friction_damping, case.duration
    grown = 1 + np.expm1(-b * T) / (b * T) if b * T > 1e-4 else b * T / 2
    speed = float(np.linalg.norm(case.rolling_velocity))
    return _ratio(acceleration * (grown / b if b else T / 2), speed)


def noslip_determinant(case: Case) -> Edge | None:
    """MuJoCo's noslip solver skips a contact with det(D A D) < 1e-10, in silence.

    A (n, n) is the inverse inertia that the friction rows feel and D their coefficients; so it
    stops where the ball is heavy, some 1e6 kg at μ = 20. Measured: the path is right to 2e-7 at a
    nearness of 0.08 (rubber) and 0.7 (classical), and wrong by more than its length at 2.3.
    """
    if not case.noslip or case.cone != "elliptic":
        return None
    rows = case.condim - 1
    slide, spin, roll = (
        case.settings.sliding_friction,
        case.settings.torsional_friction,
        case.settings.rolling_friction,
    )
    scale = np.diag([slide, slide, spin, roll, roll][:rows])
    return Edge(
        "the determinant of the friction's inverse inertia",
        float(np.linalg.det(scale @ inverse_inertia(case)[:rows, :rows] @ scale)),
        LEAST_DETERMINANT,
        "MuJoCo's noslip solver takes it for singular; scale the masses down or the friction up",
        least=True,
    )


def inverse_inertia(case: Case) -> Array:
    """(5, 5): accelerations of slip, spin and roll by unit forces and torques, world axes.

    Of the ball with its hinges held; slip is at the contact, a below the centre.
    """
    ball = case.scene.ball
    turning = case.axes @ np.diag(1 / np.array(case.parameters.I)) @ case.axes.T
    x, y, z = np.eye(3)
    arm = np.array([0.0, 0.0, -ball.radius])
    linear = np.array([x, y, *np.zeros((3, 3))])
    angular = np.array([np.cross(arm, x), np.cross(arm, y), z, x, y])
    return linear @ linear.T / ball.mass + angular @ turning @ angular.T


def start_depth(case: Case) -> Edge | None:
    """The lever arm's error of a start just touching, over the radius: half of it is in the path.

    The contact carries the weight at the depth p = g (1 - d)/(d² k), into which the ball falls.
    A start in equilibrium has it as the pair's margin, and the lever arm is a.
    """
    if case.settings.start_in_equilibrium:
        return None
    return Edge(
        "the depth into which the ball falls, over its radius",
        equilibrium_depth(case) / case.scene.ball.radius,
        2 * case.settings.promise,
        "set start_in_equilibrium",
    )


def first_step(case: Case) -> Edge | None:
    """The slip that a start just touching begins with, α dt, over the speed that M is worth.

    MuJoCo finds no contact at depth zero, so for one step the contact point has the acceleration
    that friction should have taken from it, and slip dies out slowly. Measured 0.38 to 0.56 of it
    on six scenes, in proportion to dt.
    """
    if case.settings.start_in_equilibrium or not case.balanced or not np.isfinite(case.timestep):
        return None
    force = float(np.linalg.norm(case.loads.contact_force[0, :2]))
    slip = force * float(inverse_inertia(case)[0, 0]) * case.timestep
    return Edge(
        "the slip that the first step makes, over the speed",
        slip / (momentum_scale(case.scene) * case.scene.ball.radius / case.scene.ball.d),
        case.settings.promise,
        "set start_in_equilibrium",
    )


def equilibrium_depth(case: Case) -> float:
    """p = g (1 - d)/(d² k) [m], at which a contact of impedance d carries the weight."""
    d, (stiffness, _) = case.impedance, case.normal_reference
    if stiffness == 0:
        return np.inf
    return case.scene.gravity * (1 - d) / (d * d * stiffness)


def solver_tolerance(case: Case) -> Edge | None:
    """A solver that measures itself by the huge armatures stops before it has begun.

    Newton's stops where the gradient over the sum of the inertias, armatures included, is below the
    tolerance, and without a force yet the gradient is m g d/(1 - d). Measured: right at 2 and
    nothing at 20 times that; CG, which goes by the cost as well, stops a hundred times earlier.
    PGS always takes its first iteration, and that is enough.
    """
    drive = case.settings.drive
    if not isinstance(drive, Prescribed) or case.solver == "PGS":
        return None
    hinges = sum(turns(drive) for drive in case.scene.drives) - len(case.scene.motors)
    d, weight = case.impedance, case.scene.ball.mass * case.scene.gravity
    return Edge(
        "the solver's tolerance times the armatures",
        case.tolerance * drive.armature * max(hinges, 0),
        weight * d / (1 - d) / (1 if case.solver == "Newton" else 100),
        "the solver stops before it has begun: give tolerance 0, or solver PGS",
    )


def servo_droop(case: Case) -> Edge | None:
    """A velocity servo gives torque only for an error of its rate: τ/kv, relative to the rate.

    Measured 0.75 to 0.99 of that, where it is small.
    """
    if not case.servos or not case.balanced:
        return None
    own = case.scene.motors or (None,) * len(case.scene.drives)
    worst = 0.0
    for i, servo in case.servos:
        rate = abs(float(case.scene.drives[i].rate(0.0)))
        torque = float(np.abs(case.loads.motor_torques[:, i]).max())
        if own[i] is None and rate:  # an error of the scene's own motor belongs to the motion
            worst = max(worst, torque / servo.gain / rate)
    return Edge(
        "the part of its rate that a servo loses under its load",
        worst,
        case.settings.promise,
        "take a higher gain, or prescribe the rate",
    )


def largest_number(case: Case) -> Edge | None:
    """MuJoCo calls a coordinate, a rate or a control beyond 1e10 bad.

    The path by the speed of the start, the angles that the hinges turn through, and what the
    actuators are told.
    """
    rates = [abs(float(drive.rate(0.0))) for drive in case.scene.drives]
    speed = float(np.linalg.norm(case.rolling_velocity))
    told = [abs(float(drive.acceleration(0.0))) for drive in case.scene.drives]
    reach = max(1.0, case.duration)
    return Edge(
        "the largest coordinate, rate or control",
        max(speed * reach, *(rate * reach for rate in rates), *told, case.rotation_rate),
        LARGEST_STATE,
        "MuJoCo takes more for a bad state; choose other units or a shorter run",
    )


def _ratio(part: float, whole: float) -> float:
    if part == 0:
        return 0.0
    return part / whole if whole else np.inf


EDGES = (
    sliding_friction, torsional_friction, contact_dimension, drag, frame_as_root, creep,
    noslip_determinant, start_depth, first_step, solver_tolerance, servo_droop,
    largest_number,
)  # fmt: skip
