"""One run of one engine: errors, quality of the contact, cost and versions.

ContactBench (arXiv 2304.06372) tests engines against three laws. `cone_violation` is the residual
of Coulomb's law, and `slip_work` is the energy lost to slip under the principle of maximum
dissipation. A rolling ball meets Signorini's condition with equality, so the normal force itself is
compared.
"""

import contextlib
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

from robotball import InputError, engine_named, engine_names, integrate, load_scene, sample_times
from robotball.engines.adapter import Adapter, not_installed
from robotball.engines.engine import DEFAULT, Request, run_request
from robotball.engines.environments import interpreter_of, make, python_named
from robotball.engines.states import shell_omega
from robotball.motion import ContactMotion, EngineSettings, Motion, ReferenceMotion, measured_time
from robotball.rotations import Array, rotation_matrix

from ..agreement import Agreement
from ..output import known
from ..sensitivity import total_defect

OLDER = "mujoco-3.17"  # the last release whose RK4 does not have order 4 with free joints
_ENOUGH = 1.0  # s of processor time; a longer run is timed once
LOOSEST = 0.3  # error tolerance of runs whose preset has no tolerance for their value
_FIXED_WORK = bytes(1 << 23)  # the time of hashing these bytes measures the machine's current speed
_UP = np.array([0.0, 0.0, 1.0])
_SLOW = 0.1  # of the largest slip; the direction of a slower slip changes as the slip ends


@dataclass(frozen=True)
class Contestant:
    """An engine in an environment.

    Attributes
    ----------
    name : str
        The name of the environment.
    engine : str
        The name of the engine.
    requirements : tuple of str
        The packages to install. Empty if robotball's environment has the engine.
    """

    name: str
    engine: str
    requirements: tuple[str, ...]


def contestants() -> dict[str, Contestant]:
    """Return all contestants by name: the engines, and an older version of MuJoCo."""
    known = {}
    for name in engine_names():
        with contextlib.suppress(InputError):  # skip an engine that cannot be loaded
            engine = engine_named(name)
            requirements = engine.requirements if isinstance(engine, Adapter) else ()
            known[name] = Contestant(name, name, requirements)
    older = Contestant(OLDER, DEFAULT, (OLDER.replace("-", "==") + ".*",))
    return {**known, OLDER: older}


def python_of(contestant: Contestant, folder: Path) -> Path | None:
    """Return the interpreter of a contestant's environment, or this one if it has the engine.

    Returns None if the engine is not installed.
    """
    if python := interpreter_of(folder / contestant.name, contestant.requirements):
        return python
    engine = engine_named(contestant.engine)
    here = contestant.name == contestant.engine  # otherwise it needs another version
    installed = here and (not isinstance(engine, Adapter) or engine.installed)
    return Path(sys.executable) if installed else None


def check_installed(contestants: Iterable[Contestant], folder: Path) -> None:
    """Raise InputError for a contestant that is not installed."""
    for contestant in contestants:
        if python_of(contestant, folder) is None:
            raise not_installed(engine_named(contestant.engine).label.name, contestant.name)


def install(contestant: Contestant, folder: Path, python: str = "") -> Path:
    """Create a contestant's environment and return its folder.

    `python` is a version or a path, by default the newest Python that the engine supports. Raises
    InputError if `make` raises it, or if the engine needs no installation.
    """
    if not contestant.requirements:
        raise InputError(f"{contestant.name} is already installed with robotball")
    interpreter = python_named(python) if python else None
    return make(folder / contestant.name, contestant.requirements, interpreter)


def run(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Run a cell and return its record: errors, readings, cost and versions."""
    scene = load_scene(cell["scene"])
    # A slipping ball may leave the plane for a time as short as a step.
    theory = integrate(
        scene, sample_times(cell["duration"], cell["value"] if scene.may_slip else None)
    )
    engine = engine_named(cell["engine"])
    preset = engine.presets[cell["preset"]]
    settings = settings_of(preset, cell["field"], cell["value"])
    request = Request(engine, settings, loads=theory.loads)
    with warnings.catch_warnings(record=True) as caught:
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
    spent = [timed.report.seconds for timed in motions]
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
        **(slip_quality(motion, theory) if theory.slip is not None else {}),
        "seconds": statistics.median(spent),
        "spread": max(spent) / min(spent) if len(spent) > 1 and min(spent) > 0 else None,
        "python_seconds": known(report.python_seconds),
        "fixed_work": speed,
        "faults": [str(fault) for fault in report.faults],
        "warnings": sorted({str(warning.message) for warning in caught}),
        "settings": settings.plain(),
        "python": platform.python_version(),
    }


def settings_of(preset: EngineSettings, field: str, value: float) -> EngineSettings:
    """Return the preset with another value of a field, and without a stop at faults."""
    changes: dict[str, Any] = {field: value, "stop_at_fault": False}
    if getattr(preset, field) != value:
        changes["error_tolerance"] = LOOSEST
    return replace(preset, **changes)


def fixed_work() -> float:
    """Measure the processor time of fixed work that depends on no package [s]."""
    began = time.process_time()
    hashlib.sha256(_FIXED_WORK).digest()
    return measured_time(time.process_time() - began)


def contact_quality(motion: ContactMotion, theory: Motion) -> dict[str, float | None]:
    """Return the residuals of a motion against the reference at the same times.

    Returns
    -------
    dict
        `normal_force_error` is the largest error of the normal force, divided by the weight.
        `cone_violation` is the largest friction beyond the cone, divided by the cone's limit.
        `slip_work` is the energy lost to slip, divided by the initial kinetic energy.
        `energy_error` is the largest relative error of the kinetic energy. Values are None without
        contact forces; the two energies are also None if the ball is not balanced.
    """
    n, ball = slice(len(motion.times)), theory.scene.ball
    off = motion.loads.normal_force - theory.loads.normal_force[n]
    # The first sample precedes the first step.
    residuals = {
        "normal_force_error": np.abs(off[1:]).max(initial=0.0) / (ball.mass * theory.scene.gravity),
        "cone_violation": (motion.report.friction_used[1:] - 1.0).max(initial=0.0),
        "slip_work": np.nan,
        "energy_error": np.nan,
    }
    if not theory.scene.not_reduced:
        energy, slip = kinetic_energy(motion, motion.report.depth)
        right, _ = kinetic_energy(theory, 0.0 * theory.times)
        power = -(motion.loads.contact_force * slip).sum(axis=1)
        if right.min() > 0:  # the energy of a ball at rest cannot be a unit
            residuals["slip_work"] = np.trapezoid(power[1:], motion.times[1:]) / right[0]
            error = energy / right[n] - 1.0
            residuals["energy_error"] = error[np.abs(error).argmax()]
    return {name: known(value) for name, value in residuals.items()}


def slip_quality(motion: ContactMotion, theory: ReferenceMotion) -> dict[str, float | None]:
    """Return how well a slipping motion obeys Coulomb's law, compared with the reference.

    Returns
    -------
    dict
        `late` is the relative error of the duration of the first slip. `askew` is the mean angle
        between the friction and the direction opposite to the slip, weighted with the friction
        [deg]. `most_force` is the largest normal force, divided by the reference's largest normal
        force. `hop` is the largest height of the ball above the plane [m]. A value is None if it is
        unknown; `late` is also None if the ball does not stick.
    """
    scene, report, force = theory.scene, motion.report, motion.loads.contact_force
    W = np.where(np.isfinite(scene.slip_limits), scene.slip_limits, 0.0)
    right, slip = np.linalg.norm(W * theory.slip, axis=1), W * slip_velocity(motion)
    (begin, end), own = theory.slipping[0], np.linalg.norm(slip, axis=1)
    peak = np.where((theory.times >= begin) & (theory.times <= end), right, 0.0).argmax()
    ends = [_end_of_slip(theory.times, speed, int(peak)) for speed in (right, own)]
    slides = np.linalg.norm(slip[:, :2], axis=1) > _SLOW * right.max()
    slides[0] = False  # precedes the first step
    along = -(slip * force)[slides, :2].sum(axis=1)
    across = slip[slides, 0] * force[slides, 1] - slip[slides, 1] * force[slides, 0]
    pull = np.linalg.norm(force[slides, :2], axis=1)
    angles = np.degrees(np.arctan2(np.abs(across), along))
    residuals = {
        "late": (ends[1] - begin) / (ends[0] - begin) - 1,
        "askew": np.sum(pull * angles) / pull.sum() if pull.any() else np.nan,
        "most_force": force[1:, 2].max(initial=0.0) / theory.loads.normal_force.max(),
        "hop": np.max(-report.depth, initial=0.0),
    }
    return {name: known(float(value)) for name, value in residuals.items()}


def slip_velocity(motion: Motion) -> Array:
    """Return the slip (n, 3) of a motion, as in `ReferenceMotion`, from its path and rotation.

    MuJoCo reports no slip of a ball that has left the plane.
    """
    velocity = np.gradient(motion.contact_point, motion.times, axis=0, edge_order=2)
    return motion.scene.slip_of(motion.times, motion.contact_point, velocity, _shell_of(motion))


def _shell_of(motion: Motion) -> Array:
    """Return the shell's angular velocity (n, 3) [rad/s], world axes."""
    omega, rates = motion.angular_velocity, motion.hinge_rates
    return shell_omega(motion.scene, motion.attitude, omega, rates)


def _end_of_slip(times: Array, speed: Array, peak: int) -> float:
    """Return the end [s] of a slip (n,): the zero of a line through 1/2 and 1/10 of its peak.

    Returns NaN if the slip does not end. MuJoCo's slip decays exponentially at the end.
    """
    below = [np.flatnonzero(speed[peak:] < part * speed[peak]) for part in (0.5, _SLOW)]
    if not len(below[1]):
        return np.nan
    k, j = (peak + int(some[0]) for some in below)
    return float(times[k] + speed[k] * (times[j] - times[k]) / ((speed[k] - speed[j]) or 1.0))


def kinetic_energy(motion: Motion, depth: Array) -> tuple[Array, Array]:
    """Return the kinetic energy (n,) [J] and the slip velocity (n, 3) [m/s] of a balanced ball.

    depth (n,) [m] is the depth of the contact. The centre's velocity v follows from M, which
    contains r×mv, so the sampled path need not be differentiated.
    """
    ball, R = motion.scene.ball, rotation_matrix(motion.attitude)
    omega, rates = motion.angular_velocity, motion.hinge_rates
    arm = (ball.radius - depth)[:, None]
    k = rates @ ball.gyrostatic_inertia.T
    L = np.cross(motion.momentum, _UP) if motion.scene.rolling == "rubber" else motion.momentum
    carried = L - np.einsum("nij,nj->ni", R, omega @ ball.inertia + k)
    v = np.cross(carried, _UP) / (ball.mass * arm)
    # The norm of a column of the gyrostatic inertia is the inertia of that hinge.
    spinning = rates**2 @ np.linalg.norm(ball.gyrostatic_inertia, axis=0)
    turning = (omega * (omega @ ball.inertia + 2 * k)).sum(axis=1)
    energy = (ball.mass * (v * v).sum(axis=1) + turning + spinning) / 2
    return energy, v - arm * np.cross(_shell_of(motion), _UP)
