"""PhysX, in NVIDIA's package ovphysx: an articulation with hinge drives, in single precision.

The scene is written as USD text. It runs on the processor.
"""

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball, link_motions, links_of, principal_inertia
from robotball.motion import Label
from robotball.robot.ball import Link
from robotball.robot.scene import Scene
from robotball.rotations import Array, from_matrix, perpendicular, rotation_matrix

_BODY = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI"]
_ROOT = ["PhysicsArticulationRootAPI", "PhysxArticulationAPI", "PhysxContactReportAPI"]
_SURFACE = ["PhysicsCollisionAPI", "MaterialBindingAPI"]
_DRIVEN = [f"{name}:angular" for name in ("PhysicsDriveAPI", "PhysxJointAxisAPI")]
_DRIVEN += ["PhysicsJointStateAPI:angular"]
_ROUGH = {"rel material:binding:physics": "</World/rough>"}


@dataclass(frozen=True, kw_only=True)
class _PhysxSettings(adapter.StepSettings):
    """Settings of a PhysX run."""

    friction: float | None = None  # of ball and plane
    gain: float  # N m s/rad, of the hinges' velocity drives
    armature: float | None = None  # kg m², reflected inertia of the hinges
    damping: float | None = None  # 1/s, of each body's angular velocity
    most_rate: float | None = None  # rad/s, at which PhysX clips the bodies' initial rates
    torsional: float | None = None  # m, against spin; for rubber balls only
    iterations: int | None = None  # of the solver, for positions
    threads: int | None = None  # of the solver, beside Python's


@cache
def _package() -> Any:
    """Return the package, set up once per process: on the processor, with PhysX's USD schemas."""
    import ovphysx
    import ovstage
    from ovphysx.samples.python_samples.schema_support import physx_schema_paths

    ovphysx.PhysX.set_cpu_mode(True)
    ovstage.population.register_usd_schemas([str(path) for path in physx_schema_paths()])
    return ovphysx


class _PhysxWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _PhysxSettings, step: float) -> None:
        super().__init__(scene)
        package, self.offset = _package(), links_of(scene)[0].centre
        import ovstage

        self.types, self.friction = package.types, settings.friction or self.friction
        if settings.threads is not None:
            package.set_global_config(self.types.GlobalConfigKey.NUM_THREADS, settings.threads)
        self.physx, self.stage = package.PhysX(), ovstage.Stage("stage")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "ball.usda"
            file.write_text(_usd(scene, self.now, settings), encoding="utf-8")
            domains = ovstage.PopulationDomain.ALL
            ovstage.population.open_usd(self.stage, str(file), ordinal=1, domains=domains)
        self.stage.advance_write_floor(ordinal=1).wait()
        self.physx.wait_task(self.physx.attach_ovstage(self.stage, read_ordinal=1))

    def set_rates(self, rates: Array) -> None:
        kind = self.types.SimObjectType.ARTICULATION_JOINT
        with self.physx.write_sync(kind, "jointVelocityTarget") as session:
            (group,) = session.groups
            for target, rate in zip(group.tensors, np.degrees(rates).tolist(), strict=True):
                target.fill_(rate)
            session.commit_sync(group)

    def step(self, step: float) -> None:
        self.physx.step_sync(step)

    def python_seconds(self) -> float:
        # A step of 0 s simulates nothing. It takes 9 µs, and 6 µs of these are the package's
        # Python.
        call = adapter.seconds_per_call(lambda: self.physx.step_sync(0.0))
        return super().python_seconds() + call * self.steps

    def _read(self, kind: str, name: str) -> Array:
        with self.physx.read_sync(getattr(self.types.SimObjectType, kind), [name]) as result:
            parts = [part.numpy().ravel() for group in result.groups for part in group.tensors]
        return np.concatenate([[], *parts])

    def state(self) -> State:
        names = ("Position", "LinearVelocity", "Orientation", "AngularVelocity")
        centre, velocity, q, omega = (self._read("ARTICULATION", f"root{name}") for name in names)
        attitude = np.roll(q, 1) / np.linalg.norm(q)  # from (x, y, z, w)
        joint = "ARTICULATION_JOINT"
        angles, rates = (self._read(joint, f"joint{name}") for name in ("Position", "Velocity"))
        angles = self.with_turns(np.radians(angles), self.sampled)
        # PhysX's velocity is that of the centre of mass.
        velocity -= np.cross(omega, rotation_matrix(attitude) @ self.offset)
        return State(centre, velocity, attitude, omega, angles, np.radians(rates))

    def force(self) -> Array:
        names = ("netNormalContactForce", "netFrictionContactForce")
        parts = [self._read("CONTACT_SENSOR", name).reshape(-1, 3) for name in names]
        return force_on_ball(np.concatenate(parts))  # of all links

    def end(self) -> None:
        self.physx.wait_task(self.physx.detach_ovstage())
        self.physx.destroy()
        self.stage.destroy()


def _usd(scene: Scene, start: State, settings: _PhysxSettings) -> str:
    """Return the scene as USD text. USD counts angles in degrees."""
    gravity = scene.gravity_at(0.0)
    strength = float(np.linalg.norm(gravity))
    options = {
        "vector3f physics:gravityDirection": gravity / strength,
        "float physics:gravityMagnitude": strength,
        "bool physxScene:enableGPUDynamics": 0,
        "uniform token physxScene:broadphaseType": "MBP",
    }
    kinds = ("staticFriction", "dynamicFriction")
    friction = {f"float physics:{kind}": settings.friction for kind in kinds}
    prims = [
        _prim("PhysicsScene", "scene", ["PhysxSceneAPI"], options),
        _prim("Material", "rough", ["PhysicsMaterialAPI"], friction),
        _prim("Plane", "plane", _SURFACE, {"uniform token axis": "Z", **_ROUGH}),
    ]
    for i, (link, q, omega, pivot, velocity) in enumerate(link_motions(scene, start)):
        moments, axes = principal_inertia(link)
        body = {
            "float physics:mass": link.mass,
            "point3f physics:centerOfMass": link.centre,
            "float3 physics:diagonalInertia": moments,
            "quatf physics:principalAxes": axes,
            "vector3f physics:velocity": velocity
            + np.cross(omega, rotation_matrix(q) @ link.centre),
            "vector3f physics:angularVelocity": np.degrees(omega),
            "float physxRigidBody:angularDamping": settings.damping,
            "float physxRigidBody:maxAngularVelocity": _degrees(settings.most_rate),
            "double3 xformOp:translate": pivot,
            "quatd xformOp:orient": q,
            "uniform token[] xformOpOrder": ["xformOp:translate", "xformOp:orient"],
        }
        if link.parent:
            prims += [
                _prim("Xform", link.name, _BODY, body),
                _hinge(link, start.rates[i - 1], settings),
            ]
        else:
            body |= {
                "int physxArticulation:solverPositionIterationCount": settings.iterations,
                "float physxArticulation:sleepThreshold": 0.0,  # a slow ball must not fall asleep
                "float physxContactReport:threshold": 0.0,
            }
            patch = None  # m, radius of the contact patch, whose friction resists spin
            if scene.rolling == "rubber" and settings.torsional and settings.friction:
                patch = settings.torsional / settings.friction
            surface = _ROUGH | {
                "double radius": scene.ball.radius,
                "float physxCollision:torsionalPatchRadius": patch,
                "float physxCollision:minTorsionalPatchRadius": patch,
            }
            sphere = _prim("Sphere", "sphere", [*_SURFACE, "PhysxCollisionAPI"], surface)
            prims.append(_prim("Xform", link.name, [*_BODY, *_ROOT], body, sphere))
    units = "metersPerUnit = 1\nkilogramsPerUnit = 1"
    head = f'#usda 1.0\n(\ndefaultPrim = "World"\nupAxis = "Z"\n{units}\n)'
    return f"{head}\n{_prim('Xform', 'World', [], {}, *prims)}"


def _hinge(link: Link, rate: float, settings: _PhysxSettings) -> str:
    side = perpendicular(link.axis)
    # Rotates x, the hinge axis, onto the link's axis.
    turn = from_matrix(np.stack([link.axis, side, np.cross(link.axis, side)], axis=1))
    hinge = {
        "uniform token physics:axis": "X",
        "rel physics:body0": f"</World/{link.parent}>",
        "rel physics:body1": f"</World/{link.name}>",
        "point3f physics:localPos0": link.pivot,
        "quatf physics:localRot0": turn,
        "quatf physics:localRot1": turn,
        "uniform token drive:angular:physics:type": "force",
        "float drive:angular:physics:damping": np.radians(settings.gain),
        "float drive:angular:physics:targetVelocity": np.degrees(rate),
        "float state:angular:physics:velocity": np.degrees(rate),
        "float physxJointAxis:angular:armature": settings.armature,
    }
    return _prim("PhysicsRevoluteJoint", f"{link.name}_hinge", _DRIVEN, hinge)


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.degrees(angle))


def _prim(
    kind: str, name: str, schemas: list[str], attributes: Mapping[str, Any], *children: str
) -> str:
    """Return a USD prim; None leaves an attribute at its default."""
    lines = [f"{key} = {_text(value)}" for key, value in attributes.items() if value is not None]
    body = "\n".join([*lines, *children])
    applied = f" (\nprepend apiSchemas = {json.dumps(schemas)}\n)" if schemas else ""
    return f'def {kind} "{name}"{applied}\n{{\n{body}\n}}'


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return str(tuple(value.tolist()))
    return value if str(value).startswith("<") else json.dumps(value)


_AS_IT_COMES = _PhysxSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1 / 60, gain=5.7e7
)
# The patch resists spin; the armature keeps hinge rates in single precision; the rate limit is far
# above the rotor's 148 rad/s, which the default of 100 rad/s would clip. More iterations round the
# hinge angles more often. With worker threads a step takes 50 times the processor time.
_BEST = _PhysxSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, friction=20.0, gain=1e8,
    armature=1e4, damping=0.0, most_rate=1e6, torsional=400.0, iterations=20, threads=0,
)  # fmt: skip


PHYSX = adapter.Adapter(
    label=Label("PhysX (ovphysx)", adapter.version_of("ovphysx"), "#7F7F7F", "8"),
    packages=("ovphysx",),
    extra="physx",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_PhysxWorld,
    rolls_unbalanced=True,
    resists_spin=True,
    lacks=adapter.in_single_precision,
)
