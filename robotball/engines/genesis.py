"""Genesis: its rigid solver on the CPU, with a velocity servo for each hinge.

Its contact model follows MuJoCo. Genesis integrates only with semi-implicit Euler, with or without
an implicit part.
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
    """Settings of a Genesis run; `integrator` and `cone` are Genesis's names."""

    precision: Literal["32", "64"] = "32"  # bits
    integrator: str | None = None
    cone: str | None = None
    friction: float | None = None  # of ball and plane; Genesis uses at most 5
    torsional: float | None = None  # m, against spin; for rubber balls only
    damping: float = 450.0  # N m s/rad, gain of the hinges' velocity servos
    most_torque: float | None = None  # N m, of a servo; None: no limit
    armature: float | None = None  # kg m², reflected inertia of the hinges
    impedance: float | None = None  # of the contact, at every depth
    impratio: float | None = None  # impedance of friction relative to the normal direction
    iterations: int | None = None  # of the solver, like `tolerance`
    tolerance: float | None = None


class _GenesisWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _GenesisSettings, step: float) -> None:
        super().__init__(scene)
        import genesis as gs

        gs.destroy()  # left over if an earlier run failed
        gs.init(backend=gs.cpu, precision=settings.precision, logging_level="warning")
        torsional = settings.torsional if scene.rolling == "rubber" else None
        options = adapter.without_none(
            iterations=settings.iterations, tolerance=settings.tolerance,
            impratio=settings.impratio, enable_torsional_friction=torsional is not None,
            integrator=settings.integrator and getattr(gs.integrator, settings.integrator),
            friction_cone=settings.cone and getattr(gs.friction_cone, settings.cone),
        )  # fmt: skip
        self.world = gs.Scene(
            show_viewer=False,
            sim_options=gs.options.SimOptions(
                dt=step, gravity=tuple(scene.gravity_at(0.0).tolist())
            ),
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
        self.lag = (settings.armature or 0.0) / settings.damping  # s, of a servo behind its target
        if settings.armature is not None:
            self.ball.set_dofs_armature(np.full(h, settings.armature), self.hinges)
        self.ball.set_qpos(np.concatenate([start.centre, start.attitude, start.angles]))
        omega = rotation_matrix(start.attitude).T @ start.omega  # in the shell's axes
        self.ball.set_dofs_velocity(np.concatenate([start.velocity, omega, start.rates]))
        self.set_rates(start.rates)

    def control(self, t: float, step: float) -> None:
        # The servo also accelerates its armature; without this lead it would lag.
        before, after = (self.hinges_at(time)[1] for time in (t, t + step))
        self.set_rates(before + self.lag / step * (after - before))

    def set_rates(self, rates: Array) -> None:
        self.ball.control_dofs_velocity(rates, self.hinges)

    def step(self, step: float) -> None:
        self.world.step()

    def python_seconds(self) -> float:
        return adapter.python_part(self)

    def state(self) -> State:
        q, v = _double(self.ball.get_qpos()), _double(self.ball.get_dofs_velocity())
        attitude = q[3:7] / np.linalg.norm(q[3:7])
        return State(q[:3], v[:3], attitude, rotation_matrix(attitude) @ v[3:6], q[7:], v[6:])

    def end(self) -> None:
        # Genesis writes compiled kernels, a minute's work, to disk only here or at Python's exit,
        # which robotball's processes skip.
        import genesis as gs

        gs.destroy()

    def force(self) -> Array:
        return _double(self.ball.get_links_net_contact_force())[0]


def _double(values: Any) -> Array:
    return np.asarray(values.numpy(), dtype=float)


def _mjcf(scene: Scene, settings: _GenesisSettings) -> str:
    root = Element("mujoco")
    above = {"": SubElement(root, "worldbody")}
    for link in links_of(scene):
        body = SubElement(above[link.parent], "body", name=link.name, pos=_text(link.pivot))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        SubElement(
            body, "inertial", pos=_text(link.centre), mass=_text([link.mass]),
            fullinertia=_text([xx, yy, zz, xy, xz, yz]),
        )  # fmt: skip
        if not link.parent:
            SubElement(body, "freejoint")
            sphere = SubElement(body, "geom", type="sphere", size=_text([scene.ball.radius]))
            if (d := settings.impedance) is not None:
                # Equal at both ends: the same impedance at every depth.
                sphere.set("solimp", _text([d, d, 1e-3, 0.5, 1.0]))
        else:
            SubElement(body, "joint", type="hinge", name=link.name, axis=_text(link.axis))
        above[link.name] = body
    return tostring(root, encoding="unicode")


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


_AS_IT_COMES = _GenesisSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1e-2,
    most_torque=87.0,
)  # fmt: skip
# Genesis's largest friction; the ball needs 1.2. The other settings follow those for MuJoCo: an
# elliptic cone, a hard contact, armatures that the load cannot accelerate, and a solver that runs
# all iterations, because its tolerance is relative to those armatures.
_BEST = _GenesisSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, precision="64",
    integrator="Euler", cone="elliptic", friction=5.0, torsional=5.0, damping=1e8, armature=1e6,
    impedance=0.9999, impratio=1e4, iterations=50, tolerance=1e-14,
)  # fmt: skip


def _lacks(scene: Scene, settings: _GenesisSettings) -> str | None:
    single = adapter.in_single_precision(scene, settings) if settings.precision == "32" else None
    free = adapter.no_torsion(scene) if settings.torsional is None else None
    return "; ".join(filter(None, (single, free))) or None


GENESIS = adapter.Adapter(
    label=Label("Genesis", adapter.version_of("genesis-world"), "#AA4499", "p"),
    packages=("genesis",),
    extra="genesis",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_GenesisWorld,
    rolls_unbalanced=True,
    resists_spin=True,
    lacks=_lacks,
)
