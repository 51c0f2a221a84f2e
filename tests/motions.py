"""Motions made from other motions, and pairs of motions from an engine and the equations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from robotball.engines.engine import request_of, run_request
from robotball.engines.equations import integrate
from robotball.engines.mujoco import LABEL
from robotball.motion import (
    ContactMotion,
    ContactReport,
    EngineSettings,
    Motion,
    ReferenceMotion,
    extended,
    gamma_error,
    momentum_error,
    momentum_errors,
    path_error,
    tolerated,
)
from robotball.robot.scene import Scene
from robotball.rotations import Array


def as_contact(motion: Motion, report: ContactReport, **changes: Any) -> ContactMotion:
    """Return a motion as if from a contact engine, with some fields changed."""
    return extended(motion, ContactMotion, **{"engine": LABEL, "report": report, **changes})


@dataclass(frozen=True)
class Pair:
    """Motions from a contact engine and the equations, with the errors of `robotball.motion`.

    The errors are infinite if the run broke off.
    """

    theory: ReferenceMotion
    motion: ContactMotion

    @property
    def report(self) -> ContactReport:
        return self.motion.report

    @property
    def path_error(self) -> float:
        return self._measured(path_error)

    @property
    def gamma_error(self) -> float:
        return self._measured(gamma_error)

    @property
    def momentum_error(self) -> float:
        return self._measured(momentum_error)

    def _measured(self, error: Callable[[Motion, Motion], float]) -> float:
        finished = len(self.motion.times) == len(self.theory.times)
        return error(self.motion, self.theory) if finished else float("inf")

    @property
    def agrees(self) -> bool:
        """True without faults and with all errors within the settings' tolerances."""
        settings, times = self.report.settings, self.motion.times
        path = settings.error_tolerance if settings.accuracy is None else settings.accuracy
        if self.report.faults or not self.path_error <= path:
            return False
        allowed = tolerated(settings.error_tolerance, times)
        kept = bool((momentum_errors(self.motion, self.theory) <= allowed).all())
        return settings.accuracy is not None or kept


def pair_of(
    scene: Scene,
    settings: EngineSettings | str | None = None,
    times: Array | None = None,
    *,
    accuracy: float | None = None,
    theory: ReferenceMotion | None = None,
) -> Pair:
    """Return both motions of a scene; the engine's precheck gets the loads of the equations."""
    theory = integrate(scene, times) if theory is None else theory
    request = replace(request_of(settings=settings, accuracy=accuracy), loads=theory.loads)
    return Pair(theory, run_request(theory.scene, theory.times, request))
