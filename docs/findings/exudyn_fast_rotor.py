"""A fast rotor as a body of its own asks for short steps: Euler parameters turn with it.

A symmetric body spins at 150 rad/s about its axis and is nudged across it; 1 s by Exudyn's default
solver. Its angular momentum is constant; the largest change of it, relative, at two steps.
"""

from importlib.metadata import version

import numpy as np

try:
    import exudyn
    from exudyn.itemInterface import NodeRigidBodyEP, ObjectRigidBody
    from exudyn.rigidBodyUtilities import AngularVelocity2EulerParameters_t
except ImportError:
    raise SystemExit("skipped: Exudyn is not installed") from None

J = np.array([0.0115, 0.0115, 0.023])


def change(step: float) -> float:
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    start, spin = np.array([1.0, 0, 0, 0]), np.array([3.0, 0, 150.0])
    turning = AngularVelocity2EulerParameters_t(spin, start)
    node = system.AddNode(
        NodeRigidBodyEP(
            referenceCoordinates=[0, 0, 0, *start], initialVelocities=[0, 0, 0, *turning]
        )
    )
    body = ObjectRigidBody(physicsMass=1.0, physicsInertia=[*J, 0, 0, 0], nodeNumber=node)
    system.AddObject(body)
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = 1.0
    settings.timeIntegration.numberOfSteps = round(1.0 / step)
    settings.solution.file.write = False
    system.SolveDynamic(settings)
    kinds = exudyn.OutputVariableType
    turn = np.reshape(system.GetNodeOutput(node, kinds.RotationMatrix), (3, 3))
    momentum = turn @ (J * system.GetNodeOutput(node, kinds.AngularVelocityLocal))
    return float(np.linalg.norm(momentum - J * spin) / np.linalg.norm(J * spin))


for step in (2e-3, 5e-4):
    print(f"{step * 1e3:g} ms:", change(step))
print("expected: 0: nothing turns a free body")
print("version: Exudyn", version("exudyn"))
print("verdict: open; none found")
