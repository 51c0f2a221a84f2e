"""The ball of Fig. 12 in Exudyn as one body: generalised-α, Euler parameters, steps of 1 ms.

The script adds the torque of the rotors and a velocity constraint of rolling.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp

try:
    import exudyn
    from exudyn import utilities as use
except ImportError:
    raise SystemExit("skipped: Exudyn is not installed") from None

# A ball of radius 1 m and 0.9 kg with a frame that turns about z at 2 rad/s. M, K and the inertia
# in the frame's axes, SI units.
E, A, K, OMEGA = np.eye(3), np.diag([0.7, 0.6, 0.8]), np.array([2.0, 2, 0]), np.array([0, 0, 2.0])
TIMES, level, h = np.linspace(0, 10, 501), np.r_[np.sin(0.6), np.cos(0.6), 0], np.sqrt(1 - 0.72**2)
M, GAMMA = 5 * (h * level + 0.72 * E[2]), 0.72 * level - h * E[2]
ROTATION = np.array([-M, np.cross(M, GAMMA), 5 * GAMMA]) / 5  # from frame to world axes


def rates(t, y):
    """Return the rates of M, the world's axes and the contact point, from the paper's (3.2)."""
    M, alpha, beta, gamma = axes = y[:12].reshape(4, 3)
    f = gamma @ A @ gamma
    w = A @ (np.cross(M, A @ gamma) + (OMEGA + A @ K) @ gamma * gamma - f * K) / f
    return [*np.cross(axes, w).ravel(), beta @ (w - OMEGA), -alpha @ (w - OMEGA)]


start = np.array([*M, *ROTATION.ravel(), 0, 0])
truth = solve_ivp(rates, (0, 10), start, "DOP853", TIMES, rtol=1e-11, atol=1e-11).y[12:].T
velocity = np.array([*rates(0, start)[12:], 0])
omega = np.cross([0, 0, 1], velocity)  # of the shell, which does not spin

ON = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0], [0, 0, 1]])  # ω to (-ω×e_z, (ω, e_z))


def rows(q):
    """Return the matrix from a node's rates to v - ω×e_z and (ω, e_z)."""
    return np.hstack([np.eye(4, 3), ON @ use.EulerParameters2G(q[3:])])


system, p = exudyn.SystemContainer().AddSystem(), use.RotationMatrix2EulerParameters(ROTATION)
p_rate = np.transpose(use.EulerParameters2G(p)) @ (omega + ROTATION @ OMEGA) / 4
start = {"referenceCoordinates": [0, 0, 1, *p], "initialVelocities": [*velocity, *p_rate]}
node, out = system.AddNode(use.NodeRigidBodyEP(**start)), exudyn.OutputVariableType
moments = np.diag(np.linalg.inv(A) - 0.9 * E)
ball = use.ObjectRigidBody(mass=0.9, inertia=[*moments, 0, 0, 0], nodeNumber=node)
on = {"markerNumber": system.AddMarker(use.MarkerBodyRigid(bodyNumber=system.AddObject(ball)))}
system.AddLoad(use.LoadForceVector(**on, loadVector=[0, 0, -0.9 * 9.81]))
# k of the rotor, and of the shell relative to the frame, causes the torque k×ω.
on["loadVectorUserFunction"] = lambda system, t, load: np.cross(
    K + 0.9 * OMEGA, system.GetNodeOutput(node, out.AngularVelocityLocal)
)
system.AddLoad(use.LoadTorqueVector(**on, bodyFixed=True))
ends = system.AddNode(use.NodePointGround()), node
rolling = use.ObjectConnectorCoordinateVector(
    markerNumbers=[system.AddMarker(use.MarkerNodeCoordinates(nodeNumber=i)) for i in ends],
    scalingMarker0=np.zeros((4, 3)), scalingMarker1=np.zeros((4, 7)), velocityLevel=True,
    constraintUserFunction=lambda system, t, item, q, q_t, _: (
        rows(q) @ q_t - ON @ use.EulerParameters2RotationMatrix(q[3:]) @ OMEGA
    ),
    jacobianUserFunction=lambda system, t, item, q, *_: exudyn.MatrixContainer(rows(q)),
)  # fmt: skip
system.AddObject(rolling)
read = use.SensorNode(nodeNumber=node, outputVariableType=out.Position, storeInternal=True)
sensor = system.AddSensor(read)
system.Assemble()
settings = exudyn.SimulationSettings()
settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 10, 10_000
settings.solution.sensors.writePeriod, settings.solution.file.write = 0.02, False
system.SolveDynamic(settings)
path = system.GetSensorStoredData(sensor)[:, 1:3]
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: Exudyn", version("exudyn"))
