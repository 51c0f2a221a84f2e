"""The quality of an engine's contact beside its path: forces, friction's cone, work and energy.

ContactBench (arXiv 2304.06372) holds engines to three laws. Of Coulomb's law `cone_violation` is
the residual, of the principle of maximum dissipation `slip_work` is what slip costs; in place of
Signorini's condition, which a rolling ball meets with equality, the force itself is compared.
"""

import numpy as np

from robotball.motion import ContactMotion, Motion
from robotball.rotations import Array, rotation_matrix
from validation.output import known

_UP = np.array([0.0, 0.0, 1.0])


def contact_quality(motion: ContactMotion, theory: Motion) -> dict[str, float | None]:
    """Return the residuals of a motion against the equations' at the same times, or their first.

    normal_force_error  the largest error of the normal force, over the weight
    cone_violation      how far friction is beyond its cone at most, over the cone
    slip_work           what friction takes by slip, over the kinetic energy at the start
    energy_error        the kinetic energy gained, or lost, over the reference's: the largest part

    None is of what is not known: the force, in engines that give none and at the start of those
    that give it by steps; energies of balls that are not balanced.
    """
    n, scene, report = slice(len(motion.times)), theory.scene, motion.report
    force = motion.loads.contact_force
    weight = scene.ball.mass * scene.gravity
    values = {
        "normal_force_error": np.abs(force - theory.loads.contact_force[n])[:, 2] / weight,
        "cone_violation": np.maximum(report.friction_used - 1.0, 0.0),
    }
    if not scene.not_reduced:
        energy, slip = kinetic_energy(motion, scene.ball.radius - report.depth)
        right, _ = kinetic_energy(theory, np.full(len(theory.times), scene.ball.radius))
        power = -np.einsum("ni,ni->n", np.nan_to_num(force), slip)
        work = np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(motion.times))
        values["slip_work"] = work[-1:] / right[0] if np.isfinite(force).any() else work * np.nan
        values["energy_error"] = energy / right[n] - 1.0
    names = ("normal_force_error", "cone_violation", "slip_work", "energy_error")
    return {name: _largest(values.get(name, np.array([]))) for name in names}


def kinetic_energy(motion: Motion, height: Array) -> tuple[Array, Array]:
    """Return the kinetic energy (n,) [J] of a balanced ball and its velocity of slip (n, 3) [m/s].

    height: (n,) m, of the centre above the plane. The centre's velocity v is that of M, which has
    r×mv in it: so it is known though the contact point's path is only sampled.
    """
    ball, up, R = motion.scene.ball, _UP, rotation_matrix(motion.attitude)
    omega, rates = motion.angular_velocity, motion.hinge_rates
    turning = omega @ ball.inertia + rates @ ball.gyrostatic_inertia.T
    L = np.cross(motion.momentum, up) if motion.scene.rolling == "rubber" else motion.momentum
    carried = L - np.einsum("nij,nj->ni", R, turning)
    v = np.cross(carried, up) / (ball.mass * height)[:, None]
    shell = np.einsum("nij,nj->ni", R, omega - rates[:, :1] * ball.shell.axis)
    # Each hinge's own inertia is along its axis, and its column the inertia times the axis.
    own = np.linalg.norm(ball.gyrostatic_inertia, axis=0)
    energy = (
        ball.mass * (v * v).sum(axis=1)
        + np.einsum("ni,ij,nj->n", omega, ball.inertia, omega)
        + 2 * np.einsum("ni,ij,nj->n", omega, ball.gyrostatic_inertia, rates)
        + rates**2 @ own
    ) / 2
    return energy, v - height[:, None] * np.cross(shell, up)


def _largest(values: Array) -> float | None:
    """Return the value that is farthest from 0, with its sign; None where none is known."""
    finite = values[np.isfinite(values)]
    return known(finite[np.abs(finite).argmax()]) if len(finite) else None
