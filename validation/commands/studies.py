"""The studies of engines and their settings: `study` and `engines`."""

from dataclasses import replace

from .. import options


def ablation(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    once: options.OnceOptions = options.ONCE,
) -> int:
    """Measure the effect of each choice of settings, from naive to the recipe.

    Example: robotball study ablation fig12 --quick
    """
    from ..studies.ablation import ablation_study

    return once.run(ablation_study, scene, control)


def convergence(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    preset: options.PresetName = "accurate",
    without: options.Names = (),
    once: options.OnceOptions = options.ONCE,
) -> int:
    """Measure each integrator's order of convergence, and the error of the contact model itself.

    Example: robotball study convergence fig12 --quick --without softness,noslip

    Parameters
    ----------
    preset
        Settings of the contact model. The study varies the integrator and the timestep.
    without
        Choices of 'study ablation' to undo, such as softness,noslip. Choices: drive, friction,
        cone, root, integrator, start, softness, noslip, solver, timestep.
    """
    from robotball import preset as settings_of

    from ..studies.ablation import without as undone
    from ..studies.convergence import convergence_study

    settings = undone(settings_of(preset), without)
    return once.run(lambda loaded, *how: convergence_study(loaded, settings, *how), scene, control)


def cones(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    once: options.OnceOptions = options.ONCE,
) -> int:
    """Measure the errors of MuJoCo's friction cones for frictions at which the ball slips.

    Example: robotball study cones classical_regular --quick
    """
    from ..studies.cones import cones_study

    return once.run(cones_study, scene, control)


def cost(
    scene: options.SceneName,
    /,
    *,
    control: options.Controls = (),
    duration: options.Duration = None,
    sweep: options.SweepOptions = options.SWEEP,
) -> int:
    """Measure the cost of accuracy: errors, processor times and their Pareto front.

    Example: robotball study cost fig12 --quick
    """
    from ..results import changed, controlled
    from ..studies.cost import cost_study
    from ..study import scene_cell

    loaded = controlled(scene, control)
    loaded = replace(loaded, duration=options.seconds_of(duration, sweep.quick, loaded))
    study = cost_study(loaded, scene_cell(scene, loaded.duration, control), sweep)
    return sweep.present(study, *changed(cost, duration=duration))


def extremes(*maps: str, sweep: options.SweepOptions = options.SWEEP) -> int:
    """Map where each integrator and contact setting fails, and whether a fault reports it.

    Example: robotball study extremes momentum --quick

    Parameters
    ----------
    maps
        Names of maps. Default: all of momentum, frame, rotor, masses, scale, friction, torsion,
        gravity, contact, servo, duration.
    """
    from ..studies.extremes import map_extremes

    return map_extremes(maps, sweep)


def engines(
    *scenes: str,
    only: options.Names = (),
    install: options.Names = (),
    python: str = "",
    environments: options.Environments = None,
    newest: bool = False,
    duration: options.Duration = None,
    sweep: options.SweepOptions = options.SWEEP,
) -> int:
    """List the engines and their presets. With scenes: compare the engines' errors and costs.

    Example: robotball engines fig12 --only mujoco --quick

    Parameters
    ----------
    scenes
        Names from the catalog, or paths to scene files. Without a scene the engines are listed.
    only
        Engines to run, such as drake,bullet. Default: all installed engines.
    install
        First create an environment with uv for each of these engines, such as drake,bullet.
    python
        Python of new environments: a version or a path. Default: the newest for each engine.
    newest
        Ask the package index for newer releases, and show them in the list.
    """
    from robotball.engines.environments import ENVIRONMENTS

    from ..results import changed
    from ..studies.engine_study import run_engines

    return run_engines(
        scenes, only, install, python, environments or ENVIRONMENTS, newest,
        duration, sweep, changed(engines, duration=duration),
    )  # fmt: skip
