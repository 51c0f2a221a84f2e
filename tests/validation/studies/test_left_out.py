"""`judge` names physics that a file's program left out or added, and accuses no other file."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.robot.scene import Friction
from robotball.rotations import Array
from tests.messages import unnamed
from tests.planted_physics import Torque, mujoco_file, own_file
from tests.random_balls import ball_of_points
from tests.robotball.theory.test_friction import regular
from validation import judge
from validation.studies.judge import FileJudgement, lines

File = Callable[[rb.Scene], rb.Trajectory]
SCENES: dict[str, rb.Scene] = {
    **{f"ball {number}": ball_of_points(number) for number in range(1, 6)},
    **{name: rb.load_scene(name) for name in (
        "fig12", "classical_regular", "classical_chaotic", "routh_sphere", "three_rotors",
        "offset_routh_sphere", "swinging_frame", "inclined_plane", "pendulum_robot",
        "steered_pendulum_robot",
    )},
}  # fmt: skip
BALANCED = "ball 1", "ball 2", "ball 3", "ball 5", "fig12", "classical_regular", "routh_sphere"


def resisting_rolling(scene: rb.Scene) -> Torque:
    return resisting(scene, np.array([1.0, 1.0, 0.0]))


def resisting_spin(scene: rb.Scene) -> Torque:
    return resisting(scene, np.array([0.0, 0.0, 1.0]))


def resisting(scene: rb.Scene, axes: Array) -> Torque:
    """Return a torque of 0.005 radii times the weight against turning about some axes."""
    size = 5e-3 * scene.ball.radius * scene.ball.mass * scene.gravity
    return lambda omega: -size * axes * omega / np.linalg.norm(axes * omega)


def drag(scene: rb.Scene) -> Torque:
    """Return a drag on the ball's rotation and way, as of a free joint with dampers of 0.02."""
    a = scene.ball.radius
    return lambda omega: -0.02 * (omega + a * a * omega * [1.0, 1.0, 0.0])


def with_option(**options: Any) -> Callable[[Any], None]:
    def change(spec: Any) -> None:
        for name, value in options.items():
            setattr(spec.option, name, value)

    return change


def damped(joint: str, damping: float) -> Callable[[Any], None]:
    def change(spec: Any) -> None:
        spec.joint(joint).damping = [damping, 0.0, 0.0]

    return change


def weightless(spec: Any) -> None:
    spec.body("frame").gravcomp = 1.0


def kicked(spec: Any) -> None:
    """Start with a velocity of 1 m/s upwards."""
    spec.keys[0].qvel = np.array(spec.keys[0].qvel) + np.eye(len(spec.keys[0].qvel))[2]


def own(**options: Any) -> File:
    return lambda scene: own_file(scene, **options)


def own_torque(torque: Callable[[rb.Scene], Torque]) -> File:
    return lambda scene: own_file(scene, torque=torque(scene))


def in_mujoco(change: Callable[[Any], None], **options: Any) -> File:
    return lambda scene: mujoco_file(scene, change, **options)


def resisted(scene: rb.Scene) -> rb.Trajectory:
    """Return a run of robotball's contact engine with resistance to rolling."""
    other = replace(scene, friction=Friction(rolling=1e-3))
    return recorded(rb.simulate(other, rb.sample_times(2.0), settings="balanced"))


def recorded(motion: rb.Motion) -> rb.Trajectory:
    """Return a motion as the file of another program, with the columns of its hinges."""
    others = dict[str, Array]()
    for i, hinge in enumerate(motion.scene.hinges):
        others[f"{hinge.name}_angle"] = motion.hinge_angles[:, i]
        others[f"{hinge.name}_rate"] = motion.hinge_rates[:, i]
    height = np.full(len(motion.times), motion.scene.ball.radius)
    columns = np.column_stack([motion.contact_point, height]), motion.attitude
    return rb.Trajectory("run.csv", motion.times, *columns, motion.angular_velocity, others=others)


ROBOTS = "pendulum_robot", "steered_pendulum_robot"
HEAVY = "offset_routh_sphere", "swinging_frame", "inclined_plane", "pendulum_robot"
LEVEL = "classical_regular", "ball 2", "routh_sphere"
EULER = with_option(integrator=mujoco.mjtIntegrator.mjINT_EULER)
DAMPED = "free~joint damped 0.02~N~m~s/rad"
# The kind, the facts that the first named cause has, how the file is made, and the scenes.
KINDS: list[tuple[str, str, File, tuple[str, ...]]] = [
    ("gyroscopic", "gyroscopic ω×Iω left~out", own(gyroscopic=(0.0, 1.0)), BALANCED),
    ("gyroscopic", "gyroscopic ω×(Iω~+~k) left~out", own(gyroscopic=(0.0, 0.0)), BALANCED),
    ("gyroscopic", "gyroscopic ω×k left~out", own(gyroscopic=(1.0, 0.0)), BALANCED),
    ("explicit Euler", "explicit 0.01~s", own(euler="explicit", timestep=0.01), BALANCED[1:]),
    ("semi-implicit Euler", "semi-implicit 0.01~s", own(euler="semi", timestep=0.01), BALANCED[1:]),
    ("Euler in MuJoCo", "semi-implicit 0.01~s", in_mujoco(EULER, timestep=0.01), (
        "classical_regular", "fig12", "classical_chaotic", "offset_routh_sphere", "three_rotors",
    )),
    ("damping of the free joint", DAMPED, in_mujoco(damped("shell", 0.02)), (
        "fig12", "classical_regular", "swinging_frame", "inclined_plane", "pendulum_robot",
    )),
    ("damping of the free joint", DAMPED, own_torque(drag), BALANCED),
    ("damping of a hinge", "joint frame damped",
     in_mujoco(damped("frame", 0.05), end=3.0, timestep=5e-3), ROBOTS),
    ("gravity compensation", "frame gravity~compensation", in_mujoco(weightless), HEAVY),
    ("rolling resistance", "rolling friction.rolling", own_torque(resisting_rolling), BALANCED),
    ("rolling resistance", "rolling friction.rolling 0.001~m", resisted, HEAVY),
    ("torsional friction", "spinning friction.torsional", own_torque(resisting_spin), LEVEL),
    ("contact lost", "contact~lost", in_mujoco(kicked), ("fig12", *HEAVY[::3])),
]  # fmt: skip
CASES = [(kind, facts, make, name) for kind, facts, make, names in KINDS for name in names]
# Every run of the tests includes one scene of each kind.
QUICK = {kind: (kind, facts, make, names[0]) for kind, facts, make, names in reversed(KINDS)}


def judged(scene: rb.Scene, file: rb.Trajectory) -> FileJudgement:
    return judge(scene, file).files[0]


def first(scene: rb.Scene, file: rb.Trajectory) -> str:
    """Return the first named cause."""
    return next((mistake.name for mistake in judged(scene, file).mistakes), "")


@pytest.mark.parametrize(("kind", "facts", "make", "name"), QUICK.values(), ids=[*QUICK])
def test_left_out_physics_is_the_first_named_cause(
    kind: str, facts: str, make: File, name: str
) -> None:
    assert unnamed(facts, first(SCENES[name], make(SCENES[name]))) == []


@pytest.mark.study
def test_left_out_physics_is_named_in_nineteen_of_twenty_files() -> None:
    """The table has the rate by kind."""
    right, all_of = Counter[str](), Counter[str]()
    for kind, facts, make, name in CASES:
        right[kind] += not unnamed(facts, first(SCENES[name], make(SCENES[name])))
        all_of[kind] += 1
    table = "\n".join(f"{kind}: {right[kind]} of {count}" for kind, count in all_of.items())
    print(table)
    assert right.total() >= 0.95 * all_of.total(), table


@pytest.mark.parametrize(
    "name", ["ball 2", *(pytest.param(n, marks=pytest.mark.slow) for n in BALANCED)]
)
def test_a_right_program_of_another_kind_is_accused_of_nothing(name: str) -> None:
    """Its errors are those of RK4 with steps of 5 ms."""
    verdict = judged(SCENES[name], own_file(SCENES[name]))
    assert (verdict.mistakes, verdict.agrees) == ((), True)


def wrong_frame(scene: rb.Scene, **changes: Any) -> rb.Scene:
    """Return the scene with another frame and the same angular velocity at the start."""
    frame = replace(scene.ball.frame, **changes)
    changed = scene.with_hinges(body={"frame": frame})
    M = changed.momentum_of(scene.angular_velocity_at(scene.start))
    level = [1.0, 1.0, float(scene.rolling == "classical")]
    return replace(changed, start=replace(changed.start, momentum=M * level))


WRONG: dict[str, Callable[[rb.Scene], rb.Scene]] = {
    "inertia": lambda s: wrong_frame(s, inertia=1.5 * s.ball.frame.inertia),
    "mass": lambda s: wrong_frame(s, mass=1.5 * s.ball.frame.mass),
    "centre": lambda s: wrong_frame(s, centre=1.3 * s.ball.frame.centre),
    "gravity": lambda s: replace(s, gravity=1.2 * s.gravity),
    "momentum": lambda s: replace(s, start=replace(s.start, momentum=1.2 * s.start.momentum)),
}


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        pytest.param(wrong, name, marks=() if (i + j) % 14 == 0 else pytest.mark.slow)
        for i, wrong in enumerate(WRONG)
        for j, name in enumerate(SCENES)
    ],
)
def test_a_wrong_number_is_not_taken_for_left_out_physics(wrong: str, name: str) -> None:
    """It has no name, and the report refers to `fit`."""
    scene = SCENES[name]
    verdict = judged(scene, recorded(rb.integrate(WRONG[wrong](scene), 2.0, rtol=1e-11)))
    assert verdict.mistakes == ()
    assert verdict.agrees or any(
        not unnamed("robotball~fit --free", line) for line in lines(verdict)
    )


@pytest.mark.parametrize(
    ("sliding", "facts"),
    [
        (1.0, "friction.sliding larger 0.3 1"),
        (0.65, "friction.sliding mean 0.3 1"),
        (0.15, "friction.sliding product 0.3 0.5"),
        (0.45, "friction.sliding~=~0.45"),
    ],
)
def test_the_friction_of_two_materials_is_named_by_its_rule(sliding: float, facts: str) -> None:
    """The ball slips with 0.3; a friction without a rule is measured."""
    file = recorded(rb.integrate(regular(sliding), np.linspace(0, 1, 51)))
    assert unnamed(facts, first(regular(0.3), file)) == []


@pytest.mark.parametrize("absent", [False, True])
def test_resistance_to_rolling_is_missed_where_the_scene_has_it(absent: bool) -> None:
    scene = SCENES["pendulum_robot"]
    resists = replace(scene, friction=Friction(rolling=1e-3))
    verdict = judged(resists, recorded(rb.integrate(scene if absent else resists, 2.0)))
    assert [not unnamed("rolling left~out", m.name) for m in verdict.mistakes] == [True] * absent


def test_a_convention_and_left_out_physics_are_named_together() -> None:
    scene = SCENES["ball 2"]
    file = own_file(scene, (0.0, 1.0))
    verdict = judged(scene, replace(file, attitude=file.attitude[:, [1, 2, 3, 0]]))
    assert [m.name for m in verdict.mistakes if "ω×Iω" in m.name]


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        (lambda xy: xy, ""),
        (lambda xy: 1e3 * xy[:, ::-1], "mm y,~x"),
        (lambda xy: xy + np.array([3.0, -1.0]), "path (0,~0)"),
    ],
)
def test_a_track_without_attitude_is_judged_by_its_path(
    change: Callable[[Array], Array], facts: str, tmp_path: Any
) -> None:
    """The report says what the file does not show."""
    scene = SCENES["fig12"]
    motion = rb.integrate(scene, 2.0)
    table = np.column_stack([motion.times, change(motion.contact_point)])
    np.savetxt(tmp_path / "t.csv", table, delimiter=",", header="t,x,y", comments="")
    verdict = judge(scene, tmp_path / "t.csv").files[0]
    assert unnamed(facts, first(scene, verdict.trajectory)) == []
    assert verdict.agrees == (not facts)
    assert verdict.best.path_error < 1e-12  # measured 2e-16
    assert any(not unnamed("qw,qx,qy,qz attitude momentum slip", line) for line in lines(verdict))
