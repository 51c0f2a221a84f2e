"""MuJoCo Warp as an engine: MuJoCo's models stepped by Warp on the processor, in 32 bits."""

from dataclasses import replace

import mujoco
import numpy as np

from robotball.engines.adapter import Adapter, SteppedWorld, by_name, version_of
from robotball.engines.links import State
from robotball.engines.mujoco.mjx import ModelSettings, shell_state
from robotball.engines.mujoco.model import ModelHinge, build
from robotball.engines.mujoco.settings import NAIVE, PRESETS
from robotball.motion import Label
from robotball.motors import Servo
from robotball.scene import Scene


class _WarpWorld(SteppedWorld):
    """One world on Warp's processor device."""

    def __init__(self, scene: Scene, settings: ModelSettings, step: float) -> None:
        super().__init__(scene)
        import mujoco_warp
        import warp

        warp.config.quiet = True
        warp.init()
        self.warp, self.engine = warp, mujoco_warp
        self.built = build(scene, replace(settings.model, timestep=step))
        start = self.built.start_data()
        # Warp has no such flag, and resets nothing.
        self.built.compiled.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        with warp.ScopedDevice("cpu"):
            self.model = mujoco_warp.put_model(self.built.compiled)
            self.data = mujoco_warp.put_data(self.built.compiled, start)
            mujoco_warp.step(self.model, self.data)  # compiles; not of the run
            self.data = mujoco_warp.put_data(self.built.compiled, start)

    def control(self, t: float, step: float) -> None:
        controls = [self._control(hinge, t + step / 2) for hinge in self.built.hinges]
        self.data.ctrl.assign(np.array([controls], dtype=np.float32))

    def _control(self, hinge: ModelHinge, t: float) -> float:
        """Return a hinge's control; a servo's also turns its own armature, or it would lag."""
        servo = hinge.actuation
        if not isinstance(servo, Servo):
            return hinge.control(t)
        return hinge.control(t) + servo.armature / servo.gain * hinge.drive.acceleration(t)

    def step(self, step: float) -> None:
        with self.warp.ScopedDevice("cpu"):
            self.engine.step(self.model, self.data)

    def state(self) -> State:
        qpos, qvel = (each.numpy()[0].astype(float) for each in (self.data.qpos, self.data.qvel))
        return shell_state(self.built, qpos, qvel)


# Single precision has no room for the recipe's impedance and armature: they break it. What armature
# it bears gives way to the load, 1e4 kg m² by 3e-4 of the rates. A servo takes that back, at 33 /s:
# commands stand still for a step, and a faster servo would follow the stairs.
_SINGLE = replace(
    PRESETS["balanced"],
    solver="Newton",
    solimp=(0.99, 0.99, 0.001, 0.5, 1.0),
    drive=Servo(gain=1e6, armature=3e4),
    warmstart=None,
    island=None,
)
_AS_IT_COMES = ModelSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=2e-3, model=NAIVE
)
_BEST = ModelSettings(
    name="best", error_tolerance=1e-2, stop_at_fault=False, timestep=20e-3, model=_SINGLE
)


def _lacks(scene: Scene, settings: ModelSettings) -> str:
    return "its state is in single precision"


WARP = Adapter(
    label=Label("MuJoCo Warp", version_of("mujoco-warp"), "#76B900"),
    packages=("mujoco_warp",),
    extra="mujoco-warp",
    ladders={"best": ("timestep", (20e-3, 10e-3))},
    presets=by_name(_AS_IT_COMES, _BEST),
    world=_WarpWorld,
    lacks=_lacks,
)
