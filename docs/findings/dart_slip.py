"""DART's default friction acts askew on a sliding ball; its law "Associated" throws the ball up.

A solid ball (1 kg, 0.1 m, friction 0.3) gets a velocity of 2 m/s and a spin. Friction is against
the slip u, which keeps its direction until it ends at t = 2|u|/(7μg). Printed for each law and
step: the angle of the whole pull to u, by how much 90 % of the slip ends too late, the rise [mm],
and the error of the path after 1 s, relative.
"""

from importlib.metadata import version

import numpy as np

try:
    import dartpy as dart
except ImportError:
    raise SystemExit("skipped: DART is not installed") from None

V, U, MU, G = np.array([2.0, 0]), np.array([1.5, 1]), 0.3, 9.81
SPEED = np.hypot(*U)
END, BRAKE = 2 * SPEED / (7 * MU * G), MU * G * U / SPEED
PATH = V * 1.0 - BRAKE * (END - END**2 / 2)
LABELS = "askew [deg]", "late [%]", "rise [mm]", "error"


def run(law: str, step: float) -> tuple[float, float, float, float]:
    shapes, world, rows = dart.dynamics, dart.simulation.World(), []
    world.setTimeStep(step)
    world.setGravity([0, 0, -G])
    if law != "default":
        friction = dart.constraint.NsgsFrictionSolver
        options = friction.Options()
        options.law = getattr(friction.Law, law)
        world.getConstraintSolver().setBoxedLcpSolver(friction(options))
    ground, ball = shapes.Skeleton("ground"), shapes.Skeleton("ball")
    _, plane = ground.createWeldJointAndBodyNodePair()
    ground.setMobile(False)
    _, body = ball.createFreeJointAndBodyNodePair()
    body.setInertia(shapes.Inertia(1.0, np.zeros(3), 0.004 * np.eye(3)))
    for owner, shape in ((plane, shapes.PlaneShape([0, 0, 1], 0)), (body, shapes.SphereShape(0.1))):
        node = owner.createShapeNode(shape)
        node.createCollisionAspect()
        node.createDynamicsAspect()
        node.getDynamicsAspect().setFrictionCoeff(MU)
    world.addSkeleton(ground)
    world.addSkeleton(ball)
    pose = dart.math.Isometry3()
    pose.set_translation([0, 0, 0.1])
    ball.setPositions(shapes.FreeJoint.convertToPositions(pose))
    ball.setVelocities([10, 5, 0, *V, 0])
    for _ in range(round(1 / step)):
        world.step()
        place, v = body.getTransform().translation(), body.getLinearVelocity()
        omega = body.getAngularVelocity()
        slip = np.hypot(v[0] - 0.1 * omega[1], v[1] + 0.1 * omega[0])
        rows.append([*place, *v[:2], slip])
    x, y, z, vx, vy, slip = np.array(rows).T
    half = int(END / 2 / step)
    lost = V - [vx[half], vy[half]]
    askew = np.degrees(np.arctan2(abs(lost[0] * U[1] - lost[1] * U[0]), lost @ U))
    late = step * np.sum(slip > 0.1 * SPEED) / (0.9 * END) - 1
    error = np.hypot(*([x[-1], y[-1]] - PATH)) / np.hypot(*PATH)
    return askew, 100 * late, 1e3 * (z.max() - 0.1), error


for law in ("default", "Associated", "Coulomb"):
    for step in (5e-3, 1e-3):
        for label, value in zip(LABELS, run(law, step), strict=True):
            print(f"{law}, {1e3 * step:g} ms, {label}:", value)
print("expected: 0, or values that go with the step")
print("version: DART", version("dartpy"))
print("verdict: documented; DART's NsgsFrictionSolver.hpp, see reports/dart_slip.md")
