"""robotball: a rolling ball run twice, by the paper's equations and by MuJoCo."""

from robotball.errors import InputError
from robotball.motion import Diagnostics, Fault, Motion
from robotball.reduced import integrate
from robotball.scene import Scene, sample_times
from robotball.scene_file import catalog, load_scene
from robotball.settings import PRESETS, Settings, preset
from robotball.simulate import simulate

__all__ = [
    "PRESETS",
    "Diagnostics",
    "Fault",
    "InputError",
    "Motion",
    "Scene",
    "Settings",
    "catalog",
    "integrate",
    "load_scene",
    "preset",
    "sample_times",
    "simulate",
]
