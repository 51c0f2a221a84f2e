"""The multibody equations as an engine, to compare them with the reduced equations."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robotball.engines.engine import Engine, Request, as_own
from robotball.motion import (
    ContactMotion,
    ContactReport,
    EngineSettings,
    Label,
    extended,
    measured_time,
)
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.multibody import LABEL


@dataclass(frozen=True, kw_only=True)
class _MultibodySettings(EngineSettings):
    """Settings; rtol is the relative error allowed in one step."""

    rtol: float = LEAST_RTOL


class _Multibody(Engine):
    """The multibody equations as an `Engine`."""

    label: Label = LABEL
    closes_loops = True
    presets: Mapping[str, EngineSettings] = {
        "best": _MultibodySettings(name="best", error_tolerance=1e-11)
    }
    default = "best"

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """Return the scene's motion, which neither slips nor spins."""
        from robotball.theory.multibody.integration import integrate  # loads numba

        settings = as_own(request.settings, _MultibodySettings, LABEL)
        # Compiling and loading is set-up, which the time of the run excludes.
        integrate(scene, times[:2], settings.rtol)
        began = time.process_time()
        motion = integrate(scene, times, settings.rtol)
        seconds, none = measured_time(time.process_time() - began), np.zeros(len(motion.times))
        report = ContactReport(
            settings=settings, slip=none, spin=none, depth=none, friction_used=none * np.nan,
            hinge_rate_error=none, faults=(), timestep=float(times[-1]), steps=0,
            seconds=seconds, total_seconds=seconds,
        )  # fmt: skip
        return extended(motion, ContactMotion, report=report)


MULTIBODY = _Multibody()
