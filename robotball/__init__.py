"""robotball: a rolling ball run twice, by the paper's equations and by MuJoCo."""

from robotball.drives import Custom, Ramp, Servo, Sine
from robotball.errors import InputError, SceneWarning
from robotball.motion import Diagnostics, Fault, Loads, Motion
from robotball.reduced import integrate
from robotball.scene import Scene, sample_times
from robotball.scene_file import catalog, load_scene
from robotball.settings import PRESETS, Settings, preset
from robotball.simulate import simulate

__all__ = [
    "PRESETS",
    "Custom",
    "Diagnostics",
    "Fault",
    "InputError",
    "Loads",
    "Motion",
    "Ramp",
    "Scene",
    "SceneWarning",
    "Servo",
    "Settings",
    "Sine",
    "catalog",
    "integrate",
    "load_scene",
    "preset",
    "sample_times",
    "simulate",
]
