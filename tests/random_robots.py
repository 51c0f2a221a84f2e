"""Random robots with all kinds of bodies and motors."""

from dataclasses import replace

import numpy as np

from robotball.robot.ball import Ball, Frame, Hinge, Hung, Link, Pendulum, Rotor, Shell
from robotball.robot.drives import Sine
from robotball.robot.formulas import Rolling
from robotball.robot.motors import (
    Actuator,
    DCMotor,
    Free,
    Law,
    Motor,
    PositionServo,
    Servo,
    Torque,
)
from robotball.robot.scene import Scene, Start
from tests.random_balls import cloud_inertia, random_axis
from tests.robots import turning

MODELS: tuple[Rolling, ...] = ("rubber", "classical")


def random_robot(rng: np.random.Generator, rotors: int, pendulums: int) -> Ball:
    """Return a ball of about 1 kg and 0.1 to 0.5 m, unbalanced in any direction."""
    a = rng.uniform(0.1, 0.5)
    transverse = rng.uniform(0.4, 0.7) * a * a
    shell = Shell(
        radius=a,
        mass=1.0,
        axial_inertia=transverse * rng.uniform(0.8, 1.2),
        transverse_inertia=transverse,
        axis=random_axis(rng),
        offset=rng.uniform(-0.1, 0.1) * a,
    )
    weights = rng.uniform(0.2, 1.0, 1 + rotors + pendulums)
    frame = Frame(weights[0], cloud_inertia(rng, weights[0], 0.4 * a), 0.3 * a * random_axis(rng))
    discs = []
    for m in weights[1 : 1 + rotors]:
        moment = m * (rng.uniform(0.1, 0.3) * a) ** 2
        discs.append(Rotor(m, moment, 0.6 * moment, random_axis(rng), 0.3 * a * random_axis(rng)))
    hung = []
    for m in weights[1 + rotors :]:
        inertia, centre = cloud_inertia(rng, m, 0.2 * a), 0.4 * a * random_axis(rng)
        hung.append(Pendulum(m, inertia, centre, random_axis(rng), 0.2 * a * random_axis(rng)))
    bodies: list[Hung] = [frame, *discs, *hung]
    return Ball(shell, tuple(map(Hinge, bodies)))


def random_motor(rng: np.random.Generator, inertia: float) -> Motor | None:
    """Return a motor for a hinge with an inertia [kg m²]; None prescribes the rate."""
    armature = inertia * rng.uniform(0.0, 0.5)
    return [
        None,
        Servo(20 * inertia, None, armature),
        Servo(20 * inertia, 5 * inertia, armature),
        PositionServo(50 * inertia, 2 * inertia, 5 * inertia, armature),
        Torque(armature),
        Free(inertia, 10 * inertia, rng.uniform(-1, 1), armature),
    ][rng.integers(6)]


def random_scene(rng: np.random.Generator, rolling: Rolling | None = None) -> Scene:
    """Return a robot with up to three hinges on a slightly inclined plane, in random motion."""
    ball = random_robot(rng, int(rng.integers(2)), int(rng.integers(2)))
    hinges = len(ball.hinges)
    inertia = 0.05 * ball.radius**2
    motors = tuple(random_motor(rng, inertia) for _ in range(hinges))
    sizes = [inertia if isinstance(motor, Torque) else 1.0 for motor in motors]
    rates = tuple(
        0.0
        if isinstance(motor, Free)
        else Sine(amplitude=size * rng.uniform(0.2, 2), frequency=rng.uniform(0.1, 0.5))
        for motor, size in zip(motors, sizes, strict=True)
    )
    down = np.array([*rng.uniform(-0.1, 0.1, 2), -1.0])
    attitude = rng.normal(size=4)
    scene = Scene(
        name="random",
        title="",
        source="",
        ball=ball.with_hinges(command=rates, motor=motors),
        rolling=rolling or MODELS[rng.integers(2)],
        gravity_direction=tuple(down / np.linalg.norm(down)),
        start=Start(attitude / np.linalg.norm(attitude), np.zeros(3)),
        duration=10.0,
    )
    angles, initial_rates = rng.uniform(-1, 1, hinges), rng.uniform(-1, 1, hinges)
    return turning(scene.with_hinges(angle=angles, rate=initial_rates), rng.normal(size=3))


def random_dry_robot(number: int) -> Scene:
    """Return a robot of which every hinge has dry friction, in random motion for a second.

    The friction is 0.3 to 30 % of the largest torque of a pendulum's weight.
    """
    rng = np.random.default_rng([54, number])
    ball = random_robot(rng, int(rng.integers(2)), 1 + int(rng.integers(2)))
    weight, unit = 1.2 * ball.radius, ball.radius**2  # N m and kg m², typical of a hinge
    motors: list[Motor] = []
    commands: list[float | Sine] = []
    for _ in ball.hinges:
        friction = weight * 10 ** rng.uniform(-2.5, -0.5)
        armature = 0.005 * unit * rng.random()
        if rng.random() < 0.6:
            damping, stiffness = 0.02 * unit * rng.random(), weight * rng.random()
            motors.append(Free(damping, stiffness, armature=armature, friction=friction))
            commands.append(0.0)
        else:
            stall, speed = weight * rng.uniform(0.5, 2), rng.uniform(5, 20)
            idle = friction / (friction + stall)
            motors.append(
                DCMotor(
                    stall, speed, rotor_inertia=armature, no_load_current=idle, stall_current=1.0
                )
            )
            amplitude, frequency = rng.uniform(0.2, 1), rng.uniform(0.3, 2)
            commands.append(Sine(amplitude=amplitude, frequency=frequency))
    attitude, hinges = rng.normal(size=4), len(ball.hinges)
    scene = Scene(
        name="dry",
        title="",
        source="",
        ball=ball.with_hinges(command=commands, motor=motors),
        rolling=MODELS[rng.integers(2)],
        start=Start(attitude / np.linalg.norm(attitude), np.zeros(3)),
        duration=1.0,
    )
    angles, rates = rng.uniform(-1, 1, hinges), rng.uniform(-1, 1, hinges)
    return turning(scene.with_hinges(angle=angles, rate=rates), 0.5 * rng.normal(size=3))


def random_tree(rng: np.random.Generator, framed: bool) -> Scene:
    """Return a chain of three links, the second on a slide, with another link on the shell.

    The shell has any inertia; if framed, the chain hangs on a frame. One actuator moves two joints,
    another one joint up to a limit.
    """
    rolling = MODELS[rng.integers(2)]
    scene = random_scene(rng, rolling)
    ball, a = scene.ball, scene.ball.radius
    tensor = cloud_inertia(rng, 0.3, 0.8 * a)
    shell = replace(ball.shell, asymmetry=tensor, aside=0.1 * a * random_axis(rng))
    parents = {"arm1": "frame" if framed else "shell", "arm2": "arm1", "arm3": "arm2"}
    links = tuple(
        Link(
            name, parent, 0.4, cloud_inertia(rng, 0.4, 0.2 * a), 0.4 * a * random_axis(rng),
            random_axis(rng), 0.2 * a * random_axis(rng), slides=name == "arm2",
        )
        for name, parent in (parents | {"side": "shell"}).items()
    )  # fmt: skip
    moved = ["frame", *parents, "side"] if framed else [*parents, "side"]
    unit = 0.02 * a * a  # kg m², typical inertia on a hinge
    motors = tuple(
        Free(1.0, 60.0, armature=0.1) if name == "arm2" else Free(unit, 5 * unit, 0.1, 0.3 * unit)
        for name in moved
    )
    pulled = Law(10 * unit, 10 * unit, unit, 0.1 * unit)
    wave = Sine(amplitude=1, frequency=0.6)
    actuators = (
        Actuator("cable", (("arm1", 1.0), ("arm3", -0.5)), pulled, wave),
        Actuator("geared", (("side", 3.0),), Law(unit, 0.0, unit, limit=0.7 * unit), 1.0),
    )
    angles = rng.uniform(-0.5, 0.5, len(moved)) * [0.05 * a if n == "arm2" else 1 for n in moved]
    bodies: list[Hung] = [ball.frame, *links] if framed else [*links]
    hinges = tuple(
        Hinge(body, motor=motor, angle=angle, rate=0.1 * angle)
        for body, motor, angle in zip(bodies, motors, angles, strict=True)
    )
    start = Start(scene.start.attitude, np.zeros(3))
    tree = replace(scene, ball=Ball(shell, hinges), actuators=actuators, start=start)
    return turning(tree, rng.normal(size=3))
