"""Where the plane's load varies the contact is another: what of the recipe changes then.

The depth at which the contact carries the ball goes with its load. Under a load that is constant
the start's depth is right for good, however soft the contact; under one that varies the centre
moves, and the lever arm with it. And a centre of mass off the sphere's centre couples the normal
force with friction, so that three iterations of PGS no longer solve them.
"""

from dataclasses import replace
from typing import Any

from robotball.engines.mujoco.settings import PRESETS, Prescribed, Radii, Settings
from robotball.scene import Scene

# docs/tradeoff.md has what each of them is worth.
VARYING: dict[str, Any] = {
    # Three iterations are enough, and ten cost a fifth more.
    "solver": "Newton",
    "iterations": 10,
    # At 1e-6 the rounding of the accelerations begins to show.
    "softness": 1e-5,
    # So that MuJoCo's noslip solver takes no contact of 1e6 kg for singular.
    "sliding_friction": 2000.0,
    "torsional_friction": Radii(2000.0),
    # A pendulum's weight acts on its hinge for good: a rate gives way by ∫τ dt over the armature.
    "drive": Prescribed(armature=1e18),
}
# The depth goes as the square of the contact's time constant [s], which has to be two timesteps at
# least. Steps that are chosen by their error have none; rounding of the height bounds it.
SHORTEST = (0.007, 1.0)


def fitted(settings: Settings, scene: Scene) -> Settings:
    """The settings as they are for this scene's load; those that fit none stay as they are.

    So does every value that is not the presets' own.
    """
    if not settings.fits_load or not scene.load_varies:
        return settings
    usual, changes = PRESETS["balanced"], dict(VARYING)
    if settings.adaptive and not settings.timestep:
        changes["solref"] = SHORTEST
    own = {name for name in changes if getattr(settings, name) != getattr(usual, name)}
    kept = {name: value for name, value in changes.items() if name not in own}
    return replace(settings, **kept, fits_load=False)
