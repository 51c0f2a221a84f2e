"""Motion: what both engines return, and all that anything downstream sees."""

from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array, rotation_matrix


@dataclass(frozen=True)
class Fault:
    """Something that makes a run no result: what, and from when [s]; a fatal one ended the run."""

    time: float
    cause: str
    fatal: bool = False

    def __str__(self) -> str:
        return f"{self.cause} at t = {self.time:.6g} s"


@dataclass(frozen=True)
class Diagnostics:
    """What a contact engine did besides moving the ball; arrays (n,) are at the motion's times.

    slip             m/s      sliding velocity of the shell at the contact
    spin             rad/s    angular velocity of the shell about the vertical
    depth            m        of the plane in the shell, by which the lever arm is short
    friction_used    fraction of the friction cone that the contact force needs; 1 is saturated
    hinge_rate_error largest error of a hinge's rate, relative to the rate
    faults           what went wrong, the earliest first; empty for a sound run
    timestep         s, the longest step taken
    steps            taken
    seconds          of processor time that they took, set-up excluded
    estimated_error  of the path, over its length; where an accuracy was asked for, else None
    """

    slip: Array
    spin: Array
    depth: Array
    friction_used: Array
    hinge_rate_error: Array
    faults: tuple[Fault, ...]
    timestep: float
    steps: int
    seconds: float
    estimated_error: float | None = None


@dataclass(frozen=True)
class Loads:
    """Forces and torques at n times, on h hinges (the frame's, then the rotors').

    contact_force  (n, 3)  N, world: of the plane on the shell, the normal force last
    spin_torque    (n,)    N m: λ₀, of the plane on the shell about the vertical
    motor_torques  (n, h)  N m: of the shell on the frame and of the frame on the rotors, along
                           the hinges; 0 where a hinge never turns
    """

    contact_force: Array
    spin_torque: Array
    motor_torques: Array

    @property
    def sliding_friction(self) -> Array:
        """(n,): the least coefficient of friction at which the shell does not slip."""
        return _per_newton(np.linalg.norm(self.contact_force[:, :2], axis=1), self.normal_force)

    @property
    def torsional_friction(self) -> Array:
        """(n,) m: the least torsional coefficient at which the shell does not spin."""
        return _per_newton(np.abs(self.spin_torque), self.normal_force)

    @property
    def normal_force(self) -> Array:
        """(n,) N."""
        return self.contact_force[:, 2]


def _per_newton(load: Array, normal_force: Array) -> Array:
    return np.divide(load, normal_force, out=np.zeros_like(load), where=normal_force > 0)


@dataclass(frozen=True)
class Motion:
    """A sampled motion of the ball, with n times, h hinges (the frame's, then the rotors').

    times             (n,)    s; fewer than asked for where an engine's run broke off
    contact_point     (n, 2)  m, world: where the ball touches the plane
    attitude          (n, 4)  quaternion (w, x, y, z) of the frame, frame to world
    momentum          (n, 3)  kg m²/s, world: the paper's M, which is constant in space
    angular_velocity  (n, 3)  rad/s, of the frame, frame axes
    hinge_angles      (n, h)  rad, from zero at the start
    hinge_rates       (n, h)  rad/s
    loads             what the motion asks of the plane and of the motors
    diagnostics       from MuJoCo; None from the equations
    """

    times: Array
    contact_point: Array
    attitude: Array
    momentum: Array
    angular_velocity: Array
    hinge_angles: Array
    hinge_rates: Array
    loads: Loads
    diagnostics: Diagnostics | None = None

    @property
    def gamma(self) -> Array:
        """γ (n, 3): the upward vertical, frame axes."""
        return rotation_matrix(self.attitude)[:, 2, :]

    @property
    def motor_powers(self) -> Array:
        """(n, h) W: what the motors put in."""
        return self.loads.motor_torques * self.hinge_rates

    @property
    def path_length(self) -> float:
        """The length of the sampled contact-point path [m]."""
        return float(np.linalg.norm(np.diff(self.contact_point, axis=0), axis=1).sum())
