"""What an engine is to the rest of the program, and what can be requested of one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Protocol, TypeVar

from robotball.errors import InputError
from robotball.motion import ContactMotion, EngineSettings, Label, Loads
from robotball.rotations import Array
from robotball.scene import Scene, Start

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""
Ladder = tuple[str, tuple[float, ...]]
"""A field of an engine's settings and the values that it takes in turn."""
Runner = Callable[[Array, Start], ContactMotion]
"""Times (n,) [s] from 0 and a start → the motion."""
Own = TypeVar("Own", bound=EngineSettings)


class Engine(Protocol):
    """A contact engine.

    presets: its settings by name; default: the preset that is taken where none is named;
    least_accuracy: the smallest path error that it can choose settings for, None where it can't;
    as_it_comes: the preset that a newcomer would write; ladders: by preset, a field of its settings
    and the values at which its error is held against its cost.
    """

    label: Label
    presets: Mapping[str, EngineSettings]
    default: str
    least_accuracy: float | None
    as_it_comes: str = "as-it-comes"
    ladders: Mapping[str, "Ladder"] = MappingProxyType({})

    def cannot_express(self, scene: Scene) -> str | None:
        """Why the engine cannot roll this scene, in a line; None where it can."""
        ...

    def run(self, scene: Scene, times: Array, request: "Request") -> ContactMotion:
        """Return the scene's motion at times (n,) [s] from 0; fewer where the run broke off."""
        ...

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """The engine made ready to run the scene's ball from one start after another."""
        request = Request(self, settings)
        return lambda times, start: self.run(replace(scene, start=start), times, request)


@dataclass(frozen=True)
class Request:
    """A run requested of an engine, by its own settings or by any that reach an accuracy.

    settings      None where the accuracy chooses them
    accuracy      the path error to reach, over the path's length; None where settings are given
    strict        raise InputError where the settings are predicted to fail, instead of a warning
    fault_window  the file for the states around the first fault, of an engine that keeps them
    progress      is called with the simulated fraction
    loads         of the whole motion, where a reference knows them, for the predictions
    """

    engine: Engine
    settings: EngineSettings | None
    accuracy: float | None = None
    strict: bool = False
    fault_window: Path | None = None
    progress: Progress | None = None
    loads: Loads | None = None

    @property
    def name(self) -> str:
        """The name of the run, for tables and files."""
        return f"to {self.accuracy:g}" if self.settings is None else self.settings.name


def as_own(settings: EngineSettings | None, kind: type[Own], label: Label) -> Own:
    """The settings as an engine's own kind; raises InputError where they are another engine's."""
    if not isinstance(settings, kind):
        raise InputError(f"{label.name} runs by {kind.__name__}, not by {settings!r}")
    return settings
