"""In continuous time a ball slips with a speed that is a fraction of the stiction tolerance.

A sphere rolls down a slope with friction 1, with RK3 at accuracy 1e-8. Printed: the slip after 0.5
s over the stiction tolerance vs, for two tolerances. So vs determines the error of rolling.
"""

import logging
from importlib.metadata import version

import numpy as np

try:
    from pydrake.geometry import HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody import plant as mp
    from pydrake.multibody.tree import SpatialInertia
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
    from pydrake.systems.framework import DiagramBuilder
except ImportError:
    raise SystemExit("skipped: Drake is not installed") from None

logging.getLogger("drake").setLevel(logging.ERROR)


def slip(stiction: float) -> float:
    builder = DiagramBuilder()
    plant, _ = mp.AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
    rough = mp.CoulombFriction(1.0, 1.0)
    ground = HalfSpace.MakePose(np.array([0, 0, 1.0]), np.zeros(3))
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "plane", rough)
    plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(1.0), "ball", rough)
    plant.mutable_gravity_field().set_gravity_vector([3, 0, -9])
    plant.Finalize()
    plant.set_stiction_tolerance(stiction)
    simulator = Simulator(builder.Build())
    config = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=1e-8, max_step_size=1e-3)
    ApplySimulatorConfig(config, simulator)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, [1, 0, 0, 0, 0, 0, 1])
    simulator.AdvanceTo(0.5)
    v = plant.GetVelocities(context)
    return float(abs(v[3] - v[1]))


for stiction in (1e-2, 1e-3):
    print(f"vs {stiction:g} m/s, slip over vs:", slip(stiction) / stiction)
print("expected: below 1, and the same number twice")
print("version: Drake", version("drake"))
print("verdict: documented; Drake's manual, Continuous Approximation of Coulomb Friction")
