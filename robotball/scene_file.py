"""Scenes as TOML: the catalog in scenes/, and files of the user's own."""

import difflib
import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from robotball import start as starts
from robotball.bodies import Ball, Frame, Rotor, Shell, thin_shell_inertia
from robotball.errors import InputError
from robotball.parameters import Parameters, Rolling, as_vector, parameters_of
from robotball.rotations import Array, rotation_matrix
from robotball.scene import GRAVITY, Scene
from robotball.start import Start

CATALOG = Path(__file__).parent / "scenes"
LARGEST = 1e50  # in SI units, beyond any ball; products of a few such numbers do not overflow

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


class _Table(msgspec.Struct, forbid_unknown_fields=True):
    """A TOML table in which every key must be known."""


class _Axial(_Table):
    axial: float
    transverse: float


class _Shell(_Table):
    radius: float
    mass: float
    inertia: Literal["thin"] | _Axial
    axis: Triple = (0.0, 0.0, 1.0)


class _Frame(_Table):
    mass: float
    inertia: tuple[Triple, Triple, Triple]
    rate: float = 0.0


class _Rotor(_Table):
    mass: float
    inertia: _Axial
    axis: Triple
    rate: float = 0.0


class _Section(_Table):
    L: float
    l: float
    g: float
    f: float
    c: float = 0.0


class _Start(_Table):
    section: _Section | None = None
    attitude: Quadruple | None = None
    gamma: Triple | None = None
    alpha: Triple | None = None
    momentum: Triple | None = None
    momentum_world: Triple | None = None
    angular_velocity: Triple | None = None
    rest: bool = False


class _Scene(_Table):
    title: str
    rolling: Rolling
    duration: float
    shell: _Shell
    frame: _Frame
    start: _Start
    source: str = ""
    rotor: list[_Rotor] = []
    gravity: float = GRAVITY


def catalog() -> list[str]:
    """The names of the scenes that come with robotball."""
    return sorted(path.stem for path in CATALOG.glob("*.toml"))


def load_scene(name: str | Path) -> Scene:
    """The scene of a catalog name, or of a path to a TOML file.

    Raises InputError, with the file and the key, where there is none or it cannot be used.
    """
    path = CATALOG / f"{name}.toml"
    if str(name) not in catalog():
        path = Path(name)
        if path.suffix != ".toml":
            near = difflib.get_close_matches(str(name), catalog(), n=3, cutoff=0.4)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {catalog()}"
            raise InputError(f"no scene is called {str(name)!r}; {hint}")
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:  # a null byte in the name
        raise InputError(f"{path}: {error}") from None
    try:
        table = msgspec.toml.decode(text, type=_Scene)
        _check_numbers("", msgspec.to_builtins(table))
        return _scene(path.stem, table)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {_explained(str(error))}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    # ValueError: bytes that are no text, an integer of thousands of digits; RecursionError: as
    # many brackets.
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not TOML: {error}") from None


def _check_numbers(key: str, value: object) -> None:
    """Raises InputError, with the key, for a number of a TOML value that is NaN or too large."""
    if isinstance(value, float) and not abs(value) <= LARGEST:
        raise InputError(f"{key} must be finite and at most {LARGEST:g} in size, not {value:g}")
    if isinstance(value, dict):
        for name, inner in value.items():
            _check_numbers(f"{key}.{name}" if key else name, inner)
    if isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            _check_numbers(f"{key}[{i}]", inner)


def _explained(message: str) -> str:
    """Msgspec's message, with the key's path first and a near match for a misspelt key."""
    where = re.search(r" - at `\$\.?(.*)`$", message)
    key, what = (where[1], message[: where.start()]) if where else ("", message)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        table = re.sub(r"\[.*?\]", "", key)
        near = difflib.get_close_matches(unknown[1], _known_keys(table), n=1)
        what = f"unknown key {unknown[1]!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    missing = re.search(r"missing required field `(.*)`", what)
    if missing:
        what = f"key {missing[1]!r} is missing"
    return f"{key}: {what}" if key else what


def _known_keys(table: str) -> list[str]:
    tables: dict[str, type[_Table]] = {
        "": _Scene,
        "shell": _Shell,
        "frame": _Frame,
        "rotor": _Rotor,
        "start": _Start,
        "start.section": _Section,
    }
    return list(tables.get(table, _Axial).__struct_fields__)


def _scene(name: str, table: _Scene) -> Scene:
    ball = Ball(
        shell=_shell(table.shell),
        frame=Frame(mass=table.frame.mass, inertia=np.array(table.frame.inertia)),
        rotors=tuple(_rotor(i, rotor) for i, rotor in enumerate(table.rotor, start=1)),
    )
    rates = (table.frame.rate, tuple(rotor.rate for rotor in table.rotor))
    return Scene(
        name=name,
        title=table.title,
        source=table.source,
        ball=ball,
        rolling=table.rolling,
        frame_rate=rates[0],
        rotor_rates=rates[1],
        start=_start(table.start, ball, parameters_of(ball, table.rolling, *rates)),
        duration=table.duration,
        gravity=table.gravity,
    )


def _shell(table: _Shell) -> Shell:
    if isinstance(table.inertia, _Axial):
        axial, transverse = table.inertia.axial, table.inertia.transverse
    else:
        axial = transverse = thin_shell_inertia(table.radius, table.mass)
    return Shell(
        radius=table.radius,
        mass=table.mass,
        axial_inertia=axial,
        transverse_inertia=transverse,
        axis=_direction("shell.axis", table.axis),
    )


def _rotor(number: int, table: _Rotor) -> Rotor:
    return Rotor(
        mass=table.mass,
        axial_inertia=table.inertia.axial,
        transverse_inertia=table.inertia.transverse,
        axis=_direction(f"rotor {number}'s axis", table.axis),
    )


def _direction(name: str, v: Triple) -> Array:
    length = float(np.linalg.norm(v))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name} must have a length and a direction, unlike {list(v)}")
    return np.array(v) / length


START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest"
)


def _start(table: _Start, ball: Ball, parameters: Parameters) -> Start:
    """The one start that the table gives; a section's is in principal axes."""
    given = {key for key in table.__struct_fields__ if getattr(table, key)}
    axes = ball.principal[1]
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        start = starts.along_momentum(axes @ gamma, axes @ M)
    elif given == {"gamma", "momentum"}:
        gamma = starts.unit("gamma", np.array(table.gamma))
        start = starts.along_momentum(gamma, np.array(table.momentum))
    elif (
        given - MOMENTUM_KEYS in ({"attitude"}, {"gamma", "alpha"})
        and len(given & MOMENTUM_KEYS) == 1
    ):
        attitude = _attitude(table)
        start = Start(attitude, _momentum(table, rotation_matrix(attitude), axes, parameters))
    else:
        keys = ", ".join(sorted(given)) or "nothing"
        raise InputError(f"start gives {keys}; it takes one form: {START_FORMS}")
    if parameters.rolling == "rubber":
        return replace(start, momentum=starts.horizontal(start.momentum))
    return start


MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def _attitude(table: _Start) -> Array:
    if table.attitude:
        return starts.unit("attitude", np.array(table.attitude))
    gamma, alpha = np.array(table.gamma), np.array(table.alpha)
    return starts.attitude_of_axes(starts.unit("gamma", gamma), starts.unit("alpha", alpha))


def _momentum(table: _Start, to_world: Array, axes: Array, parameters: Parameters) -> Array:
    """M (3,) in world axes of a table with one of MOMENTUM_KEYS."""
    if table.momentum:
        return to_world @ np.array(table.momentum)
    if table.momentum_world:
        return np.array(table.momentum_world)
    if table.rest:
        return np.zeros(3)
    omega, gamma = axes.T @ np.array(table.angular_velocity), axes.T @ to_world[2]
    if parameters.rolling == "rubber":
        starts.check_no_spin(omega - parameters.Omega, gamma)
    return to_world @ axes @ parameters.momentum(as_vector(omega), as_vector(gamma))
