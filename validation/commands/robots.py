"""The commands for builders of robots, from `check` to `export`, and `scenes`."""

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from .. import options

if TYPE_CHECKING:
    from robotball.design.steering import WantedPath


def check(
    file: Path,
    /,
    *,
    shell: Annotated[str | None, Parameter(metavar="NAME")] = None,
    rolling: Literal["rubber", "classical"] | None = None,
    keyframe: Annotated[str | None, Parameter(metavar="NAME")] = None,
    control: options.Controls = (),
    accuracy: Annotated[float, Parameter(metavar="ERROR")] = options.CHECKED,
    duration: options.Seconds | None = None,
    out: options.Out = options.OUT,
    json: options.JsonFile = None,
) -> int:
    """Check whether an MJCF or URDF robot rolls as it should; if not, find the wrong setting.

    Writes a mended file, a page and a picture. Your own file is not changed.

    Example: robotball check mybot.xml

    Parameters
    ----------
    file
        The MJCF or URDF file of the robot.
    shell
        The body or geom that rolls. Default: the largest sphere.
    rolling
        The rolling model. Default: the model that is nearer to the file's motion.
    keyframe
        The keyframe to start at. Default: the first one.
    accuracy
        Largest path error, relative to the path length, that counts as agreement.
    duration
        Simulated time. Default: 10 s.
    """
    from ..check.ablate import motions_of
    from ..check.checking import checked_robot
    from ..check.say import difference, page_of, study_of
    from ..output import writable_folder, write_text
    from ..results import controls_of
    from ..study import present

    writable_folder(out)
    seconds = options.CHECK_TIME if duration is None else duration
    checked, notes = checked_robot(
        file, controls_of(control), seconds, accuracy, shell, rolling, keyframe
    )
    study = study_of(checked, notes)
    picture, html = (out / f"{study.stem()}.{kind}" for kind in ("png", "html"))
    present(study, picture, json, None)
    write_text(html, page_of(study, checked, picture, motions_of(checked)))
    print(picture, html, sep="\n")
    if checked.is_changed:
        mended = out / f"{file.stem}-mended.xml"
        write_text(mended, checked.text)
        print(mended, *difference(checked), sep="\n")
    return options.AGREES if checked.agrees else options.DISAGREES


def fit(
    scene: options.SceneName,
    /,
    *logs: Path,
    free: options.Names = (),
    also: options.Names = (),
    noise: options.Names = (),
    map: options.ColumnNames = (),
    patience: options.Seconds = 120.0,
    all: bool = False,
    out: options.Out = options.OUT,
    json: options.JsonFile = None,
) -> int:
    """Find the masses, positions, gains and resistances that explain a robot's logs.

    Several logs are fitted together, except the last one, which tests the result. Writes the fitted
    scene and a page. docs/fitting.md describes the columns of a log, and which motion reveals which
    number.

    Exit status: 0 if the model explains the logs; 1 if it does not, or if the logs do not constrain
    the numbers; 2 if the scene or a log cannot be used.

    Example: robotball fit pendulum_robot run.csv --free battery.mass,frame.kv

    Parameters
    ----------
    logs
        Files of the sensor readings: CSV, NPZ, Parquet, JSON lines, MATLAB, or ROS bags.
    free
        Paths, or ends of paths, of numbers to find. With limits: frame.kv=0.1:0.8.
    also
        What else to find for each log: world.yaw, world.origin, position.marker, gyro.bias,
        accelerometer.place, commands.delay, sensors.clock, SENSOR.clock, SENSOR.scale,
        HINGE_angle.zero.
    noise
        Standard deviation of a sensor's noise in SI units, such as gyro=0.02. Default: estimated.
    patience
        Time for the search; then the best values so far are reported.
    all
        Fit all logs, and hold none out.
    """
    from ..output import columns_named
    from ..results import changed, file_name
    from ..studies.fitting import fit_logs

    words = changed(fit, free=free, also=also, noise=noise, patience=patience, all=all)
    suffix = file_name("", None, [*(path.stem for path in logs), *words])
    return fit_logs(
        scene, logs, free, also=also, noise=noise, names=columns_named(map),
        patience=patience, hold_out=not all, suffix=suffix, out=out, json=json,
    )  # fmt: skip


def judge(
    scene: options.SceneName,
    /,
    *files: Path,
    control: options.Controls = (),
    map: options.ColumnNames = (),
    tolerance: Annotated[float, Parameter(metavar="ERROR")] = options.TOLERANCE,
    json: options.JsonFile = None,
) -> int:
    """Measure the error of a trajectory from any simulator, and find the mistake behind it.

    docs/trajectories.md describes the columns. 'robotball export' writes what an engine needs.

    Example: robotball judge fig12 fig12-export/reference.csv

    Parameters
    ----------
    files
        Files with t,x,y,qw,qx,qy,qz, or t,x,y alone: CSV, NPZ, Parquet, JSON lines, MATLAB, or ROS
        bags.
    tolerance
        Largest errors that agree: relative for path, height, momentum and rates; in rad for the
        attitude.
    """
    from ..output import columns_named
    from ..results import controlled
    from ..studies.judge import judge_files

    ball, names = controlled(scene, control), columns_named(map)
    return judge_files(ball, scene, files, names, tolerance, json)


_NEAR_PATH = 1e-3  # of the path's length: how near to it a robot that is steered must come
_Metres = Annotated[float, Parameter(metavar="M")]
_Rate = Annotated[float, Parameter(metavar="RAD/S")]


def design(
    scene: options.SceneName,
    /,
    *,
    mass: Annotated[float | None, Parameter(metavar="KG")] = None,
    rotor_speed: _Rate = math.inf,
    frame_radius: _Metres | None = None,
    shell_thickness: _Metres = 0.0,
    out: options.Out = options.OUT,
) -> int:
    """Find bodies that give the A, Ω and K of a scene; print them, and write a scene with them.

    Example: robotball design fig12 --rotor-speed 20

    Parameters
    ----------
    mass
        Mass of the ball. Default: the best one.
    rotor_speed
        Largest speed of a rotor.
    frame_radius
        Radius within which the frame must lie. Default: the shell's radius.
    shell_thickness
        Thickness of a homogeneous shell. 0: a thin shell.
    """
    from robotball import Limits, load_scene, scene_toml
    from robotball.design.designing import describe, redesign

    from ..output import writable_folder, write_text
    from ..results import changed, file_name

    limits: dict[str, Any] = {
        "rotor_speed": rotor_speed,
        "frame_radius": frame_radius,
        "shell_thickness": shell_thickness,
    }
    found, designed = redesign(load_scene(scene), mass, Limits(**limits))
    name = file_name(designed.name, None, changed(design, mass=mass, **limits))
    path = writable_folder(out) / f"{name}.toml"
    write_text(path, scene_toml(replace(designed, name=name)))
    print(describe(found), path, sep="\n")
    return options.AGREES


def steer(
    scene: options.SceneName,
    /,
    *,
    path: Literal["line", "circle", "eight"] = "line",
    size: _Metres = 1.0,
    turns: float = 1.0,
    through: Annotated[str, Parameter(metavar="X,Y …")] = "",
    duration: options.Seconds = 10.0,
    rate_limit: _Rate = math.inf,
    preset: options.PresetName | None = None,
    out: options.Out = options.OUT,
) -> int:
    """Find the drives that roll a robot along a path, and check them in both engines.

    The robot has two driven hinges. The path begins at the origin, along X. Writes the scene with
    the drives, and pictures.

    Example: robotball steer three_rotors --path circle --size 0.5

    Parameters
    ----------
    path
        Shape of the path.
    size
        Length of the line, radius of the circle, or half the length of the eight.
    turns
        Number of turns round the circle. Negative: to the right.
    through
        Points in m, in place of a shape: "1,0 1,1 0,1".
    duration
        Time of the motion, from rest to rest.
    rate_limit
        Largest speed of a hinge.
    preset
        Settings of the engine to check the drives with. Default: the engine's default.
    """
    import numpy as np

    from robotball import load_scene, scene_toml
    from robotball.design import steering

    from ..agreement import compare
    from ..output import writable_folder, write_text
    from ..plots import draw
    from ..results import changed, file_name

    robot, wanted = load_scene(scene), _path_of(path, size, turns, through)
    steered = steering.steer(robot, wanted, duration)
    writable_folder(out)
    words = changed(steer, size=size, turns=turns, through=through, duration=duration)
    # The scene carries the name of its file, by which both pictures are called too.
    driven = replace(steered.scene, name=file_name(steered.scene.name, None, words))
    file = out / f"{driven.name}.toml"
    write_text(file, scene_toml(driven))
    agreement = compare(driven, steered.times, settings=preset)
    theory = agreement.theory
    off = float(np.linalg.norm(theory.contact_point - steered.wanted, axis=1).max())
    print(f"{wanted.name} of {wanted.length:.4g} m in {duration:g} s")
    print(f"{theory.engine.name}: at most {off:.2g} m off the path")
    print(f"{agreement.motion.engine.name}: {agreement.verdict}")
    most = (np.abs(each).max(axis=0) for each in (theory.hinge_rates, theory.loads.motor_torques))
    for hinge, rate, torque in zip(robot.hinges, *most, strict=True):
        print(f"{hinge.name}: up to {rate:.3g} rad/s and {torque:.3g} N m")
    friction, torsion = theory.loads.sliding_friction, theory.loads.torsional_friction
    print(f"friction: up to {friction.max():.3g}, torsional {torsion.max():.3g} m")
    # Loads follow from accelerations, so they are known only from the motion.
    missing = steering.shortfalls(robot, theory, rate_limit)
    if off > _NEAR_PATH * wanted.length:
        missing.append(f"it leaves the path by {off:.2g} m")
    for line in missing:
        print(f"cannot: {line}")
    print(file, *draw([agreement], out), sep="\n")
    return options.AGREES if agreement.agrees and not missing else options.DISAGREES


def _path_of(shape: str, size: float, turns: float, through: str) -> "WantedPath":
    from robotball.design import steering

    if through:
        return steering.through(_points_of(through))
    if shape == "circle":
        return steering.circle(size, turns)
    return steering.eight(size) if shape == "eight" else steering.straight(size)


def _points_of(text: str) -> list[tuple[float, float]]:
    """Return the pairs X,Y of a text. Raises InputError for other texts."""
    from robotball import InputError

    try:
        points = [(float(x), float(y)) for x, y in (pair.split(",") for pair in text.split())]
    except ValueError:
        points = []
    if not points:
        raise InputError(f'--through takes pairs X,Y, such as "1,0 1,1", not {text!r}')
    return points


def scenes(*, copy: Annotated[str | None, Parameter(metavar="NAME")] = None) -> int:
    """List the scenes of the catalog, or copy one to start a file of your own.

    Example: robotball scenes --copy pendulum_robot

    Parameters
    ----------
    copy
        Write this scene's file into the current folder, with a JSON schema: an editor uses the
        schema to complete and check the keys.
    """
    from rich.console import Console
    from rich.markup import escape

    from robotball.scene_files.scene_file import heads

    from ..output import plain_table, print_whole

    if copy is not None:
        return _copy(copy)
    table = plain_table(("scene", "rolling", "duration", "title"), left=(0, 1, 3))
    for name, head in heads().items():
        table.add_row(name, head["rolling"], f"{head['duration']:g} s", escape(head["title"]))
    print_whole(table, Console())
    return options.AGREES


def _copy(name: str) -> int:
    """Copy a scene of the catalog, and write the schema that the copy's first line names."""
    from robotball import InputError, catalog, scene_schema
    from robotball.errors import unknown
    from robotball.files import json_text
    from robotball.scene_files.scene_file import CATALOG

    from ..output import program, write_text

    if name not in catalog():
        raise unknown("scene", name, catalog())
    file, schema = Path(f"{name}.toml"), Path("robotball.schema.json")
    if file.exists():
        raise InputError(f"{file} exists: rename that file, or run this in another folder")
    write_text(schema, json_text(scene_schema(), indent=1) + "\n")
    text = (CATALOG / file).read_text(encoding="utf-8")
    write_text(file, f"#:schema ./{schema}\n{text}")
    print(f"{file}, and {schema}, with which an editor completes and checks its keys")
    print(f"Change it, then: {program()} compare {file}")
    return options.AGREES


def export(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    friction: options.Frictions = (),
    out: Annotated[Path | None, Parameter(metavar="DIR")] = None,
    preset: options.PresetName = "balanced",
    duration: options.Duration = None,
) -> int:
    """Print a scene as MJCF, or write it as MJCF, URDF and TOML for other simulators.

    'robotball judge' compares the other simulator's trajectory with the equations.

    Example: robotball export fig12 --out fig12-export

    Parameters
    ----------
    out
        Write all formats into this folder instead of printing the MJCF.
    preset
        Settings of the engine that are written into the MJCF.
    """
    from robotball import export_scene
    from robotball import preset as settings_of
    from robotball.engines.mujoco.mjcf_export import write_model

    from ..output import writable_folder, write_text
    from ..results import controlled

    ball, settings = controlled(scene, control, friction=friction), settings_of(preset)
    ball = replace(ball, duration=options.seconds_of(duration, False, ball))
    if out is None:
        model = write_model(ball, settings)
        print(model.xml, end="")
        if model.needs is not None:
            print(f"robotball: {model.needs}; --out DIR writes it", file=sys.stderr)
        return options.AGREES
    folder = writable_folder(out)
    written = export_scene(ball, folder)
    if ball.plane_is_still:  # MJCF cannot say how a plane moves
        for name, text in write_model(ball, settings).files.items():
            write_text(folder / name, text)
            written.append(folder / name)
    print(*sorted(written), sep="\n")
    return options.AGREES
