"""A MuJoCo warning within a Python callback blocks the process forever; Ctrl-C does not stop it.

A control callback evaluates a second MjData, with a finite state or with one so large that the
inertia matrix overflows and MuJoCo warns. The same call is also made outside a callback. Each runs
in its own process, stopped after 5 s. Printed: whether the call returned.
"""

import subprocess
import sys
from importlib.metadata import version

CALL = """
import mujoco, sys

model = mujoco.MjModel.from_xml_string('''<mujoco><option integrator="RK4"/><worldbody>
<body><freejoint/><geom size=".1"/>
<body><joint axis="0 1 0"/><geom size=".05" pos="0 0 .1"/></body></body></worldbody></mujoco>''')
data, other = mujoco.MjData(model), mujoco.MjData(model)

mujoco.set_mju_user_warning(lambda _: None)  # else MuJoCo writes a file

def evaluate(*_):
    other.qpos[:] = float(sys.argv[2])
    mujoco.mj_fwdPosition(model, other)

if sys.argv[1] == "outside":
    evaluate()
else:
    mujoco.set_mjcb_control(evaluate)
mujoco.mj_step(model, data)
"""


def returns(where: str, size: str) -> bool:
    command = [sys.executable, "-c", CALL, where, size]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=5)
    except subprocess.TimeoutExpired:
        return False
    return True


print("inside, finite state, returned:", int(returns("inside", "0.1")))
print("outside, with a warning, returned:", int(returns("outside", "1e80")))
print("inside, with a warning, returned:", int(returns("inside", "1e80")))
print("expected: 1 in each line")
print("version: MuJoCo", version("mujoco"))
print("verdict: bug; no report found, see reports/mujoco_callback_warning.md")
