"""The studies of the ball's long-run motion: `dynamics`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .. import options


def section(
    scene: options.SceneName,
    /,
    *,
    starts: options.Count = 1,
    count: options.Count = 2000,
    skip: options.Count = 0,
    g: Annotated[float, Parameter(metavar="RAD")] = 0.0,
    preset: options.PresetName | None = None,
    seed: options.Seed = 0,
    out: options.Out = options.OUT,
    threads: options.Threads = None,
    json: options.JsonFile = None,
) -> int:
    """Draw the Poincaré section g = g₀ in (l, L), or the one at a phase of periodic drives.

    Example: robotball dynamics section fig12 --starts 4 --count 500

    Parameters
    ----------
    starts
        Number of motions. 1: the scene's own start; more: random starts with its M² and (M, γ).
    count
        Crossings to draw for each motion.
    skip
        Crossings to leave out at the beginning of each motion.
    g
        The angle g₀ of the section.
    preset
        Also draw the crossings of the engine from the scene's own start, with these settings.
    """
    from ..output import writable_folder
    from ..results import changed
    from ..studies.contact_sections import section_study

    writable_folder(out)
    study = section_study(scene, starts, count, skip, g, preset, seed)
    words = changed(section, starts=starts, count=count, skip=skip, g=g, seed=seed)
    return options.present_once(study, out, json, words)


def exponents(
    scene: options.SceneName,
    /,
    *,
    starts: options.Count = 16,
    duration: options.Seconds = 10_000.0,
    transient: options.Seconds = 1000.0,
    seed: options.Seed = 0,
    threads: options.Threads = None,
    json: options.JsonFile = None,
) -> int:
    """Measure the Lyapunov exponents of a scene with the equations.

    Example: robotball dynamics exponents fig14 --starts 4 --duration 1000

    Parameters
    ----------
    starts
        Number of random starts with the scene's M² and (M, γ). 1: the scene's own start.
    duration
        Time over which the exponents of each start are measured.
    transient
        Time that is simulated before the measurement.
    """
    from ..studies.long_runs import exponents_study

    study = exponents_study(scene, starts, duration, transient, seed)
    return options.present_once(study, options.OUT, json)


def basins(
    scene: options.SceneName,
    /,
    *,
    starts: options.Count = 1000,
    transient: options.Seconds = 3000.0,
    seed: options.Seed = 0,
    threads: options.Threads = None,
    json: options.JsonFile = None,
) -> int:
    """Say which attractor each of many random starts reaches.

    Example: robotball dynamics basins fig12 --starts 100

    Parameters
    ----------
    starts
        Number of random starts with the scene's M² and (M, γ).
    transient
        Time after which a motion counts as being on its attractor.
    """
    from ..studies.long_runs import basins_study

    return options.present_once(basins_study(scene, starts, transient, seed), options.OUT, json)


def equilibria(
    scene: options.SceneName,
    /,
    *,
    longest: options.Seconds = 100.0,
    out: options.Out = options.OUT,
    threads: options.Threads = None,
    json: options.JsonFile = None,
) -> int:
    """List and draw straight motions, and the fixed points and limit cycles from rest.

    Example: robotball dynamics equilibria fig06

    Parameters
    ----------
    longest
        Longest period of limit cycles that are searched for. 0: no search.
    """
    from ..output import writable_folder
    from ..results import changed
    from ..studies.equilibria import equilibria_study

    writable_folder(out)
    study = equilibria_study(scene, longest)
    return options.present_once(study, out, json, changed(equilibria, longest=longest))


def branches(
    scene: options.SceneName,
    /,
    *,
    of: Literal["equilibrium", "line", "cycle"],
    over: Annotated[str, Parameter(metavar="NAME=FROM:TO")],
    longest: options.Seconds | None = None,
    out: options.Out = options.OUT,
    threads: options.Threads = None,
    json: options.JsonFile = None,
    csv: options.CsvFile = None,
) -> int:
    """Follow fixed points, straight motions or cycles while a number changes; find bifurcations.

    Example: robotball dynamics branches fig07 --of equilibrium --over K3=0.1:2.5

    Parameters
    ----------
    of
        Fixed points of the motion from rest; or straight motions or cycles with the scene's M.
    over
        The number that changes, and its range in SI units (angles in degrees). Numbers are K1 to
        K3, Omega1 to Omega3, K, Omega, f, c, and angles such as K12, K31 and Omega12. For periodic
        drives: frequency, f, c, frame.mean, rotor1.value, plane.Z.amplitude, plane.Z.phase.
    longest
        Longest period of the cycles. Default: 300 s, or four periods of periodic drives.
    """
    from ..output import writable_folder
    from ..results import changed
    from ..studies.branches import follow_branches
    from ..study import Study, write

    writable_folder(out)
    words = changed(branches, longest=longest)

    def save(study: Study) -> Path:
        return write(study, out / f"{study.stem(*words)}.png", json, csv)[0]

    print(follow_branches(scene, of, over, longest, save))
    return options.AGREES


def chart(
    scene: options.SceneName,
    /,
    *,
    over: Annotated[str, Parameter(metavar="NAME=FROM:TO,…")],
    points: options.Count = 100,
    refine: options.Count = 1,
    duration: options.Seconds = 4000.0,
    transient: options.Seconds = 2000.0,
    sweep: options.SweepOptions = options.SWEEP,
) -> int:
    """Chart the largest exponent over two numbers of a ball.

    The numbers are the components K1 to K3 and Omega1 to Omega3 along the principal axes, the
    lengths K and Omega, f = M² and c = (M, γ). K12, K23, K31, Omega12 and so on are the angles of
    K and Omega in a plane of two axes, in degrees.

    Example: robotball dynamics chart fig14 --over K=0:6,Omega=0:6 --quick

    Parameters
    ----------
    over
        Name and range of the number on the horizontal axis, then on the vertical axis.
    points
        Number of points along each axis before refinement.
    refine
        How often the spacing is halved where neighbouring motions differ in kind.
    duration
        Time of each motion after the transient. Its later half gives the exponent.
    transient
        Time that each motion is simulated before.
    """
    from ..results import changed
    from ..studies.charts import chart_study

    study = chart_study(scene, over, sweep, points, refine, duration, transient)
    more = {"points": points, "refine": refine, "duration": duration, "transient": transient}
    return sweep.present(study, *changed(chart, over=over, **more))
