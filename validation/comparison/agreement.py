"""Agreement: how far apart the two engines' motions of one scene are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from robotball import Diagnostics, Fault, Motion, Scene, Settings, integrate
from robotball.engines.mujoco.accuracy import asked
from robotball.engines.mujoco.run import simulate_with
from robotball.rotations import Array
from validation.comparison.sensitivity import Sensitivity, sensitivity


@dataclass(frozen=True)
class Agreement:
    """Two motions of a scene, at the same times, and the measures of their difference.

    A run of MuJoCo that broke off has no measures: they are None, and `faults` says why.
    """

    scene: Scene
    settings: Settings
    theory: Motion
    engine: Motion

    @cached_property
    def path_errors(self) -> Array:
        """(n,): distance between the two contact points [m], as far as both motions go."""
        n = len(self.engine.times)
        return np.linalg.norm(self.engine.contact_point - self.theory.contact_point[:n], axis=1)

    @cached_property
    def momentum_drifts(self) -> Array:
        """(n,): |M(t) - M(0)| of the engine's motion over |M(0)|; in kg m²/s where M(0) = 0."""
        momentum = self.engine.momentum
        size = float(np.linalg.norm(self.scene.start.momentum))
        return np.linalg.norm(momentum - momentum[:1], axis=1) / (size or 1.0)

    @property
    def finished(self) -> bool:
        return len(self.engine.times) == len(self.theory.times)

    @property
    def path_error(self) -> float | None:
        """The largest contact-point error over the length of the equations' path.

        Over the ball's radius where that path is shorter: a ball that turns on the spot has none.
        """
        if not self.finished:
            return None
        return float(self.path_errors.max() / self.path_scale)

    @cached_property
    def path_scale(self) -> float:
        """What path errors are measured by: the path's length or the radius, the longer [m]."""
        return max(self.theory.path_length, self.scene.ball.radius)

    @property
    def gamma_error(self) -> float | None:
        """The largest angle between the two verticals, seen from the frame [rad]."""
        if not self.finished:
            return None
        ours, theirs = self.engine.gamma, self.theory.gamma
        sine = np.linalg.norm(np.cross(ours, theirs), axis=1)
        return float(np.arctan2(sine, (ours * theirs).sum(axis=1)).max())

    @property
    def momentum_drift(self) -> float | None:
        """The largest of `momentum_drifts`."""
        return float(self.momentum_drifts.max()) if self.finished else None

    @property
    def diagnostics(self) -> Diagnostics:
        assert self.engine.diagnostics is not None  # simulate always gives them
        return self.engine.diagnostics

    @property
    def faults(self) -> tuple[Fault, ...]:
        return self.diagnostics.faults

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per second of stepping MuJoCo, set-up excluded."""
        return float(self.engine.times[-1:].sum() / self.diagnostics.seconds)

    @property
    def promise(self) -> float:
        """The path error, relative, that the settings are held to."""
        accuracy = self.settings.accuracy
        return self.settings.promise if accuracy is None else accuracy

    @property
    def agrees(self) -> bool:
        """No fault, and path and momentum both within the settings' promise.

        The path alone is not enough, as errors of two kinds can cancel in it, unless an accuracy of
        the path was asked for.
        """
        asked = self.settings.accuracy is not None
        measured = (self.path_error,) if asked else (self.path_error, self.momentum_drift)
        return not self.faults and all(
            value is not None and value <= self.promise for value in measured
        )

    @cached_property
    def sensitivity(self) -> Sensitivity | None:
        """What the motion itself makes of small errors, where the path alone is off; else None.

        None too where it is not known. It takes a few short runs.
        """
        if self.faults or self.agrees or not self.finished:
            return None
        if self.momentum_drift is None or not self.momentum_drift <= self.settings.promise:
            return None  # M is constant however sensitive the motion is: the engine lost it
        return sensitivity(
            self.scene, self.settings, self.theory, self.path_errors, self.path_scale
        )

    @property
    def sensitive(self) -> bool:
        """Whether the motion's own sensitivity explains why the engines do not agree."""
        return self.sensitivity is not None and self.sensitivity.explains

    @property
    def verdict(self) -> str:
        """One line: agrees, or why not."""
        if self.faults:
            return "; ".join(str(fault) for fault in self.faults)
        if self.sensitive:
            return str(self.sensitivity)
        return "agrees" if self.agrees else f"off by more than {self.promise:g}"


def compare(
    scene: Scene,
    settings: Settings | str | None = None,
    times: Array | None = None,
    *,
    accuracy: float | None = None,
    theory: Motion | None = None,
    strict: bool = False,
    dump: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Agreement:
    """Both engines' motions of `scene`, compared.

    settings: a preset's name or Settings, balanced if None; times: (n,) s from 0, the scene's own
    if None; accuracy: instead of settings, the path error to reach; theory: the equations' motion
    at those times, where it is known already. Raises InputError and warns as integrate and
    simulate do; friction is held against what the whole motion needs. strict, dump, progress: as
    in simulate.
    """
    wanted = asked(settings, accuracy)
    theory = integrate(scene, times) if theory is None else theory
    reached = simulate_with(
        scene,
        theory.times,
        wanted,
        loads=theory.loads,
        strict=strict,
        dump=dump,
        progress=progress,
    )
    return Agreement(scene, reached.settings, theory, reached.motion)
