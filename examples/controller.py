"""Damp the swing of a robot with a controller, in both engines: python examples/controller.py."""

import robotball as rb


def damp(reading: rb.Reading) -> dict[str, float]:
    """Roll at 2 rad/s, and lean the weight against the rate at which the frame swings."""
    return {"frame": -2.0, "pendulum1": 0.1 * float(reading.gyro[0])}


scene = rb.load_scene("steered_pendulum_robot").with_controller(rb.Controller(damp, period=0.01))
agreement = rb.compare(scene, 2.0, settings="accurate")
print(f"path {agreement.motion.path_length:.3f} m, {agreement.verdict}")
