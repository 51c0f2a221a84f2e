"""Judge names the mistake that is planted, and plants none itself."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.mechanics import momentum_at
from robotball.rotations import Array, rotation_matrix
from tests import euler_engine
from tests.euler_engine import angular_velocity, euler
from tests.random_robots import random_scene as random_robot_scene
from tests.validation.studies.planting import IN_FILES, IN_SCENES, WRONG_INERTIAS
from validation import judge
from validation.studies.judge import FileJudgement, lines
from validation.studies.random_runs import random_scene

NAMES = ("fig12", "classical_regular", "wobbling_drive", "three_rotors", "classical_chaotic")
OFF_BALANCE = ("pendulum_robot", "tilting_gyroscope")
SCENES = (*map(rb.load_scene, NAMES), *map(random_scene, range(1, 6)))
STEPS = (0.02, 0.005)  # s: first-order errors of the attitude of up to 3, and of 0.9 rad
END = 5.0  # s


def judged(scene: rb.Scene, trajectory: rb.Trajectory) -> FileJudgement:
    return judge(scene, trajectory).files[0]


def bare(
    motion: rb.Motion, height: float = np.nan, rows: Any = slice(None), **others: Array
) -> rb.Trajectory:
    """Times, path and attitude of a motion, or of some of its rows, without its rates."""
    position = np.column_stack([motion.contact_point, np.full(len(motion.times), height)])
    told = motion.times[rows], position[rows], motion.attitude[rows]
    return rb.Trajectory("a", *told, others=others or None)


def exact(scene: rb.Scene, end: float = END, rows: int = 500) -> rb.Trajectory:
    """The equations' own, in a row more than so many."""
    motion = rb.integrate(scene, np.linspace(0, end, rows + 1))
    return replace(bare(motion, scene.ball.radius), angular_velocity=motion.angular_velocity)


def run(scene: rb.Scene, timestep: float = 0.005) -> rb.Trajectory:
    return euler(scene, timestep, round(0.02 / timestep), END)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(IN_FILES)))
def test_a_mistake_in_a_file_is_named(number: int) -> None:
    """21 of 21, and nothing else is named; in files by a first-order engine."""
    words, plant = list(IN_FILES.items())[number]
    scene = SCENES[(number + 5) % len(SCENES)]
    trajectory = run(scene, STEPS[number % 2])
    found = judged(scene, plant(trajectory, scene))
    assert [words in each.name for each in found.mistakes] == [True], found.mistakes
    # What is left is the engine's error alone.
    right = judge(scene, trajectory, tolerance=1.0).files[0]
    assert found.best.path_error == pytest.approx(right.plain.path_error, rel=1e-6, abs=1e-9)
    assert found.best.attitude_error == pytest.approx(right.plain.attitude_error, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("words", IN_SCENES)
def test_a_mistake_in_setting_up_the_scene_is_named(words: str) -> None:
    """The engine rolls another ball, or from another start; nothing else is named."""
    number = list(IN_SCENES).index(words)
    scene = SCENES[(0, 3, 5, 0, 6, 1, 5, 2, 9)[number]]
    found = judged(scene, run(IN_SCENES[words](scene)))
    assert [words in each.name for each in found.mistakes] == [True], found.mistakes


@pytest.mark.slow
@pytest.mark.parametrize("words", WRONG_INERTIAS)
def test_a_wrong_inertia_is_named(words: str) -> None:
    """Exchanged, or about a point that is 55 or 20 mm off; nothing is left of the error."""
    number = list(WRONG_INERTIAS).index(words)
    scene = (SCENES[7], SCENES[5], *map(rb.load_scene, OFF_BALANCE))[number]
    found = judged(scene, exact(WRONG_INERTIAS[words](scene)))
    assert [each.name for each in found.mistakes] == [words]
    assert found.best.path_error < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.01, 0.99])
@pytest.mark.parametrize("number", [0, 1, 6])
def test_a_clock_that_is_a_hundredth_off_is_named(number: int, factor: float) -> None:
    """By its factor; nothing is left of the error."""
    scene = SCENES[number]
    right = exact(scene)
    found = judged(scene, replace(right, times=factor * right.times))
    assert [each.name for each in found.mistakes] == [
        f"the times are {factor:g} times what they should be"
    ]
    assert found.best.path_error < 1e-6  # measured 2e-8, of the factor


def clamped(scene: rb.Scene, monkeypatch: pytest.MonkeyPatch) -> rb.Trajectory:
    """By an engine in which no angular velocity's part is more than 0.7 of the largest."""
    most = 0.7 * float(np.abs(rb.integrate(scene, scene.times).angular_velocity).max())

    def slower(*state: Any) -> Array:
        return np.clip(angular_velocity(*state), -most, most)

    monkeypatch.setattr(euler_engine, "angular_velocity", slower)
    return run(scene)


def lighter(scene: rb.Scene) -> rb.Scene:
    frame = replace(scene.ball.frame, inertia=0.8 * scene.ball.frame.inertia)
    return replace(scene, ball=replace(scene.ball, frame=frame))


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 6])
def test_a_mistake_that_is_not_known_has_no_name(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clamp of the rates, another inertia, noise in what is written."""
    scene, rng = SCENES[number], np.random.default_rng(5)
    right = exact(scene)
    moved = replace(right, position=right.position + rng.normal(0, 0.3, right.position.shape))
    turned = right.attitude + rng.normal(0, 0.1, right.attitude.shape)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    files = clamped(scene, monkeypatch), exact(lighter(scene)), moved
    for file in (*files, replace(right, attitude=turned)):
        found = judged(scene, file)
        assert found.mistakes == ()
        assert not found.agrees


def spinning(rate: float) -> rb.Scene:
    """A frame that spins in a shell that hardly turns at the start."""
    scene = replace(rb.load_scene("fig12"), frame_rate=rate, duration=1.0)
    attitude, rates = scene.start.attitude, np.array([hinge.rate for hinge in scene.hinges])
    up, slow = rotation_matrix(attitude)[2], np.array([2.0, 1.0, 0.0])
    omega = slow - up * (up @ slow) + rate * scene.ball.shell.axis
    M = momentum_at(scene.ball, scene.rolling, attitude, omega, 0 * rates, rates)
    return replace(scene, start=rb.Start(attitude, M * [1, 1, 0]))


@pytest.mark.slow
def test_a_limit_of_the_rates_is_not_taken_for_degrees() -> None:
    """ω in deg/s and of the shell is nearly 130 rad/s, for any 100 rad/s of the frame.

    Of an engine with this limit nothing is named; of a file with it, that ω is not the attitude's.
    """
    scene = spinning(130.0)
    found = judged(scene, exact(spinning(100.0), 1.0))
    assert found.mistakes == ()
    right = exact(scene, 1.0)
    assert right.angular_velocity is not None
    limited = np.clip(right.angular_velocity, -100, 100)
    (mistake,) = judged(scene, replace(right, angular_velocity=limited)).mistakes
    assert mistake.name == "the angular velocity is not the attitude's rate"


@pytest.mark.slow
def test_a_hundredth_of_the_inertia_does_not_agree() -> None:
    """The path is within the tolerance, and the attitude is not."""
    scene = rb.load_scene("fig12")
    frame = replace(scene.ball.frame, inertia=1.01 * scene.ball.frame.inertia)
    found = judged(scene, exact(replace(scene, ball=replace(scene.ball, frame=frame))))
    assert found.mistakes == ()
    assert found.plain.path_error < found.tolerance < found.plain.attitude_error
    assert not found.agrees


@pytest.mark.slow
@pytest.mark.parametrize("timestep", STEPS)
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_a_right_file_has_no_mistake(scene: rb.Scene, timestep: float) -> None:
    """20 of 20 by a first-order engine, whose attitudes are off by 0.002 to 3 rad."""
    found = judged(scene, run(scene, timestep))
    assert found.mistakes == ()
    assert found.plain.attitude_error > 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["naive", "fast", "accurate"])
@pytest.mark.parametrize("name", ["fig12", "classical_regular"])
def test_a_contact_engines_file_has_no_mistake(name: str, preset: str, tmp_path: Path) -> None:
    """Path errors from 1e-12 to 0.6, with slip, lost contact and hinges off their rates."""
    scene = rb.load_scene(name)
    rb.simulate(scene, settings=preset).save(tmp_path / "run.csv")
    found = judge(scene, tmp_path / "run.csv").files[0]
    assert found.mistakes == ()
    assert found.agrees == (preset != "naive")


@pytest.mark.slow
def test_two_mistakes_of_different_kinds_are_both_named() -> None:
    """The order of the quaternion, and a unit of length; what is left is the engine's error."""
    scene = rb.load_scene("fig12")
    right = run(scene)
    both = IN_FILES["the quaternion's order is x, y, z, w"](right, scene)
    found = judged(scene, IN_FILES["the positions are in cm"](both, scene))
    names = {each.name for each in found.mistakes}
    assert names == {"the positions are in cm", "the quaternion's order is x, y, z, w"}
    assert found.best.path_error < 0.02  # measured 9e-3, of the engine


@pytest.mark.slow
def test_mistakes_that_tell_the_same_are_named_together() -> None:
    """Half a turn about the vertical of the world is both signs of x, y, and no other mistake."""
    scene = rb.load_scene("fig12")
    right = run(scene)
    turned = replace(right, position=right.position * [-1, -1, 1])
    (mistake,) = judged(scene, turned).mistakes
    assert mistake.name == "x and y both have the other sign"


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.02, -0.013, 0.0003])
def test_a_shift_in_time_is_found(shift: float) -> None:
    """To a millionth of a second where the engine is exact, and it is no mistake.

    Measured: 3e-9 s off; the errors fall 1e4 times and more.
    """
    scene = rb.load_scene("fig12")
    motion = rb.integrate(scene, np.linspace(0, 5, 251))
    times = motion.times + shift
    keep = times >= 0
    late = rb.Trajectory("run.csv", times[keep], bare(motion).position[keep], motion.attitude[keep])
    found = judged(scene, late)
    assert found.mistakes == ()
    assert found.lag.explains
    assert found.lag.shift == pytest.approx(shift, abs=1e-6)
    way = "late" if shift > 0 else "early"
    assert any(f"{abs(shift):.4g} s {way}" in line for line in lines(found))


@pytest.mark.slow
def test_slip_is_measured_and_not_taken_for_the_numerical_error() -> None:
    """A path that is longer by a hundredth slips; the radius at which it rolls says so."""
    scene = rb.load_scene("fig12")
    motion = rb.integrate(scene)
    longer = replace(motion, contact_point=1.01 * motion.contact_point)
    plain = judged(scene, bare(longer, 1.0)).plain
    assert plain.slip is not None
    assert plain.spin is not None
    (slip, error), (spin, spin_error) = plain.slip, plain.spin
    assert slip > 50 * error  # measured 5e-2 m/s and 5e-4
    assert abs(spin) < spin_error
    assert plain.motion.rolling_radius == pytest.approx(1.01, abs=1e-5)


@pytest.mark.slow
def test_what_a_plain_loop_writes_of_an_exported_model_is_named(tmp_path: Path) -> None:
    """MuJoCo's free joint has the shell's attitude, and its ω in the shell's own axes.

    Without that the file is off by the first order of implicitfast at 1 ms alone: measured 2.9e-3
    of the path, and 5e-2 rad.
    """
    scene = rb.load_scene("fig12")
    rb.export_scene(scene, tmp_path)
    servos = "".join(f'<velocity joint="{h.name}" kv="1000"/>' for h in scene.hinges)
    text = (tmp_path / "model.xml").read_text()
    text = text.replace("</mujoco>", f"<actuator>{servos}</actuator></mujoco>")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.noslip_iterations = 1e-3, 3
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl = [hinge.rate for hinge in scene.hinges]
    rows = []
    for i in range(5001):
        if i % 10 == 0:
            rows.append(np.concatenate([[data.time], data.qpos[:7], data.qvel[3:6]]))
        mujoco.mj_step(model, data)
    names = "time,pos_x,pos_y,pos_z,qw,qx,qy,qz,wx,wy,wz"
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=names, comments="")
    found = judge(scene, tmp_path / "run.csv").files[0]
    assert {each.name for each in found.mistakes} == {
        "the attitude is the shell's, not the frame's",
        "the angular velocity is in the shell's axes; "
        "the angular velocity is the shell's, not the frame's",
    }
    assert found.best.path_error < 4e-3
    assert found.best.attitude_error < 7e-2


@pytest.mark.slow
def test_a_robot_is_judged_as_far_as_its_file_says() -> None:
    """Of a motor that it says nothing of, momentum, slip and spin are not known; the rest is."""
    scene = random_robot_scene(np.random.default_rng(2))
    motion = rb.integrate(scene, np.linspace(0, 1, 101))
    silent = bare(motion)
    found = judged(scene, silent)
    assert (found.plain.momentum_error, found.plain.slip, found.plain.spin) == (None, None, None)
    assert found.agrees
    words = "the frame has a motor, and the file says nothing of it: the momentum and slip and spin"
    assert any(line.startswith(words) for line in lines(found))
    rates = {f"{h.name}_rate": motion.hinge_rates[:, i] for i, h in enumerate(scene.hinges)}
    angles = {f"{h.name}_angle": motion.hinge_angles[:, i] for i, h in enumerate(scene.hinges)}
    told = judged(scene, replace(silent, others=rates | angles)).plain
    assert told.momentum_error is not None
    assert told.slip is not None
    assert told.momentum_error < told.momentum_known_to  # measured 1e-6 and 7e-4
    assert told.slip[0] < told.slip[1]
    mixed = replace(silent, attitude=silent.attitude[:, [1, 2, 3, 0]])
    (mistake,) = judged(scene, mixed).mistakes
    assert mistake.name == "the quaternion's order is x, y, z, w"


def test_the_rate_of_a_hinge_is_held_against_the_references() -> None:
    """Without its angle it tells nothing of M; of the other sign it is off by twice itself."""
    scene = rb.load_scene("steered_pendulum_robot")
    motion = rb.integrate(scene, np.linspace(0, 1, 101))
    rates = motion.hinge_rates[:, 1]
    assert judged(scene, bare(motion, pendulum1_rate=rates)).agrees
    wrong = judged(scene, bare(motion, pendulum1_rate=-rates))
    assert not wrong.agrees
    assert any(
        line == "the pendulum1's rate is off by 2.0e+00 of it, and about -1 times what it should be"
        for line in lines(wrong)
    )


BOUND = "within 0.01 in path and momentum, and 0.01 rad in attitude, over"


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (0.02, f"too short to judge, with less than 10%; {BOUND} 0.02 s of the scene's 10 s"),
        (1.0, f"agrees {BOUND} 1 s of the scene's 10 s"),
    ],
)
def test_a_file_says_how_much_of_the_scene_it_covers(end: float, words: str) -> None:
    """Less than a tenth agrees with nothing."""
    found = judged(rb.load_scene("fig12"), exact(rb.load_scene("fig12"), end, round(end / 0.02)))
    assert found.agrees == (end == 1.0)
    assert lines(found)[-1] == f"verdict: {words}"


def test_a_long_file_is_judged_by_some_of_its_rows() -> None:
    """A line says so; the first and the last are among them."""
    scene = rb.load_scene("fig12")
    right = exact(scene, rows=50_000)
    wrong = replace(right, position=1.005 * right.position)
    found = judged(scene, wrong)
    assert "judged by 20000 of its 50001 rows" in lines(found)
    assert found.trajectory.times[[0, -1]].tolist() == [0, END]
    path = right.position[:, :2]
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    off = 0.005 * np.linalg.norm(path, axis=1).max() / length
    assert found.plain.path_error == pytest.approx(off, rel=1e-6)


@pytest.mark.slow
def test_files_of_several_steps_have_an_order() -> None:
    """The first order of Euler's method (measured 1.02 and 1.00); by the header's steps too."""
    scene = rb.load_scene("fig12")
    steps = (0.01, 0.005, 0.0025)
    files = [euler(scene, step, round(0.02 / step), 2.0) for step in steps]
    judgement = judge(scene, files, timesteps=steps)
    assert [each.measure for each in judgement.orders] == ["path error", "attitude error"]
    for each in judgement.orders:
        assert each.order == pytest.approx(1.0, abs=0.05)
    headed = [
        replace(file, header={"timestep": str(step)})
        for file, step in zip(files[:2], steps, strict=False)
    ]
    for each in judge(scene, headed).orders:
        assert each.order == pytest.approx(1.0, abs=0.05)
        assert each.stderr is None
    assert judge(scene, files[:2]).orders == ()


def test_a_file_in_milliseconds_is_refused_with_the_unit() -> None:
    """A time beyond all scenes is another unit; what to write is said."""
    scene = rb.load_scene("fig12")
    file = run(scene)
    with pytest.raises(rb.InputError, match=r"t goes to 5000 s, and fig12 lasts 10 s; if t is in"):
        judge(scene, replace(file, times=1e3 * file.times))


def test_a_file_of_another_scene_is_told(tmp_path: Path) -> None:
    """By the scene in its header."""
    rb.integrate(rb.load_scene("fig13"), np.linspace(0, 1, 51)).save(tmp_path / "a.csv")
    found = judge(rb.load_scene("fig12"), tmp_path / "a.csv").files[0]
    assert "the file's header has another scene than this one: fig13" in lines(found)


def test_a_file_that_starts_late_is_judged_from_there() -> None:
    """Its times are the scene's own; nothing is shifted."""
    scene = rb.load_scene("fig12")
    motion = rb.integrate(scene, np.linspace(0, 5, 251))
    late = bare(motion, 1.0, slice(50, None))
    found = judged(scene, late)
    assert found.mistakes == ()
    assert found.plain.path_error < 1e-12  # measured 4e-15
