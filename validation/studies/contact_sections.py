"""Poincaré sections of the equations and of the contact model, and starts for long motions.

M² and (M, γ) are constant, so all starts lie on the level of the scene's start.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape

from robotball import InputError, Motion, Scene, load_scene, sample_times
from robotball import preset as settings_of
from robotball.dynamics.sections import (
    Crossings,
    crossings_of_motion,
    period_of,
    section_starts,
    sections_of,
    strobed,
)
from robotball.dynamics.straight_motions import straight_motions
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.errors import check_count, check_seed
from robotball.robot.scene import Start
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.theory.reduced import LABEL as EQUATIONS

from ..output import panels, progress_bar
from ..study import Study


def sound_run(model: Model, start: Start, times: Array) -> Motion:
    """Return the motion over times (n,) [s]. Raises InputError if the run has a fault."""
    motion = run(model, times, scene=replace(model.scene, start=start))
    if motion.report.faults:
        raise InputError(f"{LABEL.name}: the run is faulty: {motion.report.faults[0]}")
    return motion


def each_step(model: Model, duration: float) -> Array:
    """Return the times (n,) of the steps of a model [s]."""
    return sample_times(duration, model.compiled.opt.timestep)


def level_starts(scene: Scene, count: int, seed: int, g: float = 0.0) -> tuple[Array, Array]:
    """Return starts on the scene's level of M² and (M, γ), as arguments for `sections`.

    Parameters
    ----------
    scene : Scene
        The scene.
    count : int
        The number of starts. 1 gives the start of the scene, more give random starts with g = `g`.
    seed : int
        The seed of the random starts.
    g : float, rad
        The value of g on the section.

    Returns
    -------
    attitudes : (n, 4)
        Attitudes of the principal axes.
    momenta : (n, 3), kg m²/s, world
        The momenta.
    """
    check_count("starts", count, 1)
    check_seed(seed)
    M = scene.start.momentum
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    if count == 1:
        return attitude[None], M[None]
    if not M.any():
        raise InputError(
            f"{scene.name} starts from rest, so random starts with the same M² do not move: "
            "give the scene a momentum, or use --starts 1"
        )
    # A rubber ball's M is horizontal (3.1).
    c = float(M[2]) if scene.rolling == "classical" else 0.0
    return random_starts(float(M @ M), count, seed, g, c)


def random_starts(
    f: float, count: int, seed: int, g: float = 0.0, c: float = 0.0
) -> tuple[Array, Array]:
    """Return random starts, uniform over the annulus of the section g = `g`."""
    random = np.random.default_rng(seed)
    L = random.uniform(-1.0, 1.0, count) * np.sqrt(f)
    return section_starts(L, random.uniform(-np.pi, np.pi, count), f, g, c)


def steady_scene(name: str, purpose: str) -> Scene:
    """Load a scene with constant rates. Raises InputError for other scenes."""
    scene = load_scene(name)
    if not scene.steady:
        raise InputError(
            f"{scene.name}: {purpose} needs constant rates, but the drives change in time; "
            f"'robotball compare {name}' shows the motion"
        )
    return scene


def moving_scene(name: str, purpose: str) -> Scene:
    """Load a steady scene with a momentum. Raises InputError if M = 0 at the start."""
    scene = steady_scene(name, purpose)
    if not np.any(scene.start.momentum):
        raise InputError(
            f"{scene.name} starts from rest, but {purpose} needs a nonzero momentum M; "
            f"'robotball dynamics equilibria {name}' shows the motion from rest"
        )
    return scene


def attracted_scene(name: str, purpose: str) -> Scene:
    """Load a moving scene with attractors.

    Raises InputError if Ω = 0, because then phase volume is constant.
    """
    scene = moving_scene(name, purpose)
    if not np.any(scene.parameters.Omega):
        raise InputError(
            f"{scene.name}: the frame does not turn (Ω = 0), so phase volume is constant and "
            f"there is no attractor; 'robotball dynamics section {name}' shows the motion"
        )
    return scene


def _may_come_to_rest(scene: Scene) -> bool:
    """Return whether motions may end on an attracting straight-line motion."""
    ball, f = scene.parameters, float(scene.start.momentum @ scene.start.momentum)
    if ball.rolling != "rubber" or not np.any(ball.Omega):
        return False
    return any(line.is_stable for line in straight_motions(ball, f))


def _at_phase(period: float, attitudes: Array, momenta: Array, skip: int) -> Crossings:
    """Return the points of all motions at the ends of periods [s], after the first `skip`."""
    attitudes, momenta = attitudes[:, skip:], momenta[:, skip:]
    axes = rotation_matrix(attitudes).reshape(-1, 3, 3)
    M = np.einsum("nij,ni->nj", axes, momenta.reshape(-1, 3))
    times = np.tile(period * np.arange(skip + 1, skip + 1 + momenta.shape[1]), len(momenta))
    return Crossings(times, axes[:, 2], M, np.ones(len(M), int))


def _draw_section(scene: Scene, theory: Crossings, engine: Crossings | None, where: str) -> Figure:
    """Draw the points of the section on the annulus, paler if g decreases."""
    figure, axes = panels(f"{scene.name}, section {where}: {len(theory.l)} points", (8.0, 6.0))
    # Many points need small dots, so that a curve is not filled.
    size = 1.2 if len(theory.l) >= 5000 else 3.0 if engine is None else 7.0
    drawn = [(EQUATIONS.name, theory, EQUATIONS.colour, "o", size)]
    if engine is not None:
        drawn.append((LABEL.name, engine, LABEL.colour, "+", 5.0))
    sides = [(1, 1.0, ", g grows"), (-1, 0.4, ", g falls")]
    if not where.startswith("g"):  # a phase always grows
        sides = [(1, 1.0, "")]
    for name, points, colour, mark, size in drawn:
        style: Any = {"color": colour, "ms": size, "mew": 0 if mark == "o" else 0.8}
        for direction, alpha, side in sides:
            half = points[points.directions == direction]
            label = f"{name}{side}"
            axes.plot(half.l % (2 * np.pi), half.L, mark, alpha=alpha, label=label, **style)
    axes.set(xlabel="l [rad], from 0 to 2π", ylabel="L [kg m²/s]", xlim=(0, 2 * np.pi))
    figure.legend(loc="outside lower center", ncols=4, markerscale=2, frameon=False)
    return figure


def section_study(
    name: str, starts: int, count: int, skip: int, g: float, preset: str | None, seed: int
) -> Study:
    """Draw the section of a scene and count its crossings."""
    scene = load_scene(name)
    period = None if scene.steady and not scene.not_reduced else period_of(scene)
    if period is None:
        scene = moving_scene(name, "a section")
    elif g:
        raise InputError(f"{scene.name} is driven: its section is at a drive phase, so omit --g")
    settings = None if preset is None else settings_of(preset)
    initial = level_starts(scene, starts, seed, g)
    total = check_count("skip", skip, 0) + check_count("count", count, 1)
    with progress_bar(1 if settings is None else 2) as show:
        show(0, f"{scene.name}: equations")
        points, engine = _by_equations(scene, initial, period, skip, count, g), None
        if settings is not None:
            show(1, f"{scene.name}: {LABEL.name}, {settings.name}")
            model = build(scene, settings)
            if period is None:
                times = each_step(model, points.times[count - 1])
                motion = sound_run(model, scene.start, times)
                engine = crossings_of_motion(motion, scene, g)[skip:]
            else:
                motion = sound_run(model, scene.start, period * np.arange(total + 1.0))
                ends = multiply(motion.attitude[1:], scene.principal_quaternion)
                engine = _at_phase(period, ends[None], motion.momentum[None, 1:], skip)
    where = f"g = {g:g}" if period is None else f"once in {period:.6g} s"
    drawn = {EQUATIONS.name: points} | ({} if engine is None else {LABEL.name: engine})
    shown = []
    for label, crossings in drawn.items():
        growing, total = np.count_nonzero(crossings.directions == 1), len(crossings.l)
        sides = f"crossings, {growing} with g growing, {total - growing} falling"
        shown.append(f"{label}: {total} {sides if period is None else f'points, {where}'}")
    if period is None and _may_come_to_rest(scene):
        shown.append(
            "a straight-line motion with this M² attracts: what ends there crosses only by"
        )
        shown.append(f"rounding; 'robotball dynamics equilibria {escape(name)}' lists it")
    record = {"scene": scene.name, "g": g, "starts": starts, "seed": seed}
    record |= {} if period is None else {"period": period}
    record |= {
        by: {key: getattr(of, key).tolist() for key in ("times", "l", "L", "directions")}
        for by, of in drawn.items()
    }
    picture = _draw_section(scene, points, engine, where)
    by, words = (None, []) if settings is None else (LABEL, [settings.name])
    return Study(scene.name, by, [*words, "section"], (), record, shown, picture)


def _by_equations(
    scene: Scene, starts: tuple[Array, Array], period: float | None, skip: int, count: int, g: float
) -> Crossings:
    """Return the points of the motions from starts that `level_starts` returns."""
    if period is not None:
        ends, M = strobed(scene, *starts, skip + count)
        return _at_phase(period, ends, M, skip)
    found = sections_of(scene.parameters, *starts, skip + count, g)
    if lost := np.count_nonzero(found.status):
        raise InputError(f"{lost} motions do not keep crossing g = {g:g}")
    return found.after(skip)
