"""Robots with known motions, and helpers to build robots.

The final states of the worked cases W1, W2, W4 and W5 at t = 10 s come from two programs with
80-bit numbers, one with momenta and one with maximal coordinates and multipliers; they agree to
2e-14.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotball.motion import Motion
from robotball.robot.ball import Ball, Frame, Hinge, Pendulum, Shell, shell_inertia
from robotball.robot.drives import Ramp, Rate, Sine
from robotball.robot.formulas import Rolling
from robotball.robot.mechanics import States
from robotball.robot.motors import Free, Motor, PositionServo, Servo
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, rotation_matrix

X, Y, Z = np.eye(3)
DURATION = 10.0  # s


@dataclass(frozen=True)
class Ending:
    """State of a worked case at t = 10 s: contact point [m], attitude, hinge angles [rad].

    angles: None if they are commanded.
    """

    contact_point: tuple[float, float]
    attitude: tuple[float, float, float, float]
    angles: tuple[float, ...] | None = None


ENDINGS = {
    "W1": Ending(
        (5.829427803998, 7.246903042787),
        (-0.442942712232, 0.331322986431, -0.180654301528, 0.813259402456),
    ),
    "W2": Ending(
        (7.188863780382, -0.315152705691),
        (0.997084709536, -0.010234091213, -0.070913540217, 0.026241478634),
    ),
    "W4": Ending(
        (-2.124278594993, 0.380225402544),
        (0.246502441058, -0.273515515312, -0.391215212635, 0.843431364628),
        (13.858765063622, 0.722199730427),
    ),
    "W5": Ending(
        (-1.059448591244, -3.987093642646),
        (0.398130133430, -0.419374453897, -0.279489078108, 0.766487651233),
        (15.489385375009, 0.746632640081),
    ),
}


def box_inertia(mass: float, x: float, y: float, z: float) -> Array:
    return mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])


def swing(amplitude: float, rate: float) -> Sine:
    """Return amplitude·sin(rate·t), rate in rad/s."""
    return Sine(amplitude=amplitude, frequency=rate / (2 * np.pi))


def robot(
    name: str,
    ball: Ball,
    rolling: Rolling,
    rates: Sequence[Rate],
    attitude: Sequence[float],
    omega: Sequence[float] = (0.0, 0.0, 0.0),
    motors: tuple[Motor | None, ...] = (),
    hinge_rates: Sequence[float] | None = None,
    **more: Any,
) -> Scene:
    """Return the scene of a ball with an initial attitude of any norm, and ω (3,) of the frame.

    rates: commands of the hinges; hinge_rates: initial rates. A rubber ball's initial spin is
    removed.
    """
    q = np.array(attitude, dtype=float)
    initial = [0.0] * len(rates) if hinge_rates is None else hinge_rates
    scene = Scene(
        name=name,
        title=name,
        source="tests/robots.py",
        ball=ball.with_hinges(command=rates, motor=motors or [None] * len(rates), rate=initial),
        rolling=rolling,
        start=Start(q / np.linalg.norm(q), np.zeros(3)),
        duration=DURATION,
        **more,
    )
    return turning(scene, np.array(omega, dtype=float))


def with_frame(scene: Scene) -> Scene:
    """Return the scene of a homogeneous shell, half of which is a frame that does not turn."""
    shell = scene.ball.shell
    mass, inertia = shell.mass / 2, shell.axial_inertia / 2
    half = replace(shell, mass=mass, axial_inertia=inertia, transverse_inertia=inertia)
    return replace(scene, ball=Ball(half, (Hinge(Frame(mass, inertia * np.eye(3)), 0.0),)))


def turning(scene: Scene, omega: Array) -> Scene:
    """Return the scene with the frame's initial ω (3,), without spin for a rubber shell."""
    if scene.rolling == "rubber":
        gamma = rotation_matrix(scene.start.attitude)[2]
        rate = scene.hinges[0].rate if scene.ball.has_frame else 0.0
        omega = omega - (omega - rate * scene.ball.shell.axis) @ gamma * gamma
    return replace(scene, start=replace(scene.start, momentum=scene.momentum_of(omega)))


def worked(name: str) -> Scene:
    return {"W1": _w1, "W2": _w2, "W4": _w4, "W5": _w5}[name]()


def low_weight(mass: float, depth: float) -> Scene:
    """Return a small frame [kg] that hangs low [m] in a shell of 1 kg and 0.2 m, at rest."""
    inertia = mass * 1.6e-4 * np.eye(3)
    frame = Frame(mass, inertia, np.array([0.0, 0.0, -depth]))
    ball = Ball(_thin_shell(0.2, 1.0, Y), (Hinge(frame),))
    return robot("low weight", ball, "classical", [0.0], (np.cos(0.25), np.sin(0.25), 0.0, 0.0))


def _w1() -> Scene:
    shell = Shell(0.5, 1.0, 0.16, 0.16, Z, offset=-0.05)
    frame = Frame(2.0, np.diag([0.08, 0.08, 0.05]), np.array([0.0, 0.0, -0.15]))
    ball = Ball(shell, (Hinge(frame),))
    return robot("W1", ball, "classical", [0.0], (1.0, 0.5, 0.0, 0.0), (1.0, 0.0, 8.0))


def _thin_shell(a: float, mass: float, axis: Array) -> Shell:
    inertia = shell_inertia(a, mass)
    return Shell(a, mass, inertia, inertia, axis)


def _w2() -> Scene:
    frame = Frame(3.0, box_inertia(3.0, 0.16, 0.1, 0.06), np.array([0.0, 0.0, -0.08]))
    ball = Ball(_thin_shell(0.2, 1.0, Y), (Hinge(frame),))
    spun_up = Ramp(final=-4.0, end=2.0, shape="quintic")
    return robot("W2", ball, "rubber", [spun_up], (1.0, 0.1, 0.0, 0.0))


def pendulum_ball() -> Ball:
    """Return W4's ball: a frame and a pendulum, both below the centre."""
    frame = Frame(1.0, box_inertia(1.0, 0.14, 0.14, 0.08), np.array([0.01, 0.0, -0.03]))
    pendulum = Pendulum(
        1.5,
        box_inertia(1.5, 0.06, 0.06, 0.06),
        centre=np.array([0.0, 0.0, -0.11]),
        axis=X,
        pivot=np.array([0.0, 0.0, -0.02]),
    )
    return Ball(_thin_shell(0.2, 1.0, Y), (Hinge(frame), Hinge(pendulum)))


def _w4() -> Scene:
    return robot(
        "W4",
        pendulum_ball(),
        "classical",
        [swing(8.0, 1.2), swing(0.8, 2.0)],
        (1.0, 0.05, 0.0, 0.0),
        (0.0, 0.0, 1.0),
        motors=(
            Servo(0.5, torque_limit=0.6, armature=0.002),
            PositionServo(6.0, 0.3, torque_limit=0.7, armature=0.001),
        ),
    )


def _w5() -> Scene:
    shell = Shell(0.25, 1.2, 0.045, 0.05, np.array([0.0, 0.6, 0.8]), offset=0.02)
    frame = Frame(
        2.0,
        np.array([[0.012, 0.002, 0.001], [0.002, 0.015, -0.001], [0.001, -0.001, 0.009]]),
        np.array([0.02, 0.03, -0.07]),
    )
    pivot = np.array([0.02, 0.02, 0.03])
    hung = Pendulum(0.8, np.diag([0.002, 0.003, 0.0025]), np.array([0.1, 0.02, 0.03]), Z, pivot)
    return robot(
        "W5",
        Ball(shell, (Hinge(frame), Hinge(hung))),
        "rubber",
        [0.0, 0.0],
        (1.0, 0.2, -0.1, 0.3),
        (1.0, -2.0, 1.5),
        motors=(Free(damping=0.01), Free(damping=0.002, stiffness=0.3, rest=0.5)),
        hinge_rates=(1.0, 0.0),
    )


def energy(motion: Motion) -> Array:
    """Return T + V (n,) of a motion, including the armatures' kinetic energy [J].

    V = -Σ m_b (r_b, G) relative to the plane's origin, without springs, which count as motors.
    """
    scene, robot = motion.scene, motion.scene.robot
    angles, rates = motion.hinge_angles, motion.hinge_rates
    states = robot.states(motion.gamma, angles, motion.angular_velocity, rates)
    to_world = rotation_matrix(motion.attitude)
    height = np.full(len(angles), scene.ball.radius)
    centre = np.column_stack([motion.contact_point, height])
    centre = centre + np.einsum("nij,nj->ni", to_world, states.centre_of_mass)
    return kinetic_energy(states) - scene.ball.mass * np.asarray(centre @ scene.gravity_world)


def kinetic_energy(states: States) -> Array:
    """Return the kinetic energy u·𝓜u/2 (n,) of states, including armatures [J]."""
    return np.asarray((states.u * states.momenta).sum(axis=0) / 2)
