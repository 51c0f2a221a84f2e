"""The numbers of a file that holds a scene, by their paths, whatever the file's kind."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from robotball.errors import InputError, unknown
from robotball.robot.scene import Scene


class Number(NamedTuple):
    """A number of a file, its unit, "" where that depends on others, and where it stands."""

    value: float
    unit: str
    place: Any


class Numbers(ABC):
    """The numbers of a file by their paths, and the scene and the file's text with others.

    suffix: of the file's name.
    """

    suffix: str

    @property
    @abstractmethod
    def known(self) -> Mapping[str, Number]:
        """Each number, by its path."""

    @abstractmethod
    def scene(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with other numbers at some paths. Raises InputError where none is."""

    @abstractmethod
    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the text of a file with other numbers, that starts as a scene does."""

    def with_whole(self, names: Sequence[str]) -> "Numbers":
        """Return the numbers with mass, centre and inertia of some bodies in place of their parts.

        Raises InputError where a file of its kind has no such bodies.
        """
        if names:
            raise InputError(
                f"{names[0]}.inertia: scene files alone have bodies that are sought as a whole; "
                "give numbers of the body"
            )
        return self

    def path_of(self, name: str) -> str:
        """Return the one path that a name stands for: its last words are enough.

        Raises InputError for a name that stands for none, with near ones, or for several.
        """
        words = name.split(".")
        found = [path for path in self.known if _follows(words, path.split("."))]
        if name in found or len(found) == 1:
            return name if name in found else found[0]
        if found:
            raise InputError(f"{name!r} may be {', '.join(found)}; give more of its path")
        raise unknown("number of the scene", name, self.known)


def _follows(words: list[str], path: list[str]) -> bool:
    """Return whether words are a path's, in its order, and the last is its last."""
    rest = iter(path)
    return words[-1] == path[-1] and all(word in rest for word in words)
