"""How fast a scene's servos, springs and dampers settle, with the ball rolling under them."""

import numpy as np

import robotball.hinges
from robotball.engines.mujoco.hinges import Hinge
from robotball.motors import Free, PositionServo, Servo
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene

SEEN = 8  # angles at which pendulums are looked at


def fastest_rate(scene: Scene, hinges: tuple[Hinge, ...]) -> float:
    """|λ| [1/s], the largest of the hinges' motors about the start; 0 without such a motor.

    H du/dt = -C u - K φ for the turning u of the shell and of the hinges that have a motor, where
    C holds its damping or gain and K its stiffness; H is the part of the robot's mass matrix that
    is left once the shell rolls, and once the other hinges keep their rates. With pendulums the
    largest as these stand at eight angles that they come by.
    """
    own = [each for each in hinges if isinstance(each.actuation, Servo | PositionServo | Free)]
    if not own:
        return 0.0
    gamma = rotation_matrix(scene.start.attitude)[2]
    turns = np.linalg.svd(gamma[None])[2][1:] if scene.rolling == "rubber" else np.eye(3)
    angles = np.stack([_angles(scene, each) for each in scene.hinges], axis=1)
    still, upright = np.zeros_like(angles), np.tile(gamma, (SEEN, 1))
    stands = scene.robot.states(upright, angles, np.zeros_like(upright), still)
    rows = [0, 1, 2, *(3 + each.index for each in own)]
    free, n = len(turns), len(own)
    onto = np.zeros((free + n, 3 + n))
    onto[:free, :3], onto[free:, 3:] = turns, np.eye(n)
    stiffness, damping = np.array([_constants(each) for each in own]).T
    worst = 0.0
    for matrix in stands.matrix.transpose(2, 0, 1):
        H = onto @ matrix[np.ix_(rows, rows)] @ onto.T
        back = np.linalg.solve(H, np.eye(free + n)[:, free:])
        system = np.zeros((2 * n + free, 2 * n + free))
        system[:n, n + free :] = np.eye(n)
        system[n:, :n], system[n:, n + free :] = -back * stiffness, -back * damping
        worst = max(worst, float(np.abs(np.linalg.eigvals(system)).max()))
    return worst


def _angles(scene: Scene, hinge: robotball.hinges.Hinge) -> Array:
    """(SEEN,) rad: where a servo sends a pendulum, and any other all around."""
    if hinge.name not in dict(scene.ball.named_pendulums):
        return np.full(SEEN, hinge.angle)
    times = np.linspace(0.0, scene.duration, SEEN - 1)
    if isinstance(hinge.motor, PositionServo):
        return np.array([hinge.angle, *hinge.command.rate(times)])
    if isinstance(hinge.motor, Servo):
        return hinge.angle + np.array([0.0, *hinge.command.angle(times)])
    return hinge.angle + np.linspace(0.0, 2 * np.pi, SEEN, endpoint=False)


def _constants(hinge: Hinge) -> tuple[float, float]:
    """Its motor's stiffness [N m/rad] and damping [N m s/rad]."""
    motor = hinge.actuation
    if isinstance(motor, Servo):
        return 0.0, motor.gain
    if isinstance(motor, PositionServo):
        return motor.gain, motor.damping
    assert isinstance(motor, Free)
    return motor.stiffness, motor.damping
