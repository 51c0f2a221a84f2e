"""`judge` names a planted mistake in the file or in the scene, and no other."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.motion import attitude_error, path_error
from robotball.robot.drives import Constant, Rate, as_drive
from robotball.robot.formulas import Rolling
from robotball.robot.scene import Friction
from robotball.robot.variations import scaled_rate
from robotball.rotations import Array, conjugate, from_matrix, multiply, rotation_matrix
from tests.conftest import Robotball
from tests.euler_engine import euler
from tests.messages import naming, unnamed, untold
from tests.random_balls import ball_of_points
from tests.random_robots import random_scene as random_robot_scene
from tests.robotball.theory.test_friction import regular, sphere
from tests.robots import with_frame
from validation import judge
from validation.studies import mistakes
from validation.studies.judge import FileJudgement, lines

NAMES = ("fig12", "classical_regular", "wobbling_drive", "three_rotors", "classical_chaotic")
SCENES = (*map(rb.load_scene, NAMES), *map(ball_of_points, range(1, 6)))
FIG12 = SCENES[0]
STEPS = (0.02, 0.005)  # s; the first-order engine's attitude errors reach 1 and 0.3 rad
END, INTERVAL = 2.0, 0.04  # s


def judged(scene: rb.Scene, trajectory: rb.Trajectory | Path) -> FileJudgement:
    return judge(scene, trajectory).files[0]


def bare(
    motion: rb.Motion, height: float = np.nan, rows: Any = slice(None), **others: Array
) -> rb.Trajectory:
    """Return times, path and attitude of a motion, or of selected rows, without its rates."""
    position = np.column_stack([motion.contact_point, np.full(len(motion.times), height)])
    columns = motion.times[rows], position[rows], motion.attitude[rows]
    return rb.Trajectory("a", *columns, others=others or None)


def exact(scene: rb.Scene, end: float = END, rows: int = 50) -> rb.Trajectory:
    """Return the equations' motion in rows + 1 samples."""
    motion = rb.integrate(scene, np.linspace(0, end, rows + 1))
    return replace(bare(motion, scene.ball.radius), angular_velocity=motion.angular_velocity)


def run(scene: rb.Scene, timestep: float = STEPS[1]) -> rb.Trajectory:
    """Return the trajectory of a first-order engine."""
    return euler(scene, timestep, round(INTERVAL / timestep), END)


InFile = Callable[[rb.Trajectory, rb.Scene], rb.Trajectory]
InScene = Callable[[rb.Scene], rb.Scene]


def changed(name: str, change: Callable[[Array, rb.Trajectory, rb.Scene], Array]) -> InFile:
    """Replace one of a file's arrays by a function of it, of the file and of the scene."""

    def planted(file: rb.Trajectory, scene: rb.Scene) -> rb.Trajectory:
        changes: dict[str, Any] = {name: change(getattr(file, name), file, scene)}
        return replace(file, **changes)

    return planted


def turned(of: Callable[[rb.Trajectory, rb.Scene], Array]) -> InFile:
    """Rotate the frame's axes by a quaternion (4,) or (n, 4)."""
    return changed(
        "attitude", lambda q, file, scene: multiply(q, np.broadcast_to(of(file, scene), q.shape))
    )


def in_shell(file: rb.Trajectory, scene: rb.Scene) -> Array:
    """Return the shell's attitude (n, 4) in the frame."""
    angles = np.asarray(scene.drives[0].angle(file.times))
    turns = Rotation.from_rotvec(np.outer(-angles, scene.ball.shell.axis))
    return np.asarray(turns.as_quat(scalar_first=True))


def rotated(q: Array, v: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", rotation_matrix(q), v))


def of_shell(w: Array, file: rb.Trajectory, scene: rb.Scene) -> Array:
    return w - np.outer(scene.drives[0].rate(file.times), scene.ball.shell.axis)


def world(S: Array, frame: bool) -> InFile:
    """Use the rows of S as the axes of the world, and of the frame."""
    P = from_matrix(S * np.linalg.det(S).round())

    def planted(file: rb.Trajectory, _: rb.Scene) -> rb.Trajectory:
        q = multiply(np.broadcast_to(P, file.attitude.shape), file.attitude)
        w = file.angular_velocity
        if frame:
            q = multiply(q, np.broadcast_to(conjugate(P), q.shape))
            w = None if w is None else w @ rotation_matrix(P).T
        return replace(file, position=file.position @ S.T, attitude=q, angular_velocity=w)

    return planted


CYCLED, Y_UP = np.eye(3)[[1, 2, 0]], np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
RATE = "angular_velocity"
IN_FILES: dict[str, InFile] = {
    "quaternion x,~y,~z,~w": changed("attitude", lambda q, *_: q[:, [1, 2, 3, 0]]),
    "qx,~qy,~qz,~qw w,~x,~y,~z": changed("attitude", lambda q, *_: q[:, [3, 0, 1, 2]]),
    "world~to~frame": changed("attitude", lambda q, *_: conjugate(q)),
    "attitude shell": turned(in_shell),
    "axes~of~the~shell angular~velocity": changed(
        RATE,
        lambda w, file, scene: rotated(conjugate(in_shell(file, scene)), of_shell(w, file, scene)),
    ),
    "positions feet": changed("position", lambda p, *_: p / 0.3048),
    "frame's~axes x,~y,~z y,~z,~x": turned(lambda *_: conjugate(from_matrix(CYCLED))),
    "positions mm": changed("position", lambda p, *_: 1e3 * p),
    "positions inches": changed("position", lambda p, *_: p / 0.0254),
    "x,~y y,~x": changed("position", lambda p, *_: p[:, [1, 0, 2]]),
    "x,~y x,~-y": changed("position", lambda p, *_: p * [1, -1, 1]),
    "x,~y -x,~-y": changed("position", lambda p, *_: p * [-1, -1, 1]),
    "path (0,~0)": changed("position", lambda p, *_: p + np.array([3, -1, 0])),
    "angular~velocity world~axes": changed(RATE, lambda w, file, _: rotated(file.attitude, w)),
    "angular~velocity deg/s": changed(RATE, lambda w, *_: np.degrees(w)),
    "angular~velocity sign": changed(RATE, lambda w, *_: -w),
    "angular~velocity describes~the~shell": changed(RATE, of_shell),
    "angular~velocity rate attitude": changed(RATE, lambda w, *_: 0.9 * w),
    "x,~z,~-y Y": world(Y_UP, frame=False),
    "x,~z,~y Y left-handed": world(np.eye(3)[[0, 2, 1]], frame=True),
    "x,~-y,~-z Z": world(np.diag([1.0, -1, -1]), frame=False),
}


PLANTED = [
    *((name,) for name in IN_FILES),
    ("positions mm", "quaternion x,~y,~z,~w"),
    # MuJoCo's qpos and qvel of a free joint of the shell.
    ("axes~of~the~shell angular~velocity", "attitude shell"),
]


# Every run of the tests includes every twelfth case.
@pytest.mark.parametrize(
    "number",
    [pytest.param(n, marks=() if n % 12 == 2 else pytest.mark.study) for n in range(len(PLANTED))],
)
def test_a_mistake_in_a_file_is_named(number: int) -> None:
    """Nothing else is named, and the remaining error is the error of the first-order engine."""
    names, scene = PLANTED[number], SCENES[(number + 5) % len(SCENES)]
    file = right = run(scene, STEPS[number % 2])
    for name in names:
        file = IN_FILES[name](file, scene)
    verdict = judged(scene, file)
    assert len(verdict.mistakes) == len(names), verdict.mistakes
    assert untold(names, [mistake.name for mistake in verdict.mistakes]) == []
    theory, motion = rb.integrate(scene, right.times), rb.recorded(scene, right)
    assert verdict.best.path_error == pytest.approx(path_error(motion, theory), rel=1e-6, abs=1e-9)
    assert verdict.best.attitude_error == pytest.approx(attitude_error(motion, theory), rel=1e-6)


@pytest.mark.parametrize(
    ("number", "factor"), [(0, 1.01), pytest.param(6, 0.99, marks=pytest.mark.study)]
)
def test_a_clock_that_is_a_hundredth_off_is_named(number: int, factor: float) -> None:
    """Undoing the factor removes the error."""
    scene = SCENES[number]
    right = exact(scene)
    verdict = judged(scene, replace(right, times=factor * right.times))
    assert untold([f"times {factor:g}"], [mistake.name for mistake in verdict.mistakes]) == []
    assert verdict.best.path_error < 1e-6  # measured 2e-8; the factor is fitted


def with_rate(hinge: int, factor: float) -> InScene:
    """Multiply the rate of the frame (0) or of a rotor by a factor."""

    def planted(scene: rb.Scene) -> rb.Scene:
        rates = [hinge.command for hinge in scene.ball.hinges]
        rates[hinge] = scaled_rate(scene.drives[hinge], factor)
        return scene.with_hinges(command=rates)

    return planted


def start_at(change: Callable[[Array], Array]) -> InScene:
    """Start at another attitude with the same angular velocity in frame axes."""
    return lambda scene: started(
        scene, change(scene.start.attitude), scene.angular_velocity_at(scene.start)
    )


def started(scene: rb.Scene, attitude: Array, omega: Array) -> rb.Scene:
    at = replace(scene, start=rb.Start(attitude, np.zeros(3)))
    level = 0.0 if scene.rolling == "rubber" else 1.0
    return replace(at, start=rb.Start(attitude, at.momentum_of(omega) * [1.0, 1.0, level]))


def other_rolling(scene: rb.Scene) -> rb.Scene:
    """Change the rolling model and keep M, without the part that a rubber ball cannot have."""
    other: Rolling = "rubber" if scene.rolling == "classical" else "classical"
    start = replace(scene.start, momentum=scene.start.momentum * [1, 1, 0])
    return replace(scene, rolling=other, start=start)


RATES: list[Rate] = [
    2.0, np.cos, rb.Custom(np.cos), Constant(2.0), rb.Ramp(initial=1.0, final=3.0, end=0.5),
    rb.Samples(times=(0.0, 1.0), values=(1.0, 2.0)),
    rb.Sum((1.0, rb.Sine(amplitude=2.0, frequency=0.7, mean=0.5))),
]  # fmt: skip


@pytest.mark.parametrize("rate", RATES)
def test_a_rate_of_any_kind_is_scaled(rate: Rate) -> None:
    """The scaled rate is three times as large at any time."""
    plain, three = (as_drive(drive, 1.0) for drive in (rate, scaled_rate(as_drive(rate, 1.0), 3.0)))
    for t in (0.1, 0.4, 0.9):
        assert three.rate(t) == pytest.approx(3 * plain.rate(t), rel=1e-12)


IN_SCENES: list[tuple[str, int, InScene]] = [
    ("frame's~rate sign", 0, with_rate(0, -1)),
    ("rotor1's~rate sign", 3, with_rate(1, -1)),
    ("frame's~rate zero", 6, with_rate(0, 0.0)),
    ("frame's~rate degrees", 0, with_rate(0, np.pi / 180)),
    ("spin rubber", 1, other_rolling),
    ("spin classical", 5, other_rolling),
    ("attitude conjugate", 2, start_at(conjugate)),
    ("attitude x,~y,~z,~w", 9, start_at(lambda q: q[[3, 0, 1, 2]])),
]


@pytest.mark.parametrize(
    ("facts", "number", "plant"),
    [
        pytest.param(*e, marks=() if i % 6 == 1 else pytest.mark.study)
        for i, e in enumerate(IN_SCENES)
    ],
)
def test_a_mistake_in_setting_up_the_scene_is_named(
    facts: str, number: int, plant: InScene
) -> None:
    """The engine used another drive, model or start, and nothing else is named."""
    scene = SCENES[number]
    verdict = judged(scene, run(plant(scene)))
    assert untold([facts], [mistake.name for mistake in verdict.mistakes]) == []
    assert verdict.best.path_error < 0.02


@pytest.mark.parametrize(
    "mistake", ["inertia", "radius", "path", pytest.param("attitude", marks=pytest.mark.study)]
)
def test_an_unknown_mistake_has_no_name(mistake: str) -> None:
    """Examples: a wrong number of the scene, and noise in the file."""
    scene, rng = SCENES[6 if mistake == "attitude" else 0], np.random.default_rng(5)
    file = exact(scene)
    if mistake == "inertia":
        frame = replace(scene.ball.frame, inertia=1.01 * scene.ball.frame.inertia)
        file = exact(scene.with_hinges(body={"frame": frame}))
    elif mistake == "radius":
        shell = replace(scene.ball.shell, radius=1.1 * scene.ball.radius)
        file = exact(replace(scene, ball=replace(scene.ball, shell=shell)))
    elif mistake == "path":
        file = replace(file, position=file.position + rng.normal(0, 0.3, file.position.shape))
    else:
        noisy = file.attitude + rng.normal(0, 0.1, file.attitude.shape)
        file = replace(file, attitude=noisy / np.linalg.norm(noisy, axis=1, keepdims=True))
    verdict = judged(scene, file)
    assert (verdict.mistakes, verdict.agrees) == ((), False)
    if mistake == "inertia":  # the path is within the tolerance, and the attitude is not
        assert verdict.plain.path_error < verdict.tolerance < verdict.plain.attitude_error


def test_a_swing_that_is_slower_is_not_taken_for_a_slow_clock() -> None:
    """A longer clock explains the path to 1e-5 but leaves an error of 4 % in ω.

    The frame's inertia was taken about the sphere's centre instead of its centre of mass.
    """
    scene = rb.load_scene("pendulum_robot")
    frame = scene.ball.frame
    r, m = frame.centre, frame.mass
    slower = replace(frame, inertia=frame.inertia + m * (r @ r * np.eye(3) - np.outer(r, r)))
    verdict = judged(scene, exact(scene.with_hinges(body={"frame": slower}), 0.5, 25))
    assert (verdict.mistakes, verdict.agrees) == ((), False)


def spinning(rate: float) -> rb.Scene:
    """Spin the frame in a shell that hardly turns at the start."""
    scene = replace(FIG12.with_hinges(command={"frame": rate}), duration=0.25)
    up, slow = rotation_matrix(scene.start.attitude)[2], np.array([2.0, 1.0, 0.0])
    omega = slow - up * (up @ slow) + rate * scene.ball.shell.axis
    return started(scene, scene.start.attitude, omega)


def test_a_limit_of_the_rates_is_not_taken_for_degrees() -> None:
    """Rates limited to 100 rad/s look like ω of the shell in deg/s, of nearly 130 rad/s.

    An engine with the limit has no mistake. A file with limited ω contradicts its attitude.
    """
    scene = spinning(130.0)
    assert judged(scene, exact(spinning(100.0), 0.25, 60)).mistakes == ()
    right = exact(scene, 0.25, 60)
    assert right.angular_velocity is not None
    limited = np.clip(right.angular_velocity, -100, 100)
    (mistake,) = judged(scene, replace(right, angular_velocity=limited)).mistakes
    assert unnamed("angular~velocity rate attitude", mistake.name) == []


@pytest.mark.parametrize(
    "number", [0, *(pytest.param(n, marks=pytest.mark.study) for n in (2, 4, 6, 8))]
)
def test_a_right_file_has_no_mistake(number: int) -> None:
    """A first-order engine's attitude errors of 0.005 to 1.1 rad are not called mistakes."""
    verdict = judged(SCENES[number], run(SCENES[number], STEPS[0]))
    assert verdict.mistakes == ()
    assert verdict.plain.attitude_error > 2e-3  # measured 4.6e-3 (ball 4) to 1.1


@pytest.mark.parametrize(("name", "preset"), [("fig12", "naive"), ("classical_regular", "fast")])
def test_a_contact_engines_file_has_no_mistake(name: str, preset: str, tmp_path: Path) -> None:
    """Cases: a path error of 0.6 with slip, lost contact and wrong hinge rates; one of 1e-7."""
    scene = rb.load_scene(name)
    rb.simulate(scene, rb.sample_times(3.0), settings=preset).save(tmp_path / "run.csv")
    verdict = judged(scene, tmp_path / "run.csv")
    assert verdict.mistakes == ()
    assert verdict.agrees == (preset != "naive")


@pytest.mark.parametrize(
    ("truth", "facts"),
    [
        (
            with_frame(sphere((2.0, 0.5), (5.0, -10.0, 3.0), Friction(0.3))),
            "friction.sliding~=~0.3 start.slip~=~[3,~1]",
        ),
        (regular(0.3), "friction.sliding~=~0.3"),
        (
            with_frame(sphere((2.0, 0.0), (10.0, 5.0, 20.0), Friction(0.3, 0.02), "rubber")),
            "friction.sliding~=~0.3 friction.torsional~=~0.02 start.slip~=~[1.5,~1] "
            "start.spin~=~20",
        ),
    ],
)  # fmt: skip
def test_a_ball_that_slips_is_explained_by_its_friction_and_start(
    truth: rb.Scene, facts: str
) -> None:
    """Judged by a scene without limits of friction; against its own scene the file agrees."""
    right = exact(truth, 1.0)
    assert judged(truth, right).agrees
    verdict = judged(truth.ideal, right)
    assert untold([facts], [mistake.name for mistake in verdict.mistakes]) == []
    assert verdict.best.path_error < 1e-4  # measured 1e-14 to 3.2e-5; numerical rates
    assert verdict.best.attitude_error < 2e-2  # measured 4e-13 to 7.0e-3


def test_slip_is_measured_and_not_taken_for_the_numerical_error() -> None:
    """A path that is 1 % too long slips, and its rolling radius is 1 % too large."""
    motion = rb.integrate(FIG12, rb.sample_times(END))
    longer = bare(replace(motion, contact_point=1.01 * motion.contact_point), 1.0)
    plain = judged(FIG12, longer).plain
    assert plain.slip is not None
    assert plain.spin is not None
    assert plain.slip[0] > 50 * plain.slip[1]  # measured 5e-2 m/s and 5e-4
    assert abs(plain.spin[0]) < plain.spin[1]
    assert plain.motion.rolling_radius == pytest.approx(1.01, abs=1e-5)


def test_a_robot_is_judged_as_far_as_its_file_says() -> None:
    """Without a motor's angle or rate, momentum, slip and spin are unknown."""
    scene = random_robot_scene(np.random.default_rng(2))
    motion = rb.integrate(scene, np.linspace(0, 1, 101))
    silent = bare(motion)
    verdict = judged(scene, silent)
    assert (verdict.plain.momentum_error, verdict.plain.slip, verdict.plain.spin) == (
        None,
        None,
        None,
    )
    assert verdict.agrees
    facts = "frame motor file momentum slip spin"
    assert any(not unnamed(facts, line) for line in lines(verdict))
    rates = {f"{h.name}_rate": motion.hinge_rates[:, i] for i, h in enumerate(scene.hinges)}
    angles = {f"{h.name}_angle": motion.hinge_angles[:, i] for i, h in enumerate(scene.hinges)}
    plain = judged(scene, replace(silent, others=rates | angles)).plain
    assert plain.momentum_error is not None
    assert plain.slip is not None
    assert plain.momentum_error < plain.momentum_known_to  # measured 1e-6 and 7e-4
    assert plain.slip[0] < plain.slip[1]
    mixed = replace(silent, attitude=silent.attitude[:, [1, 2, 3, 0]])
    (mistake,) = judged(scene, mixed).mistakes
    assert unnamed("quaternion x,~y,~z,~w", mistake.name) == []


def test_the_rate_of_a_hinge_is_held_against_the_references() -> None:
    """With the other sign its relative error is 2 and its factor -1."""
    scene = rb.load_scene("steered_pendulum_robot")
    motion = rb.integrate(scene, np.linspace(0, 1, 101))
    rates = motion.hinge_rates[:, 1]
    assert judged(scene, bare(motion, pendulum1_rate=rates)).agrees
    wrong = judged(scene, bare(motion, pendulum1_rate=-rates))
    assert not wrong.agrees
    assert any(not unnamed("pendulum1's~rate 2.0e+00 -1", line) for line in lines(wrong))


TOO_SHORT = "short 10%"


@pytest.mark.parametrize(("end", "facts"), [(0.02, TOO_SHORT), (1.0, "agrees")])
def test_a_file_says_how_much_of_the_scene_it_covers(end: float, facts: str) -> None:
    """A file that covers under a tenth of the scene does not agree."""
    verdict = judged(FIG12, exact(FIG12, end, round(end / 0.02)))
    assert verdict.agrees == (end == 1.0)
    bound = f"0.01 path height momentum 0.01~rad attitude {end:g}~s 10~s"
    assert unnamed(f"verdict {facts} {bound}", lines(verdict)[-1]) == []


def test_a_long_file_is_judged_by_some_of_its_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line of the report gives the numbers of rows; the first and last rows are kept."""
    monkeypatch.setattr("validation.studies.judge._ROWS", 200)
    right = exact(FIG12, 1.0, 250)
    verdict = judged(FIG12, replace(right, position=1.005 * right.position))
    assert any(not unnamed("200 251 rows", line) for line in lines(verdict))
    assert verdict.trajectory.times[[0, -1]].tolist() == [0, 1]
    path = verdict.trajectory.position[:, :2] / 1.005
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    off = 0.005 * np.linalg.norm(path, axis=1).max() / length
    assert verdict.plain.path_error == pytest.approx(off, rel=1e-6)


@pytest.mark.parametrize(
    ("clock", "facts"),
    [
        (lambda t: 1e3 * t, "times ms"),
        (lambda t: 1e9 * (t + 77), "times ns start 7.7e+10"),
        (lambda t: t + 1.5e9, "times start 1500000000"),
        (lambda t: t + 5, "times +5~s"),
    ],
)
def test_a_clock_of_another_unit_or_beginning_is_named(
    clock: Callable[[Array], Array], facts: str
) -> None:
    """The rest agrees, to the rounding of times since 1970."""
    right = exact(FIG12, 2.0, 100)
    verdict = judged(FIG12, replace(right, times=clock(right.times)))
    assert untold([facts], [mistake.name for mistake in verdict.mistakes]) == []
    assert verdict.best.path_error < 1e-6  # measured 3e-16 to 1e-7


def test_a_clock_that_starts_after_the_scene_is_named() -> None:
    """The file lacks the scene's first half second."""
    motion = rb.integrate(FIG12, np.linspace(0, END, 101))
    late = bare(motion, 1.0, slice(25, None))
    verdict = judged(FIG12, replace(late, times=late.times - 0.5))
    assert untold(["times -0.5~s"], [mistake.name for mistake in verdict.mistakes]) == []
    assert verdict.best.path_error < 1e-6  # measured 1e-8; the shift is fitted


def test_a_file_far_longer_than_the_scene_is_refused_with_the_unit() -> None:
    """The message names the last time and the scene's duration."""
    file = exact(FIG12)
    with pytest.raises(rb.InputError, match=naming("t 4400~s fig12 10~s")):
        judge(FIG12, replace(file, times=2.2e3 * file.times))


def test_a_file_that_begins_after_the_scene_is_judged_from_its_first_row() -> None:
    """Even if no mistake explains it; a note says so. The errors are those of the file at t = 0."""
    scene = replace(FIG12, duration=END)
    file = exact(replace(scene, start=replace(scene.start, momentum=1.2 * scene.start.momentum)))
    late = judged(scene, replace(file, times=file.times + 8371.923))
    assert any(not unnamed("t first~row 8371.923~s", note) for note in late.trajectory.notes)
    expected = judged(scene, file).plain.path_error
    assert late.plain.path_error == pytest.approx(expected, rel=1e-6)  # measured 1e-10


@pytest.mark.parametrize("column", ["frame_rate", "frame_torque"])
def test_missing_angles_of_a_hinge_with_a_motor_are_named(column: str) -> None:
    """Without them no missing physics is found, even if the rates are known."""
    scene = rb.load_scene("pendulum_robot")
    motion = rb.integrate(replace(scene, friction=Friction(rolling=0.01)), np.linspace(0, 2, 101))
    file = replace(bare(motion), others={column: motion.hinge_rates[:, 0]})
    assert any(not unnamed("frame_angle physics", line) for line in lines(judged(scene, file)))


def test_judge_proposes_a_fit_of_the_given_paths_if_no_cause_is_named(
    robotball: Robotball, tmp_path: Path
) -> None:
    """A ball that resists rolling is named with its angles; without them the paths are printed."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "robot.toml").write_text(rb.scene_toml(rb.load_scene("pendulum_robot")))
    scene = replace(rb.load_scene("pendulum_robot"), friction=Friction(rolling=0.003))
    motion = rb.integrate(scene, np.linspace(0, 4, 101))
    table = np.column_stack([motion.times, motion.contact_point, motion.attitude])
    for columns, title in ((table, ""), (np.hstack([table, motion.hinge_angles]), ",frame_angle")):
        header = f"t,x,y,qw,qx,qy,qz{title}"
        np.savetxt(tmp_path / "in" / "a.csv", columns, delimiter=",", header=header, comments="")
        _, out, _ = robotball("judge", "in/robot.toml", "in/a.csv")
        assert ("robotball fit in/robot.toml in/a.csv" in out) == (not title)
        assert ("WRONG" in out) == bool(title)


def test_a_file_of_another_scene_is_reported(tmp_path: Path) -> None:
    """The file's header names its scene."""
    rb.integrate(rb.load_scene("fig13"), np.linspace(0, 1, 51)).save(tmp_path / "a.csv")
    report = lines(judged(FIG12, tmp_path / "a.csv"))
    assert any(not unnamed("header fig13", line) for line in report)


def test_a_file_that_starts_late_is_judged_from_there() -> None:
    """Its times count from the start of the scene."""
    motion = rb.integrate(FIG12, np.linspace(0, END, 101))
    verdict = judged(FIG12, bare(motion, 1.0, slice(25, None)))
    assert verdict.mistakes == ()
    assert verdict.plain.path_error < 1e-12  # measured 4e-15


@pytest.mark.parametrize(("start", "rise", "agrees"), [
    (1.0, 0.0, True), (0.0, 0.0, True), (0.995, 0.0, True), (1.1, 0.0, False),
    (1.0, 0.5, False), (0.0, 0.04, False),
])  # fmt: skip
def test_a_height_is_judged(start: float, rise: float, agrees: bool) -> None:
    """z of the centre or of the contact point agrees; a ball that rises or hovers does not."""
    motion = rb.integrate(FIG12, rb.sample_times(END))
    height = start + rise * motion.times / END
    file = replace(bare(motion), position=np.column_stack([motion.contact_point, height]))
    verdict = judged(FIG12, file)
    # A soft contact may be 0.005 radii deep.
    error = abs(start + rise - round(start))
    assert verdict.plain.height_error == pytest.approx(error, abs=1e-15)
    assert (verdict.agrees, verdict.mistakes) == (agrees, ())
    assert any(not unnamed("z off radius", line) for line in lines(verdict)) == (error > 0)


def test_a_mistake_that_leaves_more_than_a_tenth_is_not_called_wrong(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A wrong slope is named. If slopes are not tried, the nearest axes may be wrong."""
    scene = rb.load_scene("inclined_plane")
    x, y, z = scene.gravity_direction
    file = exact(replace(scene, gravity_direction=(-x, -y, z)), 6.0, 150)
    verdict = judged(scene, file)
    assert untold(["plane slopes"], [mistake.name for mistake in verdict.mistakes]) == []
    assert any(line.startswith("WRONG") for line in lines(verdict))
    monkeypatch.setattr(mistakes, "_mistaken_scenes", lambda *_: ())
    verdict = judged(scene, file)
    assert verdict.mistakes[0].left > 0.1  # measured 0.149 in the attitude
    assert not any(line.startswith("WRONG") for line in lines(verdict))
    assert "convention" in lines(verdict)[-1]


LOPSIDED = """
title = "A lopsided ball"
rolling = "classical"
duration = 4.0
[shell]
radius = 0.1
mass = 1.0
inertia = { axial = 0.004, transverse = 0.004 }
[frame]
mass = 0.5
inertia = [0.0006, 0.0024, 0.0030]
[start]
attitude = [1, 0, 0, 0]
angular_velocity = [6, 1, 4]
"""


def test_a_missing_gyroscopic_term_is_named_and_not_explained_by_an_inertia(
    robotball: Robotball, tmp_path: Path
) -> None:
    """Without ω×Iω the ball turns about a constant axis and rolls straight on.

    A frame with five times its moment about x would follow the same path.
    """
    (tmp_path / "lopsided.toml").write_text(LOPSIDED)
    scene, times = rb.load_scene(tmp_path / "lopsided.toml"), rb.sample_times(4.0)
    omega = np.array([6.0, 1.0, 4.0])
    q = Rotation.from_rotvec(np.outer(times, omega)).as_quat(scalar_first=True)
    position = np.outer(times, scene.ball.radius * np.array([omega[1], -omega[0], 0.0]))
    position[:, 2] = scene.ball.radius
    table = np.column_stack([times, position, q])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,x,y,z,qw,qx,qy,qz", comments="")
    status, out, _ = robotball("judge", "lopsided.toml", "a.csv")
    assert status == 1
    assert "WRONG: the gyroscopic term ω×Iω is left out" in out
    assert "inertia" not in out
