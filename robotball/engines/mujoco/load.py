"""Where the plane's load varies the contact is another: what of the recipe changes then.

The depth at which the contact carries the ball goes with its load. Under a load that is constant
the start's depth is right for good, however soft the contact; under one that varies the centre
moves, and the lever arm with it. And a centre of mass off the sphere's centre couples the normal
force with friction, so that three iterations of PGS no longer solve them.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from robotball.engines.mujoco.chosen import Chosen
from robotball.engines.mujoco.settings import PRESETS, Prescribed, Radii, Settings
from robotball.scene import Scene

# docs/tradeoff.md has what each of them is worth.
VARYING: dict[str, Any] = {
    # Three iterations are enough, and ten cost a fifth more.
    "solver": "Newton",
    "iterations": 10,
    # So that MuJoCo's noslip solver takes no contact of 1e6 kg for singular.
    "sliding_friction": 2000.0,
    "torsional_friction": Radii(2000.0),
    # A pendulum's weight acts on its hinge for good: a rate gives way by ∫τ dt over the armature.
    "drive": Prescribed(armature=1e18),
}
# The contact's softness and time constant [s], in steps of one length and in steps chosen by their
# error. Its depth, which errs, goes as the first and as the square of the second. But Newton is
# content with 1e-15 m/s², and that over the softness is a force: at 1e-5 it can lift a ball at rest
# out of its contact. And MuJoCo takes no constant of less than two steps, or twice the 2 ms that
# the model has where MuJoCo makes no steps itself.
BY_STEPS, BY_ERROR = (3e-4, 0.01), (1e-4, 0.004)


def fitted(settings: Settings, scene: Scene) -> Settings:
    """The settings as they are for this scene's load; those that fit none stay as they are.

    So does every value that is not the presets' own.
    """
    if not settings.fits_load or not scene.load_varies:
        return settings
    usual, changes = PRESETS["balanced"], dict(VARYING)
    timestep = Chosen(scene, settings).timestep
    softness, constant = BY_STEPS if np.isfinite(timestep) else BY_ERROR
    if np.isfinite(timestep):
        constant = max(constant, 2 * timestep)
    changes |= {"softness": softness, "solref": (constant, 1.0)}
    own = {name for name in changes if getattr(settings, name) != getattr(usual, name)}
    kept = {name: value for name, value in changes.items() if name not in own}
    return replace(settings, **kept, fits_load=False)
