"""What the motion by the equations asks of the plane and of the motors."""

import numpy as np

from robotball import equations as eq
from robotball.drives import turns
from robotball.motion import Loads
from robotball.parameters import as_vector
from robotball.rotations import Array
from robotball.scene import Scene


def loads_of(scene: Scene, times: Array, axes: Array, omega: Array) -> Loads:
    """The loads that the constraints (2.1), (2.2) and the drives need, by Newton and Euler.

    times (n,) s; axes (n, 3, 3) from principal axes to world; omega (n, 3) of the frame, in
    principal axes [rad/s].
    """
    ball, to_principal = scene.ball, scene.principal_axes.T
    rates = np.stack([drive.rate(times) for drive in scene.drives])
    accelerations = np.stack([drive.acceleration(times) for drive in scene.drives])
    hinges = to_principal @ np.stack([ball.shell.axis, *(r.axis for r in ball.rotors)], axis=1)
    gyrostatic_inertia = to_principal @ ball.gyrostatic_inertia
    Omega, Omega_rate = np.outer(hinges[:, 0], rates[0]), np.outer(hinges[:, 0], accelerations[0])
    gamma = axes[:, 2, :].T
    rate, spin_torque = eq.full_angular_acceleration(
        tuple(omega.T),
        tuple(gamma),
        tuple(Omega),
        tuple(Omega_rate),
        tuple(gyrostatic_inertia @ rates),
        tuple(gyrostatic_inertia @ accelerations),
        as_vector(ball.principal[0]),
        ball.d,
        spin_free=scene.rolling == "rubber",
    )
    spin_torque = np.broadcast_to(np.float64(spin_torque), times.shape)
    omega_rate, w = np.array(rate), omega.T

    # The shell's angular acceleration, seen from the frame; its inertia is constant there.
    turning, turning_rate = w - Omega, omega_rate - Omega_rate
    acceleration = ball.radius * _cross(turning_rate - _cross(w, Omega), gamma)
    force = ball.mass * (acceleration + scene.gravity * gamma)
    shell_inertia = to_principal @ ball.shell.inertia @ to_principal.T
    shell_momentum_rate = shell_inertia @ turning_rate + _cross(w, shell_inertia @ turning)
    from_plane = spin_torque * gamma - ball.radius * _cross(gamma, force)
    frame_torque = hinges[:, 0] @ (from_plane - shell_momentum_rate)
    moving = np.array([turns(drive) for drive in scene.drives])
    rotor_inertias = np.array([rotor.axial_inertia for rotor in ball.rotors])[:, None]
    rotor_torques = rotor_inertias * (hinges[:, 1:].T @ omega_rate + accelerations[1:])
    return Loads(
        contact_force=np.einsum("nij,jn->ni", axes, force),
        spin_torque=spin_torque,
        motor_torques=np.column_stack([frame_torque, rotor_torques.T]) * moving,
    )


def _cross(u: Array, v: Array) -> Array:
    """Columns (3, n) of u × v."""
    return np.cross(u, v, axis=0)
