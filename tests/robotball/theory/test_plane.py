"""A moving plane, in the frame of space and in the frame of the plane: equations and engines."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import robotball as rb
from robotball.engines.engine import OURS, engine_named
from robotball.engines.mujoco.control import Control
from robotball.motion import path_error
from robotball.rotations import Array, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.multibody.derivative import HINGES, readings_of
from robotball.theory.multibody.march import March
from robotball.theory.multibody.system import System
from tests.messages import unnamed
from tests.motions import pair_of
from tests.random_robots import random_scene
from tests.robotball.theory.multibody.second_form import SecondForm

pytestmark = pytest.mark.core

FIG12, VIBRATED = rb.load_scene("fig12"), rb.load_scene("vibrated_ball")
SECONDS = 0.3
TIMES = rb.sample_times(1.0)


def sine(amplitude: float, frequency: float, phase: float = 0.0) -> rb.Sine:
    return rb.Sine(amplitude=amplitude, frequency=frequency, phase=phase)


def moved(scene: rb.Scene, *motion: Any) -> rb.Scene:
    return replace(scene, plane_motion=motion)


def backwards(drive: rb.Drive) -> rb.Custom:
    return rb.Custom(lambda t: -float(drive.rate(t)))


def shaken(rng: np.random.Generator) -> rb.Scene:
    """A random robot on a plane that moves along all axes, with a constant part."""
    x, y, z = rng.uniform(0.5, 2.0, 3)
    up = rb.Sum((0.3, sine(2 * z, 3.0, 0.4)))
    return moved(random_scene(rng), sine(x, 2.0, 1.0), sine(-y, 1.3), up)


def off_by(form: SecondForm, scene: rb.Scene) -> float:
    """Return the largest difference after SECONDS: position, hinges, and force over weight."""
    march = March(System(scene), LEAST_RTOL, SECONDS, 10_000)
    times, count = np.array([0.0, SECONDS]), len(scene.hinges)
    states, numbers = march.run(times)
    readings, (q, v) = readings_of(numbers, count), form.end(SECONDS, march.switches)
    at = rb.in_space(rb.integrate(scene, times))[-1] + [0.0, 0.0, scene.ball.radius]
    weight = scene.ball.mass * scene.gravity
    differences = [
        at - q[:3],
        states[-1, HINGES : HINGES + count] - q[7:],
        readings.rates[-1] - v[6:],
        (readings.force[-1] - form.loads(SECONDS, q, v).force) / weight,
    ]
    return float(np.abs(np.concatenate(differences)).max())


def test_robots_on_a_moving_plane_obey_the_newton_euler_equations() -> None:
    """The second form works in space, with a moving constraint, and shares no formula.

    Measured 8.8e-13, errors of both integrators. A plane that moves the opposite way differs.
    """
    rng = np.random.default_rng(3)
    for _ in range(3):
        scene = shaken(rng)
        assert off_by(SecondForm(scene), scene) < 1e-11
    other = moved(scene, *map(backwards, scene.plane_drives))
    assert off_by(SecondForm(other), scene) > 1e-3


def energy_in_space(motion: rb.Motion) -> Array:
    """Return the energy T + V (n,) of a motion in space [J]."""
    scene, robot, times = motion.scene, motion.scene.robot, motion.times
    states = robot.states(
        motion.gamma, motion.hinge_angles, motion.angular_velocity, motion.hinge_rates
    )
    to_world, masses = rotation_matrix(motion.attitude), robot.bodies[:, 0]
    moving = np.einsum("nij,bnj->bni", to_world, states.velocities)
    plane = np.stack([drive.angle(times) for drive in scene.plane_drives], axis=1)
    # (v + V)²/2 less v²/2, which the frame of the plane already includes.
    more = (moving * plane).sum(axis=2) + (plane**2).sum(axis=1) / 2
    kinetic = (states.u * states.momenta).sum(axis=0) / 2 + masses @ more
    centre = np.einsum("nij,nj->ni", to_world, states.centre_of_mass) + rb.in_space(motion)
    return np.asarray(kinetic - robot.mass * centre @ scene.gravity_world)


def test_the_energy_in_space_changes_by_the_work_of_motors_and_plane() -> None:
    """Measured 2.3e-14 of the work of the plane."""
    scene = moved(rb.load_scene("pendulum_robot"), *VIBRATED.plane_motion)
    motion = rb.integrate(scene, rb.sample_times(3.0))
    assert motion.motor_work is not None
    assert motion.plane_work is not None
    assert motion.rolling_loss is not None
    work = motion.motor_work.sum(axis=1) - motion.rolling_loss
    kept, scale = energy_in_space(motion) - work, np.ptp(motion.plane_work)
    assert np.ptp(kept - motion.plane_work) < 1e-12 * scale
    assert np.ptp(kept) > 0.9 * scale
    assert rb.integrate(rb.load_scene("pendulum_robot"), TIMES).plane_work is None


def test_the_energy_in_mujoco_changes_by_the_work_of_motors_and_plane() -> None:
    """With the contact forces and motor torques of MuJoCo."""
    motion = rb.simulate(VIBRATED, times := rb.sample_times(0.5, 0.0025))
    plane = np.stack([drive.angle(times) for drive in VIBRATED.plane_drives], axis=1)
    motors = (motion.loads.motor_torques * motion.hinge_rates).sum(axis=1)
    by_plane, by_motors = (
        CubicSpline(times, power).antiderivative()(times)
        for power in ((motion.loads.contact_force * plane).sum(axis=1), motors)
    )
    kept, scale = energy_in_space(motion) - by_motors, np.ptp(by_plane)
    assert np.ptp(kept - by_plane) < 1e-7 * scale  # measured 4e-9: error of the quadrature
    assert np.ptp(kept) > 0.9 * scale


def test_vertical_motion_of_the_plane_only_changes_the_load_of_a_balanced_ball() -> None:
    """Path and M do not change by a bit in the reduced equations; the load is m (g + A)."""
    up = sine(5.0, 4.0, 0.3)
    still, theory = rb.integrate(FIG12, TIMES), rb.integrate(moved(FIG12, 0.0, 0.0, up), TIMES)
    assert theory.engine == still.engine
    assert (theory.contact_point == still.contact_point).all()
    expected = FIG12.ball.mass * (FIG12.gravity + up.rate(TIMES))
    # Measured 4e-15 and, with fast rotors in the other equations, 4e-14 of the weight: rounding.
    assert np.allclose(theory.loads.normal_force, expected, rtol=1e-13)
    any_robot = rb.integrate(theory.scene, TIMES, equations="multibody")
    assert np.allclose(any_robot.loads.normal_force, expected, rtol=1e-12)
    assert path_error(any_robot, theory) < 1e-13
    assert theory.scene.keeps_momentum
    assert not moved(FIG12, 0.1, 0.0, up).keeps_momentum


def test_a_constant_acceleration_is_equivalent_to_an_inclined_plane() -> None:
    """With tan(slope) = A/g and gravity sqrt(g² + A²)."""
    g, A = FIG12.gravity, 0.7
    pushed = moved(VIBRATED, -A, 0.0, 0.0)
    down = np.array([A, 0.0, -g]) / np.hypot(A, g)
    tilted = replace(
        pushed, plane_motion=(0.0,) * 3, gravity=np.hypot(A, g), gravity_direction=tuple(down)
    )
    one, other = (rb.integrate(scene, TIMES) for scene in (pushed, tilted))
    assert path_error(one, other) < 1e-13  # measured 4.6e-15
    assert pushed.steady
    motions = [rb.simulate(scene, TIMES) for scene in (pushed, tilted)]
    assert path_error(*motions) < 1e-12  # measured 1.0e-16


def test_both_engines_agree_on_a_moving_plane() -> None:
    """Over 10 s with "accurate"; a plane that moves the opposite way gives another path."""
    theory = rb.integrate(VIBRATED)
    motion = rb.simulate(VIBRATED, settings="accurate")
    assert motion.report.faults == ()
    assert path_error(motion, theory) < 1e-9  # measured 1.2e-10
    other = moved(VIBRATED, VIBRATED.plane_motion[0], 0.0, sine(-3.0, 2.25, np.pi / 2))
    assert path_error(rb.integrate(other), theory) > 1e-2


def test_gravity_is_updated_at_every_stage_of_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise RK4 would be of first order.

    Half the step reduces the error by 16.1 (measured), and by 2.0 if gravity is held over a step.
    """
    theory, steps = rb.integrate(VIBRATED, TIMES), (10e-3, 5e-3)
    settings = [replace(rb.preset("balanced"), timestep=step) for step in steps]

    def gain() -> float:
        errors = [
            path_error(rb.simulate(VIBRATED, TIMES, settings=preset), theory) for preset in settings
        ]
        return errors[0] / errors[1]

    assert gain() > 12
    fall = Control.fall

    def held(self: Control, model: Any, data: Any) -> None:
        t, step = data.time, model.opt.timestep
        data.time = np.floor(t / step + 1e-6) * step
        fall(self, model, data)
        data.time = t

    monkeypatch.setattr(Control, "fall", held)
    assert gain() < 3


def test_exact_is_accurate_on_a_vibrated_plane() -> None:
    """Path, M and γ over the 4 s in which the ball swings itself up.

    Measured 3.4e-11, 2.7e-11 and 5.8e-11 rad, from the contact depth.
    """
    pair = pair_of(VIBRATED, "exact", rb.sample_times(4.0))
    assert pair.report.faults == ()
    vertical = np.linalg.norm(pair.motion.gamma - pair.theory.gamma, axis=1).max()
    assert pair.path_error < 1e-10
    assert pair.momentum_error < 8e-11
    assert vertical < 1.8e-10


def test_the_position_in_space_includes_the_displacement_of_the_plane() -> None:
    """Closed forms for a constant acceleration, a ramp, and a sine that starts at its crest."""
    push, ramp = 0.2, rb.Ramp(final=1.0, start=0.2, end=0.6)
    w, t = 2 * np.pi * 3.0, TIMES
    scene = moved(FIG12, push, ramp, sine(2.0, 3.0, np.pi / 2))
    motion = rb.integrate(scene, TIMES)
    plane = rb.in_space(motion) - np.pad(motion.contact_point, ((0, 0), (0, 1)))
    u = np.clip((t - 0.2) / 0.4, 0.0, 1.0)
    after = np.maximum(t - 0.6, 0.0)
    ramped = 0.4**2 * u**3 / 6 + 0.2 * after + after**2 / 2
    swung = 2 / w**2 * (1 - np.cos(w * t))
    expected = np.stack([push * t**2 / 2, ramped, swung], axis=1)
    assert np.abs(plane - expected).max() < 1e-14  # measured 2.2e-16


def test_a_moving_plane_is_written_to_files(tmp_path: Path) -> None:
    """Scene files reproduce it exactly; an export has its gravity over time."""
    motion = (0.5, rb.Ramp(final=1.0, end=0.4), rb.Sum((0.2, sine(2.0, 3.0))))
    scene = moved(VIBRATED, *motion)
    (tmp_path / "vibrated_ball.toml").write_text(rb.scene_toml(scene))
    assert rb.load_scene(tmp_path / "vibrated_ball.toml").plane_motion == motion
    rb.export_scene(scene, tmp_path / "out", TIMES)
    columns = np.genfromtxt(tmp_path / "out/drives.csv", delimiter=",", names=True, skip_header=2)
    exported = np.stack([columns[f"gravity_{axis}"] for axis in "XYZ"], axis=1)
    assert (exported == scene.gravity_at(TIMES)).all()


@pytest.mark.parametrize("name", [name for name in OURS if name not in ("mujoco", "multibody")])
def test_engines_that_keep_the_plane_still_refuse_planes_that_move_or_turn(name: str) -> None:
    """The other engines set gravity and the plane's rotation at every step."""
    moves = name in ("bullet", "dart", "mujoco-warp", "pinocchio", "rapier")
    for scene in (moved(FIG12, 0.0, 0.0, sine(2.0, 3.0)), rb.load_scene("turntable")):
        why = engine_named(name).cannot_express(scene)
        assert why is None if moves else unnamed("plane moves turns", str(why)) == []
