"""A second form of ideal rolling: accelerations, with a row of multipliers for each constraint.

MuJoCo's mass matrix and bias of the tree shell - frame - the rest, and explicit rows for the point
of contact, for the spin and for every hinge whose rate is given. It shares no formula with
robotball.mechanics: its coordinates are those of the shell, about its centre of mass.
"""

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from robotball.robot import Frame, Pendulum, Rotor
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Scene

UP = np.array([0.0, 0.0, 1.0])


def _body(name: str, mass: float, centre: Array, inertia: Array) -> tuple[str, str]:
    m = inertia
    parts = [m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]
    full = " ".join(repr(float(x)) for x in parts)
    at = " ".join(repr(float(x)) for x in centre)
    return name, f'<inertial mass="{float(mass)!r}" pos="{at}" fullinertia="{full}"/>'


def _numbers(v: Array) -> str:
    return " ".join(repr(float(x)) for x in v)


@dataclass
class Loads:
    """Accelerations (nv,), the plane's force (3,), its spin torque, the given hinges' torques."""

    acceleration: Array
    force: Array
    spin: float
    torques: Array


class SecondForm:
    """The scene's robot in MuJoCo's coordinates; pivot_sign: -1 is a wrong sign, to be seen."""

    def __init__(self, scene: Scene, pivot_sign: float = 1.0) -> None:
        ball, self.scene, self.hinges = scene.ball, scene, scene.hinges
        armatures = [hinge.motor.armature if hinge.motor else 0.0 for hinge in self.hinges]
        inner = ""
        for i, (name, body) in enumerate(ball.named_bodies[2:], start=1):
            assert isinstance(body, Rotor | Pendulum)
            pivot = body.pivot * pivot_sign if isinstance(body, Pendulum) else body.centre
            _, inertial = _body(name, body.mass, body.centre, body.inertia)
            inner += (
                f'<body name="{name}">{inertial}<joint type="hinge" axis="{_numbers(body.axis)}" '
                f'pos="{_numbers(pivot)}" armature="{float(armatures[i])!r}"/></body>'
            )
        shell, frame = ball.shell, ball.frame
        assert isinstance(frame, Frame)
        _, of_shell = _body("shell", shell.mass, shell.centre, shell.inertia)
        _, of_frame = _body("frame", frame.mass, frame.centre, frame.inertia)
        G = _numbers(scene.gravity_world)
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler boundmass="0" boundinertia="0"/><option gravity="{G}"/><worldbody>'
            f'<body name="shell">{of_shell}<freejoint/>'
            f'<body name="frame">{of_frame}<joint type="hinge" axis="{_numbers(shell.axis)}" '
            f'armature="{float(armatures[0])!r}"/>{inner}</body></body></worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)

    def start(self) -> tuple[Array, Array]:
        """qpos and qvel at the scene's start; the shell's own axes are the frame's there."""
        scene, q, v = self.scene, np.zeros(self.model.nq), np.zeros(self.model.nv)
        angles = np.array([hinge.angle for hinge in self.hinges])
        rates = np.array([hinge.rate for hinge in self.hinges])
        back, e = -angles[0] / 2, scene.ball.shell.axis
        q[2] = scene.ball.radius
        q[3:7] = multiply(scene.start.attitude, np.array([np.cos(back), *np.sin(back) * e]))
        q[7:], v[6:] = angles, rates
        to_world = rotation_matrix(scene.start.attitude)
        shell = to_world @ (scene.angular_velocity_at(scene.start) - rates[0] * e)
        v[:3] = scene.ball.radius * np.cross(shell, UP)
        v[3:6] = rotation_matrix(q[3:7]).T @ shell
        return q, v

    def loads(self, t: float, q: Array, v: Array) -> Loads:
        """What the constraints make of a state."""
        model, data, nv = self.model, self.data, self.model.nv
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        M = np.zeros((nv, nv))
        mujoco.mj_fullM(model, data, M)
        right = -data.qfrc_bias.copy()
        rows, values = [], []
        R = rotation_matrix(q[3:7] / np.linalg.norm(q[3:7]))
        # v - a ω×ẑ = 0 in space, where ω = Rω' has the rate Rω̇'.
        point = np.zeros((3, nv))
        point[:, :3] = np.eye(3)
        cross = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]])  # ω×ẑ = (ω_y, -ω_x, 0)
        point[:, 3:6] = -self.scene.ball.radius * cross @ R
        rows += list(point)
        values += [0.0] * 3
        if self.scene.rolling == "rubber":
            spin = np.zeros(nv)
            spin[3:6] = R[2]
            rows.append(spin)
            values.append(0.0)
        given = []
        for i, hinge in enumerate(self.hinges):
            if hinge.motor is None:
                row = np.zeros(nv)
                row[6 + i] = 1.0
                rows.append(row)
                values.append(float(hinge.command.acceleration(t)))
                given.append(i)
            else:
                command = float(hinge.command.rate(t))
                right[6 + i] += hinge.motor.law.torque(command, q[7 + i], v[6 + i])
        J = np.array(rows)
        c = len(J)
        whole = np.block([[M, -J.T], [J, np.zeros((c, c))]])
        found = np.linalg.solve(whole, np.concatenate([right, values]))
        multipliers = found[nv:]
        spin_free = self.scene.rolling == "rubber"
        return Loads(
            found[:nv],
            multipliers[:3],
            float(multipliers[3]) if spin_free else 0.0,
            multipliers[3 + spin_free :],
        )

    def end(self, duration: float, switches: list[float]) -> tuple[Array, Array]:
        """X, Y and the hinges' angles after a time [s], by accelerations.

        switches: the times of torque limits, where the integration begins anew [s].
        """
        nq = self.model.nq

        def rate(t: float, y: Array) -> Array:
            q, v = y[:nq], y[nq:]
            w, x, y_, z = q[3:7]
            p, r, s = v[3:6]
            spin = [
                (-x * p - y_ * r - z * s) / 2,
                (w * p + y_ * s - z * r) / 2,
                (w * r + z * p - x * s) / 2,
                (w * s + x * r - y_ * p) / 2,
            ]
            acceleration = self.loads(t, q, v).acceleration
            return np.concatenate([v[:3], spin, v[6:], acceleration])

        y = np.concatenate(self.start())
        for span in pairwise([0.0, *switches, duration]):
            y = solve_ivp(rate, span, y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        return y[:2], y[7:nq]
