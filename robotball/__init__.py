"""robotball: a rolling ball run twice, by the paper's equations and by MuJoCo."""

from robotball.designing.design import Design, design
from robotball.designing.feasibility import Limits
from robotball.drives import Custom, Ramp, Servo, Sine
from robotball.engines.mujoco.run import simulate
from robotball.engines.mujoco.settings import PRESETS, Settings, preset
from robotball.engines.reduced.integrate import integrate
from robotball.errors import InputError, SceneWarning
from robotball.files.scene_file import catalog, load_scene
from robotball.files.scene_writer import scene_toml
from robotball.motion import Diagnostics, Fault, Loads, Motion
from robotball.scene import Scene, sample_times

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
