"""The names of `robotball`, each from its home; loaded when they are first used."""

from .designing.design import Design, design
from .designing.feasibility import Limits
from .drives import Custom, Ramp, Servo, Sine
from .engines.mujoco.settings import PRESETS, Settings, preset
from .engines.protocol import Engine, Request
from .engines.reduced.integrate import integrate
from .engines.registry import engine_named, engine_names
from .engines.simulate import simulate
from .errors import InputError, SceneWarning
from .faults import Fault, FaultKind
from .files.scene_file import catalog, load_scene
from .files.scene_writer import scene_toml
from .motion import ContactMotion, ContactReport, Loads, Motion
from .scene import Scene, sample_times
from .settings import EngineSettings

__all__ = [
    "PRESETS",
    "ContactMotion",
    "ContactReport",
    "Custom",
    "Design",
    "Engine",
    "EngineSettings",
    "Fault",
    "FaultKind",
    "InputError",
    "Limits",
    "Loads",
    "Motion",
    "Ramp",
    "Request",
    "Scene",
    "SceneWarning",
    "Servo",
    "Settings",
    "Sine",
    "catalog",
    "design",
    "engine_named",
    "engine_names",
    "integrate",
    "load_scene",
    "preset",
    "sample_times",
    "scene_toml",
    "simulate",
]
