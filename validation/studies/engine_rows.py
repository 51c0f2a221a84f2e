"""The table of the engine study: of each engine what is run, and what of its runs is ours."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robotball import Engine, engine_named
from robotball.engines.mujoco.settings import OWN

Ladder = tuple[str, tuple[float, ...]]
"""A field of an engine's settings and the values that it takes in turn."""
Knobs = tuple[str, Mapping[str, tuple[Any, ...] | slice]]
"""A preset, and the values of its fields that a search may take: some, or all of a slice's span."""


@dataclass(frozen=True)
class EngineRow:
    """What the study runs of an engine.

    ladders   by preset, the values of a field at which its error is held against its cost
    knobs     what a search for its best settings may change; None: there is nothing to search
    ours      by preset, the parts of its runs that are robotball's and not the engine's
    source    the page or example of its own documentation that its preset as it comes follows
    """

    ladders: Mapping[str, Ladder]
    knobs: Knobs | None = None
    ours: Mapping[str, str] = field(default_factory=dict)
    source: str = ""


def row_of(name: str) -> EngineRow:
    """Return the row of an engine. One without a row runs each of its presets as it is."""
    return _ROWS.get(name) or EngineRow(_as_they_are(engine_named(name)))


def _as_they_are(engine: Engine) -> dict[str, Ladder]:
    """Return of each preset one value: of its timestep or its rtol, else of what all have."""
    found: dict[str, Ladder] = {}
    for name, preset in engine.presets.items():
        has = [key for key in ("timestep", "rtol") if isinstance(getattr(preset, key, None), float)]
        key = (*has, "error_tolerance")[0]
        found[name] = (key, (getattr(preset, key),))
    return found


_SPIN, _IDEAL = "torque against spin", "constraints, steps"
_GYROSTAT = "gyrostat's torque"
_IMPEDANCE = (0.9, 0.99, 0.999, 0.9999)
_BY_RTOL: Ladder = ("rtol", (1e-6, 1e-9, 1e-12))
_TO_ROUNDING: Ladder = ("rtol", (1e-6, 1e-9, 1e-12, 1e-15))
_OF_MODEL: dict[str, Any] = {
    "model.softness": slice(1e-4, 10.0), "model.sliding_friction": slice(2.0, 100.0),
    "model.integrator": ("RK4", "Euler", "implicitfast"),
}  # fmt: skip


def _steps(*values: float) -> Ladder:
    return "timestep", values


_ROWS = {
    "mujoco": EngineRow(
        {"naive": _steps(2e-3), "balanced": _steps(20e-3, 10e-3, 5e-3, 1e-3),
         "adaptive": _TO_ROUNDING},
        ("balanced", {
            "timestep": slice(1e-3, 2e-2), "integrator": OWN, "solver": ("PGS", "CG", "Newton"),
            "iterations": (3, 10, 50), "noslip_iterations": (0, 1, 5),
            "softness": slice(1e-3, 100.0), "cone": ("elliptic", "pyramidal"),
            "sliding_friction": slice(2.0, 100.0),
        }),
        {"adaptive": "steps"},
    ),
    "multibody": EngineRow({"best": _TO_ROUNDING}, ours={"best": "all"}),
    "bullet": EngineRow(
        {"as-it-comes": _steps(1 / 240), "best": _steps(1 / 250, 1e-3, 1e-4)},
        ("best", {
            "timestep": slice(1e-4, 4e-3), "lateral_friction": slice(1.0, 100.0),
            "damping": (0.0, None), "spinning_friction": slice(0.1, 100.0),
            "motor_force": slice(1e3, 1e10),
        }),
        source="examples/pybullet/examples/robotcontrol.py",
    ),
    "dart": EngineRow(
        {"as-it-comes": _steps(1e-3), "best": _steps(4e-3, 1e-3, 1e-4), "ideal": _BY_RTOL},
        ("best", {
            "timestep": slice(1e-4, 4e-3), "friction": slice(1.0, 1e3),
            "spin_part": slice(0.1, 2.0),
        }),
        {"best": _SPIN, "ideal": _IDEAL},
        "python/tutorials/04_biped, lesson 6: velocity actuators",
    ),
    "drake": EngineRow(
        {"as-it-comes": _steps(1e-3), "tamsi": _steps(4e-3, 1e-3, 1e-4), "best": _steps(1e-3),
         "ideal": _BY_RTOL},
        ("best", {
            "timestep": slice(1e-4, 5e-3), "approximation": ("tamsi", "sap", "lagged", "similar"),
            "integrator": (None, "runge_kutta3", "radau3", "implicit_euler"),
            "friction": slice(2.0, 100.0), "accuracy_per_step": slice(1e-10, 1e-4),
            "error_control": (False, True), "stiction": slice(1e-4, 1e-2),
            "spin_part": slice(0.1, 1e4), "armature": slice(1e2, 1e12),
        }),
        {"tamsi": _SPIN, "best": _SPIN, "ideal": _IDEAL},
        "examples/multibody/strandbeest/run_with_motor.cc: a gain as large as the mass",
    ),
    "exudyn": EngineRow(
        {"as-it-comes": _steps(2e-4), "best": _steps(20e-3, 5e-3, 1e-3),
         "contact": _steps(5e-3, 1e-3)},
        ("best", {
            "timestep": slice(1e-3, 2e-2), "solver": ("TrapezoidalIndex2", "GeneralizedAlpha"),
            "tolerance": slice(1e-12, 1e-5), "modified": (False, True),
            "load_jacobian": (False, True), "friction": (None, 2.0, 20.0),
            "slip_zone": slice(1e-6, 1e-3),
        }),
        dict.fromkeys(("as-it-comes", "contact"), f"hinge and spin, {_GYROSTAT}")
        | {"best": f"constraints, {_GYROSTAT}"},
        "TestModels/sphereTriangleTest.py",
    ),
    "genesis": EngineRow(
        {"as-it-comes": _steps(1e-2), "best": _steps(4e-3, 1e-3, 2.5e-4)},
        ("best", {
            "timestep": slice(1e-4, 1e-2), "friction": slice(1.5, 5.0),
            "torsional": slice(0.1, 5.0), "integrator": ("Euler", "implicitfast"),
            "damping": slice(1e2, 1e9), "iterations": (20, 50, 200), "armature": slice(1.0, 1e9),
            "impedance": _IMPEDANCE, "impratio": slice(1.0, 1e5),
        }),
        source="Control Your Robot, of its user guide",
    ),
    "mjx": EngineRow(
        {"as-it-comes": _steps(2e-3), "best": _steps(20e-3, 10e-3, 5e-3)},
        ("best", {"timestep": slice(1e-3, 2e-2), "line_search": (3, 5, 20), **_OF_MODEL}),
    ),
    "mujoco-warp": EngineRow(
        {"best": _steps(20e-3, 10e-3)}, ("best", {"timestep": slice(2e-3, 2e-2), **_OF_MODEL})
    ),
    "newton": EngineRow(
        {"as-it-comes": _steps(1e-3), "best": _steps(20e-3, 5e-3, 1e-3),
         "kept": _steps(20e-3, 5e-3)},
        ("best", {
            "timestep": slice(1e-3, 2e-2), "integrator": ("rk4", "euler", "implicitfast"),
            "cone": ("elliptic", "pyramidal"), "iterations": (5, 10, 50),
            "friction": slice(2.0, 100.0), "armature": slice(1e2, 1e14),
            "impedance": _IMPEDANCE, "noslip": (0, 1, 5),
        }),
        source="newton/examples/basic/example_basic_urdf.py",
    ),
    "physx": EngineRow(
        {"as-it-comes": _steps(5e-4), "best": _steps(4e-3, 1e-3, 2.5e-4)},
        ("best", {
            "timestep": slice(1e-4, 1e-2), "friction": slice(2.0, 100.0),
            "damping": slice(1e2, 1e9), "armature": slice(1.0, 1e6), "patch": slice(0.1, 100.0),
            "iterations": (4, 20, 50, 200),
        }),
        source="docs/source/tutorial/robotics/pid.rst: the internal drive",
    ),
    "pinocchio": EngineRow(
        {"RK4": _steps(20e-3, 10e-3, 5e-3), "best": ("rtol", (1e-6, 1e-9, 1e-12, 1e-14)),
         "as-it-comes": _steps(1e-3), "contact": _steps(4e-3, 1e-3)},
        ("contact", {
            "timestep": slice(1e-4, 4e-3), "solver": ("ADMM", "PGS"),
            "friction": slice(1.0, 100.0), "spin_part": slice(0.1, 2.0),
        }),
        {"RK4": _IDEAL, "best": _IDEAL, "contact": _SPIN},
        "examples/admm-constraint-solver.py",
    ),
}  # fmt: skip
