"""Compare a contact engine's motion of a scene with the reference's."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from robotball import Engine, EngineSettings, Fault, Motion, Scene, integrate
from robotball.engines.engine import DEFAULT, Request, request_of, run_request
from robotball.engines.equations import scene_of
from robotball.motion import (
    ContactMotion,
    ContactReport,
    ReferenceMotion,
    attitude_error,
    gamma_error,
    momentum_error,
    momentum_errors,
    path_error,
    path_errors,
    tolerated,
)
from robotball.robot.ball import Value
from robotball.robot.scene import Times
from robotball.rotations import Array

if TYPE_CHECKING:
    from .sensitivity import Sensitivity

_LIMITED = 3.0  # times the reference's own error: a smaller path error may be the reference's


@dataclass(frozen=True, repr=False)
class Agreement(Value):
    """Hold a contact engine's motion beside the reference's, and measure their difference.

    The errors of a motion that broke off are NaN, so that it is within no tolerance; `verdict` says
    why it did. Up to its fault, `path_errors` and `momentum_errors` have the errors over time.

    Attributes
    ----------
    theory : Motion
        The motion by the equations.
    motion : ContactMotion
        The motion by the contact engine.
    engine : Engine or None
        The engine of the motion. None if the motion cannot be run again, as one from a file.

    Examples
    --------
    >>> import robotball as rb
    >>> from validation import compare
    >>> agreement = compare("fig12", 0.5, settings="fast")
    >>> agreement.path_error < agreement.tolerance, agreement.faults
    (True, ())
    """

    theory: Motion
    motion: ContactMotion
    engine: Engine | None = None

    def __repr__(self) -> str:
        # Here, as a library's user who prints no agreement need not load the terminal's tables.
        from .output import scientific

        errors = f"path error {scientific(self.path_error)}, "
        errors += f"momentum error {scientific(self.momentum_error)}"
        by = f"{self.motion.engine.name}, {self.settings.name}"
        return f"<Agreement of {self.scene.name} by {by}: {self.verdict}; {errors}>"

    def _repr_html_(self) -> str:
        from robotball.view.notebook import cell

        return cell(repr(self), [self.theory, self.motion])

    @property
    def scene(self) -> Scene:
        return self.theory.scene

    @property
    def report(self) -> ContactReport:
        return self.motion.report

    @property
    def settings(self) -> EngineSettings:
        return self.report.settings

    @property
    def faults(self) -> tuple[Fault, ...]:
        return self.report.faults

    @property
    def end(self) -> float:
        """The time [s] of the engine's last sample; 0 where it broke off before its first one."""
        # A slice, as a run that broke off in its first step has no sample.
        return float(self.motion.times[-1:].sum())

    @property
    def finished(self) -> bool:
        return len(self.motion.times) == len(self.theory.times)

    @cached_property
    def path_errors(self) -> Array:
        """The distance (n,) [m] between the two contact points, as far as the motion goes."""
        return path_errors(self.motion, self.theory)

    @cached_property
    def momentum_errors(self) -> Array:
        """The relative error (n,) of M, as far as the motion goes."""
        return momentum_errors(self.motion, self.theory)

    @property
    def path_error(self) -> float:
        """The largest contact-point error over the path's length or the radius."""
        return self._measured(path_error)

    @property
    def attitude_error(self) -> float:
        """The largest angle between the two attitudes [rad]."""
        return self._measured(attitude_error)

    @property
    def gamma_error(self) -> float:
        """The largest angle between the two verticals, seen from the frame [rad]."""
        return self._measured(gamma_error)

    @property
    def momentum_error(self) -> float:
        """The largest error of M, relative."""
        return self._measured(momentum_error)

    def _measured(self, measure: Callable[[Motion, Motion], float]) -> float:
        # The error up to a fault is smaller than that of the whole motion: a run that broke off
        # would look better than one that finished.
        return measure(self.motion, self.theory) if self.finished else math.nan

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per second of stepping the engine, set-up excluded."""
        # Set-up is left out: it is the same for a second and for an hour.
        return self.end / self.report.seconds

    @property
    def tolerance(self) -> float:
        """The largest relative error with which a motion by these settings agrees."""
        accuracy = self.settings.accuracy
        return self.settings.error_tolerance if accuracy is None else accuracy

    @property
    def agrees(self) -> bool:
        """Whether there is no fault, and path and momentum are both within the tolerance.

        The path alone is not enough, as errors of two kinds can cancel in it, unless an accuracy of
        the path was requested. A reference that ended early says nothing of the time after.
        """
        return self._near and self.ended is None

    @property
    def ended(self) -> str | None:
        """Which joint's range ended the reference early, and when."""
        return self.theory.ended if isinstance(self.theory, ReferenceMotion) else None

    @property
    def _near(self) -> bool:
        # Not `error > tolerance`: NaN must not agree.
        if self.faults or not self.path_error <= self.tolerance:
            return False
        return self.settings.accuracy is not None or self.keeps_momentum

    @property
    def keeps_momentum(self) -> bool:
        """Whether the error of M is at every time what `tolerated` allows by then."""
        # By the one law that the monitor has, so that a run cannot agree with a fault in it, nor be
        # off without one.
        allowed = tolerated(self.settings.error_tolerance, self.motion.times)
        return bool((self.momentum_errors <= allowed).all())

    @property
    def reference_error(self) -> float | None:
        """The reference's own path error, as it estimates it; None if it does not."""
        theory = self.theory
        return theory.reference_error if isinstance(theory, ReferenceMotion) else None

    @property
    def limited_by_reference(self) -> bool:
        """Whether the path error may be as much the reference's own as the engine's."""
        own = self.reference_error
        return own is not None and self.path_error < _LIMITED * own

    @cached_property
    def sensitivity(self) -> "Sensitivity | None":
        """The motion's sensitivity to small errors, where the path alone is off; else None.

        It is None too where it is not known. A few short runs are needed to find it.
        """
        # Short runs by the same engine are needed, so a motion from a file has none.
        if self.engine is None or self.faults or self._near or not self.finished:
            return None
        if self.scene.keeps_momentum and not self.keeps_momentum:
            return None  # M is constant however sensitive the motion is: the engine lost it
        from .sensitivity import sensitivity

        return sensitivity(self.engine, self.motion, self.theory)

    @cached_property
    def loop_growth(self) -> float | None:
        """How a closed loop makes a small turn of the start grow; None without a controller.

        The path error, over the path's length, for a turn of 1 rad, were it small.
        """
        if self.scene.controller is None:
            return None
        from .sensitivity import growth

        return growth(self.theory)

    @property
    def sensitive(self) -> bool:
        """Whether the motion's own sensitivity explains why the motions do not agree."""
        return self.sensitivity is not None and self.sensitivity.explains

    @property
    def verdict(self) -> str:
        """Whether it agrees, or why not, in one line."""
        if self.faults:
            return "; ".join(str(fault) for fault in self.faults)
        if self.sensitive:
            return str(self.sensitivity)
        if self._near and self.ended:
            return f"no verdict after it ends: {self.ended}"
        if self.agrees:
            return "agrees, limited by the reference" if self.limited_by_reference else "agrees"
        return f"off by more than {self.tolerance:g}"


def compare(
    scene: Scene | str | Path,
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    accuracy: float | None = None,
    theory: Motion | None = None,
    strict: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Agreement:
    """Run a scene by a contact engine and by the equations, and compare the two motions.

    The friction of the engine is checked against what the whole motion needs.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    accuracy : float, optional
        The path error to reach, relative to the path's length. It chooses the settings, so give
        either `accuracy` or `settings`.
    theory : Motion, optional
        The motion by the equations at these times, if it is known.
    strict : bool, default False
        Whether settings that are predicted to fail raise InputError instead of a warning.
    progress : callable, optional
        Called with the simulated fraction, from 0 to 1.

    Returns
    -------
    Agreement
        Both motions, their errors and a verdict.

    Raises
    ------
    InputError
        If `load_scene`, `integrate` or `simulate` raises it.

    Warns
    -----
    SceneWarning
        If `load_scene` or `simulate` warns.

    Examples
    --------
    >>> import robotball as rb
    >>> from validation import compare
    >>> compare("fig12", 0.5, settings="fast").verdict
    'agrees'
    """
    scene = scene_of(scene)
    request = request_of(engine, settings, accuracy)
    return compare_with(
        integrate(scene, times) if theory is None else theory,
        replace(request, strict=strict, progress=progress),
    )


def compare_with(theory: Motion, request: Request) -> Agreement:
    """Compare as `compare` does, by a request, where the reference motion is known already."""
    # The equations know the loads of the whole motion; the precheck would else have those of the
    # start.
    motion = run_request(theory.scene, theory.times, replace(request, loads=theory.loads))
    return Agreement(theory, motion, request.engine)
