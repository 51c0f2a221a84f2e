"""What all tables of a scene's TOML share."""

import msgspec

from robotball.errors import InputError


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A TOML table in which every key must be known."""

    def given(self, *keys: str) -> list[str]:
        """Those of the keys that the table has."""
        return [each for each in keys if getattr(self, each) is not None]


def one_of(name: str, ways: dict[str, list[str]]) -> str:
    """The one way of telling something whose keys are given; InputError unless it is one."""
    told = [way for way, keys in ways.items() if keys]
    if len(told) != 1:
        given = " and ".join(", ".join(ways[way]) for way in told) or "nothing"
        raise InputError(f"{name} gives {given}; it takes {', or '.join(ways)}")
    return told[0]
