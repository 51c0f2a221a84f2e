"""Readings of a model's sensors: rows of numbers → the observables of a Motion.

All is computed for many rows at once, and by columns: at this size NumPy's own norm and cross
product of rows take several times as long.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from robotball import equations as eq
from robotball.engines.mujoco.model import Model, ModelHinge
from robotball.motion import Loads
from robotball.motors import Free
from robotball.rotations import Array, Mask, rotation_matrix

# Sensors of coordinates and velocities, whose size shows whether a state has diverged.
_STATE_SENSORS = [
    mujoco.mjtSensor.mjSENS_FRAMEPOS,
    mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    mujoco.mjtSensor.mjSENS_SUBTREELINVEL,
    mujoco.mjtSensor.mjSENS_JOINTPOS,
    mujoco.mjtSensor.mjSENS_JOINTVEL,
]


_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Readings:
    """Rows (m, nsensordata + 7), one a state of `model`, as named columns in SI units.

    A row is MjData's sensordata followed by its warning counters.
    """

    model: Model
    rows: Array

    def column(self, sensor: str) -> Array:
        """Return the (m, size) block of a named sensor."""
        return self.rows[:, self.model.sensor_columns[sensor]]

    @property
    def warnings(self) -> Array:
        """The number of MuJoCo's warnings so far (m, 7), in the order of mjtWarning."""
        return self.rows[:, self.model.compiled.nsensordata :]

    @property
    def time(self) -> Array:
        """The times (m,) [s]."""
        return self.column("time")[:, 0]

    @property
    def centre(self) -> Array:
        """The sphere's centre (m, 3) [m], world."""
        return self.column("centre")

    @property
    def attitude(self) -> Array:
        """The frame's quaternion (m, 4), frame to world."""
        return self.column("attitude")

    @property
    def angular_velocity(self) -> Array:
        """The frame's ω (m, 3), turned from the sensor's world axes to frame axes."""
        to_world = rotation_matrix(self.attitude)
        return np.einsum("nji,nj->ni", to_world, self.column("angular_velocity"))

    @cached_property
    def momentum(self) -> Array:
        """The paper's M (m, 3) in world axes, from MuJoCo's own momenta.

        L = G + r×mv about the contact point; M = γ×L (3.1) in the rubber model, L in the
        classical one.
        """
        scene = self.model.scene
        linear = scene.ball.mass * self.column("velocity")
        if scene.load_varies:
            arm = self.column("centre_of_mass") - self.centre * [1.0, 1.0, 0.0]
        else:  # the centre of mass is the sphere's centre, and has no sensor of its own
            arm = self.centre * [0.0, 0.0, 1.0]
        L = self.column("angular_momentum") + _cross(arm, linear)
        return _cross(_UP, L) if scene.rolling == "rubber" else L

    @property
    def in_contact(self) -> Mask:
        """True where the plane and the shell touch (m,)."""
        return self.column("contact")[:, 0] > 0

    @property
    def contact_force(self) -> Array:
        """The force (m, 3) of the plane on the shell [N]: normal, then two tangential parts."""
        return self.column("contact")[:, 1:4]

    @property
    def contact_force_world(self) -> Array:
        """The force (m, 3) of the plane on the shell along the world axes [N]."""
        normal, tangent = self.column("contact")[:, 7:10], self.column("contact")[:, 10:13]
        basis = np.stack([normal, tangent, _cross(normal, tangent)], axis=1)
        return np.einsum("ni,nij->nj", self.contact_force, basis)

    @property
    def spin_torque(self) -> Array:
        """The contact's torque (m,) about its normal [N m], λ₀ for rubber."""
        return self.column("contact")[:, 4]

    @cached_property
    def slip(self) -> Array:
        """The sliding velocity (m,) of the shell at the contact [m/s]."""
        return lengths(self.column("contact")[:, 14:16])

    @property
    def spin(self) -> Array:
        """The shell's angular velocity (m,) about the contact's normal [rad/s]."""
        return self.column("contact")[:, 16]

    @cached_property
    def friction_used(self) -> Array:
        """The used part (m,) of the friction cone, 1 on its surface, 0 in flight.

        A pyramidal cone bounds the sum of the components' sizes, an elliptic one their norm.
        """
        compiled = self.model.compiled
        # MuJoCo raises smaller coefficients to this one.
        slide, _, spin, roll, _ = np.maximum(compiled.pair_friction[0], mujoco.mjMINMU)
        normal, *tangential = self.contact_force.T
        torques = self.column("contact")[:, 4:7].T / np.array([[spin], [roll], [roll]])
        demand = np.concatenate([tangential, torques * slide]) / slide
        if compiled.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL:
            needed = np.abs(demand).sum(axis=0)
        else:
            needed = np.linalg.norm(demand, axis=0)
        return np.divide(needed, normal, out=np.zeros_like(needed), where=normal > 0)

    def sound(self, limit: float) -> Mask:
        """Return whether each row (m,) is finite, its coordinates and velocities below `limit`.

        Forces and momenta may be as large as a heavy ball makes them.
        """
        # Two passes without a copy decide nearly every portion; a NaN fails both comparisons.
        if len(self.rows) and -limit < self.rows.min() and self.rows.max() < limit:
            return np.ones(len(self.rows), bool)
        compiled = self.model.compiled
        state = np.repeat(np.isin(compiled.sensor_type, _STATE_SENSORS), compiled.sensor_dim)
        finite = np.isfinite(self.rows).all(axis=1)
        small = (np.abs(self.rows[:, : compiled.nsensordata][:, state]) < limit).all(axis=1)
        return np.asarray(finite & small)

    def _of_hinges(self, column: Callable[[ModelHinge], Array]) -> Array:
        """Return a column for each of the scene's hinges (m, h); 0 for those that do not turn."""
        columns = np.zeros((len(self.rows), len(self.model.scene.hinges)))
        for hinge in self.model.hinges:
            columns[:, hinge.index] = column(hinge)
        return columns

    @property
    def hinge_angles(self) -> Array:
        """The scene's hinge angles (m, h) [rad]."""
        return self._of_hinges(lambda hinge: self.column(f"{hinge.body}_angle")[:, 0])

    @property
    def hinge_rates(self) -> Array:
        """The scene's hinge rates (m, h) [rad/s]."""
        return self._of_hinges(lambda hinge: self.column(f"{hinge.body}_rate")[:, 0])

    @property
    def motor_torques(self) -> Array:
        """The torque (m, h) of the parent on the child, along the hinge [N m]."""
        return self._of_hinges(self._torque)

    def _torque(self, hinge: ModelHinge) -> Array:
        """Return a motor's torque (m,) [N m], or what the joint of a prescribed rate carries.

        The joint's site has its z along the hinge. A passive hinge has no sensor of its torque.
        """
        if isinstance(hinge.actuation, Free):
            angle, rate = (self.column(f"{hinge.body}_{name}")[:, 0] for name in ("angle", "rate"))
            passive = np.asarray(hinge.actuation.torque(0.0, angle, rate))
            moved = f"{hinge.body}_torque" in self.model.sensor_columns
            return passive + self.column(f"{hinge.body}_torque")[:, 0] if moved else passive
        return self.column(f"{hinge.body}_torque")[:, -1]

    @property
    def loads(self) -> Loads:
        """The forces and torques as in a Motion."""
        return Loads(self.contact_force_world, self.spin_torque, self.motor_torques)

    def hinge_rate_error(self, hinges: Iterable[ModelHinge]) -> Array:
        """Return the largest error (m,) of the rates of `hinges`, over each one's largest rate."""
        worst = np.zeros(len(self.rows))
        # A diverged state's time may be none, which no drive can be evaluated at.
        times = np.where(np.isfinite(self.time), self.time, 0.0)
        for hinge in (each for each in hinges if each.follows_rate):
            error = np.abs(self.hinge_rates[:, hinge.index] - hinge.drive.rate(times))
            worst = np.maximum(worst, error / hinge.largest_rate)
        return worst


def lengths(v: Array) -> Array:
    """Return the lengths (m,) of vectors (m, k)."""
    return np.asarray(np.sqrt(sum(column * column for column in v.T)))


def _cross(u: Array, v: Array) -> Array:
    """Return u × v (m, 3) of rows (m, 3) or (3,)."""
    return np.stack(eq.cross(tuple(u.T), tuple(v.T)), axis=-1)
