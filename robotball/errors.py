"""The one exception that a user's input can raise, and the one warning."""

import math


class InputError(ValueError):
    """Input that cannot be used; the message is one line: the value, the limit, what to do."""

    def __init__(self, message: str) -> None:
        # A quoted key or a file's name may hold a line break of its own.
        super().__init__(" ".join(message.splitlines()))


class SceneWarning(UserWarning):
    """A scene that runs, but not as its author may think; one line."""


def check_positive(what: str, value: float, unit: str) -> None:
    """Raises InputError unless `value` is positive and finite."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{what} must be positive and finite, not {value:g} {unit}")


def check_count(name: str, value: int, least: int) -> int:
    """`value`; raises InputError where it is below `least`."""
    if value < least:
        raise InputError(f"{name} must be at least {least}, not {value}")
    return value
