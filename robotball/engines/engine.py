"""Contact engines: their protocol, requests to them, their names, and `simulate`.

An engine's module is imported when the engine is requested by name, so its dependencies are needed
only by its users. Another package adds an engine with an entry point in the group
`robotball.engines`. The entry point has the engine's name and points to an Engine.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from robotball.engines.equations import scene_of
from robotball.errors import InputError, unknown, warn
from robotball.motion import ContactMotion, EngineSettings, Label, Progress, preset_named
from robotball.robot.loads import Loads
from robotball.robot.scene import Friction, Scene, Times, times_of
from robotball.rotations import Array

Runner = Callable[[Array, Scene], ContactMotion]
"""Takes times (n,) [s] from 0 and a scene that starts in another state; returns the motion."""
Kind = TypeVar("Kind", bound=EngineSettings)


class Engine(Protocol):
    """Protocol of a contact engine.

    Any object with these members is an engine. A class that inherits from Engine gets the default
    members that are defined here.

    Attributes
    ----------
    label : Label
        The engine's name, version and colour.
    presets : mapping of str to EngineSettings
        The engine's settings by name.
    default : str
        The name of the preset that is used if no settings are given.
    least_accuracy : float or None
        The smallest path error for which the engine can choose settings. None if the engine cannot
        choose settings.
    as_it_comes : str
        The name of the preset with the settings that a newcomer would write.
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
        """Return the reason why the engine cannot run this scene, in one line, or None."""
        return None

    def friction(self, scene: Scene, settings: EngineSettings) -> Friction | None:
        """Return the contact's friction for a scene and settings; None if it is unknown."""
        return None

    def run(self, scene: Scene, times: Array, request: "Request") -> ContactMotion:
        """Return the scene's motion at times (n,) [s] from 0; fewer times if the run failed."""
        ...

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """Return a function that runs the scene from any state, without a new set-up."""
        request = Request(self, settings)
        return lambda times, started: self.run(started, times, request)

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motion of each scene, equal to the motion that `run` returns."""
        request = Request(self, settings)
        return (self.run(scene, times, request) for scene in scenes)


@dataclass(frozen=True)
class Request:
    """Request to an engine, with either settings or an accuracy.

    Attributes
    ----------
    engine : Engine
        The engine that runs the scene.
    settings : EngineSettings or None
        The engine's settings. None if settings are chosen for `accuracy`.
    accuracy : float or None
        The path error to reach, relative to the path's length. None if settings are given.
    strict : bool
        If True, settings that are predicted to fail raise InputError. If False, they cause a
        warning.
    progress : callable or None
        Called with the simulated fraction, from 0 to 1.
    loads : Loads or None
        The loads of the whole motion, if a reference motion gives them. The predictions use them.

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


def as_own(settings: EngineSettings | None, kind: type[Kind], label: Label) -> Kind:
    """Return the settings of an engine. Raises InputError if their type is not `kind`."""
    if not isinstance(settings, kind):
        raise InputError(f"{label.name} needs {kind.__name__}, not {settings!r}")
    return settings


_GROUP = "robotball.engines"
DEFAULT = "mujoco"
# Strings as in entry points, because imports here would load all engines.
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
    "rapier": "robotball.engines.rapier:RAPIER",
}


def engine_names() -> list[str]:
    """List the names of all engines.

    Returns
    -------
    list of str
        The names of robotball's engines, followed by the engines that installed packages add with
        an entry point in the group `robotball.engines`. An engine is listed even if its
        dependencies are not installed.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.engine_names()[:3]
    ['mujoco', 'multibody', 'bullet']
    """
    return [*OURS, *sorted({point.name for point in entry_points(group=_GROUP)} - OURS.keys())]


def engine_named(name: str) -> Engine:
    """Load an engine by name.

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
    ['accurate', 'balanced', 'efficient', 'exact', 'fast', 'naive']
    """
    engine: Engine
    if name in [*OURS]:
        module, attribute = OURS[name].split(":")
        engine = getattr(import_module(module), attribute)
        return engine
    for point in entry_points(group=_GROUP, name=name):
        from robotball.errors import call_users

        engine = call_users(f"the engine {name!r} of {point.value} fails", point.load)
        return engine
    raise unknown("engine", name, engine_names())


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
    """Simulate a scene with a contact engine.

    A run ends at its first fault, so the motion may have fewer times than requested. If the
    settings have `stop_at_fault=False`, a run ends only at a fault after which the ball has no
    state.

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
        The path error to reach, relative to the path's length. Settings are chosen for this error,
        so give either `accuracy` or `settings`.
    strict : bool, default False
        Raise InputError for settings that are predicted to fail, instead of a warning.
    progress : callable, optional
        Called with the simulated fraction, from 0 to 1.

    Returns
    -------
    ContactMotion
        The motion, with a report on its run.

    Raises
    ------
    InputError
        If the times are invalid, the engine or the preset is unknown, the engine cannot express the
        scene, rounding errors exceed the accuracy, the run needs more steps than the settings
        allow, or `load_scene` raises it.

    Warns
    -----
    SceneWarning
        If the accuracy is not reached, if settings are predicted to fail, if the motion is
        implausible, or if `load_scene` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.simulate("fig12", 0.5, settings="fast")
    >>> print(f"{motion.path_length:.3f} m in {motion.report.steps} steps")
    1.857 m in 25 steps
    """
    request = replace(request_of(engine, settings, accuracy), strict=strict, progress=progress)
    return run_request(scene_of(scene), times, request)


def request_of(
    engine: Engine | str = DEFAULT,
    settings: EngineSettings | str | None = None,
    accuracy: float | None = None,
    *,
    keep_going: bool = False,
) -> Request:
    """Return the request for a user's choices.

    keep_going: continue a run after its first fault. Raises InputError for an unknown engine or
    preset, for both settings and accuracy, and for an accuracy that the engine cannot reach.
    """
    if isinstance(engine, str) or not hasattr(engine, "presets"):
        engine = engine_named(str(engine))
    if accuracy is not None:
        _check_accuracy(engine, settings, accuracy, keep_going)
        return Request(engine, None, float(accuracy))
    if not isinstance(settings, EngineSettings):
        settings = preset_named(engine.presets, settings or engine.default)
    return Request(engine, replace(settings, stop_at_fault=False) if keep_going else settings)


def _check_accuracy(
    engine: Engine, settings: EngineSettings | str | None, accuracy: float, keep_going: bool
) -> None:
    if settings is not None:
        raise InputError("give settings or an accuracy, not both: the accuracy sets the settings")
    if keep_going:
        raise InputError("--keep-going needs a preset: a run with a fault reaches no accuracy")
    if engine.least_accuracy is None:
        raise InputError(f"{engine.label.name} does not support an accuracy: give a preset")
    if not engine.least_accuracy <= accuracy < 1:
        raise InputError(
            f"accuracy must be at least {engine.least_accuracy:g}, the limit of rounding, and less "
            f"than 1, not {accuracy:g}"
        )


def run_request(scene: Scene, times: Times, request: Request) -> ContactMotion:
    """Run a request as `simulate` does."""
    times = runnable(scene, times, request)
    # The last time may be later than the scene's duration; the drives must be defined up to it.
    return as_of(scene, request.engine.run(scene.until(float(times[-1])), times, request))


def runnable(scene: Scene, times: Times, request: Request) -> Array:
    """Return the times of a run. Raises InputError if the engine cannot run the scene."""
    if why := request.engine.cannot_express(scene):
        raise InputError(f"{request.engine.label.name} cannot run {scene.name}: {why}")
    if scene.controller and not getattr(request.engine, "closes_loops", False):
        raise InputError(
            f"{request.engine.label.name} cannot run {scene.name}: the engine has no controllers; "
            "choose mujoco or multibody"
        )
    return times_of(times, scene)


def as_of(scene: Scene, motion: ContactMotion) -> ContactMotion:
    """Return the motion with the user's scene, and warn if it is implausible."""
    for line in _doubts(motion):
        warn(f"{scene.name}: {line}")
    return replace(motion, scene=scene)


_STILL = 10.0  # s; a rolling ball covers at least its radius in this time
_SAMPLED = 100  # samples; with fewer the path's length is uncertain
# A factor of torque_limit/kv, which is a motor's rate without load if the limit is its stall
# torque. Electronics may limit the torque to less than this, but seldom to a fifth of it.
_NO_LOAD = 5.0


def _doubts(motion: ContactMotion) -> Iterator[str]:
    """Yield the reasons why the motion is implausible; the usual cause is wrong units."""
    scene, radius = motion.scene, motion.scene.ball.radius
    # A fault already reports that the motion is wrong.
    if motion.report.faults or len(motion.times) < _SAMPLED:
        return
    if motion.times[-1] >= _STILL and motion.path_length < radius:
        yield (
            f"the ball rolls {motion.path_length:.2g} m in {motion.times[-1]:g} s, less than its "
            f"radius of {radius:g} m: check the start, the rates [rad/s] and the masses [kg]"
        )
    for hinge, rates in zip(scene.hinges, motion.hinge_rates.T, strict=True):
        if hinge.motor is not None and hinge.motor.follows_rate:
            no_load, rate = hinge.motor.law.limit / hinge.motor.law.per_rate, np.abs(rates).max()
            if rate > _NO_LOAD * no_load:
                yield (
                    f"{hinge.name}'s motor turns at {rate:.3g} rad/s, but a motor that stalls at "
                    f"torque_limit turns at most at torque_limit/kv = {no_load:.3g} rad/s: check "
                    "rate (1 rpm is 0.105 rad/s), kv and torque_limit"
                )
