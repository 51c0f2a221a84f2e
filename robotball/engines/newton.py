"""Newton: a model from its builder, stepped with its MuJoCo solver.

Model and states have single precision. One ball is stepped with MuJoCo in double precision. Many
balls are stepped side by side with MuJoCo Warp, in single precision.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_in, links_of, start_states
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix

_TIME_CONSTANT = 0.04  # s, of the contact, if its impedance is set
_SLIP_IMPEDANCE = 0.2  # 1/s, impedance / timestep of the contact for a ball that slips
_SERVO = {"target_kd": 1.0, "armature": 0.01}  # N m s/rad and kg m², in preset as-it-comes
# The largest values for Warp in single precision: with 0.9999 or 1e12 kg m² the ball is thrown off
# the plane.
_WARP_CAPS = {"impedance": 0.99, "armature": 1e6}


@dataclass(frozen=True, kw_only=True)
class _NewtonSettings(adapter.StepSettings):
    """Settings of a Newton run; the first four are the solver's."""

    integrator: str | None = None
    cone: str | None = None
    iterations: int | None = None
    tolerance: float | None = None
    friction: float | None = None  # of ball and plane
    torsional: float | None = None  # m, against spin, if the impedance is set; default: a radius
    armature: float | None = None  # kg m², reflected inertia of the hinges, in place of servos
    impedance: float | None = None  # of the contact; slip then decays slowly
    noslip: int | None = None  # iterations of the solver's noslip pass
    slips: bool = False  # use the contact for a ball that slips, not impedance and armature
    kept: bool = False  # keep the state in the solver, in double precision; deprecated by Newton
    device: str | None = None  # "cpu" or "cuda": step with Warp; None: one ball with MuJoCo


class _NewtonWorld(adapter.CapturedWorld):
    """Balls side by side, each in its own world with Warp; or one ball with MuJoCo."""

    any_step = True

    def __init__(
        self, scene: Scene, settings: _NewtonSettings, step: float, scenes: Sequence[Scene] = ()
    ) -> None:
        super().__init__(scene, settings.device or "cpu")
        import newton

        if settings.device is not None:
            caps = {n: min(v, cap) for n, cap in _WARP_CAPS.items() if (v := getattr(settings, n))}
            settings = replace(settings, **caps)
        impratio, constant, self.length = None, _TIME_CONSTANT, step
        if settings.slips:  # a critically damped spring, which MuJoCo's cone hardly pushes
            soft = min(_SLIP_IMPEDANCE * step, 1e-3)
            impratio, constant = 1e6 / soft, step
            # A larger armature or tolerance stops the solver too early.
            armature = 1e10 * scene.ball.mass * scene.ball.radius**2
            settings = replace(settings, impedance=soft, armature=armature)
        self.settings, d = settings, settings.impedance
        # The depth at which the contact carries the ball from the start.
        self.depth = scene.gravity * (1 - d) * constant**2 if d is not None else 0.0
        self.starts = start_states(scenes or [scene])
        options = ("integrator", "cone", "iterations", "tolerance")
        given = {name: getattr(settings, name) for name in options}
        chosen = adapter.without_none(impratio=impratio, **given)
        if settings.kept:
            chosen["update_data_interval"] = 0
        alone = settings.device is None
        self.captures = not alone  # MuJoCo's own steps are not Warp's
        with self.warp.ScopedDevice(self.device):
            model = self._model(newton)
            self.solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=alone, **chosen)
            self.balls, self.controls = model.state(), model.control()
        # Newton does not pass noslip on: set it in the solver's model.
        if settings.noslip is not None:
            made = self.solver.mj_model if alone else self.solver.mjw_model
            made.opt.noslip_iterations = settings.noslip
        if alone:
            # Set MuJoCo's data in double precision. With `kept`, the solver never reads Newton's
            # state.
            now, data = self.now, self.solver.mj_data
            omega = rotation_matrix(now.attitude).T @ now.omega  # in the shell's axes
            data.qpos[:] = [*self._position(now), *now.attitude, *now.angles]
            data.qvel[:] = [*now.velocity, *omega, *now.rates]
        self._push(self.now.rates, np.zeros(len(scene.drives)))
        if self.captures:
            self.launch_of(step)

    def _position(self, state: State) -> Array:
        """Return the initial centre of the shell (3,) [m], pressed into the plane."""
        return state.centre - [0.0, 0.0, self.depth]

    def _model(self, newton: Any) -> Any:
        """Return Newton's model of the balls at their initial states, one world for each ball."""
        wp, scene, settings = self.warp, self.scene, self.settings
        gravity = wp.vec3(*scene.gravity_at(0.0))
        ball, whole = (newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=gravity) for _ in "12")
        for builder in (ball, whole):
            newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        material = ball.default_shape_cfg.copy()
        material.density = 0.0
        if settings.friction is not None:
            material.mu = settings.friction
        self.friction = material.mu
        motor: dict[str, Any] = {"armature": settings.armature}
        if settings.armature is None:
            motor = {**_SERVO, "actuator_mode": newton.JointTargetMode.VELOCITY}
        bodies: dict[str, int] = {}
        joints: list[int] = []
        for link in links_of(scene):
            body = ball.add_link(
                mass=link.mass, com=wp.vec3(*link.centre), lock_inertia=True,
                inertia=wp.mat33(*link.inertia.ravel()), label=link.name,
            )  # fmt: skip
            if not link.parent:
                joint = ball.add_joint_free(child=body)
                sphere = ball.add_shape_sphere(body, radius=scene.ball.radius, cfg=material)
            else:
                place = wp.transform(wp.vec3(*link.pivot), wp.quat_identity())
                joint = ball.add_joint_revolute(
                    bodies[link.parent], body, axis=wp.vec3(*link.axis), parent_xform=place, **motor
                )
            bodies[link.name] = body
            joints.append(joint)
        ball.add_articulation(joints)
        plane = ball.add_ground_plane(cfg=material)
        if settings.impedance is not None and settings.friction is not None:
            mu, d, spin = settings.friction, settings.impedance, settings.torsional
            spin = mu * scene.ball.radius if spin is None else spin
            pair = {
                "geom1": plane, "geom2": sphere, "condim": 4 if scene.rolling == "rubber" else 3,
                "friction": [mu, mu, spin, 0.0, 0.0],
                "solref": [_TIME_CONSTANT, 1.0], "solreffriction": [-1.0, -0.5],
                "solimp": [d, d, 1e-3, 0.5, 1.0],
            }  # fmt: skip
            if settings.slips:
                pair["solref"] = [-1 / self.length**2, -2 / self.length]
                pair["solreffriction"] = [-1.0, -2.5 * d / self.length]
            ball.add_custom_values(**{f"mujoco:pair_{name}": pair[name] for name in pair})
        starts, self.n = self.starts, len(self.starts.centre)
        whole.replicate(ball, self.n)
        q = (self._position(starts), np.roll(starts.attitude, -1, axis=1), starts.angles)
        v = (starts.velocity, starts.omega, starts.rates)
        whole.joint_q, whole.joint_qd = (np.hstack(parts).ravel().tolist() for parts in (q, v))
        return whole.finalize()

    def _push(self, rates: Array, accelerations: Array) -> None:
        armature, free = self.settings.armature, np.zeros(6)
        if armature is None:
            target, values = self.controls.joint_target_qd, rates
        else:
            target, values = self.controls.joint_f, armature * accelerations
        of_ball = np.concatenate([free, values]).astype(np.float32)
        target.assign(np.tile(of_ball, self.n))

    def control(self, t: float, step: float) -> None:
        # The velocities of a step are those at its end, so the servo's target is the rate at the
        # end. A torque is constant over the step; the midpoint value keeps second order.
        middle = [drive.acceleration(t + step / 2) for drive in self.scene.drives]
        self._push(self.hinges_at(t + step)[1], np.array(middle, float))

    def take(self, step: float) -> None:
        self.solver.step(self.balls, self.balls, self.controls, None, step)

    def state(self) -> State:
        now, n = self.balls, self.n
        q, v = (a.numpy().astype(float).reshape(n, -1) for a in (now.joint_q, now.joint_qd))
        attitude = np.roll(q[:, 3:7], 1, axis=1)
        # Rounding to single precision leaves a quaternion whose norm is not 1.
        attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
        return State(q[:, :3], v[:, :3], attitude, v[:, 3:6], q[:, 7:], v[:, 6:])

    def force(self) -> Array:
        model, data = self.solver.mj_model, self.solver.mj_data
        if self.settings.device is not None:
            import mujoco_warp

            mujoco_warp.get_data_into(data, model, self.solver.mjw_data)
        return force_in(model, data)


_AS_IT_COMES = _NewtonSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-3
)
# The settings for MuJoCo, as far as Newton passes them to the solver. RK4 of its MuJoCo 3.17 has
# order 2, and the state is rounded to single precision after every step: on fig12 the error is
# 1.1e-4 at 20 ms, 2.1e-5 at 5 ms and 4.2e-5 at 1 ms.
_BEST = _NewtonSettings(
    name="best", error_tolerance=1e-3, stop_at_fault=False, timestep=20e-3, integrator="rk4",
    cone="elliptic", iterations=10, tolerance=0.0, friction=20.0, armature=1e12, impedance=0.9999,
    noslip=1,
)  # fmt: skip

_SLIP = replace(
    _BEST, name="slip", timestep=1e-3, slips=True, iterations=30, tolerance=1e-16, noslip=None
)


def _lacks(scene: Scene, settings: _NewtonSettings) -> str | None:
    lack = "its model and its states are in single precision"
    if settings.device is not None:
        limits = ", ".join(f"{name} {value:g}" for name, value in _WARP_CAPS.items())
        lack += f", as are its steps, limited to {limits}"
    if settings.impedance is None and (free := adapter.no_torsion(scene)):
        lack += f"; {free}"
    return lack


_VERSION = f"{adapter.version_of('newton')} on mujoco {adapter.version_of('mujoco')}"
NEWTON = adapter.Adapter(
    label=Label("Newton", _VERSION, "#117733", "*"),
    packages=("newton",),
    extra="newton",
    presets=adapter.by_name(
        _AS_IT_COMES,
        _BEST,
        replace(_BEST, name="kept", kept=True),
        _SLIP,
    ),
    world=_NewtonWorld,
    rolls_unbalanced=True,
    resists_spin=True,
    lacks=_lacks,
)
