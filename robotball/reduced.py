"""Scene → Motion by the paper's equations: one rotation, integrated to round-off."""

from collections.abc import Callable, Iterable
from itertools import repeat

import numpy as np
from scipy.integrate import DOP853

from robotball import equations as eq
from robotball.bodies import imbalance
from robotball.errors import InputError
from robotball.loads import loads_of
from robotball.motion import Motion
from robotball.parameters import Parameters, as_vector
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from robotball.scene import Scene, check_times

TOLERANCE = 1e-13  # of one step, relative; near the least that double precision can judge


def integrate(scene: Scene, times: Array | None = None, rtol: float = TOLERANCE) -> Motion:
    """The motion of the ball by (3.2) or (3.3).

    M is constant in space, so the state is one unit quaternion q and the contact point:
    dq/dt = q∘ω(S(q)M₀, S(q)e_z, t)/2. times: (n,) s, increasing from 0; the scene's own if None.
    rtol: the error allowed in one step. Raises InputError on unusable times, for a ball that is
    not balanced, and where the equations run into a singularity.
    """
    times = scene.times if times is None else check_times(times)
    if offset := imbalance(scene.ball):
        raise InputError(f"{offset}, where the equations need it; MuJoCo alone can roll it")
    states = _solve(scene, times, rtol)
    attitude = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    axes = rotation_matrix(attitude)
    M = axes.transpose(0, 2, 1) @ scene.start.momentum
    omega = np.array(
        [
            parameters.angular_velocity(as_vector(M_now), as_vector(axes_now[2]))
            for parameters, M_now, axes_now in zip(_parameters(scene, times), M, axes, strict=True)
        ]
    )
    return Motion(
        times=times,
        contact_point=states[:, 4:],
        attitude=multiply(attitude, conjugate(scene.principal_quaternion)),
        momentum=np.einsum("nij,nj->ni", axes, M),
        angular_velocity=omega @ scene.principal_axes.T,
        hinge_angles=np.stack([drive.angle(times) for drive in scene.drives], axis=1),
        hinge_rates=np.stack([drive.rate(times) for drive in scene.drives], axis=1),
        loads=loads_of(scene, times, axes, omega),
    )


def _parameters(scene: Scene, times: Array) -> Iterable[Parameters]:
    """The numbers of the equations at each of the times."""
    if scene.steady:
        return repeat(scene.parameters, len(times))
    return map(scene.parameters_at, times.tolist())


def right_hand_side(scene: Scene) -> Callable[[float, Array], Array]:
    """d/dt of (q, X, Y): (6,) at time t, with q from principal axes to world, of any length."""
    MX, MY, MZ = as_vector(scene.start.momentum)
    parameters_at = (lambda _: scene.parameters) if scene.steady else scene.parameters_at

    def rate(t: float, state: Array) -> Array:
        w, x, y, z, _X, _Y = state.tolist()
        q = (w, x, y, z)
        parameters = parameters_at(t)
        alpha, beta, gamma = eq.space_axes(q)
        M = eq.add(eq.add(eq.scale(MX, alpha), eq.scale(MY, beta)), eq.scale(MZ, gamma))
        omega = parameters.angular_velocity(M, gamma)
        velocity = eq.contact_velocity(alpha, beta, omega, parameters.Omega, parameters.a)
        return np.array([*eq.attitude_rate(q, omega), *velocity])

    return rate


def _solve(scene: Scene, times: Array, rtol: float) -> Array:
    """States (n, 6) at the times, integrated anew from every breakpoint of the drives."""
    rate = right_hand_side(scene)
    states = np.empty((len(times), 6))
    states[0] = (*multiply(scene.start.attitude, scene.principal_quaternion), 0.0, 0.0)
    state, begin = states[0], 0.0
    for end in (*(t for t in scene.breakpoints if t < times[-1]), times[-1]):
        inside = (times > begin) & (times <= end)
        state, states[inside] = _solve_piece(rate, state, (begin, end), times[inside], rtol)
        begin = end
    return states


def _solve_piece(
    rate: Callable[[float, Array], Array],
    state: Array,
    span: tuple[float, float],
    times: Array,
    rtol: float,
) -> tuple[Array, Array]:
    """The state (6,) at the end of a smooth span and those (n, 6) at times in it, by DOP853."""
    states = np.empty((len(times), 6))
    # X and Y are only quadratures of q: an absolute tolerance keeps them from setting the step
    # where they pass zero.
    solver = DOP853(rate, span[0], state, span[1], rtol=rtol, atol=rtol)
    done = 0
    while solver.status == "running":
        message = solver.step()
        if message is not None:
            raise InputError(
                f"the equations could not be integrated past t = {solver.t:g} s: {message}"
            )
        reached = int(np.searchsorted(times, solver.t, side="right"))
        if reached > done:
            states[done:reached] = solver.dense_output()(times[done:reached]).T
            done = reached
        solver.y[:4] /= np.linalg.norm(solver.y[:4])
    return solver.y, states
