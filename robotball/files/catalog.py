"""The scenes that come with robotball: their names, and what heads their files."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

CATALOG = Path(__file__).parent.parent / "scenes"


@dataclass(frozen=True)
class Entry:
    """What heads a scene's file: its name, title, rolling model and duration [s]."""

    name: str
    title: str
    rolling: str
    duration: float


def catalog() -> list[str]:
    """The names of the scenes that come with robotball."""
    return sorted(path.stem for path in CATALOG.glob("*.toml"))


def entries() -> list[Entry]:
    """The heads of all these scenes, whose balls are not made."""
    tables = {name: tomllib.loads((CATALOG / f"{name}.toml").read_text()) for name in catalog()}
    return [
        Entry(name, table["title"], table["rolling"], table["duration"])
        for name, table in tables.items()
    ]
