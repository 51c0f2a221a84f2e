"""One run of one engine as a cell: its errors, its contact's quality, its cost and versions.

ContactBench (arXiv 2304.06372) holds engines to three laws. Of Coulomb's law `cone_violation` is
the residual, of the principle of maximum dissipation `slip_work` is what slip costs; in place of
Signorini's condition, which a rolling ball meets with equality, the force itself is compared.
"""

import hashlib
import platform
import statistics
import sys
import time
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from robotball import InputError, engine_named, engine_names, integrate, load_scene, sample_times
from robotball.engines.adapter import Adapter, not_installed
from robotball.engines.engine import DEFAULT, Request, run_request
from robotball.engines.environments import interpreter_of, make, python_named
from robotball.motion import ContactMotion, EngineSettings, Motion, measured_time
from robotball.rotations import Array, rotation_matrix

from ..agreement import Agreement
from ..output import known
from ..sensitivity import total_defect

OLDER = "mujoco-3.17"  # before RK4 was of order 4 on free joints


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
    """Return all contestants by name: the engines, and one of them in an older version."""
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
    """Return the interpreter of a contestant: its environment's, or ours where it needs none.

    None where there is neither.
    """
    if own := interpreter_of(folder / contestant.name):
        return own
    engine = engine_named(contestant.engine)
    ours = contestant.name == contestant.engine  # another has a version of its own
    there = ours and (not isinstance(engine, Adapter) or engine.installed)
    return Path(sys.executable) if there else None


def check_installed(contestants: Iterable[Contestant], folder: Path) -> None:
    """Raise InputError for a contestant that has neither an environment nor ours."""
    for each in contestants:
        if python_of(each, folder) is None:
            raise not_installed(engine_named(each.engine).label.name, each.name)


def install(contestant: Contestant, folder: Path, python: str = "") -> Path:
    """Make a contestant's environment anew, and return its folder.

    python: a version or a path; empty for the newest that the engine's newest release supports.
    Raises InputError as `make` does, and for what our own environment has.
    """
    if not contestant.requirements:
        raise InputError(f"{contestant.name} is here already: there is nothing to install")
    by = python_named(python) if python else None
    return make(folder / contestant.name, contestant.requirements, by)


_ENOUGH = 1.0  # s of processor time after which a run is not timed again
LOOSEST = 0.3  # that a run is held to at another value than the preset's own, which has no other
_FIXED_WORK = bytes(1 << 23)  # the time of its digest is the speed of the machine at that moment
_UP = np.array([0.0, 0.0, 1.0])


def run(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Run a cell and return its record: errors, other readings, cost and versions."""
    scene = load_scene(cell["scene"])
    theory = integrate(scene, sample_times(cell["duration"]))
    engine = engine_named(cell["engine"])
    preset = engine.presets[cell["preset"]]
    settings = settings_of(preset, cell["field"], cell["value"])
    request = Request(engine, settings, loads=theory.loads)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        before = fixed_work()
        motions = [run_request(scene, theory.times, request)]
        while len(motions) < cell["rounds"] and motions[0].report.seconds < _ENOUGH:
            motions.append(run_request(scene, theory.times, request))
        speed = (before + fixed_work()) / 2
        defect = None
        if cell["stretches"]:
            defect = total_defect(engine.prepare(scene, settings), theory)
    motion, report = motions[0], motions[0].report
    agreement = Agreement(theory, motion)
    spent = [each.report.seconds for each in motions]
    return {
        "label": engine.label.name,
        "colour": engine.label.colour,
        "marker": engine.label.marker,
        "version": engine.label.version,
        "path_error": known(agreement.path_error),
        "momentum_error": known(agreement.momentum_error),
        "defect": known(defect),
        "reached": agreement.end,
        "slip": known(report.slip.max()),
        "spin": known(abs(report.spin).max()),
        "hinge_rate_error": known(report.hinge_rate_error.max()),
        "steps": report.steps,
        "longest_step": report.timestep,
        **contact_quality(motion, theory),
        "seconds": statistics.median(spent),
        "spread": max(spent) / min(spent) if len(spent) > 1 and min(spent) > 0 else None,
        "python_seconds": known(report.python_seconds),
        "fixed_work": speed,
        "faults": [str(fault) for fault in report.faults],
        "warnings": sorted({str(each.message) for each in said}),
        "settings": settings.plain(),
        "python": platform.python_version(),
    }


def settings_of(preset: EngineSettings, field: str, value: float) -> EngineSettings:
    """Return the preset with another value of a field, for a run that goes on after a fault."""
    changes: dict[str, Any] = {field: value, "stop_at_fault": False}
    if getattr(preset, field) != value:
        changes["error_tolerance"] = LOOSEST
    return replace(preset, **changes)


def fixed_work() -> float:
    """Measure the processor time of a piece of work in which no package takes part [s]."""
    began = time.process_time()
    hashlib.sha256(_FIXED_WORK).digest()
    return measured_time(time.process_time() - began)


def contact_quality(motion: ContactMotion, theory: Motion) -> dict[str, float | None]:
    """Return the residuals of a motion against the equations' at the same times, or their first.

    normal_force_error  the largest error of the normal force, over the weight
    cone_violation      how far friction is beyond its cone at most, over the cone
    slip_work           what friction takes by slip, over the kinetic energy at the start
    energy_error        the kinetic energy gained, or lost, over the reference's: the largest part

    None where it is not known: forces of engines that give none, energies of balls that are not
    balanced.
    """
    n, ball = slice(len(motion.times)), theory.scene.ball
    off = motion.loads.normal_force - theory.loads.normal_force[n]
    # The first sample is of the start, before any step.
    found = {
        "normal_force_error": np.abs(off[1:]).max(initial=0.0) / (ball.mass * theory.scene.gravity),
        "cone_violation": (motion.report.friction_used[1:] - 1.0).max(initial=0.0),
        "slip_work": np.nan,
        "energy_error": np.nan,
    }
    if not theory.scene.not_reduced:
        energy, slip = kinetic_energy(motion, motion.report.depth)
        right, _ = kinetic_energy(theory, 0.0 * theory.times)
        power = -(motion.loads.contact_force * slip).sum(axis=1)
        if right.min() > 0:  # a ball at rest has no energy that an error could be relative to
            found["slip_work"] = trapezoid(power[1:], motion.times[1:]) / right[0]
            error = energy / right[n] - 1.0
            found["energy_error"] = error[np.abs(error).argmax()]
    return {name: known(value) for name, value in found.items()}


def kinetic_energy(motion: Motion, depth: Array) -> tuple[Array, Array]:
    """Return the kinetic energy (n,) [J] of a balanced ball and its velocity of slip (n, 3) [m/s].

    depth: (n,) m, of the plane in the shell. The centre's velocity v is that of M, which has r×mv
    in it: so it is known though the contact point's path is only sampled.
    """
    ball, R = motion.scene.ball, rotation_matrix(motion.attitude)
    omega, rates = motion.angular_velocity, motion.hinge_rates
    arm = (ball.radius - depth)[:, None]
    k = rates @ ball.gyrostatic_inertia.T
    L = np.cross(motion.momentum, _UP) if motion.scene.rolling == "rubber" else motion.momentum
    carried = L - np.einsum("nij,nj->ni", R, omega @ ball.inertia + k)
    v = np.cross(carried, _UP) / (ball.mass * arm)
    shell = np.einsum("nij,nj->ni", R, omega - rates[:, :1] * ball.shell.axis)
    # A hinge's column of gyrostatic inertia is along its axis, and as long as its inertia.
    own = rates**2 @ np.linalg.norm(ball.gyrostatic_inertia, axis=0)
    turning = (omega * (omega @ ball.inertia + 2 * k)).sum(axis=1)
    energy = (ball.mass * (v * v).sum(axis=1) + turning + own) / 2
    return energy, v - arm * np.cross(shell, _UP)
