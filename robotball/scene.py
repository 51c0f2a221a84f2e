"""Scene: a ball, its drives, a rolling model and a start; all that an engine needs."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from robotball.bodies import ROUNDING, Ball, imbalance
from robotball.contact import Friction
from robotball.drives import Constant, Drive, Rate, as_drive, functions_of
from robotball.errors import LARGEST, InputError, check_positive, check_size
from robotball.hinges import Hinge, hinges_of, with_hinges_checked
from robotball.mechanics.robot import Robot, robot_of
from robotball.motors import Motor
from robotball.parameters import ROLLING_MODELS, Parameters, Rolling, as_vector, parameters_of
from robotball.rotations import Array, from_matrix, rotation_matrix
from robotball.shown import scene_cell, scene_line
from robotball.start import Start, horizontal, unit
from robotball.times import sample_times
from robotball.value import Value

GRAVITY = 9.81  # m/s², MuJoCo's own default
DOWN = (0.0, 0.0, -1.0)
SMALL = 0.3  # of |K| + d|Ω|: M below it is not what turns the ball


@dataclass(frozen=True, repr=False)
class Scene(Value):
    """One experiment, the same for every engine. SI units.

    frame_rate, rotor_rates and pendulum_rates are the commands of the hinges, the frame's about the
    shell's axis and relative to the shell, the others' relative to the frame: numbers, drives, or
    functions of time. motors, in the same order, say how a hinge is moved. One without a motor
    keeps the commanded rate [rad/s] exactly; to a motor the command is what it takes, a rate, an
    angle [rad] or a torque [N m]. No motors at all is none on any hinge.

    gravity_direction (3,): which way things fall, in world axes, whose Z is the plane's normal; an
    inclined plane has a horizontal part. friction: of the plane. A start that is on the rolling
    model but for rounding is put there: its attitude is a unit quaternion, a rubber M horizontal.
    """

    name: str
    title: str
    source: str
    ball: Ball
    rolling: Rolling
    frame_rate: Rate
    rotor_rates: tuple[Rate, ...]
    start: Start
    duration: float
    gravity: float = GRAVITY
    motors: tuple[Motor | None, ...] = ()
    pendulum_rates: tuple[Rate, ...] = ()
    gravity_direction: tuple[float, float, float] = DOWN
    friction: Friction = field(default_factory=Friction)

    def __post_init__(self) -> None:
        if self.rolling not in ROLLING_MODELS:
            raise InputError(f"rolling must be one of {ROLLING_MODELS}, not {self.rolling!r}")
        check_positive("duration", self.duration, "s")
        check_positive("gravity", self.gravity, "m/s²")
        for kind, bodies, rates in (
            ("rotors", self.ball.rotors, self.rotor_rates),
            ("pendulums", self.ball.pendulums, self.pendulum_rates),
        ):
            if len(rates) != len(bodies):
                raise InputError(f"{len(bodies)} {kind} need as many rates, not {len(rates)}")
        if len(self.motors) not in (0, len(self.drives)):
            raise InputError(
                f"{len(self.drives)} hinges need as many motors, or none, not {len(self.motors)}"
            )
        down = unit("gravity_direction", np.array(self.gravity_direction))
        if not down[2] < 0:
            raise InputError(
                f"gravity_direction must press the ball on the plane: its Z is {down[2]:.6g}, and "
                "must be negative"
            )
        object.__setattr__(self, "gravity_direction", tuple(down.tolist()))
        for part in self.start.momentum.tolist():
            check_size("the start's momentum", part, "kg m²/s", LARGEST**3)
        attitude, momentum = unit("attitude", self.start.attitude), self.start.momentum
        if self.rolling == "rubber":
            momentum = horizontal(momentum, self.momentum_scale)
        # Every engine starts from what is made exact here.
        start = with_hinges_checked(self.start, self.drives, self.motors)
        start = replace(start, attitude=attitude, momentum=momentum)
        object.__setattr__(self, "start", start)

    def __repr__(self) -> str:
        return scene_line(self)

    def _repr_html_(self) -> str:
        return scene_cell(self)

    @cached_property
    def times(self) -> Array:
        """The scene's own sample times (n,), from 0 to its duration [s]."""
        return sample_times(self.duration)

    @cached_property
    def principal_axes(self) -> Array:
        """The rotation (3, 3) from principal to frame axes: v_frame = principal_axes @ v."""
        return self.ball.principal[1]

    @cached_property
    def principal_quaternion(self) -> Array:
        """`principal_axes` as a quaternion (4,)."""
        return from_matrix(self.principal_axes)

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The hinges' commands: the frame's drive, then the rotors', then the pendulums'."""
        rates = (self.frame_rate, *self.rotor_rates, *self.pendulum_rates)
        names = [name for name, _ in self.ball.named_bodies[1:]]
        return tuple(map(self._drive, names, rates))

    def _drive(self, name: str, rate: Rate) -> Drive:
        try:
            return as_drive(rate, self.duration)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error

    @cached_property
    def hinges(self) -> tuple[Hinge, ...]:
        """The frame's hinge, then the rotors', then the pendulums', as they are at the start."""
        return self.hinges_at(self.start)

    def hinges_at(self, start: Start) -> tuple[Hinge, ...]:
        """The same hinges as they are at another start."""
        return hinges_of(self.ball, self.drives, self.motors, start)

    @cached_property
    def robot(self) -> Robot:
        """The numbers of the bodies and the armatures, for `robotball.mechanics`."""
        armatures = tuple(motor.armature if motor else 0.0 for motor in self.motors)
        return robot_of(self.ball, armatures)

    @property
    def gravity_world(self) -> Array:
        """G (3,) in world axes [m/s²]."""
        return self.gravity * np.array(self.gravity_direction)

    @cached_property
    def not_reduced(self) -> str | None:
        """Why (3.2) and (3.3) do not describe the scene, in a line; None where they do."""
        if offset := imbalance(self.ball):
            return offset
        if self.ball.pendulums:
            return "a pendulum moves the centre of mass"
        if any(self.motors):
            return "a hinge has a motor, which does not keep its rate exactly"
        if self.gravity_direction != DOWN:
            return "the plane is inclined"
        if self.friction.rolling:
            return "the plane resists rolling"
        return None

    def check_reduced(self) -> None:
        """Raises InputError where (3.2) and (3.3) do not describe the scene."""
        if self.not_reduced:
            raise InputError(
                f"{self.name}: {self.not_reduced}; this needs a scene that the paper's equations "
                "(3.2) and (3.3) describe: a balanced ball at given rates on a level plane"
            )

    @cached_property
    def load_varies(self) -> bool:
        """Whether the plane's load may change: where the centre of mass is not the sphere's."""
        pivots = [body.pivot - body.centre for body in self.ball.pendulums]
        swings = [np.cross(b.axis, p) for b, p in zip(self.ball.pendulums, pivots, strict=True)]
        far = ROUNDING * self.ball.radius
        return imbalance(self.ball) is not None or any(np.linalg.norm(s) > far for s in swings)

    @cached_property
    def keeps_momentum(self) -> bool:
        """Whether M is constant in space: balanced, on a level plane that resists no rolling."""
        upright = self.gravity_direction == DOWN
        return upright and not self.load_varies and not self.friction.rolling

    def until(self, end: float) -> "Scene":
        """The scene of a run that ends at `end` [s]: its drives are asked from 0 to there.

        Raises InputError where a drive given by a function jumps on the way.
        """
        if self.steady:
            return self
        scene = replace(self, duration=end)
        for drive in scene.drives:
            for function in functions_of(drive):
                assert function.polynomials  # refused here, if at all
        return scene

    @cached_property
    def breakpoints(self) -> tuple[float, ...]:
        """Times after 0 at which some drive is not smooth [s]."""
        return tuple(sorted({t for drive in self.drives for t in drive.breakpoints if t > 0}))

    @cached_property
    def steady(self) -> bool:
        """Whether all rates are constant."""
        return all(isinstance(drive, Constant) for drive in self.drives)

    def parameters_at(self, t: float) -> Parameters:
        """The numbers of the equations at time t [s], in principal axes."""
        rates = [float(drive.rate(t)) for drive in self.drives]
        return parameters_of(self.ball, self.rolling, rates)

    @cached_property
    def parameters(self) -> Parameters:
        """The numbers of (3.2) or (3.3), in principal axes; InputError unless they are constant."""
        self.check_reduced()
        if not self.steady:
            raise InputError(f"{self.name}: the drives change in time; use parameters_at(t)")
        return self.parameters_at(0.0)

    @cached_property
    def momentum_scale(self) -> float:
        """What errors of M are measured by [kg m²/s]: |M| of the start, where that is not small.

        A ball that starts from rest has M = 0 or rounding: K and dΩ turn it then, and where these
        are zero as well, it is the M of a ball that falls as far as its radius. So the scale goes
        with the masses, whatever their unit.
        """
        start = math.hypot(*self.start.momentum.tolist())
        falling = self.ball.d * float(np.sqrt(self.gravity / self.ball.radius))
        if self.not_reduced:
            return max(start, falling)
        with np.errstate(over="ignore", invalid="ignore"):  # refused by the equations, not here
            numbers = self.parameters_at(0.0)
        turned = math.hypot(*numbers.K) + numbers.d * math.hypot(*numbers.Omega)
        return max(start, SMALL * turned) or falling

    def angular_velocity_at(self, start: Start) -> Array:
        """ω (3,) in frame axes of this ball at any start [rad/s]."""
        to_frame = rotation_matrix(start.attitude).T
        if self.not_reduced:
            hinges = self.hinges_at(start)
            return self.robot.angular_velocity(
                to_frame[None, :, 2],
                np.array([[hinge.angle for hinge in hinges]]),
                (to_frame @ start.momentum)[None],
                np.array([[hinge.rate for hinge in hinges]]),
                self.rolling,
            )[0]
        to_principal = self.principal_axes.T @ to_frame
        M, gamma = to_principal @ start.momentum, to_principal[:, 2]
        omega = self.parameters_at(0.0).angular_velocity(as_vector(M), as_vector(gamma))
        return self.principal_axes @ np.array(omega)
