"""Definitions of the failure maps: two axes each, and how their values change a run.

A cell runs a catalog ball with one or two quantities changed over many decades and the others
fixed. `extremes.py` evaluates the cells.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from robotball import Scene, Servo, Settings, load_scene
from robotball.engines.mujoco.settings import CONSTANT, INTEGRATORS, MOST_STEPS, ORDER_8, recipe
from robotball.robot.variations import gyrostat, momentum_of, redistributed, scaled

from ..sweeps import Cell

_SCENES = {"rubber": "fig12", "classical": "classical_regular"}
TIMESTEP = 2e-3  # s, MuJoCo's default, for maps that do not vary the timestep
ERROR_TOLERANCE = 1e-2  # relative error tolerance of a cell
_MOST_STEPS = 30_000  # per cell, some seconds; fast rotations and servos shorten steps of order 8
_COUNT = 8  # default number of values on an axis
_QUICK_INTEGRATORS = ("Euler", "RK4", ORDER_8)
_QUICK_COUNT = 3  # values on an axis of the quick form
_QUICK_DURATION = 10.0  # s, longest duration of the quick form


@dataclass(frozen=True)
class _Axis:
    """Label and values of an axis. The label contains the unit."""

    label: str
    values: tuple[float, ...]


def _decades(low: float, high: float, count: int = _COUNT) -> tuple[float, ...]:
    """Return logarithmically spaced values, rounded to three digits."""
    return tuple(float(f"{v:.3g}") for v in np.geomspace(low, high, count))


_TIMESTEPS = _Axis("timestep [s]", _decades(2e-4, 0.2))
_LONG_TIMESTEPS = _Axis("timestep [s]", (0.02, 0.05, 0.1, 0.2))


@dataclass(frozen=True)
class Map:
    """A failure map.

    Attributes
    ----------
    name : str
        The name.
    held : str
        The quantities that stay fixed.
    x, y : _Axis
        The axes.
    ball : callable
        Returns the scene at (x, y), given the base scene.
    options : callable
        Returns MuJoCo's options at (x, y), without the integrator and its steps.
    ample : bool
        Whether friction is raised to three times the motion's demand.
    lasting : bool
        Whether y is the duration [s]. If False, a cell lasts for a few turns of the ball.
    rollings : tuple of str
        The rolling models.
    limit : float, s
        The time limit of a cell.
    """

    name: str
    held: str
    x: _Axis
    y: _Axis
    ball: Callable[[Scene, float, float], Scene] = lambda scene, x, y: scene
    options: Callable[[Scene, float, float], dict[str, Any]] = lambda scene, x, y: {}
    ample: bool = True
    lasting: bool = False
    rollings: tuple[str, ...] = tuple(_SCENES)
    limit: float = 60.0


def cell_run(
    chosen: Map, rolling: str, integrator: str, x: float, y: float
) -> tuple[Scene, Settings]:
    """Return the scene and settings of a cell. Raises InputError if the ball is impossible."""
    scene = base(rolling)
    varied = chosen.x in (_TIMESTEPS, _LONG_TIMESTEPS)
    settings = _settings(integrator, x if varied else TIMESTEP)
    return chosen.ball(scene, x, y), replace(settings, **chosen.options(scene, x, y))


@cache
def base(rolling: str) -> Scene:
    """Return the base scene of a rolling model."""
    return load_scene(_SCENES[rolling])


def _settings(integrator: str, timestep: float) -> Settings:
    """Return the recipe for an integrator and a timestep [s]."""
    chosen = recipe(integrator, ERROR_TOLERANCE, integrator=integrator, timestep=timestep)
    constant, ratio = CONSTANT["solref"]
    # MuJoCo (refsafe) would silently raise the time constant to two steps.
    solref = max(constant, 2 * timestep), ratio
    # The outcome is known only if the run continues after a fault.
    return replace(chosen, solref=solref, max_steps=_MOST_STEPS, stop_at_fault=False)


def _with_momentum(scene: Scene, size: float) -> Scene:
    K = momentum_of(scene)
    # Keep A: vary only the momentum K, not the inertia.
    return gyrostat(scene, K=K / np.linalg.norm(K) * size)


MAPS: dict[str, Map] = {
    chosen.name: chosen
    for chosen in (
        Map(
            "momentum",
            "A, Ω, M and the direction of K; the rotor's rate and axis give K",
            _TIMESTEPS,
            _Axis("|K| [kg m²/s]", _decades(0.1, 1e4, 9)),
            lambda scene, _, size: _with_momentum(scene, size),
        ),
        Map(
            "frame",
            "A, K and M; the rotor's rate and axis make up for the frame's",
            _TIMESTEPS,
            _Axis("|Ω| [rad/s]", _decades(0.01, 1e4, 9)),
            lambda scene, _, rate: gyrostat(scene, frame_rate=rate),
        ),
        Map(
            "rotor",
            "A, Ω, K and M: the faster the rotor, the smaller its inertia",
            _TIMESTEPS,
            _Axis("rotor's speed [rad/s]", _decades(10, 1e11, 9)),
            lambda scene, _, rate: gyrostat(scene, rotor_rate=rate),
        ),
        Map(
            "masses",
            "total mass, shapes of the bodies, their rates, M",
            _Axis("frame's mass / shell's", _decades(1e-6, 1e6, 9)),
            _Axis("rotor's mass / frame's", _decades(1e-6, 1e6, 9)),
            lambda scene, x, y: redistributed(scene, frame_to_shell=x, rotor_to_frame=y),
        ),
        Map(
            "scale",
            "rates and times: M goes with mass·length², gravity with length",
            _Axis("masses × ", _decades(1e-9, 1e9, 9)),
            _Axis("lengths × ", _decades(1e-9, 1e9, 9)),
            lambda scene, mass, length: scaled(scene, mass=mass, length=length),
        ),
        Map(
            "friction",
            "the ball and its start; torsional friction 1e6 m",
            _Axis("coefficient of sliding friction", _decades(1e-3, 1e6, 10)),
            _Axis("gravity [m/s²]", _decades(1e-3, 1e3, 7)),
            lambda scene, _, gravity: replace(scene, gravity=gravity),
            # Enough torsional friction that spin is never the cause.
            lambda _, sliding, __: {"sliding_friction": sliding, "torsional_friction": 1e6},
            ample=False,
        ),
        Map(
            "torsion",
            "the ball, its start and gravity, 9.81 m/s²",
            _Axis("coefficient of sliding friction", _decades(1e-3, 1e6, 10)),
            _Axis("coefficient of torsional friction [m]", _decades(1e-3, 1e6, 10)),
            options=lambda _, sliding, torsional: {
                "sliding_friction": sliding, "torsional_friction": torsional,
            },
            ample=False,
            rollings=("rubber",),
        ),
        Map(
            "gravity",
            "the ball and its start; the margin carries the weight, at whatever depth",
            _Axis("gravity [m/s²]", _decades(1e-9, 1e6, 11)),
            _Axis("solref's time constant [s]", _decades(0.01, 10, 9)),
            lambda scene, gravity, _: replace(scene, gravity=gravity),
            lambda _, __, constant: {"solref": (constant, 1.0)},
        ),
        Map(
            "contact",
            "the ball and its start; damping ratio 1, in solref's direct form",
            _Axis("time constant of the contact [s]", _decades(1e-5, 10, 9)),
            _Axis("solreffriction's damping b [1/s]", _decades(1e-3, 1e6, 10)),
            # With this direct form of solref MuJoCo does not soften the contact to fit the
            # timestep.
            options=lambda _, constant, rate: {
                "solref": (-1 / constant**2, -2 / constant), "solreffriction": (-1.0, -rate),
            },
        ),
        Map(
            "servo",
            "the ball and its start; the same gain kv on both hinges, j of the rotor",
            _TIMESTEPS,
            _Axis("kv/j [1/s]", _decades(0.1, 1e7, 9)),
            options=lambda scene, _, rate: {
                "drive": Servo(gain=rate * scene.ball.rotors[0].axial_inertia)
            },
        ),
        Map(
            "duration",
            "the ball and its start; a limit cycle or a regular motion, so not chaos",
            _LONG_TIMESTEPS,
            _Axis("duration [s]", _decades(0.1, 1e5, 7)),
            options=lambda *_: {"max_steps": MOST_STEPS},
            lasting=True,
            limit=1800.0,
        ),
    )
}  # fmt: skip


@dataclass(frozen=True)
class Cut:
    """The part of the maps to run: integrators, and the number of values on an axis."""

    integrators: tuple[str, ...] = tuple(INTEGRATORS)
    count: int | None = None

    def values(self, axis: _Axis) -> tuple[float, ...]:
        """Return the selected values of an axis, including both ends."""
        values = axis.values
        if self.count is None or self.count >= len(values):
            return values
        if "duration" in axis.label:
            # A simulated day would dominate the time of the quick form.
            values = tuple(v for v in values if v <= _QUICK_DURATION)
        kept = np.linspace(0, len(values) - 1, self.count).round().astype(int)
        return tuple(values[i] for i in np.unique(kept))


WHOLE, QUICK = Cut(), Cut(_QUICK_INTEGRATORS, _QUICK_COUNT)


def cells_of(chosen: Map, cut: Cut = WHOLE) -> list[Cell]:
    """Return the cells of a map, ordered by rolling model and integrator."""
    return [
        {"map": chosen.name, "rolling": rolling, "integrator": integrator, "x": x, "y": y}
        for rolling in chosen.rollings
        for integrator in cut.integrators
        for y in cut.values(chosen.y)
        for x in cut.values(chosen.x)
    ]
