"""Exudyn: the ball on an ideal rolling constraint of ours, and on Exudyn's own contact."""

from collections.abc import Mapping
from dataclasses import replace

from robotball.engines.adapter import Adapter, StepSettings, version_of
from robotball.engines.exudyn_worlds import ContactWorld, ExudynSettings, ExudynWorld
from robotball.engines.protocol import Ladder
from robotball.engines.worlds import World
from robotball.motion import Label
from robotball.scene import Scene

LABEL = Label("Exudyn", version_of("exudyn"), "#CC79A7")

# No preset comes as it is: this one has our constraint, and leaves the rest to Exudyn.
OWN_SOLVER = ExudynSettings(
    name="own-solver", error_tolerance=1e-3, stop_at_fault=False, timestep=1e-3
)
BEST = ExudynSettings(
    name="best",
    error_tolerance=1e-3,
    stop_at_fault=False,
    timestep=1e-3,
    solver="TrapezoidalIndex2",
    tolerance=1e-10,
    modified=True,
    load_jacobian=False,
)
CONTACT = replace(BEST, name="contact", tolerance=1e-9, modified=False, friction=20.0)


class Exudyn(Adapter):
    """The engine, as `robotball.engines.protocol` describes one."""

    label = LABEL
    package = "exudyn"
    extra = "exudyn"
    requirements = ("exudyn>=1.13.6",)
    ladders: Mapping[str, Ladder] = {
        "own-solver": ("timestep", (20e-3, 5e-3, 1e-3)),
        "best": ("timestep", (20e-3, 5e-3, 1e-3)),
        "contact": ("timestep", (5e-3, 1e-3)),
    }
    settings_type = ExudynSettings
    presets: Mapping[str, StepSettings] = {each.name: each for each in (OWN_SOLVER, BEST, CONTACT)}

    def world(self, scene: Scene, settings: StepSettings, step: float) -> World:
        assert isinstance(settings, ExudynSettings)
        return (ExudynWorld if settings.friction is None else ContactWorld)(scene, settings)

    def lacks(self, scene: Scene, settings: StepSettings) -> str | None:
        """Torsional friction, in its own contact."""
        assert isinstance(settings, ExudynSettings)
        if scene.rolling == "classical" or settings.friction is None:
            return None
        return "its contact has no torsional friction: a constraint of ours forbids the spin"


EXUDYN = Exudyn()
