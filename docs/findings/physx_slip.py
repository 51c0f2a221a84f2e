"""In PhysX the slip of a rolling ball does not decrease with the step.

A ball of radius 1 m rolls down a slope for 1 s with friction 1, ten times the necessary value.
Printed: the largest slip [m/s], read every 10 ms, at three step lengths. A first-order method would
have a tenth at a tenth.
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
BALL = """def PhysicsScene "scene" (
    prepend apiSchemas = ["PhysxSceneAPI"]
)
{
    vector3f physics:gravityDirection = (1, 0, -3)
    float physics:gravityMagnitude = 9.486833
    bool physxScene:enableGPUDynamics = 0
    uniform token physxScene:broadphaseType = "MBP"
}
def Material "rough" (
    prepend apiSchemas = ["PhysicsMaterialAPI"]
)
{
    float physics:staticFriction = 1
    float physics:dynamicFriction = 1
}
def Plane "plane" (
    prepend apiSchemas = ["PhysicsCollisionAPI", "MaterialBindingAPI"]
)
{
    uniform token axis = "Z"
    rel material:binding:physics = </rough>
}
def Sphere "ball" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI",
        "PhysicsCollisionAPI", "MaterialBindingAPI"]
)
{
    double radius = 1
    float physics:mass = 1
    float3 physics:diagonalInertia = (0.4, 0.4, 0.4)
    float physxRigidBody:angularDamping = 0
    float physxRigidBody:sleepThreshold = 0
    rel material:binding:physics = </rough>
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
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


def slip(step):
    (physx, stage), largest = started(BALL), 0.0
    for _ in range(100):
        for _ in range(round(0.01 / step)):
            physx.step_sync(step)
        velocity, omega = (
            read(physx, "RIGID_BODY", f"{kind}Velocity") for kind in ("linear", "angular")
        )
        largest = max(largest, abs(float(velocity[0] - omega[1])))
    physx.wait_task(physx.detach_ovstage())
    physx.destroy()
    stage.destroy()
    return largest


for step in (1e-2, 1e-3, 1e-4):
    print(f"{step * 1e3:g} ms:", slip(step))
print("expected: a tenth of the slip at a tenth of the step")
print("version: ovphysx", version("ovphysx"))
print("verdict: open; no report found, see reports/physx_slip.md")
