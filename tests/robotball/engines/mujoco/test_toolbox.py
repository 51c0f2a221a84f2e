"""An unmodified robot file in the sysid toolbox of MuJoCo: its motion and its contact error."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import robotball as rb
from robotball.engines.mujoco import toolbox
from robotball.fit.fitting import fit
from robotball.rotations import Array, turned
from robotball.user_model.robot_numbers import RobotNumbers, robot_numbers

pytest.importorskip("tabulate", reason="the extra sysid is not installed")

_GHOST = 'contype="0" conaffinity="0"'
ROLLER = f"""<mujoco><option timestep=".002" {{option}}/><worldbody>
<geom name="floor" type="plane" size="5 5 .1"/>
<body name="shell" pos="0 0 .15"><freejoint/><geom name="ball" size=".15" mass="1.3" condim="4"/>
<body name="plate"><joint name="axle" axis="0 1 0" damping=".01"/>
<geom type="box" size=".06 .11 .0025" mass=".4" {_GHOST}/>
<geom name="battery" type="box" size=".05 .035 .02" pos="0 -.01 -.085" mass="1.1" {_GHOST}/>
</body></body></worldbody>{{contact}}
<actuator><velocity name="drive" joint="axle" kv=".4"/></actuator>
<keyframe><key qvel="0 0 0 .5 0 0 0" ctrl="-4"/></keyframe></mujoco>"""
OPTIONS = {"option": 'integrator="RK4" cone="elliptic" noslip_iterations="3"'}
PAIR = """<contact><pair geom1="floor" geom2="ball" condim="4" friction="20 20 3 1 1"
solref=".004 1" solimp=".9999 .9999 .001 .5 1"/></contact>"""
NOISE = {"position": 1e-3, "attitude": 1e-2, "gyro": 2e-2, "plate_angle": 1e-2}


def numbers(folder: Path, **parts: str) -> RobotNumbers:
    """Return the robot with default contact settings, or with the given parts of its file."""
    path = folder / "roller.xml"
    path.write_text(ROLLER.format(**{"option": "", "contact": ""} | parts))
    return robot_numbers(path)


def log(scene: rb.Scene) -> rb.Log:
    """Return noisy sensor data of a motion with the equations, and its command."""
    m, rng = rb.integrate(scene, rb.sample_times(1.5)), np.random.default_rng(3)
    noisy = [rng.normal(0.0, size, (len(m.times), 3)) for size in NOISE.values()]
    sensors = (
        rb.Sensor("position", m.times, m.contact_point + noisy[0][:, :2]),
        rb.Sensor("attitude", m.times, turned(m.attitude, noisy[1])),
        rb.Sensor("gyro", m.times, m.angular_velocity + noisy[2]),
        rb.Sensor("plate_angle", m.times, m.hinge_angles + noisy[3][:, :1]),
    )
    return rb.Log("run.csv", sensors, {"drive": (m.times[:1], np.array([-4.0]))})


def test_an_unmodified_file_follows_the_equations_only_with_a_hard_contact(
    tmp_path: Path,
) -> None:
    """Path, hinge angles, rates and motor torques; not with the default contact."""
    hard, soft = (
        numbers(tmp_path, **parts).scene({}) for parts in ({**OPTIONS, "contact": PAIR}, {})
    )
    times = np.array([0.0, 0.1234, 0.4, 0.8])
    truth = rb.integrate(hard, times)
    for scene, least, most in ((hard, 0.0, 2e-3), (soft, 2e-2, np.inf)):
        motion = toolbox.roll(scene, times)
        off = max(
            np.abs(motion.contact_point - truth.contact_point).max(),
            np.abs(motion.hinge_angles - truth.hinge_angles).max(),
            np.abs(motion.angular_velocity - truth.angular_velocity).max(),
            np.abs(motion.loads.motor_torques - truth.loads.motor_torques).max(),
        )
        assert (
            least < off < most
        )  # measured 9.6e-4, from the softness, and 0.12, from slip and spin


@pytest.mark.study
def test_the_default_contact_biases_fitted_numbers(tmp_path: Path) -> None:
    """A fit with the equations recovers the number; a fit with the unmodified file does not."""
    robot = numbers(tmp_path)
    run_log, free = log(robot.scene({})), ["battery.pos.z"]
    runs: tuple[Mapping[str, Any], ...] = (
        {},
        {"run": toolbox.roll, "minimize": toolbox.least_squares},
    )
    equations, unmodified = (fit(robot, [run_log], free, noise=NOISE, **run) for run in runs)
    (recovered,), (biased,) = equations.found, unmodified.found
    assert abs(recovered.value + 0.085) < 3 * recovered.deviation  # measured 0.4 deviations
    assert abs(biased.value + 0.085) > 6 * biased.deviation  # measured 16
    assert unmodified.chi2 > 3 * unmodified.degrees  # measured 10; the contact slips and spins


def test_the_toolbox_finds_the_same_least_squares_fit_as_scipy() -> None:
    """For a noisy exponential decay, with and without an active bound."""
    times = np.linspace(0.0, 2.0, 40)
    data = 1.5 * np.exp(-0.7 * times) + np.random.default_rng(1).normal(0.0, 0.01, 40)

    def residuals(x: Array) -> Array:
        return np.asarray(x[0] * np.exp(-x[1] * times) - data)

    def jacobian(x: Array) -> Array:
        decay = np.exp(-x[1] * times)
        return np.stack([decay, -x[0] * times * decay], axis=1)

    for bound in (np.inf, 0.5):
        bounds = np.zeros(2), np.array([np.inf, bound])
        ours = toolbox.least_squares(residuals, np.array([1.0, 0.2]), jacobian, bounds, max_nfev=30)
        theirs = least_squares(residuals, np.array([1.0, 0.2]), jacobian, bounds)
        # Measured 7e-7: the stopping tolerances differ.
        assert np.abs(ours.x - theirs.x).max() < 1e-4


def test_a_missing_toolbox_is_reported_with_the_extra_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without its extra, the module of MuJoCo can be imported but is empty."""
    monkeypatch.delattr(toolbox.sysid, "optimize")
    with pytest.raises(rb.InputError, match="install robotball's extra `sysid`"):
        toolbox.check_toolbox()
