"""Our own ideal rolling of any robot, as an engine that is held against the reduced equations."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from robotball.engine import Engine, Ladder, Request, as_own
from robotball.engines.dop853 import LEAST_RTOL
from robotball.engines.multibody.integrate import LABEL, integrate
from robotball.motion import ContactMotion, ContactReport, EngineSettings, Label, Motion
from robotball.rotations import Array
from robotball.scene import Scene


@dataclass(frozen=True, kw_only=True)
class MultibodySettings(EngineSettings):
    """rtol: the error allowed in one step, relative."""

    rtol: float = LEAST_RTOL


class Multibody(Engine):
    """The engine, as `robotball.engine` describes one: it neither slips nor spins."""

    label: Label = LABEL
    presets: Mapping[str, EngineSettings] = {
        "best": MultibodySettings(name="best", error_tolerance=1e-11)
    }
    default = "best"
    least_accuracy: float | None = None
    ladders: Mapping[str, Ladder] = {"best": ("rtol", (1e-6, 1e-9, 1e-12, 1e-15))}

    def cannot_express(self, scene: Scene) -> str | None:
        """Nothing: it describes every scene."""
        return None

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """The motion; what compiles on the way is set-up."""
        settings = as_own(request.settings, MultibodySettings, LABEL)
        integrate(scene, times[:2], settings.rtol)
        began = time.process_time()
        motion = integrate(scene, times, settings.rtol)
        seconds, none = time.process_time() - began, np.zeros(len(times))
        given = {each.name: getattr(motion, each.name) for each in fields(Motion)}
        return ContactMotion(
            **given,
            report=ContactReport(
                settings=settings, slip=none, spin=none, depth=none, friction_used=none * np.nan,
                hinge_rate_error=none, faults=(), timestep=float(times[-1]), steps=0,
                seconds=seconds, total_seconds=seconds,
            ),
        )  # fmt: skip


MULTIBODY = Multibody()
