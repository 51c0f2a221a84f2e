"""The rate at which a model's motors settle while the ball rolls."""

import numpy as np

from robotball.engines.mujoco.model import ModelHinge
from robotball.robot.ball import Frame, Rotor
from robotball.robot.motors import SLOW, Law
from robotball.robot.scene import MovedHinge, Scene
from robotball.rotations import Array

_ANGLES = 8  # angles of the pendulums at which the motors' rates are evaluated, 45° apart


def fastest_rate(
    scene: Scene, hinges: tuple[ModelHinge, ...], slips: bool | None, dry: bool = False
) -> float:
    """Return the largest |λ| [1/s] of the hinges' motors about the start, with the ball rolling.

    dry: include the damping of dry friction, which is largest at rest.

    H du/dt = -C u - K φ for the rates u of the shell and of the hinges with such a motor. C has the
    dampings or gains of motors and actuators, K their stiffnesses, and H is the robot's mass matrix
    reduced to a rolling shell and constant rates of the other hinges. If the shell slips, its
    inertia resists the motors less. With pendulums, the result is the largest rate at eight angles.
    At least one hinge must have such a motor.
    """
    moved = [hinge for hinge in hinges if hinge.settles or (dry and hinge.law)]
    gamma = scene.start.to_world[2]
    # A rubber shell does not spin about the vertical, so it only turns about axes orthogonal to γ.
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
    """Return angles (_ANGLES,) [rad] of the hinge: commanded angles, or a whole turn."""
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
