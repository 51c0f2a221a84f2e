"""Integrate the paper's reduced equations (3.2) and (3.3) to round-off.

M is constant in space, so the state is a rotation, with the contact point as its quadrature. Short
motions use DOP853, long ones at steady rates the compiled steps of ensembles/.
"""

import math
from dataclasses import replace
from functools import partial
from importlib.metadata import version

import numpy as np

from robotball.motion import Label, Motion, Progress, ReferenceMotion, extended, joined, pieces
from robotball.robot import formulas as eq
from robotball.robot.formulas import as_vector, check_speed
from robotball.robot.loads import loads_of
from robotball.robot.scene import Scene
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL, Compensated, Rate, one_by_one, take_step

LABEL = Label("equations", version("robotball"), "#D55E00")  # vermillion of Okabe and Ito's set

# Largest angle [rad], from the bound on |ω|, for which DOP853 is used. It then takes seconds. The
# compiled step takes a hundredth of this time, but its code must be loaded first.
_LONG = 1e4
# The largest numbers of steps take one to three minutes. At usual rates they are enough for a
# motion of a day with DOP853, and of a month with compiled steps.
_MAX_STEPS, _MAX_COMPILED_STEPS = 1_000_000, 100_000_000
_ASTRAY = 1e100  # length of a quaternion in a failed trial step; its square would overflow
_COARSER = 4.0  # factor of the tolerance for the motion that estimates the error


def integrate(
    scene: Scene,
    times: Array,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> ReferenceMotion:
    """Integrate the ball's motion with (3.2) or (3.3), with an estimate of its error.

    The state is a unit quaternion q and the contact point: dq/dt = q∘ω(S(q)M₀, S(q)e_z, t)/2.
    times: (n,) s, increasing from 0; rtol: the relative error allowed in one step; max_steps: the
    largest number of steps; progress: called with the fraction of the motion that is complete.
    Raises InputError if these equations do not describe the scene, if the motion needs more than
    max_steps, or if a step becomes too short.
    """
    scene.check_reduced()
    whole = scene.until(float(times[-1]))
    if scene.plane_moves:
        from robotball.theory.plane import check_pressed  # few scenes need it

        check_pressed(whole)
    size = np.array([math.hypot(*whole.start.momentum.tolist())])
    fastest = check_speed(whole.parameters_at(0.0), size)[0]
    long = whole.steady and fastest * times[-1] > _LONG
    limit = (_MAX_COMPILED_STEPS if long else _MAX_STEPS) if max_steps is None else max_steps

    def states(coarser: float, progress: Progress | None = None) -> Array:
        if long:
            return compiled_states(whole, times, coarser * max(rtol / 10, LEAST_RTOL), limit)
        return _solve(whole, times, coarser * rtol, limit, progress)

    more = {"scene": scene, "again": lambda: states(_COARSER)[:, 4:]}
    return extended(motion_of(whole, times, states(1.0, progress)), ReferenceMotion, **more)


def motion_of(scene: Scene, times: Array, states: Array) -> Motion:
    """Return the motion of states (n, 6) = (q, X, Y), q from principal axes to world."""
    parts = (_part(scene, times[piece], states[piece]) for piece in pieces(len(times)))
    return replace(joined(parts, len(times)), times=times)


def _part(scene: Scene, times: Array, states: Array) -> Motion:
    attitude = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    axes = rotation_matrix(attitude)
    M = axes.transpose(0, 2, 1) @ scene.start.momentum
    omega = _angular_velocity(scene, times, M, axes[:, 2])
    return Motion(
        scene=scene, engine=LABEL, times=times, contact_point=states[:, 4:],
        attitude=multiply(attitude, conjugate(scene.principal_quaternion)),
        momentum=np.einsum("nij,nj->ni", axes, M), angular_velocity=omega @ scene.principal_axes.T,
        hinge_angles=np.stack([drive.angle(times) for drive in scene.drives], axis=1),
        hinge_rates=np.stack([drive.rate(times) for drive in scene.drives], axis=1),
        loads=loads_of(scene, times, axes, omega),
    )  # fmt: skip


def _angular_velocity(scene: Scene, times: Array, M: Array, gamma: Array) -> Array:
    """Return ω (n, 3) at n times, all in principal axes."""
    if scene.steady:
        return np.stack(scene.parameters.angular_velocity(tuple(M.T), tuple(gamma.T)), axis=1)
    rows = zip(map(scene.parameters_at, times.tolist()), M, gamma, strict=True)
    return np.array([at.angular_velocity(as_vector(m), as_vector(v)) for at, m, v in rows])


def _right_hand_side(scene: Scene) -> Rate:
    """Return the derivative of (q, X, Y) as a function of time, q from principal axes to world."""
    momentum = as_vector(scene.start.momentum)
    parameters_at = (lambda _: scene.parameters) if scene.steady else scene.parameters_at

    def rate(t: float, state: Array) -> Array:
        # Plain floats: with NumPy arrays an orbit takes fifteen times as long.
        w, x, y, z, _X, _Y = state.tolist()
        if not math.hypot(w, x, y, z) < _ASTRAY:
            return np.full(6, np.nan)
        q = (w, x, y, z)
        parameters = parameters_at(t)
        alpha, beta, gamma = axes = eq.space_axes(q)
        M = eq.seen_from_frame(momentum, axes)
        omega = parameters.angular_velocity(M, gamma)
        velocity = eq.contact_velocity(alpha, beta, omega, parameters.Omega, parameters.a)
        return np.array([*eq.attitude_rate(q, omega), *velocity])

    return rate


def compiled_states(
    scene: Scene, times: Array, tolerance: float | None = None, max_steps: int | None = None
) -> Array:
    """Return the states (n, 6) for `motion_of` with the compiled step, for steady drives.

    tolerance: of one step; None means STEP_TOLERANCE. Raises InputError if too many steps are
    needed.
    """
    # numba is slow to import, and short motions do not need it.
    from robotball.theory.ensembles.orbits import STEP_TOLERANCE, kernel_start, orbit

    parameters, attitudes, momenta = kernel_start(scene)
    allowed = STEP_TOLERANCE if tolerance is None else tolerance
    return orbit(parameters, attitudes[0], momenta[0], times, allowed, max_steps)


def _solve(
    scene: Scene, times: Array, rtol: float, max_steps: int, progress: Progress | None
) -> Array:
    """Return states (n, 6) at the times, with a restart at every breakpoint of the drives."""
    # X and Y are quadratures of q. Their scale is the radius, so that steps do not become shorter
    # when X or Y passes zero.
    scale = np.array([1.0, 1.0, 1.0, 1.0, scene.ball.radius, scene.ball.radius])
    rate, states = _right_hand_side(scene), np.empty((len(times), 6))
    states[0] = (*multiply(scene.start.attitude, scene.principal_quaternion), 0.0, 0.0)
    state, begin, last, steps, done = states[0], 0.0, float(times[-1]), 0, 1
    for end in (*(t for t in scene.breakpoints if t < last), last):
        solver = Compensated(partial(one_by_one, rate), begin, end, state, rtol, scale)
        while solver.t < end:
            steps = take_step(solver, steps, max_steps, last, progress)
            reached = int(np.searchsorted(times, solver.t, side="right"))
            if reached > done:
                states[done:reached] = solver.within(times[done:reached])
                done = reached
        state, begin = solver.state, end
    return states
