"""The ball as the tree of links that engines take, and the force of their contact.

All links have the ball's axes at the start, where hinges are at zero. The shell is the root: as the
body that touches the plane it then has no drift of the contact's Jacobian, which engines leave out
(docs/findings/mujoco_frame_root.py).
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from robotball.ball import Link
from robotball.rotations import Array, from_matrix
from robotball.scene import Scene


def links_of(scene: Scene) -> tuple[Link, ...]:
    """Return the bodies of the ball's tree, the shell first, each in its own place.

    Of such a link `pivot` is from its parent's, that of the shell the centre of the sphere, and
    `centre` is from its own pivot.
    """
    tree = scene.ball.tree
    pivots = {link.name: link.pivot for link in tree}
    return tuple(
        replace(
            link, centre=link.centre - link.pivot, pivot=link.pivot - pivots.get(link.parent, 0.0)
        )
        for link in tree
    )


def principal_inertia(link: Link) -> tuple[Array, Array]:
    """Return moments (3,) and their axes' quaternion (4,), for engines that take no tensor."""
    moments, axes = np.linalg.eigh(link.inertia)
    axes = axes if np.linalg.det(axes) > 0 else -axes  # or they would be a reflection
    return moments, from_matrix(axes)


def lifting(forces: Iterable[Array]) -> Array:
    """Return the sum (3,) of a contact's forces, on either body, as that on the ball."""
    total = sum(forces, np.zeros(3))
    return total * np.copysign(1.0, total[2])


def force_in(model: Any, data: Any) -> Array:
    """Return the force (3,) [N] on the ball of the one contact in an MjModel's data, if any."""
    import mujoco

    wrench, frame = np.zeros(6), data.contact.frame.reshape(-1, 3, 3)
    if data.ncon:
        mujoco.mj_contactForce(model, data, 0, wrench)
    return lifting(wrench[:3] @ each for each in frame[:1])
