"""The catalog's ball with one thing changed and the rest held, over any number of decades."""

from dataclasses import replace

import numpy as np

from robotball import Scene
from robotball.bodies import Ball, Frame, Rotor, Shell
from robotball.rotations import Array
from robotball.start import Start


def momentum_of(scene: Scene) -> Array:
    """K (3,) of (A.3), frame axes [kg m²/s]."""
    return scene.principal_axes @ np.array(scene.parameters.K)


def gyrostat(
    scene: Scene, *, frame_rate: float, K: Array, rotor_rate: float | None = None
) -> Scene:
    """The scene with other Ω and K (3,), frame axes, and the same A and mass.

    frame_rate [rad/s]; by (A.3) the rotor has to carry K + (J_s + d)Ω: its axis and its rate
    become what that takes, or, where rotor_rate [rad/s] is given, its axis and its inertia. The
    frame takes the rest of the inertia; InputError where nothing is left for it.
    """
    ball = scene.ball
    (rotor,) = ball.rotors
    carried = K + (ball.shell.axial_inertia + ball.d) * frame_rate * ball.shell.axis
    size = float(np.linalg.norm(carried))
    inertia = rotor.axial_inertia if rotor_rate is None else size / rotor_rate
    new = replace(rotor, axial_inertia=inertia, transverse_inertia=inertia / 2, axis=carried / size)
    frame = replace(ball.frame, inertia=ball.frame.inertia + rotor.inertia - new.inertia)
    return replace(
        scene,
        ball=Ball(ball.shell, frame, (new,)),
        frame_rate=frame_rate,
        rotor_rates=(size / inertia,),
    )


def redistributed(scene: Scene, *, frame_to_shell: float, rotor_to_frame: float) -> Scene:
    """The scene with its whole mass shared out anew; the bodies keep their shapes and rates."""
    ball = scene.ball
    shares = np.array([1.0, frame_to_shell, frame_to_shell * rotor_to_frame])
    shell, frame, rotor = (ball.mass * shares / shares.sum()).tolist()
    (old_rotor,) = ball.rotors
    return replace(
        scene,
        ball=Ball(
            scaled_shell(ball.shell, shell / ball.shell.mass),
            scaled_frame(ball.frame, frame / ball.frame.mass),
            (scaled_rotor(old_rotor, rotor / old_rotor.mass),),
        ),
    )


def scaled(scene: Scene, *, mass: float, length: float) -> Scene:
    """The same motion of a ball whose masses and lengths are multiplied by two factors.

    Rates and times stay, so that momenta go with mass·length² and gravity with length.
    """
    ball = scene.ball
    return replace(
        scene,
        ball=Ball(
            scaled_shell(ball.shell, mass, length),
            scaled_frame(ball.frame, mass, length),
            tuple(scaled_rotor(rotor, mass, length) for rotor in ball.rotors),
        ),
        start=Start(scene.start.attitude, scene.start.momentum * mass * length**2),
        gravity=scene.gravity * length,
    )


def scaled_shell(shell: Shell, mass: float, length: float = 1.0) -> Shell:
    """The shell with its mass and its lengths multiplied by two factors."""
    return replace(
        shell,
        radius=shell.radius * length,
        mass=shell.mass * mass,
        axial_inertia=shell.axial_inertia * mass * length**2,
        transverse_inertia=shell.transverse_inertia * mass * length**2,
    )


def scaled_frame(frame: Frame, mass: float, length: float = 1.0) -> Frame:
    """The same of the frame."""
    return Frame(frame.mass * mass, frame.inertia * mass * length**2, frame.centre * length)


def scaled_rotor(rotor: Rotor, mass: float, length: float = 1.0) -> Rotor:
    """The same of a rotor."""
    return replace(
        rotor,
        mass=rotor.mass * mass,
        axial_inertia=rotor.axial_inertia * mass * length**2,
        transverse_inertia=rotor.transverse_inertia * mass * length**2,
        centre=rotor.centre * length,
    )
