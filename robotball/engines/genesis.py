"""Genesis as an engine: its rigid solver on the processor, with a velocity servo a hinge.

Its contact is after MuJoCo's. It steps by semi-implicit Euler alone, with or without an implicit
part.
"""

from dataclasses import dataclass
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, links_of
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix


@dataclass(frozen=True, kw_only=True)
class _GenesisSettings(adapter.StepSettings):
    """Settings of a Genesis run.

    precision: of its arithmetic, in bits; integrator, cone: by its own names; friction: of ball
    and plane, of which it takes 5 at most; torsional m: friction against spin, of a rubber ball
    alone; damping N m s/rad: of the hinges' velocity servos; most_torque N m: that they give, any
    if None; armature kg m²: their reflected inertia; impedance: of the contact; impratio: how much
    harder friction is than the normal force; iterations, tolerance: of its solver.
    """

    precision: Literal["32", "64"] = "32"
    integrator: str | None = None
    cone: str | None = None
    friction: float | None = None
    torsional: float | None = None
    damping: float = 450.0
    most_torque: float | None = None
    armature: float | None = None
    impedance: float | None = None
    impratio: float | None = None
    iterations: int | None = None
    tolerance: float | None = None


class _GenesisWorld(adapter.ServoWorld):
    """The ball and its plane in a scene of their own."""

    def __init__(self, scene: Scene, settings: _GenesisSettings, step: float) -> None:
        super().__init__(scene)
        import genesis as gs

        gs.destroy()  # of a world that did not come to its end
        gs.init(backend=gs.cpu, precision=settings.precision, logging_level="warning")
        torsional = settings.torsional if scene.rolling == "rubber" else None
        options = adapter.given(
            iterations=settings.iterations, tolerance=settings.tolerance,
            impratio=settings.impratio, enable_torsional_friction=torsional is not None,
            integrator=settings.integrator and getattr(gs.integrator, settings.integrator),
            friction_cone=settings.cone and getattr(gs.friction_cone, settings.cone),
        )  # fmt: skip
        self.world = gs.Scene(
            show_viewer=False,
            sim_options=gs.options.SimOptions(dt=step, gravity=(0.0, 0.0, -scene.gravity)),
            rigid_options=gs.options.RigidOptions(**options),
        )
        material = gs.materials.Rigid(friction=settings.friction, friction_torsional=torsional)
        self.world.add_entity(gs.morphs.Plane(), material=material)
        robot = gs.morphs.MJCF(file=_mjcf(scene, settings))
        self.ball = self.world.add_entity(robot, material=material)
        self.world.build()
        start, h, self.friction = self.now, len(scene.drives), settings.friction or self.friction
        self.hinges = list(range(6, 6 + h))
        self.ball.set_dofs_kv(np.full(h, settings.damping), self.hinges)
        most = np.full(h, settings.most_torque or np.inf)
        self.ball.set_dofs_force_range(-most, most, self.hinges)
        self.lag = (settings.armature or 0.0) / settings.damping  # s, of a servo
        if settings.armature is not None:
            self.ball.set_dofs_armature(np.full(h, settings.armature), self.hinges)
        self.ball.set_qpos(np.concatenate([start.centre, start.attitude, start.angles]))
        turning = rotation_matrix(start.attitude).T @ start.turning
        self.ball.set_dofs_velocity(np.concatenate([start.velocity, turning, start.rates]))
        self.turn(start.rates)

    def control(self, t: float, step: float) -> None:
        # A servo turns its own armature too, by its rate at the step's begin, or it would lag.
        before, after = (self.hinges_at(each)[1] for each in (t, t + step))
        self.turn(before + self.lag / step * (after - before))

    def turn(self, rates: Array) -> None:
        self.ball.control_dofs_velocity(rates, self.hinges)

    def step(self, step: float) -> None:
        self.world.step()

    def state(self) -> State:
        q, v = _double(self.ball.get_qpos()), _double(self.ball.get_dofs_velocity())
        attitude = q[3:7] / np.linalg.norm(q[3:7])
        return State(q[:3], v[:3], attitude, rotation_matrix(attitude) @ v[3:6], q[7:], v[6:])

    def end(self) -> None:
        # Here alone it writes its kernels to disk, a minute's compilation; robotball's processes
        # do not come to Python's end.
        import genesis as gs

        gs.destroy()

    def force(self) -> Array:
        return _double(self.ball.get_links_net_contact_force())[0]


def _double(values: Any) -> Array:
    return np.asarray(values.numpy(), dtype=float)


def _mjcf(scene: Scene, settings: _GenesisSettings) -> str:
    """Return the MJCF of the ball alone, from which Genesis reads bodies."""
    root = Element("mujoco")
    above = {"": SubElement(root, "worldbody")}
    for link in links_of(scene):
        place = _text(link.pivot)
        body = SubElement(above[link.parent], "body", name=link.name, pos=place)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        SubElement(
            body, "inertial", pos=_text(link.centre), mass=_text([link.mass]),
            fullinertia=_text([xx, yy, zz, xy, xz, yz]),
        )  # fmt: skip
        if not link.parent:
            SubElement(body, "freejoint")
            sphere = SubElement(body, "geom", type="sphere", size=_text([scene.ball.radius]))
            if (d := settings.impedance) is not None:
                # Equal at both ends: the impedance does not change with the depth.
                sphere.set("solimp", _text([d, d, 1e-3, 0.5, 1.0]))
        else:
            SubElement(body, "joint", type="hinge", name=link.name, axis=_text(link.axis))
        above[link.name] = body
    return tostring(root, encoding="unicode")


def _text(values: Any) -> str:
    return " ".join(repr(float(each)) for each in values)


_AS_IT_COMES = _GenesisSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-2,
    most_torque=87.0,
)  # fmt: skip
# Friction is the most that Genesis takes, and well above the 1.2 that the ball needs. The rest is
# MuJoCo's recipe: an elliptic cone, a hard contact, armatures that the load does not turn, and a
# solver that iterates to its end instead of stopping at a tolerance relative to those armatures.
_BEST = _GenesisSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, precision="64",
    integrator="Euler", cone="elliptic", friction=5.0, torsional=5.0, damping=1e8, armature=1e6,
    impedance=0.9999, impratio=1e4, iterations=50, tolerance=1e-14,
)  # fmt: skip


def _lacks(scene: Scene, settings: _GenesisSettings) -> str | None:
    """Return that it lacks double precision, or torsional friction, as it comes."""
    single = adapter.in_single_precision(scene, settings) if settings.precision == "32" else None
    free = adapter.no_torsion(scene) if settings.torsional is None else None
    return "; ".join(filter(None, (single, free))) or None


GENESIS = adapter.Adapter(
    label=Label("Genesis", adapter.version_of("genesis-world"), "#AA4499", "p"),
    packages=("genesis",),
    extra="genesis",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_GenesisWorld,
    lacks=_lacks,
)
