"""PhysX 5 in SAPIEN: an articulation with hinge drives, in single precision."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, links_of, principal_inertia
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, from_matrix, perpendicular


@dataclass(frozen=True, kw_only=True)
class _PhysxSettings(adapter.StepSettings):
    """Settings of a PhysX run."""

    friction: float | None = None  # of ball and plane
    damping: float = 5.0  # N m s/rad, gain of the hinges' velocity drives
    armature: float | None = None  # kg m², reflected inertia of the hinges
    most_rate: float | None = None  # rad/s, at which PhysX clips rates of hinges and bodies
    patch: float | None = None  # m, radius of the contact patch against spin; for rubber balls only
    iterations: int | None = None  # of the solver, for positions and for velocities


class _PhysxWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _PhysxSettings, step: float) -> None:
        super().__init__(scene)
        import sapien

        physx, start = sapien.physx, self.now
        config = physx.PhysxSceneConfig()
        config.gravity = np.array([0.0, 0.0, -scene.gravity], dtype=np.float32)
        physx.set_scene_config(config)
        bodies = physx.PhysxBodyConfig()
        bodies.sleep_threshold = 0.0  # a slow ball must not be put to sleep
        if settings.iterations is not None:
            bodies.solver_position_iterations = bodies.solver_velocity_iterations = (
                settings.iterations
            )
        physx.set_body_config(bodies)
        self.world = sapien.Scene([physx.PhysxCpuSystem()])
        self.world.set_timestep(step)
        material = None
        if settings.friction is not None:
            material = physx.PhysxMaterial(settings.friction, settings.friction, 0.0)
        ground = self.world.create_actor_builder()
        ground.set_physx_body_type("static")
        # PhysX's plane has its normal along x.
        upward = sapien.Pose(q=from_matrix(np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]])))
        ground.add_plane_collision(upward, material=material)
        ground.build("ground")
        builder = self.world.create_articulation_builder()
        bodies_built: dict[str, Any] = {}
        patch = settings.patch if scene.rolling == "rubber" else None
        for link in links_of(scene):
            body = builder.create_link_builder(bodies_built.get(link.parent))
            body.set_name(link.name)
            moments, axes = principal_inertia(link)
            body.set_mass_and_inertia(link.mass, sapien.Pose(link.centre, axes), moments)
            if not link.parent:
                body.add_sphere_collision(
                    radius=scene.ball.radius, material=material,
                    patch_radius=patch or 0.0, min_patch_radius=patch or 0.0,
                )  # fmt: skip
            else:
                side = perpendicular(link.axis)
                # Rotates x, PhysX's hinge axis, onto the link's axis.
                turn = from_matrix(np.stack([link.axis, side, np.cross(link.axis, side)], axis=1))
                body.set_joint_name(link.name)
                # Unwrapped, because a rotor turns by more than 1000 rad.
                body.set_joint_properties(
                    "revolute_unwrapped", [[-np.inf, np.inf]],
                    sapien.Pose(link.pivot, turn), sapien.Pose(q=turn),
                )  # fmt: skip
            bodies_built[link.name] = body
        builder.set_initial_pose(sapien.Pose(start.centre, start.attitude))
        self.ball = ball = builder.build()
        for link in ball.links:
            # PhysX damps bodies by default.
            link.set_linear_damping(0.0)
            link.set_angular_damping(0.0)
            if settings.most_rate is not None:
                link.set_max_angular_velocity(settings.most_rate)
        for joint in ball.active_joints:
            joint.set_drive_properties(0.0, settings.damping)
            if settings.armature is not None:
                joint.set_armature(np.array([settings.armature], dtype=np.float32))
            if settings.most_rate is not None:
                joint.set_max_velocity(settings.most_rate)
        ball.set_root_pose(sapien.Pose(start.centre, start.attitude))
        ball.set_root_linear_velocity(start.velocity)
        ball.set_root_angular_velocity(start.omega)
        ball.set_qvel(start.rates)
        self.set_rates(start.rates)

    def set_rates(self, rates: Array) -> None:
        for joint, rate in zip(self.ball.active_joints, rates.tolist(), strict=True):
            joint.set_drive_velocity_target(rate)

    def step(self, step: float) -> None:
        self.world.step()

    def state(self) -> State:
        ball, pose = self.ball, self.ball.root_pose
        velocity, omega = _double(ball.root_linear_velocity), _double(ball.root_angular_velocity)
        attitude = _double(pose.q) / np.linalg.norm(pose.q)
        angles, rates = _double(ball.qpos), _double(ball.qvel)
        return State(_double(pose.p), velocity, attitude, omega, angles, rates)

    def force(self) -> Array:
        points = [point for contact in self.world.get_contacts() for point in contact.points]
        # SAPIEN reports normal impulses only, without friction.
        normal = sum(abs(point.impulse[2]) for point in points) / self.world.timestep
        return np.array([np.nan, np.nan, normal])


def _double(values: Any) -> Array:
    return np.array(values, dtype=float)


_AS_IT_COMES = _PhysxSettings(name="as-it-comes", error_tolerance=1e-2, timestep=5e-4)
# The patch resists spin; the armature keeps hinge rates in single precision; the rate limit is far
# above the rotor's 148 rad/s, which the default of 100 rad/s would clip. No setting we found
# removes the remaining slip, 1e-3 m/s even on a mere slope.
_BEST = _PhysxSettings(
    name="best", error_tolerance=5e-2, timestep=1e-3, friction=20.0, damping=1e8, armature=1e4,
    most_rate=1e6, patch=20.0, iterations=20,
)  # fmt: skip


PHYSX = adapter.Adapter(
    label=Label("PhysX 5 (SAPIEN)", adapter.version_of("sapien"), "#7F7F7F", "8"),
    packages=("sapien",),
    extra="physx",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_PhysxWorld,
    lacks=adapter.in_single_precision,
)
