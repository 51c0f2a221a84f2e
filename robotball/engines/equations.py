"""Integrate a scene with the equations of ideal rolling."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Literal

import numpy as np

from robotball.errors import EarlyEndError, InputError, check_count, check_size, unknown
from robotball.motion import Progress, ReferenceMotion, arrays_of
from robotball.robot.scene import Scene, Times, times_of
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL

_Equations = Literal["reduced", "multibody"]
# Modules by name: an import would load both.
_EQUATIONS: dict[_Equations, str] = {
    "reduced": "robotball.theory.reduced",
    "multibody": "robotball.theory.multibody.integration",
}

_COARSE, _MOST_COARSE = 1e-8, 5000  # rtol and most steps of a motion that is only checked for slip
_CERTAIN = 0.9  # of the friction; if samples need less, the ball does not slip in between
# The friction of this first part of a motion is checked at this many times. If the ball slips in
# this part, rolling is not integrated to the end.
_EARLY, _CHECKS = 1 / 16, 9


def scene_of(scene: Scene | str | Path) -> Scene:
    """Return a scene, loaded with `load_scene` from a name or path."""
    if isinstance(scene, Scene):
        return scene
    from robotball.scene_files.scene_file import load_scene

    return load_scene(scene)


def integrate(
    scene: Scene | str | Path,
    times: Times = None,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    *,
    equations: _Equations | None = None,
    progress: Progress | None = None,
) -> ReferenceMotion:
    """Integrate a scene's motion with the equations of rolling, or of slipping if the ball slips.

    The ball slips if the scene gives its friction and rolling needs more friction.

    The label of the motion names the equations. Every number of a returned motion is finite.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    rtol : float, default 1e-15
        The largest relative error of one step. It must not be smaller than the default.
    max_steps : int, optional
        The largest number of steps. The default corresponds to some minutes of computing.
    equations : str, optional
        "reduced" for equations (3.2) or (3.3) of the paper, in which the ball never slips, or
        "multibody" for the equations of any robot. The default is "reduced" if (3.2) or (3.3)
        describes the motion, else "multibody".
    progress : callable, optional
        Called with the integrated fraction of the motion, from 0 to 1, if the integration takes
        longer than a moment.

    Returns
    -------
    ReferenceMotion
        The motion, with an estimate of its own error.

    Raises
    ------
    InputError
        If the times are invalid, the requested equations do not describe the scene, the ball lifts
        off, `max_steps` is reached, a step becomes too short, a number overflows, or `load_scene`
        raises it.

    Warns
    -----
    SceneWarning
        If `load_scene` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> motion = rb.integrate("fig12", 0.5)
    >>> motion.contact_point.shape
    (26, 2)
    >>> print(f"{motion.path_length:.3f} m")
    1.857 m
    """
    scene = scene_of(scene)
    times = times_of(times, scene)
    check_size("rtol", rtol)
    if not LEAST_RTOL <= rtol < 1:
        raise InputError(f"rtol must be at least {LEAST_RTOL:g} and less than 1, not {rtol:g}")
    if max_steps is not None:
        check_count("max_steps", max_steps, 1, 2**62)
    chosen: _Equations = equations or ("multibody" if scene.not_reduced else "reduced")
    if chosen not in [*_EQUATIONS]:
        raise unknown("set of equations", chosen, _EQUATIONS)

    def run(
        name: _Equations, scene: Scene, times: Array, progress: Progress | None
    ) -> ReferenceMotion:
        motion: ReferenceMotion = import_module(_EQUATIONS[name]).integrate(
            scene, times, rtol, max_steps, progress
        )
        _check_finite(motion)
        return motion

    def half(begin: float) -> Progress | None:
        return progress and (lambda part: progress(begin + part / 2))

    # Overflow is reported with the number that overflowed, not as NumPy's warning.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if equations == "reduced" or not scene.may_slip:
            return run(chosen, scene, times, progress)
        if scene.start.slips:
            return run("multibody", scene, times, progress)
        try:
            # A controller is not called for this check, because a call may change its state.
            if not scene.controller:
                early = np.linspace(0.0, _EARLY * times[-1], _CHECKS)
                if run(chosen, scene.ideal, early, None).loads.grip(scene.slip_limits).max() > 1:
                    return run("multibody", scene, times, progress)
            rolling = replace(run(chosen, scene.ideal, times, half(0.0)), scene=scene)
        except EarlyEndError:  # a ball that slips may continue
            return run("multibody", scene, times, progress)
        if rolling.loads.grip(scene.slip_limits).max() < _CERTAIN:
            return rolling
        # The friction is exceeded at a sample, or may be exceeded between samples.
        slipping = run("multibody", scene, times, half(0.5))
        return rolling if slipping.slip is None else slipping


def slips(scene: Scene) -> bool:
    """Return whether a motion exceeds the friction of its scene; True if this is unknown."""
    if not scene.may_slip or scene.start.slips or scene.controller:  # call controllers only once
        return scene.may_slip
    try:
        return integrate(scene, rtol=_COARSE, max_steps=_MOST_COARSE).slip is not None
    except InputError:
        return True


def _check_finite(motion: ReferenceMotion) -> None:
    """Raise InputError with the first number that overflowed, if there is one."""
    for place, array in arrays_of(motion):
        finite = np.isfinite(array).reshape(len(array), -1).all(axis=1)
        if not finite.all():
            t = motion.times[finite.argmin()]
            raise InputError(
                f"{motion.scene.name}: the {place[-1].replace('_', ' ')} exceeds "
                f"{np.finfo(float).max:.2g}, the largest number, at t = {t:g} s: bring masses, "
                "lengths and rates nearer to 1"
            )
