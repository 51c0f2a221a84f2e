"""changeDynamics with several options for a link changes the base instead of the link.

A body with one link. Printed: the first moments of inertia of base and link [kg m²] after setting
the link's to 0.3 together with a damping, and after setting 0.3 alone.
"""

from importlib.metadata import version

try:
    import pybullet as p
except ImportError:
    raise SystemExit("skipped: PyBullet is not installed") from None

p.connect(p.DIRECT)
for options in ({"linearDamping": 0.0}, {}):
    p.resetSimulation()
    body = p.createMultiBody(
        1.0, linkMasses=[0.1], linkCollisionShapeIndices=[-1], linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, 0]], linkOrientations=[[0, 0, 0, 1]],
        linkInertialFramePositions=[[0, 0, 0]], linkInertialFrameOrientations=[[0, 0, 0, 1]],
        linkParentIndices=[0], linkJointTypes=[p.JOINT_REVOLUTE], linkJointAxis=[[0, 0, 1]],
    )  # fmt: skip
    p.changeDynamics(body, -1, localInertiaDiagonal=[0.1, 0.1, 0.1])
    p.changeDynamics(body, 0, localInertiaDiagonal=[0.2, 0.2, 0.2])
    p.changeDynamics(body, 0, localInertiaDiagonal=[0.3, 0.3, 0.3], **options)
    name = "with a damping" if options else "alone"
    print(f"{name}, base:", p.getDynamicsInfo(body, -1)[2][0])
    print(f"{name}, link:", p.getDynamicsInfo(body, 0)[2][0])
print("expected: base 0.1 and link 0.3 for both")
print("version: PyBullet", version("pybullet"))
print("verdict: bug; bullet3 #3314")
