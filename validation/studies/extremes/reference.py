"""The equations' motion for a cell: by the compiled stepper, since some turn a million times."""

import numpy as np

from robotball import Motion, Scene
from robotball.engines.reduced.compiled.kernels import orbit, start_of
from robotball.loads import loads_of
from robotball.rotations import Array, conjugate, multiply, rotation_matrix


def reference(scene: Scene, times: Array) -> Motion:
    """What `integrate` gives, to the same error, for steady drives; times (n,) s from 0.

    Raises InputError where the stepper gives the motion up.
    """
    parameters, starts, momenta = start_of(scene)
    attitude, contact_point = orbit(parameters, starts[0], momenta[0], times)
    axes = rotation_matrix(attitude)
    M = axes.transpose(0, 2, 1) @ scene.start.momentum
    omega = np.stack(parameters.angular_velocity(as_columns(M), as_columns(axes[:, 2])), axis=1)
    return Motion(
        times=times,
        contact_point=contact_point,
        attitude=multiply(attitude, conjugate(scene.principal_quaternion)),
        momentum=np.tile(scene.start.momentum, (len(times), 1)),
        angular_velocity=omega @ scene.principal_axes.T,
        hinge_angles=np.stack([drive.angle(times) for drive in scene.drives], axis=1),
        hinge_rates=np.stack([drive.rate(times) for drive in scene.drives], axis=1),
        loads=loads_of(scene, times, axes, omega),
    )


def path_length(scene: Scene, motion: Motion) -> float:
    """The length of the contact point's path [m], by the mean of its speed at the samples.

    Between samples that are many turns apart, the chords would say nothing of it.
    """
    shell = motion.angular_velocity - motion.hinge_rates[:, :1] * scene.ball.shell.axis
    speed = scene.ball.radius * np.linalg.norm(np.cross(shell, motion.gamma), axis=1)
    return float(speed.mean() * motion.times[-1])


def speed_scale(scene: Scene) -> float:
    """About how fast the ball turns: A(|M| + |K|) + |Ω| [rad/s]."""
    numbers = scene.parameters
    size = np.linalg.norm(scene.start.momentum) + np.linalg.norm(numbers.K)
    return float(max(numbers.A) * size + np.linalg.norm(numbers.Omega))


def as_columns(v: Array) -> tuple[Array, Array, Array]:
    """(n, 3) as three columns."""
    x, y, z = v.T
    return x, y, z
