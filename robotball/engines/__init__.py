"""The engines there are: our own, and those that other packages bring.

A package adds an engine by an entry point of the group `robotball.engines`, whose name is the
engine's and whose object is an Engine.
"""

from importlib import import_module
from importlib.metadata import entry_points

from robotball.engines.protocol import Engine
from robotball.errors import InputError, unknown

GROUP = "robotball.engines"
DEFAULT = "mujoco"
OURS = {
    "mujoco": "robotball.engines.mujoco.engine:MUJOCO",
    "multibody": "robotball.engines.multibody.engine:MULTIBODY",
    "bullet": "robotball.engines.bullet:BULLET",
    "dart": "robotball.engines.dart:DART",
    "drake": "robotball.engines.drake:DRAKE",
    "exudyn": "robotball.engines.exudyn:EXUDYN",
    "genesis": "robotball.engines.genesis:GENESIS",
    "mjx": "robotball.engines.mujoco.mjx:MJX",
    "mujoco-warp": "robotball.engines.mujoco.warp:WARP",
    "newton": "robotball.engines.newton:NEWTON",
    "physx": "robotball.engines.physx:PHYSX",
    "pinocchio": "robotball.engines.pinocchio:PINOCCHIO",
}


def engine_names() -> list[str]:
    """The names of all engines, ours first."""
    return [*OURS, *sorted({point.name for point in entry_points(group=GROUP)} - OURS.keys())]


def engine_named(name: str) -> Engine:
    """The engine of this name; raises InputError where there is none, or it cannot be loaded."""
    if name in OURS:
        module, attribute = OURS[name].split(":")
        return getattr(import_module(module), attribute)
    for point in entry_points(group=GROUP, name=name):
        try:
            return point.load()
        except (ImportError, AttributeError) as error:
            raise InputError(f"the engine {name!r} of {point.value} fails: {error}") from None
    raise unknown("engine", name, engine_names())
