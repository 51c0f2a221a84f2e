"""Pinocchio: its mass matrix and bias under our constraints, or its own contact.

Pinocchio's bilateral constraints hold a fixed point of a body. A ball's contact point changes, and
a constraint that is redefined at the lowest point at every step has the wrong acceleration
(docs/findings/pinocchio_rolling.py). Pinocchio's frictional contacts constrain only velocities, so
they do not have this error.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball, links_of
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix

_ARMATURE = 1e12  # kg m², of the hinges with contact: too large for the load to accelerate


@dataclass(frozen=True, kw_only=True)
class _PinocchioSettings(adapter.PointSettings):
    """Settings of a Pinocchio run.

    root: the shell's joint; the velocity of a free flyer is in rotating axes, that of other joints
    in world axes. A step moves along the velocity, so with the contact the error in rotating axes
    is 8 to 11 times as large.
    """

    friction: float = 0.8  # of ball and plane
    root: Literal["free flyer", "translation"] = "free flyer"


def _model(scene: Scene, pin: Any, root: str) -> Any:
    model, joints = pin.Model(), {"": 0}
    free = pin.JointModelFreeFlyer()
    if root == "translation":
        free = pin.JointModelComposite(pin.JointModelTranslation())
        free.addJoint(pin.JointModelSpherical())
    for link in links_of(scene):
        joint = pin.JointModelRevoluteUnaligned(*link.axis) if link.parent else free
        # At the start all links have the ball's axes, so the offset is a pure translation.
        offset = pin.SE3(np.eye(3), link.pivot)
        joints[link.name] = model.addJoint(joints[link.parent], joint, offset, link.name)
        body = pin.Inertia(link.mass, link.centre, link.inertia)
        model.appendBodyToJoint(joints[link.name], body, pin.SE3.Identity())
    model.gravity.linear = scene.gravity_at(0.0)
    return model


def _coordinates(state: State, root: str) -> tuple[Array, Array]:
    R = rotation_matrix(state.attitude)
    velocity = R.T @ state.velocity if root == "free flyer" else state.velocity
    # Pinocchio's quaternions are (x, y, z, w).
    q = np.concatenate([state.centre, np.roll(state.attitude, -1), state.angles])
    return q, np.concatenate([velocity, R.T @ state.omega, state.rates])


class _PinocchioWorld(adapter.IdealWorld):
    """The ball as a free shell with hinges; ω is in the shell's axes."""

    def __init__(self, scene: Scene, settings: _PinocchioSettings, step: float) -> None:
        super().__init__(scene, settings)
        import pinocchio

        self.pin, self.model = pinocchio, _model(scene, pinocchio, "translation")
        self.data = self.model.createData()
        self.T = np.eye(self.model.nv)

    def set_gravity(self, gravity: Array) -> None:
        self.model.gravity.linear = gravity

    def dynamics(self, state: State) -> tuple[Array, Array]:
        R = rotation_matrix(state.attitude)
        q, qdot = _coordinates(state, "translation")
        M = self.pin.crba(self.model, self.data, q, self.pin.Convention.WORLD)
        M = np.triu(M) + np.triu(M, 1).T  # crba fills the upper triangle only
        h = self.pin.nonLinearEffects(self.model, self.data, q, qdot)
        # ω is in the shell's axes; since those rotate with ω, its rate there is Rᵀ dω/dt.
        self.T[3:6, 3:6] = R.T
        return self.T.T @ M @ self.T, self.T.T @ h


class _ContactWorld(adapter.SteppedWorld):
    """The ball with Pinocchio's frictional contact, stepped as in Pinocchio's example."""

    any_step = True

    def __init__(self, scene: Scene, settings: _PinocchioSettings, step: float) -> None:
        super().__init__(scene)
        import pinocchio as pin

        self.pin, self.model = pin, _model(scene, pin, settings.root)
        self.model.armature = np.array([*np.zeros(6), *np.full(len(scene.drives), _ARMATURE)])
        self.data, self.tau = self.model.createData(), np.zeros(self.model.nv)
        self.damping, self.friction = adapter.spin_damping(scene, settings, step), settings.friction
        self.q, self.v = _coordinates(self.now, settings.root)
        self.set_turn(float(scene.plane_turn.rate(0.0)))
        self.rotating_axes = settings.root == "free flyer"
        identity = pin.SE3.Identity()
        self.contact = pin.PointContactConstraintModel(self.model, 0, identity, 1, identity)
        self.contact.setFriction(settings.friction)
        self.solver, self.settings = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings()
        self.result = pin.ADMMSolverResult()
        self.settings.max_iterations, self.settings.solve_ncp = 1000, True
        for kind in ("feasibility", "complementarity"):
            setattr(self.settings, f"absolute_{kind}_tol", 1e-10)
            setattr(self.settings, f"relative_{kind}_tol", 1e-12)

    def set_gravity(self, gravity: Array) -> None:
        self.model.gravity.linear = gravity

    def set_turn(self, rate: float) -> None:
        self.turn = rate

    def control(self, t: float, step: float) -> None:
        self.tau[6:] = [_ARMATURE * drive.acceleration(t + step / 2) for drive in self.scene.drives]

    def step(self, step: float) -> None:
        pin, model, data, q, v = self.pin, self.model, self.data, self.q, self.v
        R, a = rotation_matrix(np.roll(q[3:7], 1)), self.scene.ball.radius
        self.tau[3:6] = -self.damping * (R[2] @ v[3:6] - self.turn) * R[2]
        # The contact is at the shell's lowest point; both frames have world axes.
        self.contact.joint1_placement = pin.SE3(np.eye(3), np.array([q[0], q[1], 0.0]))
        self.contact.joint2_placement = pin.SE3(R.T, -a * R[2])
        models = [pin.ConstraintModel(self.contact)]
        datas = [models[0].createData()]
        pin.crba(model, data, q, pin.Convention.WORLD)
        free = v + step * pin.aba(model, data, q, v, self.tau)
        data.q_in = q
        models[0].calc(model, data, datas[0])
        cholesky = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
        cholesky.compute(model, data, models, datas, 1e-10)
        J = pin.getConstraintsJacobian(model, data, models, datas)
        # The velocity relative to the plane, which turns about the origin.
        drift = J @ free + [self.turn * q[1], -self.turn * q[0], (q[2] - a) / step]
        delassus = cholesky.getDelassusOperatorCholeskyExpression()
        self.solver.solve(delassus, drift, models, datas, self.settings, self.result)
        self.contact_force = self.result.retrieveConstraintImpulses() / step
        self.v = v + step * pin.aba(model, data, q, v, self.tau + J.T @ self.contact_force)
        self.q = pin.integrate(model, q, self.v * step)

    def state(self) -> State:
        q, v, R = self.q, self.v, rotation_matrix(np.roll(self.q[3:7], 1))
        velocity = R @ v[:3] if self.rotating_axes else v[:3]
        return State(q[:3], velocity, np.roll(q[3:7], 1), R @ v[3:6], q[7:], v[6:])

    def force(self) -> Array:
        return force_on_ball([self.contact_force])


_AS_IT_COMES = _PinocchioSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-3, spin_part=0.0
)

PINOCCHIO = adapter.Adapter(
    label=Label("Pinocchio", adapter.version_of("pin"), "#56B4E9", "D"),
    packages=("pinocchio",),
    extra="pinocchio",
    presets=adapter.by_name(
        _PinocchioSettings(name="RK4", error_tolerance=1e-4, timestep=20e-3, ideal="RK4"),
        # DOP853 chooses its steps; the timestep is the longest.
        _PinocchioSettings(name="best", error_tolerance=1e-10, timestep=1.0, ideal="DOP853"),
        _AS_IT_COMES,
        _PinocchioSettings(
            name="contact", error_tolerance=5e-2, timestep=1e-3, friction=20.0, root="translation"
        ),
    ),
    world=adapter.either(_ContactWorld, _PinocchioWorld),
    moves_plane=True,
    rolls_unbalanced=True,
    lacks=adapter.spins,
)
