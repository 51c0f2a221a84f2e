"""Rapier's gyroscopic correction adds 1e-7 to a body's momentum in every substep.

A free sphere needs no correction: its angular velocity is constant. Printed: the relative change of
its momentum after 10 s at three step lengths, with four substeps each, and without the correction.
"""

from importlib.metadata import version

import numpy as np

try:
    import rapier3d as rapier
except ImportError:
    raise SystemExit("skipped: Rapier is not installed") from None

OMEGA = (0.5, 0.7, 2.0)


def change(step: float, corrected: bool = True) -> float:
    world = rapier.PhysicsWorld()
    world.integration_parameters.dt = step
    sphere = rapier.MassProperties((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0))
    body = rapier.RigidBody.dynamic().additional_mass_properties(sphere).angvel(OMEGA)
    handle = world.add_body(body.gyroscopic_forces(corrected).can_sleep(False))
    for _ in range(round(10 / step)):
        world.step()
    return float(np.linalg.norm(world.rigid_bodies[handle].angvel.to_tuple())) / norm - 1


norm = float(np.linalg.norm(OMEGA))
for step in (1e-2, 1e-3, 1e-4):
    print(f"{step * 1e3:g} ms:", change(step))
print("without correction, 0.1 ms:", change(1e-4, corrected=False))
print("expected: 0, because the correction is to preserve angular momentum")
print("version: Rapier", version("rapier3d"))
print("verdict: bug; no report found, see reports/rapier_gyroscopic.md")
