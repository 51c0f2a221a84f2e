"""A ball of point masses and its Newton–Euler equations: sums over points, without I, k, K or M.

The shell is a ring and two poles, a rotor is a ring, and the frame is a cloud of points with a
counterweight that puts the ball's centre of mass at its centre. Frame axes, SI units.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robotball.rotations import Array, on_circle, tangents
from tests.paper.formulas import Numbers, cross, unit

_RING = 6  # points; three or more make a ring dynamically symmetric


@dataclass(frozen=True)
class Body:
    """Points (p, 3) about a centre (3,), rotating about an axis (3,) at a changing rate."""

    masses: Array
    points: Array
    centre: Array
    axis: Array
    rate: float = 0.0
    rate_rate: float = 0.0

    def moment(self, axis: Array) -> float:
        """Return Σ m r² about an axis through its centre."""
        away = self.points - np.outer(self.points @ axis, axis)
        return float(self.masses @ (away * away).sum(axis=1))

    @property
    def mass(self) -> float:
        return float(self.masses.sum())


@dataclass(frozen=True)
class Ball:
    """The shell, the frame and the rotors, of radius a."""

    shell: Body
    frame: Body
    rotors: tuple[Body, ...]
    a: float

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (self.shell, self.frame, *self.rotors)

    @property
    def mass(self) -> float:
        return sum(body.mass for body in self.bodies)

    @property
    def Omega(self) -> Array:
        """Ω; the shell rotates at -Ω relative to the frame."""
        return -self.shell.rate * self.shell.axis

    @property
    def numbers(self) -> Numbers:
        """The constants of (A.3) with the Steiner terms of E21: k = Σ jφ̇n - J_sΩ, K = k - dΩ."""
        d, J_s = self.mass * self.a**2, self.shell.moment(self.shell.axis)
        Omega_rate = -self.shell.rate_rate * self.shell.axis
        k, k_rate = -J_s * self.Omega, -J_s * Omega_rate
        for rotor in self.rotors:
            k = k + rotor.moment(rotor.axis) * rotor.rate * rotor.axis
            k_rate = k_rate + rotor.moment(rotor.axis) * rotor.rate_rate * rotor.axis
        K = k - d * self.Omega
        return Numbers(self.inertia(np.zeros(3)), d, self.Omega, K, self.a, Omega_rate, k_rate)

    def inertia(self, about: Array) -> Array:
        """Return Σ m(r²E - r⊗r) (3, 3) about a point."""
        total = np.zeros((3, 3))
        for body in self.bodies:
            for mass, r in zip(body.masses, body.centre + body.points - about, strict=True):
                total += mass * (r @ r * np.eye(3) - np.outer(r, r))
        return total

    def momenta(self, v: Array, omega: Array) -> tuple[Array, Array, float]:
        """Return Σ mu, Σ r×mu about the centre, and Σ mu²/2, at the velocities of the points."""
        p, G, T = np.zeros(3), np.zeros(3), 0.0
        for body in self.bodies:
            spin = omega + body.rate * body.axis
            u = v + np.cross(omega, body.centre) + np.cross(spin, body.points)
            p = p + body.masses @ u
            G = G + body.masses @ np.cross(body.centre + body.points, u)
            T += float(body.masses @ (u * u).sum(axis=1)) / 2
        return p, G, T

    def rates(self, v: Array, omega: Array, v_rate: Array, omega_rate: Array) -> Array:
        """Return Σ m du/dt and Σ r×m du/dt (6,) for these rates of v and ω in frame axes."""
        total = np.zeros(6)
        for body in self.bodies:
            spin = omega + body.rate * body.axis
            spin_rate = (
                omega_rate + body.rate_rate * body.axis + body.rate * cross(omega, body.axis)
            )
            centre = v_rate + cross(omega, v) + cross(omega_rate, body.centre)
            centre = centre + cross(omega, cross(omega, body.centre))
            point = np.cross(spin_rate, body.points)
            point = point + np.cross(spin, np.cross(spin, body.points))
            force = body.masses[:, None] * (centre + point)
            total[:3] += force.sum(axis=0)
            total[3:] += np.cross(body.centre + body.points, force).sum(axis=0)
        return total

    def turned(self, time: float) -> "Ball":
        """Return the ball after its shell and rotors have rotated for a time."""

        def rotated(body: Body) -> Body:
            along = np.outer(body.points @ body.axis, body.axis)
            side = np.cross(body.axis, body.points)
            cos, sin = np.cos(body.rate * time), np.sin(body.rate * time)
            return replace(body, points=along + cos * (body.points - along) + sin * side)

        return Ball(rotated(self.shell), self.frame, tuple(map(rotated, self.rotors)), self.a)


def rolled(ball: Ball, omega: Array, gamma: Array, rubber: bool) -> tuple[Array, float]:
    """Return dω/dt and λ₀ of the Newton–Euler equations with (2.1), and with (2.2) if `rubber`.

    The plane applies the force λ at -aγ and the torque λ₀ about γ. Gravity acts at the centre and
    is left out.
    """
    n = ball.numbers
    relative = omega - n.Omega
    v = -ball.a * cross(gamma, relative)
    gamma_rate = cross(gamma, omega)

    def equations(x: Array) -> Array:
        omega_rate, v_rate, force, torque = x[:3], x[3:6], x[6:9], x[9]
        balance = ball.rates(v, omega, v_rate, omega_rate)
        balance[:3] -= force
        balance[3:] -= -ball.a * cross(gamma, force) + torque * gamma
        # Constraints differentiated once: the unknowns are accelerations.
        slip = v_rate + ball.a * cross(gamma_rate, relative)
        slip = slip + ball.a * cross(gamma, omega_rate - n.Omega_rate)
        spin = (omega_rate - n.Omega_rate) @ gamma + relative @ gamma_rate
        return np.concatenate([balance, slip, [spin if rubber else torque]])

    # The equations are linear in the ten unknowns, so differences give the matrix.
    at_zero = equations(np.zeros(10))
    columns = np.stack([equations(column) - at_zero for column in np.eye(10)], axis=1)
    x: Array = np.linalg.solve(columns, -at_zero).astype(float)
    return x[:3], float(x[9])


@dataclass(frozen=True)
class Moment:
    """A ball of point masses with a state: ω, γ and v (3,)."""

    ball: Ball
    omega: Array
    gamma: Array
    v: Array


def moments(seed: int, count: int = 20, rotors: int = 2, centred: bool = False) -> Iterator[Moment]:
    """Yield random balls and states; the rotors are off centre unless `centred`."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        omega, gamma, v = random.normal(size=(3, 3))
        ball = _some_ball(random, rotors, 0.0 if centred else 0.3)
        yield Moment(ball, omega, unit(gamma), v)


def _some_ball(random: np.random.Generator, rotors: int, off_centre: float) -> Ball:
    """Return a random ball with rotors about `off_centre` off its centre [m]."""
    rings = [
        ring_of_points(
            random, 0.2, random.normal(size=3) * off_centre, random.normal(size=2) * [30.0, 10.0]
        )
        for _ in range(rotors)
    ]
    shell = ring_of_points(random, 1.0, np.zeros(3), random.normal(size=2))
    # A ring alone has J = 2I; two poles on the axis change that ratio.
    poles = random.uniform(0.3, 1.0) * np.stack([shell.axis, -shell.axis])
    shell = replace(
        shell,
        masses=np.append(shell.masses, [0.05, 0.05]),
        points=np.concatenate([shell.points, poles]),
    )
    points, masses = random.normal(size=(5, 3)) * 0.4, random.uniform(0.05, 0.2, 5)
    # The last point puts the centre of mass at the centre of the sphere.
    off = masses @ points + sum((ring.mass * ring.centre for ring in rings), np.zeros(3))
    masses, points = np.append(masses, 0.3), np.concatenate([points, [-off / 0.3]])
    frame = Body(masses, points, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return Ball(shell, frame, tuple(rings), a=random.uniform(0.8, 1.2))


def ring_of_points(random: np.random.Generator, radius: float, centre: Array, rates: Array) -> Body:
    """Return a ring of points about a random axis, with its rate and acceleration."""
    axis = unit(random.normal(size=3))
    angles = np.linspace(0.0, 2 * np.pi, _RING, endpoint=False)
    points = radius * on_circle(tangents(axis), angles)
    masses = np.full(_RING, random.uniform(0.01, 0.05))
    return Body(masses, points, centre, axis, float(rates[0]), float(rates[1]))
