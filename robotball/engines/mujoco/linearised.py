"""A planned run linearised about its start, for numbers of `limits` that no formula gives.

They are the loads and eigenvalues of MuJoCo's own model, the rate at which the motors settle with
the ball rolling under them, and, where rotations about the start say too little, the momentum that
RK4 loses in a short run.
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
from robotball.robot.scene import Friction, MovedHinge, Scene
from robotball.rotations import Array

# The central differences' half step, a velocity [m/s or rad/s] or an angle [rad]: rounding over it
# and its own square are both far below the digits that a prediction needs.
_PUSH = 1e-6


def linearised_start(scene: Scene, settings: Settings) -> tuple[Loads, Array]:
    """Return the loads of a model's start, and its eigenvalues about it.

    The eigenvalues (2 nv - 3,) are complex [1/s]: a small deviation grows or dies out with the real
    part, and turns with the imaginary one.
    """
    # Unlimited friction, so that the loads show how much of it the motion needs.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(replace(scene, friction=Friction()), replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = readings_of(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The place on the plane changes nothing, and the height is the contact's.
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
            f"{scene.name}: at the start MuJoCo has no finite accelerations; bring "
            "the bodies' places and masses nearer to those of the ball"
        )
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # A deviation of attitude is measured in axes that turn with the shell.
    turning[:3, :3] = -np.cross(qvel[3:6], np.eye(3)).T  # -ω×
    return loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T]))


_ANGLES = 8  # angles of the pendulums at which the motors' rates are evaluated, 45° apart


def fastest_rate(scene: Scene, hinges: tuple[ModelHinge, ...]) -> float:
    """Return the largest |λ| [1/s] of the hinges' motors about the start, with the ball rolling.

    H du/dt = -C u - K φ for the turning u of the shell and of the hinges that have a motor, where
    C holds its damping or gain and K its stiffness, and those of the actuators; H is the part of
    the robot's mass matrix that is left once the shell rolls, and once the other hinges keep their
    rates. Where there are pendulums, the largest over eight angles that they pass. At least one
    hinge has such a motor.
    """
    own = [each for each in hinges if each.settles]
    gamma = scene.start.to_world[2]
    # Rubber does not spin about the vertical, so the shell turns in the plane across γ alone.
    turns = np.linalg.svd(gamma[None])[2][1:] if scene.rolling == "rubber" else np.eye(3)
    angles = np.stack([_angles(scene, each) for each in scene.hinges], axis=1)
    still, upright = np.zeros_like(angles), np.tile(gamma, (_ANGLES, 1))
    stands = scene.robot.states(upright, angles, np.zeros_like(upright), still)
    rows = [0, 1, 2, *(3 + each.index for each in own)]
    free, n = len(turns), len(own)
    onto = np.zeros((free + n, 3 + n))
    onto[:free, :3], onto[free:, 3:] = turns, np.eye(n)
    laws = [each.law for each in own if each.law]
    stiffness, damping = map(np.diag, np.array([(law.per_angle, law.per_rate) for law in laws]).T)
    for actuator in scene.actuators:
        gears = dict(actuator.gears)
        ratios = np.array([gears.get(each.name, 0.0) for each in own])
        stiffness = stiffness + actuator.law.per_angle * np.outer(ratios, ratios)
        damping = damping + actuator.law.per_rate * np.outer(ratios, ratios)
    worst = 0.0
    for matrix in stands.matrix.transpose(2, 0, 1):
        H = onto @ matrix[np.ix_(rows, rows)] @ onto.T
        back = np.linalg.solve(H, np.eye(free + n)[:, free:])
        # Of first order in (φ, u): springs act by the hinges' angles, dampers by their rates.
        system = np.zeros((2 * n + free, 2 * n + free))
        system[:n, n + free :] = np.eye(n)
        system[n:, :n], system[n:, n + free :] = -back @ stiffness, -back @ damping
        worst = max(worst, float(np.abs(np.linalg.eigvals(system)).max()))
    return worst


def _angles(scene: Scene, hinge: MovedHinge) -> Array:
    """Return the hinge's angles (_ANGLES,) [rad]: as it is commanded, or else a whole turn."""
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


_MOST_STEPS = 500  # of the short run; the loss of a longer run is extrapolated in proportion


def momentum_loss(scene: Scene, timestep: float, duration: float) -> float:
    """Estimate how much momentum RK4 loses over a duration [s], relative to the scene's scale.

    By steps of the recipe's model, which takes some 60 ms. Infinite where they diverge.
    """
    count = duration / timestep
    steps = float(min(np.ceil(count), _MOST_STEPS))
    model = build(replace(scene, friction=Friction()), recipe("look", 1.0, timestep=timestep))
    with controlled(model) as control, np.errstate(all="ignore"):
        portions = by_steps(control, model.start_data(), np.array([0.0, steps * timestep]))
        M = np.concatenate([readings_of(model, each.rows).momentum for each in portions])
        lost = float(np.linalg.norm(M - M[0], axis=1).max()) / scene.momentum_scale
    return lost * max(1.0, count / steps) if lost < np.inf else np.inf
