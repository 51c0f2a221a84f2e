"""Pinocchio as an engine: its mass matrix and bias, under our rolling constraints and steps.

Its own constraints hold a point that stays where it is on a body. A ball touches with ever another
one, and a constraint at its lowest point, set anew at every step, has the wrong acceleration
(docs/findings/pinocchio_rolling.py).
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines.adapter import (
    Adapter,
    IdealWorld,
    Stepper,
    StepSettings,
    by_name,
    version_of,
)
from robotball.engines.links import State, links_of
from robotball.motion import Label
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True, kw_only=True)
class _PinocchioSettings(StepSettings):
    """Settings of a Pinocchio run: our stepper, and rtol for DOP853 alone."""

    stepper: Stepper
    rtol: float = 1e-12


class _PinocchioWorld(IdealWorld):
    """The ball as a free shell with hinges, in Pinocchio's local coordinates."""

    def __init__(self, scene: Scene, settings: _PinocchioSettings, step: float) -> None:
        super().__init__(scene, settings.stepper, settings.rtol)
        import pinocchio

        self.pin, self.model = pinocchio, pinocchio.Model()
        joints = {"": 0}
        for link in links_of(scene):
            joint = (
                pinocchio.JointModelRevoluteUnaligned(*link.axis)
                if link.parent
                else pinocchio.JointModelFreeFlyer()
            )
            # All links have the ball's axes at the start, so that places are shifts alone.
            place = pinocchio.SE3(np.eye(3), link.pivot)
            made = self.model.addJoint(joints[link.parent], joint, place, link.name)
            joints[link.name] = made
            body = pinocchio.Inertia(link.mass, link.centre, link.inertia)
            self.model.appendBodyToJoint(made, body, pinocchio.SE3.Identity())
        self.model.gravity.linear = scene.gravity_world
        self.data = self.model.createData()
        self.T = np.eye(self.model.nv)

    def dynamics(self, state: State) -> tuple[Array, Array]:
        R = rotation_matrix(state.attitude)
        v, w = R.T @ state.velocity, R.T @ state.turning
        # Pinocchio's quaternions are (x, y, z, w).
        q = np.concatenate([state.centre, np.roll(state.attitude, -1), state.angles])
        qdot = np.concatenate([v, w, state.rates])
        M = self.pin.crba(self.model, self.data, q, self.pin.Convention.WORLD)
        M = np.triu(M) + np.triu(M, 1).T  # crba fills the upper half alone
        h = self.pin.nonLinearEffects(self.model, self.data, q, qdot)
        # Its velocities are in the shell's axes: T turns them, and because these axes turn with ω
        # the acceleration there is Rᵀdv/dt - ω×v.
        self.T[:3, :3] = self.T[3:6, 3:6] = R.T
        turned = np.concatenate([-np.cross(w, v), np.zeros(self.model.nv - 3)])
        return self.T.T @ M @ self.T, self.T.T @ (h + M @ turned)


class _Pinocchio(Adapter):
    """Pinocchio as an `Adapter`, for balls that others of the kind cannot roll."""

    def cannot_express(self, scene: Scene) -> str | None:
        """Return why it cannot roll the scene. Balance and a level plane are not needed."""
        if scene.ball.links:
            return "its adapter knows a shell, a frame, rotors and pendulums, and no links on them"
        if any(scene.motors):
            return "its adapter turns hinges at given rates, and a hinge has a motor"
        if any(hinge.angle for hinge in scene.hinges):
            return "its adapter begins with all hinges at angle 0"
        if scene.friction.rolling:
            return "its adapter knows no resistance to rolling"
        return None


PINOCCHIO = _Pinocchio(
    label=Label("Pinocchio", version_of("pin"), "#56B4E9"),
    packages=("pinocchio",),
    extra="pinocchio",
    ladders={
        "RK4": ("timestep", (20e-3, 10e-3, 5e-3)),
        "best": ("rtol", (1e-6, 1e-9, 1e-12, 1e-14)),
    },
    presets=by_name(
        _PinocchioSettings(name="RK4", error_tolerance=1e-4, timestep=20e-3, stepper="RK4"),
        # DOP853 chooses its steps itself; the timestep is only the longest.
        _PinocchioSettings(name="best", error_tolerance=1e-10, timestep=1.0, stepper="DOP853"),
    ),
    world=_PinocchioWorld,
)
