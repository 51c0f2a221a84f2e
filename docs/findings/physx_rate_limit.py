"""PhysX, with SAPIEN's defaults, clips hinge rates at 100 rad/s without a warning.

A rotor on the hinge of a free body has a drive with a target of 150 rad/s. Printed: its rate after
1 s at 1 ms [rad/s], by default and with the limits of joint and bodies raised.
"""

from importlib.metadata import version

import numpy as np

try:
    import sapien
except ImportError:
    raise SystemExit("skipped: SAPIEN is not installed") from None


def rate(most: float | None) -> float:
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.set_timestep(1e-3)
    builder = scene.create_articulation_builder()
    body = builder.create_link_builder()
    body.set_mass_and_inertia(1.0, sapien.Pose(), [0.5, 0.7, 0.3])
    rotor = builder.create_link_builder(body)
    rotor.set_mass_and_inertia(0.1, sapien.Pose(), [0.02, 0.01, 0.01])
    limits = [[-np.inf, np.inf]]
    rotor.set_joint_properties("revolute_unwrapped", limits, sapien.Pose(), sapien.Pose())
    both = builder.build()
    (joint,) = both.active_joints
    joint.set_drive_properties(0.0, 1e3)
    joint.set_drive_velocity_target(150.0)
    if most is not None:
        joint.set_max_velocity(most)
        for link in both.links:
            link.set_max_angular_velocity(most)
    for _ in range(1000):
        scene.step()
    return float(both.qvel[0])


print("default:", rate(None))
print("raised:", rate(1e6))
print("expected: 150, or a warning")
print("version: SAPIEN", version("sapien"))
print("verdict: documented; PhysX's API, setMaxJointVelocity, which names no default")
