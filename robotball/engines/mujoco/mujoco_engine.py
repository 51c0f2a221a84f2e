"""MuJoCo as an engine: run a request and return the motion with its report.

Read the folder in this order: `settings` (the recipes), `model` (MJCF from scene and settings),
`control` and `stepping` (MuJoCo's integrators) with `order8`, `parts` and `rolling_resistance`,
`readings` (sensor values and warnings), `run`, `rollouts` (many runs), `limits` with
`special_limits` and `linearised` (predicted failures), `accuracy` (settings for an accuracy).
"""

from collections.abc import Iterator, Mapping, Sequence

from robotball.engines.engine import Engine, Request, Runner, as_own
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import precheck, run
from robotball.engines.mujoco.settings import PRESETS, Resolved, Settings
from robotball.motion import ContactMotion, EngineSettings
from robotball.robot.scene import Friction, Scene
from robotball.rotations import Array


class _MuJoCo(Engine):
    """MuJoCo as an `Engine`."""

    label = LABEL
    presets: Mapping[str, EngineSettings] = PRESETS
    default = "balanced"
    # In path lengths; near an unstable motion, rounding errors reach half of this value.
    least_accuracy: float | None = 1e-11
    as_it_comes = "naive"
    closes_loops = True

    def friction(self, scene: Scene, settings: EngineSettings) -> Friction:
        """Return the friction of a scene's contact under settings."""
        resolved = Resolved(scene, as_own(settings, Settings, LABEL))
        slide, spin, _ = resolved.friction
        return Friction(slide, spin if resolved.condim > 3 else None)

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """Return the scene's motion at times (n,) [s] from 0; fewer times if the run failed."""
        chosen, motion = request.settings, None
        if request.accuracy is not None:
            from robotball.engines.mujoco.accuracy import reach

            motion = reach(scene, times, request.accuracy, request.progress)
            chosen = motion.report.settings
        # Resolved once, because the choice of the recipe may integrate the motion.
        settings = Resolved(scene, as_own(chosen, Settings, LABEL)).settings
        precheck(scene, settings, times, request.loads, strict=request.strict)
        if motion is None:
            motion = run(build(scene, settings), times, request.progress)
        if scene.not_reduced is None and not scene.may_slip:  # the monitor has checked M
            return motion
        from robotball.engines.mujoco.accuracy import checked

        return checked(motion)

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """Build the model once, and return a function that runs it from any state of the ball."""
        model = build(scene, as_own(settings, Settings, LABEL))
        return lambda times, started: run(model, times, scene=started)

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motion of each scene, equal to the motion that `run` returns."""
        from robotball.engines.mujoco.rollouts import run_many

        return run_many(scenes, as_own(settings, Settings, LABEL), times)


MUJOCO = _MuJoCo()
