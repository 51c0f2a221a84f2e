"""The maps of extremes as data: two axes each, how the run of a cell is made, what is held fixed.

A cell runs the catalog's ball with one thing changed and the rest held, over any number of decades.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from robotball import Scene, Servo, Settings, load_scene
from robotball.engines.mujoco.settings import ADAPTIVE, CONSTANT, INTEGRATORS, MOST_STEPS, recipe
from robotball.errors import unknown
from robotball.robot import Ball, Frame, Rotor, Shell
from robotball.rotations import Array
from robotball.scene import Start
from validation.sweeps import Cell


def momentum_of(scene: Scene) -> Array:
    """K (3,) of (A.3), frame axes [kg m²/s]."""
    return scene.principal_axes @ np.array(scene.parameters.K)


def gyrostat(
    scene: Scene, *, frame_rate: float, K: Array, rotor_rate: float | None = None
) -> Scene:
    """The scene with other Ω and K (3,), frame axes, and the same A and mass.

    frame_rate [rad/s]; by (A.3) the rotor has to carry K + (J_s + d)Ω: its axis and its rate
    become what that takes, or, where rotor_rate [rad/s] is given, its axis and its inertia. The
    frame takes the rest of the inertia; InputError where nothing is left for it.
    """
    ball = scene.ball
    (rotor,) = ball.rotors
    carried = K + (ball.shell.axial_inertia + ball.d) * frame_rate * ball.shell.axis
    size = float(np.linalg.norm(carried))
    inertia = rotor.axial_inertia if rotor_rate is None else size / rotor_rate
    new = replace(rotor, axial_inertia=inertia, transverse_inertia=inertia / 2, axis=carried / size)
    frame = replace(ball.frame, inertia=ball.frame.inertia + rotor.inertia - new.inertia)
    return replace(
        scene,
        ball=Ball(ball.shell, frame, (new,)),
        frame_rate=frame_rate,
        rotor_rates=(size / inertia,),
    )


def redistributed(scene: Scene, *, frame_to_shell: float, rotor_to_frame: float) -> Scene:
    """The scene with its whole mass shared out anew; the bodies keep their shapes and rates."""
    ball = scene.ball
    shares = np.array([1.0, frame_to_shell, frame_to_shell * rotor_to_frame])
    shell, frame, rotor = (ball.mass * shares / shares.sum()).tolist()
    (old_rotor,) = ball.rotors
    return replace(
        scene,
        ball=Ball(
            scaled_shell(ball.shell, shell / ball.shell.mass),
            scaled_frame(ball.frame, frame / ball.frame.mass),
            (scaled_rotor(old_rotor, rotor / old_rotor.mass),),
        ),
    )


def scaled(scene: Scene, *, mass: float, length: float) -> Scene:
    """The same motion of a ball whose masses and lengths are multiplied by two factors.

    Rates and times stay, so that momenta go with mass·length² and gravity with length.
    """
    ball = scene.ball
    return replace(
        scene,
        ball=Ball(
            scaled_shell(ball.shell, mass, length),
            scaled_frame(ball.frame, mass, length),
            tuple(scaled_rotor(rotor, mass, length) for rotor in ball.rotors),
        ),
        start=Start(scene.start.attitude, scene.start.momentum * mass * length**2),
        gravity=scene.gravity * length,
    )


def scaled_shell(shell: Shell, mass: float, length: float = 1.0) -> Shell:
    """The shell with its mass and its lengths multiplied by two factors."""
    return replace(
        shell,
        radius=shell.radius * length,
        mass=shell.mass * mass,
        axial_inertia=shell.axial_inertia * mass * length**2,
        transverse_inertia=shell.transverse_inertia * mass * length**2,
    )


def scaled_frame(frame: Frame, mass: float, length: float = 1.0) -> Frame:
    """The same of the frame."""
    return Frame(frame.mass * mass, frame.inertia * mass * length**2, frame.centre * length)


def scaled_rotor(rotor: Rotor, mass: float, length: float = 1.0) -> Rotor:
    """The same of a rotor."""
    return replace(
        rotor,
        mass=rotor.mass * mass,
        axial_inertia=rotor.axial_inertia * mass * length**2,
        transverse_inertia=rotor.transverse_inertia * mass * length**2,
        centre=rotor.centre * length,
    )


SCENES = {"rubber": "fig12", "classical": "classical_regular"}
TIMESTEP = 2e-3  # s, MuJoCo's default, on maps that do not vary it
RTOL = 1e-8  # of the adaptive integrator's steps, where it is not varied
DURATION = 3.0  # s, on maps that do not vary it: a few turns of the ball
ERROR_TOLERANCE = 1e-2  # the error that a cell is held to
ADAPTIVE_STEPS = 2000  # at most; of the cells that end well none takes 1800
COUNT = 8  # values of an axis, if no other number is given


@dataclass(frozen=True)
class Axis:
    """A quantity, with its unit in the label, and its values."""

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class CellRun:
    """What one cell runs.

    ample: whether friction is raised to three times the motion's demand where it is less.
    duration: s; None for a few turns of the ball.
    """

    scene: Scene
    settings: Settings
    ample: bool = True
    duration: float | None = None


@dataclass(frozen=True)
class Map:
    """A failure map: `make` gives the run of an integrator at (x, y) from the base scene.

    The adaptive integrator has no timestep: where that is an axis, it is its rtol that varies.
    """

    name: str
    title: str
    held: str
    x: Axis
    y: Axis
    make: Callable[[Scene, str, float, float], CellRun]
    rollings: tuple[str, ...] = tuple(SCENES)
    limit: float = 60.0  # s of one cell

    def x_of(self, integrator: str) -> Axis:
        """The first axis as an integrator has it."""
        return ADAPTIVE_AXES.get(self.x, self.x) if integrator == ADAPTIVE else self.x


def cell_run(chosen: Map, rolling: str, integrator: str, x: float, y: float) -> CellRun:
    """The run of a cell; raises InputError where there is no such ball."""
    return chosen.make(base(rolling), integrator, x, y)


@cache
def base(rolling: str) -> Scene:
    """The scene that the maps of a rolling model start from."""
    return load_scene(SCENES[rolling])


def map_settings(integrator: str, step: float | None = None) -> Settings:
    """The recipe with an integrator and its timestep [s], or rtol if it is the adaptive one."""
    if integrator == ADAPTIVE:
        chosen = recipe(integrator, ERROR_TOLERANCE, integrator=ADAPTIVE, rtol=step or RTOL)
        chosen = replace(chosen, max_steps=ADAPTIVE_STEPS)
    else:
        timestep = step or TIMESTEP
        chosen = recipe(integrator, ERROR_TOLERANCE, integrator=integrator, timestep=timestep)
        constant, ratio = CONSTANT["solref"]
        # As MuJoCo would do in silence.
        chosen = replace(chosen, solref=(max(constant, 2 * timestep), ratio))
    # What becomes of a run is to be seen to its end.
    return replace(chosen, stop_at_fault=False)


def decades(low: float, high: float, count: int = COUNT) -> tuple[float, ...]:
    """Values evenly spaced in their logarithm, to three digits."""
    return tuple(float(f"{v:.3g}") for v in np.geomspace(low, high, count))


def _momentum(scene: Scene, integrator: str, step: float, size: float) -> CellRun:
    K = momentum_of(scene)
    ball = gyrostat(scene, frame_rate=_frame_rate(scene), K=K / np.linalg.norm(K) * size)
    return CellRun(ball, map_settings(integrator, step))


def _frame(scene: Scene, integrator: str, step: float, rate: float) -> CellRun:
    ball = gyrostat(scene, frame_rate=rate, K=momentum_of(scene))
    return CellRun(ball, map_settings(integrator, step))


def _rotor(scene: Scene, integrator: str, step: float, rate: float) -> CellRun:
    ball = gyrostat(scene, frame_rate=_frame_rate(scene), K=momentum_of(scene), rotor_rate=rate)
    return CellRun(ball, map_settings(integrator, step))


def _masses(scene: Scene, integrator: str, frame_to_shell: float, rotor_to_frame: float) -> CellRun:
    ball = redistributed(scene, frame_to_shell=frame_to_shell, rotor_to_frame=rotor_to_frame)
    return CellRun(ball, map_settings(integrator))


def _scale(scene: Scene, integrator: str, mass: float, length: float) -> CellRun:
    return CellRun(scaled(scene, mass=mass, length=length), map_settings(integrator))


def _friction(scene: Scene, integrator: str, sliding: float, gravity: float) -> CellRun:
    settings = replace(map_settings(integrator), sliding_friction=sliding, torsional_friction=1e6)
    return CellRun(replace(scene, gravity=gravity), settings, ample=False)


def _torsion(scene: Scene, integrator: str, sliding: float, torsional: float) -> CellRun:
    settings = replace(
        map_settings(integrator), sliding_friction=sliding, torsional_friction=torsional
    )
    return CellRun(scene, settings, ample=False)


def _gravity(scene: Scene, integrator: str, gravity: float, constant: float) -> CellRun:
    settings = replace(map_settings(integrator), solref=(constant, 1.0))
    return CellRun(replace(scene, gravity=gravity), settings)


def _contact(scene: Scene, integrator: str, constant: float, rate: float) -> CellRun:
    # The direct form of a critically damped contact, which MuJoCo does not soften to fit dt.
    settings = replace(
        map_settings(integrator),
        solref=(-1 / constant**2, -2 / constant),
        solreffriction=(-1.0, -rate),
    )
    return CellRun(scene, settings)


def _servo(scene: Scene, integrator: str, step: float, rate: float) -> CellRun:
    gain = rate * scene.ball.rotors[0].axial_inertia
    settings = replace(map_settings(integrator, step), drive=Servo(gain=gain))
    return CellRun(scene, settings)


def _duration(scene: Scene, integrator: str, step: float, duration: float) -> CellRun:
    settings = replace(map_settings(integrator, step), max_steps=MOST_STEPS)
    return CellRun(scene, settings, duration=duration)


def _frame_rate(scene: Scene) -> float:
    return float(scene.drives[0].rate(0.0))


TIMESTEPS = Axis("timestep [s]", decades(2e-4, 0.2))
LONG_TIMESTEPS = Axis("timestep [s]", (0.02, 0.05, 0.1, 0.2))
ADAPTIVE_AXES = {
    TIMESTEPS: Axis("rtol of a step", decades(1e-13, 0.1)),
    # A day's motion takes it minutes, whatever its rtol.
    LONG_TIMESTEPS: Axis("rtol of a step", (1e-6,)),
}

MAPS: dict[str, Map] = {
    each.name: each
    for each in (
        Map(
            "momentum",
            "timestep × momentum |K|",
            "A, Ω, M and the direction of K; the rotor's rate and axis give K",
            TIMESTEPS,
            Axis("|K| [kg m²/s]", decades(0.1, 1e4, 9)),
            _momentum,
        ),
        Map(
            "frame",
            "timestep × frame's rate |Ω|",
            "A, K and M; the rotor's rate and axis make up for the frame's",
            TIMESTEPS,
            Axis("|Ω| [rad/s]", decades(0.01, 1e4, 9)),
            _frame,
        ),
        Map(
            "rotor",
            "timestep × rotor's speed at fixed K",
            "A, Ω, K and M: the faster the rotor, the smaller its inertia",
            TIMESTEPS,
            Axis("rotor's speed [rad/s]", decades(10, 1e11, 9)),
            _rotor,
        ),
        Map(
            "masses",
            "mass of rotor : frame : shell",
            "total mass, shapes of the bodies, their rates, M",
            Axis("frame's mass / shell's", decades(1e-6, 1e6, 9)),
            Axis("rotor's mass / frame's", decades(1e-6, 1e6, 9)),
            _masses,
        ),
        Map(
            "scale",
            "scale of mass × scale of length",
            "rates and times: M goes with mass·length², gravity with length",
            Axis("masses × ", decades(1e-9, 1e9, 9)),
            Axis("lengths × ", decades(1e-9, 1e9, 9)),
            _scale,
        ),
        Map(
            "friction",
            "sliding friction × gravity",
            "the ball and its start; torsional friction 1e6 m",
            Axis("coefficient of sliding friction", decades(1e-3, 1e6, 10)),
            Axis("gravity [m/s²]", decades(1e-3, 1e3, 7)),
            _friction,
        ),
        Map(
            "torsion",
            "sliding × torsional friction",
            "the ball, its start and gravity, 9.81 m/s²",
            Axis("coefficient of sliding friction", decades(1e-3, 1e6, 10)),
            Axis("coefficient of torsional friction [m]", decades(1e-3, 1e6, 10)),
            _torsion,
            rollings=("rubber",),
        ),
        Map(
            "gravity",
            "gravity × time constant of the contact",
            "the ball and its start; the margin carries the weight, at whatever depth",
            Axis("gravity [m/s²]", decades(1e-9, 1e6, 11)),
            Axis("solref's time constant [s]", decades(0.01, 10, 9)),
            _gravity,
        ),
        Map(
            "contact",
            "stiffness × friction damping of the contact",
            "the ball and its start; damping ratio 1, in solref's direct form",
            Axis("time constant of the contact [s]", decades(1e-5, 10, 9)),
            Axis("solreffriction's damping b [1/s]", decades(1e-3, 1e6, 10)),
            _contact,
        ),
        Map(
            "servo",
            "timestep × servo gain",
            "the ball and its start; the same gain kv on both hinges, j of the rotor",
            TIMESTEPS,
            Axis("kv/j [1/s]", decades(0.1, 1e7, 9)),
            _servo,
        ),
        Map(
            "duration",
            "timestep × duration",
            "the ball and its start; a limit cycle or a regular motion, so not chaos",
            LONG_TIMESTEPS,
            Axis("duration [s]", decades(0.1, 1e5, 7)),
            _duration,
            limit=1800.0,
        ),
    )
}


def chosen(names: tuple[str, ...]) -> list[Map]:
    """The named maps, all for none; raises InputError on a name that is no map's."""
    for name in names:
        if name not in MAPS:
            raise unknown("map", name, MAPS)
    return [MAPS[name] for name in dict.fromkeys(names or MAPS)]


QUICK_INTEGRATORS = ("Euler", "RK4", ADAPTIVE)
QUICK_COUNT = 3  # values of an axis
QUICK_DURATION = 10.0  # s, at most


@dataclass(frozen=True)
class Cut:
    """How much of the maps to run: all integrators and values, or a few."""

    integrators: tuple[str, ...] = tuple(INTEGRATORS)
    count: int | None = None

    def values(self, axis: Axis) -> tuple[float, ...]:
        """Those of the axis that are in the cut, its ends among them."""
        values = axis.values
        if self.count is None or self.count >= len(values):
            return values
        if "duration" in axis.label:
            values = tuple(v for v in values if v <= QUICK_DURATION)
        chosen = np.linspace(0, len(values) - 1, self.count).round().astype(int)
        return tuple(values[i] for i in np.unique(chosen))


WHOLE, QUICK = Cut(), Cut(QUICK_INTEGRATORS, QUICK_COUNT)


def cells_of(chosen: Map, cut: Cut = WHOLE) -> list[Cell]:
    """The cells of a map; those of one ball follow each other."""
    return [
        {"map": chosen.name, "rolling": rolling, "integrator": integrator, "x": x, "y": y}
        for rolling in chosen.rollings
        for integrator in cut.integrators
        for y in cut.values(chosen.y)
        for x in cut.values(chosen.x_of(integrator))
    ]
