"""Interface to the numbers of a scene or robot file, addressed by path, for any file format."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from robotball.errors import InputError, unknown
from robotball.robot.scene import Scene


class Number(NamedTuple):
    """A number of a file.

    unit: "" if it depends on other numbers; place: location in the file, in a format-specific form.
    """

    value: float
    unit: str
    place: Any


class Numbers(ABC):
    """The numbers of a file by path. They can be replaced to get another scene or another file.

    suffix: suffix of the file's name.
    """

    suffix: str

    @property
    @abstractmethod
    def known(self) -> Mapping[str, Number]:
        """Each number, keyed by path."""

    @abstractmethod
    def scene(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with some numbers replaced. Raises InputError if it is invalid."""

    @abstractmethod
    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the file's text with some numbers replaced and the initial state of `start`."""

    def with_whole(self, names: Sequence[str]) -> "Numbers":
        """Return the numbers with mass, centre and inertia of some bodies instead of their parts.

        Raises InputError for file formats that do not support this.
        """
        if names:
            raise InputError(
                f"{names[0]}.inertia: only scene files can free the inertia of a body as a whole; "
                "name single numbers of the body"
            )
        return self

    def path_of(self, name: str) -> str:
        """Return the path that a name, such as its last parts, stands for.

        Raises InputError, listing candidates, if no path or several paths match.
        """
        parts = name.split(".")
        matches = [path for path in self.known if _follows(parts, path.split("."))]
        if name in matches or len(matches) == 1:
            return name if name in matches else matches[0]
        if matches:
            raise InputError(f"{name!r} is ambiguous: {', '.join(matches)}; give more of the path")
        raise unknown("number of the scene", name, self.known)


def _follows(parts: list[str], path: list[str]) -> bool:
    """Return whether `parts` is an ordered subset of `path` that ends with its last word."""
    rest = iter(path)
    return parts[-1] == path[-1] and all(word in rest for word in parts)
