"""Environments of their own for engines, so that none decides on another's packages.

An environment has the engine and what it asks for; everything else, robotball among it, it takes
from ours, after its own. So MuJoCo of another version is only another environment.
"""

import subprocess
import sys
import sysconfig
import venv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import robotball
from robotball import InputError, engine_named, engine_names
from robotball.engines import DEFAULT
from robotball.engines.adapter import Adapter

OLDER = "mujoco-3.17"  # before RK4 was of order 4 on free joints
LINK = "zz_robotball.pth"


@dataclass(frozen=True)
class Contestant:
    """An engine as one environment has it.

    name: the environment's; engine: its key; requirements: what pip installs there, none where
    our own environment has the engine.
    """

    name: str
    engine: str
    requirements: tuple[str, ...]


def contestants() -> dict[str, Contestant]:
    """All of them by name: the engines, and one of them in an older version."""
    found = []
    for name in engine_names():
        try:
            engine = engine_named(name)
        except InputError:
            continue
        requirements = engine.requirements if isinstance(engine, Adapter) else ()
        found.append(Contestant(name, name, requirements))
    found.append(Contestant(OLDER, DEFAULT, (OLDER.replace("-", "==") + ".*",)))
    return {each.name: each for each in found}


def python_of(contestant: Contestant, folder: Path) -> Path | None:
    """The interpreter that runs it: its environment's, or ours where it needs none; else None.

    An environment without its link, which comes last, was not made to its end, and is none.
    """
    home = folder / contestant.name
    if _link_of(home).exists():
        return (home / "bin" / "python").absolute()
    engine = engine_named(contestant.engine)
    there = engine.installed if isinstance(engine, Adapter) else not contestant.requirements
    return Path(sys.executable) if there else None


def install(contestant: Contestant, folder: Path) -> Path:
    """Its environment, made anew by venv and pip.

    Raises InputError where pip fails, for what our own environment has, and in place of a folder
    that holds something else.
    """
    if not contestant.requirements:
        raise InputError(f"{contestant.name} is here already: there is nothing to install")
    home = folder / contestant.name
    if home.is_dir() and any(home.iterdir()) and not (home / "pyvenv.cfg").is_file():
        raise InputError(
            f"{home} is no environment, and would be lost: move it, or give another folder with "
            "--environments"
        )
    venv.create(home, clear=True, with_pip=True)
    python = home / "bin" / "python"
    command = [str(python), "-m", "pip", "install", "--quiet", *contestant.requirements]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        words = [line for line in done.stderr.split("\n") if line.strip()]
        raise InputError(f"{contestant.name} cannot be installed: {words[-1] if words else '?'}")
    _link(home)
    return home


def _link(home: Path) -> None:
    """Has the environment look into ours, after its own packages."""
    ours: Sequence[str] = (str(Path(robotball.__file__).parents[1]), sysconfig.get_path("purelib"))
    _link_of(home).write_text("\n".join(ours) + "\n")


def _link_of(home: Path) -> Path:
    own = sysconfig.get_path("purelib", vars={"base": str(home), "platbase": str(home)})
    return Path(own) / LINK
