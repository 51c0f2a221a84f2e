"""A pyramidal cone gives a sliding ball wrong friction, and an elliptic cone throws the ball up.

A solid ball (1 kg, 0.1 m, friction 0.3) at rest gets a velocity of 2 m/s and a spin. Friction is
against the slip u, which keeps its direction until it ends at t = 2|u|/(7μg). Printed for each
contact and timestep: the angle of friction over half of that time, by how much 99 % of the slip
ends too late, the rise, the largest normal force, and the error of the path after 1 s, relative.
"""

from importlib.metadata import version

import mujoco
import numpy as np

BALL = """<mujoco><option timestep="{}" {}/><worldbody><geom name="floor" type="plane"
size="0 0 1"/><body pos="0 0 .1"><freejoint/><geom name="ball" size=".1" mass="1"/></body>
</worldbody><contact><pair geom1="floor" geom2="ball" friction=".3 .3" {}/></contact></mujoco>"""
V, U, G, ELLIPTIC = np.array([2.0, 0]), np.array([1.5, 1]), 9.81, 'integrator="RK4" cone="elliptic"'
SPEED = np.hypot(*U)
PULL, END = 0.3 * G * U / SPEED, 2 * SPEED / (7 * 0.3 * G)
for step in (5e-3, 1e-3, 2e-4):
    d, times = 0.2 * step, step * np.arange(1, round(1 / step) + 1)[:, None]
    hard = f'solimp="{d} {d}" solref="{-1 / step**2} {-2 / step}" margin="{G * (1 - d) * step**2}"'
    option = f'{ELLIPTIC} impratio="{1e6 / d}" tolerance="1e-16"'
    cure = option, f'{hard} solreffriction="-1 {-2.5 * d / step}"'
    s = np.minimum(times, END)
    path = V * times - PULL * (s * times - s * s / 2)
    for name, words in {"default": ("", ""), "elliptic": (ELLIPTIC, ""), "cure": cure}.items():
        model, rows = mujoco.MjModel.from_xml_string(BALL.format(step, *words)), []
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, len(times))
        rest, data.qpos[:2], data.qvel[:] = data.qpos[2], 0, [*V, 0, 10, 5, 0]
        for _ in times:
            mujoco.mj_step(model, data)
            x, y, _ = data.xmat[1].reshape(3, 3) @ data.qvel[3:] / 10
            slip = np.hypot(data.qvel[0] - y, data.qvel[1] + x)
            rows.append([*data.qpos[:3], *data.qvel[:2], slip, data.qfrc_constraint[2]])
        rows, label = np.array(rows), f"{name}, {1e3 * step:g} ms"
        lost, late = V - rows[int(END / 2 / step), 3:5], np.sum(rows[:, 5] > 0.01 * SPEED) * step
        cosine = lost @ U / np.hypot(*lost) / SPEED
        print(f"{label}, askew [deg]:", np.degrees(np.arccos(cosine)))
        print(f"{label}, late [%]:", 100 * (late / END / 0.99 - 1))
        print(f"{label}, rise [mm]:", 1e3 * (rows[:, 2].max() - rest))
        print(f"{label}, force over weight:", rows[:, 6].max() / G)
        print(f"{label}, error:", np.hypot(*(rows[-1, :2] - path[-1])) / np.hypot(*path[-1]))
print("expected: 0, 0, 0, 1 and 0, or errors that vanish with the timestep")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, Physical realism, see reports/mujoco_slip.md")
