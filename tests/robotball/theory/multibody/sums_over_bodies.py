"""The derivative of a robot's state with sums over all bodies and dense matrices.

It has the state and modes of robotball.theory.multibody.derivative, but none of its recursions.
Every body has a matrix of partial velocities (Kane). Multipliers hold the constraints of the shell.
"""

from typing import NamedTuple

import numpy as np

from robotball.rotations import Array, rotation_matrix
from robotball.theory.multibody.derivative import HINGES, LOSS, MOMENTUM, POINT, STANDING
from robotball.theory.multibody.system import System


class Sums(NamedTuple):
    """Derivative of a state, and readings in world axes."""

    rate: Array
    force: Array
    plane_torque: Array
    slip: Array
    rates: Array
    torques: Array


def differentiate(system: System, t: float, state: Array) -> Sums:
    """Return the derivative of a state at time t [s] in the system's modes."""
    scene, modes, h = system.scene, system.modes, system.count
    tree, n = scene.ball.tree, 3 + system.count
    k, slips, of_slip = n + 2, slice(n, n + 2), HINGES + 3 * h
    axes = rotation_matrix(state[:4] / np.linalg.norm(state[:4]))  # rows α, β, γ
    gamma, lift = axes[2], scene.ball.radius * axes[2]
    angles = state[HINGES : HINGES + h]
    turned, shifts = (parts[:, 0] for parts in scene.robot.moved(angles[None]))
    parents = [-1, *([link.name for link in tree].index(link.parent) for link in tree[1:])]
    masses = [link.mass for link in tree]
    centres = [R @ link.centre + s for R, s, link in zip(turned, shifts, tree, strict=True)]
    pivots = [R @ link.pivot + s for R, s, link in zip(turned, shifts, tree, strict=True)]
    normals = [R @ link.axis for R, link in zip(turned, tree, strict=True)]
    tensors = [R @ link.inertia @ R.T for R, link in zip(turned, tree, strict=True)]

    # The motion of each body per unit of u: its rotation, and the velocity of its centre of mass.
    turns, moves = np.zeros((2, len(tree), 3, k))
    for b, r in enumerate(centres):
        turns[b, :, :3] = np.eye(3)
        moves[b, :, :3] = np.cross(np.eye(3), r + lift).T
        moves[b, :, slips] = axes[:2].T
        j = b
        while j > 0:
            if tree[j].slides:
                moves[b, :, 2 + j] = normals[j]
            else:
                turns[b, :, 2 + j] = normals[j]
                moves[b, :, 2 + j] = np.cross(normals[j], r - pivots[j])
            j = parents[j]
    matrix = np.diag([0.0] * 3 + [m.motor.armature if m.motor else 0.0 for m in scene.hinges])
    matrix = np.pad(matrix, (0, k - n))
    for m, J, T, S in zip(masses, tensors, turns, moves, strict=True):
        matrix += T.T @ J @ T + m * S.T @ S

    # Rows that u obeys, for the rates given and the directions about which the shell may not turn.
    slides = modes.slipping and bool(np.isfinite(system.friction[0]))
    spins = scene.rolling == "classical" or system.spins
    turn, point = scene.plane_turn, state[POINT:MOMENTUM]
    of_plane = scene.plane_velocity(t, point)
    held = [*([axes[0], axes[1]] if modes.standing else []), *([] if spins else [gamma])]
    D = [*(np.pad(d, (0, k - 3)) for d in held)]
    goal = [0.0] * (2 * modes.standing) + [of_plane[2]] * (not spins)
    goals = [0.0] * (2 * modes.standing) + [float(turn.acceleration(t))] * (not spins)
    for j, hinge in enumerate(scene.hinges):
        if hinge.motor is None:
            D.append(np.eye(k)[3 + j])
            goal.append(float(hinge.command.rate(t)))
            goals.append(float(hinge.command.acceleration(t)))
    if not slides:
        D += [*np.eye(k)[slips]]
    rows, c = np.array(D).reshape(-1, k), len(D)
    whole = np.block([[matrix, rows.T], [rows, np.zeros((c, c))]])

    M = state[MOMENTUM:LOSS] if spins else np.cross(state[MOMENTUM:LOSS], [0.0, 0.0, 1.0])
    momenta = [
        axes.T @ M,
        state[HINGES + h : HINGES + 2 * h],
        state[of_slip : of_slip + 2] if system.slips else np.zeros(2),
    ]
    stuck = [] if slides else [*of_plane[:2]]
    u = np.linalg.solve(whole, np.concatenate([*momenta, goal, stuck]))[:k]
    rates = u[3:n]
    omegas, velocities = turns @ u, moves @ u

    # Newton and Euler with accelerations at constant u.
    G = axes.T @ scene.gravity_at(t)
    faster, accelerations = np.zeros((2, len(tree), 3))
    rate_of_u, lost_to_u, force = np.zeros(k), np.zeros(k), np.zeros(3)
    slip = axes[:2].T @ u[slips]
    v = np.cross(omegas[0], lift) + slip
    for b, (m, r, J) in enumerate(zip(masses, centres, tensors, strict=True)):
        w, p, arm = omegas[b], parents[b], r
        if b:
            of_parent, on_parent, arm = omegas[p], pivots[b] - centres[p], r - pivots[b]
            faster[b] = faster[p]
            accelerations[b] = accelerations[p] + np.cross(faster[p], on_parent)
            accelerations[b] += np.cross(of_parent, np.cross(of_parent, on_parent))
            carried = rates[b - 1] * np.cross(of_parent, normals[b])
            (accelerations if tree[b].slides else faster)[b] += (1 + tree[b].slides) * carried
        accelerations[b] += np.cross(faster[b], arm) + np.cross(w, np.cross(w, arm))
        f, torque = m * (accelerations[b] - G), J @ faster[b] + np.cross(w, J @ w)
        lost_to_u += turns[b].T @ torque + moves[b].T @ f
        force += f
        # Rates of the momenta in space.
        push, weight = m * velocities[b], m * G
        rate_of_u[:3] += np.cross(push, v) + np.cross(r + lift, weight)
        j = b
        while j > 0:
            p, n_rate = parents[j], np.cross(omegas[parents[j]], normals[j])
            w = velocities[p] + np.cross(omegas[p], pivots[j] - centres[p])
            if tree[j].slides:
                rate_of_u[2 + j] += n_rate @ push + normals[j] @ weight
            else:
                rho = r - pivots[j]
                rate_of_u[2 + j] += n_rate @ (J @ omegas[b] + np.cross(rho, push))
                rate_of_u[2 + j] += normals[j] @ (np.cross(push, w) + np.cross(rho, weight))
            j = p

    of_motors = np.zeros(k)
    free = [hinge for hinge in scene.hinges if hinge.motor is not None]
    laws = [(m.motor.law, m.command, {m.name: 1.0}) for m in free if m.motor]
    pairs = zip(scene.actuators, scene.controls, strict=True)
    laws += [(a.law, command, dict(a.gears)) for a, command in pairs]
    for side, (law, command, gears) in zip(modes.motors, laws, strict=True):
        ratios = np.array([gears.get(hinge.name, 0.0) for hinge in scene.hinges])
        unlimited = law.unlimited(command.rate(t), ratios @ angles, ratios @ rates)
        of_motors[3:n] += ratios * (side * law.limit if side else unlimited)
    x, y = scene.ball.radius * np.array([axes[1] @ u[:3], -axes[0] @ u[:3]]) + axes[:2] @ slip
    stuck = [] if slides else scene.plane_acceleration(t, point[0], point[1], x, y)[:2]
    masses_by_u = np.einsum("b,bik->ik", masses, moves)

    def solved(right: Array, *values: list[float]) -> Array:
        return np.linalg.solve(whole, np.concatenate([right, *values]))

    solution = solved(of_motors - lost_to_u, goals, stuck)
    force += masses_by_u @ solution[:k]
    velocity = np.array([*u[slips], gamma @ u[:3]]) - of_plane
    rolling = np.array([axes[0] @ u[:3], axes[1] @ u[:3], 0.0])
    pull, resisting, up = np.zeros(3), np.zeros(3), np.eye(3)[2]
    if modes.slipping:
        ahead = modes.ahead[0, 0]
        ahead = ahead if ahead.any() else system.weights * velocity
        pull = -system.weights * ahead / np.linalg.norm(ahead)
    if not modes.standing:
        along = rolling + max(STANDING - float(np.linalg.norm(rolling)), 0.0) * modes.toward
        resisting = -system.resistance * along / (np.linalg.norm(along) or 1.0)
    along_u = np.concatenate([axes.T @ (resisting + pull[2] * up), np.zeros(k - 3)])
    along_u[slips] = pull[:2]
    by_unit = solved(along_u, np.zeros(c).tolist())
    normal = float(gamma @ force / (1 - gamma @ masses_by_u @ by_unit[:k]))
    solution, force = solution + normal * by_unit, force + normal * masses_by_u @ by_unit[:k]
    multipliers = solution[k:]
    plane_torque = normal * (resisting + pull[2] * up)
    for d, torque in zip(held, multipliers, strict=False):
        plane_torque -= torque * (axes @ d)
    given = np.array([hinge.motor is None for hinge in scene.hinges], dtype=bool)
    torques = np.where(given, lost_to_u[3:n] + (matrix @ solution[:k])[3:n], of_motors[3:n])

    carrier, rate = omegas[scene.robot.carrier], np.zeros_like(state)
    q0, q = state[0], state[1:4]
    rate[:4] = 0.5 * np.array([-q @ carrier, *(q0 * carrier + np.cross(q, carrier))])
    rate[POINT:MOMENTUM] = x, y
    L_rate = axes @ rate_of_u[:3] + plane_torque
    rate[MOMENTUM:LOSS] = L_rate if spins else np.cross([0.0, 0.0, 1.0], L_rate)
    rate[LOSS] = -plane_torque[:2] @ rolling[:2]
    rate[HINGES : HINGES + h] = rates
    rate[HINGES + h : HINGES + 2 * h] = np.where(given, 0.0, rate_of_u[3:n] + torques)
    rate[HINGES + 2 * h : of_slip] = torques * rates
    push = axes @ force
    if system.slips:
        rate[of_slip : of_slip + 2] = (push + sum(masses) * scene.gravity_at(t))[:2]
        rate[of_slip + 2] = -normal * pull @ velocity
    if not scene.plane_is_still:
        moved = np.array([drive.angle(t) for drive in scene.plane_drives])
        rate[-1] = push @ moved + [*push[:2], plane_torque[2]] @ of_plane
    return Sums(rate, push, plane_torque, velocity, rates, torques)
