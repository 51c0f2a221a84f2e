"""A fast rotor as a body of its own asks for short steps by Exudyn's default solver.

A symmetric body spins at 150 rad/s about its axis and is nudged across it; 1 s by two nodes and two
solvers, of which GeneralizedAlpha is the default. Its angular momentum is constant; the change of
it, relative, at two steps.
"""

from importlib.metadata import version

import numpy as np

try:
    import exudyn
    from exudyn.itemInterface import NodeRigidBodyEP, NodeRigidBodyRotVecLG, ObjectRigidBody
    from exudyn.rigidBodyUtilities import AngularVelocity2EulerParameters_t
except ImportError:
    raise SystemExit("skipped: Exudyn is not installed") from None

J, SPIN, UNIT = np.array([0.0115, 0.0115, 0.023]), np.array([3.0, 0, 150.0]), np.eye(4)[0]
NODES = {
    NodeRigidBodyEP: (UNIT, AngularVelocity2EulerParameters_t(SPIN, UNIT)),
    NodeRigidBodyRotVecLG: (np.zeros(3), SPIN),  # a rotation vector, stepped on the Lie group
}


def change(kind: type, solver: str, step: float) -> float:
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    turn, turning = ([0, 0, 0, *each] for each in NODES[kind])
    node = system.AddNode(kind(referenceCoordinates=turn, initialVelocities=turning))
    system.AddObject(ObjectRigidBody(mass=1.0, inertia=[*J, 0, 0, 0], nodeNumber=node))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = 1.0
    settings.timeIntegration.numberOfSteps = round(1.0 / step)
    settings.solution.file.write = False
    system.SolveDynamic(settings, solverType=getattr(exudyn.DynamicSolverType, solver))
    kinds = exudyn.OutputVariableType
    turned = np.reshape(system.GetNodeOutput(node, kinds.RotationMatrix), (3, 3))
    momentum = turned @ (J * system.GetNodeOutput(node, kinds.AngularVelocityLocal))
    return float(np.linalg.norm(momentum - J * SPIN) / np.linalg.norm(J * SPIN))


for kind in NODES:
    for solver in "GeneralizedAlpha", "TrapezoidalIndex2":
        for step in (2e-3, 5e-4):
            print(f"{kind.__name__}, {solver}, {step * 1e3:g} ms:", change(kind, solver, step))
print("expected: 0: nothing turns a free body")
print("version: Exudyn", version("exudyn"))
print("verdict: open; none found")
