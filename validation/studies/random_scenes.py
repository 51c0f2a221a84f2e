"""Random scenes: balls of mass points within their shell, in both rolling models."""

import numpy as np
from scipy.spatial.transform import Rotation

from robotball import Scene
from robotball.bodies import Ball, Frame, Rotor, Shell
from robotball.parameters import Rolling
from robotball.rotations import Array
from robotball.start import Start

SEED = 20190501


def random_scene(number: int) -> Scene:
    """A ball of mass points within its shell, 0 to 3 rotors, in axes that are not principal."""
    rng = np.random.default_rng([SEED, number])
    radius, mass = rng.uniform(0.5, 1.5), rng.uniform(0.3, 2.0)

    def direction() -> Array:
        v = rng.normal(size=3)
        return v / np.linalg.norm(v)

    shell_mass = mass * rng.uniform(0.05, 0.3)
    # Of points on the sphere, gathered towards its axis or its equator.
    axial = shell_mass * radius**2 * rng.uniform(0.4, 0.9)
    transverse = shell_mass * radius**2 - axial / 2
    shell = Shell(radius, shell_mass, axial, transverse, direction())
    rotors = []
    for _ in range(number % 4):
        rotor_mass, size = mass * rng.uniform(0.02, 0.1), radius * rng.uniform(0.3, 0.8)
        moment = rotor_mass * size**2
        rotors.append(Rotor(rotor_mass, moment, moment * rng.uniform(0.5, 0.8), direction()))
    points = rng.normal(size=(6, 3))
    points *= radius * rng.uniform(0.4, 1.0, size=(6, 1)) / np.linalg.norm(points, axis=1)[:, None]
    point_mass = (mass - shell_mass - sum(rotor.mass for rotor in rotors)) / 12
    tensors = [2 * point_mass * (r @ r * np.eye(3) - np.outer(r, r)) for r in points]
    frame = Frame(12 * point_mass, np.sum(tensors, axis=0))
    ball = Ball(shell, frame, tuple(rotors))
    rolling: Rolling = "rubber" if number % 2 else "classical"
    # Rates of both signs such that |A K| and |Ω| stay below 4 rad/s.
    weakest = float(np.linalg.eigvalsh(ball.inertia)[0] + ball.d)
    spins = tuple(
        rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * weakest / r.axial_inertia for r in rotors
    )
    attitude = Rotation.random(random_state=rng).as_quat(scalar_first=True)
    momentum = direction() * weakest * rng.uniform(0.5, 2.5)
    if rolling == "rubber":
        momentum[2] = 0.0
    return Scene(
        name=f"ball {number}", title="", source="", ball=ball, rolling=rolling,
        frame_rate=float(rng.choice([-1, 1]) * rng.uniform(0.3, 2.5)), rotor_rates=spins,
        start=Start(attitude, momentum), duration=10.0,
    )  # fmt: skip
