"""The choice of the recipe by the plane's load, and what it is where the load varies.

The depth at which the contact carries the ball goes with its load. Under a load that is constant
the start's depth is right for good, however soft the contact; under one that varies the centre
moves, and the lever arm with it. And a centre of mass off the sphere's centre couples the normal
force with friction, so that three iterations of PGS no longer solve them.
"""

from dataclasses import replace
from typing import Any

from robotball.engines.mujoco.settings import BY_LOAD, CONSTANT, Prescribed, Radii, Settings
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


def on_load(settings: Settings, scene: Scene) -> Settings:
    """The settings on this scene: each value that is BY_LOAD is its recipe's, the others stay."""
    left = [name for name in CONSTANT if getattr(settings, name) == BY_LOAD]
    if not left:
        return settings
    chosen = varying(settings) if scene.load_varies else CONSTANT
    return replace(settings, **{name: chosen[name] for name in left})


def varying(settings: Settings) -> dict[str, Any]:
    """The recipe for a varying load, in the steps of these settings."""
    chosen_steps = settings.adaptive and settings.timestep is None
    softness, constant = BY_ERROR if chosen_steps else BY_STEPS
    constant = max(constant, 2 * (settings.timestep or 0.0))
    return VARYING | {"softness": softness, "solref": (constant, 1.0)}
