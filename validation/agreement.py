"""Compare a contact engine's motion of a scene with the reference motion."""

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
    from .slip import Slip

# A path error below this multiple of the reference error may be the reference's error.
_LIMITED = 3.0


@dataclass(frozen=True, repr=False)
class Agreement(Value):
    """Compare a contact engine's motion with the reference motion.

    If the run failed before its end, the errors are None, and `faults` has the reason.

    Attributes
    ----------
    theory : Motion
        The reference motion from the equations.
    motion : ContactMotion
        The motion of the contact engine.
    engine : Engine or None
        The engine that ran the motion. None if the motion cannot be run again.

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
        from .output import scientific  # it loads rich

        path, momentum = scientific(self.path_error), scientific(self.momentum_error)
        run = f"{self.scene.name} by {self.motion.engine.name}, {self.settings.name}"
        errors = f"path error {path}, momentum error {momentum}"
        return f"<Agreement of {run}: {self.verdict}; {errors}>"

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
        """The time [s] of the engine's last sample; 0 without a sample."""
        # The slice is empty if the run broke off in its first step.
        return float(self.motion.times[-1:].sum())

    @property
    def finished(self) -> bool:
        return len(self.motion.times) == len(self.theory.times)

    @cached_property
    def path_errors(self) -> Array:
        """The distance (n,) [m] between the two contact points at the motion's times."""
        return path_errors(self.motion, self.theory)

    @cached_property
    def momentum_errors(self) -> Array:
        """The relative error (n,) of M at the motion's times."""
        return momentum_errors(self.motion, self.theory)

    @property
    def path_error(self) -> float:
        """The largest contact-point error, divided by the path's length or the radius."""
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
        """The largest relative error of M."""
        return self._measured(momentum_error)

    def _measured(self, measure: Callable[[Motion, Motion], float]) -> float:
        # The error up to a fault is smaller than that of the whole motion: a run that broke off
        # would look better than one that finished.
        return measure(self.motion, self.theory) if self.finished else math.nan

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per second of stepping the engine, without the set-up."""
        return self.end / self.report.seconds

    @property
    def tolerance(self) -> float:
        """The largest relative error of a motion that agrees."""
        accuracy = self.settings.accuracy
        return self.settings.error_tolerance if accuracy is None else accuracy

    @property
    def agrees(self) -> bool:
        """Whether path and momentum are within the tolerance, without a fault.

        Momentum is checked too, because errors can cancel in the path. If an accuracy of the path
        was requested, only the path is checked. If the reference ended early, the motion does not
        agree.
        """
        return self._near and self.ended is None

    @property
    def ended(self) -> str | None:
        """The joint whose range ended the reference early, and the time."""
        return self.theory.ended if isinstance(self.theory, ReferenceMotion) else None

    @property
    def _near(self) -> bool:
        # Not `error > tolerance`: NaN must not agree.
        if self.faults or not self.path_error <= self.tolerance:
            return False
        return self.settings.accuracy is not None or self.keeps_momentum

    @property
    def keeps_momentum(self) -> bool:
        """Whether the error of M is within the bound of `tolerated` at every time.

        The monitor uses the same bound.
        """
        allowed = tolerated(self.settings.error_tolerance, self.motion.times)
        return bool((self.momentum_errors <= allowed).all())

    @property
    def reference_error(self) -> float | None:
        """The estimated path error of the reference; None if the reference has no estimate."""
        theory = self.theory
        return theory.reference_error if isinstance(theory, ReferenceMotion) else None

    @property
    def limited_by_reference(self) -> bool:
        """Whether the path error may be the error of the reference, not of the engine."""
        own = self.reference_error
        return own is not None and self.path_error < _LIMITED * own

    @cached_property
    def sensitivity(self) -> "Sensitivity | None":
        """The motion's sensitivity to small errors; None if it is unknown.

        Short runs of the same engine measure the sensitivity, if only the path disagrees.
        """
        if self.engine is None or self.faults or self._near or not self.finished:
            return None
        if self.scene.keeps_momentum and not self.keeps_momentum:
            return None  # M is constant even in sensitive motions: the engine changed it
        from .sensitivity import sensitivity

        return sensitivity(self.engine, self.motion, self.theory)

    @cached_property
    def slip(self) -> "Slip | None":
        """The effect of limited friction on the motion; None if friction suffices for rolling."""
        from .slip import slip_of

        return slip_of(self.theory, self.motion, self.engine)

    @cached_property
    def loop_growth(self) -> float | None:
        """The growth of a small rotation of the start in a closed loop; None without a controller.

        The growth is the path error divided by the path's length, per radian of the rotation.
        """
        if self.scene.controller is None:
            return None
        from .sensitivity import growth

        return growth(self.theory)

    @property
    def sensitive(self) -> bool:
        """Whether the sensitivity of the motion explains the disagreement."""
        return self.sensitivity is not None and self.sensitivity.explains

    @property
    def verdict(self) -> str:
        """One line: the motion agrees, or the reason why not."""
        if self.faults:
            return "; ".join(str(fault) for fault in self.faults)
        if self.sensitive:
            return str(self.sensitivity)
        if self._near and self.ended:
            return f"no verdict after the end of the reference: {self.ended}"
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
    """Run a scene with a contact engine, integrate the equations, and compare both motions.

    The engine's friction is checked against the friction that the whole motion needs.

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
        The path error to reach, relative to the path's length. Settings are chosen for this error,
        so give either `accuracy` or `settings`.
    theory : Motion, optional
        The reference motion at these times, if it is known.
    strict : bool, default False
        Whether to raise InputError instead of a warning if the settings are predicted to fail.
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
    """Compare the run of a request with a known reference motion."""
    # Without these loads, the check before the run would use only the loads at the start.
    motion = run_request(theory.scene, theory.times, replace(request, loads=theory.loads))
    return Agreement(theory, motion, request.engine)
