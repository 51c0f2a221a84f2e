"""Ideal rolling by accelerations, with a Lagrange multiplier for each constraint.

Mass matrix and bias come from MuJoCo, with the links in depth-first order. Explicit constraint rows
hold the contact point, the spin and every hinge with a prescribed rate. It shares no formula with
robotball.robot.mechanics: its coordinates are the position and attitude of the shell.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from robotball.engines.states import links_of
from robotball.robot import formulas as eq
from robotball.robot.formulas import as_vector
from robotball.robot.scene import Scene
from robotball.rotations import Array, multiply, rotation_matrix

UP = np.array([0.0, 0.0, 1.0])


def _numbers(v: Any) -> str:
    return " ".join(repr(float(x)) for x in v)


def _body(link: Any, joint: str, inner: str = "") -> str:
    J = link.inertia
    full = _numbers([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
    return (
        f'<body pos="{_numbers(link.pivot)}"><inertial mass="{float(link.mass)!r}" '
        f'pos="{_numbers(link.centre)}" fullinertia="{full}"/>{joint}{inner}</body>'
    )


class Loads(NamedTuple):
    """Accelerations (nv,), the plane's force (3,), its spin torque, the motors' torques (h,)."""

    acceleration: Array
    force: Array
    spin: float
    torques: Array


class SecondForm:
    """The robot in MuJoCo coordinates: qpos, and qvel with ω in shell axes."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.hinges = scene, scene.hinges
        links, joints = links_of(scene), ["<freejoint/>"]
        joints += [
            f'<joint type="{"slide" if hinge.body.slides else "hinge"}" '
            f'axis="{_numbers(hinge.body.axis)}" '
            f'armature="{float(hinge.motor.armature if hinge.motor else 0.0)!r}"/>'
            for hinge in self.hinges
        ]

        def nested(i: int) -> str:
            inner = (nested(j) for j, link in enumerate(links) if link.parent == links[i].name)
            return _body(links[i], joints[i], "".join(inner))

        self.model = mujoco.MjModel.from_xml_string(
            '<mujoco><compiler boundmass="0" boundinertia="0"/>'
            f'<option gravity="{_numbers(scene.gravity_world)}"/>'
            f"<worldbody>{nested(0)}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)

    def surface(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the velocity and acceleration (3,) of a turning plane's point at the contact.

        The acceleration is that of the constraint, whose point moves with the ball. The axis is at
        the origin of a plane that moves up and down only.
        """
        turn, flat = self.scene.plane_turn, [1.0, 1.0, 0.0]
        spin, faster = turn.rate(t) * UP, turn.acceleration(t) * UP
        r, moves = q[:3] * flat, v[:3] * flat
        return np.cross(spin, r), np.cross(faster, r) + np.cross(spin, moves)

    def start(self) -> tuple[Array, Array]:
        """Return qpos and qvel at the start; shell and frame axes coincide at angle 0."""
        scene, q, v = self.scene, np.zeros(self.model.nq), np.zeros(self.model.nv)
        q[7:], v[6:] = np.array([(hinge.angle, hinge.rate) for hinge in self.hinges]).T
        angle, rate = (q[7], v[6]) if scene.ball.has_frame else (0.0, 0.0)
        back, e = -angle / 2, scene.ball.shell.axis
        q[2] = scene.ball.radius
        q[3:7] = multiply(scene.start.attitude, np.array([np.cos(back), *np.sin(back) * e]))
        to_world = rotation_matrix(scene.start.attitude)
        shell = to_world @ (scene.angular_velocity_at(scene.start) - rate * e)
        if scene.rolling == "rubber":
            shell = shell + scene.plane_turn.rate(0.0) * UP
        v[:3] = scene.ball.radius * np.cross(shell, UP)
        v[3:6] = rotation_matrix(q[3:7]).T @ shell
        return q, v

    def dynamics(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the mass matrix (nv, nv) and the bias (nv,), including gravity."""
        self.data.qpos[:], self.data.qvel[:] = q, v
        mujoco.mj_forward(self.model, self.data)
        M = np.zeros((len(v), len(v)))
        mujoco.mj_fullM(self.model, self.data, M)
        return M, self.data.qfrc_bias.copy()

    def loads(self, t: float, q: Array, v: Array) -> Loads:
        """Return accelerations and constraint loads in a state."""
        M, bias = self.dynamics(q, v)
        nv, right, R = len(v), -bias, rotation_matrix(q[3:7] / np.linalg.norm(q[3:7]))
        spin_free = self.scene.rolling == "rubber"
        prescribed = [i for i, hinge in enumerate(self.hinges) if hinge.motor is None]
        J = np.zeros((3 + spin_free + len(prescribed), nv))
        values = np.zeros(len(J))
        # v - a ω×ẑ is the velocity of the plane in space. ω = Rω' has the rate Rω̇', and
        # ω×ẑ = (ω_y, -ω_x, 0). Gravity does not change.
        values[:3] = [drive.rate(t) for drive in self.scene.plane_drives]
        values[:3] += self.surface(t, q, v)[1]
        J[:3, :3] = np.eye(3)
        J[:3, 3:6] = -self.scene.ball.radius * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]) @ R
        if spin_free:
            J[3, 3:6] = R[2]
            values[3] = self.scene.plane_turn.acceleration(t)
        for row, i in enumerate(prescribed, start=3 + spin_free):
            J[row, 6 + i] = 1.0
            values[row] = self.hinges[i].command.acceleration(t)
        torques = np.zeros(len(self.hinges))
        for i, hinge in enumerate(self.hinges):
            if hinge.motor is not None:
                torques[i] = hinge.motor.law.torque(hinge.command.rate(t), q[7 + i], v[6 + i])
        for actuator, command in zip(self.scene.actuators, self.scene.controls, strict=True):
            gears = np.array([dict(actuator.gears).get(hinge.name, 0.0) for hinge in self.hinges])
            torques += gears * actuator.law.torque(command.rate(t), gears @ q[7:], gears @ v[6:])
        right[6:] += torques
        whole = np.block([[M, -J.T], [J, np.zeros((len(J), len(J)))]])
        solution = np.linalg.solve(whole, np.concatenate([right, values]))
        multipliers = solution[nv:]
        torques[prescribed] = multipliers[3 + spin_free :]
        spin_torque = float(multipliers[3]) if spin_free else 0.0
        return Loads(solution[:nv], multipliers[:3], spin_torque, torques)

    def end(self, duration: float, switches: list[float]) -> tuple[Array, Array]:
        """Return qpos and qvel after `duration` [s].

        The integration restarts at `switches` [s], the times at which torque limits are reached.
        """
        nq = self.model.nq

        def rate(t: float, y: Array) -> Array:
            q, v = y[:nq], y[nq:]
            w, x, y_, z = q[3:7]
            spin = eq.attitude_rate((w, x, y_, z), as_vector(v[3:6]))
            return np.concatenate([v[:3], spin, v[6:], self.loads(t, q, v).acceleration])

        y = np.concatenate(self.start())
        for span in pairwise([0.0, *switches, duration]):
            y = solve_ivp(rate, span, y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        return y[:nq], y[nq:]
