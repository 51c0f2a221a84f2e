"""A minimal engine: the equations' motion with an error that grows in time."""

import numpy as np

from robotball.engines.engine import Engine, Request
from robotball.engines.equations import integrate
from robotball.motion import ContactMotion, ContactReport, EngineSettings, Label, extended
from robotball.robot.scene import Scene
from robotball.rotations import Array

ERROR = 1e-4  # relative to the path, at its end
PRESETS = {"as it comes": EngineSettings(name="as it comes", error_tolerance=1e-2)}


class Off(Engine):
    """Roll as the equations do, with a final path error of ERROR; only rubber balls."""

    label = Label("Off", "3.1", "#009E73")
    presets = PRESETS
    default = "as it comes"
    least_accuracy = None

    def cannot_express(self, scene: Scene) -> str | None:
        return "it rolls only rubber balls" if scene.rolling == "classical" else None

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        exact, zero = integrate(scene, times), np.zeros(len(times))
        settings = request.settings or self.presets[self.default]
        report = ContactReport(
            settings, slip=zero, spin=zero, depth=zero, friction_used=zero, hinge_rate_error=zero,
            faults=(), timestep=float(times[1]), steps=len(times), seconds=0.01, total_seconds=0.01,
        )  # fmt: skip
        error = np.outer(ERROR * exact.path_length * times / times[-1], [0.6, 0.8])
        path = exact.contact_point + error
        return extended(exact, ContactMotion, engine=self.label, contact_point=path, report=report)


OFF = Off()
