"""Build a ball in Python, and compare MuJoCo with the equations: python examples/own_ball.py."""

import numpy as np

import robotball as rb

shell = rb.Shell(0.2, 1.0, 0.03, 0.03, axis=np.array([0.0, 1.0, 0.0]))
frame = rb.Hinge(rb.Frame(2.0, 0.01 * np.eye(3)), command=-2.0)
wheel = rb.Hinge(rb.Rotor(0.3, 4e-4, 2e-4, axis=np.array([1.0, 0.0, 0.0])), command=80.0)
start = rb.Start(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.05, 0.0, 0.0]))
ball, title = rb.Ball(shell, (frame, wheel)), "A wheel on a frame"
scene = rb.Scene("mine", title, "", ball, "rubber", start, duration=5.0)
agreement = rb.compare(scene)
print(f"path {agreement.theory.path_length:.3f} m, {agreement.verdict}")
