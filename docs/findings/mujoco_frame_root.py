"""Contact rows have no dJ/dt term, so a shell that is attached to a rotating body slips.

A shell of radius 1 m rolls on a plane, and a frame turns in it at 2 rad/s. The same ball is
modelled twice, with the shell or the frame on the free joint. Printed: the largest slip of the
shell's lowest point within 1 s [m/s]; slip decays at the rate b = 1/s.
"""

from importlib.metadata import version

import mujoco
import numpy as np

BODY = {
    "shell": '<geom name="ball" size="1" mass="0"/>'
    '<inertial pos="0 0 0" mass=".1" diaginertia=".06 .06 .06"/>',
    "frame": '<inertial pos="0 0 0" mass=".9" diaginertia=".5 .7 .3"/>',
}
WORLD = """<mujoco><option timestep="1e-3" integrator="RK4" cone="elliptic" solver="PGS"
 iterations="3" tolerance="0" noslip_iterations="1" noslip_tolerance="0"/>
<worldbody><geom name="plane" type="plane" size="0 0 1"/>
<body pos="0 0 1"><freejoint/>{}<body><joint axis="0 0 {}" armature="1e12"/>{}</body></body>
</worldbody>
<contact><pair geom1="plane" geom2="ball" condim="3" friction="20 20 1 1 1" margin="1.4e-3"
 solimp=".9999 .9999 .001 .5 1" solref=".02 1" solreffriction="-1 -1"/></contact></mujoco>"""
SHELL, OMEGA = np.array([1.0, 2.0, 0.5]), np.array([0.0, 0.0, 2.0])  # of the shell and the frame


def slip(root: str, child: str, sign: int) -> float:
    model = mujoco.MjModel.from_xml_string(WORLD.format(BODY[root], sign, BODY[child]))
    data = mujoco.MjData(model)
    data.qvel[:3] = np.cross(SHELL, [0, 0, 1])
    data.qvel[3:6] = SHELL if root == "shell" else SHELL + OMEGA
    data.qvel[6] = OMEGA[2]  # child relative to root: reversed rate about a reversed axis
    shell, largest, velocity = model.geom("ball").bodyid[0], 0.0, np.zeros(6)
    for _ in range(1000):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, shell, velocity, 0)
        sliding = velocity[3:] + np.cross(velocity[:3], [0, 0, -1])
        largest = max(largest, np.linalg.norm(sliding[:2]))
    return largest


print("shell root:", slip("shell", "frame", 1))
print("frame root:", slip("frame", "shell", -1))
print("expected: 0 for both, because they are the same robot")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, Computation, Dual problem")
