"""robotball: a rolling ball run twice, by the paper's equations and by MuJoCo."""

from robotball.design import Design, design
from robotball.drives import Custom, Ramp, Servo, Sine
from robotball.errors import InputError, SceneWarning
from robotball.feasibility import Limits
from robotball.motion import Diagnostics, Fault, Loads, Motion
from robotball.reduced import integrate
from robotball.scene import Scene, sample_times
from robotball.scene_file import catalog, load_scene
from robotball.scene_writer import scene_toml
from robotball.settings import PRESETS, Settings, preset
from robotball.simulate import simulate

__all__ = [
    "PRESETS",
    "Custom",
    "Design",
    "Diagnostics",
    "Fault",
    "InputError",
    "Limits",
    "Loads",
    "Motion",
    "Ramp",
    "Scene",
    "SceneWarning",
    "Servo",
    "Settings",
    "Sine",
    "catalog",
    "design",
    "integrate",
    "load_scene",
    "preset",
    "sample_times",
    "scene_toml",
    "simulate",
]
