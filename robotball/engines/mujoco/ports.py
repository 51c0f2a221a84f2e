"""MJX and MuJoCo Warp as engines, which step MuJoCo's models with JAX or Warp.

JAX steps in double precision, and Warp in single precision. The shell's state is read from MuJoCo's
coordinates, without sensors.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np

from robotball.engines import adapter
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, ModelHinge, build, controls_at
from robotball.engines.mujoco.settings import CONSTANT, NAIVE, PRESETS, Settings, for_slip
from robotball.engines.states import State, force_in, start_states
from robotball.motion import Label
from robotball.robot.motors import Servo
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix

# Value for friction in single precision, if the ball slips. On classical_regular with a friction of
# 0.3 the path error is 2e-4 with 1e4, 5e-3 with 1e6, and 0.14 with the value for double precision.
_SINGLE_IMPRATIO = 1e4
_PASSES = 50  # the largest number of steps per call, whose controls have a fixed size


@dataclass(frozen=True, kw_only=True)
class _ModelSettings(adapter.StepSettings):
    """Settings of a run; `model` has MuJoCo's settings, `device` is "cpu" or "cuda"."""

    model: Settings
    device: str = "cpu"
    line_search: int | None = None  # iterations of MJX at most
    slips: bool = False  # use the recipe for a ball that slips, with the servos of `model`


def _built(scene: Scene, settings: _ModelSettings, step: float) -> Model:
    model = replace(settings.model, timestep=step)
    if settings.slips:
        law, drive = for_slip(scene, model, step), model.drive
        single = isinstance(drive, Servo)
        model = replace(law, drive=drive, impratio=_SINGLE_IMPRATIO) if single else law
    return build(scene, model, sensed=False)


class _MjxWorld(adapter.World):
    """One ball, or a ball for each scene, stepped in a compiled loop."""

    def __init__(
        self, scene: Scene, settings: _ModelSettings, step: float, scenes: Sequence[Scene] = ()
    ) -> None:
        super().__init__(scene)
        self.advance = _advance(bool(scenes))
        import jax
        from mujoco import mjx

        self.built = _built(scene, settings, step)
        start, model = self.built.start_data(), self.built.compiled
        self.friction = model.pair_friction[0, 0]
        if settings.line_search is not None:
            model.opt.ls_iterations = settings.line_search
        cuda = jax.default_backend() == "gpu"
        name = adapter.on_device(self, settings.device, cuda, install="jax[cuda13]")
        device = jax.devices(name)[0]
        self.model = mjx.put_model(model, device)
        self.data, self.calls = mjx.put_data(model, start, device), 0
        if scenes:
            n, (qpos, qvel) = len(scenes), _coordinates(self.built, scenes)
            many = jax.tree.map(lambda x: jax.numpy.broadcast_to(x, (n, *x.shape)), self.data)
            self.data = jax.device_put(many.replace(qpos=qpos, qvel=qvel), device)
        for _ in range(2):  # compiles for both the initial types and those after a step
            self._take(0.0, step, 0)

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        for begin, length, count, sample in self.stretches(times, timestep):
            for done in range(0, count, _PASSES):
                self._take(begin + done * length, length, min(_PASSES, count - done))
                self.calls += 1
            if sample is not None:
                self.data.qpos.block_until_ready()  # so that its work does not count as reading
                yield self._state

    def _take(self, begin: float, step: float, count: int) -> None:
        """Take `count` steps from `begin` [s], with the controls at the middle of each step."""
        # If a control is held over a step at its middle value, the order is 2, like that of MJX's
        # RK4.
        middles = (begin + (np.arange(_PASSES) + 0.5) * step).tolist()
        controls = np.array([controls_at(self.scene, self.built.hinges, t) for t in middles])
        self.data = self.advance(self.model, self.data, controls, step, count)

    def _state(self) -> State:
        return shell_state(self.built, np.asarray(self.data.qpos), np.asarray(self.data.qvel))

    def force(self) -> Array:
        # The contact is the only constraint on the free shell. mj_contactForce needs MJX's copy of
        # the contact, which has no adhesion (docs/findings/mjx_contact_force.py).
        return np.asarray(self.data.qfrc_constraint, dtype=float)[:3]

    def python_seconds(self) -> float:
        """Return the processor time [s] of the calls, measured on empty calls."""
        return adapter.seconds_per_call(lambda: self._take(0.0, self.longest, 0)) * self.calls


def shell_state(model: Model, qpos: Array, qvel: Array) -> State:
    """Return the state for MuJoCo's coordinates (…, nq) and (…, nv), with the shell as root."""
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
    """Return qpos (n, nq) and qvel (n, nv) at the starts of scenes, with the shell as root."""
    now, places = start_states(scenes), [hinge.index for hinge in model.hinges]
    turning = np.einsum("nij,ni->nj", rotation_matrix(now.attitude), now.omega)
    qpos = np.concatenate([now.centre, now.attitude, now.angles[:, places]], axis=1)
    return qpos, np.concatenate([now.velocity, turning, now.rates[:, places]], axis=1)


@cache
def _advance(many: bool) -> Callable[..., Any]:
    """Return the compiled loop, which takes model, data, controls, step [s] and count."""
    import jax

    from robotball.theory.compiled import cache_folder

    # Compiling takes 20 s, and each run of a comparison is in another process.
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


# MJX has no noslip. A harder contact does not need noslip, but a contact that is too hard gives
# NaN: this happens with a softness of 1e-6, but not with 1e-2 (docs/findings/mjx_nan.py).
_HARD = replace(
    PRESETS["balanced"], **CONSTANT | {"solver": "Newton", "softness": 1e-2},
    noslip_iterations=None, noslip_tolerance=None, ls_tolerance=None,
)  # fmt: skip
_LOOSE: dict[str, Any] = {"error_tolerance": 1e-2, "stop_at_fault": False}
_BEST = _ModelSettings(
    name="best", error_tolerance=1e-4, stop_at_fault=False, timestep=5e-3, model=_HARD,
    line_search=5,
)  # fmt: skip

MJX = adapter.Adapter(
    label=Label(
        "MJX", f"{adapter.version_of('mujoco-mjx')} on {LABEL.name} {LABEL.version}", "#DDAA33", "<"
    ),
    packages=("mujoco.mjx", "jax"),
    extra="mjx",
    presets=adapter.by_name(
        _ModelSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE),
        _BEST,
        replace(_BEST, name="slip", timestep=1e-3, slips=True, line_search=None),
    ),
    world=_MjxWorld,
    rolls_unbalanced=True,
    resists_spin=True,
)


class _WarpWorld(adapter.CapturedWorld):
    """One ball, or a ball for each scene, on a device of Warp."""

    def __init__(
        self, scene: Scene, settings: _ModelSettings, step: float, scenes: Sequence[Scene] = ()
    ) -> None:
        super().__init__(scene, settings.device)
        import mujoco_warp

        self.engine = mujoco_warp
        self.built = _built(scene, settings, step)
        start, self.friction = self.built.start_data(), self.built.compiled.pair_friction[0, 0]
        # Warp lacks this flag, and does not reset states.
        self.built.compiled.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.built.compiled.flg_surfacevel = scene.plane_turns  # also if it starts from rest
        self.n = len(scenes) or 1
        with self.warp.ScopedDevice(self.device):
            self.model = mujoco_warp.put_model(self.built.compiled)
            self.data = mujoco_warp.put_data(self.built.compiled, start, self.n)
            self.take(step)  # compiles
            self.data = mujoco_warp.put_data(self.built.compiled, start, self.n)
            if scenes:
                qpos, qvel = _coordinates(self.built, scenes)
                self.data.qpos.assign(qpos.astype(np.float32))
                self.data.qvel.assign(qvel.astype(np.float32))
        self.launch_of(step)

    def set_gravity(self, gravity: Array) -> None:
        self.model.opt.gravity.assign(gravity[None].astype(np.float32))

    def set_turn(self, rate: float) -> None:
        surfaces = self.built.compiled.geom_surfacevel
        surfaces[self.built.compiled.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, 5] = rate
        self.model.geom_surfacevel.assign(surfaces[None].astype(np.float32))

    def control(self, t: float, step: float) -> None:
        controls = [self._control(hinge, t + step / 2) for hinge in self.built.hinges]
        self.data.ctrl.assign(np.array([controls] * self.n, dtype=np.float32))

    def _control(self, hinge: ModelHinge, t: float) -> float:
        """Return a hinge's control, which for a servo compensates the lag of its armature."""
        servo = hinge.actuation
        if not isinstance(servo, Servo):
            return hinge.control(t)
        return hinge.control(t) + servo.armature / servo.gain * hinge.command.acceleration(t)

    def take(self, step: float) -> None:
        self.engine.step(self.model, self.data)

    def state(self) -> State:
        qpos, qvel = self.data.qpos.numpy(), self.data.qvel.numpy()
        return shell_state(self.built, qpos.astype(float), qvel.astype(float))

    def force(self) -> Array:
        data = mujoco.MjData(self.built.compiled)
        self.engine.get_data_into(data, self.built.compiled, self.data)
        return force_in(self.built.compiled, data)


# The recipe's impedance and armature fail in single precision. With the largest armature that
# works, 1e4 kg m², loads change the rates by 3e-4. A servo with a rate of 33 1/s corrects this; a
# faster servo would follow the steps of the held commands.
_SINGLE = replace(
    PRESETS["balanced"], solver="Newton", solimp=(0.99, 0.99, 0.001, 0.5, 1.0),
    drive=Servo(gain=1e6, armature=3e4), warmstart=None, island=None,
)  # fmt: skip


def _lacks(scene: Scene, settings: _ModelSettings) -> str:
    # A run in MuJoCo adds this term in a callback (`Control._follow`).
    turning = "its contact lacks the acceleration of a turning plane" if scene.plane_turns else None
    single = adapter.in_single_precision(scene, settings)
    return "; ".join(filter(None, (single, turning)))


WARP = adapter.Adapter(
    label=Label("MuJoCo Warp", adapter.version_of("mujoco-warp"), "#76B900", ">"),
    packages=("mujoco_warp",),
    extra="mujoco-warp",
    presets=adapter.by_name(
        _ModelSettings(name="as-it-comes", timestep=2e-3, model=NAIVE, **_LOOSE),
        _ModelSettings(name="best", timestep=20e-3, model=_SINGLE, **_LOOSE),
        _ModelSettings(name="slip", timestep=1e-3, model=_SINGLE, slips=True, **_LOOSE),
    ),
    world=_WarpWorld,
    moves_plane=True,
    rolls_unbalanced=True,
    resists_spin=True,
    lacks=_lacks,
)
