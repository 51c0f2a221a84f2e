"""Exudyn: the ball as one body with a gyrostatic torque, on an ideal rolling constraint.

Its own rolling joints are for discs, whose contact point depends on the disc's axis; the rolling of
a ball is a velocity constraint that we give it as a Python function, and so is the torque of what
turns inside, which would need tiny steps as bodies of their own.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from robotball.engines.adapter import Adapter, StepSettings, World, longest_step, version_of
from robotball.engines.links import State, start_state
from robotball.engines.protocol import Ladder
from robotball.errors import InputError
from robotball.motion import Label
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
from robotball.scene import Scene

LABEL = Label("Exudyn", version_of("exudyn"), "#CC79A7")
CALLS = 200  # of our functions that are timed
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class ExudynSettings(StepSettings):
    """solver: of its dynamic solvers; tolerance: of Newton's, relative; modified: whether Newton's
    matrix is kept over steps; load_jacobian: whether it has our torque's derivatives.
    """

    solver: Literal["TrapezoidalIndex2", "GeneralizedAlpha"] = "GeneralizedAlpha"
    tolerance: float | None = None
    modified: bool = False
    load_jacobian: bool = True


class ExudynWorld(World):
    """One rigid body, in the frame's axes, with the inertia of the whole ball."""

    def __init__(self, scene: Scene, settings: ExudynSettings, step: float) -> None:
        super().__init__(scene)
        import exudyn
        import exudyn.itemInterface
        from exudyn.rigidBodyUtilities import EulerParameters2G

        self.settings, self.G, self.calls = settings, EulerParameters2G, [0, 0, 0]
        items, container = exudyn.itemInterface, exudyn.SystemContainer()
        self.system = system = container.AddSystem()
        self.container = container
        now, ball, h = start_state(scene), scene.ball, len(scene.drives)
        attitude, R = now.attitude, rotation_matrix(now.attitude)
        omega = now.turning + now.rates[0] * (R @ ball.shell.axis)
        G = np.array(EulerParameters2G(attitude))
        spinning = G.T @ omega / 4  # G G^T = 4 E
        node = system.AddNode(
            items.NodeRigidBodyEP(
                referenceCoordinates=[0.0, 0.0, ball.radius, *attitude],
                initialCoordinates=[0.0] * 7,
                initialVelocities=[*now.velocity, *spinning],
            )
        )
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = ball.inertia
        body = system.AddObject(
            items.ObjectRigidBody(mass=ball.mass, inertia=[xx, yy, zz, yz, xz, xy], nodeNumber=node)
        )
        marker = system.AddMarker(items.MarkerBodyRigid(bodyNumber=body))
        system.AddLoad(
            items.LoadTorqueVector(
                markerNumber=marker, bodyFixed=True, loadVectorUserFunction=self._torque
            )
        )
        weight = items.LoadForceVector(
            markerNumber=marker, loadVector=[0.0, 0.0, -ball.mass * scene.gravity]
        )
        system.AddLoad(weight)
        ground = system.AddNode(items.NodePointGround())
        ends = [
            system.AddMarker(items.MarkerNodeCoordinates(nodeNumber=each))
            for each in (ground, node)
        ]
        self.row_count = 4 if scene.rolling == "rubber" else 3
        system.AddObject(
            items.ObjectConnectorCoordinateVector(
                markerNumbers=ends,
                scalingMarker0=np.zeros((self.row_count, 3)),
                scalingMarker1=np.zeros((self.row_count, 7)),
                constraintUserFunction=self._constraint,
                jacobianUserFunction=self._jacobian,
                velocityLevel=True,
            )
        )
        sensors = [
            items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True)
            for kind in (
                exudyn.OutputVariableType.Coordinates,
                exudyn.OutputVariableType.Coordinates_t,
            )
        ]
        self.sensors = [system.AddSensor(sensor) for sensor in sensors]
        system.Assemble()
        self.exudyn, self.node, self.hinges = exudyn, node, h

    # What Exudyn asks of us ----------------------------------------------------------------

    def _torque(self, system: Any, t: float, load: Any) -> list[float]:
        """-ω×k - dk/dt of what turns inside, in the frame's axes."""
        self.calls[0] += 1
        ball, drives = self.scene.ball, self.scene.drives
        k = ball.gyrostatic_inertia @ [drive.rate(t) for drive in drives]
        pushed = ball.gyrostatic_inertia @ [drive.acceleration(t) for drive in drives]
        omega = system.GetNodeOutput(self.node, self.exudyn.OutputVariableType.AngularVelocityLocal)
        x, y, z = omega
        return [
            -(y * k[2] - z * k[1]) - pushed[0],
            -(z * k[0] - x * k[2]) - pushed[1],
            -(x * k[1] - y * k[0]) - pushed[2],
        ]

    def _constraint(
        self, system: Any, t: float, item: int, q: Array, q_t: Array, velocity: bool
    ) -> Array:
        """v = a (ω - Ω)×e_z, and (ω - Ω, e_z) = 0 of the rubber model."""
        self.calls[1] += 1
        return self._rows(q) @ q_t[-7:] - self._carried(t, q)

    def _jacobian(
        self, system: Any, t: float, item: int, q: Array, q_t: Array, velocity: bool
    ) -> Any:
        self.calls[2] += 1
        J = self._rows(q)
        matrix = self.exudyn.MatrixContainer()
        matrix.SetWithDenseMatrix(
            np.hstack([np.zeros((len(J), len(q) - 7)), J]), useDenseMatrix=True
        )
        return matrix

    def _rows(self, q: Array) -> Array:
        G, a = np.array(self.G(q[-4:])), self.scene.ball.radius
        J = np.zeros((self.row_count, 7))
        J[0, 0] = J[1, 1] = J[2, 2] = 1.0
        J[0, 3:], J[1, 3:] = -a * G[1], a * G[0]
        if self.row_count == 4:
            J[3, 3:] = G[2]
        return J

    def _carried(self, t: float, q: Array) -> Array:
        shell, drive = self.scene.ball.shell, self.scene.drives[0]
        x, y, z = rotation_matrix(q[-4:] / np.linalg.norm(q[-4:])) @ shell.axis * drive.rate(t)
        return np.array([-shell.radius * y, shell.radius * x, 0.0, z])[: self.row_count]

    # What we ask of Exudyn -----------------------------------------------------------------

    def march(self, times: Array, timestep: float) -> Iterator[State]:
        exudyn, settings = self.exudyn, self.settings
        interval = float(times[1])
        if not np.allclose(np.diff(times), interval, rtol=1e-9):
            raise InputError(f"{LABEL.name} keeps samples at equal intervals alone")
        self.longest = longest_step(self.scene, times, timestep)
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
        chosen.solution.sensors.writePeriod = interval
        solver = getattr(exudyn.DynamicSolverType, settings.solver)
        self.system.SolveDynamic(chosen, solverType=solver)
        q, q_t = (self.system.GetSensorStoredData(sensor)[:, 1:] for sensor in self.sensors)
        q = q + np.array([0.0, 0.0, self.scene.ball.radius, *self.now.attitude])
        for t, place, moving in zip(times[1:].tolist(), q[1:], q_t[1:], strict=True):
            yield self._state(t, place, moving)

    def _state(self, t: float, q: Array, q_t: Array) -> State:
        """The shell's, of the frame's coordinates."""
        axis, drives = self.scene.ball.shell.axis, self.scene.drives
        angles, rates = np.array([(drive.angle(t), drive.rate(t)) for drive in drives], float).T
        frame = q[3:] / np.linalg.norm(q[3:])
        half = np.array([np.cos(angles[0] / 2), *np.sin(angles[0] / 2) * axis])
        turning = np.array(self.G(q[3:])) @ q_t[3:] - rates[0] * (rotation_matrix(frame) @ axis)
        return State(q[:3], q_t[:3], multiply(frame, conjugate(half)), turning, angles, rates)

    def python_seconds(self) -> float:
        """Of our three functions, by their calls."""
        q, q_t = np.array([*np.zeros(3), *self.now.attitude]), np.ones(7)
        ours: tuple[Callable[[], Any], ...] = (
            lambda: self._torque(self.system, 0.0, None),
            lambda: self._constraint(None, 0.0, 0, q, q_t, True),
            lambda: self._jacobian(None, 0.0, 0, q, q_t, True),
        )
        counts, total = list(self.calls), 0.0
        for call, count in zip(ours, counts, strict=True):
            began = time.process_time()
            for _ in range(CALLS):
                call()
            total += (time.process_time() - began) / CALLS * count
        return total


# No preset comes as it is: both have our constraint. This one leaves the rest to Exudyn.
OWN_SOLVER = ExudynSettings(
    name="own-solver", error_tolerance=1e-3, stop_at_fault=False, timestep=1e-3
)
BEST = ExudynSettings(
    name="best",
    error_tolerance=1e-3,
    stop_at_fault=False,
    timestep=1e-3,
    solver="TrapezoidalIndex2",
    tolerance=1e-10,
    modified=True,
    load_jacobian=False,
)


class Exudyn(Adapter):
    """The engine, as `robotball.engines.protocol` describes one."""

    label = LABEL
    package = "exudyn"
    extra = "exudyn"
    requirements = ("exudyn>=1.13.6",)
    ladders: Mapping[str, Ladder] = {
        "own-solver": ("timestep", (20e-3, 5e-3, 1e-3)),
        "best": ("timestep", (20e-3, 5e-3, 1e-3)),
    }
    settings_type = ExudynSettings
    presets: Mapping[str, StepSettings] = {each.name: each for each in (OWN_SOLVER, BEST)}

    def world(self, scene: Scene, settings: StepSettings, step: float) -> World:
        assert isinstance(settings, ExudynSettings)
        return ExudynWorld(scene, settings, step)


EXUDYN = Exudyn()
