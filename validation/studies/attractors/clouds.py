"""Clouds of section points compared: how far apart two are, and whether chance explains it."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from robotball.rotations import Array

NEIGHBOURS = 8


def states(gamma: Array, momenta: Array) -> Array:
    """Points (n, 6): γ and M/|M| in frame axes, whose distance needs no angle.

    On the annulus (l, L) two near states may lie far apart, at L = ±√f or at l = ±π.
    """
    return np.concatenate([gamma, momenta / np.linalg.norm(momenta, axis=1, keepdims=True)], axis=1)


def distance(cloud: Array, reference: Array) -> float:
    """2E|x - y| - E|x - x'| of clouds (n, k), (m, k): their energy distance, but for a part
    that the reference alone has to do with.
    """
    return float(2 * cdist(cloud, reference).mean() - cdist(cloud, cloud).mean())


def rank_probability(cloud: Array, peers: Sequence[Array], reference: Array) -> float:
    """The probability that by chance alone `cloud` is at least as far from `reference` as it is.

    peers: clouds drawn by the very recipe that `cloud` claims to be drawn by, each from starts of
    its own. If the claim is true all of them and `cloud` are exchangeable, so the rank of its
    energy distance from the reference is uniform: exactly, however correlated the points of one
    cloud are. The least value is 1/(1 + number of peers).
    """
    ours = distance(cloud, reference)
    return (1 + sum(distance(peer, reference) >= ours for peer in peers)) / (1 + len(peers))


def distance_to_curve(points: Array, curve: Array) -> Array:
    """How far points (n, k) are from a curve that is known by many points (m, k) of it, (n,).

    To the straight line that fits the nearest few best; it misses a curve of curvature κ by
    κs²/2 where those few reach s along it.
    """
    _, nearest = cKDTree(curve).query(points, k=NEIGHBOURS)
    near = curve[nearest]
    middle = near.mean(axis=1, keepdims=True)
    along = np.linalg.svd(near - middle, full_matrices=False)[2][:, 0]
    arm = points - middle[:, 0]
    across = arm - (arm * along).sum(axis=1, keepdims=True) * along
    return np.linalg.norm(across, axis=1)
