"""MuJoCo applies only a fraction of a declared rolling friction, depending on cone and impratio.

A solid ball of radius 0.1 m rolls for 0.2 s with condim 6 and with condim 4. Printed: the
additional loss of speed with condim 6 over μ g t / (7/5 a), which is 1 for a torque μ m g. MuJoCo
makes the rolling rows softer than the normal row by (μ_slide / μ)² / impratio, so with a slow ball
or a small coefficient they creep below the limit. Last line: the fraction of steps in contact.
"""

from importlib.metadata import version

import mujoco

RADIUS, TIME, STEP = 0.1, 0.2, 1e-3
ROLL = """<mujoco><option timestep="{step}" cone="{cone}" impratio="{impratio}"/><worldbody>
<geom type="plane" size="0 0 1" condim="1"/><body pos="0 0 {radius}"><freejoint/>
<geom size="{radius}" mass="1" condim="{condim}" friction="1 .005 {mu}"/>
</body></worldbody></mujoco>"""


def lost(condim: int, cone: str, impratio: int, mu: float, speed: float) -> tuple[float, float]:
    """Return the speed lost [m/s] and the fraction of steps in contact."""
    text = ROLL.format(step=STEP, radius=RADIUS, condim=condim, cone=cone, impratio=impratio, mu=mu)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for _ in range(200):  # settle
        mujoco.mj_step(model, data)
    data.qvel[0], data.qvel[4] = speed, speed / RADIUS
    touching, steps = 0, round(TIME / STEP)
    for _ in range(steps):
        mujoco.mj_step(model, data)
        touching += data.ncon
    return speed - data.qvel[0], touching / steps


def delivered(cone: str, impratio: int, mu: float, speed: float) -> float:
    declared = mu * 9.81 * TIME / (1.4 * RADIUS)
    with_rolling, without = (lost(condim, cone, impratio, mu, speed)[0] for condim in (6, 4))
    return (with_rolling - without) / declared


for impratio in (1, 100):
    for cone in ("pyramidal", "elliptic"):
        for mu in (1e-4, 2e-3, 6e-3):
            print(f"{cone}, impratio {impratio}, {mu} m:", delivered(cone, impratio, mu, 0.5))
print("elliptic at 0.1 m/s:", delivered("elliptic", 1, 2e-3, 0.1))
print("in contact, 0.015 m at 2 m/s:", lost(6, "elliptic", 100, 0.015, 2.0)[1])
print("expected: 1 for each cone and coefficient")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, Modeling, Preventing slip")
