"""Loads: the forces and torques that a motion needs, from the laws of Newton and Euler."""

from dataclasses import dataclass

import numpy as np

from robotball.robot import formulas as eq
from robotball.robot.ball import Value
from robotball.robot.drives import turns
from robotball.robot.formulas import as_vector
from robotball.robot.scene import Scene
from robotball.rotations import Array


@dataclass(frozen=True)
class Loads(Value):
    """Hold the forces and torques that a motion needs, at n times and on h hinges.

    The hinges are in the order of `Ball.hinges`.

    Attributes
    ----------
    contact_force : (n, 3), N, world
        The force of the plane on the shell. Its third column is the normal force.
    spin_torque : (n,), N m
        The torque λ₀ of the plane on the shell about the vertical.
    motor_torques : (n, h), N m
        The torque of the motor along each hinge. The shell exerts it on the frame, and the frame on
        a rotor. 0 for a hinge that never turns.

    Examples
    --------
    >>> import robotball as rb
    >>> loads = rb.integrate(rb.load_scene("fig12"), 0.5).loads
    >>> print(f"needs a friction coefficient of {loads.sliding_friction.max():.3f}")
    needs a friction coefficient of 1.155
    """

    contact_force: Array
    spin_torque: Array
    motor_torques: Array

    @classmethod
    def unknown(cls, times: int, hinges: int) -> "Loads":
        """Return loads that are all NaN."""
        return cls(*(np.full(shape, np.nan) for shape in ((times, 3), times, (times, hinges))))

    @property
    def sliding_friction(self) -> Array:
        """The least coefficient of friction (n,) with which the shell does not slip."""
        return _per_newton(np.linalg.norm(self.contact_force[:, :2], axis=1), self.normal_force)

    @property
    def torsional_friction(self) -> Array:
        """The least torsional coefficient (n,) with which the shell does not spin [m]."""
        return _per_newton(np.abs(self.spin_torque), self.normal_force)

    def grip(self, limits: Array) -> Array:
        """Return the friction as a fraction (n,) of its limits (3,), see `Scene.slip_limits`."""
        slide, _, spin = limits
        return np.hypot(self.sliding_friction / slide, self.torsional_friction / spin)

    @property
    def normal_force(self) -> Array:
        """The force (n,) of the plane on the shell along its normal [N]."""
        return self.contact_force[:, 2]


def loads_of(scene: Scene, times: Array, axes: Array, omega: Array) -> Loads:
    """Return the loads that the constraints (2.1), (2.2) and the drives exert.

    The angular acceleration comes from the unreduced equations (2.4)-(2.5). times (n,) s; axes
    (n, 3, 3) from principal axes to world; omega (n, 3) of the frame, in principal axes [rad/s].
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

    # In frame axes the inertia of the turning shell is constant, because the shell is symmetric
    # about its hinge.
    turning, turning_rate = w - Omega, omega_rate - Omega_rate
    acceleration = ball.radius * _cross(turning_rate - _cross(w, Omega), gamma)
    force = ball.mass * (acceleration - scene.gravity_at(times)[:, 2] * gamma)
    shell_inertia = to_principal @ ball.shell.inertia @ to_principal.T
    shell_momentum_rate = shell_inertia @ turning_rate + _cross(w, shell_inertia @ turning)
    # Euler's equation of the shell about its centre gives the torque of the frame's motor.
    from_plane = spin_torque * gamma - ball.radius * _cross(gamma, force)
    frame_torque = hinges[:, 0] @ (from_plane - shell_momentum_rate)
    moving = np.array([turns(drive) for drive in scene.drives])
    # The torque along the axis of a symmetric rotor is I (dω/dt, n) + I φ̈, because its gyroscopic
    # torque is orthogonal to the axis.
    rotor_inertias = np.array([rotor.axial_inertia for rotor in ball.rotors])[:, None]
    rotor_torques = rotor_inertias * (hinges[:, 1:].T @ omega_rate + accelerations[1:])
    return Loads(
        contact_force=np.einsum("nij,jn->ni", axes, force),
        spin_torque=spin_torque,
        motor_torques=np.column_stack([frame_torque, rotor_torques.T]) * moving,
    )


def _cross(u: Array, v: Array) -> Array:
    """Return the columns (3, n) of u × v."""
    return np.cross(u, v, axis=0)


def _per_newton(load: Array, normal_force: Array) -> Array:
    # 0 while the ball is off the plane, because a flying ball needs no friction.
    return np.divide(load, normal_force, out=np.zeros_like(load), where=normal_force > 0)
