"""A fast rotor as a separate body needs short steps with Exudyn's default solver.

A symmetric body spins at 150 rad/s about its axis, with 3 rad/s across it, for 1 s with two nodes
and two solvers; GeneralizedAlpha is the default. Its angular momentum is constant. Printed: the
relative change at two step lengths.
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
    NodeRigidBodyRotVecLG: (np.zeros(3), SPIN),  # a rotation vector on the Lie group
}


def change(kind: type, solver: str, step: float) -> float:
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    position, velocity = ([0, 0, 0, *rotation] for rotation in NODES[kind])
    node = system.AddNode(kind(referenceCoordinates=position, initialVelocities=velocity))
    system.AddObject(ObjectRigidBody(mass=1.0, inertia=[*J, 0, 0, 0], nodeNumber=node))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = 1.0
    settings.timeIntegration.numberOfSteps = round(1.0 / step)
    settings.solution.file.write = False
    system.SolveDynamic(settings, solverType=getattr(exudyn.DynamicSolverType, solver))
    kinds = exudyn.OutputVariableType
    R = np.reshape(system.GetNodeOutput(node, kinds.RotationMatrix), (3, 3))
    momentum = R @ (J * system.GetNodeOutput(node, kinds.AngularVelocityLocal))
    return float(np.linalg.norm(momentum - J * SPIN) / np.linalg.norm(J * SPIN))


for kind in NODES:
    for solver in "GeneralizedAlpha", "TrapezoidalIndex2":
        for step in (2e-3, 5e-4):
            print(f"{kind.__name__}, {solver}, {step * 1e3:g} ms:", change(kind, solver, step))
print("expected: 0, because no torque acts on a free body")
print("version: Exudyn", version("exudyn"))
print("verdict: open; no report found")
