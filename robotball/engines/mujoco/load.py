"""Where the plane's load varies the contact is another: what of the recipe changes then.

The depth at which the contact carries the ball goes with its load. Under a load that is constant
the start's depth is right for good, however soft the contact; under one that varies the centre
moves, and the lever arm with it. And a centre of mass off the sphere's centre couples the normal
force with friction, so that three iterations of PGS no longer solve them.
"""

from dataclasses import replace
from typing import Any

from robotball.engines.mujoco.settings import Settings
from robotball.scene import Scene

# Measured with PGS and a soft contact in place of them: 1e-8 to 1e-1 of the path, with no warning.
# Three iterations of Newton's method are enough; ten cost a fifth more. At a softness of 1e-6 the
# rounding of the accelerations begins to show.
VARYING: dict[str, Any] = {"solver": "Newton", "iterations": 10, "softness": 1e-5}


# The depth goes as the square of the contact's time constant [s], which has to be two timesteps at
# least. Steps that are chosen by their error have none, and rounding bounds it.
SHORTEST = (0.01, 1.0)


def fitted(settings: Settings, scene: Scene) -> Settings:
    """The settings as they are for this scene's load; those that fit none stay as they are."""
    if not settings.fits_load or not scene.load_varies:
        return settings
    solref = SHORTEST if settings.adaptive and not settings.timestep else settings.solref
    return replace(settings, **VARYING, solref=solref, fits_load=False)
