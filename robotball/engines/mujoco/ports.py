"""MJX and MuJoCo Warp as engines: MuJoCo's models stepped by JAX, or by Warp, on the processor.

JAX steps in double precision, Warp in single. Neither reads sensors: the shell's state is taken
from MuJoCo's coordinates.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np

from robotball.engines import adapter
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, ModelHinge, build, controls_at, start_state
from robotball.engines.mujoco.settings import CONSTANT, NAIVE, PRESETS, Settings
from robotball.engines.states import State, force_in
from robotball.motion import Label
from robotball.robot.motors import Servo
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix

_PASSES = 50  # of the loop at most in one call, whose controls are an array of fixed size


@dataclass(frozen=True, kw_only=True)
class _ModelSettings(adapter.StepSettings):
    """Settings of a run of MuJoCo's model: MuJoCo's own, for the model and its options.

    device: "cpu" or "cuda", where the balls are stepped.
    """

    model: Settings
    device: str = "cpu"


@dataclass(frozen=True, kw_only=True)
class _MjxSettings(_ModelSettings):
    """Settings of an MJX run.

    line_search: the iterations of its line search at most; None leaves MuJoCo's.
    """

    line_search: int | None = None


class _MjxWorld(adapter.World):
    """Worlds abreast, one unless scenes are given; steps are the passes of a compiled loop."""

    def __init__(
        self, scene: Scene, settings: _MjxSettings, step: float, scenes: Sequence[Scene] = ()
    ) -> None:
        super().__init__(scene)
        self.advance = _advance(bool(scenes))
        import jax
        from mujoco import mjx

        self.built = build(scene, replace(settings.model, timestep=step))
        start, model = self.built.start_data(), self.built.compiled
        self.friction = model.pair_friction[0, 0]
        # Nothing reads the sensors, and every stage of RK4 would be compiled with them.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        if settings.line_search is not None:
            model.opt.ls_iterations = settings.line_search
        cuda = jax.default_backend() == "gpu"
        device = jax.devices(adapter.on_device(self, settings.device, cuda))[0]
        self.model = mjx.put_model(model, device)
        self.data, self.calls = mjx.put_data(model, start, device), 0
        if scenes:
            n, (qpos, qvel) = len(scenes), _coordinates(self.built, scenes)
            many = jax.tree.map(lambda x: jax.numpy.broadcast_to(x, (n, *x.shape)), self.data)
            self.data = jax.device_put(many.replace(qpos=qpos, qvel=qvel), device)
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
        return shell_state(self.built, np.asarray(self.data.qpos), np.asarray(self.data.qvel))

    def force(self) -> Array:
        # On the free shell nothing else acts by a constraint. mj_contactForce would need MJX's copy
        # of the contact, which has no adhesion (docs/findings/mjx_contact_force.py).
        return np.asarray(self.data.qfrc_constraint, dtype=float)[:3]

    def python_seconds(self) -> float:
        """Return the processor time [s] of the calls themselves, measured on empty ones."""
        return adapter.seconds_per_call(lambda: self._take(0.0, self.longest, 0)) * self.calls


def shell_state(model: Model, qpos: Array, qvel: Array) -> State:
    """Return the state of MuJoCo's coordinates (…, nq) and (…, nv), with the shell as the root."""
    places = [hinge.index for hinge in model.hinges]
    angles, rates = np.zeros((2, *qpos.shape[:-1], len(model.scene.drives)))
    angles[..., places], rates[..., places] = qpos[..., 7:], qvel[..., 6:]
    broken = ~np.isfinite(np.concatenate([qpos, qvel], axis=-1)).all(axis=-1, keepdims=True)
    attitude = np.where(broken, [1.0, 0.0, 0.0, 0.0], qpos[..., 3:7])
    attitude /= np.linalg.norm(attitude, axis=-1, keepdims=True)
    turning = np.einsum("...ij,...j->...i", rotation_matrix(attitude), qvel[..., 3:6])
    centre = np.where(broken, np.nan, qpos[..., :3])
    return State(centre, qvel[..., :3], attitude, turning, angles, rates)


def _coordinates(model: Model, scenes: Sequence[Scene]) -> tuple[Array, Array]:
    """Return qpos (n, nq) and qvel (n, nv) at the starts of scenes."""
    root, hinges = model.settings.root, model.hinges
    qpos, qvel = zip(*(start_state(s, root, hinges) for s in scenes), strict=True)
    return np.array(qpos), np.array(qvel)


@cache
def _advance(many: bool) -> Callable[..., Any]:
    """Return the compiled loop: model, data, controls (_PASSES, nu), step [s], count → data."""
    import jax

    from robotball.theory.compiled import cache_folder

    # The loop takes 20 s to compile, and each run of a comparison has a process of its own.
    folder = cache_folder()
    for name, value in {
        "enable_x64": True, "compilation_cache_dir": folder and str(folder / "jax"),
        "persistent_cache_min_compile_time_secs": 1.0,
    }.items():  # fmt: skip
        jax.config.update(f"jax_{name}", value)
    from mujoco import mjx

    one_step = jax.vmap(mjx.step, in_axes=(None, 0)) if many else mjx.step

    def advance(model: Any, data: Any, controls: Any, step: float, count: int) -> Any:
        model = model.tree_replace({"opt.timestep": step})

        def taken(i: int, now: Any) -> Any:
            control = jax.numpy.broadcast_to(controls[i], now.ctrl.shape)
            after = one_step(model, now.replace(ctrl=control))
            return jax.tree.map(lambda new, old: new.astype(old.dtype), after, now)

        return jax.lax.fori_loop(0, count, taken, data)

    return jax.jit(advance)


# MJX has no noslip. A harder contact needs none; one that is too hard gives NaN, as a softness of
# 1e-6 does and 1e-2 does not (docs/findings/mjx_nan.py).
_HARD = replace(
    PRESETS["balanced"], **CONSTANT | {"solver": "Newton", "softness": 1e-2},
    noslip_iterations=None, noslip_tolerance=None, ls_tolerance=None,
)  # fmt: skip
_LOOSE: dict[str, Any] = {"error_tolerance": 1e-2, "stop_at_fault": False}
_BEST = _MjxSettings(
    name="best", error_tolerance=1e-4, stop_at_fault=False, timestep=5e-3, model=_HARD,
    line_search=5,
)  # fmt: skip

MJX = adapter.Adapter(
    label=Label(
        "MJX", f"{adapter.version_of('mujoco-mjx')} on {LABEL.name} {LABEL.version}", "#DDAA33", "<"
    ),
    packages=("mujoco.mjx", "jax"),  # MJX is a part of MuJoCo's package, and needs JAX
    extra="mjx",
    presets=adapter.by_name(
        _MjxSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE), _BEST
    ),
    world=_MjxWorld,
)


class _WarpWorld(adapter.SteppedWorld):
    """Worlds abreast, one unless scenes are given, on one of Warp's devices."""

    def __init__(
        self, scene: Scene, settings: _ModelSettings, step: float, scenes: Sequence[Scene] = ()
    ) -> None:
        super().__init__(scene)
        import mujoco_warp
        import warp

        warp.config.log_level = warp.LOG_WARNING
        warp.init()
        self.warp, self.engine = warp, mujoco_warp
        self.built = build(scene, replace(settings.model, timestep=step))
        start, self.friction = self.built.start_data(), self.built.compiled.pair_friction[0, 0]
        # Warp has no such flag, and resets nothing.
        self.built.compiled.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.device = adapter.on_device(self, settings.device, warp.is_cuda_available())
        self.n = len(scenes) or 1
        with warp.ScopedDevice(self.device):
            self.model = mujoco_warp.put_model(self.built.compiled)
            self.data = mujoco_warp.put_data(self.built.compiled, start, self.n)
            mujoco_warp.step(self.model, self.data)  # compiles; not of the run
            self.data = mujoco_warp.put_data(self.built.compiled, start, self.n)
            if scenes:
                qpos, qvel = _coordinates(self.built, scenes)
                self.data.qpos.assign(qpos.astype(np.float32))
                self.data.qvel.assign(qvel.astype(np.float32))

    def control(self, t: float, step: float) -> None:
        controls = [self._control(hinge, t + step / 2) for hinge in self.built.hinges]
        self.data.ctrl.assign(np.array([controls] * self.n, dtype=np.float32))

    def _control(self, hinge: ModelHinge, t: float) -> float:
        """Return a hinge's control; a servo's also turns its own armature, or it would lag."""
        servo = hinge.actuation
        if not isinstance(servo, Servo):
            return hinge.control(t)
        return hinge.control(t) + servo.armature / servo.gain * hinge.command.acceleration(t)

    def step(self, step: float) -> None:
        with self.warp.ScopedDevice(self.device):
            self.engine.step(self.model, self.data)

    def wait(self) -> None:
        self.warp.synchronize_device(self.device)

    def state(self) -> State:
        qpos, qvel = (each.numpy().astype(float) for each in (self.data.qpos, self.data.qvel))
        return shell_state(self.built, qpos, qvel)

    def force(self) -> Array:
        data = mujoco.MjData(self.built.compiled)
        self.engine.get_data_into(data, self.built.compiled, self.data)
        return force_in(self.built.compiled, data)


# Single precision has no room for the recipe's impedance and armature: they break it. What armature
# it bears gives way to the load, 1e4 kg m² by 3e-4 of the rates. A servo takes that back, at 33 /s:
# commands stand still for a step, and a faster servo would follow the stairs.
_SINGLE = replace(
    PRESETS["balanced"], solver="Newton", solimp=(0.99, 0.99, 0.001, 0.5, 1.0),
    drive=Servo(gain=1e6, armature=3e4), warmstart=None, island=None,
)  # fmt: skip


WARP = adapter.Adapter(
    label=Label("MuJoCo Warp", adapter.version_of("mujoco-warp"), "#76B900", ">"),
    packages=("mujoco_warp",),
    extra="mujoco-warp",
    presets=adapter.by_name(
        _ModelSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE),
        _ModelSettings(name="best", timestep=20e-3, model=_SINGLE, **_LOOSE),
    ),
    world=_WarpWorld,
    lacks=adapter.in_single_precision,
)
