"""The engines, and the two motions of a scene: by a contact engine and by the equations.

In order: what an engine is, a request to one, the names of engines, `simulate` by a contact engine,
`integrate` by the equations. Engines are loaded when they are named, so that none needs another and
what an engine depends on is imported only for its users. A package adds an engine by an entry point
of the group `robotball.engines`, whose name is the engine's and whose object is an Engine.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar

import numpy as np

from robotball.errors import InputError, check_count, check_size, unknown, warn
from robotball.motion import (
    ContactMotion,
    EngineSettings,
    Label,
    Progress,
    ReferenceMotion,
    arrays_of,
    preset_named,
)
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene, Times, times_of
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL

Runner = Callable[[Array, Scene], ContactMotion]
"""Times (n,) [s] from 0 and a scene that starts in another state → the motion."""
Own = TypeVar("Own", bound=EngineSettings)


class Engine(Protocol):
    """Run scenes as a contact engine does.

    Any object with these members is an engine. A class that derives from this one inherits the
    members that have a value here.

    Attributes
    ----------
    label : Label
        The engine's name, version and colour.
    presets : mapping of str to EngineSettings
        The engine's settings by name.
    default : str
        The preset that is taken if no settings are given.
    least_accuracy : float or None
        The smallest path error that the engine can choose settings for. None if it chooses none.
    as_it_comes : str
        The preset that a newcomer would write.
    closes_loops : bool
        Whether the engine runs scenes with a controller.

    Examples
    --------
    >>> import robotball as rb
    >>> engine = rb.engine_named("mujoco")
    >>> engine.label.name, engine.default
    ('MuJoCo', 'balanced')
    >>> print(engine.cannot_express(rb.load_scene("fig12")))
    None
    """

    label: Label
    presets: Mapping[str, EngineSettings]
    default: str
    least_accuracy: float | None = None
    as_it_comes: str = "as-it-comes"
    closes_loops: bool = False

    def cannot_express(self, scene: Scene) -> str | None:
        """Return why the engine cannot roll this scene, in a line; None where it can."""
        return None

    def run(self, scene: Scene, times: Array, request: "Request") -> ContactMotion:
        """Return the scene's motion at times (n,) [s] from 0; fewer where the run broke off."""
        ...

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """Return the engine made ready to run a scene from one state of its ball after another."""
        request = Request(self, settings)
        return lambda times, started: self.run(started, times, request)

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes, as `run` returns them."""
        request = Request(self, settings)
        return (self.run(each, times, request) for each in scenes)


@dataclass(frozen=True)
class Request:
    """Request a run of an engine, by its own settings or by an accuracy.

    Attributes
    ----------
    engine : Engine
        The engine that runs the scene.
    settings : EngineSettings or None
        The engine's settings. None if the accuracy chooses them.
    accuracy : float or None
        The path error to reach, relative to the path's length. None if settings are given.
    strict : bool
        Whether settings that are predicted to fail raise InputError. Otherwise they cause a
        warning.
    progress : callable or None
        Called with the simulated fraction, from 0 to 1.
    loads : Loads or None
        The loads of the whole motion, if a reference knows them. The predictions use them.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.Request(rb.engine_named("mujoco"), None, accuracy=1e-6).name
    'to 1e-06'
    """

    engine: Engine
    settings: EngineSettings | None
    accuracy: float | None = None
    strict: bool = False
    progress: Progress | None = None
    loads: Loads | None = None

    @property
    def name(self) -> str:
        """The name of the run, for tables and files."""
        return f"to {self.accuracy:g}" if self.settings is None else self.settings.name


def as_own(settings: EngineSettings | None, kind: type[Own], label: Label) -> Own:
    """Return the settings as an engine's own kind. Raises InputError if they are another's."""
    if not isinstance(settings, kind):
        raise InputError(f"{label.name} runs by {kind.__name__}, not by {settings!r}")
    return settings


_GROUP = "robotball.engines"
DEFAULT = "mujoco"
# Named by strings, as entry points are: an import would load all engines at once.
OURS = {
    "mujoco": "robotball.engines.mujoco.mujoco_engine:MUJOCO",
    "multibody": "robotball.engines.multibody_engine:MULTIBODY",
    "bullet": "robotball.engines.bullet:BULLET",
    "dart": "robotball.engines.dart:DART",
    "drake": "robotball.engines.drake:DRAKE",
    "exudyn": "robotball.engines.exudyn:EXUDYN",
    "genesis": "robotball.engines.genesis:GENESIS",
    "mjx": "robotball.engines.mujoco.ports:MJX",
    "mujoco-warp": "robotball.engines.mujoco.ports:WARP",
    "newton": "robotball.engines.newton:NEWTON",
    "physx": "robotball.engines.physx:PHYSX",
    "pinocchio": "robotball.engines.pinocchio:PINOCCHIO",
}


def engine_names() -> list[str]:
    """List the names of all engines.

    Returns
    -------
    list of str
        The names: the engines of robotball first, then those that installed packages add by an
        entry point of the group `robotball.engines`. An engine that is listed need not be
        installed.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.engine_names()[:3]
    ['mujoco', 'multibody', 'bullet']
    """
    return [*OURS, *sorted({point.name for point in entry_points(group=_GROUP)} - OURS.keys())]


def engine_named(name: str) -> Engine:
    """Load the engine of a name.

    Parameters
    ----------
    name : str
        A name of `engine_names`.

    Returns
    -------
    Engine
        The engine.

    Raises
    ------
    InputError
        If there is no engine of this name, or if its package is not installed or fails to load.

    Examples
    --------
    >>> import robotball as rb
    >>> sorted(rb.engine_named("mujoco").presets)
    ['accurate', 'adaptive', 'balanced', 'fast', 'naive']
    """
    if name in [*OURS]:
        return _loaded(OURS[name])
    for point in entry_points(group=_GROUP, name=name):
        from robotball.errors import call_users  # which our own engines do without

        engine: Engine = call_users(f"the engine {name!r} of {point.value} fails", point.load)
        return engine
    raise unknown("engine", name, engine_names())


def _loaded(where: str) -> Any:
    """Return the object of a string `module:attribute`."""
    module, attribute = where.split(":")
    return getattr(import_module(module), attribute)


def scene_of(scene: Scene | str | Path) -> Scene:
    """Return a scene, which `load_scene` loads where its name or path is given."""
    if isinstance(scene, Scene):
        return scene
    from robotball.scene_files.scene_file import load_scene

    return load_scene(scene)


def simulate(
    scene: Scene | str | Path,
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    accuracy: float | None = None,
    strict: bool = False,
    progress: Progress | None = None,
) -> ContactMotion:
    """Simulate a scene by a contact engine.

    A run ends at its first fault, so a motion may have fewer times than requested. If
    `stop_at_fault` of the settings is False, only a fault that leaves no state ends the run.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    accuracy : float, optional
        The path error to reach, relative to the path's length. It chooses the settings, so give
        either `accuracy` or `settings`.
    strict : bool, default False
        Whether settings that are predicted to fail raise InputError instead of a warning.
    progress : callable, optional
        Called with the simulated fraction, from 0 to 1.

    Returns
    -------
    ContactMotion
        The motion, with a report on its run.

    Raises
    ------
    InputError
        If times are unusable, the engine or the preset is unknown, the engine cannot express the
        scene, rounding forbids the accuracy, the run needs more steps than the settings allow, or
        `load_scene` raises it.

    Warns
    -----
    SceneWarning
        If the accuracy is not reached, if settings are predicted to fail, if the ball or its motion
        can hardly be intended, or if `load_scene` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.simulate("fig12", 0.5, settings="fast")
    >>> print(f"{motion.path_length:.3f} m in {motion.report.steps} steps")
    1.857 m in 25 steps
    """
    request = request_of(engine, settings, accuracy)
    whole = replace(request, strict=strict, progress=progress)
    return run_request(scene_of(scene), times, whole)


def request_of(
    of: Engine | str = DEFAULT,
    settings: EngineSettings | str | None = None,
    accuracy: float | None = None,
    *,
    keep_going: bool = False,
) -> Request:
    """Return the request of a user's choices.

    keep_going: do not end at the first fault. Raises InputError for an unknown engine or preset,
    for both settings and accuracy, and for an accuracy that the engine cannot reach.
    """
    if isinstance(of, str) or not hasattr(of, "presets"):
        of = engine_named(str(of))
    if accuracy is not None:
        _check_accuracy(of, settings, accuracy, keep_going)
        return Request(of, None, float(accuracy))
    if not isinstance(settings, EngineSettings):
        settings = preset_named(of.presets, settings or of.default)
    return Request(of, replace(settings, stop_at_fault=False) if keep_going else settings)


def _check_accuracy(
    of: Engine, settings: EngineSettings | str | None, accuracy: float, keep_going: bool
) -> None:
    if settings is not None:
        raise InputError("give settings or an accuracy, not both: an accuracy chooses its own")
    if keep_going:
        raise InputError("a run with a fault reaches no accuracy: give --keep-going with a preset")
    if of.least_accuracy is None:
        raise InputError(f"{of.label.name} has no settings for an accuracy: give a preset")
    if not of.least_accuracy <= accuracy < 1:
        raise InputError(
            f"an accuracy must be at least {of.least_accuracy:g}, where rounding ends it, and "
            f"below 1, not {accuracy:g}"
        )


def run_request(scene: Scene, times: Times, request: Request) -> ContactMotion:
    """Simulate the scene as `simulate` does, by a request."""
    times = runnable(scene, times, request)
    # The drives must reach to the last time that is asked for, which may be beyond the scene's own
    # duration. The motion's scene is the user's again.
    return as_of(scene, request.engine.run(scene.until(float(times[-1])), times, request))


def runnable(scene: Scene, times: Times, request: Request) -> Array:
    """Return the times of a run. Raises InputError where the engine cannot run the scene."""
    if why := request.engine.cannot_express(scene):
        raise InputError(f"{request.engine.label.name} cannot run {scene.name}: {why}")
    if scene.controller and not getattr(request.engine, "closes_loops", False):
        raise InputError(
            f"{request.engine.label.name} cannot run {scene.name}: it has no controllers; take "
            "mujoco or multibody"
        )
    return times_of(times, scene)


def as_of(scene: Scene, motion: ContactMotion) -> ContactMotion:
    """Return the motion as that of a user's scene, and warn of what can hardly be meant."""
    for line in _doubts(motion):
        warn(f"{scene.name}: {line}")
    return replace(motion, scene=scene)


_STILL = 10.0  # s, in which a ball that rolls at all rolls farther than its radius
_SAMPLED = 100  # samples of a path at least, by which its length is known
# Times torque_limit/kv, which is a motor's rate without load where the limit is its stall torque;
# electronics may limit it to less, but seldom to a fifth.
_NO_LOAD = 5.0


def _doubts(motion: ContactMotion) -> Iterator[str]:
    """Yield why the motion can hardly be intended, a line each; wrong units are the usual cause."""
    scene, radius = motion.scene, motion.scene.ball.radius
    # A run that faulted has ended early, or has said already that it is off.
    if motion.report.faults or len(motion.times) < _SAMPLED:
        return
    if motion.times[-1] >= _STILL and motion.path_length < radius:
        yield (
            f"the ball rolls {motion.path_length:.2g} m in {motion.times[-1]:g} s, less than its "
            f"radius of {radius:g} m; check the start, the rates [rad/s] and the masses [kg]"
        )
    for i, hinge in enumerate(scene.hinges):
        motor = hinge.motor
        if motor is not None and motor.follows_rate:
            no_load = motor.law.limit / motor.law.per_rate
            rate = np.abs(motion.hinge_rates[:, i]).max()
            if rate > _NO_LOAD * no_load:
                yield (
                    f"{hinge.name}'s motor turns at {rate:.3g} rad/s, but without load "
                    f"at {no_load:.3g} = torque_limit/kv if it stalls at its limit; check rate "
                    "(1 rpm is 0.105 rad/s), kv and torque_limit"
                )


_Equations = Literal["reduced", "multibody"]
_EQUATIONS: dict[_Equations, str] = {
    "reduced": "robotball.theory.reduced:integrate",
    "multibody": "robotball.theory.multibody.integration:integrate",
}


def integrate(
    scene: Scene | str | Path,
    times: Times = None,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    *,
    equations: _Equations | None = None,
    progress: Progress | None = None,
) -> ReferenceMotion:
    """Integrate a scene's motion by the equations of ideal rolling.

    The label of the motion names the equations. Every number of a returned motion is finite.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    rtol : float, default 1e-15
        The relative error allowed in one step, at least the default.
    max_steps : int, optional
        The largest number of steps. The default limit stands for some minutes of work.
    equations : str, optional
        "reduced" for the paper's (3.2) or (3.3), or "multibody" for the equations of any robot. The
        default is "reduced" where these describe the scene, else "multibody".
    progress : callable, optional
        Called with the fraction of the motion that is known, from 0 to 1, if the integration takes
        longer than a moment.

    Returns
    -------
    ReferenceMotion
        The motion, with an estimate of its own error.

    Raises
    ------
    InputError
        If times are unusable, the requested equations do not describe the scene, the ball lifts
        off, the limit of steps is met, a step shrinks to nothing, a number overflows, or
        `load_scene` raises it.

    Warns
    -----
    SceneWarning
        If `load_scene` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.integrate("fig12", 0.5)
    >>> motion.contact_point.shape
    (26, 2)
    >>> print(f"{motion.path_length:.3f} m")
    1.857 m
    """
    scene = scene_of(scene)
    times = times_of(times, scene)
    check_size("rtol", rtol)
    if not LEAST_RTOL <= rtol < 1:
        raise InputError(f"rtol must be at least {LEAST_RTOL:g} and less than 1, not {rtol:g}")
    if max_steps is not None:
        check_count("max_steps", max_steps, 1, 2**62)
    chosen = equations or ("multibody" if scene.not_reduced else "reduced")
    if chosen not in [*_EQUATIONS]:
        raise unknown("set of equations", chosen, _EQUATIONS)
    # Overflow is found in the result, with the number that overflowed, rather than in a warning.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        run = _loaded(_EQUATIONS[chosen])
        motion: ReferenceMotion = run(scene, times, rtol, max_steps, progress)
    _check_finite(motion)
    return motion


def _check_finite(motion: ReferenceMotion) -> None:
    """Raise InputError, with the first number that overflowed, unless all are finite."""
    for place, array in arrays_of(motion):
        finite = np.isfinite(array).reshape(len(array), -1).all(axis=1)
        if not finite.all():
            t = motion.times[finite.argmin()]
            raise InputError(
                f"{motion.scene.name}: the {place[-1].replace('_', ' ')} exceeds "
                f"{np.finfo(float).max:.2g}, the largest number that there is, at t = {t:g} s; "
                "bring the bodies or the rates nearer to 1"
            )
