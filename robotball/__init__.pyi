"""The public names of `robotball`, each from its module, which is loaded on first use."""

import types

import validation as _validation

from .design.designing import Design as Design
from .design.designing import Limits as Limits
from .design.designing import design as design
from .dynamics.equilibria import equilibria as equilibria
from .dynamics.long_run import exponents as exponents
from .dynamics.sections import section as section
from .engines.engine import Engine as Engine
from .engines.engine import Request as Request
from .engines.engine import engine_named as engine_named
from .engines.engine import engine_names as engine_names
from .engines.engine import simulate as simulate
from .engines.equations import integrate as integrate
from .engines.many_motions import simulate_many as simulate_many
from .engines.mujoco.dm_environment import dm_environment as dm_environment
from .engines.mujoco.settings import PRESETS as PRESETS
from .engines.mujoco.settings import Settings as Settings
from .engines.mujoco.settings import preset as preset
from .engines.recorded import RecordedMotion as RecordedMotion
from .engines.recorded import load_motion as load_motion
from .engines.recorded import recorded as recorded
from .errors import InputError as InputError
from .errors import SceneWarning as SceneWarning
from .files.trajectories import Trajectory as Trajectory
from .files.trajectories import read_trajectory as read_trajectory
from .fit.evidence import Estimate as Estimate
from .fit.evidence import SensorFit as SensorFit
from .fit.fitting import Fit as Fit
from .fit.fitting import fit as fit
from .fit.logs import Log as Log
from .fit.logs import Sensor as Sensor
from .fit.logs import read_log as read_log
from .motion import ContactMotion as ContactMotion
from .motion import ContactReport as ContactReport
from .motion import EngineSettings as EngineSettings
from .motion import Fault as Fault
from .motion import FaultKind as FaultKind
from .motion import Motion as Motion
from .motion import ReferenceMotion as ReferenceMotion
from .robot.ball import Ball as Ball
from .robot.ball import Frame as Frame
from .robot.ball import Hinge as Hinge
from .robot.ball import Link as Link
from .robot.ball import Pendulum as Pendulum
from .robot.ball import Rotor as Rotor
from .robot.ball import Shell as Shell
from .robot.controllers import Controller as Controller
from .robot.controllers import Reading as Reading
from .robot.controllers import Sensors as Sensors
from .robot.drives import Custom as Custom
from .robot.drives import Drive as Drive
from .robot.drives import Ramp as Ramp
from .robot.drives import Samples as Samples
from .robot.drives import Sine as Sine
from .robot.drives import Sum as Sum
from .robot.loads import Loads as Loads
from .robot.motors import Actuator as Actuator
from .robot.motors import DCMotor as DCMotor
from .robot.motors import Free as Free
from .robot.motors import Law as Law
from .robot.motors import PositionServo as PositionServo
from .robot.motors import Servo as Servo
from .robot.motors import Torque as Torque
from .robot.scene import Friction as Friction
from .robot.scene import Scene as Scene
from .robot.scene import Start as Start
from .robot.scene import sample_times as sample_times
from .scene_files.scene_file import catalog as catalog
from .scene_files.scene_file import load_scene as load_scene
from .scene_files.scene_file import scene_schema as scene_schema
from .theory.plane import in_space as in_space
from .view.export import export_scene as export_scene
from .view.export import scene_toml as scene_toml
from .view.notebook import plot as plot
from .view.render import film as film

Agreement = _validation.Agreement
check_robot = _validation.check_robot
compare = _validation.compare
assert_agrees = _validation.assert_agrees
compare_many = _validation.compare_many
sweep = _validation.sweep

def validation_package(module: str = "") -> types.ModuleType: ...
