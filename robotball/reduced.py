"""Scene → Motion by the paper's equations: one rotation, integrated to round-off."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853

from robotball import equations as eq
from robotball.errors import InputError
from robotball.motion import Motion
from robotball.parameters import Parameters
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from robotball.scene import Scene, check_times

TOLERANCE = 1e-13  # of one step, relative; near the least that double precision can judge


def integrate(scene: Scene, times: Array | None = None, rtol: float = TOLERANCE) -> Motion:
    """The motion of the ball by (3.2) or (3.3).

    M is constant in space, so the state is one unit quaternion q and the contact point:
    dq/dt = q∘ω(S(q)M₀, S(q)e_z)/2. times: (n,) s, increasing from 0; the scene's own if None.
    rtol: the error allowed in one step. Raises InputError on unusable times.
    """
    times = scene.times if times is None else check_times(times)
    to_principal = scene.principal_quaternion
    q0 = multiply(scene.start.attitude, to_principal)
    states = _solve(right_hand_side(scene.parameters, scene.start.momentum), q0, times, rtol)
    attitude = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    axes = rotation_matrix(attitude)
    M = axes.transpose(0, 2, 1) @ scene.start.momentum
    omega = scene.parameters.angular_velocity(tuple(M.T), tuple(axes[:, 2, :].T))
    M_world = np.einsum("nij,nj->ni", axes, M)
    rates = np.array([scene.frame_rate, *scene.rotor_rates])
    return Motion(
        times=times,
        contact_point=states[:, 4:],
        attitude=multiply(attitude, conjugate(to_principal)),
        momentum=M_world,
        angular_velocity=np.stack(omega, axis=1) @ scene.principal_axes.T,
        hinge_angles=times[:, None] * rates,
    )


def right_hand_side(parameters: Parameters, momentum: Array) -> Callable[[float, Array], Array]:
    """d/dt of (q, X, Y): (6,) at time t, for M (3,) in world axes. Any length of q will do."""
    MX, MY, MZ = (float(component) for component in momentum)

    def rate(_: float, state: Array) -> Array:
        w, x, y, z, _X, _Y = state.tolist()
        q = (w, x, y, z)
        alpha, beta, gamma = eq.space_axes(q)
        M = eq.add(eq.add(eq.scale(MX, alpha), eq.scale(MY, beta)), eq.scale(MZ, gamma))
        omega = parameters.angular_velocity(M, gamma)
        velocity = eq.contact_velocity(alpha, beta, omega, parameters.Omega, parameters.a)
        return np.array([*eq.attitude_rate(q, omega), *velocity])

    return rate


def _solve(rate: Callable[[float, Array], Array], q0: Array, times: Array, rtol: float) -> Array:
    """States (n, 6) at the times, by DOP853 with q brought back to length one at every step."""
    states = np.empty((len(times), 6))
    states[0] = (*q0, 0.0, 0.0)
    # X and Y are only quadratures of q: an absolute tolerance keeps them from setting the step
    # where they pass zero.
    solver = DOP853(rate, 0.0, states[0], times[-1], rtol=rtol, atol=rtol)
    done = 1
    while done < len(times):
        message = solver.step()
        if solver.status == "failed":
            raise InputError(
                f"the equations could not be integrated past t = {solver.t:g} s: {message}"
            )
        reached = int(np.searchsorted(times, solver.t, side="right"))
        if reached > done:
            states[done:reached] = solver.dense_output()(times[done:reached]).T
            done = reached
        solver.y[:4] /= np.linalg.norm(solver.y[:4])
    return states
