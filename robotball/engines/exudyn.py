"""Exudyn: the ball as one body with an ideal rolling constraint, or on Exudyn's contact.

Exudyn's rolling joints are for discs, whose contact point depends on the disc's axis. A ball rolls
with our velocity constraint, and our torque replaces the rotors. The constraint and the torque are
Python functions. Rotors as bodies would need short steps: at 2 ms with the default solver, a rotor
at 150 rad/s has an error of 6.6e-3 with Euler parameters and 2.6e-4 with a rotation vector
(docs/findings/exudyn_fast_rotor.py).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from robotball.engines import adapter
from robotball.engines.states import State, force_on_ball
from robotball.motion import Label
from robotball.robot.scene import Scene
from robotball.rotations import Array, conjugate, from_matrix, multiply, rotation_matrix

_CONTACT_DEPTH = 1e-6  # radii by which the weight presses the ball into Exudyn's contact
_PLANE = 1e4  # size of the plane in radii


@dataclass(frozen=True, kw_only=True)
class _ExudynSettings(adapter.StepSettings):
    """Settings of an Exudyn run."""

    solver: Literal["TrapezoidalIndex2", "GeneralizedAlpha"] = "GeneralizedAlpha"
    tolerance: float | None = None  # of Newton's iteration, relative
    modified: bool = False  # keep Newton's matrix over steps
    load_jacobian: bool = True  # include our torque's derivatives in Newton's matrix
    friction: float | None = None  # of Exudyn's contact; None: our constraint
    slip_zone: float = 2e-5  # m/s, slip speed at which friction is full
    stiffness: float | None = None  # N/m, of the contact; None: pressed in by 1e-6 radii


class _ExudynWorld(adapter.World):
    """One rigid body in the frame's axes, with the inertia of the whole ball."""

    def __init__(self, scene: Scene, settings: _ExudynSettings, step: float) -> None:
        super().__init__(scene)
        import exudyn
        import exudyn.itemInterface
        import exudyn.rigidBodyUtilities

        self.settings, self.calls = settings, [0, 0, 0]
        self.exudyn, self.items, self.longest = exudyn, exudyn.itemInterface, step
        self.to_omega = exudyn.rigidBodyUtilities.EulerParameters2G
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.nodes: list[Any] = []
        self._fill()
        node = {"nodeNumber": self.nodes[-1]}
        kinds = ("Position", "Velocity", "AngularVelocity", "RotationMatrix")
        self.sensors = [self._sensor(self.items.SensorNode, node, kind) for kind in kinds]
        self.system.Assemble()

    def _sensor(self, sensor: Any, item: dict[str, Any], kind: str) -> Any:
        read = getattr(self.exudyn.OutputVariableType, kind)
        return self.system.AddSensor(sensor(**item, outputVariableType=read, storeInternal=True))

    def _fill(self) -> None:
        """Add bodies and the constraint. The state is read from the last node."""
        ball = self.scene.ball
        self.row_count, self.driven = 4 if self.scene.rolling == "rubber" else 3, slice(None)
        omega = self.now.omega + self.now.rates[0] * self._axis(self.now.attitude)
        self._torque_on(self._body(ball.mass, ball.inertia, omega))
        self._constrain([self.system.AddNode(self.items.NodePointGround()), *self.nodes])

    def _axis(self, attitude: Array) -> Array:
        """Return the shell's axis in world axes."""
        return np.asarray(rotation_matrix(attitude) @ self.scene.ball.shell.axis)

    def _to_omega(self, attitude: Array) -> Array:
        """Return the matrix from the rates of Euler parameters to ω in world axes."""
        return np.array(self.to_omega(attitude))

    def _body(self, mass: float, inertia: Array, omega: Array) -> Any:
        """Add a body at the sphere's centre, in the ball's axes. Returns its marker."""
        system, items, now = self.system, self.items, self.now
        start = np.array([0.0, 0.0, self.scene.ball.radius, *now.attitude])
        rates = [*now.velocity, *np.linalg.pinv(self._to_omega(now.attitude)) @ omega]
        # Initial coordinates are relative to the reference coordinates.
        coordinates = {"referenceCoordinates": start, "initialCoordinates": 0 * start}
        node = system.AddNode(items.NodeRigidBodyEP(**coordinates, initialVelocities=rates))
        self.nodes.append(node)
        moments = inertia[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]  # xx, yy, zz, yz, xz, xy
        body = items.ObjectRigidBody(mass=mass, inertia=moments, nodeNumber=node)
        marker = system.AddMarker(items.MarkerBodyRigid(bodyNumber=system.AddObject(body)))
        weight = (mass * self.scene.gravity_at(0.0)).tolist()
        system.AddLoad(items.LoadForceVector(markerNumber=marker, loadVector=weight))
        return marker

    def _torque_on(self, marker: Any) -> None:
        how = {"bodyFixed": True, "loadVectorUserFunction": self._torque}
        self.system.AddLoad(self.items.LoadTorqueVector(markerNumber=marker, **how))

    def _constrain(self, nodes: list[Any]) -> None:
        """Add our constraint on the velocities of two nodes."""
        marker = self.items.MarkerNodeCoordinates
        sizes = [len(self.system.GetNode(node)["referenceCoordinates"]) for node in nodes]
        first, second = (np.zeros((self.row_count, size)) for size in sizes)
        ends = [self.system.AddMarker(marker(nodeNumber=node)) for node in nodes]
        rolling = self.items.ObjectConnectorCoordinateVector(
            markerNumbers=ends, scalingMarker0=first, scalingMarker1=second, velocityLevel=True,
            constraintUserFunction=self._constraint, jacobianUserFunction=self._jacobian,
        )  # fmt: skip
        self.system.AddObject(rolling)

    # Functions that Exudyn calls.

    def _torque(self, system: Any, t: float, load: Any) -> Array:
        """Return -ω×k - dk/dt in the frame's axes, for the angular momentum k of the hinges."""
        self.calls[0] += 1
        drives = self.scene.drives[self.driven]
        inertia = self.scene.ball.gyrostatic_inertia[:, self.driven]
        k = inertia @ [drive.rate(t) for drive in drives]
        k_rate = inertia @ [drive.acceleration(t) for drive in drives]
        kind = self.exudyn.OutputVariableType.AngularVelocityLocal
        x, y, z = system.GetNodeOutput(self.nodes[0], kind)
        return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]) @ k - k_rate

    def _constraint(self, system: Any, t: float, item: int, q: Array, q_t: Array, _: bool) -> Array:
        """Return the residual of v = a (ω - Ω)×e_z, and of (ω - Ω, e_z) = 0 for rubber balls."""
        self.calls[1] += 1
        return self._rows(q) @ q_t - self._prescribed(t, q)

    def _jacobian(self, system: Any, t: float, item: int, q: Array, q_t: Array, _: bool) -> Any:
        self.calls[2] += 1
        return self.exudyn.MatrixContainer(self._rows(q))

    def _rows(self, q: Array) -> Array:
        # A marker's coordinates include the reference; if it is added again, the solver fails.
        G, a = self._to_omega(q[3:]), self.scene.ball.radius
        J = np.zeros((self.row_count, len(q)))
        # The third row keeps the centre's height. A velocity constraint, because the contact point
        # moves over the ball.
        J[0, 0] = J[1, 1] = J[2, 2] = 1.0
        J[0, 3:], J[1, 3:] = -a * G[1], a * G[0]
        if self.row_count == 4:
            J[3, 3:] = G[2]
        return J

    def _prescribed(self, t: float, q: Array) -> Array:
        shell, drive = self.scene.ball.shell, self.scene.drives[0]
        x, y, z = self._axis(q[3:]) * drive.rate(t)
        return np.array([-shell.radius * y, shell.radius * x, 0.0, z])[: self.row_count]

    def march(self, times: Array, timestep: float) -> Iterator[Callable[[], State]]:
        exudyn, settings = self.exudyn, self.settings
        self.steps = round(float(times[-1]) / self.longest)
        chosen = exudyn.SimulationSettings()
        chosen.timeIntegration.numberOfSteps = self.steps
        chosen.timeIntegration.endTime = float(times[-1])
        chosen.timeIntegration.verboseMode = 0
        if not settings.load_jacobian:
            chosen.timeIntegration.computeLoadsJacobian = 0
        if settings.tolerance is not None:
            chosen.timeIntegration.newton.relativeTolerance = settings.tolerance
        chosen.timeIntegration.newton.useModifiedNewton = settings.modified
        chosen.solution.file.write = False
        # Store every step: if Newton fails, Exudyn shortens a step, and samples at a fixed period
        # would then be at other times.
        chosen.solution.sensors.writePeriod = 0.0
        solver = getattr(exudyn.DynamicSolverType, settings.solver)
        self.system.SolveDynamic(chosen, solverType=solver)
        states = self._states(times)
        for _ in times[1:]:
            yield states.__next__

    def _states(self, times: Array) -> Iterator[State]:
        from scipy.interpolate import CubicSpline  # late: all engines are listed without it

        read = [self.system.GetSensorStoredData(sensor) for sensor in self.sensors]
        # The error of the cubic has order 4, that of the solver order 2.
        path = CubicSpline(read[0][:, 0], np.hstack([columns[:, 1:] for columns in read]))
        for t in times[1:].tolist():
            centre, velocity, omega, R = np.split(path(t), [3, 6, 9])
            yield self._state(t, centre, velocity, omega, from_matrix(R.reshape(3, 3)))

    def _state(
        self, t: float, centre: Array, velocity: Array, omega: Array, attitude: Array
    ) -> State:
        """Return the state at t [s] from the frame's state, which the sensors store."""
        axis, (angles, rates) = self.scene.ball.shell.axis, self.hinges_at(t)
        half = np.array([np.cos(angles[0] / 2), *np.sin(angles[0] / 2) * axis])
        omega = omega - rates[0] * self._axis(attitude)
        return State(centre, velocity, multiply(attitude, conjugate(half)), omega, angles, rates)

    def python_seconds(self) -> float:
        """Return the time of our three functions, from the number of their calls [s]."""
        q = np.array([*np.zeros(3), *self.now.attitude] * len(self.nodes))
        arguments = (None, 0.0, 0, q, np.ones(len(q)), True)
        timed = (
            lambda: self._torque(self.system, 0.0, None),
            lambda: self._constraint(*arguments),
            lambda: self._jacobian(*arguments),
        )
        return sum(adapter.seconds_per_call(f) * n for f, n in zip(timed, self.calls, strict=True))


class _ContactWorld(_ExudynWorld):
    """The shell on Exudyn's contact, and a second body for the rest of the ball.

    Our constraint joins the centres of the two bodies, prescribes the frame's rate, and prevents
    spin of a rubber ball.
    """

    def _fill(self) -> None:
        system, items, settings = self.system, self.items, self.settings
        scene, ball, now = self.scene, self.scene.ball, self.now
        self.row_count, self.driven = 7 if scene.rolling == "rubber" else 6, slice(1, None)
        shell, omega = ball.shell, now.omega + now.rates[0] * self._axis(self.now.attitude)
        # Frame and shell have the same axes at the start.
        self._torque_on(self._body(ball.mass - shell.mass, ball.inertia - shell.inertia, omega))
        sphere = self._body(shell.mass, shell.inertia, now.omega)
        self._constrain(self.nodes)
        ground = items.MarkerBodyRigid(bodyNumber=system.AddObject(items.ObjectGround()))
        state = items.NodeGenericData(initialCoordinates=[0.0] * 4, numberOfDataCoordinates=4)
        weight, far = ball.mass * scene.gravity, _PLANE * ball.radius
        stiffness = settings.stiffness or weight / (_CONTACT_DEPTH * ball.radius)
        triangle = [[-2 * far, -far, 0], [2 * far, -far, 0], [0, 3 * far, 0]]
        contact = items.ObjectContactSphereTriangle(
            markerNumbers=[sphere, system.AddMarker(ground)], nodeNumber=system.AddNode(state),
            sphereRadius=ball.radius + weight / stiffness, includeEdges=0,
            trianglePoints=self.exudyn.Vector3DList(triangle), contactStiffness=stiffness,
            dynamicFriction=settings.friction, frictionProportionalZone=settings.slip_zone,
        )  # fmt: skip
        item = {"objectNumber": system.AddObject(contact)}
        self.force_sensor = self._sensor(items.SensorObject, item, "Force")
        self.t, self.friction = 0.0, settings.friction or self.friction

    def _rows(self, q: Array) -> Array:
        m = len(q) // 2
        rest, shell = self._to_omega(q[3:m]), self._to_omega(q[m + 3 :])
        J = np.zeros((7, 2 * m))
        J[:3, :3], J[:3, m : m + 3] = -np.eye(3), np.eye(3)
        J[3:6, 3:m], J[3:6, m + 3 :] = -rest, shell
        J[6, m + 3 :] = shell[2]
        return J[: self.row_count]

    def _prescribed(self, t: float, q: Array) -> Array:
        relative = self._axis(q[3 : len(q) // 2]) * self.scene.drives[0].rate(t)
        return np.array([0.0, 0.0, 0.0, *-relative, 0.0])[: self.row_count]

    def force(self) -> Array:
        at, *parts = self.system.GetSensorStoredData(self.force_sensor).T
        return force_on_ball([np.array([np.interp(self.t, at, part) for part in parts])])

    def _state(
        self, t: float, centre: Array, velocity: Array, omega: Array, attitude: Array
    ) -> State:
        self.t = t
        return State(centre, velocity, attitude, omega, *self.hinges_at(t))


# The contact of Exudyn's example. The others impose our constraint on the hinge or on everything.
_AS_IT_COMES = _ExudynSettings(
    name="as-it-comes", error_tolerance=1e-2, stop_at_fault=False, timestep=2e-4, tolerance=1e-6,
    solver="TrapezoidalIndex2", modified=True, friction=0.2, slip_zone=1e-3, stiffness=1e5,
)  # fmt: skip
_BEST = _ExudynSettings(name="best", error_tolerance=1e-3, stop_at_fault=False, timestep=1e-3)
_CONTACT = replace(
    _BEST, name="contact", solver="TrapezoidalIndex2", tolerance=1e-9, load_jacobian=False,
    friction=20.0,
)  # fmt: skip


def _lacks(scene: Scene, settings: _ExudynSettings) -> str | None:
    if settings.friction is None:
        return None
    return adapter.no_torsion(scene, "a constraint from robotball forbids the spin")


def _world(scene: Scene, settings: _ExudynSettings, step: float) -> adapter.World:
    return (_ExudynWorld if settings.friction is None else _ContactWorld)(scene, settings, step)


EXUDYN = adapter.Adapter(
    label=Label("Exudyn", adapter.version_of("exudyn"), "#CC79A7", "X"),
    packages=("exudyn",),
    extra="exudyn",
    presets=adapter.by_name(_AS_IT_COMES, _BEST, _CONTACT),
    world=_world,
    lacks=_lacks,
)
