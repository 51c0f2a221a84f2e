"""Pinocchio's contact holds a point of the body, and a rolling ball touches with ever another one.

A solid ball of radius a = 1 m rolls about y at 2 rad/s and spins at 3 rad/s. By the equations it
goes on as it is. Printed is the acceleration of its centre under a 3D contact at its lowest point
[m/s²]: the point of the body that is there has a (ω² e_z - ω_z ω), which the contact takes away.
"""

from importlib.metadata import version

import numpy as np

try:
    import pinocchio as pin
except ImportError:
    raise SystemExit("skipped: Pinocchio is not installed") from None

model = pin.Model()
joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 1.0), pin.SE3.Identity())
data = model.createData()
lowest = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
kind, axes = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
contact = pin.RigidConstraintModel(kind, model, joint, lowest, axes)
contacts, held = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
contacts.append(contact)
held.append(contact.createData())
pin.initConstraintDynamics(model, data, contacts, held)
turning = np.array([0, 2.0, 3.0])
q, v = pin.neutral(model), np.concatenate([np.cross(turning, [0, 0, 1]), turning])
settings = pin.ProximalSettings(1e-12, 0, 10)
rate = pin.constraintDynamics(model, data, q, v, np.zeros(6), contacts, held, settings)
# Velocities are in the ball's axes: those of the world here, but for their turning.
along, across, up = rate[:3] + np.cross(turning, v[:3])
print("along:", along)
print("across:", across)
print("up:", up)
print("expected: 0 along, across and up")
print("version: Pinocchio", version("pin"))
print("verdict: open; none found")
