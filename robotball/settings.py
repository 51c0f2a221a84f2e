"""What the settings of every engine have, whatever else they say."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from robotball.errors import unknown


@dataclass(frozen=True, kw_only=True)
class EngineSettings:
    """How an engine is to run a scene; each engine adds its own.

    error_tolerance: the largest path error and momentum error, both relative, that the settings
    are held to over 10 s on the scenes of the catalog; accuracy: the path error that they were
    chosen for, if they were; stop_at_fault: end the run at its first fault, or go on as long as
    there is a state.
    """

    name: str
    error_tolerance: float
    accuracy: float | None = None
    stop_at_fault: bool = True

    def plain(self) -> dict[str, Any]:
        """The settings as plain data, without what is left open."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
            if value is not None
        }


Preset = TypeVar("Preset", bound=EngineSettings)


def preset_named(presets: Mapping[str, Preset], name: str) -> Preset:
    """One of an engine's presets; raises InputError with the near matches where there is none."""
    if name not in presets:
        raise unknown("preset", name, presets)
    return presets[name]
