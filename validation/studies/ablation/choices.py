"""What the recipe does otherwise than a newcomer, choice by choice."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from robotball import InputError, Settings, preset
from robotball.engines.mujoco.settings import NAIVE


@dataclass(frozen=True)
class Choice:
    """One modelling choice: the fields of Settings that make it, and what it is in words."""

    name: str
    fields: tuple[str, ...]
    words: str


# Those without which nothing rolls come first, so that the smaller errors behind them are seen.
CHOICES = (
    # The solver's tolerances are relative to inertia; beside a huge one it would stop at once.
    Choice("drive", ("drive", "tolerance", "ls_tolerance"), "huge inertias, not servos"),
    Choice("friction", ("sliding_friction", "torsional_friction"), "more than the motion needs"),
    Choice("cone", ("cone",), "elliptic, not a pyramid"),
    Choice("root", ("root",), "the shell has the free joint, not the frame"),
    Choice("integrator", ("integrator",), "RK4, not Euler"),
    Choice("start", ("start_in_equilibrium",), "at the depth that carries the weight"),
    Choice("softness", ("solref", "solimp", "solreffriction"), "a stiff contact"),
    Choice("noslip", ("noslip_iterations", "noslip_tolerance"), "slip is solved for"),
    Choice(
        "solver",
        ("solver", "jacobian", "iterations", "warmstart", "island"),
        "PGS and few iterations",
    ),
    Choice("timestep", ("timestep",), "shorter than MuJoCo's own"),
)
# A newcomer hangs the shell on the body that it is built around. At both ends a faulty run goes
# on, so that there is an error to tell, and slip is a fault from the same size on.
BOTTOM = replace(NAIVE, root="frame", stop_at_fault=False)
TOP = replace(preset("accurate"), promise=NAIVE.promise, stop_at_fault=False)


def adopt(settings: Settings, choice: Choice, of: Settings = TOP) -> Settings:
    """`settings`, but with the choice as it is made in `of`."""
    return replace(settings, **{name: getattr(of, name) for name in choice.fields})


def undo(settings: Settings, choice: Choice) -> Settings:
    """`settings`, but with the choice as a newcomer makes it."""
    return adopt(settings, choice, BOTTOM)


def without(settings: Settings, names: Iterable[str]) -> Settings:
    """`settings` with the choices of the names undone, and named so.

    Raises InputError for a name that no choice has.
    """
    known = {choice.name: choice for choice in CHOICES}
    for name in names:
        if name not in known:
            raise InputError(f"no choice is called {name!r}; there are {', '.join(known)}")
        settings = replace(undo(settings, known[name]), name=f"{settings.name} - {name}")
    return settings
