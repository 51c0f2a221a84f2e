"""Rapier: bodies with hinges as constraints and velocity motors, in single precision.

Its contact at one point resists no spin; we apply a torque against spin instead. The hinges are
impulse joints: a multibody rounds hinge angles more as they grow (docs/engines.md).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball, link_motions, links_of, principal_inertia
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, conjugate, multiply, rotation_matrix


@dataclass(frozen=True, kw_only=True)
class _RapierSettings(adapter.SpinSettings):
    """Settings of a Rapier run."""

    friction: float | None = None  # of ball and plane
    substeps: int | None = None  # in each step; Rapier calls them solver iterations
    gain: float = 30.0  # of the hinges' velocity motors
    by_force: bool = False  # the gain is in N m s/rad, and not relative to the inertia
    fast_rotation: bool = False  # lift the limit of 45° per step


class _RapierWorld(adapter.ServoWorld):
    def __init__(self, scene: Scene, settings: _RapierSettings, step: float) -> None:
        super().__init__(scene)
        import rapier3d as rapier

        self.world = world = rapier.PhysicsWorld()
        self.set_gravity(scene.gravity_at(0.0))
        options = world.integration_parameters
        options.dt = step
        # Make a moving floor's contact as hard as the contact of a floor at rest, not half as hard.
        options.contact_softness = options.static_contact_softness
        if settings.substeps is not None:
            options.num_solver_iterations = settings.substeps
        sphere = rapier.Collider.ball(scene.ball.radius).density(0.0)
        surfaces = [sphere, rapier.Collider.halfspace([0.0, 0.0, 1.0])]
        if settings.friction is not None:
            surfaces = [surface.friction(settings.friction) for surface in surfaces]
        handle = world.add_body(rapier.RigidBody.kinematic_velocity_based(), [surfaces[1]])
        self.floor = world.rigid_bodies[handle]
        self.set_turn(float(scene.plane_turn.rate(0.0)))
        (self.plane,) = self.floor.colliders
        self.friction = world.colliders[self.plane].friction
        model = rapier.MotorModel
        kind = model.FORCE_BASED if settings.by_force else model.ACCELERATION_BASED
        self.gain, self.axis = settings.gain, rapier.JointAxis.ANG_X
        handles, self.hinges = dict[str, Any](), list[Any]()
        for link, q, omega, pivot, velocity in link_motions(scene, self.now):
            moments, axes = principal_inertia(link)
            inertia = rapier.MassProperties(
                link.centre, link.mass, moments, rapier.Rotation3(*axes.tolist())
            )
            place = rapier.Isometry3(pivot, rapier.Rotation3(*q.tolist()))
            of_centre = velocity + np.cross(omega, rotation_matrix(q) @ link.centre)
            body = rapier.RigidBody.dynamic().position(place).linvel(of_centre).angvel(omega)
            body = body.additional_mass_properties(inertia).can_sleep(False)
            body = body.allow_fast_rotation(settings.fast_rotation)
            handles[link.name] = world.add_body(body, [] if link.parent else [surfaces[0]])
            if link.parent:
                hinge = rapier.RevoluteJointBuilder(link.axis).local_anchor1(link.pivot)
                hinge = hinge.contacts_enabled(False).motor_model(kind).build()
                ends = handles[link.parent], handles[link.name]
                self.hinges.append(world.impulse_joints.insert(*ends, hinge))
        self.bodies = {name: world.rigid_bodies[handle] for name, handle in handles.items()}
        self.shell, self.offset = self.bodies["shell"], links_of(scene)[0].centre
        self.damping = adapter.spin_damping(scene, settings, step)
        self.set_rates(self.now.rates)

    def set_gravity(self, gravity: Array) -> None:
        self.world.gravity = gravity

    def set_turn(self, rate: float) -> None:
        self.floor.angvel = [0.0, 0.0, rate]

    def set_rates(self, rates: Array) -> None:
        for handle, rate in zip(self.hinges, rates.tolist(), strict=True):
            hinge = self.world.impulse_joints.get(handle)
            motor = hinge.data
            motor.set_motor_velocity(self.axis, rate, self.gain)
            hinge.data = motor

    def step(self, step: float) -> None:
        if self.damping:
            self._resist_spin()
        self.world.step()

    def _resist_spin(self) -> None:
        self.shell.reset_torques()
        spin = self.shell.angvel.z - self.floor.angvel.z
        self.shell.add_torque((0.0, 0.0, -self.damping * spin))

    def python_seconds(self) -> float:
        torque = adapter.seconds_per_call(self._resist_spin) * self.steps if self.damping else 0.0
        return super().python_seconds() + torque

    def state(self) -> State:
        attitudes = {name: _attitude(body) for name, body in self.bodies.items()}
        omegas = {name: _array(body.angvel) for name, body in self.bodies.items()}
        hinges = []
        for link in links_of(self.scene)[1:]:
            parent, child = attitudes[link.parent], attitudes[link.name]
            relative = multiply(conjugate(parent), child)
            angle = 2 * np.arctan2(relative[1:] @ link.axis, relative[0])
            rate = (omegas[link.name] - omegas[link.parent]) @ rotation_matrix(parent) @ link.axis
            hinges.append((angle, rate))
        angles, rates = np.reshape(hinges, (-1, 2)).T
        q, omega = attitudes["shell"], omegas["shell"]
        # Rapier's velocity is that of the centre of mass.
        velocity = _array(self.shell.linvel) - np.cross(omega, rotation_matrix(q) @ self.offset)
        centre = _array(self.shell.translation)
        return State(centre, velocity, q, omega, self.with_turns(angles, self.sampled), rates)

    def force(self) -> Array:
        pairs = self.world.narrow_phase.contact_pairs_with(self.plane)
        step = self.world.integration_parameters.dt
        return force_on_ball(_array(pair.total_impulse()) / step for pair in pairs)


def _array(vector: Any) -> Array:
    return np.array(vector.to_tuple())


def _attitude(body: Any) -> Array:
    q = np.roll(body.rotation.to_tuple(), 1)  # from (x, y, z, w)
    return q / np.linalg.norm(q)


_AS_IT_COMES = _RapierSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=1 / 60, spin_part=0.0
)
# The ball needs a friction of 1.2. By default Rapier would limit the rotor to 45° per step. If
# substeps are longer than 50 µs, the first-order error grows; if they are shorter, rounding errors
# grow (docs/findings/rapier_gyroscopic.py).
_BEST = _RapierSettings(
    name="best", error_tolerance=5e-2, stop_at_fault=False, timestep=1e-3, friction=20.0,
    substeps=20, gain=1e9, by_force=True, fast_rotation=True,
)  # fmt: skip


def _lacks(scene: Scene, settings: _RapierSettings) -> str:
    single, spin = adapter.in_single_precision(scene, settings), adapter.spins(scene, settings)
    return "; ".join(filter(None, (single, spin)))


RAPIER = adapter.Adapter(
    label=Label("Rapier", adapter.version_of("rapier3d"), "#B22222", "H"),
    packages=("rapier3d",),
    extra="rapier",
    presets=adapter.by_name(_AS_IT_COMES, _BEST),
    world=_RapierWorld,
    moves_plane=True,
    rolls_unbalanced=True,
    lacks=_lacks,
)
