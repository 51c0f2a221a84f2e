"""MJX and MuJoCo Warp as engines: MuJoCo's models stepped by JAX, or by Warp, on the processor.

JAX steps in double precision, Warp in single. Neither reads sensors: the shell's state is taken
from MuJoCo's coordinates.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np

from robotball.engines.adapter import (
    IDLE_STEPS,
    Adapter,
    SteppedWorld,
    StepSettings,
    World,
    by_name,
    version_of,
)
from robotball.engines.links import State, lifting
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, ModelHinge, build, controls_at
from robotball.engines.mujoco.settings import CONSTANT, NAIVE, PRESETS, Settings
from robotball.motion import Label
from robotball.motors import Servo
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene

_PASSES = 50  # of the loop at most in one call, whose controls are an array of fixed size


@dataclass(frozen=True, kw_only=True)
class ModelSettings(StepSettings):
    """Settings of a run of MuJoCo's model: MuJoCo's own, for the model and its options."""

    model: Settings


@dataclass(frozen=True, kw_only=True)
class _MjxSettings(ModelSettings):
    """Settings of an MJX run.

    line_search: the iterations of its line search at most; None leaves MuJoCo's.
    """

    line_search: int | None = None


class _MjxWorld(World):
    """One world, whose steps are the passes of a compiled loop."""

    def __init__(self, scene: Scene, settings: _MjxSettings, step: float) -> None:
        super().__init__(scene)
        self.advance = _advance()
        from mujoco import mjx

        self.built = build(scene, replace(settings.model, timestep=step))
        start, model = self.built.start_data(), self.built.compiled
        self.friction = model.pair_friction[0, 0]
        # Nothing reads the sensors, and every stage of RK4 would be compiled with them.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        if settings.line_search is not None:
            model.opt.ls_iterations = settings.line_search
        self.model, self.data, self.calls = mjx.put_model(model), mjx.put_data(model, start), 0
        for _ in range(2):  # compiles; the data of the second have the types that a step gives
            self._take(0.0, step, 0)

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        for begin, length, count, sample in self.stretches(times, timestep):
            for done in range(0, count, _PASSES):
                self._take(begin + done * length, length, min(_PASSES, count - done))
                self.calls += 1
            if sample is not None:
                self.data.qpos.block_until_ready()  # or its work would count as our reading
                yield self._state

    def _take(self, begin: float, step: float, count: int) -> None:
        """Take `count` steps from `begin` [s], with the controls at the middle of each."""
        # Held over a step, the middle's control keeps order 2, which is all that MJX's RK4 has.
        middles = (begin + (np.arange(_PASSES) + 0.5) * step).tolist()
        controls = np.array([controls_at(self.scene, self.built.hinges, t) for t in middles])
        self.data = self.advance(self.model, self.data, controls, step, count)

    def _state(self) -> State:
        qpos, qvel = np.asarray(self.data.qpos), np.asarray(self.data.qvel)
        if not (np.isfinite(qpos).all() and np.isfinite(qvel).all()):
            return replace(self.now, centre=np.full(3, np.nan))
        return shell_state(self.built, qpos, qvel)

    def force(self) -> Array:
        from mujoco import mjx

        return _force(self.built.compiled, mjx.get_data(self.built.compiled, self.data))

    def python_seconds(self) -> float:
        """Return the processor time [s] of the calls themselves, measured on empty ones."""
        count = min(IDLE_STEPS, self.calls)
        began = time.process_time()
        for _ in range(count):
            self._take(0.0, self.longest, 0)
        return (time.process_time() - began) / count * self.calls


def shell_state(model: Model, qpos: Array, qvel: Array) -> State:
    """Return the state of MuJoCo's coordinates, with the shell as the root."""
    count, places = len(model.scene.drives), [hinge.index for hinge in model.hinges]
    angles, rates = np.zeros(count), np.zeros(count)
    angles[places], rates[places] = qpos[7:], qvel[6:]
    attitude = qpos[3:7] / np.linalg.norm(qpos[3:7])
    return State(qpos[:3], qvel[:3], attitude, rotation_matrix(attitude) @ qvel[3:6], angles, rates)


def _force(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the force (3,) [N] of the contact, if there is one, by what a port has computed."""
    wrench, frame = np.zeros(6), data.contact.frame.reshape(-1, 3, 3)
    if data.ncon:
        mujoco.mj_contactForce(model, data, 0, wrench)
    return lifting(wrench[:3] @ each for each in frame[:1])


@cache
def _advance() -> Callable[..., Any]:
    """Return the compiled loop: model, data, controls (PASSES, nu), step [s], count → data."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from mujoco import mjx

    def advance(model: Any, data: Any, controls: Any, step: float, count: int) -> Any:
        model = model.tree_replace({"opt.timestep": step})

        def taken(i: int, now: Any) -> Any:
            after = mjx.step(model, now.replace(ctrl=controls[i]))
            return jax.tree.map(lambda new, old: new.astype(old.dtype), after, now)

        return jax.lax.fori_loop(0, count, taken, data)

    return jax.jit(advance)


# MJX has no noslip. A harder contact needs none; where friction is so hard that a step of Newton
# ends on the cone's axis, the line search of MJX takes the root of a negative number: softness
# 1e-6 gives NaN, and 1e-2 does not.
_HARD = replace(
    PRESETS["balanced"],
    **CONSTANT | {"solver": "Newton", "softness": 1e-2},
    noslip_iterations=None,
    noslip_tolerance=None,
    ls_tolerance=None,
)
_LOOSE: dict[str, Any] = {"error_tolerance": 1e-2, "stop_at_fault": False}
_BEST = _MjxSettings(
    name="best", error_tolerance=1e-4, stop_at_fault=False, timestep=5e-3, model=_HARD,
    line_search=5,
)  # fmt: skip

MJX = Adapter(
    label=Label("MJX", f"{version_of('mujoco-mjx')} on {LABEL.name} {LABEL.version}", "#DDAA33"),
    packages=("mujoco.mjx", "jax"),  # MJX is a part of MuJoCo's package, and needs JAX
    extra="mjx",
    ladders={"as-it-comes": ("timestep", (2e-3,)), "best": ("timestep", (20e-3, 10e-3, 5e-3))},
    presets=by_name(_MjxSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE), _BEST),
    world=_MjxWorld,
)


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
        start, self.friction = self.built.start_data(), self.built.compiled.pair_friction[0, 0]
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

    def force(self) -> Array:
        data = mujoco.MjData(self.built.compiled)
        self.engine.get_data_into(data, self.built.compiled, self.data)
        return _force(self.built.compiled, data)


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


def _in_single_precision(scene: Scene, settings: ModelSettings) -> str:
    return "its state is in single precision"


WARP = Adapter(
    label=Label("MuJoCo Warp", version_of("mujoco-warp"), "#76B900"),
    packages=("mujoco_warp",),
    extra="mujoco-warp",
    ladders={"best": ("timestep", (20e-3, 10e-3))},
    presets=by_name(
        ModelSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE),
        ModelSettings(name="best", timestep=20e-3, model=_SINGLE, **_LOOSE),
    ),
    world=_WarpWorld,
    lacks=_in_single_precision,
)
