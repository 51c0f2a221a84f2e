"""Motions beside others, or made up from others, for what a test needs of them."""

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
    """A motion as a contact engine would give it, with some fields changed."""
    return extended(motion, ContactMotion, **{"engine": LABEL, "report": report, **changes})


@dataclass(frozen=True)
class Pair:
    """A contact engine's motion beside the equations', with the errors of `robotball.motion`.

    Those of a run that broke off are infinite.
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
        """Whether there is no fault, and the errors are within what the settings are held to."""
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
    """Both motions of a scene; the engine's precheck knows the loads of the equations' motion."""
    theory = integrate(scene, times) if theory is None else theory
    request = replace(request_of(settings=settings, accuracy=accuracy), loads=theory.loads)
    return Pair(theory, run_request(theory.scene, theory.times, request))
