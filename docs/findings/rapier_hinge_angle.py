"""A hinge of a Rapier multibody does not turn at its rate: its angle is rounded in every substep.

A hinge between two free bodies turns at 2 rad/s for 10 s, with four substeps per step. Printed: the
relative error of its angle at three step lengths.
"""

from importlib.metadata import version

try:
    import rapier3d as rapier
except ImportError:
    raise SystemExit("skipped: Rapier is not installed") from None
RATE = 2.0  # rad/s


def error(step: float) -> float:
    world, origin = rapier.PhysicsWorld(), (0.0, 0.0, 0.0)
    world.integration_parameters.dt = step
    ends = []
    for size in (1e6, 1.0):
        sphere = rapier.MassProperties(origin, size, (size, size, size))
        body = rapier.RigidBody.dynamic().additional_mass_properties(sphere)
        ends.append(world.add_body(body.can_sleep(False).allow_fast_rotation(True)))
    hinge = rapier.RevoluteJointBuilder((0.0, 0.0, 1.0)).build()
    handle = world.multibody_joints.insert(*ends, hinge)
    both = world.multibody_joints.multibody(handle)
    both.set_damping([0.0] * 7)
    both.set_generalized_velocity([0.0] * 6 + [RATE])
    for _ in range(round(10 / step)):
        world.step()
    assert abs(both.generalized_velocity()[-1] / RATE - 1) < 1e-6
    return float(both.generalized_position()[-1]) / (10 * RATE) - 1


for step in (1e-2, 1e-3, 1e-4):
    print(f"{step * 1e3:g} ms:", error(step))
print("expected: 1e-7, the precision of the rate, or less with shorter steps")
print("version: Rapier", version("rapier3d"))
print("verdict: open; no report found, see reports/rapier_hinge_angle.md")
