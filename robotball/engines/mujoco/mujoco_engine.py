"""MuJoCo as an engine: it takes a request and returns a motion with its report.

The room is read in this order: `settings` (the recipes), `model` (scene and settings → MJCF),
`control` and `stepping` (MuJoCo's integrators) with `torque_limits` and `rolling_resistance`,
`adaptive` (DOP853), `readings` (sensors → readings, MuJoCo's own faults), `run`, `rollouts` (many
at once), `limits` with `linearised` (faults predicted), `accuracy` (an error in place of settings,
and that of settings), `user_model`, `mjcf_export`, `ports` (MJX and MuJoCo Warp),
`dm_environment` (an agent drives).
"""

from collections.abc import Iterator, Mapping, Sequence

from robotball.engines.engine import Engine, Request, Runner, as_own
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.limits import precheck
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import held, run
from robotball.engines.mujoco.settings import PRESETS, Settings
from robotball.motion import ContactMotion, EngineSettings, Progress
from robotball.robot.scene import Scene
from robotball.rotations import Array

# A ball near an unstable motion magnifies the rounding of its start to half of it.
LEAST_ACCURACY = 1e-11


class MuJoCo(Engine):
    """MuJoCo as an `Engine`."""

    label = LABEL
    presets: Mapping[str, EngineSettings] = PRESETS
    default = "balanced"
    least_accuracy: float | None = LEAST_ACCURACY
    as_it_comes = "naive"
    closes_loops = True

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        """Return the scene's motion at times (n,) [s] from 0; fewer where the run broke off."""
        if request.accuracy is not None:
            motion = _to_accuracy(scene, times, request, request.accuracy)
            # The search chooses the settings, so they are known only once it has run.
            settings = as_own(motion.report.settings, Settings, LABEL)
            precheck(scene, settings, times, request.loads, strict=request.strict)
            return motion
        settings = as_own(request.settings, Settings, LABEL)
        precheck(scene, settings, times, request.loads, strict=request.strict)
        return held(run(build(scene, settings), times, request.progress))

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """Return a function that runs one model, built here, from any state of the scene's ball."""
        model = build(scene, as_own(settings, Settings, LABEL))
        return lambda times, started: run(model, times, scene=started)

    def run_many(
        self, scenes: Sequence[Scene], times: Array, settings: EngineSettings
    ) -> Iterator[ContactMotion]:
        """Yield the motions of scenes, as `run` returns them."""
        from robotball.engines.mujoco.rollouts import run_many

        return run_many(scenes, as_own(settings, Settings, LABEL), times)


MUJOCO = MuJoCo()


def _to_accuracy(scene: Scene, times: Array, request: Request, accuracy: float) -> ContactMotion:
    """Search for settings that reach the accuracy, and return the last run."""
    from robotball.engines.mujoco.accuracy import reach

    # How many runs follow is not known, so each is given half of the work that is left.
    part = 1.0

    def another(settings: Settings, at: Array) -> ContactMotion:
        nonlocal part
        part /= 2
        share = _share(request.progress, 1 - 2 * part, part)
        return run(build(scene, settings), at, share)

    return reach(scene, times, accuracy, another)


def _share(progress: Progress | None, done: float, part: float) -> Progress | None:
    """Return the progress of a run that is a part of the whole, after a part that is done."""
    return None if progress is None else lambda fraction: progress(done + part * fraction)
