"""Rapier limits every body to 45° per step, without a warning.

A free sphere starts at 100 rad/s about z. Printed: its angular velocity after one step of 1/60 s.
"""

from importlib.metadata import version

try:
    import rapier3d as rapier
except ImportError:
    raise SystemExit("skipped: Rapier is not installed") from None


def rate(fast: bool) -> float:
    world = rapier.PhysicsWorld()
    sphere = rapier.MassProperties((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0))
    body = rapier.RigidBody.dynamic().additional_mass_properties(sphere).angvel((0.0, 0.0, 100.0))
    handle = world.add_body(body.allow_fast_rotation(fast))
    world.step()
    return float(world.rigid_bodies[handle].angvel.z)


print("default:", rate(fast=False))
print("allowed:", rate(fast=True))
print("expected: 100, because no torque acts on a free body")
print("version: Rapier", version("rapier3d"))
print("verdict: documented; Rapier's API, set_allow_fast_rotation")
