"""Exudyn's sensors write at wrong times after a step has been shortened.

A mass of 1 kg falls on a stiff spring, at 10 ms with at most three iterations of Newton; if these
do not suffice, Exudyn shortens the step. A sensor writes every 10 ms. Printed: its number of rows
after 1 s, and the largest distance of their times from multiples of 10 ms [s].
"""

from importlib.metadata import version

import numpy as np

try:
    import exudyn
    from exudyn import itemInterface
except ImportError:
    raise SystemExit("skipped: Exudyn is not installed") from None

container = exudyn.SystemContainer()
system = container.AddSystem()
node = system.AddNode(itemInterface.NodePoint(referenceCoordinates=[0, 0, 1]))
system.AddObject(itemInterface.MassPoint(mass=1.0, nodeNumber=node))
point = system.AddMarker(itemInterface.MarkerNodePosition(nodeNumber=node))
ground = system.AddMarker(
    itemInterface.MarkerBodyPosition(bodyNumber=system.AddObject(itemInterface.ObjectGround()))
)
system.AddLoad(itemInterface.Force(markerNumber=point, loadVector=[0, 0, -10]))


def push(system: object, t: float, item: int, at: list[float], *_: object) -> list[float]:
    return [0.0, 0.0, 1e7 * min(0.0, at[2])]


spring = itemInterface.CartesianSpringDamper(
    markerNumbers=[ground, point], springForceUserFunction=push
)
system.AddObject(spring)
kind = exudyn.OutputVariableType.Position
sensor = system.AddSensor(
    itemInterface.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
)
system.Assemble()
settings = exudyn.SimulationSettings()
settings.timeIntegration.endTime = 1.0
settings.timeIntegration.numberOfSteps = 100
settings.timeIntegration.newton.maxIterations = 3
settings.timeIntegration.verboseMode = 0
settings.solution.sensors.writePeriod = 0.01
settings.solution.file.write = False
system.SolveDynamic(settings)
times = system.GetSensorStoredData(sensor)[:, 0]
print("rows:", len(times))
print("off:", np.abs(times - 0.01 * np.arange(len(times))).max())
print("expected: 101 rows and 0")
print("version: Exudyn", version("exudyn"))
print("verdict: open; no report found")
