"""The names of `robotball`, each from its home; loaded when they are first used."""

import validation as _validation

from .ball import Ball as Ball
from .ball import Frame as Frame
from .ball import Hinge as Hinge
from .ball import Link as Link
from .ball import Pendulum as Pendulum
from .ball import Rotor as Rotor
from .ball import Shell as Shell
from .controllers import Controller as Controller
from .controllers import Reading as Reading
from .controllers import Sensors as Sensors
from .designing import Design as Design
from .designing import Limits as Limits
from .designing import design as design
from .drives import Custom as Custom
from .drives import Drive as Drive
from .drives import Ramp as Ramp
from .drives import Samples as Samples
from .drives import Sine as Sine
from .drives import Sum as Sum
from .engine import Engine as Engine
from .engine import Request as Request
from .engine import engine_named as engine_named
from .engine import engine_names as engine_names
from .engine import integrate as integrate
from .engine import simulate as simulate
from .engines.mujoco.dm_environment import dm_environment as dm_environment
from .engines.mujoco.settings import PRESETS as PRESETS
from .engines.mujoco.settings import Settings as Settings
from .engines.mujoco.settings import preset as preset
from .engines.recorded import RecordedMotion as RecordedMotion
from .engines.recorded import load_motion as load_motion
from .engines.recorded import recorded as recorded
from .errors import InputError as InputError
from .errors import SceneWarning as SceneWarning
from .evidence import Found as Found
from .evidence import SensorFit as SensorFit
from .files.export import export_scene as export_scene
from .files.logs import Log as Log
from .files.logs import Sensor as Sensor
from .files.logs import read_log as read_log
from .files.scene_file import catalog as catalog
from .files.scene_file import load_scene as load_scene
from .files.scene_writer import scene_toml as scene_toml
from .files.trajectories import Trajectory as Trajectory
from .files.trajectories import read_trajectory as read_trajectory
from .fitting import Fit as Fit
from .fitting import fit as fit
from .loads import Loads as Loads
from .many_motions import simulate_many as simulate_many
from .motion import ContactMotion as ContactMotion
from .motion import ContactReport as ContactReport
from .motion import EngineSettings as EngineSettings
from .motion import Fault as Fault
from .motion import FaultKind as FaultKind
from .motion import Motion as Motion
from .motion import ReferenceMotion as ReferenceMotion
from .motors import Actuator as Actuator
from .motors import DCMotor as DCMotor
from .motors import Free as Free
from .motors import Law as Law
from .motors import PositionServo as PositionServo
from .motors import Servo as Servo
from .motors import Torque as Torque
from .plane import in_space as in_space
from .scene import Scene as Scene
from .scene import Start as Start
from .scene import sample_times as sample_times

Agreement = _validation.Agreement
compare = _validation.compare
compare_many = _validation.compare_many
