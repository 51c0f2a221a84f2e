"""Random balls made of mass points and rings, so that they are physical."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robotball.robot.ball import Ball, Frame, Hinge, Hung, Rotor, Shell, shell_inertia
from robotball.robot.formulas import Rolling
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array

_SEED = 20190501


@dataclass(frozen=True)
class RandomBall:
    """A ball with its hinge rates [rad/s], shell thickness and radii of frame and rotors [m]."""

    ball: Ball
    rates: tuple[float, ...]
    thickness: float
    frame_radius: float
    rotor_radius: float

    @property
    def Omega(self) -> Array:
        return self.rates[0] * self.ball.shell.axis

    @property
    def K(self) -> Array:
        """K = k - dΩ (3,), with k from (A.3)."""
        return self.ball.gyrostatic_inertia @ np.array(self.rates) - self.ball.d * self.Omega


def random_ball(rng: np.random.Generator, rotors: int) -> RandomBall:
    """Return a shell of any thickness with mass points around its centre as frame, and rings."""
    a, mass = 10 ** rng.uniform(-1.5, 0.5), 10 ** rng.uniform(-2, 2)
    thickness = a * rng.choice([0.0, rng.uniform(0.01, 0.3)])
    frame_radius = rng.uniform(0.6, 0.97) * (a - thickness)
    rotor_radius = rng.uniform(0.3, 0.95) * frame_radius
    parts = np.array([rng.uniform(0.05, 0.4), 1.0, *rng.uniform(0.02, 0.2, rotors)])
    masses = mass * parts / parts.sum()
    J_s = shell_inertia(a, masses[0], thickness)
    rings = tuple(
        Rotor(m, m * radius**2, m * radius**2 / 2, random_axis(rng))
        for m, radius in zip(masses[2:], rotor_radius * rng.uniform(0.5, 1, rotors), strict=True)
    )
    shell = Shell(a, masses[0], J_s, J_s, random_axis(rng))
    frame = Frame(masses[1], cloud_inertia(rng, masses[1], frame_radius))
    bodies: list[Hung] = [frame, *rings]
    ball = Ball(shell, tuple(map(Hinge, bodies)))
    rates = rng.uniform(20, 300, rotors) * rng.choice([-1, 1], rotors)
    frame_rate = float(rng.choice([0.0, rng.uniform(0.1, 5), -rng.uniform(0.1, 5)]))
    return RandomBall(
        ball=ball,
        rates=(frame_rate, *rates.tolist()),
        thickness=float(thickness),
        frame_radius=float(frame_radius),
        rotor_radius=float(rotor_radius),
    )


def random_axis(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def cloud_inertia(rng: np.random.Generator, mass: float, radius: float) -> Array:
    """Return the inertia (3, 3) of six pairs of opposite points within `radius`, squeezed."""
    points = rng.normal(size=(6, 3)) * rng.uniform(0.2, 1, 3)
    points *= radius * rng.uniform(0.3, 1, (6, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    weights = rng.uniform(0.1, 1, 6)
    weights *= mass / weights.sum()
    second = np.einsum("p,pi,pj->ij", weights, points, points)
    return np.trace(second) * np.eye(3) - second


def ring_ball(rng: np.random.Generator, rotors: int) -> RandomBall:
    """Return a ball that consists mainly of rings scattered about a direction, and a flat frame."""
    real = random_ball(rng, 0)
    radius, mass, lead = real.frame_radius, real.ball.mass, random_axis(rng)
    scatter = rng.uniform(0.3, 3)
    rings = []
    for m in mass * rng.uniform(0.5, 2, rotors):
        axis = lead + scatter * random_axis(rng)
        axis /= np.linalg.norm(axis)
        rings.append(Rotor(m, m * radius**2, m * radius**2 / 2, axis))
    points = np.array([np.cross(lead, random_axis(rng)) for _ in range(3)])
    points += 0.05 * rng.normal(size=(3, 3))
    points *= 0.5 * radius / np.linalg.norm(points, axis=1, keepdims=True)
    second = 0.01 * mass * points.T @ points
    frame = Frame(0.03 * mass, np.trace(second) * np.eye(3) - second)
    bodies: list[Hung] = [frame, *rings]
    return RandomBall(
        ball=Ball(real.ball.shell, tuple(map(Hinge, bodies))),
        rates=(real.rates[0], *[float(rng.uniform(5, 50))] * rotors),
        thickness=real.thickness,
        frame_radius=radius,
        rotor_radius=radius,
    )


def ball_of_points(number: int) -> Scene:
    """Return a scene of mass points in a shell with 0 to 3 rotors, in non-principal axes."""
    rng = np.random.default_rng([_SEED, number])
    radius, mass = rng.uniform(0.5, 1.5), rng.uniform(0.3, 2.0)
    shell_mass = mass * rng.uniform(0.05, 0.3)
    # Mass points on the sphere, concentrated towards its axis or its equator.
    axial = shell_mass * radius**2 * rng.uniform(0.4, 0.9)
    transverse = shell_mass * radius**2 - axial / 2
    shell = Shell(radius, shell_mass, axial, transverse, random_axis(rng))
    rotors = []
    for _ in range(number % 4):
        rotor_mass, size = mass * rng.uniform(0.02, 0.1), radius * rng.uniform(0.3, 0.8)
        moment = rotor_mass * size**2
        rotors.append(Rotor(rotor_mass, moment, moment * rng.uniform(0.5, 0.8), random_axis(rng)))
    points = rng.normal(size=(6, 3))
    points *= radius * rng.uniform(0.4, 1.0, size=(6, 1)) / np.linalg.norm(points, axis=1)[:, None]
    point_mass = (mass - shell_mass - sum(rotor.mass for rotor in rotors)) / 12
    tensors = [2 * point_mass * (r @ r * np.eye(3) - np.outer(r, r)) for r in points]
    frame = Frame(12 * point_mass, np.sum(tensors, axis=0))
    bodies: list[Hung] = [frame, *rotors]
    ball = Ball(shell, tuple(map(Hinge, bodies)))
    rolling: Rolling = "rubber" if number % 2 else "classical"
    # Rates of both signs with |A K| and |Ω| below 4 rad/s.
    weakest = float(np.linalg.eigvalsh(ball.inertia)[0] + ball.d)
    spins = tuple(
        rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * weakest / r.axial_inertia for r in rotors
    )
    attitude = Rotation.random(random_state=rng).as_quat(scalar_first=True)
    momentum = random_axis(rng) * weakest * rng.uniform(0.5, 2.5)
    if rolling == "rubber":
        momentum[2] = 0.0
    frame_rate = float(rng.choice([-1, 1]) * rng.uniform(0.3, 2.5))
    return Scene(
        name=f"ball {number}", title="", source="", duration=10.0, rolling=rolling,
        ball=ball.with_hinges(command=(frame_rate, *spins)), start=Start(attitude, momentum),
    )  # fmt: skip
