"""Numbers for the laws of `limits` that no formula gives, from trials at the start.

They are the loads and eigenvalues of MuJoCo's model, the rate at which the motors settle while the
ball rolls, and the momentum that RK4 loses in a short run.
"""

from dataclasses import replace

import mujoco
import numpy as np

from robotball.engines.mujoco.control import read_row
from robotball.engines.mujoco.model import ModelHinge, build
from robotball.engines.mujoco.readings import readings_of
from robotball.engines.mujoco.settings import Settings, recipe
from robotball.engines.mujoco.stepping import by_steps, controlled
from robotball.errors import InputError
from robotball.robot.ball import Frame, Rotor
from robotball.robot.loads import Loads
from robotball.robot.motors import SLOW, Law
from robotball.robot.scene import MovedHinge, Scene
from robotball.rotations import Array

# Half step of central differences, a velocity [m/s or rad/s] or an angle [rad]. Both its square and
# rounding divided by it are far below the digits of a prediction.
_PUSH = 1e-6
_MOST_STEPS = 500  # of the short run; the loss of a longer run is extrapolated in proportion
_ANGLES = 8  # angles of the pendulums at which the motors' rates are evaluated, 45° apart


def linearised_start(scene: Scene, settings: Settings) -> tuple[Loads, Array]:
    """Return the loads of a model at the start, and its eigenvalues (2 nv - 3,) there [1/s].

    A small deviation grows or decays with the real part and oscillates with the imaginary part.
    """
    # With unlimited friction the loads show how much friction the motion needs.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(scene.ideal, replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = readings_of(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The position on the plane has no effect, and the contact determines the height.
        for of_angle, i in [(True, i) for i in range(3, nv)] + [(False, i) for i in range(nv)]:
            sides = []
            for push in (_PUSH, -_PUSH):
                data.qpos[:], data.qvel[:] = qpos, qvel
                if of_angle:
                    mujoco.mj_integratePos(compiled, data.qpos, np.eye(nv)[i], push)
                else:
                    data.qvel[i] += push
                mujoco.mj_forward(compiled, data)
                sides.append(data.qacc.copy())
            columns.append((sides[0] - sides[1]) / (2 * _PUSH))
    if not np.isfinite(columns).all():
        raise InputError(
            f"{scene.name}: MuJoCo's accelerations are not finite at the start: bring the "
            "positions and masses of the bodies nearer to the ball's radius and mass"
        )
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # The deviation of the attitude is in axes that turn with the shell.
    turning[:3, :3] = -np.cross(qvel[3:6], np.eye(3)).T  # -ω×
    return loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T]))


def fastest_rate(
    scene: Scene, hinges: tuple[ModelHinge, ...], slips: bool, dry: bool = False
) -> float:
    """Return the largest |λ| [1/s] of the hinges' motors about the start, with the ball rolling.

    dry: with the damping of dry friction, which is largest at rest.

    H du/dt = -C u - K φ for the rates u of the shell and of the hinges with such a motor. C has the
    dampings or gains of motors and actuators, K their stiffnesses, and H is the robot's mass matrix
    reduced to a rolling shell and constant rates of the other hinges. A shell that slips resists
    them less. With pendulums it is the largest over eight angles. At least one hinge has such a
    motor.
    """
    moved = [hinge for hinge in hinges if hinge.settles or (dry and hinge.law)]
    gamma = scene.start.to_world[2]
    # A rubber shell does not spin about the vertical, so it turns about axes across γ only.
    spins = slips or scene.rolling == "classical"
    turns = np.eye(3) if spins else np.linalg.svd(gamma[None])[2][1:]
    angles = np.stack([_angles(scene, hinge) for hinge in scene.hinges], axis=1)
    still, upright = np.zeros_like(angles), np.tile(gamma, (_ANGLES, 1))
    stands = scene.robot.states(upright, angles, np.zeros_like(upright), still)
    rows = [0, 1, 2, *(3 + hinge.index for hinge in moved)]
    free, n = len(turns), len(moved)
    onto = np.zeros((free + n, 3 + n))
    onto[:free, :3], onto[free:, 3:] = turns, np.eye(n)

    def damping_of(law: Law) -> float:
        return law.per_rate + dry * law.friction / SLOW

    laws = [hinge.law for hinge in moved if hinge.law]
    stiffness = np.diag([law.per_angle for law in laws])
    damping = np.diag([damping_of(law) for law in laws])
    for actuator in scene.actuators:
        gears = dict(actuator.gears)
        ratios = np.array([gears.get(hinge.name, 0.0) for hinge in moved])
        stiffness = stiffness + actuator.law.per_angle * np.outer(ratios, ratios)
        damping = damping + damping_of(actuator.law) * np.outer(ratios, ratios)
    matrices = stands.matrix
    if slips:
        across = np.eye(3) - np.outer(gamma, gamma)
        pushed = np.einsum("kl,kin,ljn->ijn", across, stands.pushes, stands.pushes)
        matrices = np.concatenate([matrices, matrices - pushed / scene.ball.mass], axis=2)
    worst = 0.0
    for matrix in matrices.transpose(2, 0, 1):
        H = onto @ matrix[np.ix_(rows, rows)] @ onto.T
        back = np.linalg.solve(H, np.eye(free + n)[:, free:])
        # First order in (φ, u): springs act on the angles of hinges, dampers on their rates.
        system = np.zeros((2 * n + free, 2 * n + free))
        system[:n, n + free :] = np.eye(n)
        system[n:, :n], system[n:, n + free :] = -back @ stiffness, -back @ damping
        worst = max(worst, float(np.abs(np.linalg.eigvals(system)).max()))
    return worst


def _angles(scene: Scene, hinge: MovedHinge) -> Array:
    """Return angles (_ANGLES,) [rad] that the hinge passes: as commanded, else a whole turn."""
    if isinstance(dict(scene.ball.named_bodies)[hinge.name], Frame | Rotor):
        return np.full(_ANGLES, hinge.angle)
    times = np.linspace(0.0, scene.duration, _ANGLES - 1)
    moved = [(1.0, hinge.motor.law, hinge.command)] if hinge.motor else []
    for actuator, command in zip(scene.actuators, scene.controls, strict=True):
        moved += [(ratio, actuator.law, command) for n, ratio in actuator.gears if n == hinge.name]
    for ratio, law, command in moved:
        if law.per_command and ratio and law.per_angle:
            to = law.per_command / law.per_angle / ratio
            return np.array([hinge.angle, *(to * command.rate(times))])
        if law.per_command and ratio and law.per_rate:
            to = law.per_command / law.per_rate / ratio
            return hinge.angle + np.array([0.0, *(to * command.angle(times))])
    return hinge.angle + np.linspace(0.0, 2 * np.pi, _ANGLES, endpoint=False)


def momentum_loss(scene: Scene, timestep: float, duration: float) -> float:
    """Estimate the relative loss of momentum with RK4 over a duration [s]; infinite if it diverges.

    The estimate is from a short run of the recipe's model, which takes some 60 ms.
    """
    count = duration / timestep
    steps = float(min(np.ceil(count), _MOST_STEPS))
    model = build(scene.ideal, recipe("look", 1.0, timestep=timestep))
    with controlled(model) as control, np.errstate(all="ignore"):
        portions = by_steps(control, model.start_data(), np.array([0.0, steps * timestep]))
        M = np.concatenate([readings_of(model, portion.rows).momentum for portion in portions])
        lost = float(np.linalg.norm(M - M[0], axis=1).max()) / scene.momentum_scale
    return lost * max(1.0, count / steps) if lost < np.inf else np.inf
