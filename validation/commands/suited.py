"""Which scenes the commands about long-run motion are for, and where to go with the others."""

import numpy as np

from robotball import InputError, Scene, load_scene


def steady_scene(name: str, purpose: str) -> Scene:
    """A scene whose rates are constant; raises InputError for any other."""
    scene = load_scene(name)
    if not scene.steady:
        raise InputError(
            f"{scene.name}: its drives change in time, and {purpose} needs constant rates; "
            f"'robotball compare {name}' shows its motion"
        )
    return scene


def moving_scene(name: str, purpose: str) -> Scene:
    """One that also has a momentum; raises InputError for a start from rest, M = 0."""
    scene = steady_scene(name, purpose)
    if not np.any(scene.start.momentum):
        raise InputError(
            f"{scene.name} starts from rest, and {purpose} needs a momentum M other than zero; "
            f"'robotball equilibria {name}' shows the motion from rest"
        )
    return scene


def attracted_scene(name: str, purpose: str) -> Scene:
    """One that also has attractors; raises InputError where Ω = 0, and phase volume is kept."""
    scene = moving_scene(name, purpose)
    if not np.any(scene.parameters.Omega):
        raise InputError(
            f"{scene.name}: its frame does not turn (Ω = 0), so phase volume is kept and there "
            f"are no attractors; 'robotball section {name}' shows its motion"
        )
    return scene


def may_come_to_rest(scene: Scene) -> bool:
    """Whether a straight-line motion with the scene's M² attracts: motions may end there."""
    from robotball.qualitative.straight_motions import straight_motions

    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    if ball.rolling != "rubber" or not np.any(ball.Omega):
        return False
    return any(line.is_stable for line in straight_motions(ball, f))
