"""Section 2: the system, its constraints and energy, and the equations of motion.

Checked by point masses, which leave rounding, and along MuJoCo's motion. MuJoCo at "balanced"
leaves 2e-8 in 10 s, and the differences by which rates of ω and of the contact point are taken,
1e-6 and more.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robotball import equations as eq
from robotball import sample_times, simulate
from robotball.ball import Frame
from robotball.equations import as_vector
from robotball.rotations import Array, from_matrix, multiply
from robotball.scene import Start
from tests.paper import formulas as f
from tests.paper.claim import MINUS, Errors, Section, by
from tests.paper.engine_ball import (
    CLASSICAL,
    DRIVEN,
    EACH,
    INNER,
    MOTION,
    RUBBER,
    Seen,
    largest,
    rate,
    seen,
    seen_of,
)
from tests.paper.formulas import Numbers, cross, paper_scene
from tests.paper.point_masses import MASSES, Moment, moments, rolled

SECTION = Section("2. Equations of motion")
_PRINTED_INERTIA = "ma²(γ² - γ⊗γ), where I is …"
_DRAWN = "drawings; `robotball figures 3 4` has ours"
SECTION.unchecked("Figs 3-4", "the structure and the axes", _DRAWN)
claim = SECTION.claim

# The system ----------------------------------------------------------------------------------


@claim("2", "the inertia does not change in the frame's axes")
@by(MASSES, "the axes: the shell's", {"time": 0.3}, bound=3e-15, unit="kg m²")
def _mass_distribution(time: float = 0.0) -> Errors:
    """Compute the inertia of the point masses as shell and rotors turn on, in the frame's axes.

    time: s that these axes turn with the shell.
    """
    for moment in moments(21):
        ball = moment.ball.turned(0.3)
        carried = f.turned_about(ball.shell.axis, ball.shell.rate * time)
        change = carried.T @ ball.inertia(np.zeros(3)) @ carried
        yield change - moment.ball.inertia(np.zeros(3))


@claim("Remark 1", "α, β and γ stay orthonormal")
@by("scipy", "the sign of dβ/dt", bound=1e-11)
def _orthonormal(twist: float = 1.0) -> Errors:
    """Compare SSᵀ with E after 10 s of (2.6) and dγ/dt = γ×ω, integrated one by one, ω(t) any."""
    # An ω(t) that belongs to no ball: (2.6) holds for any, and no conserved quantity may help.
    swing = np.array([3.0, -2.0, 1.0])

    def turning(x: Array) -> Array:
        omega = swing * np.cos(swing * x[9])
        rows = [cross(v, omega) for v in x[:9].reshape(3, 3)]
        return np.concatenate([rows[0], twist * rows[1], rows[2], [1.0]])

    start = np.concatenate([f.E.ravel(), [0.0]])
    S = f.followed(turning, start, np.array([0.0, 10.0]))[-1, :9].reshape(3, 3)
    yield S @ S.T - f.E


@claim("2", "ω̂ = dS/dt Sᵀ")
@by(MOTION, "the sign of ω̂", bound=4e-6, unit="rad/s")
def _quasi_velocities(twist: float = 1.0) -> Errors:
    """Compare dS/dt Sᵀ, by differences of MuJoCo's attitude, with its ω."""
    ball = seen(RUBBER)
    S = ball.axes.transpose(0, 2, 1)
    found = rate(S) @ S[INNER].transpose(0, 2, 1)
    expected = np.array([twist * f.hat(omega) for omega in ball.omega[INNER]])
    yield largest((found - expected).reshape(len(found), 9))


# Constraints ---------------------------------------------------------------------------------


@claim("(2.1)", "v + aγ×(ω - Ω) = 0")
@by(MOTION, "the sign of Ω", bound=6e-6, unit="m/s")
def _no_slip(twist: float = 1.0) -> Errors:
    """Compute v + aγ×(ω - Ω) of (2.1)."""
    for ball in map(seen, EACH):
        rolled_on = ball.of(lambda n, w, gamma: n.a * cross(gamma, w - twist * n.Omega))[INNER]
        yield largest(ball.centre_velocity + rolled_on)


@claim("(2.2)", "rubber: (ω - Ω, γ) = 0")
@by(MOTION, "the sign of Ω", bound=1e-7, unit="rad/s")
def _no_spin(twist: float = 1.0) -> Errors:
    """Compute (ω - Ω, γ) of (2.2)."""
    for ball in (seen(RUBBER), seen(DRIVEN)):
        yield ball.of(lambda n, w, gamma: (w - twist * n.Omega) @ gamma)


# Energy ------------------------------------------------------------------------------------


@claim("2", "T = mv²/2 + (ω, Iω)/2 + (k, ω)")
@by(MASSES, "the sign of k", bound=3e-14, unit="J")
def _kinetic_energy(twist: float = 1.0) -> Errors:
    """Compare Σ mu²/2 with mv²/2 + (ω, Iω)/2 + (k, ω), less its value where v = ω = 0."""
    for moment in moments(22):
        ball, n, w, v = moment.ball, moment.ball.numbers, moment.omega, moment.v
        # The paper's T leaves out the energy of the turning inside, which neither v nor ω changes.
        T = ball.momenta(v, w)[2] - ball.momenta(0 * v, 0 * w)[2]
        formula = ball.mass * v @ v / 2 + w @ n.I @ w / 2 + twist * n.k @ w
        yield T - formula


@claim("2", "k = Σ jφ̇n - J_sΩ")
@by(MASSES, "the sign of J_s", bound=9e-15, unit="kg m²/s")
def _gyrostatic_momentum(twist: float = 1.0) -> Errors:
    """Compare Σ r×mu with Iω + k, where k = Σ jφ̇n - J_sΩ."""
    for moment in moments(23):
        ball, n = moment.ball, moment.ball.numbers
        turning = [r.moment(r.axis) * r.rate * r.axis for r in ball.rotors]
        k = sum(turning, np.zeros(3)) - twist * ball.shell.moment(ball.shell.axis) * n.Omega
        yield ball.momenta(moment.v, moment.omega)[1] - (n.I @ moment.omega + k)


def _plane_force(ball: Seen) -> Array:
    """Return λ (n, 3) of MuJoCo's contact, without the weight's part, in frame axes."""
    in_space = ball.motion.loads.contact_force.copy()
    in_space[:, 2] = 0.0  # the centre stays at its height, so λ has no vertical part
    return np.einsum("nij,ni->nj", ball.axes, in_space)


@claim("(2.3)", "both lines, with the contact's λ and λ₀")
@by(MOTION, "sign of ∂f/∂ω", bound=2e-4, unit="N, N m")
def _poincare_suslov(twist: float = 1.0) -> Errors:
    """Compare both lines of (2.3), the rates of Iω + k and mv, with MuJoCo's λ at -aγ and λ₀."""
    for ball in map(seen, EACH):
        n, force = ball.numbers[0], _plane_force(ball)
        mass, a = n.d / n.a**2, n.a
        v, turning = mass * ball.centre_velocity, ball.of(lambda n, w, _: n.I @ w + n.k)
        # v is known by differences already, so that its rate loses samples at both ends again.
        push = rate(v) + np.cross(ball.omega[INNER][INNER], v[INNER]) - force[INNER][INNER]
        twisting = ball.motion.loads.spin_torque[:, None] * ball.gamma
        torque = -twist * a * np.cross(ball.gamma, force) + twisting
        spun = rate(turning) + (np.cross(ball.omega, turning) - torque)[INNER]
        yield largest(push)
        yield largest(spun)


@claim("Remark 3", "gravity has no part")
@by(MOTION, "the centre of mass", {"off": 1e-5}, bound=1e-11, unit="m")
def _without_gravity(off: float = 0.0) -> Errors:
    """Compare MuJoCo's paths at 9.81 and 3.7 m/s², with the frame's centre of mass off by [m]."""
    scene = paper_scene(RUBBER)
    # Two gravities roll the same path only if the centre of mass is the centre: 10 µm show.
    frame = Frame(scene.ball.frame.mass, scene.ball.frame.inertia, off * f.E[2])
    scene = scene.with_hinges(body={"frame": frame})
    times = sample_times(5.0)
    paths = [simulate(replace(scene, gravity=g), times).contact_point for g in (9.81, 3.7)]
    yield largest(paths[0] - paths[1])


@claim("2", "λ = -maγ×(ω̇ - Ω̇) - …")
@by(MOTION, "the sign of its last term", bound=3e-5, unit="N")
def _reaction(twist: float = 1.0) -> Errors:
    """Compare λ after (2.3), with dω/dt by differences, with MuJoCo's contact force."""
    for ball in map(seen, EACH):
        found = []
        for n, w, gamma, w_rate in zip(
            ball.numbers[INNER], ball.omega[INNER], ball.gamma[INNER], rate(ball.omega), strict=True
        ):
            shell = w - n.Omega
            turning = cross(gamma, w_rate - n.Omega_rate) + cross(cross(gamma, w), shell)
            found.append(-n.d / n.a * (turning + twist * cross(w, cross(gamma, shell))))
        yield largest(np.array(found) - _plane_force(ball)[INNER])


def _by_masses(seed: int, rubber: bool) -> Iterator[tuple[Moment, Numbers, Array, Array, float]]:
    """Yield random point-mass balls, their numbers, ω with (2.2) if `rubber`, dω/dt and λ₀."""
    for moment in moments(seed):
        n, omega = moment.ball.numbers, moment.omega
        if rubber:
            # The acceleration follows from a state that satisfies (2.2); any other has no rubber
            # motion.
            omega = f.level(omega, moment.gamma) + (n.Omega @ moment.gamma) * moment.gamma
        yield moment, n, omega, *rolled(moment.ball, omega, moment.gamma, rubber)


@claim("(2.4)", "rubber: dω/dt")
@by(MASSES, "the sign of W", bound=2e-13, unit="rad/s²", rubber=True)
@claim("(2.4)", "classical: dω/dt")
@by(MASSES, "the sign of W", bound=2e-13, unit="rad/s²", rubber=False)
def _full_equations(rubber: bool, twist: float = 1.0) -> Errors:
    """Compare dω/dt of (2.4), with the λ₀ that Newton and Euler give, with theirs."""
    for moment, n, omega, omega_rate, spin_torque in _by_masses(24, rubber):
        torque = f.gyroscopic_torque(n, omega, moment.gamma)
        torque = torque + spin_torque * moment.gamma
        torque = torque + twist * f.drive_torque(n, omega, moment.gamma)
        yield np.linalg.solve(f.contact_inertia(n, moment.gamma), torque) - omega_rate


def _ours(n: Numbers, omega: Array, gamma: Array) -> Array:
    """Return dω/dt and λ₀ (4,) of a rubber ball by robotball."""
    w, vertical, I = map(as_vector, (omega, gamma, np.diag(n.I)))
    Omega, Omega_rate, k, k_rate = map(as_vector, (n.Omega, n.Omega_rate, n.k, n.k_rate))
    omega_rate, spin_torque = eq.full_angular_acceleration(
        w, vertical, Omega, Omega_rate, k, k_rate, I, n.d, spin_free=True
    )
    return np.array([*omega_rate, spin_torque])


@claim("(2.4)", "dω/dt while Ω and k change")
@by(MOTION, "the sign of λ₀", bound=3e-5, unit="rad/s²")
def _driven_equations(twist: float = 1.0) -> Errors:
    """Compare dω/dt of (2.4)-(2.5) with differences of MuJoCo's ω, while the rates swing."""
    ball = seen(DRIVEN)
    found = ball.of(lambda n, w, g: f.full_rates(n, w, g, twist)[0])
    yield largest(rate(ball.omega) - found[INNER])
    yield largest(rate(ball.omega) - ball.of(_ours)[INNER, :3])


@claim("E4, (2.4)", "Ĩ = I + ma²(γ²E - γ⊗γ), about the contact point", _PRINTED_INERTIA)
@by(MASSES, "the sign of γ²", bound=1e-14, unit="kg m²", printed={"unit_matrix": np.ones((3, 3))})
def _contact_inertia(twist: float = 1.0, unit_matrix: Array = f.E) -> Errors:
    """Compare Ĩ with Σ m(r²E - r⊗r) about the contact point.

    As printed, γ² is taken from each of its entries.
    """
    for moment in moments(26):
        ball, n, gamma = moment.ball, moment.ball.numbers, moment.gamma
        tilde = n.I + n.d * (twist * gamma @ gamma * unit_matrix - np.outer(gamma, gamma))
        yield ball.inertia(-ball.a * gamma) - tilde


@claim("(2.5)", "λ₀, with Ω and k changing")
@by(MASSES, "the sign of Ω̇", bound=4e-14, unit="N m")
def _multiplier(twist: float = 1.0) -> Errors:
    """Compare λ₀ of (2.5) with the spin torque of Newton and Euler's equations."""
    for moment, n, omega, _, spin_torque in _by_masses(25, rubber=True):
        change = twist * n.Omega_rate
        found = f.full_rates(replace(n, Omega_rate=change), omega, moment.gamma)[1]
        yield found - spin_torque


@claim("(2.5)", "λ₀ is the torque of the contact")
@by(MOTION, "the sign of λ₀", bound=6e-8, unit="N m")
def _contact_torque(twist: float = 1.0) -> Errors:
    """Compare λ₀ of (2.5) with the torque that MuJoCo's contact feels, while the rates swing."""
    ball = seen(DRIVEN)
    paper = ball.of(lambda *state: f.full_rates(*state)[1])
    for found in (twist * paper, ball.of(_ours)[:, 3]):
        yield largest(found - ball.motion.loads.spin_torque)


@claim("E3, (2.5)", "the rate of (2.2): … - (Ω̇, γ) = 0", "… + (Ω̇, γ) = 0")
@by(MASSES, "the sign of (Ω̇, γ)", bound=4e-14, unit="rad/s²", printed=MINUS)
def _constraint_rate(twist: float = 1.0) -> Errors:
    """Compute (Ĩω̇, Ĩ⁻¹γ) - (Ω, γ×ω) - (Ω̇, γ) of rubber balls of point masses, and + (Ω̇, γ)."""
    for moment, n, omega, omega_rate, _ in _by_masses(27, rubber=True):
        tilde, gamma = f.contact_inertia(n, moment.gamma), moment.gamma
        first = tilde @ omega_rate @ np.linalg.solve(tilde, gamma)
        rest = first - n.Omega @ cross(gamma, omega)
        yield rest - twist * n.Omega_rate @ gamma


@claim("(2.6)", "dα/dt = α×ω, dβ/dt = β×ω")
@by(MOTION, "the sign of both", bound=3e-5, unit="rad/s")
def _reconstruction(twist: float = 1.0) -> Errors:
    """Compare the rates of α and β, by differences of MuJoCo's attitude, with (2.6)."""
    for ball in map(seen, EACH):
        for axis in (ball.axes[:, 0], ball.axes[:, 1]):
            turning = twist * np.cross(axis, ball.omega)[INNER]
            yield largest(rate(axis) - turning)
        q, omega = ball.motion.attitude, ball.motion.angular_velocity
        ours = np.stack(eq.attitude_rate(tuple(q.T), tuple(omega.T)), axis=1)
        yield largest(rate(q) - ours[INNER])
        axes: Array = np.array(eq.space_axes(tuple(q.T))).transpose(2, 0, 1)
        yield np.abs(axes @ ball.motion.scene.principal_axes - ball.axes).max()


@claim("(2.7)", "Ẋ = a(β, ω - Ω), Ẏ = -a(α, ω - Ω)")
@by(MOTION, "the sign of Ẏ", bound=6e-6, unit="m/s")
def contact_point(twist: float = 1.0) -> Errors:
    """Compare Ẋ and Ẏ, by differences of MuJoCo's path, with (2.7): a(β, ω-Ω) and -a(α, ω-Ω)."""
    for ball in map(seen, EACH):
        shell = ball.of(lambda n, w, _: n.a * (w - n.Omega))
        alpha, beta = ball.axes[:, 0], ball.axes[:, 1]
        yield ball.path_error((beta * shell).sum(axis=1), -twist * (alpha * shell).sum(axis=1))
        Omega = ball.of(lambda n, *_: n.Omega)
        X, Y, w, drive = (tuple(each.T) for each in (alpha, beta, ball.omega, Omega))
        yield ball.path_error(*eq.contact_velocity(X, Y, w, drive, ball.numbers[0].a))


# The rubber ball has no such control: its M has to stay horizontal.
_ABOUT_OX = {"axis": 0, "names": [CLASSICAL]}


@claim("Remark 4", "turned about OZ, ω and γ stay the same")
@by(MOTION, "OX for OZ", _ABOUT_OX, bound=3e-10, unit="rad/s, m")
def _plane_symmetry(axis: int = 2, names: Sequence[str] = (RUBBER, CLASSICAL)) -> Errors:
    """Compare ω, γ and the path of MuJoCo's ball with those turned 0.7 rad about an axis."""
    for name in names:
        scene, ball = paper_scene(name), seen(name)
        # An angle that is no part of a turn, so that no symmetry of the ball maps it on itself.
        turn = f.turned_about(f.E[axis], 0.7)
        turned = Start(
            multiply(from_matrix(turn), scene.start.attitude), turn @ scene.start.momentum
        )
        other = seen_of(replace(scene, start=turned), 10.0)
        path = ball.motion.contact_point @ turn[:2, :2].T
        yield largest(other.omega - ball.omega)
        yield largest(other.gamma - ball.gamma)
        yield largest(other.motion.contact_point - path)
