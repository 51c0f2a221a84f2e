"""PhysX clips the initial angular velocity of a body at 100 rad/s without a warning.

A rotor on the hinge of a free body starts at 150 rad/s, or is driven there. Printed: its rate after
1 s at 1 ms [rad/s], by default and with the limit of the bodies raised.
"""

from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

try:
    import ovphysx
    import ovstage
    from ovphysx.samples.python_samples.schema_support import physx_schema_paths
except ImportError:
    raise SystemExit("skipped: ovphysx is not installed") from None

ovphysx.PhysX.set_cpu_mode(True)
ovphysx.set_global_config(ovphysx.types.GlobalConfigKey.NUM_THREADS, 0)
ovstage.population.register_usd_schemas([str(path) for path in physx_schema_paths()])
BOTH = """def PhysicsScene "scene" (
    prepend apiSchemas = ["PhysxSceneAPI"]
)
{{
    float physics:gravityMagnitude = 0
    bool physxScene:enableGPUDynamics = 0
    uniform token physxScene:broadphaseType = "MBP"
}}
def Xform "body" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI",
        "PhysicsArticulationRootAPI", "PhysxArticulationAPI"]
)
{{
    float physics:mass = 1
    float3 physics:diagonalInertia = (0.5, 0.7, 0.3)
    float physxRigidBody:angularDamping = 0
    float physxArticulation:sleepThreshold = 0
    {limit}
}}
def Xform "rotor" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI"]
)
{{
    float physics:mass = 0.1
    float3 physics:diagonalInertia = (0.02, 0.01, 0.01)
    vector3f physics:angularVelocity = ({rate}, 0, 0)
    float physxRigidBody:angularDamping = 0
    {limit}
}}
def PhysicsRevoluteJoint "hinge" (
    prepend apiSchemas = ["PhysicsDriveAPI:angular", "PhysicsJointStateAPI:angular"]
)
{{
    uniform token physics:axis = "X"
    rel physics:body0 = </body>
    rel physics:body1 = </rotor>
    uniform token drive:angular:physics:type = "force"
    float drive:angular:physics:damping = {gain}
    float drive:angular:physics:targetVelocity = 8594.367
    float state:angular:physics:velocity = {rate}
}}
"""


def started(prims):
    """Return PhysX with the prims, and their stage."""
    stage, physx = ovstage.Stage("stage"), ovphysx.PhysX()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.usda"
        file.write_text(f'#usda 1.0\n(\nmetersPerUnit = 1\nupAxis = "Z"\n)\n{prims}')
        domains = ovstage.PopulationDomain.ALL
        ovstage.population.open_usd(stage, str(file), ordinal=1, domains=domains)
    stage.advance_write_floor(ordinal=1).wait()
    physx.wait_task(physx.attach_ovstage(stage, read_ordinal=1))
    return physx, stage


def read(physx, kind, name):
    kind = getattr(ovphysx.types.SimObjectType, kind)
    with physx.read_sync(kind, [name]) as result:
        return np.concatenate([t.numpy().ravel() for g in result.groups for t in g.tensors])


def rate(limit="", rate=0.0, gain=0.0):
    physx, stage = started(BOTH.format(limit=limit, rate=np.degrees(rate), gain=gain))
    for _ in range(1000):
        physx.step_sync(1e-3)
    (rate,) = np.radians(read(physx, "ARTICULATION_JOINT", "jointVelocity"))
    physx.wait_task(physx.detach_ovstage())
    physx.destroy()
    stage.destroy()
    return float(rate)


print("started, default:", rate(rate=150.0))
print("started, raised:", rate("float physxRigidBody:maxAngularVelocity = 6e7", rate=150.0))
print("driven, default:", rate(gain=20.0))
print("expected: 150, or a warning")
print("version: ovphysx", version("ovphysx"))
print("verdict: documented; PhysX's USD schema, maxAngularVelocity")
