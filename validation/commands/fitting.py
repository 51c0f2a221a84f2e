"""The commands that read measured motions: `fit` logs of a robot, and `judge` trajectories."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .. import options


def fit(
    scene: options.SceneName,
    /,
    *logs: Path,
    free: options.Names = (),
    also: options.Names = (),
    noise: options.Names = (),
    loss: Literal["linear", "soft_l1", "huber", "cauchy", "arctan"] = "linear",
    all: bool = False,
    engine: Annotated[str, Parameter(metavar="ENGINE")] = "mujoco",
    preset: options.Names = (),
    out: options.Out = options.OUT,
    json: options.JsonFile = None,
) -> int:
    """Find the masses, positions, gains and resistances that explain a robot's logs.

    Several logs are fitted together, except the last one, which tests the result. Writes the fitted
    scene and a page. docs/fitting.md describes the columns of a log, and which motion reveals which
    number.

    Exit status: 0 if the model explains the logs; 1 if it does not, if the logs do not constrain
    the numbers, or if a number ends at its limit; 2 if the scene or a log cannot be used.

    Example: robotball fit pendulum_robot run.csv --free battery.mass,frame.kv

    Parameters
    ----------
    logs
        CSV, NPZ or Parquet files of the sensor readings.
    free
        Numbers to find, by their paths or the last words of these; with limits as frame.kv=0.1:0.8.
    also
        What else to find for each log: world.yaw, world.origin, position.marker, gyro.bias,
        accelerometer.place, commands.delay, sensors.clock, SENSOR.clock, SENSOR.scale,
        HINGE_angle.zero.
    noise
        Standard deviation of a sensor's noise in SI units, as gyro=0.02. Default: estimated.
    loss
        Loss of scipy's least_squares; every loss except linear tolerates outliers.
    all
        Fit all logs, and hold none out.
    engine
        The engine of the presets.
    preset
        Also fit with these presets of the engine, to see how its contact shifts the numbers.
    """
    from ..studies.fitting import fit_logs

    return fit_logs(
        scene, logs, free, also=also, noise=noise, loss=loss,
        hold_out=not all, engine=engine, presets=preset, out=out, json=json,
    )  # fmt: skip


def judge(
    scene: options.SceneName,
    /,
    *files: Path,
    control: options.Controls = (),
    tolerance: Annotated[float, Parameter(metavar="ERROR")] = options.TOLERANCE,
    json: options.JsonFile = None,
) -> int:
    """Say how far a trajectory from any simulator is off, and which mistake explains the error.

    docs/trajectories.md describes the columns. 'robotball export' writes what an engine needs.

    Example: robotball judge fig12 fig12-export/reference.csv

    Parameters
    ----------
    files
        CSV, NPZ or Parquet files with t,x,y,qw,qx,qy,qz.
    tolerance
        Largest errors that agree: relative for path, height, momentum and rates; in rad for the
        attitude.
    """
    from ..results import controlled
    from ..studies.judge import judge_files

    return judge_files(controlled(scene, control), files, tolerance, json)
