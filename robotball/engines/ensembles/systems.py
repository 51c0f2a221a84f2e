"""The systems of equations that are stepped, in plain arithmetic like equations.py.

All in the axes of section 3.3, in which M = -mα + cγ, and in unit quaternions: M is constant in
space, so an attitude is all there is to integrate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robotball import equations as eq
from robotball.engines.ensembles.flatten import along, slopes
from robotball.equations import Parameters, Quaternion, Scalar, Vector

State = Sequence[Scalar]


@dataclass(frozen=True)
class Level:
    """What stays constant, in the axes of section 3.3: M = -mα + cγ, kg m²/s."""

    m: Scalar
    c: Scalar

    def momentum(self, alpha: Vector, gamma: Vector) -> Vector:
        """M in frame axes."""
        return eq.subtract(eq.scale(self.c, gamma), eq.scale(self.m, alpha))


Seen = tuple[Scalar, Scalar, Scalar]
"""A section function's value, its rate [1/s], and what is above 0 on the section's own side."""


@dataclass(frozen=True)
class System:
    """Equations to step: their right-hand side and what of the state is of length one.

    rate: (state, parameters, level) -> d(state)/dt. units: the dimensions of the unit vectors
    that the state starts with; they are what the error is judged on, and they are brought back
    to length one at every step. The rest are quadratures of them. loose: times the tolerance that
    the error of each unit vector may be. section: (state, parameters, level, numbers of the
    section) -> what is seen of the section, if any is.
    """

    name: str
    size: int
    units: tuple[int, ...]
    rate: Callable[[State, Parameters, Level], State]
    loose: tuple[float, ...] = (1.0,)
    section: Callable[[State, Parameters, Level, State], Seen] | None = None

    @property
    def allowed(self) -> list[float]:
        """Times the tolerance that each number's error may be, of those that are judged."""
        return [times for n, times in zip(self.units, self.loose, strict=True) for _ in range(n)]


def path_rate(state: State, parameters: Parameters, level: Level) -> State:
    """d/dt of (q, X, Y): attitude and contact point."""
    q, alpha, beta, _, omega = turning(state, parameters, level)
    velocity = eq.contact_velocity(alpha, beta, omega, parameters.Omega, parameters.a)
    return (*eq.attitude_rate(q, omega), *velocity)


def attitude_rate(state: State, parameters: Parameters, level: Level) -> State:
    """d/dt of q alone."""
    q, _, _, _, omega = turning(state, parameters, level)
    return eq.attitude_rate(q, omega)


def deviation_rate(state: State, parameters: Parameters, level: Level) -> State:
    """d/dt of (q, ξ, ln growth, ln volume): a neighbouring orbit's direction and distance.

    A small turn ξ of the start, in frame axes, obeys dξ/dt = Dω·ξ - ω×ξ; its direction, of length
    one, and the logarithm of its length are kept apart.
    """
    q, alpha, _, gamma, omega = turning(state, parameters, level)
    xi: Vector = (state[4], state[5], state[6])
    moving_gamma = along(gamma, eq.cross(gamma, xi))
    moving_M = along(level.momentum(alpha, gamma), eq.cross(level.momentum(alpha, gamma), xi))
    change = slopes(parameters.angular_velocity(moving_M, moving_gamma))
    growth = eq.dot(xi, change)
    xi_rate = eq.subtract(eq.subtract(change, eq.cross(omega, xi)), eq.scale(growth, xi))
    return (*eq.attitude_rate(q, omega), *xi_rate, growth, parameters.divergence(gamma))


def turning(
    state: State, parameters: Parameters, level: Level
) -> tuple[Quaternion, Vector, Vector, Vector, Vector]:
    """q, α, β, γ and ω of a state that starts with q."""
    w, x, y, z = state[:4]
    alpha, beta, gamma = eq.unit_space_axes((w, x, y, z))
    omega = parameters.angular_velocity(level.momentum(alpha, gamma), gamma)
    return (w, x, y, z), alpha, beta, gamma, omega


def section_function(state: State, parameters: Parameters, level: Level, section: State) -> Seen:
    """sin(g - g₀), its rate and cos(g - g₀), all times √(1 - L²/f); of a state with q first.

    section: (cos g₀, sin g₀, m/√f, c/√f). With γ₀ = (m/√f)γ + (c/√f)α of (5.5) the definition of
    g reads √(1 - L²/f) (sin g, cos g) = (-β₃, -γ₀₃); no angle is needed.
    """
    cos_g, sin_g, across = section[:3]
    along_M = section[3] if parameters.rolling == "classical" else 0.0
    _, alpha, beta, gamma, omega = turning(state, parameters, level)
    node = eq.add(eq.scale(across, gamma), eq.scale(along_M, alpha))
    ahead = eq.subtract(eq.scale(sin_g, node), eq.scale(cos_g, beta))
    facing = -(cos_g * node[2] + sin_g * beta[2])
    return ahead[2], eq.cross(ahead, omega)[2], facing


def arc_function(state: State, parameters: Parameters, level: Level, arc: State) -> Seen:
    """(γ, n), its rate and (γ, e); of a state with q first.

    arc: n and e, unit vectors: half of the great circle across n, the half around e.
    """
    normal: Vector = (arc[0], arc[1], arc[2])
    middle: Vector = (arc[3], arc[4], arc[5])
    _, _, _, gamma, omega = turning(state, parameters, level)
    return eq.dot(normal, gamma), eq.dot(normal, eq.cross(gamma, omega)), eq.dot(middle, gamma)


# Of a neighbour's direction only the mean of its growth counts. Its error is some 10 times the
# attitude's, and judged alike it would set the step: a seventh more of them for the same exponents.
DIRECTION = 100.0

PATH = System("path", 6, (4,), path_rate)
RETURN = System("return", 4, (4,), attitude_rate, section=section_function)
ARC = System("arc", 4, (4,), attitude_rate, section=arc_function)
DEVIATION = System("deviation", 9, (4, 3), deviation_rate, loose=(1.0, DIRECTION))
