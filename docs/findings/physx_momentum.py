"""PhysX conserves a free body's momentum, until single precision limits very short steps.

The body and rotor of mujoco_implicitfast.py for 10 s. Printed: the relative change of angular
momentum at three step lengths. The other engines of first order gain 4.5 % at 1 ms.
"""

from importlib.metadata import version

import numpy as np

try:
    import sapien
except ImportError:
    raise SystemExit("skipped: SAPIEN is not installed") from None

I, J = np.array([0.5, 0.7, 0.3]), np.array([0.02, 0.01, 0.01])
config = sapien.physx.PhysxSceneConfig()
config.gravity = np.zeros(3)
sapien.physx.set_scene_config(config)


def change(step: float) -> float:
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.set_timestep(step)
    builder = scene.create_articulation_builder()
    body = builder.create_link_builder()
    body.set_mass_and_inertia(1.0, sapien.Pose(), I)
    rotor = builder.create_link_builder(body)
    rotor.set_mass_and_inertia(0.1, sapien.Pose(), J)
    limits = [[-np.inf, np.inf]]
    rotor.set_joint_properties("revolute_unwrapped", limits, sapien.Pose(), sapien.Pose())
    both = builder.build()
    for link in both.links:
        link.set_linear_damping(0.0)
        link.set_angular_damping(0.0)
        link.set_max_angular_velocity(1e6)
    both.active_joints[0].set_max_velocity(1e6)
    both.active_joints[0].set_friction(0.0)
    both.set_root_angular_velocity([3, 1, 5])
    both.set_qvel([100.0])

    def momentum() -> float:
        R = both.root_pose.to_transformation_matrix()[:3, :3].astype(float)
        w = R.T @ both.root_angular_velocity.astype(float)
        return float(np.linalg.norm((I + J) * w + [J[0] * float(both.qvel[0]), 0, 0]))

    before = momentum()
    for _ in range(round(10 / step)):
        scene.step()
    return momentum() / before - 1


for step in (1e-2, 1e-3, 1e-4):
    print(f"{step * 1e3:g} ms:", change(step))
print("expected: 0, or less change with shorter steps")
print("version: SAPIEN", version("sapien"))
print("verdict: open; no report found")
