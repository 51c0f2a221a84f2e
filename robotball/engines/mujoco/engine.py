"""MuJoCo as an engine: a request in, a motion with its report out."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from robotball.engine import Engine, Ladder, Progress, Request, Runner, as_own
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.limits import precheck
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import PRESETS, Settings
from robotball.motion import ContactMotion, EngineSettings, Label
from robotball.rotations import Array
from robotball.scene import Scene

# A ball near an unstable motion magnifies the rounding of its start to half of it.
LEAST_ACCURACY = 1e-11
LADDERS: Mapping[str, Ladder] = {
    "naive": ("timestep", (2e-3,)),
    "balanced": ("timestep", (20e-3, 10e-3, 5e-3, 1e-3)),
    "adaptive": ("rtol", (1e-6, 1e-9, 1e-12, 1e-15)),
}


@dataclass(frozen=True)
class MuJoCo(Engine):
    """The engine, as `robotball.engine` describes one."""

    label: Label = LABEL
    presets: Mapping[str, EngineSettings] = field(default_factory=lambda: PRESETS)
    default: str = "balanced"
    least_accuracy: float | None = LEAST_ACCURACY
    as_it_comes: str = "naive"
    ladders: Mapping[str, Ladder] = field(default_factory=lambda: LADDERS)

    def cannot_express(self, scene: Scene) -> str | None:
        """Only a resistance to rolling that varies: it would need the load before it is known."""
        if scene.friction.rolling and scene.load_varies:
            return "its plane resists rolling, by a load that varies"
        return None

    def run(self, scene: Scene, times: Array, request: Request) -> ContactMotion:
        if request.accuracy is not None:
            # The search chooses the settings, so they are known only once it has run.
            motion = _to_accuracy(scene, times, request, request.accuracy)
            settings = own_settings(motion.report.settings)
            precheck(scene, settings, times, request.loads, strict=request.strict)
            return motion
        settings = own_settings(request.settings)
        precheck(scene, settings, times, request.loads, strict=request.strict)
        return run(build(scene, settings), times, request.progress, request.fault_window)

    def prepare(self, scene: Scene, settings: EngineSettings) -> Runner:
        """One model, built once, for every start."""
        model = build(scene, own_settings(settings))
        return lambda times, start: run(model, times, start=start)


MUJOCO = MuJoCo()


def own_settings(settings: EngineSettings | None) -> Settings:
    """The settings as MuJoCo's; raises InputError where they are another engine's."""
    return as_own(settings, Settings, LABEL)


def _to_accuracy(scene: Scene, times: Array, request: Request, accuracy: float) -> ContactMotion:
    from robotball.engines.mujoco.accuracy import reach

    part = 1.0  # of the work left before each run; none knows how many follow it

    def another(settings: Settings, at: Array) -> ContactMotion:
        nonlocal part
        part /= 2
        share = _share(request.progress, 1 - 2 * part, part)
        # The pilot runs are coarse, and go on whatever they find.
        window = request.fault_window if settings.stop_at_fault else None
        return run(build(scene, settings), at, share, window)

    return reach(scene, times, accuracy, another)


def _share(progress: Progress | None, done: float, part: float) -> Progress | None:
    """Progress of a run that is a part of the whole."""
    return None if progress is None else lambda fraction: progress(done + part * fraction)
