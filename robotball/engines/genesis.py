"""Genesis: its rigid solver on the processor, after MuJoCo's model, with a velocity servo a hinge.

It steps by semi-implicit Euler alone, with or without an implicit part.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from robotball.engine import Ladder
from robotball.engines.adapter import Adapter, SteppedWorld, StepSettings, World, version_of
from robotball.engines.links import State, links_of
from robotball.motion import Label
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene

LABEL = Label("Genesis", version_of("genesis-world"), "#AA4499")


@dataclass(frozen=True, kw_only=True)
class GenesisSettings(StepSettings):
    """None leaves a choice at Genesis's own default.

    precision: of its arithmetic, in bits; integrator, cone: by its own names; friction: of ball
    and plane, of which it takes 5 at most; torsional m: the same against spin, of a rubber ball,
    which as it comes nothing resists; damping N m s/rad: of the hinges' velocity servos; armature
    kg m²: their reflected inertia; impedance: of the contact; impratio: how much harder friction
    is than the normal force; iterations, tolerance: of its solver.
    """

    precision: Literal["32", "64"] = "32"
    integrator: str | None = None
    cone: str | None = None
    friction: float | None = None
    torsional: float | None = None
    damping: float = 10.0
    armature: float | None = None
    impedance: float | None = None
    impratio: float | None = None
    iterations: int | None = None
    tolerance: float | None = None


class GenesisWorld(SteppedWorld):
    """The ball and its plane in a scene of their own."""

    def __init__(self, scene: Scene, settings: GenesisSettings, step: float) -> None:
        super().__init__(scene)
        import genesis as gs

        gs.destroy()  # of the world before, whose precision may be another
        gs.init(backend=gs.cpu, precision=settings.precision, logging_level="error")
        torsional = settings.torsional if scene.rolling == "rubber" else None
        options: dict[str, Any] = {
            "iterations": settings.iterations,
            "tolerance": settings.tolerance,
            "impratio": settings.impratio,
            "integrator": settings.integrator and getattr(gs.integrator, settings.integrator),
            "friction_cone": settings.cone and getattr(gs.friction_cone, settings.cone),
            "enable_torsional_friction": torsional is not None,
        }
        self.world = gs.Scene(
            show_viewer=False,
            sim_options=gs.options.SimOptions(dt=step, gravity=(0.0, 0.0, -scene.gravity)),
            rigid_options=gs.options.RigidOptions(
                **{name: value for name, value in options.items() if value is not None}
            ),
        )
        material = gs.materials.Rigid(friction=settings.friction, friction_torsional=torsional)
        self.world.add_entity(gs.morphs.Plane(), material=material)
        robot = gs.morphs.MJCF(file=_mjcf(scene, settings))
        self.ball = self.world.add_entity(robot, material=material)
        self.world.build()
        start, h = self.now, len(scene.drives)
        self.hinges = list(range(6, 6 + h))
        self.ball.set_dofs_kv(np.full(h, settings.damping), self.hinges)
        self.ball.set_dofs_force_range(np.full(h, -np.inf), np.full(h, np.inf), self.hinges)
        if settings.armature is not None:
            self.ball.set_dofs_armature(np.full(h, settings.armature), self.hinges)
        self.ball.set_qpos(np.concatenate([start.centre, start.attitude, start.angles]))
        turning = rotation_matrix(start.attitude).T @ start.turning
        self.ball.set_dofs_velocity(np.concatenate([start.velocity, turning, start.rates]))
        self._turn(start.rates)

    def _turn(self, rates: Array) -> None:
        self.ball.control_dofs_velocity(rates, self.hinges)

    def control(self, t: float, step: float) -> None:
        self._turn(np.array([float(drive.rate(t + step)) for drive in self.scene.drives]))

    def step(self, step: float) -> None:
        self.world.step()

    def state(self) -> State:
        q, v = _double(self.ball.get_qpos()), _double(self.ball.get_dofs_velocity())
        attitude = q[3:7] / np.linalg.norm(q[3:7])
        return State(q[:3], v[:3], attitude, rotation_matrix(attitude) @ v[3:6], q[7:], v[6:])


def _double(values: Any) -> Array:
    return np.asarray(values.numpy(), dtype=float)


def _mjcf(scene: Scene, settings: GenesisSettings) -> str:
    """The ball alone: what Genesis reads bodies from."""
    root = Element("mujoco")
    above = [SubElement(root, "worldbody")]
    for link in links_of(scene):
        parent = above[link.parent + 1] if link.drive else above[0]
        body = SubElement(parent, "body", name=link.name, pos=_text(link.origin))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        SubElement(
            body, "inertial", pos=_text(link.centre), mass=_text([link.mass]),
            fullinertia=_text([xx, yy, zz, xy, xz, yz]),
        )  # fmt: skip
        if link.drive is None:
            SubElement(body, "freejoint")
            sphere = SubElement(body, "geom", type="sphere", size=_text([scene.ball.radius]))
            if (d := settings.impedance) is not None:
                sphere.set("solimp", _text([d, d, 1e-3, 0.5, 1.0]))
        else:
            SubElement(body, "joint", type="hinge", name=link.name, axis=_text(link.axis))
        above.append(body)
    return tostring(root, encoding="unicode")


def _text(values: Any) -> str:
    return " ".join(repr(float(each)) for each in values)


PRESETS = {
    each.name: each
    for each in (
        GenesisSettings(
            name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-2
        ),
        GenesisSettings(
            name="best",
            error_tolerance=5e-2,
            stop_at_fault=False,
            timestep=1e-3,
            precision="64",
            integrator="Euler",
            cone="elliptic",
            friction=5.0,
            torsional=5.0,
            damping=1e8,
            armature=1e6,
            impedance=0.9999,
            impratio=1e4,
            iterations=50,
            tolerance=1e-14,
        ),
    )
}


class Genesis(Adapter):
    """The engine, as `robotball.engine` describes one."""

    label = LABEL
    package = "genesis"
    extra = "genesis"
    requirements = ("genesis-world>=1.4.5", "torch>=2.8")
    ladders: Mapping[str, Ladder] = {
        "as-it-comes": ("timestep", (1e-2,)),
        "best": ("timestep", (4e-3, 1e-3, 2.5e-4)),
    }
    settings_type = GenesisSettings
    presets: Mapping[str, StepSettings] = PRESETS

    def lacks(self, scene: Scene, settings: StepSettings) -> str | None:
        """Double precision, or torsional friction, as it comes."""
        assert isinstance(settings, GenesisSettings)
        said = ["its state is in single precision"] if settings.precision == "32" else []
        if scene.rolling == "rubber" and settings.torsional is None:
            said.append("its contact has no torsional friction: the shell spins freely")
        return "; ".join(said) or None

    def world(self, scene: Scene, settings: StepSettings, step: float) -> World:
        assert isinstance(settings, GenesisSettings)
        return GenesisWorld(scene, settings, step)


GENESIS = Genesis()
