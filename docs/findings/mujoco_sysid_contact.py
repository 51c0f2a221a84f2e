"""With a wrong contact mujoco.sysid fits wrong parameters to the log of a rolling robot.

A motor turns a frame on the axle of a ball; a battery hangs low in it. The log has 6 s at 50 Hz of
the ball's centre, the hinge angle and a gyro, with noise of 1 mm, 0.01 rad and 0.02 rad/s. It is
computed from the equations of rolling without slip or spin, without MuJoCo. The battery's mass and
depth and the motor's gain kv are fitted. Printed: their errors and standard deviations [%], chi2/n
and the processor time.
"""

import io
import time

import mujoco
import numpy as np
from mujoco import sysid
from scipy.integrate import solve_ivp

if not hasattr(sysid, "optimize"):
    raise SystemExit("skipped: mujoco[sysid] is not installed")

TRUTH = np.array([1.1, 0.085, 0.4])  # battery's mass [kg] and depth [m], kv [N m s/rad]
NAMES = "mass", "depth", "kv", "chi2/n", "seconds"
TIMES, NOISE = np.arange(301) / 50, np.repeat([1e-3, 1e-2, 2e-2], [3, 1, 3])
ROBOT = """<mujoco><option {}/><worldbody><geom name="floor" type="plane" size="0 0 1"/>
<body name="shell" pos="0 0 .15" euler="5.72958 0 0"><freejoint/><geom name="ball" size=".15"/>
<inertial pos="0 0 0" mass="1.3213" diaginertia=".0193 .0193 .0193"/><body name="frame">
<joint name="hinge" axis="0 1 0" armature=".001"/><geom type="box" size=".06 .11 .0025" mass=".4"/>
<geom type="cylinder" size=".018 .035" pos="0 .06 -.025" zaxis="0 1 0" mass=".35"/>
<geom name="battery" type="box" size=".05 .035 .02" pos="0 -.01 0"/><site name="imu"/></body></body>
</worldbody><contact><pair geom1="floor" geom2="ball" condim="4" {}/></contact>
<actuator><velocity name="motor" joint="hinge" forcerange="-1.2 1.2"/></actuator>
<sensor><framepos name="centre" objtype="xbody" objname="shell"/>
<jointpos name="angle" joint="hinge"/><gyro name="gyro" site="imu"/></sensor></mujoco>"""
SOLVER = 'timestep=".0025" cone="elliptic" noslip_iterations="1" noslip_tolerance="0" tolerance="0"'
CONTACT = 'friction="2000 2000 300" solref=".01 1" solimp=".9999 .9999" solreffriction="-1 -.5"'
CASES = {  # options, contact, and the number of timesteps subtracted from the sensors' times
    "default": ("", "", 1),
    "elliptic, impratio 100": ('cone="elliptic" impratio="100"', "", 1),
    "rolling, Euler": (SOLVER, CONTACT, 1),
    "rolling, RK4": (SOLVER + ' integrator="RK4"', CONTACT, 1),
    "rolling, RK4, uncorrected times": (SOLVER + ' integrator="RK4"', CONTACT, 0),
}


def command(times: np.ndarray) -> np.ndarray:
    """Return the desired hinge rate [rad/s], which a controller holds for 20 ms."""
    s = np.clip((np.floor(times * 50 + 1e-6) / 50 - 0.5) / 3, 0, 1)
    return -4 * s**3 * (10 - 15 * s + 6 * s**2)


def rolled() -> np.ndarray:
    """Return sensor values (n, 7) from virtual power: u moves shell, centre, frame by S, V, W."""
    mass = np.array([0.4, TRUTH[0], 0.35])  # the motor has the inertia of the last box
    centre = np.array([[0, 0, 0], [0, -0.01, -TRUTH[1]], [0, 0.06, -0.025]])
    box = np.array([[0.12, 0.22, 0.005], [0.1, 0.07, 0.04], [0.031177, 0.07, 0.031177]]) ** 2 / 12
    inertia_terms = mass @ ((centre**2 + box).sum(1, keepdims=True) - box)
    first, second = mass @ centre, np.diag(inertia_terms) - centre.T @ np.diag(mass) @ centre
    S, V = np.diag([1.0, 1, 0]), 0.15 * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    constant = (1.3213 + mass.sum()) * V @ V.T + np.diag([0.0193, 0.0193, 0.001])

    def rates(_: float, state: np.ndarray, desired: float) -> np.ndarray:
        u, R = state[3:6], state[6:].reshape(3, 3)
        W = np.vstack([S[:2], R[:, 1]])
        w, h, I = u @ W, R @ first, R @ second @ R.T
        bias = u[2] * np.cross(u @ S, W[2])  # the frame's angular acceleration at constant u
        force = np.cross(bias, h) + np.cross(w, np.cross(w, h))
        torque = I @ bias + np.cross(w, I @ w) + np.cross(h, [0, 0, 9.81])
        motor = np.clip(TRUTH[2] * (desired - u[2]), -1.2, 1.2)
        coupling = np.cross(W, h) @ V.T
        inertia = constant + coupling + coupling.T + W @ I @ W.T
        change = np.linalg.solve(inertia, [0, 0, motor] - V @ force - W @ torque)
        return np.concatenate([(u @ V)[:2], u[2:], change, np.cross(w, R.T).T.ravel()])

    cos, sin, rows = np.cos(0.1), np.sin(0.1), []
    state = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0, 0, cos, -sin, 0, sin, cos])
    for desired in command(TIMES):
        gyro = state[6:].reshape(3, 3).T @ [*state[3:5], 0] + [0, state[5], 0]
        rows.append([*state[:2], 0.15, state[2], *gyro])
        state = solve_ivp(rates, (0, 0.02), state, args=[desired], rtol=1e-7, atol=1e-8).y[:, -1]
    return np.array(rows)


def fitted(robot: str, log: np.ndarray, late: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the fitted parameters, their standard deviations and chi2/n."""

    def put(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
        battery, motor = spec.geom("battery"), spec.actuator("motor")
        battery.mass, depth, kv = parameter.value
        battery.pos[2], motor.gainprm[0], motor.biasprm[2] = -depth, kv, -kv

    def residual(_, run, measured, model, *rest, **state):
        times = run.times - late * model.opt.timestep
        run = sysid.TimeSeries(times, run.data, measured.signal_mapping).resample(measured.times)
        return (run.data - measured.data) / NOISE, run, measured

    spec = mujoco.MjSpec.from_string(robot)
    model = spec.compile()
    times = np.arange(0, 6 + 2 * model.opt.timestep, model.opt.timestep)
    control = sysid.TimeSeries.from_control_names(times, command(times)[:, None], model)
    sensors = sysid.TimeSeries.from_names(TIMES, log, model)
    start = sysid.create_initial_state(model, model.qpos0)
    run = sysid.ModelSequences("robot", spec, "log", start, control, sensors)
    residuals = sysid.build_residual_fn(models_sequences=[run], modify_residual=residual)
    free = sysid.ParameterDict({"": sysid.Parameter("", 0.8 * TRUTH, [0] * 3, [2] * 3, False, put)})
    _, result = sysid.optimize(free, residuals, verbose=False, x_scale="jac", output=io.StringIO())
    deviation = np.sqrt(np.diag(np.linalg.inv(result.jac.T @ result.jac)))
    return result.x, deviation, 2 * result.extras["objective"][-1] / log.size


log = rolled() + NOISE * np.random.default_rng(0).standard_normal((len(TIMES), len(NOISE)))
for case, (options, contact, late) in CASES.items():
    begin = time.process_time()
    parameters, deviation, chi2 = fitted(ROBOT.format(options, contact), log, late)
    values = *(100 * (parameters / TRUTH - 1)), chi2, time.process_time() - begin
    for name, value in zip(NAMES, values, strict=True):
        print(f"{case}, {name}:", value)
for name, value in zip(NAMES, 100 * deviation / TRUTH, strict=False):
    print(f"standard deviation, {name}:", value)
print("expected: errors of one standard deviation, chi2/n 1")
print("version: MuJoCo", mujoco.__version__)
print("verdict: open; no report found")
