"""Exudyn's sensors write at other times than their period says, once a step was shortened.

A point of 1 kg falls on a stiff spring, in steps of 10 ms and with three iterations of Newton at
most; where they do not suffice Exudyn shortens the step. A sensor writes every 10 ms: how many rows
it has after 1 s, and how far their times are from the multiples of its period [s].
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
print("expected: 0: a row every 10 ms, as asked for")
print("version: Exudyn", version("exudyn"))
print("verdict: open; none found")
