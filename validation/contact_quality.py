"""The quality of an engine's contact beside its path: forces, friction's cone, work and energy.

ContactBench (arXiv 2304.06372) holds engines to three laws. Of Coulomb's law `cone_violation` is
the residual, of the principle of maximum dissipation `slip_work` is what slip costs; in place of
Signorini's condition, which a rolling ball meets with equality, the force itself is compared.
"""

import numpy as np
from scipy.integrate import trapezoid

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

    None where it is not known: forces of engines that give none, energies of balls that are not
    balanced.
    """
    n, ball = slice(len(motion.times)), theory.scene.ball
    off = motion.loads.normal_force - theory.loads.normal_force[n]
    # The first sample is of the start, before any step.
    found = {
        "normal_force_error": np.abs(off[1:]).max(initial=0.0) / (ball.mass * theory.scene.gravity),
        "cone_violation": (motion.report.friction_used[1:] - 1.0).max(initial=0.0),
        "slip_work": np.nan,
        "energy_error": np.nan,
    }
    if not theory.scene.not_reduced:
        energy, slip = kinetic_energy(motion, motion.report.depth)
        right, _ = kinetic_energy(theory, 0.0 * theory.times)
        power = -(motion.loads.contact_force * slip).sum(axis=1)
        found["slip_work"] = trapezoid(power[1:], motion.times[1:]) / right[0]
        error = energy / right[n] - 1.0
        found["energy_error"] = error[np.abs(error).argmax()]
    return {name: known(value) for name, value in found.items()}


def kinetic_energy(motion: Motion, depth: Array) -> tuple[Array, Array]:
    """Return the kinetic energy (n,) [J] of a balanced ball and its velocity of slip (n, 3) [m/s].

    depth: (n,) m, of the plane in the shell. The centre's velocity v is that of M, which has r×mv
    in it: so it is known though the contact point's path is only sampled.
    """
    ball, R = motion.scene.ball, rotation_matrix(motion.attitude)
    omega, rates = motion.angular_velocity, motion.hinge_rates
    arm = (ball.radius - depth)[:, None]
    k = rates @ ball.gyrostatic_inertia.T
    L = np.cross(motion.momentum, _UP) if motion.scene.rolling == "rubber" else motion.momentum
    carried = L - np.einsum("nij,nj->ni", R, omega @ ball.inertia + k)
    v = np.cross(carried, _UP) / (ball.mass * arm)
    shell = np.einsum("nij,nj->ni", R, omega - rates[:, :1] * ball.shell.axis)
    # A hinge's column of gyrostatic inertia is along its axis, and as long as its inertia.
    own = rates**2 @ np.linalg.norm(ball.gyrostatic_inertia, axis=0)
    turning = (omega * (omega @ ball.inertia + 2 * k)).sum(axis=1)
    energy = (ball.mass * (v * v).sum(axis=1) + turning + own) / 2
    return energy, v - arm * np.cross(shell, _UP)
